//! The configuration's form: its sections with their defaults, and what the agent makes of them.

use super::problem::ConfigProblem;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use xtb_bus::{Enrolled, Opening, SessionRole};
use xtb_control::VehicleConfig;
use xtb_control::config::{Allowed::*, ConfigError, DefaultOrigin::*, Parameter, render_toml, validate};
use xtb_control::config_section;
use xtb_control::frames::MapPose;
use xtb_control::vehicle::Imu;
use xtb_identity::{Identity, Role};
use xtb_nav::NavSettings;
use xtb_nav::settings::{ArrivalSettings, DriveSettings, PoseSettings, UnknownSettings};
use xtb_protocol::Name;
use xtb_protocol::board::rates::LineRates;
use xtb_ros2::RosName;
use xtb_ros2::types::Distro;

config_section! {
    /// Who this robot is.
    AgentSection "agent" {
        name: String = "xtb-1".to_owned(), "", Text, Ours, "The robot's name: 1 to 32 of a-z, 0-9 and -.";
        fleet: String = "lab".to_owned(), "", Text, Ours, "The fleet's name.";
    }
}

config_section! {
    /// How to reach the others.
    ZenohSection "zenoh" {
        mode: String = "client".to_owned(), "", OneOf(&["client", "peer"]), Ours, "client of a router, or \
                        peer discovered by multicast.";
        connect: Vec<String> = vec!["tcp/127.0.0.1:7447".to_owned()], "", Text, Ours, "Routers to try; with an \
                               identity, those that it names unless others with TLS stand here.";
        identity: String = String::new(), "", Text, Ours, "Folder of the robot's identity; empty = \
                           xtb/identity below the user's configuration, if `robot-agent enrol` has made it; \
                           none = none. Name and fleet follow from it.";
    }
}

config_section! {
    /// Where the truck is plugged in.
    HardwareSection "hardware" {
        kind: String = "none".to_owned(), "", OneOf(&["none", "serial", "simulated"]), Ours, "serial, or \
                        simulated (one truck in an empty room). With none the agent does not start.";
        board: String = "/dev/ttyUSB0".to_owned(), "", Text, Assumed, "The I/O board's serial port.";
        gyro: String = "/dev/ttyUSB1".to_owned(), "", Text, Assumed, "The gyro's serial port; unused with vehicle.imu = \"bno085-rvc\", which \
                         is at the board.";
        board_baud: u32 = 115_200, "baud", Range(1200.0, 4_000_000.0), Ours, "The board's baud rate. The \
                                    rate needed is computed from the frame periods; the memorandum's 9600 is \
                                    too low.";
        gyro_baud: u32 = 38_400, "baud", Range(1200.0, 115_200.0), Printed("§2.2"), "The gyro's baud rate.";
        seed: u32 = 1, "", Range(0.0, 4_294_967_295.0), Ours, "Seed of the simulated truck.";
    }
}

config_section! {
    /// How the control loop runs.
    ControlSection "control" {
        realtime: bool = false, "", Switch, Ours, "Run the control loop before all ordinary programs \
                                (SCHED_FIFO, priority 20) and lock all memory (mlockall), where the system \
                                permits it.";
    }
}

config_section! {
    /// Where the truck stands at start, in the map (ENU).
    StartPose "start_pose" {
        x_m: f64 = 0.0, "m", Range(-1000.0, 1000.0), Ours, "East.";
        y_m: f64 = 0.0, "m", Range(-1000.0, 1000.0), Ours, "North.";
        yaw_rad: f64 = std::f64::consts::FRAC_PI_2, "rad", Range(-7.0, 7.0), Ours, "Counter-clockwise from \
            east; π/2 = facing north.";
    }
}

config_section! {
    /// Planned goals: on which map.
    MapSection "navigation" {
        map: String = String::new(), "", Text, Ours, "Map to plan on, a YAML file of ROS's map_server; empty \
                                      = the fleet's, from `fleet-cli map serve`.";
    }
}

/// The second level: the map, and beside it the sections of [`NavSettings`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NavigationSection {
    /// See [`MapSection`].
    pub map: String,
    /// Along a path.
    pub drive: DriveSettings,
    /// On arrival.
    pub arrival: ArrivalSettings,
    /// What is not on the map.
    pub unknown: UnknownSettings,
    /// Where it is.
    pub pose: PoseSettings,
}

impl NavigationSection {
    fn parameters(&self) -> Vec<Parameter> {
        let mut all = MapSection { map: self.map.clone() }.parameters();
        all.extend(self.settings().parameters());
        all
    }

    /// How it drives.
    #[must_use]
    pub fn settings(&self) -> NavSettings {
        let Self { drive, arrival, unknown, pose, .. } = self.clone();
        NavSettings { drive, arrival, unknown, pose }
    }
}

