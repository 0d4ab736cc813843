//! The only table of keys: every channel, what it carries and how Zenoh shall treat it. What builds keys, reads
//! them and listens to all of a kind follows from it.

mod cell;
mod name;
pub mod received;

pub use cell::{CELL_M, FloorCell};
pub use name::{MAX_NAME, Name, NameError, RESERVED};

const ROOT: &str = "xtb";
const ANY: &str = "*";

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
    /// Commands to robots.
    InteractiveLow,
    /// State.
    DataHigh,
    /// Other requests, events: what other clients use by default.
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

impl Qos {
    const fn new(congestion: Congestion, priority: Priority, express: bool) -> Self {
        Self { congestion, priority, express }
    }

    /// The newest value counts.
    const LATEST: Self = Self::new(Congestion::Drop, Priority::DataHigh, true);
    /// Much, and none of it matters much.
    const SAMPLES: Self = Self::new(Congestion::Drop, Priority::DataLow, false);
    /// Large, and in no hurry.
    const BULK: Self = Self::new(Congestion::Drop, Priority::Background, false);
    /// Before all others. Dropped where somebody's queue is full, since to wait for one would hold up the stop of all
    /// others: it is sent again until it is acknowledged.
    const ESTOP: Self = Self::new(Congestion::Drop, Priority::RealTime, true);
    /// Steers by hand.
    const SETPOINT: Self = Self::new(Congestion::Drop, Priority::InteractiveHigh, true);
    /// Never dropped, and not kept waiting by states that come again and again: a stop is one.
    const COMMAND: Self = Self::new(Congestion::Block, Priority::InteractiveLow, true);
    /// What many listen to: dropped where somebody's queue is full, since to wait for one would hold up all others.
    const EVENTS: Self = Self::new(Congestion::Drop, Priority::Data, false);
    /// Never dropped: a question and its answer.
    const RELIABLE: Self = Self::new(Congestion::Block, Priority::Data, true);
}

