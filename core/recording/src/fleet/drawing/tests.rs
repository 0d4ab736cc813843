//! What is drawn when, and what goes.

use super::*;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{
    Arc, FleetMap, GoalKind, GoalState, GoalStatus, Latch, LatchState, LinkLoss, MapCell, MapHash, NavPhase,
    ParameterInfo, RouteSource, RouteState, Track,
};

const MS: u64 = 1_000_000;

fn key(text: &str) -> Key {
    Key::parse(text).unwrap()
}

fn driving() -> RobotState {
    let mut state = xtb_client::fake::state("xtb-1");
    state.goal = Some(GoalState {
        id: Uuid::from_u128(7),
        kind: GoalKind::Goto,
        x_m: Some(2.0),
        y_m: Some(0.0),
        yaw_rad: None,
        via: None,
        status: GoalStatus::Running,
        distance_m: None,
        age_ms: 0,
        reason: None,
        by: Name::new("me").unwrap(),
        on_link_loss: LinkLoss::Halt,
    });
    let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
    let arcs = vec![Arc { length_m: 2.0, curvature_per_m: 0.0 }];
    state.nav.route = Some(RouteState {
        source: RouteSource::Traffic,
        plan: 1,
        phase: NavPhase::Following,
        track: Some(Track { start, arcs }),
        done_m: 0.0,
        release_m: 0.5,
        off_m: 0.0,
        waits_for: None,
        blocked_at_m: None,
        plans: 1,
    });
    state
}

fn draw(painter: &mut Painter, at_ms: u64, state: &RobotState) -> SceneUpdate {
    painter.draw(at_ms * MS, &key("xtb/lab/xtb-1/state"), &state.clone().into()).unwrap()
}

fn ids(update: &SceneUpdate) -> Vec<&str> {
    update.entities.iter().map(|entity| entity.id.as_str()).collect()
}

#[test]
fn a_way_is_drawn_when_it_changes_and_goes_with_its_goal() {
    let mut painter = Painter::default();
    let mut state = driving();
    let first = draw(&mut painter, 0, &state);
    assert_eq!(ids(&first), ["xtb-1 truck", "xtb-1 way"]);
    let lines = &first.entities[1].lines;
    let ends: Vec<f64> = lines.iter().map(|line| line.points.last().unwrap().x).collect();
    assert_eq!(ends, [0.5, 2.0]);
    assert_eq!(ids(&draw(&mut painter, 100, &state)), ["xtb-1 truck"]);
    state.nav.route.as_mut().unwrap().release_m = 1.0;
    assert_eq!(ids(&draw(&mut painter, 200, &state)), ["xtb-1 truck", "xtb-1 way"]);
    assert_eq!(ids(&draw(&mut painter, 1200, &state)), ["xtb-1 truck", "xtb-1 way"]);
    state.goal.as_mut().unwrap().status = GoalStatus::Reached;
    let last = draw(&mut painter, 1300, &state);
    assert_eq!((ids(&last), last.deletions[0].id.as_str()), (vec!["xtb-1 truck"], "xtb-1 way"));
}

#[test]
fn a_truck_vanishes_when_it_falls_silent_and_is_red_when_it_is_latched() {
    let mut state = driving();
    let good = draw(&mut Painter::default(), 0, &state).entities.remove(0);
    assert_eq!((good.lifetime.sec, good.lifetime.nsec), (0, 500_000_000));
    state.latches = vec![LatchState { latch: Latch::Estop, age_ms: 0, by: "me".into(), present: false }];
    let latched = draw(&mut Painter::default(), 0, &state).entities.remove(0);
    assert!(latched.cubes[0].color.r > 2.0 * latched.cubes[0].color.g, "{latched:?}");
}

