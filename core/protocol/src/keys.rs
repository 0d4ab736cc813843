//! The only table of keys: every channel, what it carries and how Zenoh shall treat it.
//!
//! | key | channel | carries |
//! | --- | --- | --- |
//! | `xtb/<fleet>/<robot>/alive` | [`Channel::Alive`] | presence (liveliness token) |
//! | `xtb/<fleet>/<robot>/state` | [`Channel::State`] | [`RobotState`](crate::messages::RobotState) |
//! | `xtb/<fleet>/<robot>/sensors` | [`Channel::Sensors`] | [`Sensors`](crate::messages::Sensors) |
//! | `xtb/<fleet>/<robot>/event` | [`Channel::Event`] | [`Event`](crate::messages::Event) |
//! | `xtb/<fleet>/<robot>/about` | [`Channel::About`] | [`About`](crate::messages::About) |
//! | `xtb/<fleet>/<robot>/cmd/<client>` | [`Channel::Cmd`] | [`Request`](crate::messages::Request) → [`Reply`](crate::messages::Reply) |
//! | `xtb/<fleet>/<robot>/teleop/<client>` | [`Channel::Teleop`] | [`Setpoint`](crate::messages::Setpoint) |
//! | `xtb/<fleet>/<robot>/fix` | [`Channel::Fix`] | [`Fix`](crate::messages::Fix) |
//! | `xtb/<fleet>/<robot>/route` | [`Channel::Route`] | [`Route`](crate::messages::Route) |
//! | `xtb/<fleet>/<robot>/estop/<client>` | [`Channel::Estop`] | [`Estop`](crate::messages::Estop), put, or asked → [`Estopped`](crate::messages::Estopped) |
//! | `xtb/<fleet>/all/estop/<client>` | [`Channel::EstopAll`] | [`Estop`](crate::messages::Estop) for every robot |
//! | `xtb/<fleet>/<robot>/log/<client>` | [`Channel::Log`] | [`LogRequest`](crate::messages::LogRequest) → [`LogReply`](crate::messages::LogReply) |
//! | `xtb/<fleet>/traffic/alive` | [`Channel::TrafficAlive`] | presence of traffic control (liveliness token) |
//! | `xtb/<fleet>/traffic/state` | [`Channel::TrafficState`] | [`TrafficState`](crate::messages::TrafficState) |
//! | `xtb/<fleet>/map` | [`Channel::Map`] | [`FleetMap`](crate::messages::FleetMap) |
//! | `xtb/<fleet>/dispatch/alive` | [`Channel::DispatchAlive`] | presence of the dispatcher (liveliness token) |
//! | `xtb/<fleet>/dispatch/cmd/<client>` | [`Channel::DispatchCmd`] | [`DispatchRequest`](crate::messages::DispatchRequest) → [`DispatchReply`](crate::messages::DispatchReply) |
//! | `xtb/<fleet>/dispatch/tasks` | [`Channel::DispatchTasks`] | [`TaskList`](crate::messages::TaskList) |
//! | `xtb/<fleet>/dispatch/event` | [`Channel::DispatchEvent`] | [`TaskEvent`](crate::messages::TaskEvent) |
//! | `xtb/<fleet>/sim/truth` | [`Channel::SimTruth`] | [`Truth`](crate::messages::Truth), JSON |
//! | `xtb/<fleet>/sim/roster` | [`Channel::SimRoster`] | [`Roster`](crate::messages::Roster), JSON |

use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// Names that no robot may have: they are other things' places in the key space.
pub const RESERVED: [&str; 5] = ["all", "sim", "dispatch", "traffic", "map"];
const ROOT: &str = "xtb";
const ANY: &str = "*";
/// Any number of characters within a chunk, none too.
const ANY_PART: &str = "$*";
/// Longest name in characters.
pub const MAX_NAME: usize = 32;

/// A name that cannot stand in a key.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NameError {
    /// Wrong length or characters.
    #[error("{0:?} is not a name: 1 to {MAX_NAME} of a-z, 0-9 and -")]
    Malformed(String),
    /// See [`RESERVED`].
    #[error("{0:?} is reserved and cannot be a robot's name")]
    Reserved(String),
}

