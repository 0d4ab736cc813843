//! The fleet config: an optional TOML file with the fleet's name, routers, roster and aliases, and where robots go by
//! themselves.

mod observer;

pub use observer::{AlertsConfig, HistoryConfig, observer};

use crate::nearest::nearest;
use crate::text::width::text_width;
use robot_agent::files;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::{Table, Value};
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::config::{ConfigError, validate};
use xtb_control::frames::MapPose;
use xtb_dispatch::{HomeRules, HomeSettings};
use xtb_protocol::Name;
use xtb_protocol::messages::{MAX_COORDINATE_M, RosterEntry, place_name};
use xtb_protocol::text::{is_control, is_invisible};

/// Columns of an alias at most.
const ALIAS: usize = 24;

const TOP: [&str; 7] = ["fleet", "connect", "robots", "home", "alerts", "history", "aliases"];
const HOME: [&str; 4] = ["now_margin_v", "resume_margin_v", "park_after_s", "robots"];
const ROBOT: [&str; 3] = ["name", "tags", "start_pose"];
const POSE: [&str; 3] = ["x_m", "y_m", "yaw_rad"];

/// What the file says; every field may be left out.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FleetConfig {
    /// The fleet's name.
    pub fleet: Option<Name>,
    /// Its routers.
    pub connect: Vec<String>,
    /// Which robots should be there.
    pub robots: Vec<RosterEntry>,
    /// When the dispatcher sends robots to docks and parking places; `None` = never.
    pub home: Option<HomeConfig>,
    /// When the dispatcher calls for a person, and how.
    pub alerts: AlertsConfig,
    /// How much history it keeps.
    pub history: HistoryConfig,
    /// What people here call robots, for screens only.
    pub aliases: BTreeMap<Name, String>,
}

/// The section `home`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, Serialize)]
#[serde(default)]
pub struct HomeConfig {
    /// When.
    #[serde(flatten)]
    pub settings: HomeSettings,
    /// Robots with a place of their own, and that place.
    pub robots: BTreeMap<Name, Name>,
}

impl From<HomeConfig> for HomeRules {
    fn from(HomeConfig { settings, robots }: HomeConfig) -> Self {
        Self { settings, homes: robots }
    }
}

impl FleetConfig {
    /// Reads `named`, or the file at its default place if there is one.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]: the file cannot be read, or what it says is not valid.
    pub fn find(named: Option<&Path>) -> Result<Self> {
        let Some(path) = named.map(Path::to_owned).or_else(|| default_path().filter(|path| path.exists()))
        else {
            return Ok(Self::default());
        };
        let place = path.display();
        let text = files::text(&path, files::MAX_TEXT).map_err(|error| {
            Error::new(ErrorKind::Config, format!("cannot read the config {place}: {error}"))
                .hint("name another one with --config or XTB_CONFIG")
        })?;
        Self::parse(&text)
            .map_err(|failure| Error { message: format!("in {place}: {}", failure.message), ..failure })
    }

    /// Reads a file's text.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] with the key or the line that is wrong.
    pub fn parse(text: &str) -> Result<Self> {
        let invalid = |error: toml::de::Error| Error::new(ErrorKind::Config, error.to_string().trim_end());
        known_keys(&text.parse::<Table>().map_err(invalid)?)?;
        let config: Self = toml::from_str(text).map_err(invalid)?;
        for (i, robot) in config.robots.iter().enumerate() {
            Name::robot(robot.name.as_str())
                .map_err(|error| Error::new(ErrorKind::Config, format!("robots[{i}].name: {error}")))?;
            if config.robots[..i].iter().any(|other| other.name == robot.name) {
                return Err(Error::new(
                    ErrorKind::Config,
                    format!("two robots have the name {}", robot.name),
                ));
            }
            if let Some(pose) = robot.start_pose {
                in_range(&format!("robots[{i}].start_pose"), &pose)?;
            }
        }
        if let Some(home) = &config.home {
            let invalid = |error: ConfigError| Error::new(ErrorKind::Config, error.to_string());
            validate(&home.settings.parameters()).map_err(invalid)?;
            for (robot, place) in &home.robots {
                place_name(place.as_str()).map_err(|error| {
                    Error::new(ErrorKind::Config, format!("home.robots.{robot}: {error}"))
                })?;
            }
        }
        config.alerts.check()?;
        config.history.check()?;
        check_aliases(&config.aliases)?;
        Ok(config)
    }
}

