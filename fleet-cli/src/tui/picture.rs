//! The live picture of a simulated fleet: trucks, trails and goals, and a line for each robot.

use crate::terminal::{Input, Keys};
use crossterm::event::KeyCode;
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Stylize};
use ratatui::symbols::Marker;
use ratatui::widgets::canvas::{Canvas, Circle, Context, Line, Points};
use ratatui::widgets::{Block, Row, Table};
use ratatui::{DefaultTerminal, Frame};
use std::collections::BTreeMap;
use xtb_client::Result;
use xtb_client::client::LastState;
use xtb_control::vehicle::Geometry;
use xtb_protocol::Name;
use xtb_protocol::messages::{Truth, TruthRobot};

/// A trail's points; the oldest fade first.
const TRAIL: usize = 400;
/// A new point of the trail this far from the last.
const TRAIL_STEP_M: f64 = 0.05;
const COLORS: [Color; 6] =
    [Color::Cyan, Color::Yellow, Color::Magenta, Color::Green, Color::LightBlue, Color::LightRed];

/// What the picture shows besides the present.
#[derive(Debug, Clone, Default)]
pub struct PictureTrails {
    /// Goals of each robot.
    pub goals: BTreeMap<Name, Vec<(f64, f64)>>,
    trails: BTreeMap<Name, Vec<(f64, f64)>>,
}

impl PictureTrails {
    fn remember(&mut self, truth: &Truth) {
        for (name, robot) in &truth.robots {
            let trail = self.trails.entry(name.clone()).or_default();
            let far = |&(x, y): &(f64, f64)| (x - robot.x_m).hypot(y - robot.y_m) >= TRAIL_STEP_M;
            if trail.last().is_none_or(far) {
                if trail.len() == TRAIL {
                    trail.remove(0);
                }
                trail.push((robot.x_m, robot.y_m));
            }
        }
    }

    /// The part of the map that holds everything, with a margin.
    fn bounds(&self, truth: &Truth) -> ([f64; 2], [f64; 2]) {
        let goals = self.goals.values().flatten().copied();
        let robots = truth.robots.values().map(|robot| (robot.x_m, robot.y_m));
        let points: Vec<(f64, f64)> = goals.chain(robots).collect();
        let span = |values: Vec<f64>| {
            let (low, high) =
                values.into_iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
            if low > high { [-1.0, 1.0] } else { [low - 0.8, high + 0.8] }
        };
        (span(points.iter().map(|p| p.0).collect()), span(points.iter().map(|p| p.1).collect()))
    }
}

/// A terminal given over to the picture until this is dropped.
pub struct Picture {
    terminal: DefaultTerminal,
    keys: Keys,
}

impl Picture {
    /// Takes the terminal.
    ///
    /// # Errors
    /// The terminal cannot be put into raw mode.
    pub fn open() -> Result<Self> {
        let terminal = ratatui::try_init()?;
        match Keys::open() {
            Ok(keys) => Ok(Self { terminal, keys }),
            Err(failure) => {
                ratatui::restore();
                Err(failure)
            }
        }
    }

    /// Draws the present. True if the user wants to leave (q, Esc or Ctrl-C).
    ///
    /// # Errors
    /// The terminal is gone.
    pub fn draw(
        &mut self,
        scene: &mut PictureTrails,
        truth: &Truth,
        states: &BTreeMap<Name, LastState>,
    ) -> Result<bool> {
        scene.remember(truth);
        self.terminal.draw(|frame| render(frame, scene, truth, states))?;
        let leaves = |input| match input {
            Input::Key(key) => Input::leaves(&key) || key.code == KeyCode::Char('q'),
            Input::FocusLost => false,
        };
        Ok(self.keys.typed().any(leaves))
    }
}

