//! What lies over the picture: the keys, why a robot stands, a question.

use super::robot_view::ShownRobot;
use super::*;
use crate::commands::why;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Line;
use ratatui::widgets::{Block, Clear, Paragraph, Wrap};

const KEYS: &[(&str, &str)] = &[
    ("e / E", "E-STOP the selected robot / ALL: latched until reset"),
    ("s / S", "stop the selected robot / all"),
    ("Tab j k 0-9", "select a robot"),
    ("/", "filter: name, number, @tag or state; Enter keeps, Esc ends it"),
    ("arrows", "cursor, with shift by 5 cells; g puts it on the robot"),
    ("Enter", "send the robot to the cursor; it continues if you quit"),
    ("r R u", "yaw on arrival: left, right, any"),
    ("c", "cancel its task or goal"),
    ("p", "set its pose: it stands at the cursor (asks)"),
    ("t", "drive: hold arrows, space stops; t or Esc ends"),
    ("x / X", "reset its latches / those of all robots (asks)"),
    ("A", "activate a suspended dispatcher (asks)"),
    ("w", "why it is stopped, and what to do"),
    ("v", "events, tasks or alerts; d: each event of a drive"),
    ("o", "acknowledge the open alerts: you have seen them"),
    ("+ - a f", "map: zoom in, out, all, follow the robot"),
    ("H J K L", "map: west, south, north, east"),
    ("q Esc ^C", "quit; a robot that you drive is stopped"),
];
const PLAYING_KEYS: &[(&str, &str)] = &[
    ("space", "pause or continue"),
    ("left right", "5 s back or forward; with shift 60 s"),
    ("Tab j k 0-9", "select a robot"),
    ("/", "filter: name, number, @tag or state; Enter keeps, Esc ends it"),
    ("w", "why it is stopped, and what to do"),
    ("v", "events or tasks; d: each event of a drive"),
    ("+ - a f", "map: zoom in, out, all, follow the robot"),
    ("H J K L", "map: west, south, north, east"),
    ("q Esc ^C", "quit"),
];
const SIGNS: [&str; 2] = [
    "Map: arrow = heading, ◇ = goal, dots = driven and planned path.",
    "# latched  ! blocked or faulty  ? stale: last known place",
];

impl Cockpit {
    pub(super) fn draw_over(
        &self,
        frame: &mut Frame<'_>,
        area: Rect,
        sights: &[ShownRobot<'_>],
        scene: &Scene,
    ) {
        let (title, lines) = match &self.over {
            None => return,
            Some(Modal::Question(_)) if self.filter.typing => return,
            Some(Modal::Help) => (" keys ".to_owned(), self.help()),
            Some(Modal::Why) => match self.sight(sights) {
                Some(sight) => (format!(" why {} ", sight.name), explained(*sight, scene)),
                None => return,
            },
            Some(Modal::Question(question)) => {
                let lines =
                    vec![question.text.clone(), String::new(), "y = yes, any other key = no".to_owned()];
                (" ? ".to_owned(), lines)
            }
        };
        let (width, wanted) = (area.width.saturating_sub(2).clamp(16, 90), lines.len());
        let inner = usize::from(width.saturating_sub(4)).max(1);
        let rows: usize = lines.iter().map(|line| line.chars().count().div_ceil(inner).max(1)).sum();
        let rows = u16::try_from(rows.max(wanted)).unwrap_or(u16::MAX).saturating_add(2);
        let height = rows.min(area.height);
        let at = Rect {
            x: area.x + (area.width.saturating_sub(width)) / 2,
            y: area.y + (area.height.saturating_sub(height)) / 2,
            width: width.min(area.width),
            height,
        };
        let lines: Vec<Line<'_>> = lines.into_iter().map(Line::from).collect();
        let block = Block::bordered().title(title).border_style(self.setup.look.tone(Tone::Strong));
        let block = block.padding(ratatui::widgets::Padding::horizontal(1));
        frame.render_widget(Clear, at);
        frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: false }).block(block), at);
    }

    fn help(&self) -> Vec<String> {
        let keys = if self.playing.is_some() { PLAYING_KEYS } else { KEYS };
        let lines = keys.iter().map(|(key, meaning)| format!("{key:12} {meaning}"));
        let read_only = self.setup.read_only.map(|why| format!("Commands disabled: {why}"));
        let signs = SIGNS.map(str::to_owned);
        lines.chain([String::new()]).chain(signs).chain(read_only).collect()
    }
}

fn explained(sight: ShownRobot<'_>, scene: &Scene) -> Vec<String> {
    why::in_words(&sight.to_view(), scene.suspended()).lines().map(str::to_owned).collect()
}