/// The name of a fleet, a robot or a client: 1–32 of `a-z 0-9 -`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(try_from = "String", into = "String")]
pub struct Name(String);

impl Name {
    /// # Errors
    /// [`NameError::Malformed`].
    pub fn new(text: &str) -> Result<Self, NameError> {
        let allowed = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        if (1..=MAX_NAME).contains(&text.len()) && text.bytes().all(allowed) {
            Ok(Self(text.to_owned()))
        } else {
            Err(NameError::Malformed(text.chars().take(2 * MAX_NAME).collect()))
        }
    }

    /// A name that a robot may have.
    ///
    /// # Errors
    /// [`NameError::Malformed`] or [`NameError::Reserved`].
    pub fn robot(text: &str) -> Result<Self, NameError> {
        let name = Self::new(text)?;
        if RESERVED.contains(&text) { Err(NameError::Reserved(text.to_owned())) } else { Ok(name) }
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl TryFrom<String> for Name {
    type Error = NameError;

    fn try_from(text: String) -> Result<Self, NameError> {
        Self::new(&text)
    }
}

impl From<Name> for String {
    fn from(name: Name) -> String {
        name.0
    }
}

impl std::str::FromStr for Name {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        Self::new(text)
    }
}

/// One channel of a robot, of the fleet or of the simulator.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Channel {
    /// Liveliness token, declared last: alive means commandable.
    Alive,
    /// 20 Hz; also a queryable for late joiners.
    State,
    /// 10 Hz while somebody listens.
    Sensors,
    /// Mode changes, goal results, faults; recoverable.
    Event,
    /// Factsheet, queryable.
    About,
    /// Request and reply; the client's name stands in the key so that access control can bind it.
    Cmd(Name),
    /// Setpoints.
    Teleop(Name),
    /// Measured poses.
    Fix,
    /// Path and release from traffic control.
    Route,
    /// Emergency stop of one robot; also a queryable, whose reply acknowledges it.
    Estop(Name),
    /// Emergency stop of every robot.
    EstopAll(Name),
    /// The robot's recordings, asked for piece by piece.
    Log(Name),
    /// Liveliness token of traffic control: one for a fleet.
    TrafficAlive,
    /// What traffic control does, 2 Hz.
    TrafficState,
    /// The fleet's map; also a queryable for late joiners.
    Map,
    /// Liveliness token of the dispatcher: one for a fleet.
    DispatchAlive,
    /// Submissions, cancellations and questions to the dispatcher, by client.
    DispatchCmd(Name),
    /// The list of tasks, queryable.
    DispatchTasks,
    /// Each change of a task; recoverable.
    DispatchEvent,
    /// Ground truth of the simulator, 20 Hz.
    SimTruth,
    /// Which robots the simulator runs, queryable.
    SimRoster,
}

/// What happens when a queue on the way is full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Congestion {
    /// The message is dropped: a newer one follows.
    Drop,
    /// The sender waits.
    Block,
}

/// Which of Zenoh's queues a message takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Priority {
    /// Emergency stops, alone.
    RealTime,
    /// Setpoints.
    InteractiveHigh,
    /// State.
    DataHigh,
    /// Requests, events: what other clients use by default.
    Data,
    /// Raw samples.
    DataLow,
    /// What may take long.
    Background,
}

/// How Zenoh shall treat a channel's messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Qos {
    /// On full queues.
    pub congestion: Congestion,
    /// Among other messages.
    pub priority: Priority,
    /// Send at once instead of batching.
    pub express: bool,
}

impl Channel {
    /// The channel's quality of service. No priority holds both Drop and Block: within Zenoh they
    /// share a lock, and a blocked message would hold the others up for seconds.
    #[must_use]
    pub fn qos(&self) -> Qos {
        use Congestion::{Block, Drop};
        let qos = |congestion, priority, express| Qos { congestion, priority, express };
        match self {
            Self::State | Self::Fix | Self::Route => qos(Drop, Priority::DataHigh, true),
            Self::Sensors | Self::SimTruth | Self::TrafficState => qos(Drop, Priority::DataLow, false),
            Self::Map | Self::Log(_) => qos(Drop, Priority::Background, false),
            Self::Estop(_) | Self::EstopAll(_) => qos(Block, Priority::RealTime, true),
            Self::Teleop(_) => qos(Drop, Priority::InteractiveHigh, true),
            Self::Alive
            | Self::TrafficAlive
            | Self::DispatchAlive
            | Self::Event
            | Self::DispatchEvent
            | Self::About
            | Self::Cmd(_)
            | Self::DispatchCmd(_)
            | Self::DispatchTasks
            | Self::SimRoster => qos(Block, Priority::Data, true),
        }
    }
}

