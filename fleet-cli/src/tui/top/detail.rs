//! Everything about the selected robot in a few lines.

use super::robot_view::{ShownRobot, Standing, UNKNOWN, age};
use super::*;
use crate::text::task as task_text;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use xtb_client::text::reasons;
use xtb_client::text::robot as describe;
use xtb_protocol::messages::{BatteryLevel, RobotState};

impl Cockpit {
    pub(super) fn draw_detail(&self, frame: &mut Frame<'_>, area: Rect, sight: &ShownRobot<'_>) {
        let look = self.setup.look;
        let standing = sight.standing();
        let mut head = vec![Span::styled(format!(" {} ", sight.name), look.tone(Tone::Strong))];
        head.push(Span::styled(headline(sight, standing), look.tone(standing.tone())));
        let mut lines = vec![Line::from(head)];
        let fact = |label: &str, text: String, tone: Tone| {
            let label = Span::styled(format!("  {label:8}"), look.tone(Tone::Dim));
            Line::from(vec![label, Span::styled(text, look.tone(tone))])
        };
        for (label, text, tone) in facts(sight) {
            lines.push(fact(label, text, tone));
        }
        frame.render_widget(Paragraph::new(lines), area);
    }
}

fn headline(sight: &ShownRobot<'_>, standing: Standing) -> String {
    match sight.state {
        None => sight.why(true),
        Some(state) => match describe::stands(state) {
            Some(stands) if stands.starts_with("for ") => format!("stopped {stands}"),
            Some(reasons) => format!("stopped: {reasons}"),
            None if standing == Standing::Drives => format!("driving, {}", describe::speed(state)),
            None => "stopped".to_owned(),
        },
    }
}

/// Labels stay where they are when nothing is known, so that the eye finds them.
fn facts(sight: &ShownRobot<'_>) -> [(&'static str, String, Tone); 7] {
    let show = |text: fn(&RobotState) -> String| sight.state.map_or_else(|| UNKNOWN.to_owned(), text);
    let state = sight.state;
    let blocked =
        state.is_some_and(|state| [state.obstacle.front, state.obstacle.rear].contains(&Some(true)));
    let low = state.is_some_and(|state| state.battery_level > BatteryLevel::Ok);
    let bad = state.is_some_and(|state| !(state.latches.is_empty() && state.faults.is_empty()));
    let when = |so: bool, tone: Tone| if so { tone } else { Tone::Plain };
    [
        (
            "goal",
            show(|state| state.goal.as_ref().map_or_else(|| "none".to_owned(), describe::goal)),
            Tone::Plain,
        ),
        ("task", task(sight), Tone::Plain),
        ("pose", pose(sight), when(state.is_none(), Tone::Dim)),
        ("problem", show(wrong), when(bad, Tone::Bad)),
        ("ranges", show(|state| describe::obstacles(&state.obstacle)), when(blocked, Tone::Warning)),
        ("control", show(describe::controlled_by), Tone::Plain),
        ("battery", show(battery_and_tilt), when(low, Tone::Warning)),
    ]
}

fn task(sight: &ShownRobot<'_>) -> String {
    sight.task.map_or_else(
        || "none".to_owned(),
        |task| {
            let (state, legs) = (reasons::name(&task.state), task_text::legs(task));
            format!("{} {state} {legs}, {}", task.id, task_text::what(&task.spec.kind))
        },
    )
}

/// The last one is said to be the last one.
fn pose(sight: &ShownRobot<'_>) -> String {
    match (sight.state, &sight.robot.state) {
        (Some(state), _) => {
            let (pose, sigma_m) = (describe::pose(&state.pose), describe::fixed(state.pose.sigma_m, 2));
            format!("{pose} ±{sigma_m} m")
        }
        (None, Some(seen)) => {
            format!("{UNKNOWN}, {} ago {}", age(sight.age_ms), describe::pose(&seen.value.pose))
        }
        (None, None) => UNKNOWN.to_owned(),
    }
}

fn wrong(state: &RobotState) -> String {
    let latches = state.latches.iter().map(|set| format!("LATCHED {}", describe::latch(set)));
    let faults = state.faults.iter().map(|fault| format!("FAULT {}", fault.fault));
    let all: Vec<String> = latches.chain(faults).collect();
    if all.is_empty() { "none".to_owned() } else { all.join(", ") }
}

fn battery_and_tilt(state: &RobotState) -> String {
    format!("{}; {}", describe::battery(state), describe::tilt(&state.tilt_deg))
}