config_section! {
    /// The robot as a node of ROS 2 (docs/ros2.md).
    Ros2Section "ros2" {
        enabled: bool = false, "", Switch, Ours, "Speak ROS 2 as rmw_zenoh does, beside the fleet's own \
                               protocol.";
        domain_id: u32 = 0, "", Range(0.0, 232.0), Ours, "ROS_DOMAIN_ID.";
        namespace: String = String::new(), "", Text, Ours, "Namespace of the robot's topics, such as /xtb_1; \
                               empty = that of its name.";
        distro: String = "kilted".to_owned(), "", OneOf(&["jazzy", "kilted", "lyrical", "rolling"]), Ours,
                         "Release of ROS 2: the feedback of navigate_to_pose differs between them.";
    }
}

/// How the robot speaks ROS 2.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ros2 {
    /// `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// The node's namespace.
    pub namespace: RosName,
    /// For the types that differ between releases.
    pub distro: Distro,
}

impl Ros2 {
    /// In this domain, with the namespace of its name.
    #[must_use]
    pub fn of(robot: &Name, domain: u32) -> Self {
        Self { domain, namespace: RosName::robot(robot), distro: Distro::default() }
    }
}

impl Ros2Section {
    /// `None` = not at all.
    fn of(&self, robot: &Name) -> Result<Option<Ros2>, ConfigProblem> {
        if !self.enabled {
            return Ok(None);
        }
        let namespace = match self.namespace.as_str() {
            "" => RosName::robot(robot),
            text => RosName::new(text).ok().filter(|name| name.as_str() != "/").ok_or_else(|| {
                ConfigProblem::Value(ConfigError::Conflict {
                    name: "ros2.namespace".into(),
                    value: format!("{text:?}"),
                    reason:
                        "a namespace is /a or /a/b, each part of A-Z, a-z, 0-9 and _, not beginning with a \
                             digit"
                            .into(),
                })
            })?,
        };
        let distro = Distro::of(&self.distro).unwrap_or_default();
        Ok(Some(Ros2 { domain: self.domain_id, namespace, distro }))
    }
}

/// The whole file.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConfigFile {
    /// Who.
    pub agent: AgentSection,
    /// How to reach the others.
    pub zenoh: ZenohSection,
    /// Where plugged in.
    pub hardware: HardwareSection,
    /// How its control loop runs.
    pub control: ControlSection,
    /// As a node of ROS 2.
    pub ros2: Ros2Section,
    /// Where it stands.
    pub start_pose: StartPose,
    /// The second level.
    pub navigation: NavigationSection,
    /// What it is.
    pub vehicle: VehicleConfig,
}

/// What an agent needs to run, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct AgentConfig {
    /// Its fleet.
    pub fleet: Name,
    /// Its name.
    pub robot: Name,
    /// Peer instead of client.
    pub peer: bool,
    /// Routers to try.
    pub connect: Vec<String>,
    /// Its identity; `None` = it uses a router without identities.
    pub identity: Option<Enrolled>,
    /// Where it stands at start.
    pub start_pose: MapPose,
    /// Its vehicle.
    pub vehicle: VehicleConfig,
    /// How it drives along paths.
    pub navigation: NavSettings,
    /// Its own map; `None` = the fleet's.
    pub map: Option<PathBuf>,
    /// As a node of ROS 2; `None` = it is none.
    pub ros2: Option<Ros2>,
    /// Folder for a recording of every step.
    pub record: Option<PathBuf>,
    /// Where settings are saved that were changed while it ran; `None` = nowhere.
    pub settings_file: Option<PathBuf>,
    /// Its control loop with real-time priority and in locked memory, where permitted. Without effect where loops
    /// share threads.
    pub realtime: bool,
    /// Times real time that its simulated world runs; 1 for every real robot.
    pub world_speed: f64,
}

impl AgentConfig {
    /// How its session is opened.
    #[must_use]
    pub fn opening(&self) -> Opening {
        let connect = self.connect.clone();
        let role = if self.peer { SessionRole::Peer { connect } } else { SessionRole::Client { connect } };
        Opening::of(role).tls(self.identity.as_ref().map(Enrolled::tls))
    }
}

