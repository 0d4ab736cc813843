//! Text: the fleet's config, the agent's, and the lines of a trace.

use fleet_cli::config::{AlertsConfig, FleetConfig, HistoryConfig, HomeConfig};
use robot_agent::config::{ConfigFile, ConfigProblem, SettingLayers};
use serde::Serialize;
use std::collections::BTreeMap;
use xtb_client::ErrorKind;
use xtb_control::controller::Controller;
use xtb_control::{Command, Outputs, Sample, Stamp, VehicleConfig};
use xtb_protocol::Name;
use xtb_protocol::messages::RosterEntry;
use xtb_protocol::trace::{TraceReader, exact_decision_line, sample_line};

/// A fleet config as it would be printed.
#[derive(Serialize)]
struct Printed<'a> {
    fleet: &'a Option<Name>,
    connect: &'a [String],
    robots: &'a [RosterEntry],
    #[serde(skip_serializing_if = "Option::is_none")]
    home: &'a Option<HomeConfig>,
    aliases: &'a BTreeMap<Name, String>,
    alerts: &'a AlertsConfig,
    history: &'a HistoryConfig,
}

/// The fleet's config file.
#[must_use]
pub fn fleet_config(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let config = match FleetConfig::parse(text) {
        Ok(config) => config,
        Err(failure) => {
            assert!(failure.kind == ErrorKind::Config && !failure.message.is_empty(), "{failure:?}");
            return false;
        }
    };
    for (i, robot) in config.robots.iter().enumerate() {
        assert!(Name::robot(robot.name.as_str()).is_ok(), "{robot:?}");
        assert!(config.robots[..i].iter().all(|other| other.name != robot.name), "{robot:?}");
        if let Some(pose) = robot.start_pose {
            assert!([pose.x_m, pose.y_m].iter().all(|m| (-1000.0..=1000.0).contains(m)), "{pose:?}");
            assert!((-7.0..=7.0).contains(&pose.yaw_rad), "{pose:?}");
        }
    }
    let FleetConfig { fleet, connect, robots, home, aliases, alerts, history } = &config;
    let printed = toml::to_string(&Printed { fleet, connect, robots, home, aliases, alerts, history })
        .unwrap_or_else(|error| panic!("{config:?}: {error}"));
    let again =
        FleetConfig::parse(&printed).unwrap_or_else(|failure| panic!("{}:\n{printed}", failure.message));
    assert_eq!(again, config);
    true
}

/// The agent's config file.
#[must_use]
pub fn agent_config(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let config = match configured(text) {
        Ok(config) => config,
        Err(problem) => {
            assert!(!problem.to_string().is_empty());
            return false;
        }
    };
    assert!(config.vehicle.validate().is_ok());
    let printed = config.to_toml();
    let again = configured(&printed).unwrap_or_else(|problem| panic!("{problem}:\n{printed}"));
    assert_eq!(again, config);
    if let Ok(agent) = config.agent() {
        assert!(Name::robot(agent.robot.as_str()).is_ok());
        let pose = agent.start_pose;
        assert!([pose.x_m, pose.y_m, pose.yaw_rad].iter().all(|number| number.is_finite()), "{pose:?}");
    }
    true
}

fn configured(text: &str) -> Result<ConfigFile, ConfigProblem> {
    let mut layers = SettingLayers::default();
    layers.file("robot.toml", text)?;
    layers.finish()
}

/// A trace, line by line; what it lets through, the controller bears.
#[must_use]
pub fn trace(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let mut reader = TraceReader::default();
    let mut controller = Controller::new(VehicleConfig::default());
    let mut before = Stamp::ZERO;
    let mut accepted = false;
    for line in text.lines() {
        let (t, sample) = match reader.line(line) {
            Ok(read) => read,
            Err(error) => {
                assert!(!error.to_string().is_empty());
                counts_as_not_read(&reader, before);
                continue;
            }
        };
        accepted = true;
        assert!(t >= before, "{t:?} after {before:?}");
        before = t;
        assert!(in_range(&sample), "{sample:?}");
        let printed = sample_line(t, &sample);
        assert_eq!(TraceReader::default().line(&printed), Ok((t, sample)), "{printed}");
        let cut = line.trim_ascii_end();
        assert!(TraceReader::default().line(&cut[..cut.len() - 1]).is_err(), "half a line was read");
        decides(&controller.step(t, &sample));
    }
    accepted
}

/// A refused line has not moved the reader's clock.
fn counts_as_not_read(reader: &TraceReader, before: Stamp) {
    let next = sample_line(before, &Sample::Encoder { pulses: 23 });
    assert_eq!(reader.clone().line(&next), Ok((before, Sample::Encoder { pulses: 23 })));
}

fn in_range(sample: &Sample) -> bool {
    match sample {
        Sample::Adc(adc) => {
            let all = adc.ir_front.iter().chain(&adc.ir_rear).chain(&adc.tilt).chain(&adc.pistons);
            all.into_iter().all(|count| (0.0..=1023.0).contains(&count.get()))
        }
        Sample::Command(Command::Goto(goal)) => goal.x_m().is_finite() && goal.y_m().is_finite(),
        Sample::Command(Command::Teleop { rpm, steering } | Command::Follow { rpm, steering }) => {
            rpm.get().abs() <= 353.0 && steering.get().abs() <= 1.0
        }
        _ => true,
    }
}

fn decides(outputs: &Outputs) {
    let numbers = [outputs.reference_rpm, outputs.rpm, outputs.pose.x_m, outputs.pose.y_m];
    assert!(numbers.iter().all(|number| number.is_finite()), "{}", exact_decision_line(outputs));
    // A number that is not finite would be printed as null.
    assert!(!exact_decision_line(outputs).contains(r#"_m":null"#));
}
