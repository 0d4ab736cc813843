//! Nodes of ROS as clients of the robot: asks for the lease in their names, retains it as long as one of them needs it,
//! and releases it. One request after the other; each is answered within a turn of the control loop. Their goals are
//! in [`goals`].
//!
//! | asks | takes the lease from |
//! | --- | --- |
//! | `cmd_vel` | nobody: it must be free, or held by the same node, or by `take_control` |
//! | `navigate_to_pose`, `goal_pose` | another goal of ROS: as with Nav2 the newer goal counts |
//! | `reset`, `initialpose` | nobody; it is borrowed for the one request |
//! | `take_control` | anybody |

mod goals;

use super::Stamps;
use super::callbacks::{Callbacks, Event, Holder, Purpose, verdict};
use super::publish::{Notes, Publishers};
use crate::snapshot::Snapshot;
use std::sync::Arc;
use std::time::{Duration, Instant};
use xtb_control::Stamp;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{Body, ErrorBody, Outcome, RejectCode, Reply, Request};
use xtb_protocol::{Name, Uuid};
use xtb_ros2::Gid;
use xtb_ros2::action::Goals;
use xtb_ros2::command::HeldBack;
use xtb_ros2::convert::map_pose;
use xtb_ros2::types::{GetResult, Time, Trigger, Verdict};
use xtb_ros2_node::Call;

/// Who has called `take_control` has so long to command.
const TAKEN_FOR: Duration = Duration::from_secs(10);
/// A refusal is told in `/diagnostics` for so long.
const TOLD_FOR: Duration = Duration::from_secs(10);

/// A node, as it asks for something.
struct Caller {
    client: Name,
    node: String,
}

/// See the module's documentation.
pub(super) struct Client {
    callbacks: Arc<Callbacks>,
    publishers: Publishers,
    stamps: Stamps,
    goals: Goals<Call<GetResult>>,
    /// The last thing that was refused, and when.
    refused: Option<(String, Instant)>,
}