impl ConfigFile {
    /// Whether every value is in its range, and the values fit each other.
    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        validate(&self.own_parameters())?;
        self.navigation.settings().validate()?;
        self.vehicle.validate()?;
        self.validate_rates()
    }

    fn own_parameters(&self) -> Vec<Parameter> {
        let mut all = self.agent.parameters();
        all.extend(self.zenoh.parameters());
        all.extend(self.hardware.parameters());
        all.extend(self.control.parameters());
        all.extend(self.ros2.parameters());
        all.extend(self.start_pose.parameters());
        all.extend(self.navigation.parameters());
        all
    }

    /// Serial lines that are too slow for what has to go over them are refused.
    fn validate_rates(&self) -> Result<(), ConfigError> {
        let hardware = &self.hardware;
        if hardware.kind != "serial" {
            return Ok(());
        }
        let board = LineRates::board(self.vehicle.encoder.window_s, self.vehicle.remote.period_ms);
        let (board, gyro) = match self.vehicle.imu {
            Imu::ThreeDmG => (board, Some(LineRates::gyro())),
            Imu::Bno085Rvc => (board.with_bno085(), None),
        };
        let is_wide = self.vehicle.range_finders.need_wide_scan();
        let board = if is_wide { board.with_wide_scans() } else { board };
        let board = Some(("hardware.board_baud", hardware.board_baud, board));
        let gyro = gyro.map(|gyro| ("hardware.gyro_baud", hardware.gyro_baud, gyro));
        for (name, baud, line) in board.into_iter().chain(gyro) {
            line.check(baud).map_err(|too_slow| ConfigError::Conflict {
                name: name.into(),
                value: baud.to_string(),
                reason: too_slow.to_string(),
            })?;
        }
        Ok(())
    }

    /// The robot of this identity: name, fleet and, unless others with TLS are set, routers are its own.
    ///
    /// # Errors
    /// [`ConfigProblem::Identity`]: a setting that goes with no identity, or not with this one.
    pub fn identify(&mut self, identity: &Identity) -> Result<(), ConfigProblem> {
        let usual = Self::default();
        let own = identity.name.as_str();
        let other = |set: &str, usual: &str, own: &str| set != usual && set != own;
        if identity.role != Role::Robot {
            let (message, hint) = (
                format!("{own} is {}, not a robot", identity.role.noun()),
                "enrol a robot's file, of `fleet-cli pki add-robot`",
            );
            return Err(ConfigProblem::Identity { message, hint: hint.into() });
        }
        for (what, set, usual, own) in [
            ("robot", &mut self.agent.name, usual.agent.name, own),
            ("fleet", &mut self.agent.fleet, usual.agent.fleet, identity.fleet.as_str()),
        ] {
            if other(set, &usual, own) {
                let message = format!("the {what} is set to {set}, but the identity is of {what} {own}");
                let hint = "leave name and fleet out: they follow from the identity";
                return Err(ConfigProblem::Identity { message, hint: hint.into() });
            }
            *set = own.to_owned();
        }
        if self.zenoh.mode == "peer" {
            let message = format!("peers have no identity, but this computer has that of {own}");
            let hint = "zenoh.mode = \"client\" uses a router; --identity none goes without the identity";
            return Err(ConfigProblem::Identity { message, hint: hint.into() });
        }
        if self.zenoh.connect == usual.zenoh.connect {
            self.zenoh.connect = identity.routers.clone();
        }
        match self.zenoh.connect.iter().find(|endpoint| !endpoint.starts_with("tls/")) {
            None => Ok(()),
            Some(endpoint) => Err(ConfigProblem::Identity {
                message: format!("{endpoint} has no TLS: the identity of {own} is not used there"),
                hint: format!(
                    "connect to {} (the default without --connect); --identity none goes without the identity",
                    identity.routers.first().map_or("tls/HOST:7447", String::as_str)
                ),
            }),
        }
    }

    /// All settings as commented TOML.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let own = render_toml("", &self.own_parameters());
        format!(
            "# Configuration of robot-agent. Every line is optional: these are the values in effect.\n\
             {own}{}",
            render_toml("vehicle.", &self.vehicle.parameters())
        )
    }

    /// What the agent needs, with names and planned speeds checked.
    ///
    /// # Errors
    /// [`ConfigProblem::Name`]; [`ConfigProblem::Value`] for speeds from which this vehicle cannot stop.
    pub fn agent(&self) -> Result<AgentConfig, ConfigProblem> {
        let navigation = self.navigation.settings();
        navigation.validate_for(&self.vehicle)?;
        let StartPose { x_m, y_m, yaw_rad } = self.start_pose;
        let robot = Name::robot(&self.agent.name)?;
        Ok(AgentConfig {
            fleet: Name::new(&self.agent.fleet)?,
            ros2: self.ros2.of(&robot)?,
            robot,
            peer: self.zenoh.mode == "peer",
            connect: self.zenoh.connect.clone(),
            identity: None,
            start_pose: MapPose { x_m, y_m, yaw_rad },
            vehicle: self.vehicle.clone(),
            map: (!self.navigation.map.is_empty()).then(|| PathBuf::from(&self.navigation.map)),
            navigation,
            record: None,
            settings_file: None,
            realtime: self.control.realtime,
            world_speed: 1.0,
        })
    }
}