impl Drop for Picture {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

fn color(index: usize) -> Color {
    COLORS[index % COLORS.len()]
}

fn render(frame: &mut Frame<'_>, scene: &PictureTrails, truth: &Truth, states: &BTreeMap<Name, LastState>) {
    let lines = u16::try_from(truth.robots.len()).unwrap_or(u16::MAX).min(frame.area().height / 2);
    let [map, list] =
        Layout::vertical([Constraint::Min(6), Constraint::Length(lines + 3)]).areas(frame.area());
    let (x_bounds, y_bounds) = fit(scene.bounds(truth), f64::from(map.width), f64::from(map.height));
    let title = format!(" XTB fleet · {:.1} s simulated · q quits ", truth.t_s);
    let canvas = Canvas::default()
        .block(Block::bordered().title(title))
        .marker(Marker::Braille)
        .x_bounds(x_bounds)
        .y_bounds(y_bounds)
        .paint(|canvas| {
            for (index, (name, robot)) in truth.robots.iter().enumerate() {
                draw_robot(canvas, scene, name, robot, color(index));
            }
        });
    frame.render_widget(canvas, map);
    let rows = truth
        .robots
        .iter()
        .enumerate()
        .map(|(index, (name, robot))| row(name, robot, states.get(name)).fg(color(index)));
    let widths = [8, 8, 9, 10, 10, 18, 10].map(Constraint::Length);
    let header = Row::new(["robot", "mode", "goal", "to go", "speed", "stopped because", "contacts"]).bold();
    let block = Block::bordered();
    frame.render_widget(Table::new(rows, widths).header(header).block(block), list);
}

/// Bounds of the same scale in both directions: a terminal's cell is about twice as high as wide.
fn fit((x, y): ([f64; 2], [f64; 2]), columns: f64, rows: f64) -> ([f64; 2], [f64; 2]) {
    let scale = ((x[1] - x[0]) / columns).max((y[1] - y[0]) / (2.0 * rows));
    let widen = |span: [f64; 2], size: f64| {
        let middle = (span[0] + span[1]) / 2.0;
        [middle - size / 2.0, middle + size / 2.0]
    };
    (widen(x, scale * columns), widen(y, scale * 2.0 * rows))
}

fn draw_robot(
    canvas: &mut Context<'_>,
    scene: &PictureTrails,
    name: &Name,
    robot: &TruthRobot,
    color: Color,
) {
    if let Some(trail) = scene.trails.get(name) {
        canvas.draw(&Points { coords: trail, color: Color::DarkGray });
    }
    for &(x, y) in scene.goals.get(name).into_iter().flatten() {
        canvas.draw(&Circle { x, y, radius: 0.1, color });
    }
    canvas.layer();
    let body = Geometry::default();
    let (half_length, half_width) = (body.body_length_m / 2.0, body.body_width_m / 2.0);
    let (sin, cos) = robot.yaw_rad.sin_cos();
    let at =
        |ahead: f64, left: f64| (robot.x_m + ahead * cos - left * sin, robot.y_m + ahead * sin + left * cos);
    let corners = [
        at(half_length, 0.0),
        at(half_length / 2.0, half_width),
        at(-half_length, half_width),
        at(-half_length, -half_width),
        at(half_length / 2.0, -half_width),
    ];
    for (i, &(x1, y1)) in corners.iter().enumerate() {
        let (x2, y2) = corners[(i + 1) % corners.len()];
        canvas.draw(&Line { x1, y1, x2, y2, color });
    }
    canvas.print(robot.x_m + half_length, robot.y_m + half_width, name.to_string().fg(color));
}

fn row(name: &Name, robot: &TruthRobot, seen: Option<&LastState>) -> Row<'static> {
    let contacts = robot.contacts.to_string();
    let Some(state) = seen.and_then(LastState::fresh) else {
        let unknown = || "unknown".to_owned();
        return Row::new([name.to_string(), unknown(), unknown(), unknown(), unknown(), unknown(), contacts]);
    };
    let goal = state.goal.as_ref();
    let distance = goal.and_then(|goal| goal.distance_m).map(|m| format!("{m:.2} m"));
    let reasons: Vec<String> = state.stopped_because.iter().map(xtb_client::text::reasons::name).collect();
    Row::new([
        name.to_string(),
        xtb_client::text::reasons::name(&state.mode),
        goal.map(|goal| xtb_client::text::reasons::name(&goal.status)).unwrap_or_default(),
        distance.unwrap_or_default(),
        state.speed_mps.map_or_else(|| "unknown".into(), |mps| format!("{mps:+.2} m/s")),
        reasons.join(", "),
        contacts,
    ])
}
