//! What callbacks and [`client`](super::client) share: who of ROS is there, whose commands drive, and which lease they drive with.
//!
//! The callbacks run on Zenoh's threads. A velocity command of the driver goes on to the control loop at once; an
//! emergency stop and a stop wait for nothing; everything else is queued for the client.

use crate::inbox::Inbox;
use crate::snapshot::Snapshot;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::{mpsc, watch};
use xtb_control::{Steering, VehicleConfig, WheelRpm};
use xtb_protocol::messages::{Body, Outcome, Reply, Request};
use xtb_protocol::{Name, Uuid};
use xtb_robot::Operator;
use xtb_ros2::command::{Advice, Commands, HeldBack};
use xtb_ros2::names::{client_name, unknown_client_name};
use xtb_ros2::offer;
use xtb_ros2::token::Kind;
use xtb_ros2::types::{
    CancelGoal, GetResult, GoalId, PoseStamped, PoseWithCovarianceStamped, SendGoal, Trigger, Twist, Verdict,
};
use xtb_ros2::{Attachment, Gid, Graph, RosName, Token};
use xtb_ros2_node::Call;

/// What waits for the client.
pub(super) enum Event {
    /// This publisher asks for motion, and nobody drives.
    LeaseWanted(Gid),
    /// The one who had the lease is gone.
    Vanished,
    /// See `offer::RESET`.
    Reset(Call<Trigger>),
    /// See `offer::TAKE_CONTROL`.
    Take(Call<Trigger>),
    /// See `offer::RELEASE_CONTROL`.
    Release(Call<Trigger>),
    /// See `offer::GOAL_POSE`.
    GoalPose(Gid, PoseStamped),
    /// See `offer::INITIAL_POSE`.
    InitialPose(Gid, PoseWithCovarianceStamped),
    /// See `offer::SEND_GOAL`.
    SendGoal(Call<SendGoal>),
    /// See `offer::GET_RESULT`.
    GetResult(Call<GetResult>),
    /// See `offer::CANCEL_GOAL`.
    Cancel(Call<CancelGoal>),
}

/// What the lease is held for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Velocity commands of this publisher; they keep it.
    Commands,
    /// A goal; kept until that ends, or its client is gone.
    Goal {
        /// The goal.
        id: GoalId,
        /// Who sent it.
        client: Gid,
    },
    /// `take_control` was called: kept for a while, for whoever commands next.
    Taken {
        /// Not longer.
        until: Instant,
    },
}

/// The lease, if ROS has it.
#[derive(Debug, Clone)]
pub(super) struct Holder {
    /// As which client of ours.
    pub(super) client: Name,
    /// The node's full name.
    pub(super) node: String,
    /// What for.
    pub(super) purpose: Purpose,
    /// Lease, numbers, echoes.
    pub(super) operator: Operator,
    /// States up to this number may not know of the grant yet.
    pub(super) known_after: u64,
}

/// What is shared, behind one lock that nobody holds for long.
pub(super) struct Shared {
    /// Whose commands drive.
    pub(super) commands: Commands,
    /// Who is there.
    pub(super) graph: Graph,
    /// Who of them has the lease.
    pub(super) holder: Option<Holder>,
}

impl Shared {
    /// A node's name among our clients, and its own.
    pub(super) fn client(&self, gid: &Gid) -> (Name, String) {
        self.graph.find(gid).map_or_else(
            || (unknown_client_name(gid), format!("gid {gid}")),
            |token| (client_name(&token.node.name), token.node.full_name()),
        )
    }

    /// Who asks for motion and does not get it, for people.
    pub(super) fn held_back(&self, now_ns: i64, which: HeldBack) -> String {
        let held = self.commands.held_back(now_ns).filter(|(_, why)| *why == which);
        held.map(|(gid, _)| self.client(&gid).1).collect::<Vec<_>>().join(", ")
    }
}

/// See the module's documentation.
pub(super) struct Callbacks {
    shared: Mutex<Shared>,
    namespace: RosName,
    /// Where everything goes in.
    pub(super) inbox: Arc<Inbox>,
    snapshots: watch::Receiver<Option<Snapshot>>,
    events: mpsc::Sender<Event>,
    since: Instant,
    overloaded: AtomicU64,
}

