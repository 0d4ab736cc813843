//! The cockpit on a fleet of six, at both sizes that matter and some that do not.

mod alerts;
mod drawing;
mod filtering;
mod pressing;

use super::*;
use crossterm::event::{KeyEventState, KeyModifiers};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use xtb_client::fake::{self, name};
use xtb_client::messages::AnyMessage;
use xtb_protocol::Uuid;
use xtb_protocol::keys::{FleetKeys, Key};
use xtb_protocol::messages::{
    Arc, FleetMap, GoalStatus, Latch, LeaseState, MapCell, MapHash, MapZone, MapZoneKind, NavPhase,
    RobotState, RosterEntry, RouteSource, RouteState, SimStats, StopReason, Suspension, SuspensionCause,
    TaskId, TaskList, TaskState, TaskView, Track,
};

/// When the tests look.
const NOW: AtMs = 10_000;

fn key(text: &str) -> Key {
    let map = FleetKeys::new(name("lab")).map();
    let root = map.strip_suffix("map").unwrap();
    Key::parse(&format!("{root}{text}")).unwrap()
}

fn at(robot: &str, x_m: f64, y_m: f64, yaw_deg: f64) -> RobotState {
    let mut state = fake::state(robot);
    (state.pose.x_m, state.pose.y_m, state.pose.yaw_rad) = (x_m, y_m, yaw_deg.to_radians());
    state
}

fn under_way(mut state: RobotState, status: GoalStatus) -> RobotState {
    state.mode = xtb_control::Mode::Goto;
    state.goal = Some(fake::goal(Uuid::from_u128(7), status));
    state.lease = Some(LeaseState { holder: name("alice"), age_ms: 20 });
    state
}

/// A room of 12 × 8 m with walls of one cell.
fn room() -> FleetMap {
    let (width, height) = (48, 32);
    let mut cells = vec![(MapCell::Occupied, width)];
    for _ in 1..height - 1 {
        cells.extend([(MapCell::Occupied, 1), (MapCell::Free, width - 2), (MapCell::Occupied, 1)]);
    }
    cells.push((MapCell::Occupied, width));
    let kind = MapZoneKind::KeepOut;
    let points = vec![[3.0, -3.0], [5.0, -3.0], [5.0, -1.5], [3.0, -1.5]];
    let zones = vec![MapZone { name: "chargers".into(), kind, points }];
    let (name, hash) = ("room".into(), MapHash::new(5));
    FleetMap { name, hash, resolution_m: 0.25, origin_m: [-6.0, -4.0], width, height, cells, zones }
}

/// One drives, one is blocked, one latched, one stale, one gone, and one was never heard.
fn fleet() -> Scene {
    let mut scene = Scene::new(name("lab"));
    scene.take(0, &key("map"), room().into());
    for robot in ["xtb-1", "xtb-2", "xtb-3", "xtb-4", "xtb-5"] {
        scene.take(0, &key(&format!("{robot}/alive")), AnyMessage::Alive(true));
    }
    let mut tell = |at_ms: AtMs, state: RobotState| {
        scene.take(at_ms, &key(&format!("{}/state", state.robot)), state.into());
    };
    let mut drives = under_way(at("xtb-1", -4.0, 3.0, 0.0), GoalStatus::Running);
    if let Some(goal) = &mut drives.goal {
        (goal.x_m, goal.y_m) = (Some(1.5), Some(3.0));
    }
    drives.speed_mps = Some(0.31);
    let track = Track {
        start: xtb_control::frames::MapPose { x_m: -4.5, y_m: 3.0, yaw_rad: 0.0 },
        arcs: vec![Arc { length_m: 6.0, curvature_per_m: 0.0 }],
    };
    drives.nav.route = Some(RouteState {
        source: RouteSource::Own,
        plan: 0,
        phase: NavPhase::Following,
        track: Some(track),
        done_m: 0.5,
        release_m: 3.0,
        off_m: 0.0,
        waits_for: None,
        blocked_at_m: None,
        plans: 1,
    });
    tell(9_900, drives);
    let mut blocked = under_way(at("xtb-2", 0.0, 0.0, 90.0), GoalStatus::Blocked);
    blocked.stopped_because = vec![StopReason::ObstacleFront];
    blocked.stopped_age_ms = Some(3_000);
    blocked.obstacle.front = Some(true);
    tell(9_950, blocked);
    let mut latched = at("xtb-3", 3.0, 2.0, 180.0);
    latched.latches = vec![fake::latch(Latch::Estop, "carol", false)];
    latched.stopped_because = vec![StopReason::Estop];
    latched.stopped_age_ms = Some(12_000);
    tell(9_980, latched);
    let mut stale = under_way(at("xtb-4", -2.0, -2.0, 45.0), GoalStatus::Running);
    stale.speed_mps = Some(0.77);
    tell(6_000, stale);
    tell(5_000, at("xtb-5", 1.5, -2.5, 0.0));
    scene.take(7_000, &key("xtb-5/alive"), AnyMessage::Alive(false));
    scene.expect(RosterEntry { name: name("xtb-6"), tags: Vec::new(), start_pose: None });
    let mut sensors = fake::sensors("xtb-2");
    sensors.ir_front_cm = vec![None, Some(20.0), Some(21.0), None, None, Some(30.0)];
    scene.take(9_900, &key("xtb-2/sensors"), sensors.into());
    scene.take(9_000, &key("dispatch/alive"), AnyMessage::Alive(true));
    let mut task = fake::task(3, TaskState::Running);
    task.robot = Some(name("xtb-2"));
    scene.take(9_000, &key("dispatch/tasks"), list(vec![task], Vec::new()).into());
    scene
}