/// Makes of the table: [`Channel`], the methods of [`FleetKeys`] and [`RobotKeys`], [`any`] and the reading of keys.
macro_rules! channels {
    (
        robot { $($(#[doc = $r_doc:literal])+ $R:ident: $r:ident, $R_ANY:ident, $r_key:literal, $r_qos:ident;)+ }
        robot by cell { $($(#[doc = $rl_doc:literal])+ $Rl:ident: $rl:ident, $RL_ANY:ident, $rl_key:literal, $rl_qos:ident;)+ }
        robot by client { $($(#[doc = $rc_doc:literal])+ $Rc:ident: $rc:ident, $RC_ANY:ident, $rc_key:literal, $rc_qos:ident;)+ }
        fleet { $($(#[doc = $f_doc:literal])+ $F:ident: $f:ident, $F_ANY:ident, $f_key:literal, $f_qos:ident;)+ }
        fleet by client { $($(#[doc = $fc_doc:literal])+ $Fc:ident: $fc:ident, $FC_ANY:ident, $fc_key:literal, $fc_qos:ident;)+ }
    ) => {
        /// One channel of a robot, of the fleet or of the simulator.
        #[derive(Debug, Clone, PartialEq, Eq)]
        pub enum Channel {
            $($(#[doc = $r_doc])+ $R,)+
            $($(#[doc = $rl_doc])+ $Rl(FloorCell),)+
            $($(#[doc = $rc_doc])+ $Rc(Name),)+
            $($(#[doc = $f_doc])+ $F,)+
            $($(#[doc = $fc_doc])+ $Fc(Name),)+
        }

        /// A channel, whatever cell or client its key names.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Kind {
            $($(#[doc = $r_doc])+ $R,)+
            $($(#[doc = $rl_doc])+ $Rl,)+
            $($(#[doc = $rc_doc])+ $Rc,)+
            $($(#[doc = $f_doc])+ $F,)+
            $($(#[doc = $fc_doc])+ $Fc,)+
        }

        impl Kind {
            /// Every channel.
            pub const ALL: &'static [Self] =
                &[$(Self::$R,)+ $(Self::$Rl,)+ $(Self::$Rc,)+ $(Self::$F,)+ $(Self::$Fc),+];

            /// Whether its keys name a client.
            #[must_use]
            pub fn names_client(self) -> bool {
                matches!(self, $(Self::$Rc)|+ | $(Self::$Fc)|+)
            }

            /// The channel's keys in this fleet: of this robot if it is a robot's, of any cell and client.
            #[must_use]
            pub fn key_expr(self, fleet: &FleetKeys, robot: &RobotKeys) -> String {
                match self {
                    $(Self::$R => robot.$r(),)+
                    $(Self::$Rl => by(&robot.0, $rl_key, None),)+
                    $(Self::$Rc => robot.$rc(None),)+
                    $(Self::$F => fleet.$f(),)+
                    $(Self::$Fc => fleet.$fc(None),)+
                }
            }
        }

        impl Channel {
            /// The client that the key names, if the channel's keys name one.
            #[must_use]
            pub fn client(&self) -> Option<&Name> {
                match self {
                    $(Self::$Rc(client) => Some(client),)+
                    $(Self::$Fc(client) => Some(client),)+
                    $(Self::$R)|+ | $(Self::$Rl(_))|+ | $(Self::$F)|+ => None,
                }
            }

            /// The channel's quality of service. No priority holds both Drop and Block: within Zenoh they
            /// share a lock, and a blocked message would hold the others up for seconds.
            #[must_use]
            pub fn qos(&self) -> Qos {
                match self {
                    $(Self::$R => Qos::$r_qos,)+
                    $(Self::$Rl(_) => Qos::$rl_qos,)+
                    $(Self::$Rc(_) => Qos::$rc_qos,)+
                    $(Self::$F => Qos::$f_qos,)+
                    $(Self::$Fc(_) => Qos::$fc_qos,)+
                }
            }

            fn of_robot(key: &str) -> Option<Self> {
                match key { $($r_key => return Some(Self::$R),)+ _ => {} }
                let (key, by) = key.split_once('/')?;
                match key {
                    $($rl_key => FloorCell::parse(by).map(Self::$Rl),)+
                    $($rc_key => Name::new(by).ok().map(Self::$Rc),)+
                    _ => None,
                }
            }

            fn of_fleet(key: &str) -> Option<Self> {
                match key { $($f_key => return Some(Self::$F),)+ _ => {} }
                let (key, by) = key.rsplit_once('/')?;
                match key { $($fc_key => Name::new(by).ok().map(Self::$Fc),)+ _ => None }
            }
        }

        impl RobotKeys {
            $($(#[doc = $r_doc])+ #[must_use] pub fn $r(&self) -> String { key(&self.0, $r_key) })+
            $($(#[doc = $rl_doc])+ #[must_use] pub fn $rl(&self, cell: FloorCell) -> String {
                format!("{}/{}/{cell}", self.0, $rl_key)
            })+
            $($(#[doc = $rc_doc])+ /// `None` = of any client.
            #[must_use] pub fn $rc(&self, client: Option<&Name>) -> String { by(&self.0, $rc_key, client) })+
        }

        impl FleetKeys {
            $($(#[doc = $f_doc])+ #[must_use] pub fn $f(&self) -> String { key(&self.0, $f_key) })+
            $($(#[doc = $fc_doc])+ /// `None` = of any client.
            #[must_use] pub fn $fc(&self, client: Option<&Name>) -> String { by(&self.0, $fc_key, client) })+
        }

        /// Key expressions that match every key of a channel, whatever fleet, robot and client.
        pub mod any {
            $($(#[doc = $r_doc])+ pub const $R_ANY: &str = concat!("xtb/*/*/", $r_key);)+
            $($(#[doc = $rl_doc])+ pub const $RL_ANY: &str = concat!("xtb/*/*/", $rl_key, "/*");)+
            $($(#[doc = $rc_doc])+ pub const $RC_ANY: &str = concat!("xtb/*/*/", $rc_key, "/*");)+
            $($(#[doc = $f_doc])+ pub const $F_ANY: &str = concat!("xtb/*/", $f_key);)+
            $($(#[doc = $fc_doc])+ pub const $FC_ANY: &str = concat!("xtb/*/", $fc_key, "/*");)+
        }
    };
}

channels! {
    robot { // xtb/<fleet>/<robot>/…
        /// Presence, a liveliness token, declared last: alive means commandable.
        Alive: alive, ALIVE, "alive", RELIABLE;
        /// [`RobotState`](crate::messages::RobotState), 20 Hz; also a queryable for late joiners.
        State: state, STATE, "state", LATEST;
        /// The same in JSON, 20 Hz while somebody listens.
        StateJson: state_json, STATE_JSON, "state/json", LATEST;
        /// [`Sensors`](crate::messages::Sensors), 10 Hz while somebody listens.
        Sensors: sensors, SENSORS, "sensors", SAMPLES;
        /// [`Event`](crate::messages::Event): mode changes, goal results, faults; recoverable.
        Event: event, EVENT, "event", EVENTS;
        /// The same in JSON.
        EventJson: event_json, EVENT_JSON, "event/json", EVENTS;
        /// [`About`](crate::messages::About), the factsheet, queryable.
        About: about, ABOUT, "about", RELIABLE;
        /// [`Fix`](crate::messages::Fix), measured poses.
        Fix: fix, FIX, "fix", LATEST;
        /// [`Route`](crate::messages::Route), path and release from traffic control.
        Route: route, ROUTE, "route", LATEST;
    }
    robot by cell { // xtb/<fleet>/<robot>/…/<cell>, so that who listens to a few cells hears few robots
        /// [`NearState`](crate::messages::NearState), 5 Hz while somebody listens, on the cells of its body and of
        /// the next metres of its way.
        Near: near, NEAR, "near", LATEST;
    }
    robot by client { // xtb/<fleet>/<robot>/…/<client>, so that identities can be bound to it one day
        /// [`Request`](crate::messages::Request) → [`Reply`](crate::messages::Reply).
        Cmd: cmd, CMD, "cmd", COMMAND;
        /// [`ParamRequest`](crate::messages::ParamRequest) → [`ParamReply`](crate::messages::ParamReply): settings
        /// that may change while the robot runs.
        Param: param, PARAM, "param", RELIABLE;
        /// [`LogRequest`](crate::messages::LogRequest) → [`LogReply`](crate::messages::LogReply): the robot's
        /// recordings, asked for piece by piece.
        Log: log, LOG, "log", BULK;
        /// [`Setpoint`](crate::messages::Setpoint).
        Teleop: teleop, TELEOP, "teleop", SETPOINT;
        /// [`Estop`](crate::messages::Estop) of one robot; put, or asked → [`Estopped`](crate::messages::Estopped).
        Estop: estop, ESTOP, "estop", ESTOP;
    }
    fleet { // xtb/<fleet>/…
        /// Presence of traffic control, a liveliness token: one for a fleet.
        TrafficAlive: traffic_alive, TRAFFIC_ALIVE, "traffic/alive", RELIABLE;
        /// [`TrafficState`](crate::messages::TrafficState), 2 Hz.
        TrafficState: traffic_state, TRAFFIC_STATE, "traffic/state", SAMPLES;
        /// [`FleetMap`](crate::messages::FleetMap); also a queryable for late joiners.
        Map: map, MAP, "map", BULK;
        /// [`FleetPlaces`](crate::messages::FleetPlaces) of that map; also a queryable.
        Places: places, PLACES, "map/places", BULK;
        /// [`MapHistory`](crate::messages::MapHistory): who changed that map, when and why; queryable.
        MapHistory: map_history, MAP_HISTORY, "map/history", BULK;
        /// Presence of the dispatcher, a liveliness token: one for a fleet.
        DispatchAlive: dispatch_alive, DISPATCH_ALIVE, "dispatch/alive", RELIABLE;
        /// [`TaskList`](crate::messages::TaskList), queryable.
        DispatchTasks: dispatch_tasks, DISPATCH_TASKS, "dispatch/tasks", RELIABLE;
        /// [`FleetHomes`](crate::messages::FleetHomes): who is at a dock or on the way to one, queryable.
        DispatchHomes: dispatch_homes, DISPATCH_HOMES, "dispatch/homes", RELIABLE;
        /// [`TaskEvent`](crate::messages::TaskEvent), each change of a task; recoverable.
        DispatchEvent: dispatch_event, DISPATCH_EVENT, "dispatch/event", EVENTS;
        /// [`FleetAlerts`](crate::messages::FleetAlerts), what needs a person; also a queryable.
        DispatchAlerts: dispatch_alerts, DISPATCH_ALERTS, "dispatch/alerts", EVENTS;
        /// [`HistoryRequest`](crate::messages::HistoryRequest) → [`HistoryReply`](crate::messages::HistoryReply).
        DispatchHistory: dispatch_history, DISPATCH_HISTORY, "dispatch/history", RELIABLE;
        /// [`Truth`](crate::messages::Truth) of the simulator, JSON, 20 Hz while somebody listens.
        SimTruth: sim_truth, SIM_TRUTH, "sim/truth", SAMPLES;
        /// [`Roster`](crate::messages::Roster), JSON: which robots the simulator runs, queryable.
        SimRoster: sim_roster, SIM_ROSTER, "sim/roster", RELIABLE;
        /// [`SimStats`](crate::messages::SimStats), JSON: how fast the simulator runs, 1 Hz; also a queryable.
        SimStats: sim_stats, SIM_STATS, "sim/stats", SAMPLES;
    }
    fleet by client { // xtb/<fleet>/…/<client>
        /// [`Estop`](crate::messages::Estop) of every robot.
        EstopAll: estop_all, ESTOP_ALL, "all/estop", ESTOP;
        /// [`MapEdit`](crate::messages::MapEdit) → [`MapEditReply`](crate::messages::MapEditReply).
        MapEdit: map_edit, MAP_EDIT, "map/edit", RELIABLE;
        /// [`DispatchRequest`](crate::messages::DispatchRequest) → [`DispatchReply`](crate::messages::DispatchReply).
        DispatchCmd: dispatch_cmd, DISPATCH_CMD, "dispatch/cmd", RELIABLE;
        /// [`AckRequest`](crate::messages::AckRequest) → [`AckReply`](crate::messages::AckReply).
        DispatchAck: dispatch_ack, DISPATCH_ACK, "dispatch/ack", RELIABLE;
        /// [`StandbyRequest`](crate::messages::StandbyRequest) → [`StandbyReply`](crate::messages::StandbyReply).
        DispatchStandby: dispatch_standby, DISPATCH_STANDBY, "dispatch/standby", RELIABLE;
        /// [`IdentityStatus`](crate::messages::IdentityStatus), JSON: whether the router admits this identity,
        /// queryable.
        Identity: identity, IDENTITY, "identity", RELIABLE;
    }
}

fn key(prefix: &str, channel: &str) -> String {
    format!("{prefix}/{channel}")
}

fn by(prefix: &str, channel: &str, client: Option<&Name>) -> String {
    format!("{prefix}/{channel}/{}", client.map_or(ANY, Name::as_str))
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
        let (root, key) = key.split_once('/')?;
        let (fleet, key) = key.split_once('/').filter(|_| root == ROOT)?;
        let fleet = Name::new(fleet).ok()?;
        if let Some(channel) = Channel::of_fleet(key) {
            return Some(Self { fleet, robot: None, channel });
        }
        let (robot, key) = key.split_once('/')?;
        let robot = Some(Name::robot(robot).ok()?);
        Channel::of_robot(key).map(|channel| Self { fleet, robot, channel })
    }
}

/// The keys of a fleet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FleetKeys(String);

impl FleetKeys {
    /// The keys of this fleet.
    #[must_use]
    pub fn new(fleet: Name) -> Self {
        Self(key(ROOT, fleet.as_str()))
    }

    /// One robot's keys.
    #[must_use]
    pub fn robot(&self, robot: &Name) -> RobotKeys {
        RobotKeys(key(&self.0, robot.as_str()))
    }

    /// All keys of the fleet, also those that later versions may have.
    #[must_use]
    pub fn everything(&self) -> String {
        key(&self.0, "**")
    }

    /// Key expressions for all robots at once.
    #[must_use]
    pub fn any_robot(&self) -> RobotKeys {
        RobotKeys(key(&self.0, ANY))
    }
}

/// The keys of a robot, or of any robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotKeys(String);

impl RobotKeys {
    /// Topics of a recording's file; nothing is published there.
    #[must_use]
    pub fn record(&self, topic: &str) -> String {
        key(&self.0, &format!("record/{topic}"))
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
            (robot.state_json(), Channel::StateJson),
            (robot.sensors(), Channel::Sensors),
            (robot.event(), Channel::Event),
            (robot.event_json(), Channel::EventJson),
            (robot.about(), Channel::About),
            (robot.fix(), Channel::Fix),
            (robot.route(), Channel::Route),
            (robot.near(FloorCell::at(-1.0, 9.0)), Channel::Near(FloorCell { column: -1, row: 1 })),
            (robot.cmd(Some(&client)), Channel::Cmd(client.clone())),
            (robot.param(Some(&client)), Channel::Param(client.clone())),
            (robot.log(Some(&client)), Channel::Log(client.clone())),
            (robot.teleop(Some(&client)), Channel::Teleop(client.clone())),
            (robot.estop(Some(&client)), Channel::Estop(client.clone())),
            (fleet.estop_all(Some(&client)), Channel::EstopAll(client.clone())),
            (fleet.traffic_alive(), Channel::TrafficAlive),
            (fleet.traffic_state(), Channel::TrafficState),
            (fleet.map(), Channel::Map),
            (fleet.places(), Channel::Places),
            (fleet.map_history(), Channel::MapHistory),
            (fleet.map_edit(Some(&client)), Channel::MapEdit(client.clone())),
            (fleet.dispatch_alive(), Channel::DispatchAlive),
            (fleet.dispatch_cmd(Some(&client)), Channel::DispatchCmd(client.clone())),
            (fleet.dispatch_standby(Some(&client)), Channel::DispatchStandby(client.clone())),
            (fleet.identity(Some(&client)), Channel::Identity(client.clone())),
            (fleet.dispatch_tasks(), Channel::DispatchTasks),
            (fleet.dispatch_event(), Channel::DispatchEvent),
            (fleet.dispatch_homes(), Channel::DispatchHomes),
            (fleet.dispatch_alerts(), Channel::DispatchAlerts),
            (fleet.dispatch_history(), Channel::DispatchHistory),
            (fleet.dispatch_ack(Some(&client)), Channel::DispatchAck(client.clone())),
            (fleet.sim_truth(), Channel::SimTruth),
            (fleet.sim_roster(), Channel::SimRoster),
            (fleet.sim_stats(), Channel::SimStats),
        ] {
            assert_eq!(Key::parse(&key).unwrap_or_else(|| panic!("{key}")).channel, channel);
        }
    }

    #[test]
    fn foreign_keys_are_not_ours() {
        for key in ["", "xtb", "xtb/lab", "xtb/lab/xtb-1", "xtb/lab/xtb-1/cmd", "ros/lab/xtb-1/state"] {
            assert_eq!(Key::parse(key), None, "{key}");
        }
        for key in ["xtb/lab/xtb-1/near", "xtb/lab/xtb-1/near/*", "xtb/lab/xtb-1/near/1"] {
            assert_eq!(Key::parse(key), None, "{key}");
        }
        assert_eq!(Key::parse("xtb/lab/all/state"), None);
        assert_eq!(Key::parse("xtb/lab/map/state"), None);
        assert_eq!(Key::parse("xtb/lab/xtb-1/cmd/a/b"), None);
    }
}