impl Callbacks {
    pub(super) fn new(
        vehicle: &VehicleConfig,
        namespace: RosName,
        inbox: Arc<Inbox>,
        snapshots: watch::Receiver<Option<Snapshot>>,
        events: mpsc::Sender<Event>,
    ) -> Self {
        let shared = Shared { commands: Commands::of(vehicle), graph: Graph::default(), holder: None };
        let (since, overloaded) = (Instant::now(), AtomicU64::new(0));
        Self { shared: Mutex::new(shared), namespace, inbox, snapshots, events, since, overloaded }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Of a clock that only goes ahead.
    pub(super) fn now_ns(&self) -> i64 {
        i64::try_from(self.since.elapsed().as_nanos()).unwrap_or(i64::MAX)
    }

    /// The number of the robot's latest state.
    pub(super) fn latest_seq(&self) -> u64 {
        self.snapshots.borrow().as_ref().map_or(0, |now| now.state.seq)
    }

    /// Who has the lease, by the robot's latest state.
    pub(super) fn lease_holder(&self) -> Option<Name> {
        let snapshot = self.snapshots.borrow();
        snapshot.as_ref()?.state.lease.as_ref().map(|lease| lease.holder.clone())
    }

    /// What found the queue to the client full.
    pub(super) fn overloaded(&self) -> u64 {
        self.overloaded.load(Ordering::Relaxed)
    }

    /// Queues something for the client. A service that finds no room is not answered: who asks asks again.
    pub(super) fn event(&self, event: Event) {
        if self.events.try_send(event).is_err() {
            self.overloaded.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// A velocity command has come.
    pub(super) fn command(&self, attachment: &Attachment, twist: &Twist) {
        let mut shared = self.lock();
        match shared.commands.command(attachment, self.now_ns(), twist) {
            Advice::Ignore => {}
            Advice::Ask => {
                drop(shared);
                self.event(Event::LeaseWanted(attachment.gid));
            }
            Advice::Drive(drive) => self.setpoint(&mut shared, drive.rpm, drive.steering),
        }
    }

    /// Under the lease that is held for commands.
    fn setpoint(&self, shared: &mut Shared, rpm: WheelRpm, steering: Steering) {
        let tick_ms = self.snapshots.borrow().as_ref().map(|now| now.state.tick_ms);
        let Some(holder) = shared.holder.as_mut().filter(|holder| holder.purpose == Purpose::Commands) else {
            return;
        };
        tick_ms.into_iter().for_each(|tick_ms| holder.operator.saw(tick_ms));
        if let Some(setpoint) = holder.operator.setpoint(rpm.get(), steering.get()) {
            self.inbox.setpoint(holder.client.clone(), setpoint);
        }
    }

    /// A token has come or gone. With that of the one who drives its commands end at once, with that of the one who
    /// sent the goal the goal does.
    pub(super) fn token(&self, token: &str, there: bool) {
        let mut shared = self.lock();
        let shared = &mut *shared;
        if there {
            return shared.graph.declared(token);
        }
        let Some(gid) = shared.graph.undeclared(token) else { return };
        let Ok(token) = token.parse::<Token>() else { return };
        let drove = is_of(&token, &self.namespace, Kind::Publisher, offer::CMD_VEL.name)
            && shared.commands.vanished(&gid, &shared.graph);
        if drove {
            self.setpoint(shared, WheelRpm::ZERO, Steering::CENTRED);
        }
        let sent = |client: Gid| {
            let may_be_its = is_of(&token, &self.namespace, Kind::Client, offer::SEND_GOAL.name)
                || is_of(&token, &self.namespace, Kind::Publisher, offer::GOAL_POSE.name);
            client == gid || (may_be_its && shared.graph.find(&client).is_none())
        };
        let purpose = shared.holder.as_ref().map(|holder| holder.purpose);
        if drove || matches!(purpose, Some(Purpose::Goal { client, .. }) if sent(client)) {
            self.event(Event::Vanished);
        }
    }

    /// `stop`: no lease, no queue.
    pub(super) async fn stop(self: Arc<Self>, call: Call<Trigger>) {
        let (client, _) = self.lock().client(&call.client());
        let request = Request { id: Uuid::new_v4(), lease: None, body: Body::Stop {} };
        let reply = self.inbox.ask(&client, request).await;
        call.reply(&verdict(&reply, "stopped")).await;
    }

    /// `estop`: the same, and latched.
    pub(super) async fn estop(self: Arc<Self>, call: Call<Trigger>) {
        let (client, _) = self.lock().client(&call.client());
        let latched = self.inbox.ask_estop(&client).await;
        let verdict = if latched {
            Verdict::done("emergency stop latched; `reset` ends it")
        } else {
            Verdict::refused("the robot has not confirmed the emergency stop: use the switch on the robot")
        };
        call.reply(&verdict).await;
    }
}

/// Whether this is an endpoint of a name in that namespace.
fn is_of(token: &Token, namespace: &RosName, kind: Kind, name: &str) -> bool {
    let endpoint = token.endpoint.as_ref().filter(|endpoint| endpoint.kind == kind);
    endpoint.is_some_and(|endpoint| namespace.resolve(name).as_ref() == Ok(&endpoint.key.name))
}

/// A reply as a service of ROS says it.
pub(super) fn verdict(reply: &Reply, done: &str) -> Verdict {
    match &reply.result {
        Outcome::Ok(_) => Verdict::done(done),
        Outcome::Error(error) => Verdict::refused(format!("{}; {}", error.message, error.hint)),
    }
}
