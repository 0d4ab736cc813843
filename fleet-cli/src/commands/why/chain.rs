//! From a robot's state to the chain of reasons, most important first. Pure.
//!
//! Stands: latches, faults, what else it stands for, how its goal ended, who has control, inputs,
//! battery. Drives: what allows it to, then the same without the standstill.

use crate::output::Tone;
use schemars::JsonSchema;
use serde::Serialize;
use std::time::Duration;
use xtb_client::fleet_view::RobotView;
use xtb_client::text::reasons;
use xtb_client::text::robot as describe;
use xtb_control::Mode;
use xtb_protocol::Name;
use xtb_protocol::messages::texts::for_robot;
use xtb_protocol::messages::{BatteryLevel, Fault, GoalStatus, RobotState, StopReason, Suspension};
use xtb_robot::faults::INPUT_LOST_MS;

/// What it does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Verdict {
    /// Something lets it.
    Drives,
    /// Something keeps it.
    Stands,
    /// Nobody can say.
    Unknown,
}

/// What a reason is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    /// Whether it can be heard.
    Link,
    /// A latched stop.
    Latch,
    /// Something is broken.
    Fault,
    /// Why it stands.
    Stop,
    /// Why it may drive.
    May,
    /// Its present or last goal.
    Goal,
    /// What the dispatcher has suspended.
    Tasks,
    /// Who has control.
    Lease,
    /// Its sensors.
    Inputs,
    /// Its battery.
    Battery,
}

impl Kind {
    /// What stands before its lines.
    pub(super) fn label(self) -> &'static str {
        match self {
            Self::Link => "link",
            Self::Latch => "latch",
            Self::Fault => "fault",
            Self::Stop => "stop",
            Self::May => "driving",
            Self::Goal => "goal",
            Self::Tasks => "tasks",
            Self::Lease => "control",
            Self::Inputs => "inputs",
            Self::Battery => "battery",
        }
    }
}

/// One link of the chain.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(super) struct Reason {
    /// What it is about.
    pub(super) kind: Kind,
    /// The protocol's name, where it has one.
    pub(super) name: Option<String>,
    /// In words.
    pub(super) text: String,
    /// Since when.
    pub(super) age_ms: Option<u64>,
    /// What to do about it; `None` = nothing.
    pub(super) hint: Option<String>,
    /// Whether it keeps the robot from driving, or soon will.
    pub(super) hinders: bool,
}

impl Reason {
    fn new(kind: Kind, text: impl Into<String>) -> Self {
        Self { kind, name: None, text: text.into(), age_ms: None, hint: None, hinders: false }
    }

    pub(super) fn tone(&self) -> Tone {
        match (self.kind, self.hinders) {
            (Kind::Latch | Kind::Fault | Kind::Link, true) => Tone::Bad,
            (_, true) => Tone::Warning,
            (_, false) => Tone::Plain,
        }
    }
}

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(super) struct Why {
    /// Whose.
    pub(super) robot: Name,
    /// What it does.
    pub(super) verdict: Verdict,
    /// In a sentence.
    pub(super) headline: String,
    /// What the controller does.
    pub(super) mode: Option<Mode>,
    /// Since when it stands.
    pub(super) stopped_age_ms: Option<u64>,
    /// How old this is.
    pub(super) age_ms: Option<u64>,
    /// Most important first.
    pub(super) reasons: Vec<Reason>,
}

impl Why {
    /// Beside a dispatcher that has suspended this.
    pub(super) fn beside(mut self, suspended: &[Suspension]) -> Self {
        if self.verdict == Verdict::Stands {
            let after = self.reasons.iter().take_while(|reason| reason.kind <= Kind::Goal).count();
            self.reasons.splice(after..after, suspended.iter().map(tasks));
        }
        self
    }
}

/// Explains what a robot does.
pub(super) fn explain(robot: &RobotView) -> Why {
    let (verdict, headline, reasons) = match &robot.state {
        Some(state) if robot.alive => known(robot, state),
        _ => unknown(robot),
    };
    let state = robot.state.as_ref().filter(|_| robot.alive);
    Why {
        robot: robot.name.clone(),
        verdict,
        headline,
        mode: state.map(|state| state.mode),
        stopped_age_ms: state.and_then(|state| state.stopped_age_ms),
        age_ms: robot.age_ms,
        reasons,
    }
}

fn age(ms: u64) -> String {
    describe::age(Duration::from_millis(ms))
}

fn unknown(robot: &RobotView) -> (Verdict, String, Vec<Reason>) {
    let name = &robot.name;
    let (headline, text, hint) = match (robot.alive, robot.age_ms) {
        (false, _) => (
            format!("{name} is missing: motion unknown"),
            "no agent with this name at the router".to_owned(),
            "check its power, its network, and that robot-agent is running; `fleet-cli doctor` checks the \
             rest",
        ),
        (true, Some(ms)) => (
            format!("{name} is STALE: motion unknown"),
            format!("its last state is {} old", age(ms)),
            "its link or its agent hangs: `fleet-cli doctor`; if nearby, use the transmitter",
        ),
        (true, None) => (
            format!("{name} is present, but its motion is unknown"),
            "it sends no state".to_owned(),
            "its agent may have another version: `fleet-cli doctor` shows it",
        ),
    };
    let reason = Reason {
        hint: Some(hint.to_owned()),
        hinders: true,
        age_ms: robot.age_ms,
        ..Reason::new(Kind::Link, text)
    };
    (Verdict::Unknown, headline, vec![reason])
}

