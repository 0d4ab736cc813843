//! What stands where, at any size of the terminal.
//!
//! ```text
//!   title                        too narrow for both: map above robots;
//!   map     │ robots             too low for that: robots alone
//!           │ the selected one
//!           │ events or tasks
//!   notices
//!   keys
//! ```

use ratatui::layout::{Constraint, Layout, Rect};

/// From this width on the map stands beside the robots.
const BESIDE: u16 = 70;
/// From this height on there is a map at all.
const MAPPED: u16 = 14;
/// Rows of the selected robot's facts, with its name.
pub(super) const DETAIL: u16 = 8;
/// Robots of which the table shows all, if there is room.
const HEADING: u16 = 1;

/// Where everything goes. What has no room has no area.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Areas {
    pub(super) title: Rect,
    pub(super) map: Option<Rect>,
    pub(super) robots: Rect,
    pub(super) detail: Option<Rect>,
    pub(super) pane: Option<Rect>,
    pub(super) notices: Rect,
    pub(super) keys: Rect,
}

/// Shares the screen out for so many robots.
pub(super) fn areas(area: Rect, robots: usize) -> Areas {
    let notices = match area.height {
        0..8 => 1,
        8..40 => 2,
        _ => 4,
    };
    let lines = [1, 0, notices, 1].map(Constraint::Length);
    let [title, body, notices, keys] =
        Layout::vertical([lines[0], Constraint::Fill(1), lines[2], lines[3]]).areas(area);
    let mut areas = Areas { title, notices, keys, robots: body, ..Areas::default() };
    let rows = HEADING + u16::try_from(robots.max(1)).unwrap_or(u16::MAX - HEADING);
    if area.height < MAPPED {
        return areas;
    }
    if area.width < BESIDE {
        let table = rows.min(body.height / 2);
        let [map, table] = Layout::vertical([Constraint::Fill(1), Constraint::Length(table)]).areas(body);
        (areas.map, areas.robots) = (Some(map), table);
        return areas;
    }
    let map = (body.width * 45 / 100).max(32);
    let [map, right] = Layout::horizontal([Constraint::Length(map), Constraint::Fill(1)]).areas(body);
    let right = Rect { x: right.x + 1, width: right.width.saturating_sub(1), ..right };
    areas.map = Some(map);
    // The selected robot's facts and a few events are worth more than the last rows of a large fleet.
    let most = right.height.saturating_sub(DETAIL + 4).max(right.height / 3);
    let table = rows.min(most);
    let [table, _, detail, _, pane] = Layout::vertical([
        Constraint::Length(table),
        Constraint::Length(1),
        Constraint::Length(DETAIL),
        Constraint::Length(1),
        Constraint::Fill(1),
    ])
    .areas(right);
    areas.robots = table;
    areas.detail = (detail.height > 1).then_some(detail);
    areas.pane = (pane.height > 1).then_some(pane);
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_has_room_at_80_by_24_and_nothing_overlaps() {
        for (width, height) in [(80, 24), (160, 50)] {
            let all = areas(Rect::new(0, 0, width, height), 5);
            let parts = [all.title, all.map.unwrap(), all.robots, all.detail.unwrap(), all.pane.unwrap()];
            let parts: Vec<Rect> = parts.into_iter().chain([all.notices, all.keys]).collect();
            assert!(all.robots.height == 6 && parts.iter().all(|part| part.area() > 0), "{all:?}");
            for (index, part) in parts.iter().enumerate() {
                assert!(parts[..index].iter().all(|other| part.intersection(*other).area() == 0), "{all:?}");
            }
        }
    }

    #[test]
    fn a_small_terminal_keeps_the_robots_and_a_tiny_one_does_not_fail() {
        let narrow = areas(Rect::new(0, 0, 50, 24), 3);
        assert!(narrow.map.is_some() && narrow.robots.height == 4 && narrow.detail.is_none());
        let low = areas(Rect::new(0, 0, 80, 10), 3);
        assert!(low.map.is_none() && low.robots.height == 6, "{low:?}");
        for width in 0..40 {
            for height in 0..20 {
                let _ = areas(Rect::new(0, 0, width, height), 300);
            }
        }
    }
}
