//! Goals of nodes of ROS: of `navigate_to_pose`, whose bookkeeping is [`Goals`](xtb_ros2::action::Goals), and of RViz's
//! tool. A goal has the same id here and there.

use super::{Client, held_by, verdict};
use crate::ros2::callbacks::{Holder, Purpose};
use xtb_control::frames::MapPose;
use xtb_protocol::Uuid;
use xtb_protocol::messages::texts::for_robot;
use xtb_protocol::messages::{Body, LinkLoss, Outcome, Reply, RobotState, Via};
use xtb_ros2::Gid;
use xtb_ros2::action::Answer;
use xtb_ros2::convert::{level, map_pose};
use xtb_ros2::types::{CancelGoal, GetResult, GoalId, Level, PoseStamped, SendGoal, SendGoalResponse};
use xtb_ros2_node::Call;

/// Longest time of a goal that goes on without its client: none of these does.
const FINISH_S: f64 = 300.0;

impl Client {
    pub(super) async fn goal_pose(&mut self, gid: Gid, pose: &PoseStamped) {
        let id = Uuid::new_v4().into_bytes();
        if self.navigate(gid, id, pose).await.is_ok() {
            self.status().await;
        }
    }

    pub(super) async fn send_goal(&mut self, call: Call<SendGoal>) {
        let (id, gid) = (call.request.goal_id, call.client());
        let accepted = self.goals.is_new(&id) && self.navigate(gid, id, &call.request.pose).await.is_ok();
        let stamp = self.now();
        if accepted && let Ok(answers) = self.goals.accept(&stamp, id) {
            send(answers).await;
        }
        call.reply(&SendGoalResponse { accepted, stamp }).await;
        self.status().await;
    }

    pub(super) async fn get_result(&mut self, call: Call<GetResult>) {
        let id = call.request.goal_id;
        send(self.goals.wait(&id, call)).await;
    }

    pub(super) async fn cancel_goal(&mut self, call: Call<CancelGoal>) {
        let (response, id) = self.goals.cancel(&call.request);
        if let Some(id) = id {
            let reply = self.ask(Uuid::new_v4(), Body::Cancel { goal: Uuid::from_bytes(id) }).await;
            let _ = self.told(&reply, "");
        }
        call.reply(&response).await;
        self.status().await;
    }

    /// Sends the robot there; `Err` = refused, and noted.
    async fn navigate(&mut self, gid: Gid, id: GoalId, pose: &PoseStamped) -> Result<(), ()> {
        let by = self.caller(&gid);
        let place = match map_pose(&pose.header, &pose.pose) {
            Ok(place) => place,
            Err(error) => {
                self.note(format!("goal of {}: {error}", by.node));
                return Err(());
            }
        };
        let purpose = Purpose::Goal { id, client: gid };
        let holder = self.callbacks.lock().holder.clone();
        let reply = match holder {
            Some(holder) if holder.node == by.node => Reply::done(Uuid::nil(), Default::default()),
            Some(Holder { purpose: Purpose::Commands, node, .. }) => held_by(&node),
            Some(_) => {
                self.release_lease().await;
                self.acquire(&by, false, purpose).await
            }
            None => self.acquire(&by, false, purpose).await,
        };
        let reply = if matches!(reply.result, Outcome::Ok(_)) { self.goto(id, &place).await } else { reply };
        if let Outcome::Error(_) = reply.result {
            let verdict = verdict(&reply, "");
            self.note(format!("goal of {}: {}", by.node, verdict.message));
            // The lease that was acquired for it alone.
            let present = self.callbacks.lock().holder.as_ref().map(|holder| holder.purpose);
            if present == Some(purpose) {
                self.release_lease().await;
            }
            return Err(());
        }
        let mut shared = self.callbacks.lock();
        shared.commands.end();
        if let Some(holder) = &mut shared.holder {
            holder.purpose = purpose;
        }
        Ok(())
    }

    async fn goto(&self, id: GoalId, place: &MapPose) -> Reply {
        let body = Body::Goto {
            x_m: place.x_m,
            y_m: place.y_m,
            yaw_rad: Some(place.yaw_rad),
            via: Some(Via::Planned),
            on_link_loss: LinkLoss::Halt,
            finish_s: FINISH_S,
        };
        self.ask(Uuid::from_bytes(id), body).await
    }

    /// What the robot says of the goals; the lease of one that has ended is released.
    pub(super) async fn follow_goals(&mut self, state: &RobotState) {
        let of = |id: &GoalId| {
            let id = Uuid::from_bytes(*id);
            let present = state.goal.as_ref().filter(|goal| goal.id == id).map(|goal| goal.status);
            present.or_else(|| state.ended_goals.iter().find(|goal| goal.id == id).map(|goal| goal.status))
        };
        if let Some((id, before)) = self.goals.active()
            && let Some(status) = of(&id)
        {
            let answers = self.goals.progress(&self.now(), &id, status, &why(state));
            send(answers).await;
            if self.goals.active().map(|(_, now)| now) != Some(before) {
                self.status().await;
            }
        }
        let purpose = self.callbacks.lock().holder.as_ref().map(|holder| holder.purpose);
        if let Some(Purpose::Goal { id, .. }) = purpose
            && of(&id).is_some_and(|status| status.is_final())
        {
            self.release_lease().await;
        }
    }

    /// How all goals stand, for those who look.
    pub(super) async fn status(&self) {
        self.publishers.status(&self.goals.status()).await;
    }
}

/// Answers those who have waited.
pub(super) async fn send(answers: impl IntoIterator<Item = Answer<Call<GetResult>>>) {
    for Answer { to, response } in answers {
        to.reply(&response).await;
    }
}

/// Why the goal is as it is, and what to do about it.
fn why(state: &RobotState) -> String {
    let Some(goal) = &state.goal else { return String::new() };
    let reason = goal.reason.clone().unwrap_or_else(|| goal.status.text().to_owned());
    let remedy = state.stopped_because.iter().find_map(|reason| reason.remedy());
    match remedy.filter(|_| level(state) != Level::Ok || goal.reason.is_some()) {
        Some(remedy) => format!("{reason}; {}", for_robot(remedy, &state.robot)),
        None => reason,
    }
}