/// Key expressions that match every key of a channel, whatever fleet, robot and client.
pub mod any {
    /// See [`Channel::Alive`](super::Channel::Alive).
    pub const ALIVE: &str = "xtb/*/*/alive";
    /// See [`Channel::State`](super::Channel::State).
    pub const STATE: &str = "xtb/*/*/state";
    /// See [`Channel::Sensors`](super::Channel::Sensors).
    pub const SENSORS: &str = "xtb/*/*/sensors";
    /// See [`Channel::Event`](super::Channel::Event).
    pub const EVENT: &str = "xtb/*/*/event";
    /// See [`Channel::About`](super::Channel::About).
    pub const ABOUT: &str = "xtb/*/*/about";
    /// See [`Channel::Cmd`](super::Channel::Cmd).
    pub const CMD: &str = "xtb/*/*/cmd/*";
    /// See [`Channel::Teleop`](super::Channel::Teleop).
    pub const TELEOP: &str = "xtb/*/*/teleop/*";
    /// See [`Channel::Estop`](super::Channel::Estop); also of [`Channel::EstopAll`](super::Channel::EstopAll).
    pub const ESTOP: &str = "xtb/*/*/estop/*";
    /// See [`Channel::Fix`](super::Channel::Fix).
    pub const FIX: &str = "xtb/*/*/fix";
    /// See [`Channel::Route`](super::Channel::Route).
    pub const ROUTE: &str = "xtb/*/*/route";
    /// See [`Channel::Map`](super::Channel::Map).
    pub const MAP: &str = "xtb/*/map";
    /// See [`Channel::SimTruth`](super::Channel::SimTruth).
    pub const SIM_TRUTH: &str = "xtb/*/sim/truth";
    /// See [`Channel::SimRoster`](super::Channel::SimRoster).
    pub const SIM_ROSTER: &str = "xtb/*/sim/roster";
}

/// A parsed key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key {
    /// Whose.
    pub fleet: Name,
    /// `None` for the channels of the fleet and the simulator, and for those of all robots.
    pub robot: Option<Name>,
    /// Which.
    pub channel: Channel,
}

impl Key {
    /// Reads a concrete key; `None` if it is not one of ours.
    #[must_use]
    pub fn parse(key: &str) -> Option<Self> {
        let mut parts = key.split('/');
        if parts.next()? != ROOT {
            return None;
        }
        let fleet = Name::new(parts.next()?).ok()?;
        let (who, what, client) = (parts.next()?, parts.next(), parts.next());
        if parts.next().is_some() {
            return None;
        }
        let Some(what) = what else {
            return (who == "map").then_some(Self { fleet, robot: None, channel: Channel::Map });
        };
        if who == "sim" {
            let channel = match (what, client) {
                ("truth", None) => Channel::SimTruth,
                ("roster", None) => Channel::SimRoster,
                _ => return None,
            };
            return Some(Self { fleet, robot: None, channel });
        }
        if who == "traffic" {
            let channel = match (what, client) {
                ("alive", None) => Channel::TrafficAlive,
                ("state", None) => Channel::TrafficState,
                _ => return None,
            };
            return Some(Self { fleet, robot: None, channel });
        }
        if who == "dispatch" {
            let channel = match (what, client) {
                ("alive", None) => Channel::DispatchAlive,
                ("tasks", None) => Channel::DispatchTasks,
                ("event", None) => Channel::DispatchEvent,
                ("cmd", Some(client)) => Channel::DispatchCmd(Name::new(client).ok()?),
                _ => return None,
            };
            return Some(Self { fleet, robot: None, channel });
        }
        if who == "all" {
            let ("estop", Some(client)) = (what, client) else { return None };
            return Some(Self { fleet, robot: None, channel: Channel::EstopAll(Name::new(client).ok()?) });
        }
        let channel = match (what, client) {
            ("alive", None) => Channel::Alive,
            ("state", None) => Channel::State,
            ("sensors", None) => Channel::Sensors,
            ("event", None) => Channel::Event,
            ("about", None) => Channel::About,
            ("fix", None) => Channel::Fix,
            ("route", None) => Channel::Route,
            ("cmd", Some(client)) => Channel::Cmd(Name::new(client).ok()?),
            ("log", Some(client)) => Channel::Log(Name::new(client).ok()?),
            ("teleop", Some(client)) => Channel::Teleop(Name::new(client).ok()?),
            ("estop", Some(client)) => Channel::Estop(Name::new(client).ok()?),
            _ => return None,
        };
        Some(Self { fleet, robot: Some(Name::robot(who).ok()?), channel })
    }
}

