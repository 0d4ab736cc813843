//! The pilot: asks for the lease in the names of nodes, sends their goals, keeps the lease as long as somebody needs
//! it and gives it back. One request after the other; each is answered within a turn of the control loop.
//!
//! | asks | takes the lease from |
//! | --- | --- |
//! | `cmd_vel` | nobody: it must be free, or held by the same node, or by `take_control` |
//! | `navigate_to_pose`, `goal_pose` | another goal of ROS: as with Nav2 the newer goal counts |
//! | `reset`, `initialpose` | nobody; it is borrowed for the one request |
//! | `take_control` | anybody |

use super::Stamps;
use super::front::{Event, Front, Holder, Purpose, verdict};
use super::publish::{Notes, Publishers};
use crate::snapshot::Snapshot;
use std::sync::Arc;
use std::time::{Duration, Instant};
use xtb_control::Stamp;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::texts::for_robot;
use xtb_protocol::messages::{Body, ErrorBody, LinkLoss, Outcome, Reply, Request, RobotState, Via};
use xtb_protocol::{Name, Uuid};
use xtb_ros2::Gid;
use xtb_ros2::action::{Answer, Goals};
use xtb_ros2::command::HeldBack;
use xtb_ros2::convert::{level, map_pose};
use xtb_ros2::types::{GetResult, GoalId, Level, PoseStamped, SendGoalResponse, Time, Trigger, Verdict};
use xtb_ros2_node::Call;

/// Who has called `take_control` has so long to command.
const TAKEN_FOR: Duration = Duration::from_secs(10);
/// A refusal is told in `/diagnostics` for so long.
const TOLD_FOR: Duration = Duration::from_secs(10);
/// Longest time of a goal that goes on without its client: none of these does.
const FINISH_S: f64 = 300.0;

/// A node, as it asks for something.
struct Asker {
    client: Name,
    node: String,
}

/// See the module's documentation.
pub(super) struct Pilot {
    front: Arc<Front>,
    publishers: Publishers,
    stamps: Stamps,
    goals: Goals<Call<GetResult>>,
    /// The last thing that was refused, and when.
    refused: Option<(String, Instant)>,
    state: Option<RobotState>,
}

impl Pilot {
    pub(super) fn new(front: Arc<Front>, publishers: Publishers, stamps: Stamps) -> Self {
        Self { front, publishers, stamps, goals: Goals::default(), refused: None, state: None }
    }

    /// What stays true is published once.
    pub(super) async fn begin(&mut self) {
        self.publishers.begin(&self.now()).await;
        self.publishers.status(&self.goals.status()).await;
    }

    fn now(&self) -> Time {
        self.stamps.at(self.stamps.clock.now().ms())
    }

    /// Carries out what was asked.
    pub(super) async fn handle(&mut self, event: Event) {
        match event {
            Event::Wanted(gid) => self.drive_for(gid).await,
            Event::Vanished => {
                self.note("the node that drove, or had sent the goal, is gone: the robot stands".into());
                self.give_back().await;
            }
            Event::Reset(call) => {
                let by = self.asker(&call.client());
                let reply = self.borrow(&by, Body::Reset { latch: None }).await;
                call.reply(&self.told(&reply, "latches reset; the robot stands until a new command")).await;
            }
            Event::Take(call) => self.take(call).await,
            Event::Release(call) => self.release(call).await,
            Event::InitialPose(gid, message) => match map_pose(&message.header, &message.pose.pose) {
                Ok(MapPose { x_m, y_m, yaw_rad }) => {
                    let reply = self.borrow(&self.asker(&gid), Body::SetPose { x_m, y_m, yaw_rad }).await;
                    let _ = self.told(&reply, "");
                }
                Err(error) => self.note(format!("initialpose: {error}")),
            },
            Event::GoalPose(gid, pose) => {
                let id = Uuid::new_v4().into_bytes();
                if self.go(gid, id, &pose).await.is_ok() {
                    self.status().await;
                }
            }
            Event::SendGoal(call) => {
                let (id, gid) = (call.request.goal_id, call.client());
                let accepted = self.goals.is_new(&id) && self.go(gid, id, &call.request.pose).await.is_ok();
                let stamp = self.now();
                if accepted && let Ok(answers) = self.goals.accept(&stamp, id) {
                    send(answers).await;
                }
                call.reply(&SendGoalResponse { accepted, stamp }).await;
                self.status().await;
            }
            Event::GetResult(call) => {
                let id = call.request.goal_id;
                send(self.goals.wait(&id, call)).await;
            }
            Event::Cancel(call) => {
                let (response, id) = self.goals.cancel(&call.request);
                if let Some(id) = id {
                    let body = Body::Cancel { goal: Uuid::from_bytes(id) };
                    let reply = self.ask(body).await;
                    let _ = self.told(&reply, "");
                }
                call.reply(&response).await;
                self.status().await;
            }
        }
    }

