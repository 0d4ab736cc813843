//! One robot in detail, as lines of text.

use crate::describe;
use crate::output::{Output, Tone};
use crate::view::RobotView;
use crate::words;
use std::time::Duration;
use xtb_protocol::messages::RobotState;

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
            format!("STALE: last heard {} ago, everything else is unknown", describe::age(age))
        }
        (true, None) => "present, but its state is unknown".to_owned(),
    }
}

fn facts(robot: &RobotView, state: &RobotState) -> Vec<(&'static str, String, Tone)> {
    let blocked = [state.obstacle.front, state.obstacle.rear].contains(&Some(true));
    let mut facts = vec![
        ("mode", words::name(&state.mode), Tone::Plain),
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
        ("goal", state.goal.as_ref().map_or_else(|| "none".to_owned(), describe::goal), Tone::Plain),
        ("lease", describe::lease_with_age(state), Tone::Plain),
        ("tilt", describe::tilt(&state.tilt_deg), Tone::Plain),
        ("battery", describe::battery(state), Tone::Plain),
        ("inputs", describe::inputs(state), Tone::Plain),
        ("state age", describe::age(Duration::from_millis(robot.age_ms.unwrap_or_default())), Tone::Plain),
    ];
    if !state.stopped_because.is_empty() {
        facts.insert(1, ("stands", words::reasons(&state.stopped_because), Tone::Warning));
    }
    for fault in state.faults.iter().rev() {
        facts.insert(1, ("fault", describe::fault(fault), Tone::Bad));
    }
    if !state.latches.is_empty() {
        let latches: Vec<_> = state.latches.iter().map(|latch| latch.latch.to_string()).collect();
        facts.insert(1, ("latched", latches.join(", "), Tone::Bad));
    }
    if let Some(rejected) = describe::rejected(&state.rejected) {
        facts.push(("rejected", rejected, Tone::Warning));
    }
    facts
}
