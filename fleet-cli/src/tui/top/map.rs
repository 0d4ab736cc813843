//! The map: walls and zones, and on them paths, trails, range finders, goals and robots.

use super::labels::{Extent, Label, extents};
use super::robot_view::{ShownRobot, age};
use super::view::View;
use super::*;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line as Text, Span};
use ratatui::widgets::canvas::{Canvas, Context, Line, Points};
use ratatui::widgets::{Block, Clear};
use xtb_client::scene::CarBody;
use xtb_nav::Path;
use xtb_protocol::messages::{MapPlace, PlaceKind, RouteState, Sensors};

/// Narrower than this a body is only a sign.
const BODY_CELLS: f64 = 4.0;
/// Without a map this much around the robots is shown.
const AROUND_M: f64 = 2.0;
/// Wider cells have room for what names differ in, not for whole names.
const NAMES_UP_TO_M: f64 = 0.25;

impl Cockpit {
    /// The map in its frame.
    pub(super) fn draw_map(
        &mut self,
        frame: &mut Frame<'_>,
        area: Rect,
        sights: &[ShownRobot<'_>],
        now_ms: AtMs,
    ) {
        let look = self.setup.look;
        let inner = Block::bordered().inner(area);
        frame.render_widget(Clear, area);
        let selected = self.sight(sights).and_then(ShownRobot::place).map(|(x_m, y_m, _)| (x_m, y_m));
        self.view.arrange(inner, self.bounds(sights), selected);
        let block = Block::bordered()
            .border_style(look.tone(Tone::Dim))
            .title(self.map_title(area.width))
            .title_bottom(self.cursor_title());
        frame.render_widget(block, area);
        if inner.is_empty() {
            return;
        }
        let names = short_names(sights, self.view.cell_m().0 <= NAMES_UP_TO_M);
        let drawing = Drawing { cockpit: self, view: &self.view, look, now_ms };
        let labels: Vec<Option<Label>> =
            sights.iter().zip(&names).map(|(sight, name)| drawing.label(inner, sight, name)).collect();
        let extents = extents(&labels);
        let (x, y) = self.view.bounds();
        let canvas = Canvas::default().marker(Marker::Braille).x_bounds(x).y_bounds(y).paint(|canvas| {
            drawing.floor(canvas);
            sights.iter().for_each(|sight| drawing.way(canvas, sight));
            canvas.layer();
            sights.iter().for_each(|sight| drawing.sensed(canvas, sight));
            for (sight, name) in sights.iter().zip(&names) {
                drawing.goal(canvas, sight, name);
            }
            for ((sight, name), extent) in sights.iter().zip(&names).zip(&extents) {
                drawing.robot(canvas, sight, name, *extent);
            }
        });
        frame.render_widget(canvas, inner);
        self.draw_cursor(frame, inner);
    }

    fn map_title(&self, width: u16) -> Text<'static> {
        let name = self.floor.as_ref().map_or("no map", |floor| floor.name.as_str());
        let (width_m, height_m) = self.view.cell_m();
        let mode = if self.view.follows() { ", follow" } else { "" };
        let scale = format!(" {name}{mode} · cell {width_m:.2} × {height_m:.2} m ").replace('×', "by");
        let short = format!(" {name}{mode} ");
        Text::raw(if scale.chars().count() + 2 <= usize::from(width) { scale } else { short })
    }