    fn asker(&self, gid: &Gid) -> Asker {
        let (client, node) = self.front.lock().client(gid);
        Asker { client, node }
    }

    /// In the name of whoever has the lease, with it; without one the robot refuses.
    async fn ask(&self, body: Body) -> Reply {
        let holder = self.front.lock().holder.clone();
        let Some(Holder { client, operator, .. }) = holder else {
            return no_lease();
        };
        self.ask_as(&client, operator.lease(), body).await
    }

    /// The same without an answer: what came of it, the state shows.
    fn tell(&self, body: Body) {
        let holder = self.front.lock().holder.clone();
        if let Some(Holder { client, operator, .. }) = holder {
            let request = Request { id: Uuid::new_v4(), lease: operator.lease(), body };
            self.front.inbox.tell(client, request);
        }
    }

    async fn ask_as(&self, client: &Name, lease: Option<xtb_protocol::messages::Lease>, body: Body) -> Reply {
        let request = Request { id: Uuid::new_v4(), lease, body };
        self.front.inbox.ask(client, request).await
    }

    /// Asks for the lease; granted, it is held for this purpose.
    async fn acquire(&self, by: &Asker, take: bool, purpose: Purpose) -> Reply {
        let reply = self.ask_as(&by.client, None, Body::Acquire { take }).await;
        if matches!(reply.result, Outcome::Ok(_)) {
            let mut operator = xtb_robot::Operator::default();
            operator.replied(Stamp::ZERO, &reply);
            let known_after = self.front.latest_seq();
            self.front.lock().holder = Some(Holder {
                client: by.client.clone(),
                node: by.node.clone(),
                purpose,
                operator,
                known_after,
            });
        }
        reply
    }

    /// Gives the lease back, which ends what runs under it; whoever drove has to let go.
    async fn give_back(&mut self) {
        if self.front.lock().holder.is_some() {
            let reply = self.ask(Body::Release {}).await;
            if let Outcome::Error(error) = &reply.result {
                tracing::debug!("release: {}", error.message);
            }
        }
        let mut shared = self.front.lock();
        shared.holder = None;
        shared.commands.end();
    }

    /// A publisher asks for motion, and none drives.
    async fn drive_for(&mut self, gid: Gid) {
        let by = self.asker(&gid);
        let (holder, driver) = {
            let shared = self.front.lock();
            (shared.holder.clone(), shared.commands.driver())
        };
        if driver.is_some() {
            return self.front.lock().commands.refused(&gid);
        }
        // Its own lease, and one that was taken for whoever commands next, is given to it.
        let reply = match holder {
            Some(holder) if holder.client == by.client => {
                if let Some(holder) = &mut self.front.lock().holder {
                    holder.purpose = Purpose::Commands;
                }
                Reply::done(Uuid::nil(), Default::default())
            }
            Some(Holder { purpose: Purpose::Taken { .. }, .. }) => {
                let _ = self.ask(Body::Release {}).await;
                self.front.lock().holder = None;
                self.acquire(&by, false, Purpose::Commands).await
            }
            Some(holder) => held_by(&holder.node),
            None => self.acquire(&by, false, Purpose::Commands).await,
        };
        let granted = matches!(reply.result, Outcome::Ok(_));
        {
            let commands = &mut self.front.lock().commands;
            if granted { commands.granted(gid) } else { commands.refused(&gid) }
        }
        if !granted {
            let verdict = verdict(&reply, "");
            self.note(format!("cmd_vel of {}: {}", by.node, verdict.message));
        }
    }