/// An alias fits beside a name, does nothing to a terminal, and is mistaken for no other robot.
fn check_aliases(aliases: &BTreeMap<Name, String>) -> Result<()> {
    for (robot, alias) in aliases {
        let wrong = |what: String| {
            let error = Error::new(ErrorKind::Config, format!("aliases.{robot} = {alias:?} {what}"));
            Err(error.hint(format!("an alias is 1 to {ALIAS} columns wide, and only one robot has it")))
        };
        if alias.trim() != alias || alias.is_empty() || text_width(alias) > ALIAS {
            return wrong("is empty, too wide, or begins or ends with a blank".into());
        }
        if alias.contains(|c| is_control(c) || is_invisible(c)) {
            return wrong("has a character that cannot be shown".into());
        }
        Name::robot(robot.as_str())
            .map_err(|error| Error::new(ErrorKind::Config, format!("aliases.{robot}: {error}")))?;
        let is_taken =
            |(other, own): (&Name, &String)| other != robot && (own == alias || other.as_str() == alias);
        if let Some((other, _)) = aliases.iter().find(|(other, own)| is_taken((other, own))) {
            return wrong(format!("is {other}'s too"));
        }
    }
    Ok(())
}

/// The ranges of the agent's own `start_pose`.
fn in_range(place: &str, pose: &MapPose) -> Result<()> {
    for (field, value, max) in [
        ("x_m", pose.x_m, MAX_COORDINATE_M),
        ("y_m", pose.y_m, MAX_COORDINATE_M),
        ("yaw_rad", pose.yaw_rad, 7.0),
    ] {
        if !(-max..=max).contains(&value) {
            let message = format!("{place}.{field} = {value:?} is not allowed: {:?}..={max:?}", -max);
            return Err(Error::new(ErrorKind::Config, message));
        }
    }
    Ok(())
}

fn default_path() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = absolute("XDG_CONFIG_HOME").or_else(|| absolute("HOME").map(|home| home.join(".config")))?;
    Some(base.join("xtb").join("fleet.toml"))
}

/// Serde would name an unknown key, but not the one that was meant.
fn known_keys(top: &Table) -> Result<()> {
    check(top, "", &TOP)?;
    if let Some(home) = top.get("home").and_then(Value::as_table) {
        check(home, "home.", &HOME)?;
    }
    for (name, known) in [("alerts", &observer::ALERTS[..]), ("history", &observer::HISTORY)] {
        top.get(name).and_then(Value::as_table).map_or(Ok(()), |it| check(it, &format!("{name}."), known))?;
    }
    let robots = top.get("robots").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    for (i, robot) in robots.iter().enumerate() {
        let Some(robot) = robot.as_table() else { continue };
        check(robot, &format!("robots[{i}]."), &ROBOT)?;
        if let Some(pose) = robot.get("start_pose").and_then(Value::as_table) {
            check(pose, &format!("robots[{i}].start_pose."), &POSE)?;
        }
    }
    Ok(())
}