impl Client {
    pub(super) fn new(callbacks: Arc<Callbacks>, publishers: Publishers, stamps: Stamps) -> Self {
        Self { callbacks, publishers, stamps, goals: Goals::default(), refused: None }
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
            Event::LeaseWanted(gid) => self.drive_for(gid).await,
            Event::Vanished => {
                self.note("the node that drove, or had sent the goal, is gone: the robot stands".into());
                self.release_lease().await;
            }
            Event::Reset(call) => {
                let by = self.caller(&call.client());
                let reply = self.with_lease(&by, Body::Reset { latch: None }).await;
                call.reply(&self.told(&reply, "latches reset; the robot stands until a new command")).await;
            }
            Event::GoalPose(gid, pose) => self.goal_pose(gid, &pose).await,
            Event::SendGoal(call) => self.send_goal(call).await,
            Event::GetResult(call) => self.get_result(call).await,
            Event::Cancel(call) => self.cancel_goal(call).await,
            Event::Take(call) => self.take(call).await,
            Event::Release(call) => self.release(call).await,
            Event::InitialPose(gid, message) => match map_pose(&message.header, &message.pose.pose) {
                Ok(MapPose { x_m, y_m, yaw_rad }) => {
                    let reply =
                        self.with_lease(&self.caller(&gid), Body::SetPose { x_m, y_m, yaw_rad }).await;
                    let _ = self.told(&reply, "");
                }
                Err(error) => self.note(format!("initialpose: {error}")),
            },
        }
    }

    fn caller(&self, gid: &Gid) -> Caller {
        let (client, node) = self.callbacks.lock().client(gid);
        Caller { client, node }
    }

    /// A request of whoever has the lease, with it.
    fn request(&self, id: Uuid, body: Body) -> Option<(Name, Request)> {
        let shared = self.callbacks.lock();
        let Holder { client, operator, .. } = shared.holder.as_ref()?;
        Some((client.clone(), Request { id, lease: operator.lease(), body }))
    }

    /// Sends it; without a lease it is refused here.
    async fn ask(&self, id: Uuid, body: Body) -> Reply {
        match self.request(id, body) {
            Some((client, request)) => self.callbacks.inbox.ask(&client, request).await,
            None => refused("no node of ROS holds control".into(), "call `take_control`"),
        }
    }

    /// Asks for the lease; granted, it is held for this purpose.
    async fn acquire(&self, by: &Caller, take: bool, purpose: Purpose) -> Reply {
        let request = Request { id: Uuid::new_v4(), lease: None, body: Body::Acquire { take } };
        let reply = self.callbacks.inbox.ask(&by.client, request).await;
        if matches!(reply.result, Outcome::Ok(_)) {
            let mut operator = xtb_robot::Operator::default();
            operator.replied(Stamp::ZERO, &reply);
            let known_after = self.callbacks.latest_seq();
            self.callbacks.lock().holder = Some(Holder {
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
    async fn release_lease(&mut self) {
        if self.callbacks.lock().holder.is_some() {
            let reply = self.ask(Uuid::new_v4(), Body::Release {}).await;
            if let Outcome::Error(error) = &reply.result {
                tracing::debug!("release: {}", error.message);
            }
        }
        let mut shared = self.callbacks.lock();
        shared.holder = None;
        shared.commands.end();
    }

    /// A publisher asks for motion, and none drives.
    async fn drive_for(&mut self, gid: Gid) {
        let by = self.caller(&gid);
        let (holder, driver) = {
            let shared = self.callbacks.lock();
            (shared.holder.clone(), shared.commands.driver())
        };
        if driver.is_some() {
            return self.callbacks.lock().commands.refused(&gid);
        }
        // Its own lease, and one that was taken for whoever commands next, is given to it.
        let reply = match holder {
            Some(holder) if holder.node == by.node => {
                if let Some(holder) = &mut self.callbacks.lock().holder {
                    holder.purpose = Purpose::Commands;
                }
                Reply::done(Uuid::nil(), Default::default())
            }
            Some(Holder { purpose: Purpose::Taken { .. }, .. }) => {
                let _ = self.ask(Uuid::new_v4(), Body::Release {}).await;
                self.callbacks.lock().holder = None;
                self.acquire(&by, false, Purpose::Commands).await
            }
            Some(holder) => held_by(&holder.node),
            None => self.acquire(&by, false, Purpose::Commands).await,
        };
        let granted = matches!(reply.result, Outcome::Ok(_));
        {
            let commands = &mut self.callbacks.lock().commands;
            if granted { commands.granted(gid) } else { commands.refused(&gid) }
        }
        if !granted {
            let verdict = verdict(&reply, "");
            self.note(format!("cmd_vel of {}: {}", by.node, verdict.message));
        }
    }

    /// `take_control`: from anybody, for whoever commands next.
    async fn take(&mut self, call: Call<Trigger>) {
        let by = self.caller(&call.client());
        let purpose = Purpose::Taken { until: Instant::now() + TAKEN_FOR };
        let reply = self.acquire(&by, true, purpose).await;
        if matches!(reply.result, Outcome::Ok(_)) {
            self.callbacks.lock().commands.open();
        }
        let done = format!(
            "control is taken; within {} s the next node that publishes cmd_vel, or sends a goal, has it",
            TAKEN_FOR.as_secs()
        );
        call.reply(&self.told(&reply, &done)).await;
    }

    async fn release(&mut self, call: Call<Trigger>) {
        let holds = self.callbacks.lock().holder.is_some();
        self.release_lease().await;
        let other = self.callbacks.lease_holder();
        call.reply(&match (holds, other) {
            (true, _) => Verdict::done("control is released; whoever held a stick has to let go first"),
            (false, None) => Verdict::done("no client had control"),
            (false, Some(other)) => Verdict::refused(format!("{other} holds control, and no node of ROS")),
        })
        .await;
    }

    /// One request that needs the lease only for itself.
    async fn with_lease(&mut self, by: &Caller, body: Body) -> Reply {
        if self.callbacks.lock().holder.is_some() {
            return self.ask(Uuid::new_v4(), body).await;
        }
        let until = Instant::now();
        let reply = self.acquire(by, false, Purpose::Taken { until }).await;
        if matches!(reply.result, Outcome::Error(_)) {
            return reply;
        }
        let reply = self.ask(Uuid::new_v4(), body).await;
        self.release_lease().await;
        reply
    }

    /// Keeps the lease for a goal or for whoever has taken control.
    pub(super) async fn retain(&mut self) {
        let now = self.stamps.clock.now();
        let body = {
            let mut shared = self.callbacks.lock();
            shared.holder.as_mut().and_then(|holder| match holder.purpose {
                Purpose::Commands => None, // Its commands do.
                Purpose::Taken { until } if Instant::now() >= until => Some(Body::Release {}),
                Purpose::Goal { .. } | Purpose::Taken { .. } => holder.operator.retain(now),
            })
        };
        match body {
            Some(Body::Release {}) => self.release_lease().await,
            // Its answer is not waited for: a slow link must not hold up the next one. The state shows a lost lease.
            Some(body) => {
                if let Some((client, request)) = self.request(Uuid::new_v4(), body) {
                    self.callbacks.inbox.tell(client, request);
                }
            }
            None => {}
        }
    }

    /// What the control loop shows: goals go on, a lost lease is lost, everything is published.
    pub(super) async fn see(&mut self, snapshot: &Snapshot, malformed: u64) {
        let state = &snapshot.state;
        let lost = {
            let mut shared = self.callbacks.lock();
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
        let notes = self.publishers.diagnoses().then(|| self.notes(malformed));
        self.publishers.snapshot(snapshot, &self.stamps.at(state.tick_ms), notes).await;
        if let Some((id, _)) = self.goals.active() {
            self.publishers.feedback(id, state, &self.stamps.at(state.tick_ms)).await;
        }
    }

    /// The agent ends.
    pub(super) async fn end(&mut self) {
        goals::send(self.goals.shut_down(&self.now())).await;
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
        let (shared, now_ns) = (self.callbacks.lock(), self.callbacks.now_ns());
        let mut events: Vec<(&str, String)> = Vec::new();
        if let Some(holder) = &shared.holder {
            events.push(("ROS node in control", holder.node.clone()));
        }
        for (name, which) in
            [("fenced cmd_vel", HeldBack::Fenced), ("cmd_vel that has to let go", HeldBack::MustLetGo)]
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
            ("overloaded", (self.callbacks.overloaded() + self.goals.turned_away()).to_string()),
        ];
        Notes { events, counters }
    }
}

fn refused(message: String, hint: &str) -> Reply {
    let error = ErrorBody { code: RejectCode::LeaseHeld, message, hint: hint.into() };
    Reply { id: Uuid::nil(), result: Outcome::Error(error) }
}

fn held_by(node: &str) -> Reply {
    refused(format!("{node} drives"), "end that node, or call `take_control`")
}
