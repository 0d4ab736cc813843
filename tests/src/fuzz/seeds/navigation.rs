//! The corpus of the second level's doors: fixes, routes, states, maps.

use super::{ID, message, text};
use crate::fuzz::Seed;
use crate::fuzz::maps::IMAGE;
use xtb_control::frames::MapPose;
use xtb_control::{Stamp, VehicleConfig};
use xtb_nav::map::ros::Files;
use xtb_nav::{Cell, Grid, Map, Zone, ZoneKind};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Arc, Fix, FixSource, FleetMap, GoalKind, GoalState, GoalStatus, LinkLoss, MapState, NavPhase, NavState,
    NearRole, NearState, NearWay, Rejected, RobotState, Route, RouteGoal, RouteSource, RouteState, Track,
    TrafficState, Via,
};
use xtb_robot::agent::RobotIdentity;
use xtb_robot::robot::Robot;

const HERE: MapPose = MapPose { x_m: 1.0, y_m: -1.0, yaw_rad: 0.5 };

fn name(text: &str) -> Name {
    Name::robot(text).unwrap_or_else(|error| panic!("{error}"))
}

fn track() -> Track {
    let arcs = [(0.5, 2.0), (-0.25, 0.0), (1.5, -1.25)];
    let arcs = arcs.map(|(length_m, curvature_per_m)| Arc { length_m, curvature_per_m });
    Track { start: HERE, arcs: arcs.to_vec() }
}

pub(crate) fn fix() -> Vec<Seed> {
    let full = Fix {
        x_m: 1.5,
        y_m: -2.0,
        yaw_rad: Some(0.5),
        sigma_m: 0.05,
        sigma_yaw_rad: 0.03,
        source: FixSource::MotionCapture,
        age_ms: 40,
    };
    let short = r#"{"x_m":1,"y_m":2,"sigma_m":0.05,"source":"uwb"}"#;
    let mut seeds = message("full", &full).to_vec();
    seeds.extend(message("no_yaw", &Fix { yaw_rad: None, source: FixSource::Tags, ..full }));
    seeds.push(text("short.json", short));
    seeds.push(text("exact.json", &short.replace("0.05", "0")));
    seeds
}

pub(crate) fn route() -> Vec<Seed> {
    let alive = Route {
        epoch: 300,
        seq: 1,
        goal: None,
        track: None,
        plan: 0,
        release_m: 0.0,
        cruise_mps: 0.2,
        waits_for: None,
        reason: None,
        others: Vec::new(),
    };
    let led = Route {
        goal: Some(RouteGoal { epoch: 7, id: ID }),
        track: Some(track()),
        plan: 3,
        release_m: 1.25,
        cruise_mps: 0.35,
        waits_for: Some(name("xtb-2")),
        others: vec![HERE; 3],
        ..alive.clone()
    };
    let stood = Route { track: None, reason: Some("blocked by xtb-2".to_owned()), ..led.clone() };
    let mut seeds = message("alive", &alive).to_vec();
    seeds.extend(message("led", &led));
    seeds.extend(message("stood", &stood));
    seeds
}

/// One that is parked, one that drives, and one that waits for another.
pub(crate) fn near() -> Vec<Seed> {
    let parked = NearState {
        robot: name("xtb-1"),
        x_m: HERE.x_m,
        y_m: HERE.y_m,
        yaw_rad: HERE.yaw_rad,
        speed_mps: 0.0,
        role: NearRole::Parked,
        way: None,
        waits_for: None,
    };
    let way = Some(NearWay { track: track(), done_m: 0.5, release_m: 1.25 });
    let going = NearState { speed_mps: 0.2, role: NearRole::Alone, way, ..parked.clone() };
    let waiting = NearState { speed_mps: 0.0, waits_for: Some(name("xtb-2")), ..going.clone() };
    let mut seeds = message("parked", &parked).to_vec();
    seeds.extend(message("going", &going));
    seeds.extend(message("waiting", &waiting));
    seeds
}

pub(crate) fn traffic() -> Vec<Seed> {
    let state = TrafficState {
        epoch: 300,
        seq: 7,
        map_hash: "00ff00ff00ff00ff".to_owned(),
        led: vec![name("xtb-1"), name("xtb-2")],
        obstacles: vec![name("xtb-3")],
        plans: 12,
    };
    message("two", &state).to_vec()
}

