//! The table of robots: the columns that there is room for, the most important ones first.

use super::robot_view::{ShownRobot, UNKNOWN, age};
use super::*;
use crate::text::width::shortened;
use crate::text::width::text_width;
use ratatui::Frame;
use ratatui::layout::{Constraint, Rect};
use ratatui::style::Modifier;
use ratatui::widgets::{Cell, Row, Table};
use xtb_client::text::reasons;
use xtb_client::text::robot::fixed;
use xtb_protocol::messages::{BatteryLevel, RobotState};

/// From this width on reasons are written out.
const LONG_WHY: u16 = 34;
/// From this width of the table on aliases stand beside the names.
const ALIASES_FROM: u16 = 64;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Name,
    Mode,
    Speed,
    ToGo,
    Task,
    Lease,
    Battery,
    Why,
    Age,
}

/// As they stand, with their widths; why takes what is left.
const COLUMNS: [(Column, &str, u16); 9] = [
    (Column::Name, "robot", 0),
    (Column::Mode, "mode", 6),
    (Column::Speed, "m/s", 5),
    (Column::ToGo, "to go", 7),
    (Column::Task, "task", 5),
    (Column::Lease, "control", 10),
    (Column::Battery, "batt", 6),
    (Column::Why, "stopped because", 15),
    (Column::Age, "age", 6),
];
/// What is left out last comes first.
const IMPORTANCE: [Column; 9] = [
    Column::Name,
    Column::Why,
    Column::Age,
    Column::Mode,
    Column::Speed,
    Column::ToGo,
    Column::Lease,
    Column::Task,
    Column::Battery,
];

/// The columns for a width, with their widths.
fn columns(width: u16, name: u16) -> Vec<(Column, &'static str, u16)> {
    let wide = |column: &Column| {
        let found = COLUMNS.iter().find(|(other, ..)| other == column);
        if *column == Column::Name { name + 1 } else { found.map_or(0, |(_, _, width)| *width) }
    };
    let mut left = width;
    let mut chosen = Vec::new();
    for column in IMPORTANCE {
        let Some(rest) = left.checked_sub(wide(&column) + 1) else { break };
        left = rest;
        chosen.push(column);
    }
    let all = COLUMNS.into_iter().filter(|(column, ..)| chosen.contains(column));
    all.map(|(column, title, _)| {
        let more = if column == Column::Why { left + 1 } else { 0 };
        (column, title, wide(&column) + more)
    })
    .collect()
}

impl Cockpit {
    /// The table, with the selected robot in sight.
    pub(super) fn draw_table(&self, frame: &mut Frame<'_>, area: Rect, sights: &[ShownRobot<'_>]) {
        let look = self.setup.look;
        let (all, fitting) = (sights.len(), self.fitting(sights));
        let sights = self.listed(sights);
        let title = |sight: &ShownRobot<'_>| match area.width >= ALIASES_FROM {
            true => sight.title(),
            false => sight.name.to_string(),
        };
        let most = if area.width >= ALIASES_FROM { 30 } else { 16 };
        let name = sights.iter().map(|sight| text_width(&title(sight))).max().unwrap_or(5).clamp(5, most);
        let columns = columns(area.width, u16::try_from(name).unwrap_or(16));
        let room = usize::from(area.height.saturating_sub(1)).max(1);
        let at = sights.iter().position(|sight| Some(sight.name) == self.selected.as_ref()).unwrap_or(0);
        let first = (at + 1).saturating_sub(room).min(sights.len().saturating_sub(room));
        let more = sights.len().saturating_sub(room);
        let rows = sights.iter().skip(first).take(room).map(|sight| self.row(sight, &title(sight), &columns));
        let mut header: Vec<Cell<'_>> = columns
            .iter()
            .map(|(column, title, _)| match column {
                Column::Name if self.filter.text.is_empty() => Cell::from(format!(" {title}")),
                Column::Name => Cell::from(format!("/{}", self.filter.text)),
                Column::Why if fitting < all => Cell::from(format!("why ({fitting} of {all})")),
                Column::Why if more > 0 => Cell::from(format!("why (+{more} rows)")),
                _ => Cell::from(*title),
            })
            .collect();
        if sights.is_empty() {
            header = vec![Cell::from(" no robot of this fleet present")];
        }
        let widths = columns.iter().map(|(_, _, width)| Constraint::Length(*width));
        let widths: Vec<Constraint> =
            if sights.is_empty() { vec![Constraint::Fill(1)] } else { widths.collect() };
        let header = Row::new(header).style(look.tone(Tone::Dim).add_modifier(Modifier::UNDERLINED));
        frame.render_widget(Table::new(rows, widths).header(header).column_spacing(1), area);
    }

    fn row(
        &self,
        sight: &ShownRobot<'_>,
        title: &str,
        columns: &[(Column, &'static str, u16)],
    ) -> Row<'static> {
        let look = self.setup.look;
        let selected = Some(sight.name) == self.selected.as_ref();
        let cells = columns.iter().map(|(column, _, width)| {
            let (text, tone) = match column {
                Column::Name => (title.to_owned(), Tone::Plain),
                _ => cell(sight, *column, *width),
            };
            let style = look.tone(tone);
            match column {
                Column::Name => {
                    let mark = if selected { '>' } else { ' ' };
                    let style = style.fg(look.robot(sight.row));
                    let strong = if selected { Modifier::REVERSED | Modifier::BOLD } else { Modifier::BOLD };
                    Cell::from(format!("{mark}{text}")).style(style.add_modifier(strong))
                }
                _ => Cell::from(shortened(&text, usize::from(*width))).style(style),
            }
        });
        let row = Row::new(cells.collect::<Vec<_>>());
        if sight.state.is_none() { row.style(look.tone(Tone::Dim)) } else { row }
    }
}

