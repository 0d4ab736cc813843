//! A robot's state in words and numbers for people; what is not known is called unknown.

use super::reasons;
use std::time::Duration;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{
    BatteryLevel, FaultState, GoalKind, GoalState, LatchState, LinkLoss, ObstacleView, PoseState, Rejected,
    RobotState, SimStats, TiltState,
};

/// What is shown for a value that nobody knows.
pub const UNKNOWN: &str = "unknown";

/// A number with `digits` places, and never `-0`.
pub fn fixed(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    let zero = text.trim_start_matches('-').bytes().all(|b| b == b'0' || b == b'.');
    if zero { text.trim_start_matches('-').to_owned() } else { text }
}

fn known(value: Option<f64>, digits: usize, unit: &str) -> String {
    value.map_or_else(|| UNKNOWN.to_owned(), |value| format!("{} {unit}", fixed(value, digits)))
}

/// An age: `40 ms`, `1.2 s`, `2 min 05 s`.
pub fn age(age: Duration) -> String {
    match age.as_millis() {
        ms @ 0..1000 => format!("{ms} ms"),
        ms @ 100_000.. => format!("{} min {:02} s", ms / 60_000, ms / 1000 % 60),
        _ => format!("{:.1} s", age.as_secs_f64()),
    }
}

fn age_ms(ms: Option<u64>) -> String {
    ms.map_or_else(|| "never".to_owned(), |ms| age(Duration::from_millis(ms)))
}

/// How fast a simulator runs, × real time; what was asked for too, where that is something else.
pub fn simulator(stats: &SimStats) -> String {
    let which = stats.first.map_or_else(String::new, |first| format!(" of xtb-{first} …"));
    let Some(factor) = stats.real_time_factor else {
        return format!("simulator{which} running, speed unknown");
    };
    let digits = if factor < 10.0 { 2 } else { 0 };
    let runs = format!("simulator{which} runs at {} × real time", fixed(factor, digits));
    if stats.speed == 1.0 { runs } else { format!("{runs}, {} × requested", stats.speed) }
}

/// Place and direction in the map.
pub fn pose(pose: &PoseState) -> String {
    let (x, y) = (fixed(pose.x_m, 2), fixed(pose.y_m, 2));
    format!("({x}, {y}) {}°", fixed(pose.yaw_rad.to_degrees(), 0))
}

/// The same of a configured pose.
pub fn map_pose(pose: &MapPose) -> String {
    let (x, y) = (fixed(pose.x_m, 2), fixed(pose.y_m, 2));
    format!("({x}, {y}) {}°", fixed(pose.yaw_rad.to_degrees(), 0))
}

/// A point of the map: `(1.00, -2.50)`.
pub fn map_point(x_m: f64, y_m: f64) -> String {
    format!("({}, {})", fixed(x_m, 2), fixed(y_m, 2))
}

/// Where the pose comes from and how old it is.
pub fn pose_source(pose: &PoseState) -> String {
    match pose.age_ms {
        Some(_) => format!("{}, {}", reasons::name(&pose.source), age_ms(pose.age_ms)),
        None => format!("{}, not measured", reasons::name(&pose.source)),
    }
}

/// What pose fixes have shown of the odometry and of themselves; `None` = nothing yet.
pub fn odometry(pose: &PoseState) -> Option<String> {
    let scale = fixed(pose.odometry_scale?, 3);
    let sigma = fixed(pose.odometry_scale_sigma.unwrap_or_default(), 3);
    let late = pose.fix_delay_ms.map(|ms| format!("; fixes are {ms} ms older than their stamp"));
    Some(format!("scale {scale} ± {sigma}{}", late.unwrap_or_default()))
}

/// Speed over ground.
pub fn speed(state: &RobotState) -> String {
    known(state.speed_mps, 2, "m/s")
}

/// Battery voltage and what it means.
pub fn battery(state: &RobotState) -> String {
    let volts = known(state.battery_v, 1, "V");
    match state.battery_level {
        BatteryLevel::Unknown if state.battery_v.is_none() => volts,
        BatteryLevel::Ok => volts,
        BatteryLevel::Unknown => format!("{volts}, level unknown"),
        level => format!("{volts}, {}", reasons::name(&level)),
    }
}

/// Who holds the lease.
pub fn lease(state: &RobotState) -> String {
    state.lease.as_ref().map_or_else(|| "free".to_owned(), |lease| lease.holder.to_string())
}

/// Who has control, and when it was heard last.
pub fn controlled_by(state: &RobotState) -> String {
    match &state.lease {
        Some(lease) => format!("{} ({} ago)", lease.holder, age_ms(Some(lease.age_ms))),
        None => "none".to_owned(),
    }
}

/// The same in a column.
pub fn lease_with_age(state: &RobotState) -> String {
    match &state.lease {
        Some(lease) => format!("{}, {}", lease.holder, age_ms(Some(lease.age_ms))),
        None => "free".to_owned(),
    }
}

