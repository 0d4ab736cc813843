//! Diagnostics: the robot as a whole, each of its faults and each latched stop, with what to do about it.

use crate::names::RosName;
use crate::types::{DiagnosticArray, DiagnosticStatus, Header, KeyValue, Level, Time};
use xtb_protocol::messages::texts::for_robot;
use xtb_protocol::messages::{BatteryLevel, Fault, RobotState};
use xtb_robot::faults::stops;

/// How bad a state is: an error while a stop is latched or a fault is there that stops the robot, a warning with any
/// other fault.
#[must_use]
pub fn level(state: &RobotState) -> Level {
    let faults = state.faults.iter().map(|state| of_fault(state.fault)).max().unwrap_or(Level::Ok);
    let battery = if state.battery_level >= BatteryLevel::Warn { Level::Warn } else { Level::Ok };
    if state.latches.is_empty() { faults.max(battery) } else { Level::Error }
}

/// Faults with which the robot drives on are warnings.
fn of_fault(fault: Fault) -> Level {
    if stops(fault).is_some() { Level::Error } else { Level::Warn }
}

/// How a robot is. `notes` is what else is to be said, as names and values: the original name of the node that drives
/// it, a second publisher that is fenced, what a velocity command was cut down to.
#[must_use]
pub fn diagnostics(stamp: &Time, state: &RobotState, notes: &[(&str, String)]) -> DiagnosticArray {
    let namespace = RosName::robot(&state.robot);
    let part = |part: &str, level: Level, message: String, values: Vec<KeyValue>| DiagnosticStatus {
        level: level as u8,
        name: format!("{}: {part}", namespace.relative()),
        message,
        hardware_id: state.robot.to_string(),
        values,
    };
    let remedy = |remedy: &str| vec![value("remedy", for_robot(remedy, &state.robot))];
    let faults = state.faults.iter().map(|it| {
        let detail = it.detail.iter().map(|detail| value("detail", detail.clone()));
        let values = remedy(it.fault.remedy()).into_iter().chain(detail).collect();
        part(&it.fault.to_string(), of_fault(it.fault), it.fault.text().to_owned(), values)
    });
    let latches = state.latches.iter().map(|it| {
        let values = vec![value("remedy", it.remedy(state)), value("by", it.by.clone())];
        part(&format!("latch {}", it.latch), Level::Error, it.latch.text().to_owned(), values)
    });
    let robot = part("robot", level(state), summary(state), values(state, notes));
    let status = std::iter::once(robot).chain(faults).chain(latches).collect();
    DiagnosticArray { header: Header { stamp: stamp.clone(), frame_id: String::new() }, status }
}

/// Why it stands, or that it drives.
fn summary(state: &RobotState) -> String {
    let reasons: Vec<_> = state.stopped_because.iter().map(|reason| reason.text()).collect();
    if reasons.is_empty() { "driving".to_owned() } else { format!("stopped: {}", reasons.join(", ")) }
}

fn values(state: &RobotState, notes: &[(&str, String)]) -> Vec<KeyValue> {
    let holder = state.lease.as_ref().map_or_else(|| "none".to_owned(), |lease| lease.holder.to_string());
    let volts = state.battery_v.map_or_else(|| "unknown".to_owned(), |volts| format!("{volts:.2} V"));
    let goal = state.goal.as_ref().map(|goal| {
        let reason = goal.reason.as_ref().map_or_else(String::new, |reason| format!(": {reason}"));
        value("goal", format!("{}{reason}", goal.status.text()))
    });
    let mode = value("mode", format!("{:?}", state.mode).to_lowercase());
    let fixed = [mode, value("control", holder), value("battery", volts)];
    let notes = notes.iter().map(|(name, text)| value(name, text.clone()));
    fixed.into_iter().chain(goal).chain(notes).collect()
}

fn value(key: &str, value: String) -> KeyValue {
    KeyValue { key: key.to_owned(), value }
}