    /// `take_control`: from anybody, for whoever commands next.
    async fn take(&mut self, call: Call<Trigger>) {
        let by = self.asker(&call.client());
        let purpose = Purpose::Taken { until: Instant::now() + TAKEN_FOR };
        let reply = self.acquire(&by, true, purpose).await;
        if matches!(reply.result, Outcome::Ok(_)) {
            self.front.lock().commands.open();
        }
        let done = format!(
            "control is taken; within {} s the next node that publishes cmd_vel, or sends a goal, has it",
            TAKEN_FOR.as_secs()
        );
        call.reply(&self.told(&reply, &done)).await;
    }

    async fn release(&mut self, call: Call<Trigger>) {
        let holds = self.front.lock().holder.is_some();
        self.give_back().await;
        let other = self.state.as_ref().and_then(|state| state.lease.as_ref()).map(|lease| &lease.holder);
        call.reply(&match (holds, other) {
            (true, _) => Verdict::done("control is released; whoever held a stick has to let go first"),
            (false, None) => Verdict::done("nobody held control"),
            (false, Some(other)) => Verdict::refused(format!("{other} holds control, and no node of ROS")),
        })
        .await;
    }

    /// One request that needs the lease only for itself.
    async fn borrow(&mut self, by: &Asker, body: Body) -> Reply {
        if self.front.lock().holder.is_some() {
            return self.ask(body).await;
        }
        let until = Instant::now();
        let reply = self.acquire(by, false, Purpose::Taken { until }).await;
        if matches!(reply.result, Outcome::Error(_)) {
            return reply;
        }
        let reply = self.ask(body).await;
        self.give_back().await;
        reply
    }

    /// Sends the robot there; `Err` = refused, and noted.
    async fn go(&mut self, gid: Gid, id: GoalId, pose: &PoseStamped) -> Result<(), ()> {
        let by = self.asker(&gid);
        let place = match map_pose(&pose.header, &pose.pose) {
            Ok(place) => place,
            Err(error) => {
                self.note(format!("goal of {}: {error}", by.node));
                return Err(());
            }
        };
        let purpose = Purpose::Goal { id, client: gid };
        let holder = self.front.lock().holder.clone();
        let reply = match holder {
            Some(holder) if holder.client == by.client => Reply::done(Uuid::nil(), Default::default()),
            Some(Holder { purpose: Purpose::Commands, node, .. }) => held_by(&node),
            Some(_) => {
                self.give_back().await;
                self.acquire(&by, false, purpose).await
            }
            None => self.acquire(&by, false, purpose).await,
        };
        let reply = if matches!(reply.result, Outcome::Ok(_)) { self.goto(id, &place).await } else { reply };
        if let Outcome::Error(_) = reply.result {
            let idle = self.goals.active().is_none();
            let verdict = verdict(&reply, "");
            self.note(format!("goal of {}: {}", by.node, verdict.message));
            let purpose_of = |holder: &Holder| holder.purpose;
            let present = self.front.lock().holder.as_ref().map(purpose_of);
            if idle && present == Some(purpose) {
                self.give_back().await;
            }
            return Err(());
        }
        let mut shared = self.front.lock();
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
        let holder = self.front.lock().holder.clone();
        let Some(Holder { client, operator, .. }) = holder else { return no_lease() };
        let request = Request { id: Uuid::from_bytes(id), lease: operator.lease(), body };
        self.front.inbox.ask(&client, request).await
    }

    /// Keeps the lease for a goal or for whoever has taken control.
    pub(super) async fn keep(&mut self) {
        let now = self.stamps.clock.now();
        let body = {
            let mut shared = self.front.lock();
            shared.holder.as_mut().and_then(|holder| match holder.purpose {
                Purpose::Commands => None, // Its commands do.
                Purpose::Taken { until } if Instant::now() >= until => Some(Body::Release {}),
                Purpose::Goal { .. } | Purpose::Taken { .. } => holder.operator.retain(now),
            })
        };
        match body {
            Some(Body::Release {}) => self.give_back().await,
            // Its answer is not waited for: a slow link must not hold up the next one.
            Some(body) => self.tell(body),
            None => {}
        }
    }

