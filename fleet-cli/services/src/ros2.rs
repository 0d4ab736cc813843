//! What of ROS 2 belongs to the whole fleet: `/map` and `/estop`, from whoever serves the map or simulates, and
//! `/clock`, where a world does not run at the wall clock's speed. Robots are nodes of their own (`robot-agent`).

use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_client::client::Client;
use xtb_client::estop::estop;
use xtb_client::multi_robot::{StopOutcome, StopReport, Targets};
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::Action;
use xtb_nav::Map;
use xtb_protocol::messages::FleetMap;
use xtb_ros2::convert::occupancy_grid;
use xtb_ros2::types::{Clock, Time, Trigger, Verdict};
use xtb_ros2::{RosName, offer};
use xtb_ros2_node::{Call, Node, NodeError, Publisher, Server, now_ns};

/// The node's name.
const NODE: &str = "xtb_fleet";
/// `/clock` goes out this often: as often as a world steps, or so.
const CLOCK_EVERY: Duration = Duration::from_millis(10);
/// An emergency stop of all is repeated for so long to those that have not confirmed it.
const ESTOP_WITHIN: Duration = Duration::from_secs(2);

/// The fleet as a node of ROS 2, until it is dropped.
pub struct FleetNode {
    _map: Option<Publisher>,
    _estop: Option<Server>,
    node: Node,
    clock: Option<JoinHandle<()>>,
}

impl FleetNode {
    /// A node in this `ROS_DOMAIN_ID` on the client's session.
    ///
    /// # Errors
    /// Zenoh refuses.
    pub async fn start(client: &Client, domain: u32, map: Option<&Map>) -> Result<Self> {
        let node = Node::open(client.bus(), domain, root(), NODE).await.map_err(failed)?;
        let published = match map {
            Some(map) => Some(publish(&node, map).await.map_err(failed)?),
            None => None,
        };
        // Who may not is not asked: whoever needs it must see that it is not there.
        let estop = match client.may(Action::EmergencyStop) {
            Ok(()) => Some(answer_estop(&node, client).await.map_err(failed)?),
            Err(_) => None,
        };
        Ok(Self { _map: published, _estop: estop, node, clock: None })
    }

    /// Publishes this time as `/clock`, in s since the world began.
    ///
    /// # Errors
    /// Zenoh refuses.
    pub async fn tell_time(&mut self, now_s: impl Fn() -> f64 + Send + 'static) -> Result<()> {
        let publisher = self.node.publisher(&offer::CLOCK).await.map_err(failed)?;
        self.clock = Some(tokio::spawn(async move {
            let mut tick = tokio::time::interval(CLOCK_EVERY);
            tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
            let mut last_ns = None;
            loop {
                tick.tick().await;
                let ns = (now_s() * 1e9) as u64;
                if publisher.is_heard() && last_ns.replace(ns) != Some(ns) {
                    publisher.put(&Clock { clock: Time::from_ns(ns) }).await;
                }
            }
        }));
        Ok(())
    }
}

impl Drop for FleetNode {
    fn drop(&mut self) {
        self.clock.iter().for_each(JoinHandle::abort);
    }
}

/// The namespace of what belongs to nobody.
fn root() -> RosName {
    match RosName::new("/") {
        Ok(root) => root,
        Err(error) => unreachable!("{error}"),
    }
}

async fn publish(node: &Node, map: &Map) -> std::result::Result<Publisher, NodeError> {
    let publisher = node.publisher(&offer::MAP).await?;
    let now = Time::from_ns(now_ns().unsigned_abs());
    publisher.put(&occupancy_grid(&now, &FleetMap::from(map))).await;
    Ok(publisher)
}

async fn answer_estop(node: &Node, client: &Client) -> std::result::Result<Server, NodeError> {
    let (runtime, client) = (tokio::runtime::Handle::current(), Arc::new(client.clone()));
    let each = move |call| _ = runtime.spawn(stop_all(client.clone(), call));
    node.serve::<Trigger>(&offer::FLEET_ESTOP, each).await
}

async fn stop_all(client: Arc<Client>, call: Call<Trigger>) {
    let targets = Targets::All { expect: Vec::new(), known: Vec::new() };
    let (report, _) = estop(&client, &targets, ESTOP_WITHIN).await;
    call.reply(&verdict(&report)).await;
}

fn verdict(report: &StopReport) -> Verdict {
    let named = |stopped: bool| {
        let of = report.robots.iter().filter(move |(_, it)| (**it == StopOutcome::Stopped) == stopped);
        of.map(|(name, _)| name.to_string()).collect::<Vec<_>>().join(", ")
    };
    match (report.complete, named(false).as_str()) {
        (true, _) => Verdict::done(format!("emergency stop latched: {}", named(true))),
        (false, "") => Verdict::refused(format!(
            "emergency stop latched: {}; whether these are all robots is not known",
            if report.robots.is_empty() { "none".to_owned() } else { named(true) }
        )),
        (false, missing) => {
            Verdict::refused(format!("not confirmed: {missing}; use the switches on the robots"))
        }
    }
}

fn failed(error: NodeError) -> Error {
    Error::new(ErrorKind::Failed, format!("cannot speak ROS 2: {error}"))
        .hint("with identities the router has to carry ROS 2: `fleet-cli router --ros2`")
}