fn known(robot: &RobotView, state: &RobotState) -> (Verdict, String, Vec<Reason>) {
    let (name, old) = (&robot.name, age(robot.age_ms.unwrap_or_default()));
    let mode = reasons::name(&state.mode);
    let mut reasons: Vec<Reason> = latches(state).chain(faults(state)).collect();
    let drives = super::drives(state);
    let (verdict, headline) = if drives {
        reasons.insert(0, may(state));
        reasons.extend(stops(state));
        let speed = describe::speed(state);
        (Verdict::Drives, format!("{name}: driving, {speed} (mode {mode}, state {old} old)"))
    } else {
        reasons.extend(stops(state));
        let since = state.stopped_age_ms.map(|ms| format!(" for {}", age(ms))).unwrap_or_default();
        (Verdict::Stands, format!("{name}: stopped{since} (mode {mode}, state {old} old)"))
    };
    reasons.extend(goal(state));
    reasons.push(lease(state));
    reasons.extend(inputs(state));
    reasons.push(battery(state));
    (verdict, headline, reasons)
}

fn tasks(suspension: &Suspension) -> Reason {
    let hint = Some(suspension.cause.remedy().to_owned());
    Reason { hint, hinders: true, ..Reason::new(Kind::Tasks, suspension.text()) }
}

fn latches(state: &RobotState) -> impl Iterator<Item = Reason> + '_ {
    state.latches.iter().map(|set| {
        let cause = if set.present { "cause still present" } else { "cause gone" };
        let words = set.latch.reason().text();
        let text = format!("{words}: {} latched by {}, {} ago; {cause}", set.latch, set.by, age(set.age_ms));
        Reason {
            name: Some(set.latch.to_string()),
            age_ms: Some(set.age_ms),
            hint: Some(set.remedy(state)),
            hinders: true,
            ..Reason::new(Kind::Latch, text)
        }
    })
}

fn faults(state: &RobotState) -> impl Iterator<Item = Reason> + '_ {
    state.faults.iter().map(|broken| {
        let detail = broken.detail.as_ref().map(|words| format!(" ({words})")).unwrap_or_default();
        let text = format!("{}: {}{detail}, for {}", broken.fault.place(), broken.fault, age(broken.age_ms));
        Reason {
            name: Some(broken.fault.to_string()),
            age_ms: Some(broken.age_ms),
            hint: Some(broken.fault.remedy().to_owned()),
            hinders: true,
            ..Reason::new(Kind::Fault, text)
        }
    })
}

/// What it stands for besides latches, as the robot orders it.
fn stops(state: &RobotState) -> impl Iterator<Item = Reason> + '_ {
    let latched = |reason: StopReason| state.latches.iter().any(|set| set.latch.reason() == reason);
    state.stopped_because.iter().filter(move |reason| !latched(**reason)).map(|&reason| {
        let since = match reason {
            StopReason::SetpointExpired => state.input_age_ms.setpoint,
            StopReason::BoardLost => state.input_age_ms.encoder,
            StopReason::GyroLost => state.input_age_ms.gyro,
            StopReason::RemoteLost => state.input_age_ms.remote,
            _ => None,
        };
        let again = is_loss(reason) && since.is_some_and(|ms| ms <= INPUT_LOST_MS);
        let words = reason.text();
        let words = match again {
            true => words.replace(" not responding", " was lost").replace(" signal lost", " signal was lost"),
            false => words.to_owned(),
        };
        let last = match since {
            Some(_) if again => ", now responding again".to_owned(),
            Some(ms) => format!(", last message {} ago", age(ms)),
            None if only_latched(reason) => ", since reset".to_owned(),
            None => String::new(),
        };
        Reason {
            name: Some(reasons::name(&reason)),
            age_ms: since,
            hint: if again {
                Some(for_robot(StopReason::NoCommand.remedy().unwrap_or_default(), &state.robot))
            } else {
                reason.remedy().map(|remedy| for_robot(remedy, &state.robot))
            },
            hinders: !passes(reason),
            ..Reason::new(Kind::Stop, format!("{words}{last}"))
        }
    })
}

/// Something was not heard any more: once it is heard again, that is only why it stopped.
fn is_loss(reason: StopReason) -> bool {
    matches!(reason, StopReason::BoardLost | StopReason::GyroLost)
}