fn check(table: &Table, path: &str, known: &[&str]) -> Result<()> {
    let Some(key) = table.keys().find(|key| !known.contains(&key.as_str())) else { return Ok(()) };
    let hint = match nearest(key, known.iter().copied()) {
        Some(near) => format!("did you mean {path}{near}?"),
        None => format!("known here: {}", known.join(", ")),
    };
    Err(Error::new(ErrorKind::Config, format!("unknown key {path}{key}")).hint(hint))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_file_is_read() {
        let config = FleetConfig::parse(
            r#"
            fleet = "hall"
            connect = ["tcp/10.0.0.1:7447"]
            [[robots]]
            name = "xtb-1"
            tags = ["arm"]
            start_pose = { x_m = 1.0, y_m = -2.0, yaw_rad = 0.5 }
            [[robots]]
            name = "xtb-2"
            [aliases]
            xtb-2 = "Roter Käfer"
            "#,
        )
        .unwrap();
        assert_eq!(config.fleet.unwrap().as_str(), "hall");
        assert_eq!(config.robots[0].start_pose.unwrap().y_m, -2.0);
        assert_eq!(config.robots[1].name.as_str(), "xtb-2");
        assert_eq!(config.aliases[&Name::new("xtb-2").unwrap()], "Roter Käfer");
        assert_eq!(FleetConfig::parse("").unwrap(), FleetConfig::default());
    }

    #[test]
    fn an_unknown_key_is_an_error_that_names_the_one_meant() {
        for (text, key, hint) in [
            ("conect = []", "unknown key conect", "did you mean connect?"),
            ("[[robots]]\nnme = 'a'", "unknown key robots[0].nme", "did you mean robots[0].name?"),
            ("[[robots]]\nname = 'a'\nstart_pose = { x = 1 }", "robots[0].start_pose.x", "x_m"),
            (
                "zzz = 1",
                "unknown key zzz",
                "known here: fleet, connect, robots, home, alerts, history, aliases",
            ),
            ("[alerts]\nblocked = 5", "unknown key alerts.blocked", "did you mean alerts.blocked_s?"),
        ] {
            let failure = FleetConfig::parse(text).unwrap_err();
            assert!(failure.message.contains(key), "{failure:?}");
            assert!(failure.hint.contains(hint), "{failure:?}");
        }
    }

    #[test]
    fn the_rules_for_docks_are_read_with_their_usual_values() {
        let read = |text: &str| FleetConfig::parse(text).unwrap().home;
        assert_eq!(read(""), None);
        let usual = HomeRules::from(read("[home]").unwrap());
        assert_eq!(usual, HomeRules::default());
        let home = read("[home]\npark_after_s = 120\n[home.robots]\nxtb-1 = 'dock-1'").unwrap();
        assert_eq!(home.settings.park_after_s, 120.0);
        assert_eq!(home.settings.resume_margin_v, usual.settings.resume_margin_v);
        assert_eq!(HomeRules::from(home).homes.values().next().unwrap().as_str(), "dock-1");
        for text in [
            "[home]\npark_after = 3",
            "[home]\npark_after_s = -1",
            "[home]\nnow_margin_v = nan",
            "[home.robots]\nxtb-1 = '2'",
            "home = 3",
        ] {
            assert_eq!(FleetConfig::parse(text).unwrap_err().kind, ErrorKind::Config, "{text}");
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for text in [
            "fleet = 'Lab'",
            "fleet = 3",
            "fleet",
            "[[robots]]\nname = 'all'",
            "[[robots]]\nname = 'a'\n[[robots]]\nname = 'a'",
            "[[robots]]\nname = 'a'\nstart_pose = { x_m = nan, y_m = 0, yaw_rad = 0 }",
            "[[robots]]\nname = 'a'\nstart_pose = { x_m = 0, y_m = 1001, yaw_rad = 0 }",
            "[aliases]\na = ''",
            "[aliases]\na = ' x'",
            "[aliases]\na = 'more than twenty-four columns'",
            "[aliases]\na = \"\\u001b[2J\"",
            "[aliases]\na = \"x\\u202ey\"",
            "[aliases]\na = 'x'\nb = 'x'",
            "[aliases]\na = 'b'\nb = 'x'",
            "[aliases]\nall = 'x'",
            "[aliases]\nA = 'x'",
        ] {
            assert_eq!(FleetConfig::parse(text).unwrap_err().kind, ErrorKind::Config, "{text}");
        }
    }
}
