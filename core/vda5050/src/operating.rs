//! Who drives a robot, in the words of VDA 5050; its errors and its safety state.

use crate::problem::{Level, error};
use crate::protocol::Protocol;
use serde_json::{Value, json};
use xtb_control::Mode;
use xtb_control::speed::STANDS_MPS;
use xtb_protocol::messages::texts::for_robot;
use xtb_protocol::messages::{BatteryLevel, Fault, Latch, RobotState, StopReason};

/// The bridge's name as a client, or its end: the same at each start, so that the dispatcher knows its submissions
/// again.
pub const CLIENT: &str = "vda5050";

/// Whether a client is one of those that drive for a master control: the dispatcher or the bridge.
fn is_ours(client: &str) -> bool {
    client == "dispatch"
        || client.strip_suffix(CLIENT).is_some_and(|stem| stem.is_empty() || stem.ends_with('-'))
}

/// Who may drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operating {
    /// The master control.
    Automatic,
    /// Somebody else for a while; the order is kept.
    Intervened,
    /// Somebody else.
    Manual,
    /// Nobody: the robot has measured nothing yet.
    Startup,
}

impl Operating {
    /// Of a robot that has an order, or none.
    #[must_use]
    pub fn of(state: &RobotState, has_order: bool) -> Self {
        let holder = state.lease.as_ref().map(|lease| lease.holder.as_str());
        let taken = matches!(state.mode, Mode::Manual | Mode::Teleop)
            || holder.is_some_and(|holder| !is_ours(holder))
            || state.latches.iter().any(|set| set.latch == Latch::RemoteTakeover);
        match (taken, has_order) {
            (true, true) => Self::Intervened,
            (true, false) => Self::Manual,
            (false, false) if state.pose.age_ms.is_none() => Self::Startup,
            (false, _) => Self::Automatic,
        }
    }

    /// As a version names it.
    #[must_use]
    pub fn text(self, protocol: Protocol) -> &'static str {
        match self {
            Self::Automatic => "AUTOMATIC",
            Self::Intervened => protocol.pick("MANUAL", "INTERVENED"),
            Self::Manual => "MANUAL",
            Self::Startup => protocol.pick("SERVICE", "STARTUP"),
        }
    }

    /// Whether new orders are taken.
    #[must_use]
    pub fn takes_orders(self) -> bool {
        matches!(self, Self::Automatic | Self::Intervened)
    }
}

/// Whether the wheels turn, as far as is known.
#[must_use]
pub fn drives(state: &RobotState) -> bool {
    state.speed_mps.is_some_and(|mps| mps.abs() > STANDS_MPS)
}

/// Whether the robot knows where it is.
#[must_use]
pub fn is_localized(state: &RobotState) -> bool {
    state.pose.age_ms.is_some() && !state.stopped_because.contains(&StopReason::PoseUncertain)
}

/// Latches, faults and a lost position.
#[must_use]
pub fn errors(state: &RobotState, protocol: Protocol) -> Vec<Value> {
    let robot = &state.robot;
    let latches = state.latches.iter().map(|set| {
        let text = format!("{}, by {}", set.latch.reason().text(), set.by);
        let name = (&*set.latch.to_string(), Level::Fatal);
        error(protocol, name, &text, Some(&set.remedy(state)), &[])
    });
    let faults = state.faults.iter().map(|set| {
        let text = set
            .detail
            .as_ref()
            .map_or_else(|| set.fault.text().to_owned(), |detail| format!("{}: {detail}", set.fault.text()));
        let hint = for_robot(set.fault.remedy(), robot);
        error(protocol, (&*set.fault.to_string(), level(set.fault)), &text, Some(&hint), &[])
    });
    let mut errors: Vec<Value> = latches.chain(faults).collect();
    let uncertain = StopReason::PoseUncertain;
    if state.stopped_because.contains(&uncertain) {
        let name = protocol.pick("localizationError", "LOCALIZATION_ERROR");
        let hint = format!("`fleet-cli set-pose {robot} X Y`, or initializePosition");
        errors.push(error(protocol, (name, Level::Fatal), uncertain.text(), Some(&hint), &[]));
    }
    errors
}

/// What only loses comfort is a warning.
fn level(fault: Fault) -> Level {
    match fault {
        Fault::RecordingFailed | Fault::OdometryScale | Fault::FixesFrozen | Fault::FixesContradict => {
            Level::Warning
        }
        Fault::BatteryLow | Fault::RemoteLost => Level::Urgent,
        _ => Level::Critical,
    }
}

/// `safetyState`.
#[must_use]
pub fn safety(state: &RobotState, protocol: Protocol) -> Value {
    let stop = match state.latches.iter().any(|set| set.latch == Latch::Estop) {
        true => "REMOTE",
        false if state.latches.is_empty() => "NONE",
        false => "MANUAL",
    };
    let field = state.obstacle.front == Some(true) || state.obstacle.rear == Some(true);
    json!({protocol.pick("eStop", "activeEmergencyStop"): stop, "fieldViolation": field})
}

/// `batteryState` or `powerSupply`. The charge is not measured: coarse steps stand for the levels of its voltage.
#[must_use]
pub fn battery(state: &RobotState, protocol: Protocol) -> Value {
    let percent = match state.battery_level {
        BatteryLevel::Ok => 100.0,
        BatteryLevel::Warn => 40.0,
        BatteryLevel::Finish => 20.0,
        BatteryLevel::Critical => 5.0,
        BatteryLevel::Unknown => 0.0,
    };
    let mut battery = json!({protocol.pick("batteryCharge", "stateOfCharge"): percent, "charging": false});
    if let Some(volts) = state.battery_v {
        battery["batteryVoltage"] = json!(volts);
    }
    battery
}