    fn cursor_title(&self) -> Text<'static> {
        let Some(Cursor { x_m, y_m, yaw_rad }) = self.cursor else { return Text::raw("") };
        let yaw = yaw_rad.map_or_else(|| "any yaw".to_owned(), |yaw| format!("{:.0}°", yaw.to_degrees()));
        let (x_m, y_m) = (xtb_client::text::robot::fixed(x_m, 2), xtb_client::text::robot::fixed(y_m, 2));
        Text::raw(format!(" cursor ({x_m}, {y_m}) {yaw} "))
    }

    /// Of the floor, else of the robots.
    fn bounds(&self, sights: &[ShownRobot<'_>]) -> ([f64; 2], [f64; 2]) {
        if let Some(floor) = &self.floor {
            return floor.bounds;
        }
        let places = sights.iter().filter_map(ShownRobot::place);
        let goals = sights.iter().filter_map(goal_of).map(|(x_m, y_m, yaw)| (x_m, y_m, yaw.unwrap_or(0.0)));
        let points: Vec<(f64, f64, f64)> = places.chain(goals).collect();
        let span = |along: fn(&(f64, f64, f64)) -> f64| {
            let fold = |(low, high): (f64, f64), at: f64| (low.min(at), high.max(at));
            let (low, high) = points.iter().map(along).fold((f64::MAX, f64::MIN), fold);
            if low > high { [-AROUND_M, AROUND_M] } else { [low - AROUND_M, high + AROUND_M] }
        };
        (span(|point| point.0), span(|point| point.1))
    }

    fn draw_cursor(&self, frame: &mut Frame<'_>, inner: Rect) {
        let Some(cursor) = self.cursor else { return };
        let Some(at) = self.view.cell(inner, (cursor.x_m, cursor.y_m)) else { return };
        let sign = cursor.yaw_rad.map_or('+', |yaw| self.setup.look.arrow(yaw));
        if let Some(cell) = frame.buffer_mut().cell_mut(at) {
            cell.set_char(sign).set_style(Style::reset().add_modifier(Modifier::REVERSED | Modifier::BOLD));
        }
    }
}

/// What tells robots apart: whole names where there is room, else without what all begin with.
fn short_names(sights: &[ShownRobot<'_>], whole: bool) -> Vec<String> {
    let names: Vec<&str> = sights.iter().map(|sight| sight.name.as_str()).collect();
    let first = names.first().copied().unwrap_or_default();
    let stem = first.trim_end_matches(|c: char| c.is_ascii_digit());
    let numbered = |name: &&str| name.strip_prefix(stem).is_some_and(|rest| rest.parse::<u64>().is_ok());
    let stem = if whole || !names.iter().all(numbered) { "" } else { stem };
    names.iter().map(|name| name[stem.len()..].to_owned()).collect()
}

/// The goal that it is under way to.
fn goal_of(sight: &ShownRobot<'_>) -> Option<(f64, f64, Option<f64>)> {
    let goal = sight.state?.goal.as_ref().filter(|goal| !goal.status.is_final())?;
    Some((goal.x_m?, goal.y_m?, goal.yaw_rad))
}

struct Drawing<'a> {
    cockpit: &'a Cockpit,
    view: &'a View,
    look: Theme,
    now_ms: AtMs,
}