    /// What the control loop shows: goals go on, a lost lease is lost, everything is published.
    pub(super) async fn see(&mut self, snapshot: &Snapshot, malformed: u64) {
        let state = &snapshot.state;
        self.state = Some(state.clone());
        let lost = {
            let mut shared = self.front.lock();
            let lost = shared.holder.take_if(|holder| {
                let has = state.lease.as_ref().is_some_and(|lease| lease.holder == holder.client);
                state.seq > holder.known_after && !has
            });
            if lost.is_some() {
                shared.commands.end();
            }
            lost
        };
        if let (Some(holder), Some(other)) = (lost, &state.lease) {
            self.note(format!("{} has lost control to {}", holder.node, other.holder));
        }
        self.follow_goals(state).await;
        let notes = self.notes(malformed);
        self.publishers.snapshot(snapshot, &self.stamps.at(state.tick_ms), &notes).await;
        if let Some((id, _)) = self.goals.active() {
            self.publishers.feedback(id, state, &self.stamps.at(state.tick_ms)).await;
        }
    }

    async fn follow_goals(&mut self, state: &RobotState) {
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
        let purpose = self.front.lock().holder.as_ref().map(|holder| holder.purpose);
        if let Some(Purpose::Goal { id, .. }) = purpose
            && of(&id).is_some_and(|status| status.is_final())
        {
            self.give_back().await;
        }
    }

    async fn status(&self) {
        self.publishers.status(&self.goals.status()).await;
    }

    /// The agent ends.
    pub(super) async fn end(&mut self) {
        send(self.goals.shut_down(&self.now())).await;
        self.status().await;
    }

    /// Something was refused or ended: told in `/diagnostics` for a while.
    fn note(&mut self, text: String) {
        tracing::info!("ROS 2: {text}");
        self.refused = Some((text, Instant::now()));
    }

    fn told(&mut self, reply: &Reply, done: &str) -> Verdict {
        let verdict = verdict(reply, done);
        if !verdict.success {
            self.note(verdict.message.clone());
        }
        verdict
    }

    fn notes(&self, malformed: u64) -> Notes {
        let (shared, now_ns) = (self.front.lock(), self.front.now_ns());
        let mut events: Vec<(&str, String)> = Vec::new();
        if let Some(holder) = &shared.holder {
            events.push(("ROS node in control", holder.node.clone()));
        }
        for (name, which) in
            [("fenced cmd_vel", HeldBack::Fenced), ("cmd_vel that has to let go", HeldBack::Held)]
        {
            let held = shared.held_back(now_ns, which);
            if !held.is_empty() {
                events.push((name, held));
            }
        }
        if let Some(notice) = shared.commands.notice() {
            events.push(("cmd_vel", notice.to_string()));
        }
        if let Some((text, _)) = self.refused.as_ref().filter(|(_, at)| at.elapsed() < TOLD_FOR) {
            events.push(("refused", text.clone()));
        }
        let counts = shared.commands.counts();
        let counters = vec![
            (
                "cmd_vel received",
                format!(
                    "fresh {}, on trial {}, late {}, uneven {}, old {}",
                    counts.fresh, counts.on_trial, counts.late, counts.uneven, counts.old
                ),
            ),
            ("malformed", malformed.to_string()),
            ("overloaded", (self.front.overloaded() + self.goals.turned_away()).to_string()),
        ];
        Notes { events, counters }
    }
}

async fn send(answers: impl IntoIterator<Item = Answer<Call<GetResult>>>) {
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

fn refused(message: String, hint: &str) -> Reply {
    let error = ErrorBody { code: xtb_protocol::messages::RejectCode::LeaseHeld, message, hint: hint.into() };
    Reply { id: Uuid::nil(), result: Outcome::Error(error) }
}

fn held_by(node: &str) -> Reply {
    refused(format!("{node} drives"), "end that node, or call `take_control`")
}

fn no_lease() -> Reply {
    refused("no node of ROS holds control".into(), "call `take_control`")
}