/// The keys of a fleet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FleetKeys(Name);

impl FleetKeys {
    /// The keys of this fleet.
    #[must_use]
    pub fn new(fleet: Name) -> Self {
        Self(fleet)
    }

    /// One robot's keys.
    #[must_use]
    pub fn robot(&self, robot: &Name) -> RobotKeys {
        RobotKeys(format!("{ROOT}/{}/{robot}", self.0))
    }

    /// Key expressions for all robots at once.
    #[must_use]
    pub fn any_robot(&self) -> RobotKeys {
        RobotKeys(format!("{ROOT}/{}/{ANY}", self.0))
    }

    /// The states of all robots, for a robot that listens to them for a while. It matches the same keys as
    /// `any_robot().state()` and is another expression: of those who take back a subscription, questions on the
    /// very same expression no longer reached the queryables (Zenoh 1.10).
    #[must_use]
    pub fn neighbour_states(&self) -> String {
        format!("{ROOT}/{}/{ANY}/state{ANY_PART}", self.0)
    }

    /// Emergency stop of every robot, by one client or by any.
    #[must_use]
    pub fn estop_all(&self, client: Option<&Name>) -> String {
        format!("{ROOT}/{}/all/estop/{}", self.0, client.map_or(ANY, Name::as_str))
    }

    /// Presence of traffic control.
    #[must_use]
    pub fn traffic_alive(&self) -> String {
        format!("{ROOT}/{}/traffic/alive", self.0)
    }

    /// What traffic control does.
    #[must_use]
    pub fn traffic_state(&self) -> String {
        format!("{ROOT}/{}/traffic/state", self.0)
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> String {
        format!("{ROOT}/{}/map", self.0)
    }

    /// Presence of the dispatcher.
    #[must_use]
    pub fn dispatch_alive(&self) -> String {
        format!("{ROOT}/{}/dispatch/alive", self.0)
    }

    /// Requests of one client to the dispatcher, or of any.
    #[must_use]
    pub fn dispatch_cmd(&self, client: Option<&Name>) -> String {
        format!("{ROOT}/{}/dispatch/cmd/{}", self.0, client.map_or(ANY, Name::as_str))
    }

    /// The list of tasks.
    #[must_use]
    pub fn dispatch_tasks(&self) -> String {
        format!("{ROOT}/{}/dispatch/tasks", self.0)
    }

    /// Changes of tasks.
    #[must_use]
    pub fn dispatch_event(&self) -> String {
        format!("{ROOT}/{}/dispatch/event", self.0)
    }

    /// Ground truth.
    #[must_use]
    pub fn sim_truth(&self) -> String {
        format!("{ROOT}/{}/sim/truth", self.0)
    }

    /// The simulator's robots.
    #[must_use]
    pub fn sim_roster(&self) -> String {
        format!("{ROOT}/{}/sim/roster", self.0)
    }
}

/// The keys of a robot, or of any robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotKeys(String);

impl RobotKeys {
    /// Presence.
    #[must_use]
    pub fn alive(&self) -> String {
        format!("{}/alive", self.0)
    }

    /// State.
    #[must_use]
    pub fn state(&self) -> String {
        format!("{}/state", self.0)
    }

    /// Samples.
    #[must_use]
    pub fn sensors(&self) -> String {
        format!("{}/sensors", self.0)
    }