#[test]
fn a_car_and_what_it_sees_are_drawn_where_its_factsheet_says() {
    let info = |(name, value): (&str, &str)| {
        let (name, value) = (name.to_owned(), value.to_owned());
        ParameterInfo { name, value, unit: String::new(), origin: String::new() }
    };
    let mut about = xtb_client::fake::about("xtb-1", "");
    about.vehicle = [
        ("drivetrain", "\"front_axle\""),
        ("geometry.wheelbase_m", "0.3"),
        ("geometry.body_length_m", "0.4"),
        ("geometry.body_width_m", "0.2"),
        ("steering.stop_deg", "20.0"),
        ("range_finders.front", "[{ left_m = 0.05, ahead_m = -0.1 }]"),
    ]
    .map(info)
    .to_vec();
    let mut painter = Painter::default();
    assert_eq!(painter.draw(0, &key("xtb/lab/xtb-1/about"), &about.into()), None);
    let car = draw(&mut painter, 0, &driving()).entities.remove(0);
    // The pose is that of the rear axle.
    let (middle, size) = (&car.cubes[0].pose.position, &car.cubes[0].size);
    assert!(
        (middle.x - 0.15).abs() < 1e-9 && middle.y.abs() < 1e-9 && (size.x - 0.4).abs() < 1e-9,
        "{car:?}"
    );
    let mut sensors = xtb_client::fake::sensors("xtb-1");
    sensors.ir_front_cm[0] = Some(30.0);
    sensors.ir_front_cm[1] = Some(30.0); // more than the factsheet names
    let seen = painter.draw(MS, &key("xtb/lab/xtb-1/sensors"), &sensors.into()).unwrap();
    let points = &seen.entities[0].lines[0].points;
    assert_eq!(points.len(), 2, "one stroke");
    let ahead_m = 0.35 - 0.1 + 0.3;
    assert!(points.iter().all(|point| (point.x - ahead_m).abs() < 1e-9), "{points:?}");
    assert!((points[0].y + points[1].y - 2.0 * 0.05).abs() < 1e-9, "{points:?}");
}

#[test]
fn who_has_gone_is_taken_away() {
    let mut painter = Painter::default();
    draw(&mut painter, 0, &driving());
    let gone = painter.draw(MS, &key("xtb/lab/xtb-1/alive"), &AnyMessage::Alive(false)).unwrap();
    let ids: Vec<&str> = gone.deletions.iter().map(|deletion| deletion.id.as_str()).collect();
    assert_eq!(ids, ["xtb-1 truck", "xtb-1 way", "xtb-1 sight"]);
}

fn map(width: u32, height: u32, cells: &[(MapCell, u32)]) -> FleetMap {
    let (name, hash, cells) = ("m".into(), MapHash::new(0), cells.to_vec());
    FleetMap { name, hash, resolution_m: 0.5, origin_m: [-1.0, 1.0], width, height, cells, zones: Vec::new() }
}

#[test]
fn walls_are_few_boxes_where_the_occupied_cells_are() {
    use MapCell::{Free, Occupied};
    // A room of 4 × 4: the bottom row runs over into the left wall.
    let cells = [(Occupied, 5), (Free, 2), (Occupied, 2), (Free, 2), (Occupied, 5)];
    let (blocks, left_out) = walls::blocks(&map(4, 4, &cells));
    let mut found: Vec<_> = blocks.iter().map(|block| (block.columns, block.rows)).collect();
    found.sort_unstable();
    assert_eq!(found, [((0, 1), (1, 3)), ((0, 4), (0, 1)), ((0, 4), (3, 4)), ((3, 4), (1, 3))]);
    assert_eq!(left_out, 0);
    let update = Painter::default().draw(0, &key("xtb/lab/map"), &map(4, 4, &cells).into()).unwrap();
    let first = &update.entities[0].cubes[0];
    assert_eq!((first.pose.position.x, first.pose.position.y, first.size.x), (0.0, 1.25, 2.0));
    assert_eq!(update.entities[0].lifetime.sec, 0);
}

#[test]
fn a_map_of_noise_is_bounded_and_says_so() {
    let cells: Vec<_> =
        (0..90_000).map(|n| (if n % 2 == 0 { MapCell::Occupied } else { MapCell::Free }, 1)).collect();
    let (blocks, left_out) = walls::blocks(&map(301, 299, &cells));
    assert!(blocks.len() == 20_000 && left_out > 20_000, "{} {left_out}", blocks.len());
}