fn cell(sight: &ShownRobot<'_>, column: Column, width: u16) -> (String, Tone) {
    let known = |text: fn(&RobotState) -> (String, Tone)| {
        sight.state.map_or_else(|| (UNKNOWN.to_owned(), Tone::Dim), text)
    };
    match column {
        Column::Name => (sight.title(), Tone::Plain),
        Column::Mode => known(|state| (reasons::name(&state.mode), Tone::Plain)),
        Column::Speed => known(|state| match state.speed_mps {
            Some(mps) => (fixed(mps, 2), Tone::Plain),
            None => (UNKNOWN.to_owned(), Tone::Warning),
        }),
        Column::ToGo => known(|state| (to_go(state), Tone::Plain)),
        Column::Task => (sight.task.map(|task| task.id.to_string()).unwrap_or_default(), Tone::Plain),
        Column::Lease => known(|state| {
            (
                state.lease.as_ref().map_or_else(|| "free".to_owned(), |lease| lease.holder.to_string()),
                Tone::Plain,
            )
        }),
        Column::Battery => known(battery),
        Column::Why => (sight.why(width >= LONG_WHY), sight.standing().tone()),
        Column::Age => (age(sight.age_ms), if sight.state.is_some() { Tone::Dim } else { Tone::Bad }),
    }
}

fn to_go(state: &RobotState) -> String {
    match &state.goal {
        Some(goal) if goal.status.is_final() => reasons::name(&goal.status),
        Some(goal) => match goal.distance_m {
            Some(m) => format!("{} m", fixed(m, 1)),
            None => reasons::name(&goal.kind),
        },
        None => String::new(),
    }
}

fn battery(state: &RobotState) -> (String, Tone) {
    let tone = match state.battery_level {
        BatteryLevel::Ok => Tone::Plain,
        BatteryLevel::Unknown => Tone::Dim,
        BatteryLevel::Warn => Tone::Warning,
        BatteryLevel::Finish | BatteryLevel::Critical => Tone::Bad,
    };
    // A low one is said by a sign too.
    let sign = if state.battery_level > BatteryLevel::Ok { "!" } else { "" };
    let volts = state.battery_v.map_or_else(|| UNKNOWN.to_owned(), |volts| format!("{} V", fixed(volts, 1)));
    (format!("{volts}{sign}"), tone)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(width: u16) -> Vec<Column> {
        columns(width, 5).into_iter().map(|(column, ..)| column).collect()
    }

    #[test]
    fn columns_go_by_importance_and_never_beyond_the_width() {
        use Column::{Age, Mode, Name, Speed, Why};
        assert_eq!(names(43), [Name, Mode, Speed, Why, Age]);
        assert_eq!(names(120).len(), COLUMNS.len());
        assert_eq!(names(24), [Name, Why]);
        for width in 8..200 {
            let used: u16 = columns(width, 5).iter().map(|(_, _, width)| width + 1).sum();
            assert!(used <= width + 1, "{used} of {width}");
        }
    }
}
