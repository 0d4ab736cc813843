//! The robot as a node of ROS 2: what it publishes, hears and answers is the table of `xtb_ros2::offer`.
//!
//! ```text
//!  cmd_vel ─► callbacks.rs: fresh? whose? ── setpoint ──────────────► inbox (as from the network) ─► control loop
//!  stop, estop ─────────────────────── at once ─────────────────►   │
//!  reset, take_control, goals, … ─► queue ─► client.rs ─ request ─►   │ reply
//!  snapshots, 20 Hz ─► publish.rs ─► odom, tf, ranges, …        ◄───┘
//! ```
//! ROS has no way around the rules: whatever it asks for goes to the control loop as a client's request, under the
//! name `ros-<node>` and with a lease that is asked for like any other.

mod callbacks;
mod client;
mod publish;

use crate::clock::Clock;
use crate::config::Ros2;
use crate::inbox::Inbox;
use crate::snapshot::Snapshot;
use callbacks::{Callbacks, Event};
use client::Client;
use publish::Publishers;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio::time::MissedTickBehavior;
use xtb_bus::{Bus, BusError};
use xtb_control::VehicleConfig;
use xtb_protocol::Name;
use xtb_ros2::offer;
use xtb_ros2::types::{CancelGoal, GetResult, PoseStamped, SendGoal, Time, Trigger, Twist, TwistStamped};
use xtb_ros2_node::{Call, Node, NodeError, Server, Subscriber};

/// Requests that wait for the client; more are dropped and counted: a `stop` and an `estop` are not among them.
const EVENTS: usize = 64;
/// Leases are kept, and what takes too long is ended, this often.
const TICK: Duration = Duration::from_millis(50);

/// What the node needs of the agent.
pub(crate) struct Parts {
    /// The agent's session.
    pub(crate) bus: Bus,
    /// Whose node.
    pub(crate) robot: Name,
    /// Its settings.
    pub(crate) vehicle: VehicleConfig,
    /// Where commands go in.
    pub(crate) inbox: Arc<Inbox>,
    /// What the control loop shows.
    pub(crate) snapshots: watch::Receiver<Option<Snapshot>>,
    /// Which time messages bear.
    pub(crate) stamps: Stamps,
}

/// The time that messages bear: the wall clock's, or that of a simulated world that does not run at its speed.
#[derive(Debug, Clone)]
pub(crate) struct Stamps {
    /// The robot's clock.
    pub(crate) clock: Clock,
    /// Whether that is the time of `/clock`.
    pub(crate) simulated: bool,
}

impl Stamps {
    /// Of what was so at this tick of the robot.
    fn at(&self, tick_ms: u64) -> Time {
        let tick_ns = tick_ms * 1_000_000;
        if self.simulated {
            return Time::from_ns(tick_ns);
        }
        let age_ns = self.clock.now().ns().saturating_sub(tick_ns);
        let now_ns = xtb_ros2_node::now_ns().unsigned_abs();
        Time::from_ns(now_ns.saturating_sub(age_ns))
    }
}

/// Serves the node until the control loop ends.
///
/// # Errors
/// [`BusError`] if something cannot be declared.
pub(crate) async fn run(parts: Parts, config: Ros2) -> Result<(), BusError> {
    match serve(parts, config).await {
        Ok(()) => Ok(()),
        Err(NodeError::Bus(error)) => Err(error),
        Err(NodeError::Name(error)) => {
            tracing::error!("no node of ROS 2: {error}");
            std::future::pending().await
        }
    }
}

async fn serve(parts: Parts, config: Ros2) -> Result<(), NodeError> {
    let Parts { bus, robot, vehicle, inbox, mut snapshots, stamps } = parts;
    let node = Node::open(&bus, config.domain, config.namespace.clone(), offer::NODE).await?;
    let (sender, mut events) = mpsc::channel(EVENTS);
    let callbacks = Arc::new(Callbacks::new(&vehicle, config.namespace, inbox, snapshots.clone(), sender));
    let publishers = Publishers::declare(&node, config.distro, &robot, &vehicle).await?;
    let _heard = hear(&node, &callbacks).await?;
    let _served = answer(&node, &callbacks).await?;
    let follow = callbacks.clone();
    let _watch = node.watch(move |token, there| follow.token(token, there)).await?;
    tracing::info!("{robot} is the ROS 2 node {} in domain {}", node.name().full_name(), config.domain);
    let mut client = Client::new(callbacks.clone(), publishers, stamps);
    client.begin().await;
    let mut tick = tokio::time::interval(TICK);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            biased;
            Some(event) = events.recv() => client.handle(event).await,
            changed = snapshots.changed() => {
                if changed.is_err() {
                    client.end().await;
                    return Ok(());
                }
                let snapshot = snapshots.borrow_and_update().clone();
                if let Some(snapshot) = snapshot {
                    client.see(&snapshot, node.malformed()).await;
                }
            }
            _ = tick.tick() => client.retain().await,
        }
    }
}

async fn hear(node: &Node, callbacks: &Arc<Callbacks>) -> Result<[Subscriber; 4], NodeError> {
    let (stamped, plain, goal, initial) =
        (callbacks.clone(), callbacks.clone(), callbacks.clone(), callbacks.clone());
    Ok([
        node.subscribe::<TwistStamped>(&offer::CMD_VEL_STAMPED, move |heard| {
            stamped.command(&heard.attachment, &heard.message.twist);
        })
        .await?,
        node.subscribe::<Twist>(&offer::CMD_VEL, move |heard| {
            plain.command(&heard.attachment, &heard.message);
        })
        .await?,
        node.subscribe::<PoseStamped>(&offer::GOAL_POSE, move |heard| {
            goal.event(Event::GoalPose(heard.attachment.gid, heard.message));
        })
        .await?,
        node.subscribe(&offer::INITIAL_POSE, move |heard| {
            initial.event(Event::InitialPose(heard.attachment.gid, heard.message));
        })
        .await?,
    ])
}

async fn answer(node: &Node, callbacks: &Arc<Callbacks>) -> Result<Vec<Server>, NodeError> {
    let queued = |event: fn(Call<Trigger>) -> Event| {
        let callbacks = callbacks.clone();
        move |call| callbacks.event(event(call))
    };
    let (send, result, cancel) = (callbacks.clone(), callbacks.clone(), callbacks.clone());
    let (stop, estop) = (callbacks.clone(), callbacks.clone());
    let runtime = tokio::runtime::Handle::current();
    let stops = runtime.clone();
    Ok(vec![
        // These two wait in no queue.
        node.serve::<Trigger>(&offer::STOP, move |call| _ = stops.spawn(stop.clone().stop(call))).await?,
        node.serve::<Trigger>(&offer::ESTOP, move |call| _ = runtime.spawn(estop.clone().estop(call)))
            .await?,
        node.serve::<Trigger>(&offer::RESET, queued(Event::Reset)).await?,
        node.serve::<Trigger>(&offer::TAKE_CONTROL, queued(Event::Take)).await?,
        node.serve::<Trigger>(&offer::RELEASE_CONTROL, queued(Event::Release)).await?,
        node.serve::<SendGoal>(&offer::SEND_GOAL, move |call| send.event(Event::SendGoal(call))).await?,
        node.serve::<GetResult>(&offer::GET_RESULT, move |call| result.event(Event::GetResult(call))).await?,
        node.serve::<CancelGoal>(&offer::CANCEL_GOAL, move |call| cancel.event(Event::Cancel(call))).await?,
    ])
}