/// A robot that has just booted, and one that waits on its path.
pub(crate) fn robot_state() -> Vec<Seed> {
    let identity = RobotIdentity { fleet: name("lab"), robot: name("xtb-1"), epoch: 300, start_pose: HERE };
    let mut robot = Robot::new(identity, VehicleConfig::default(), "fuzz");
    let booted = robot.state(Stamp::from_ns(1_000_000_000), Rejected::default());
    let goal = GoalState {
        id: ID,
        kind: GoalKind::Goto,
        x_m: Some(3.0),
        y_m: Some(4.0),
        yaw_rad: None,
        via: Some(Via::Planned),
        status: GoalStatus::Blocked,
        distance_m: Some(6.0),
        age_ms: 400,
        reason: Some("waiting for xtb-2".to_owned()),
        by: name("cli-7"),
        on_link_loss: LinkLoss::Finish,
    };
    let route = RouteState {
        source: RouteSource::Traffic,
        plan: 3,
        phase: NavPhase::Waiting,
        track: Some(track()),
        done_m: 0.5,
        release_m: 1.0,
        off_m: 0.01,
        waits_for: Some(name("xtb-2")),
        blocked_at_m: Some((1.5, -0.5)),
        plans: 2,
    };
    let map = MapState { name: "lab".to_owned(), hash: "00ff00ff00ff00ff".to_owned(), fleet_hash: None };
    let nav = NavState { map: Some(map), traffic: true, route: Some(route), fixes: 40 };
    let waiting = RobotState { goal: Some(goal), nav, battery_v: Some(7.2), ..booted.clone() };
    let mut seeds = message("booted", &booted).to_vec();
    seeds.extend(message("waiting", &waiting));
    seeds
}

/// Six by four cells, a zone of each kind.
fn map() -> Map {
    let mut cells = vec![Cell::Free; 24];
    cells[..6].fill(Cell::Occupied);
    cells[17] = Cell::Unknown;
    let zone = |name, kind, points: &[[f64; 2]]| {
        Zone::new(name, kind, points.to_vec()).unwrap_or_else(|error| panic!("{error}"))
    };
    let zones = vec![
        zone("chargers", ZoneKind::KeepOut, &[[-0.1, -0.1], [0.1, -0.1], [0.0, 0.05]]),
        zone(
            "lane",
            ZoneKind::OneWay { heading_rad: 1.5 },
            &[[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]],
        ),
    ];
    let grid = Grid::new(0.05, [-0.15, -0.1], 6, 4, cells).unwrap_or_else(|error| panic!("{error}"));
    Map::new("lab", grid, zones).unwrap_or_else(|error| panic!("{error}"))
}

pub(crate) fn fleet_map() -> Vec<Seed> {
    let full = FleetMap::from(&map());
    let bare = FleetMap { zones: Vec::new(), name: "bare".to_owned(), ..full.clone() };
    let mut seeds = message("full", &full).to_vec();
    seeds.extend(message("other_hash", &bare));
    seeds
}

/// As they are written, as ROS writes them, and what is refused.
pub(crate) fn ros_map() -> Vec<Seed> {
    let files = Files::of(&map(), "lab.pgm").unwrap_or_else(|error| panic!("{error}"));
    let both =
        |name: &str, yaml: &str, image: &[u8]| (name.to_owned(), [yaml.as_bytes(), IMAGE, image].concat());
    let plain = b"P2\n# by hand\n3 2\n255\n254 205 0\n0 100 89\n";
    let ros = "image: lab.pgm\nresolution: 0.05\norigin: [-1.5, -2, 0]\nnegate: 0\noccupied_thresh: 0.65\n\
               free_thresh: 0.196\n";
    vec![
        both("ours", &files.yaml, &files.image),
        both("ros", ros, &files.image),
        both("plain", ros, plain),
        both("negated", &ros.replace("negate: 0", "negate: true"), b"P5 2 1 65535\n\xff\xf0\x00\x10"),
        both("scale", &format!("{ros}mode: scale\n"), plain),
        both("turned", &ros.replace("-2, 0]", "-2, 0.5]"), plain),
        both("too_large", ros, b"P5 5000 5000 255\n\x00"),
        both("crossing", &files.yaml.replace("0.05]", "-0.2]"), &files.image),
        text("no_image", ros),
    ]
}
