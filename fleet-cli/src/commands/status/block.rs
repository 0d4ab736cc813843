//! One robot in detail, as lines of text.

use crate::output::{Output, Tone};
use std::time::Duration;
use xtb_client::fleet_view::RobotView;
use xtb_client::text::reasons;
use xtb_client::text::robot as describe;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{BatteryLevel, RobotState};

const LABEL_WIDTH: usize = 10;

/// The lines, the first one being the robot's name.
pub(super) fn lines(robot: &RobotView, out: &Output) -> Vec<String> {
    let name = out.paint(Tone::Strong, robot.name.as_str());
    match &robot.state {
        Some(state) if robot.alive => {
            let mut lines = vec![name];
            lines.extend(facts(robot, state).into_iter().map(|(label, text, tone)| {
                let label = out.paint(Tone::Dim, &format!("{label:LABEL_WIDTH$}"));
                format!("  {label} {}", out.paint(tone, &text))
            }));
            lines
        }
        _ => vec![format!("{name}  {}", out.paint(Tone::Bad, &absence(robot)))],
    }
}

/// Why nothing is known; the last known values are not shown, they would be taken for present ones.
fn absence(robot: &RobotView) -> String {
    match (robot.alive, robot.age_ms.map(Duration::from_millis)) {
        (false, _) => "missing".to_owned(),
        (true, Some(age)) => {
            format!("STALE: last message {} ago, everything else is unknown", describe::age(age))
        }
        (true, None) => "present, but its state is unknown".to_owned(),
    }
}

fn facts(robot: &RobotView, state: &RobotState) -> Vec<(&'static str, String, Tone)> {
    let blocked = [state.obstacle.front, state.obstacle.rear].contains(&Some(true));
    let low = state.battery_level > BatteryLevel::Ok;
    let mut facts = vec![
        ("mode", reasons::name(&state.mode), Tone::Plain),
        (
            "pose",
            format!("{} ({})", describe::pose(&state.pose), describe::pose_source(&state.pose)),
            Tone::Plain,
        ),
        ("speed", describe::speed(state), Tone::Plain),
        (
            "obstacles",
            describe::obstacles(&state.obstacle),
            if blocked { Tone::Warning } else { Tone::Plain },
        ),
        ("goal", state.goal.as_ref().map_or_else(|| "none".to_owned(), describe::goal_in_full), Tone::Plain),
        ("control", describe::controlled_by(state), Tone::Plain),
        ("tilt", describe::tilt(&state.tilt_deg), Tone::Plain),
        ("battery", describe::battery(state), if low { Tone::Warning } else { Tone::Plain }),
        ("inputs", describe::inputs(state), Tone::Plain),
        ("state age", describe::age(Duration::from_millis(robot.age_ms.unwrap_or_default())), Tone::Plain),
    ];
    if let Some(odometry) = describe::odometry(&state.pose) {
        facts.insert(3, ("odometry", odometry, Tone::Plain));
    }
    if let Some(stands) = describe::stands(state) {
        facts.insert(1, ("stopped", stands, Tone::Warning));
    }
    for fault in state.faults.iter().rev() {
        facts.insert(1, ("fault", describe::fault(fault), Tone::Bad));
    }
    for latch in state.latches.iter().rev() {
        facts.insert(1, ("latched", describe::latch(latch), Tone::Bad));
    }
    if !state.ended_goals.is_empty() {
        let ends =
            state.ended_goals.iter().map(|end| format!("{} {}", short(end.id), reasons::name(&end.status)));
        facts.push(("past goals", ends.collect::<Vec<_>>().join(", "), Tone::Dim));
    }
    if let Some(rejected) = describe::rejected(&state.rejected) {
        facts.push(("rejected", rejected, Tone::Warning));
    }
    facts
}

/// The first part of an id is enough for the eye.
fn short(id: Uuid) -> String {
    id.simple().to_string()[..8].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake;
    use xtb_protocol::messages::{GoalEnd, GoalStatus, Latch, LeaseState, StopReason};

    #[test]
    fn holder_latches_goals_and_the_standstill_are_shown_with_their_ages() {
        let mut goal = fake::goal(Uuid::from_u128(1), GoalStatus::Cancelled);
        (goal.age_ms, goal.reason) = (12_000, Some("estop".into()));
        let state = RobotState {
            latches: vec![
                fake::latch(Latch::Estop, "cli-1", false),
                fake::latch(Latch::GyroLost, "gyro_silent", true),
            ],
            lease: Some(LeaseState { holder: fake::name("cli-2"), age_ms: 40 }),
            goal: Some(goal),
            ended_goals: vec![GoalEnd { id: Uuid::from_u128(7 << 96), status: GoalStatus::Reached }],
            stopped_because: vec![StopReason::Estop],
            stopped_age_ms: Some(12_000),
            battery_level: BatteryLevel::Warn,
            ..fake::state("xtb-1")
        };
        let robot = RobotView {
            name: fake::name("xtb-1"),
            alias: None,
            alive: true,
            state: Some(state),
            age_ms: Some(30),
            tags: Vec::new(),
            start_pose: None,
        };
        let text = lines(&robot, &Output { json: false, colors: false }).join("\n");
        for part in [
            "latched    estop by cli-1 for 12.0 s\n",
            "latched    gyro_lost by gyro_silent for 12.0 s, cause still present",
            "stopped    for 12.0 s: emergency stop",
            "goal       cancelled (1.00, 2.00) 12.0 s ago, sent by me: estop",
            "control    cli-2 (40 ms ago)",
            "battery    7.4 V, warn",
            "past goals 00000007 reached",
        ] {
            assert!(text.contains(part), "{part:?} is missing in\n{text}");
        }
        let stale = RobotView { state: None, age_ms: Some(9000), ..robot };
        let text = lines(&stale, &Output { json: false, colors: false }).join("\n");
        assert!(text.contains("STALE: last message 9.0 s ago") && !text.contains("estop"), "{text}");
    }
}