/// The goal, how it stands, and what is left to go.
pub fn goal(goal: &GoalState) -> String {
    goal_with(goal, &goal_point(goal))
}

/// Where the goal is, or what kind of goal it is.
pub fn goal_point(goal: &GoalState) -> String {
    match (goal.kind, goal.x_m, goal.y_m) {
        (GoalKind::Goto, Some(x_m), Some(y_m)) => format!("{}, {}", fixed(x_m, 2), fixed(y_m, 2)),
        (kind, ..) => reasons::name(&kind),
    }
}

/// As [`goal`], with other words for [`goal_point`]: where there is too little room for all of it.
pub fn goal_with(goal: &GoalState, point: &str) -> String {
    let mut text = format!("{} ({point})", reasons::name(&goal.status));
    if let Some(distance_m) = goal.distance_m.filter(|_| !goal.status.is_final()) {
        text.push_str(&format!(", {} m to go", fixed(distance_m, 2)));
    }
    text
}

/// The goal with who sent it, for how long it stands so, why, and what becomes of it without its client.
pub fn goal_in_full(state: &GoalState) -> String {
    let mut text = goal(state);
    let age = age(Duration::from_millis(state.age_ms));
    text.push_str(&match state.status.is_final() {
        true => format!(" {age} ago, sent by {}", state.by),
        false => format!(", for {age}, sent by {}", state.by),
    });
    if !state.status.is_final() {
        text.push_str(match state.on_link_loss {
            LinkLoss::Halt => ", stops if its client times out",
            LinkLoss::Finish => ", continues without its client",
        });
    }
    if let Some(reason) = &state.reason {
        text.push_str(&format!(": {reason}"));
    }
    text
}

/// A latch with who set it and since when.
pub fn latch(state: &LatchState) -> String {
    let age = age(Duration::from_millis(state.age_ms));
    let still = if state.present { ", cause still present" } else { "" };
    format!("{} by {} for {age}{still}", state.latch, state.by)
}

/// Since when it stands; `None` while it drives.
pub fn stands(state: &RobotState) -> Option<String> {
    let why = (!state.stopped_because.is_empty()).then(|| reasons::reasons(&state.stopped_because));
    let since = state.stopped_age_ms.map(|ms| format!("for {}", age(Duration::from_millis(ms))));
    match (since, why) {
        (Some(since), Some(why)) => Some(format!("{since}: {why}")),
        (since, why) => since.or(why),
    }
}

/// What the obstacle rule sees.
pub fn obstacles(view: &ObstacleView) -> String {
    let side = |seen| match seen {
        Some(true) => "OBSTACLE",
        Some(false) => "clear",
        None => UNKNOWN,
    };
    format!("front {}, rear {}", side(view.front), side(view.rear))
}

/// Platform tilt.
pub fn tilt(tilt: &TiltState) -> String {
    format!("pitch {}, roll {}", known(tilt.x, 1, "°"), known(tilt.y, 1, "°"))
}

/// A fault with its age, the system's words and what to do.
pub fn fault(state: &FaultState) -> String {
    let detail = state.detail.as_ref().map(|words| format!(" ({words})")).unwrap_or_default();
    let age = age(Duration::from_millis(state.age_ms));
    format!("{} for {age}{detail}: {}", state.fault, state.fault.remedy())
}

/// Ages of the inputs.
pub fn inputs(state: &RobotState) -> String {
    let ages = &state.input_age_ms;
    let remote = ("remote", ages.remote);
    [("gyro", ages.gyro), ("encoder", ages.encoder), ("adc", ages.adc), remote, ("setpoint", ages.setpoint)]
        .map(|(name, ms)| format!("{name} {}", age_ms(ms)))
        .join(", ")
}

/// The counters that are not zero; `None` if all are.
pub fn rejected(rejected: &Rejected) -> Option<String> {
    let Ok(serde_json::Value::Object(counters)) = serde_json::to_value(rejected) else { return None };
    let counted = counters.iter().filter(|(_, count)| count.as_u64() != Some(0));
    let text = counted.map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join(", ");
    (!text.is_empty()).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_without_minus_zero() {
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(fixed(-0.4, 0), "0");
        assert_eq!(fixed(-1.5, 1), "-1.5");
    }

    #[test]
    fn only_counters_that_count_are_shown() {
        assert_eq!(rejected(&Rejected::default()), None);
        let some = Rejected { malformed: 2, gyro_bytes: 1, ..Rejected::default() };
        assert_eq!(rejected(&some).unwrap(), "gyro_bytes 1, malformed 2");
    }

    #[test]
    fn ages_have_a_unit() {
        assert_eq!(age(Duration::from_millis(999)), "999 ms");
        assert_eq!(age(Duration::from_millis(1250)), "1.2 s");
        assert_eq!(age(Duration::from_secs(99)), "99.0 s");
        assert_eq!(age(Duration::from_secs(125)), "2 min 05 s");
        assert_eq!(age_ms(None), "never");
    }
}
