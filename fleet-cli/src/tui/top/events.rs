//! What happened, the newest first; or, instead, the dispatcher's tasks.

use super::labels::fitted;
use super::robot_view::{age, long_age};
use super::*;
use crate::text::task as task_text;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Modifier;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use xtb_client::scene::{SceneEvent, What};
use xtb_client::text::reasons;
use xtb_protocol::messages::{Event, EventKind, GoalStatus, TaskEvent, TaskView};

impl Cockpit {
    pub(super) fn draw_pane(&self, frame: &mut Frame<'_>, area: Rect, scene: &Scene, now_ms: AtMs) {
        let look = self.setup.look;
        let (title, lines) = match self.pane {
            Pane::Events => ("events (v: tasks)".to_owned(), self.events(scene, now_ms)),
            Pane::Tasks => self.tasks(scene, now_ms),
        };
        let style = look.tone(Tone::Dim).add_modifier(Modifier::UNDERLINED);
        let title = Line::styled(format!(" {title:width$}", width = usize::from(area.width)), style);
        let lines = std::iter::once(title).chain(lines).take(usize::from(area.height));
        let lines: Vec<Line<'_>> = lines.map(|line| fitted(line, area.width)).collect();
        frame.render_widget(Paragraph::new(lines), area);
    }

    fn events(&self, scene: &Scene, now_ms: AtMs) -> Vec<Line<'static>> {
        let shown = |robot: &Name| self.setup.robots.is_empty() || self.setup.robots.contains(robot);
        let concerns = |happening: &&SceneEvent| match &happening.what {
            What::Robot(event) => shown(&event.robot),
            What::Task(event) => event.step.robot.as_ref().is_none_or(shown),
            What::Presence { robot, .. } => robot.as_ref().is_none_or(shown),
        };
        let line = |(since_ms, happening): (Option<u64>, &SceneEvent)| {
            let (text, tone) = happened(&happening.what);
            let since = since_ms.map_or_else(|| "?".to_owned(), |ms| age(Some(ms)));
            let since = Span::styled(format!("{since:>7} "), self.setup.look.tone(Tone::Dim));
            Line::from(vec![since, Span::styled(text, self.setup.look.tone(tone))])
        };
        let shown = scene.happenings().iter().rev().filter(concerns);
        let mut shown: Vec<_> =
            shown.map(|happening| (since_ms(scene, happening, now_ms), happening)).collect();
        // Those from before the screen opened come robot by robot.
        shown.sort_by_key(|(since_ms, happening)| {
            since_ms.unwrap_or_else(|| now_ms.saturating_sub(happening.at_ms))
        });
        shown.into_iter().map(line).collect()
    }

    /// Open ones first, then those that ended last.
    fn tasks(&self, scene: &Scene, now_ms: AtMs) -> (String, Vec<Line<'static>>) {
        let Some(list) = scene.tasks() else {
            return ("tasks (v: events): unknown, no dispatcher found".to_owned(), Vec::new());
        };
        let old = format!("{} old", long_age(list.age_ms(now_ms)));
        let gone = if scene.dispatcher() || self.playing.is_some() { "" } else { ", DISPATCHER GONE" };
        let count = task_text::count_list(&list.value);
        let title = format!("tasks (v: events): {count}{gone}, {old}");
        let open = list.value.tasks.iter().filter(|task| !task.state.is_final());
        let ended = list.value.tasks.iter().rev().filter(|task| task.state.is_final());
        let line = |task: &TaskView| {
            let robot =
                task_text::robot(task).map_or_else(|| task_text::who(&task.spec.who), Name::to_string);
            let state = reasons::name(&task.state);
            let why = task.reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
            let (legs, what) = (task_text::legs(task), task_text::what(&task.spec.kind));
            let text = format!(" {:>4} {state:10} {robot:8} {legs:>5} {what}{why}", task.id.to_string());
            Line::styled(text, self.setup.look.tone(task_text::tone(task.state)))
        };
        let suspended = scene.suspended().iter().flat_map(|suspension| {
            let line = |text: String, tone| Line::styled(text, self.setup.look.tone(tone));
            let remedy = format!("  → {}", suspension.cause.remedy());
            [line(format!(" {}", suspension.text()), Tone::Bad), line(remedy, Tone::Dim)]
        });
        (title, suspended.chain(open.chain(ended).map(line)).collect())
    }
}