impl Drawing<'_> {
    fn floor(&self, canvas: &mut Context<'_>) {
        let Some(floor) = &self.cockpit.floor else { return };
        let line = |segment: &floor::Segment, color: Color| {
            let [(x1, y1), (x2, y2)] = *segment;
            Line { x1, y1, x2, y2, color }
        };
        for zone in &floor.zones {
            let color = self.look.paint(if zone.heading_rad.is_some() { Color::Blue } else { Color::Red });
            for edge in &zone.edges {
                let dashes = self.dashes(edge);
                canvas.draw(&Points { coords: &dashes, color });
            }
            let style = self.look.tone(Tone::Dim).fg(color);
            let Some(name) = self.zone_name(zone) else { continue };
            let left_m = name.chars().count() as f64 / 2.0 * self.view.cell_m().0;
            canvas.print(zone.middle.0 - left_m, zone.middle.1, Text::styled(name, style));
        }
        let color = self.look.paint(Color::Gray);
        floor.walls.iter().for_each(|wall| canvas.draw(&line(wall, color)));
        floor.places.iter().for_each(|place| self.place(canvas, place));
    }

    /// A mark, and the name beside it.
    fn place(&self, canvas: &mut Context<'_>, place: &MapPlace) {
        let mark = match place.kind {
            PlaceKind::Place => "·",
            PlaceKind::Dock => "D",
            PlaceKind::Parking => "P",
            PlaceKind::Waiting => "W",
        };
        let text = format!("{mark} {}", place.name);
        canvas.print(place.x_m, place.y_m, Text::styled(text, self.look.tone(Tone::Dim)));
    }

    /// As much of its name as lies within it.
    fn zone_name(&self, zone: &floor::Zone) -> Option<String> {
        let east = zone.edges.iter().map(|[from, _]| from.0);
        let (low, high) = east.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        let arrow = zone.heading_rad.map(|heading_rad| self.look.arrow(heading_rad).to_string());
        let whole = match &arrow {
            Some(arrow) => format!("{arrow} {}", zone.name),
            None => zone.name.clone(),
        };
        let fits = (whole.chars().count() + 1) as f64 * self.view.cell_m().0 < high - low;
        if fits { Some(whole) } else { arrow }
    }

    /// Points of a line, so far apart that it is told from a wall.
    fn dashes(&self, [from, to]: &floor::Segment) -> Vec<(f64, f64)> {
        let length_m = (to.0 - from.0).hypot(to.1 - from.1);
        let count = (length_m / self.view.cell_m().0).ceil().clamp(1.0, 1000.0);
        let at =
            |step: f64| (from.0 + (to.0 - from.0) * step / count, from.1 + (to.1 - from.1) * step / count);
        (0..=count as u32).map(|step| at(f64::from(step))).collect()
    }

    /// Where it has been, and where its path goes: dense as far as it is released, thin beyond.
    fn way(&self, canvas: &mut Context<'_>, sight: &ShownRobot<'_>) {
        let trail: Vec<(f64, f64)> = sight.robot.trail.iter().copied().collect();
        canvas.draw(&Points { coords: &trail, color: self.look.paint(Color::DarkGray) });
        let route = sight.state.and_then(|state| state.nav.route.as_ref());
        let Some((route, path)) = route.and_then(|route| Some((route, path_of(route)?))) else { return };
        let dot_m = self.view.cell_m().0 / 2.0;
        let points: Vec<(f64, f64)> = along(&path, route, dot_m);
        canvas.draw(&Points { coords: &points, color: self.look.robot(sight.row) });
    }

    /// What its range finders see, from neighbour to neighbour.
    fn sensed(&self, canvas: &mut Context<'_>, sight: &ShownRobot<'_>) {
        let sensors = sight.robot.sensors.as_ref().and_then(|seen| seen.fresh(self.now_ms));
        let (Some(pose), Some(sensors)) = (sight.state.map(|state| &state.pose), sensors) else { return };
        let color = self.look.paint(Color::LightRed);
        let to_map = |(ahead, left): (f64, f64)| at((pose.x_m, pose.y_m, pose.yaw_rad), ahead, left);
        for arc in arcs(sensors, &sight.robot.body) {
            let arc: Vec<(f64, f64)> = arc.into_iter().map(to_map).collect();
            canvas.draw(&Points { coords: &arc, color });
            for pair in arc.windows(2) {
                canvas.draw(&Line { x1: pair[0].0, y1: pair[0].1, x2: pair[1].0, y2: pair[1].1, color });
            }
        }
    }

    fn goal(&self, canvas: &mut Context<'_>, sight: &ShownRobot<'_>, name: &str) {
        let Some((x_m, y_m, yaw_rad)) = goal_of(sight) else { return };
        let arrow = yaw_rad.map(|yaw| self.look.arrow(yaw).to_string()).unwrap_or_default();
        let gap = if name.starts_with(|c: char| c.is_ascii_digit()) { "" } else { " " };
        let style = Style::new().fg(self.look.robot(sight.row));
        canvas.print(x_m, y_m, Text::styled(format!("◇{arrow}{gap}{name}"), style));
    }

    /// Where the whole label of a robot would be.
    fn label(&self, inner: Rect, sight: &ShownRobot<'_>, name: &str) -> Option<Label> {
        let (x_m, y_m, _) = sight.place()?;
        let spans = self.label_spans(sight, name);
        let columns: Vec<u16> =
            spans.iter().map(|span| u16::try_from(span.width()).unwrap_or(u16::MAX)).collect();
        let is_old = sight.is_old();
        let age = columns.last().copied().filter(|_| is_old).unwrap_or(0);
        let (column, row) = self.view.cell(inner, (self.within(&spans, x_m), y_m))?;
        Some(Label { column, row, name: columns.iter().sum::<u16>() - age, age })
    }

    /// So that a label does not hang over the right edge.
    fn within(&self, spans: &[Span<'_>], x_m: f64) -> f64 {
        let columns: usize = spans.iter().map(Span::width).sum();
        let [west_m, east_m] = self.view.bounds().0;
        let edge_m = east_m - columns.saturating_sub(1) as f64 * self.view.cell_m().0;
        if x_m > edge_m { edge_m.max(west_m) } else { x_m }
    }

    /// Sign, name, how it stands, and how old that is.
    fn label_spans(&self, sight: &ShownRobot<'_>, name: &str) -> Vec<Span<'static>> {
        let (known, standing) = (sight.state.is_some(), sight.standing());
        let color = if known { self.look.robot(sight.row) } else { self.look.paint(Color::DarkGray) };
        let yaw_rad = sight.place().map_or(0.0, |(_, _, yaw_rad)| yaw_rad);
        let heading = if known { self.look.arrow(yaw_rad) } else { '?' };
        let selected = self.cockpit.selected.as_ref() == Some(sight.name);
        let style = Style::new().fg(color).add_modifier(if known { Modifier::BOLD } else { Modifier::DIM });
        let style = if selected { style.add_modifier(Modifier::REVERSED) } else { style };
        let mut spans = vec![Span::styled(heading.to_string(), style), Span::styled(name.to_owned(), style)];
        if let Some(sign) = standing.sign().filter(|_| known) {
            spans.push(Span::styled(sign.to_string(), self.look.tone(standing.tone())));
        }
        if sight.is_old() {
            spans.push(Span::styled(format!(" {}", age(sight.age_ms)), self.look.tone(Tone::Dim)));
        }
        spans
    }

    fn robot(&self, canvas: &mut Context<'_>, sight: &ShownRobot<'_>, name: &str, extent: Extent) {
        let Some(place) = sight.place() else { return };
        let body = &sight.robot.body;
        if sight.state.is_some() && body.length_m / self.view.cell_m().0 >= BODY_CELLS {
            outline(canvas, place, body, self.look.robot(sight.row));
        }
        let mut spans = self.label_spans(sight, name);
        let x_m = self.within(&spans, place.0);
        match extent {
            Extent::Sign => spans.truncate(1),
            Extent::Name if sight.is_old() => drop(spans.pop()),
            Extent::Name | Extent::Age => {}
        }
        canvas.print(x_m, place.1, Text::from(spans));
    }
}

/// A point of the robot's own frame, in the map.
fn at((x_m, y_m, yaw_rad): (f64, f64, f64), ahead_m: f64, left_m: f64) -> (f64, f64) {
    let (sin, cos) = yaw_rad.sin_cos();
    (x_m + ahead_m * cos - left_m * sin, y_m + ahead_m * sin + left_m * cos)
}

fn outline(canvas: &mut Context<'_>, place: (f64, f64, f64), body: &CarBody, color: Color) {
    let (half_m, side_m) = (body.length_m / 2.0, body.width_m / 2.0);
    let corners = [
        (half_m, 0.0),
        (half_m / 2.0, side_m),
        (-half_m, side_m),
        (-half_m, -side_m),
        (half_m / 2.0, -side_m),
    ];
    let corners = corners.map(|(ahead, left)| at(place, body.ahead_m + ahead, left));
    for (index, &(x1, y1)) in corners.iter().enumerate() {
        let (x2, y2) = corners[(index + 1) % corners.len()];
        canvas.draw(&Line { x1, y1, x2, y2, color });
    }
}

/// Ends of the beams that see something, (ahead, left) of the robot, in groups of neighbours.
fn arcs(sensors: &Sensors, body: &CarBody) -> Vec<Vec<(f64, f64)>> {
    let mut arcs = Vec::new();
    for bumper in body.seen(sensors) {
        let mut arc = Vec::new();
        for (beam, reading) in bumper {
            match reading {
                Some(cm) => arc.push(beam.at_cm(cm)),
                None => arcs.push(std::mem::take(&mut arc)),
            }
        }
        arcs.push(arc);
    }
    arcs.retain(|arc| !arc.is_empty());
    arcs
}

fn path_of(route: &RouteState) -> Option<Path> {
    route.track.as_ref().map(Path::from)
}

/// Points of what is still to be driven: at each dot as far as it is released, at each fourth beyond.
fn along(path: &Path, route: &RouteState, dot_m: f64) -> Vec<(f64, f64)> {
    const MOST: usize = 2000;
    let (mut way_m, end_m) = (route.done_m.max(0.0), path.length_m());
    let mut points = Vec::new();
    while way_m <= end_m && points.len() < MOST {
        let (pose, _) = path.at(way_m);
        points.push((pose.x_m, pose.y_m));
        way_m += if way_m < route.release_m { dot_m } else { 4.0 * dot_m };
    }
    points
}
