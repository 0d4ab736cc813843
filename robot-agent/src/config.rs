//! The agent's configuration: one table with defaults, over it a TOML file, over that flags and environment.
//!
//! `robot-agent --print-config` prints what is in force, each line with its unit, range and origin,
//! ready to be saved and edited. Unknown keys are errors with a suggestion: a misspelt limit must
//! not be silently the default.

use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use thiserror::Error;
use toml::{Table, Value};
use xtb_bus::Role;
use xtb_control::VehicleConfig;
use xtb_control::config::{Allowed::*, ConfigError, Origin::*, Parameter, render_toml, validate};
use xtb_control::config_section;
use xtb_control::frames::MapPose;
use xtb_nav::NavSettings;
use xtb_nav::settings::{ArrivalSettings, DriveSettings, PoseSettings, UnknownSettings};
use xtb_protocol::Name;
use xtb_protocol::board::rates::LineRates;
use xtb_protocol::keys::NameError;

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
        connect: Vec<String> = vec!["tcp/127.0.0.1:7447".to_owned()], "", Text, Ours, "Routers to try.";
    }
}

config_section! {
    /// Where the truck is plugged in.
    HardwareSection "hardware" {
        kind: String = "none".to_owned(), "", OneOf(&["none", "serial", "simulated"]), Ours, "serial, or \
                        simulated (one truck in an empty room). With none the agent does not start.";
        board: String = "/dev/ttyUSB0".to_owned(), "", Text, Assumed, "The I/O board's serial port.";
        gyro: String = "/dev/ttyUSB1".to_owned(), "", Text, Assumed, "The gyro's serial port.";
        board_baud: u32 = 115_200, "baud", Range(1200.0, 4_000_000.0), Ours, "The board's baud rate. The \
                                    rate needed is computed from the frame periods; the memorandum's 9600 is \
                                    too low.";
        gyro_baud: u32 = 38_400, "baud", Range(1200.0, 115_200.0), Printed("§2.2"), "The gyro's baud rate.";
        seed: u32 = 1, "", Range(0.0, 4_294_967_295.0), Ours, "Seed of the simulated truck.";
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
    /// Where it stands.
    pub start_pose: StartPose,
    /// The second level.
    pub navigation: NavigationSection,
    /// What it is.
    pub vehicle: VehicleConfig,
}

/// A configuration that cannot be used.
#[derive(Debug, Error)]
pub enum ConfigProblem {
    /// The file cannot be read.
    #[error("cannot read {path}: {reason}")]
    Read {
        /// Its path.
        path: String,
        /// The system's words.
        reason: String,
    },
    /// Not TOML.
    #[error("{origin}: {reason}")]
    Syntax {
        /// File or flag.
        origin: String,
        /// The parser's words, with line and column.
        reason: String,
    },
    /// A key that means nothing.
    #[error("{origin}: unknown key {key}{}", suggestion(.nearest))]
    UnknownKey {
        /// File or flag.
        origin: String,
        /// With its sections.
        key: String,
        /// The nearest key that exists.
        nearest: Option<String>,
    },
    /// A value of the wrong type.
    #[error("{origin}: {reason}")]
    Type {
        /// File or flag.
        origin: String,
        /// What was expected.
        reason: String,
    },
    /// A value out of its range.
    #[error(transparent)]
    Value(#[from] ConfigError),
    /// A name that cannot stand in a key.
    #[error(transparent)]
    Name(#[from] NameError),
}

fn suggestion(nearest: &Option<String>) -> String {
    nearest.as_ref().map(|key| format!("; did you mean {key}?")).unwrap_or_default()
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
    /// Where it stands at start.
    pub start_pose: MapPose,
    /// Its vehicle.
    pub vehicle: VehicleConfig,
    /// How it drives along paths.
    pub navigation: NavSettings,
    /// Its own map; `None` = the fleet's.
    pub map: Option<PathBuf>,
    /// Folder for a recording of every step.
    pub record: Option<PathBuf>,
    /// Times real time that its simulated world runs; 1 for every real robot.
    pub world_speed: f64,
}

impl AgentConfig {
    /// What its session is on the network.
    #[must_use]
    pub fn role(&self) -> Role {
        let connect = self.connect.clone();
        if self.peer { Role::Peer { connect } } else { Role::Client { connect } }
    }
}

/// Collects settings, the later ones over the earlier ones.
#[derive(Debug, Clone, Default)]
pub struct Layers(Table);

impl Layers {
    /// Puts a file's settings on top.
    ///
    /// # Errors
    /// [`ConfigProblem::Syntax`] or [`ConfigProblem::UnknownKey`].
    pub fn file(&mut self, origin: &str, text: &str) -> Result<(), ConfigProblem> {
        let table: Table = text.parse().map_err(|error: toml::de::Error| ConfigProblem::Syntax {
            origin: origin.to_owned(),
            reason: error.to_string().trim_end().to_owned(),
        })?;
        refuse_unknown(origin, "", &table, &known_keys()?)?;
        merge(&mut self.0, table);
        Ok(())
    }

    /// Puts one setting on top: a dotted key and its value.
    ///
    /// # Errors
    /// [`ConfigProblem::UnknownKey`].
    pub fn set(&mut self, origin: &str, key: &str, value: Value) -> Result<(), ConfigProblem> {
        let nested = key
            .rsplit('.')
            .fold(value, |inner, part| Value::Table(Table::from_iter([(part.to_owned(), inner)])));
        let Value::Table(table) = nested else { return Ok(()) };
        refuse_unknown(origin, "", &table, &known_keys()?)?;
        merge(&mut self.0, table);
        Ok(())
    }

    /// Puts one setting on top as a command line gives it: what is not a number, a switch or quoted is
    /// text, and a section of the vehicle needs no `vehicle.` in front.
    ///
    /// # Errors
    /// [`ConfigProblem::UnknownKey`].
    pub fn set_text(&mut self, origin: &str, key: &str, value: &str) -> Result<(), ConfigProblem> {
        let value = value.parse().unwrap_or_else(|_| Value::String(value.to_owned()));
        let first = key.split('.').next().unwrap_or_default();
        let known = known_keys()?;
        let of_vehicle = known.get("vehicle").is_some_and(|vehicle| vehicle.get(first).is_some());
        if known.contains_key(first) || !of_vehicle {
            return self.set(origin, key, value);
        }
        self.set(origin, &format!("vehicle.{key}"), value)
    }

    /// The settings in force, checked.
    ///
    /// # Errors
    /// Every other [`ConfigProblem`].
    pub fn finish(self) -> Result<ConfigFile, ConfigProblem> {
        let file: ConfigFile =
            Value::Table(self.0).try_into().map_err(|error: toml::de::Error| ConfigProblem::Type {
                origin: "configuration".into(),
                reason: error.to_string().trim_end().to_owned(),
            })?;
        validate(&file.own_parameters())?;
        file.navigation.settings().validate()?;
        file.vehicle.validate()?;
        file.validate_rates()?;
        Ok(file)
    }
}

impl ConfigFile {
    fn own_parameters(&self) -> Vec<Parameter> {
        let mut all = self.agent.parameters();
        all.extend(self.zenoh.parameters());
        all.extend(self.hardware.parameters());
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
        for (name, baud, line) in [
            ("hardware.board_baud", hardware.board_baud, board),
            ("hardware.gyro_baud", hardware.gyro_baud, LineRates::gyro()),
        ] {
            line.check(baud).map_err(|too_slow| ConfigError::Conflict {
                name: name.into(),
                value: baud.to_string(),
                reason: too_slow.to_string(),
            })?;
        }
        Ok(())
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
        Ok(AgentConfig {
            fleet: Name::new(&self.agent.fleet)?,
            robot: Name::robot(&self.agent.name)?,
            peer: self.zenoh.mode == "peer",
            connect: self.zenoh.connect.clone(),
            start_pose: MapPose { x_m, y_m, yaw_rad },
            vehicle: self.vehicle.clone(),
            map: (!self.navigation.map.is_empty()).then(|| PathBuf::from(&self.navigation.map)),
            navigation,
            record: None,
            world_speed: 1.0,
        })
    }
}

fn known_keys() -> Result<Table, ConfigProblem> {
    Table::try_from(ConfigFile::default())
        .map_err(|error| ConfigProblem::Type { origin: "defaults".into(), reason: error.to_string() })
}

fn refuse_unknown(origin: &str, prefix: &str, given: &Table, known: &Table) -> Result<(), ConfigProblem> {
    for (key, value) in given {
        match (value, known.get(key)) {
            (_, None) => {
                return Err(ConfigProblem::UnknownKey {
                    origin: origin.to_owned(),
                    key: format!("{prefix}{key}"),
                    nearest: nearest(key, known).map(|near| format!("{prefix}{near}")),
                });
            }
            (Value::Table(given), Some(Value::Table(known))) => {
                refuse_unknown(origin, &format!("{prefix}{key}."), given, known)?;
            }
            _ => {}
        }
    }
    Ok(())
}

fn nearest<'a>(key: &str, known: &'a Table) -> Option<&'a String> {
    let likeness = |candidate: &&String| (strsim::jaro_winkler(key, candidate) * 1000.0) as u32;
    known.keys().max_by_key(likeness).filter(|best| likeness(best) >= 700)
}

fn merge(under: &mut Table, over: Table) {
    for (key, value) in over {
        match (under.get_mut(&key), value) {
            (Some(Value::Table(under)), Value::Table(over)) => merge(under, over),
            (_, value) => {
                under.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(text: &str) -> Result<ConfigFile, ConfigProblem> {
        let mut layers = Layers::default();
        layers.file("robot.toml", text)?;
        layers.finish()
    }

    #[test]
    fn the_printed_configuration_reads_back_as_itself() {
        let file = ConfigFile::default();
        assert_eq!(with(&file.to_toml()).unwrap(), file);
    }

    #[test]
    fn an_unknown_key_is_an_error_with_a_suggestion() {
        let error = with("[vehicle.speed]\nkpp = 3.0\n").unwrap_err().to_string();
        assert_eq!(error, "robot.toml: unknown key vehicle.speed.kpp; did you mean vehicle.speed.kp?");
        let error = with("[vehicel]\n").unwrap_err().to_string();
        assert!(error.ends_with("did you mean vehicle?"), "{error}");
    }

    #[test]
    fn a_value_out_of_range_names_field_value_and_range() {
        let error = with("[vehicle.goto]\ntolerance_m = 0.0\n").unwrap_err().to_string();
        assert_eq!(error, "goto.tolerance_m = 0.0 is not allowed: 0.01..=5 m");
    }

    #[test]
    fn a_setting_of_navigation_is_refused_by_its_whole_name() {
        let error = with("[navigation.drive]\nlook_ahead_m = 2.0\n").unwrap_err().to_string();
        assert_eq!(error, "navigation.drive.look_ahead_m = 2.0 is not allowed: 0.15..=0.6 m");
        let error = with("[navigation.drive]\nmeeting_mps = 0.4\n").unwrap_err().to_string();
        assert!(error.starts_with("navigation.drive.cruise_mps = 0.35 is not allowed: it must"), "{error}");
        let error = with("[navigation.pose]\ngates = 2\n").unwrap_err().to_string();
        assert!(error.ends_with("did you mean navigation.pose.gate?"), "{error}");
        // What a replay needs is in order; the truck that drives would not stop in time.
        let file = with("[vehicle.obstacle]\nthreshold_cm = 20.0\n").unwrap();
        let error = file.agent().unwrap_err().to_string();
        assert!(error.starts_with("navigation.drive.cruise_mps = 0.35 is not allowed: the 20 cm"), "{error}");
    }

    #[test]
    fn settings_of_navigation_reach_the_agent() {
        let text = "[navigation]\nmap = \"lab.yaml\"\n[navigation.drive]\ncruise_mps = 0.3\n\
                    [navigation.unknown]\nfades_s = 20\n";
        let agent = with(text).unwrap().agent().unwrap();
        assert_eq!(agent.map, Some(PathBuf::from("lab.yaml")));
        assert_eq!((agent.navigation.drive.cruise_mps, agent.navigation.unknown.fades_s), (0.3, 20.0));
    }

    #[test]
    fn later_layers_win() {
        let mut layers = Layers::default();
        layers.file("robot.toml", "[agent]\nname = \"red\"\nfleet = \"barn\"\n").unwrap();
        layers.set("--name", "agent.name", Value::String("blue".into())).unwrap();
        let agent = layers.finish().unwrap().agent().unwrap();
        assert_eq!((agent.robot.as_str(), agent.fleet.as_str()), ("blue", "barn"));
    }

    #[test]
    fn a_reserved_name_is_refused() {
        let error = with("[agent]\nname = \"all\"\n").unwrap().agent().unwrap_err();
        assert!(error.to_string().contains("reserved"), "{error}");
    }

    #[test]
    fn a_serial_line_that_is_too_slow_is_refused_and_what_would_do_is_said() {
        let refused = |setting: &str| {
            with(&format!("[hardware]\nkind = \"serial\"\n{setting}\n")).unwrap_err().to_string()
        };
        let board = refused("board_baud = 9600");
        assert!(board.starts_with("hardware.board_baud = 9600 is not allowed: the frames need"), "{board}");
        assert!(board.ends_with("use at least 28800 (38400 is usual)"), "{board}");
        assert!(refused("gyro_baud = 9600").contains("use at least 14400 (19200 is usual)"));
        // A shorter window needs more.
        assert!(refused("[vehicle.encoder]\nwindow_s = 0.001").contains("use at least 230400"));
        with("[hardware]\nkind = \"serial\"\nboard_baud = 28800\ngyro_baud = 14400\n").unwrap();
        with("[hardware]\nboard_baud = 9600\n").unwrap();
    }

    #[test]
    fn the_table_of_rates_has_the_pwm_frames_own_period() {
        use xtb_robot::robot::PWM_FRAME_NS;
        assert_eq!(xtb_protocol::board::rates::PWM_EVERY_S, PWM_FRAME_NS as f64 * 1e-9);
    }
}