fn list(tasks: Vec<TaskView>, suspended: Vec<Suspension>) -> TaskList {
    TaskList { ledger: 1, at_ms: 5_000, ledger_failed: None, tasks, left_out: 0, suspended }
}

fn cockpit() -> Cockpit {
    with(Theme { color: true, ascii: false }, None)
}

fn with(look: Theme, read_only: Option<&'static str>) -> Cockpit {
    Cockpit::new(Setup { robots: Vec::new(), look, reporting: Reporting::Releases, read_only })
}

/// What stands on the screen, line by line.
fn screen(cockpit: &mut Cockpit, scene: &Scene, width: u16, height: u16) -> Vec<String> {
    screen_at(cockpit, scene, width, height, NOW)
}

fn screen_at(cockpit: &mut Cockpit, scene: &Scene, width: u16, height: u16, now_ms: AtMs) -> Vec<String> {
    let buffer = buffer(cockpit, scene, width, height, now_ms);
    let rows = buffer.content.chunks(usize::from(width.max(1)));
    rows.map(|row| row.iter().map(ratatui::buffer::Cell::symbol).collect::<String>()).collect()
}

fn buffer(
    cockpit: &mut Cockpit,
    scene: &Scene,
    width: u16,
    height: u16,
    now_ms: AtMs,
) -> ratatui::buffer::Buffer {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| cockpit.draw(frame, scene, now_ms)).unwrap();
    terminal.backend().buffer().clone()
}

/// The line in which `what` stands.
fn line<'a>(screen: &'a [String], what: &str) -> &'a str {
    let found = screen.iter().find(|line| line.contains(what));
    found.unwrap_or_else(|| panic!("{what} is not on the screen:\n{}", screen.join("\n")))
}

fn typed(code: KeyCode, kind: KeyEventKind) -> Input {
    let (modifiers, state) = (KeyModifiers::NONE, KeyEventState::NONE);
    Input::Key(KeyEvent { code, modifiers, kind, state })
}

fn press(cockpit: &mut Cockpit, scene: &Scene, code: KeyCode) -> Vec<Action> {
    cockpit.input(&typed(code, KeyEventKind::Press), scene, NOW)
}

fn letter(cockpit: &mut Cockpit, scene: &Scene, letter: char) -> Vec<Action> {
    press(cockpit, scene, KeyCode::Char(letter))
}

/// What robots are asked for.
fn commands(actions: &[Action]) -> Vec<Command> {
    let command = |action: &Action| match action {
        Action::Do { command, .. } => Some(command.clone()),
        _ => None,
    };
    actions.iter().filter_map(command).collect()
}