/// What holds a robot by a latch alone: without the latch it is only why it stopped.
pub(super) fn only_latched(reason: StopReason) -> bool {
    use StopReason as R;
    matches!(reason, R::Estop | R::RemoteTakeover | R::Runaway | R::SensorFault | R::BatteryCritical)
}

/// Why the motor rests while the robot is under way.
pub(super) fn passes(reason: StopReason) -> bool {
    matches!(reason, StopReason::Starting | StopReason::Coasting | StopReason::AtCusp | StopReason::Planning)
}

/// What allows it to drive.
fn may(state: &RobotState) -> Reason {
    let holder =
        || state.lease.as_ref().map_or_else(|| "unknown".to_owned(), |lease| lease.holder.to_string());
    match state.mode {
        Mode::Manual => Reason::new(Kind::May, "driven by the R/C transmitter"),
        Mode::Teleop => {
            let setpoint = state.input_age_ms.setpoint;
            let last = setpoint.map_or_else(|| "unknown".to_owned(), |ms| format!("{} ago", age(ms)));
            Reason {
                age_ms: setpoint,
                ..Reason::new(Kind::May, format!("driven by hand by {}, last setpoint {last}", holder()))
            }
        }
        Mode::Goto | Mode::Wander => {
            let by = state.goal.as_ref().map_or_else(holder, |goal| goal.by.to_string());
            Reason::new(Kind::May, format!("goal of {by}, see below"))
        }
        Mode::Idle | Mode::Fault => {
            let hint = format!("`fleet-cli stop {}`, then check its motor", state.robot);
            Reason { hint: Some(hint), hinders: true, ..Reason::new(Kind::May, "no known reason") }
        }
    }
}

fn goal(state: &RobotState) -> Option<Reason> {
    let goal = state.goal.as_ref()?;
    let hint = match goal.status {
        GoalStatus::Accepted | GoalStatus::Running => None,
        GoalStatus::Blocked => Some("clear the path; it continues by itself".to_owned()),
        GoalStatus::Reached | GoalStatus::Replaced => None,
        GoalStatus::Cancelled | GoalStatus::Failed | GoalStatus::Interrupted => {
            Some(match (goal.x_m, goal.y_m) {
                (Some(x_m), Some(y_m)) => {
                    format!("when it can drive again: `fleet-cli goto {} {x_m} {y_m}`", state.robot)
                }
                _ => format!("when it can drive again: `fleet-cli wander {}`", state.robot),
            })
        }
    };
    Some(Reason {
        name: Some(reasons::name(&goal.status)),
        age_ms: Some(goal.age_ms),
        hint,
        hinders: goal.status == GoalStatus::Blocked,
        ..Reason::new(Kind::Goal, describe::goal_in_full(goal))
    })
}

fn lease(state: &RobotState) -> Reason {
    match &state.lease {
        None => Reason::new(Kind::Lease, "none: no client has control"),
        Some(lease) => {
            let text = format!("{} has control, heard {} ago", lease.holder, age(lease.age_ms));
            Reason {
                age_ms: Some(lease.age_ms),
                hint: Some("other clients need --take".to_owned()),
                ..Reason::new(Kind::Lease, text)
            }
        }
    }
}

/// All ages; those that are lost each on a line of its own.
fn inputs(state: &RobotState) -> Vec<Reason> {
    let ages = &state.input_age_ms;
    let needed = [
        ("gyro", ages.gyro, Fault::GyroSilent),
        ("encoder", ages.encoder, Fault::EncoderSilent),
        ("converter", ages.adc, Fault::ConverterSilent),
    ];
    let lost = needed.into_iter().filter(|(_, ms, _)| ms.is_none_or(|ms| ms > INPUT_LOST_MS));
    let mut reasons: Vec<Reason> = lost
        .map(|(name, ms, fault)| {
            let heard = ms.map_or_else(|| "never".to_owned(), |ms| format!("{} ago", age(ms)));
            Reason {
                name: Some(name.to_owned()),
                age_ms: ms,
                hint: Some(fault.remedy().to_owned()),
                hinders: true,
                ..Reason::new(Kind::Inputs, format!("no data from the {name}, last: {heard}"))
            }
        })
        .collect();
    reasons.push(Reason::new(Kind::Inputs, describe::inputs(state)));
    reasons
}

fn battery(state: &RobotState) -> Reason {
    let (hinders, hint) = match state.battery_level {
        BatteryLevel::Ok => (false, None),
        BatteryLevel::Unknown if state.battery_v.is_some() => (false, None),
        BatteryLevel::Unknown => (false, Some("not measured, may be empty: measure it by hand")),
        BatteryLevel::Warn => (false, Some("charge it soon")),
        BatteryLevel::Finish => (true, Some("no new commands accepted: bring it home and charge it")),
        BatteryLevel::Critical => (true, Some(Fault::BatteryCritical.remedy())),
    };
    Reason {
        name: Some(reasons::name(&state.battery_level)),
        hint: hint.map(str::to_owned),
        hinders,
        ..Reason::new(Kind::Battery, describe::battery(state))
    }
}

#[cfg(test)]
mod tests;
