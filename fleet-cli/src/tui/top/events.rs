//! What happened, the newest first; or, instead, the dispatcher's tasks, or its alerts.

use super::labels::fitted;
use super::robot_view::{age, long_age};
use super::*;
use crate::text::task as task_text;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Modifier;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use xtb_client::scene::fold::{EventEntry, fold, words};
use xtb_client::scene::{SceneChange, SceneEvent};
use xtb_client::text::reasons;
use xtb_protocol::messages::{EventKind, GoalStatus, TaskEvent, TaskView};

impl Cockpit {
    pub(super) fn draw_pane(&self, frame: &mut Frame<'_>, area: Rect, scene: &Scene, now_ms: AtMs) {
        let look = self.setup.look;
        let (title, lines) = match self.pane {
            Pane::Events => {
                let details = if self.details { "less" } else { "details" };
                (format!("events (d: {details}, v: tasks)"), self.events(scene, now_ms))
            }
            Pane::Tasks => self.tasks(scene, now_ms),
            Pane::Alerts => self.alert_lines(scene),
        };
        let style = look.tone(Tone::Dim).add_modifier(Modifier::UNDERLINED);
        let title = Line::styled(format!(" {title:width$}", width = usize::from(area.width)), style);
        let lines = std::iter::once(title).chain(lines).take(usize::from(area.height));
        let lines: Vec<Line<'_>> = lines.map(|line| fitted(line, area.width)).collect();
        frame.render_widget(Paragraph::new(lines), area);
    }

    /// A line for each drive, task and other event; with details each event has a line below its own.
    fn events(&self, scene: &Scene, now_ms: AtMs) -> Vec<Line<'static>> {
        let shown = |robot: &Name| self.setup.robots.is_empty() || self.setup.robots.contains(robot);
        let concerns = |happening: &&SceneEvent| match &happening.what {
            SceneChange::Robot(event) => shown(&event.robot),
            SceneChange::Task(event) => event.step.robot.as_ref().is_none_or(shown),
            SceneChange::Presence { robot, .. } => robot.as_ref().is_none_or(shown),
        };
        let age_of = |happening: &SceneEvent| since_ms(scene, happening, now_ms);
        let line = |indent: &str, happening: &SceneEvent, text: String| {
            let since = age_of(happening).map_or_else(|| "?".to_owned(), |ms| age(Some(ms)));
            let since = Span::styled(format!("{since:>7} {indent}"), self.setup.look.tone(Tone::Dim));
            Line::from(vec![since, Span::styled(text, self.setup.look.tone(tone(&happening.what)))])
        };
        let mut entries = fold(scene.happenings().iter().filter(concerns));
        entries.reverse();
        // Those from before the screen opened come robot by robot.
        entries.sort_by_key(|entry| {
            let newest = entry.events.last().map(|event| (age_of(event), event.at_ms));
            newest.map(|(since_ms, at_ms)| since_ms.unwrap_or_else(|| now_ms.saturating_sub(at_ms)))
        });
        let lines = |entry: EventEntry<'_>| {
            let head = entry.head().map(|head| line("", head, entry.text()));
            let inner = entry.events.iter().rev().filter(|_| self.details && entry.is_folded());
            let inner: Vec<_> = inner.map(|event| line("  ", event, words(&event.what))).collect();
            head.into_iter().chain(inner)
        };
        entries.into_iter().flat_map(lines).collect()
    }

    /// Open ones first, then those that ended last.
    fn tasks(&self, scene: &Scene, now_ms: AtMs) -> (String, Vec<Line<'static>>) {
        let Some(list) = scene.tasks() else {
            return ("tasks (v: events): unknown, no dispatcher found".to_owned(), Vec::new());
        };
        let old = format!("{} old", long_age(list.age_ms(now_ms)));
        let gone = if scene.dispatcher() || self.playing.is_some() { "" } else { ", NO DISPATCHER" };
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
        SceneChange::Robot(event) => {
            let state = scene.robots().get(&event.robot)?.state.as_ref()?;
            match state.value.epoch == event.epoch {
                true => state.age_ms(now_ms) + state.value.tick_ms.saturating_sub(event.tick_ms),
                false => came, // of another boot, with a clock of its own
            }
        }
        SceneChange::Task(event) => {
            let list = scene.tasks()?;
            list.age_ms(now_ms) + list.value.at_ms.saturating_sub(event.step.at_ms)
        }
        SceneChange::Presence { .. } => came,
    };
    // Never younger than its message.
    Some(happened.max(came))
}

/// How good it is.
fn tone(what: &SceneChange) -> Tone {
    let event = match what {
        SceneChange::Robot(event) => event,
        SceneChange::Task(TaskEvent { step, .. }) => return task_text::tone(step.state),
        SceneChange::Presence { there, .. } => return if *there { Tone::Plain } else { Tone::Bad },
    };
    match &event.kind {
        EventKind::Started { .. } => Tone::Strong,
        EventKind::Mode { .. } | EventKind::Lease { holder: None } => Tone::Dim,
        EventKind::Goal { status: GoalStatus::Reached, .. } => Tone::Good,
        EventKind::Goal { status: GoalStatus::Failed, .. } => Tone::Bad,
        EventKind::Goal {
            status: GoalStatus::Blocked | GoalStatus::Cancelled | GoalStatus::Interrupted,
            ..
        } => Tone::Warning,
        EventKind::Goal { .. } | EventKind::Lease { .. } => Tone::Plain,
        EventKind::Fault { present, .. } => {
            if *present {
                Tone::Bad
            } else {
                Tone::Good
            }
        }
        EventKind::Latch { set, .. } => {
            if *set {
                Tone::Bad
            } else {
                Tone::Good
            }
        }
    }
}