/// How long ago it happened. The last events of before come when the screen opens: how old they are
/// then, their robot's clock says, or the dispatcher's; `None` until that has been heard.
fn since_ms(scene: &Scene, happening: &SceneEvent, now_ms: AtMs) -> Option<u64> {
    let came = now_ms.saturating_sub(happening.at_ms);
    let happened = match &happening.what {
        What::Robot(event) => {
            let state = scene.robots().get(&event.robot)?.state.as_ref()?;
            match state.value.epoch == event.epoch {
                true => state.age_ms(now_ms) + state.value.tick_ms.saturating_sub(event.tick_ms),
                false => came, // of another boot, with a clock of its own
            }
        }
        What::Task(event) => {
            let list = scene.tasks()?;
            list.age_ms(now_ms) + list.value.at_ms.saturating_sub(event.step.at_ms)
        }
        What::Presence { .. } => came,
    };
    // Never younger than its message.
    Some(happened.max(came))
}

/// In words, and how good it is.
fn happened(what: &What) -> (String, Tone) {
    match what {
        What::Robot(event) => robot(event),
        What::Task(TaskEvent { task, step, .. }) => {
            let on = step.robot.as_ref().map(|robot| format!(" on {robot}")).unwrap_or_default();
            let why = step.reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
            (format!("{task} {}{on}{why}", reasons::name(&step.state)), task_text::tone(step.state))
        }
        What::Presence { robot, key, there } => {
            let who = robot.as_ref().map_or_else(|| service(key), Name::to_string);
            match there {
                true => (format!("{who} is online"), Tone::Plain),
                false => (format!("{who} is GONE"), Tone::Bad),
            }
        }
    }
}

/// The dispatcher or traffic control, by the key of its presence.
fn service(key: &str) -> String {
    let who = key.rsplit('/').nth(1).unwrap_or(key);
    if who == "traffic" { "traffic control".to_owned() } else { "the dispatcher".to_owned() }
}

fn robot(event: &Event) -> (String, Tone) {
    let name = &event.robot;
    match &event.kind {
        EventKind::Started { version } => (format!("{name} has started, version {version}"), Tone::Strong),
        EventKind::Mode { from, to } => {
            (format!("{name} {} > {}", reasons::name(from), reasons::name(to)), Tone::Dim)
        }
        EventKind::Goal { status, reason, .. } => {
            let why = reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
            let tone = match status {
                GoalStatus::Reached => Tone::Good,
                GoalStatus::Blocked | GoalStatus::Cancelled | GoalStatus::Interrupted => Tone::Warning,
                GoalStatus::Failed => Tone::Bad,
                _ => Tone::Plain,
            };
            (format!("{name} goal {}{why}", reasons::name(status)), tone)
        }
        EventKind::Lease { holder: Some(holder) } => {
            (format!("{name} is controlled by {holder}"), Tone::Plain)
        }
        EventKind::Lease { holder: None } => (format!("{name}: control released"), Tone::Dim),
        EventKind::Fault { fault, present: true, detail } => {
            let detail = detail.as_ref().map(|words| format!(" ({words})")).unwrap_or_default();
            (format!("{name} FAULT {fault}{detail}"), Tone::Bad)
        }
        EventKind::Fault { fault, .. } => (format!("{name} {fault} cleared"), Tone::Good),
        EventKind::Latch { latch, set: true, by } => (format!("{name} LATCHED {latch} by {by}"), Tone::Bad),
        EventKind::Latch { latch, by, .. } => (format!("{name} {latch} reset by {by}"), Tone::Good),
    }
}