    /// Topics of a recording's file; nothing is published there.
    #[must_use]
    pub fn record(&self, topic: &str) -> String {
        format!("{}/record/{topic}", self.0)
    }

    /// Events.
    #[must_use]
    pub fn event(&self) -> String {
        format!("{}/event", self.0)
    }

    /// Factsheet.
    #[must_use]
    pub fn about(&self) -> String {
        format!("{}/about", self.0)
    }

    /// Measured poses.
    #[must_use]
    pub fn fix(&self) -> String {
        format!("{}/fix", self.0)
    }

    /// Path and release from traffic control.
    #[must_use]
    pub fn route(&self) -> String {
        format!("{}/route", self.0)
    }

    /// Requests of one client, or of any.
    #[must_use]
    pub fn cmd(&self, client: Option<&Name>) -> String {
        format!("{}/cmd/{}", self.0, client.map_or(ANY, Name::as_str))
    }

    /// Recordings for one client, or for any.
    #[must_use]
    pub fn log(&self, client: Option<&Name>) -> String {
        format!("{}/log/{}", self.0, client.map_or(ANY, Name::as_str))
    }

    /// Emergency stop by one client, or by any.
    #[must_use]
    pub fn estop(&self, client: Option<&Name>) -> String {
        format!("{}/estop/{}", self.0, client.map_or(ANY, Name::as_str))
    }

    /// Setpoints of one client, or of any.
    #[must_use]
    pub fn teleop(&self, client: Option<&Name>) -> String {
        format!("{}/teleop/{}", self.0, client.map_or(ANY, Name::as_str))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    #[test]
    fn every_key_parses_back_into_its_channel() {
        let fleet = FleetKeys::new(name("lab"));
        let robot = fleet.robot(&name("xtb-1"));
        let client = name("cli-7");
        for (key, channel) in [
            (robot.alive(), Channel::Alive),
            (robot.state(), Channel::State),
            (robot.sensors(), Channel::Sensors),
            (robot.event(), Channel::Event),
            (robot.about(), Channel::About),
            (robot.fix(), Channel::Fix),
            (robot.route(), Channel::Route),
            (robot.cmd(Some(&client)), Channel::Cmd(client.clone())),
            (robot.log(Some(&client)), Channel::Log(client.clone())),
            (robot.teleop(Some(&client)), Channel::Teleop(client.clone())),
            (robot.estop(Some(&client)), Channel::Estop(client.clone())),
            (fleet.estop_all(Some(&client)), Channel::EstopAll(client.clone())),
            (fleet.traffic_alive(), Channel::TrafficAlive),
            (fleet.traffic_state(), Channel::TrafficState),
            (fleet.map(), Channel::Map),
            (fleet.dispatch_alive(), Channel::DispatchAlive),
            (fleet.dispatch_cmd(Some(&client)), Channel::DispatchCmd(client.clone())),
            (fleet.dispatch_tasks(), Channel::DispatchTasks),
            (fleet.dispatch_event(), Channel::DispatchEvent),
            (fleet.sim_truth(), Channel::SimTruth),
            (fleet.sim_roster(), Channel::SimRoster),
        ] {
            assert_eq!(Key::parse(&key).unwrap_or_else(|| panic!("{key}")).channel, channel);
        }
    }

    #[test]
    fn foreign_keys_are_not_ours() {
        for key in ["", "xtb", "xtb/lab", "xtb/lab/xtb-1", "xtb/lab/xtb-1/cmd", "ros/lab/xtb-1/state"] {
            assert_eq!(Key::parse(key), None, "{key}");
        }
        assert_eq!(Key::parse("xtb/lab/all/state"), None);
        assert_eq!(Key::parse("xtb/lab/map/state"), None);
        assert_eq!(Key::parse("xtb/lab/xtb-1/cmd/a/b"), None);
    }

    #[test]
    fn names_are_checked() {
        for bad in ["", "Xtb", "a b", "a/b", "*", &"x".repeat(33)] {
            assert!(Name::new(bad).is_err(), "{bad}");
        }
        assert_eq!(Name::robot("all"), Err(NameError::Reserved("all".into())));
    }
}
