//! Everything about the selected robot in a few lines.

use super::robot_view::{ShownRobot, Standing, UNKNOWN, age};
use super::*;
use crate::text::task as task_text;
use crate::text::width::{shortened, text_width};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use xtb_client::text::reasons;
use xtb_client::text::robot as describe;
use xtb_protocol::messages::{BatteryLevel, GoalState, RobotState};

/// Columns of a label with the blanks around it.
const LABEL: usize = 10;

impl Cockpit {
    pub(super) fn draw_detail(&self, frame: &mut Frame<'_>, area: Rect, sight: &ShownRobot<'_>) {
        let look = self.setup.look;
        let standing = sight.standing();
        let width = usize::from(area.width);
        let name = format!(" {} ", shortened(&sight.title(), width / 2));
        let headline = shortened(&headline(sight, standing), width.saturating_sub(text_width(&name)));
        let name = Span::styled(name, look.tone(Tone::Strong));
        let mut lines = vec![Line::from(vec![name, Span::styled(headline, look.tone(standing.tone()))])];
        let room = width.saturating_sub(LABEL);
        for (label, text, tone) in facts(sight, room) {
            let label = Span::styled(format!("  {label:8}"), look.tone(Tone::Dim));
            let text = Span::styled(shortened(&text, room), look.tone(tone));
            lines.push(Line::from(vec![label, text]));
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

/// Labels stay where they are when nothing is known, so that the eye finds them. `room`: columns for a text.
fn facts(sight: &ShownRobot<'_>, room: usize) -> [(&'static str, String, Tone); 7] {
    let show = |text: fn(&RobotState) -> String| sight.state.map_or_else(|| UNKNOWN.to_owned(), text);
    let state = sight.state;
    let blocked =
        state.is_some_and(|state| [state.obstacle.front, state.obstacle.rear].contains(&Some(true)));
    let low = state.is_some_and(|state| state.battery_level > BatteryLevel::Ok);
    let bad = state.is_some_and(|state| !(state.latches.is_empty() && state.faults.is_empty()));
    let when = |so: bool, tone: Tone| if so { tone } else { Tone::Plain };
    let goal = match state.map(|state| state.goal.as_ref()) {
        None => UNKNOWN.to_owned(),
        Some(None) => "none".to_owned(),
        Some(Some(goal)) => goal_within(goal, room),
    };
    [
        ("goal", goal, Tone::Plain),
        ("task", task(sight), Tone::Plain),
        ("pose", pose(sight), when(state.is_none(), Tone::Dim)),
        ("problem", show(wrong), when(bad, Tone::Bad)),
        ("ranges", show(|state| describe::obstacles(&state.obstacle)), when(blocked, Tone::Warning)),
        ("control", show(describe::controlled_by), Tone::Plain),
        ("battery", show(battery_and_tilt), when(low, Tone::Warning)),
    ]
}

/// The goal in `room` columns if possible: its point, which the map shows too, gives way to how the goal stands
/// and what is left to go.
fn goal_within(goal: &GoalState, room: usize) -> String {
    let point = describe::goal_point(goal);
    let only_x = point.split_once(", ").map(|(x, _)| format!("{x}, …"));
    let mut text = describe::goal_with(goal, &point);
    for point in only_x.into_iter().chain(["…".to_owned()]) {
        if text_width(&text) <= room {
            break;
        }
        text = describe::goal_with(goal, &point);
    }
    text
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

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake;
    use xtb_protocol::Uuid;
    use xtb_protocol::messages::{GoalKind, GoalStatus};

    #[test]
    fn a_goals_point_gives_way_before_its_distance() {
        let goal = fake::goal(Uuid::nil(), GoalStatus::Running);
        for (room, expected) in [
            (34, "running (1.00, 2.00), 1.50 m to go"),
            (33, "running (1.00, …), 1.50 m to go"),
            (30, "running (…), 1.50 m to go"),
            (10, "running (…), 1.50 m to go"),
        ] {
            assert_eq!(goal_within(&goal, room), expected, "{room}");
        }
        let wander = GoalState { kind: GoalKind::Wander, x_m: None, y_m: None, distance_m: None, ..goal };
        assert_eq!(goal_within(&wander, 16), "running (wander)");
        assert_eq!(goal_within(&wander, 15), "running (…)");
    }
}
