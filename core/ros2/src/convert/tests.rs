//! A robot's state in the words of ROS, and poses of ROS in ours.

use super::*;
use crate::cdr::to_bytes;
use crate::types::{Header, Level, Message, Point, Pose, Quaternion, Time};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use xtb_control::frames::MapPose;
use xtb_control::vehicle::RangeFinder;
use xtb_control::{Mode, VehicleConfig};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Arc, BatteryLevel, Fault, FaultState, FleetMap, InputAges, Latch, LatchState, MapCell, MapHash, NavPhase,
    NavState, ObstacleView, PoseSource, PoseState, Rejected, RobotState, RouteSource, RouteState, StopReason,
    TiltState, Track,
};
use xtb_robot::motion::Motion;

fn name() -> Name {
    Name::new("xtb-1").unwrap()
}

fn robot() -> Robot {
    Robot::new(&name(), &VehicleConfig::default())
}

fn stamp() -> Time {
    Time { sec: 7, nanosec: 5 }
}

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> PoseState {
    PoseState {
        x_m,
        y_m,
        yaw_rad,
        source: PoseSource::Odometry,
        age_ms: Some(0),
        sigma_m: 0.1,
        sigma_yaw_rad: 0.02,
        fix_age_ms: None,
        odometry_scale: None,
        odometry_scale_sigma: None,
        fix_delay_ms: None,
    }
}

fn state() -> RobotState {
    RobotState {
        robot: name(),
        epoch: 1,
        seq: 1,
        tick_ms: 1,
        mode: Mode::Idle,
        lease: None,
        pose: pose(1.0, 2.0, 0.0),
        speed_mps: Some(0.0),
        reference_rpm: 0.0,
        steering: 0.0,
        obstacle: ObstacleView { front: None, rear: None },
        tilt_deg: TiltState::default(),
        battery_v: Some(7.5),
        battery_level: BatteryLevel::Ok,
        goal: None,
        ended_goals: Vec::new(),
        faults: Vec::new(),
        latches: Vec::new(),
        nav: NavState::default(),
        stopped_because: vec![StopReason::NoCommand],
        stopped_age_ms: Some(0),
        input_age_ms: InputAges::default(),
        turn_late_us: 0,
        turns_late: 0,
        rejected: Rejected::default(),
    }
}

fn motion(x_m: f64, y_m: f64, yaw_rad: f64) -> Motion {
    Motion { pose: MapPose { x_m, y_m, yaw_rad }, speed_mps: Some(0.15), yaw_rate_radps: Some(-0.1) }
}

fn near(a: &MapPose, b: &MapPose) -> bool {
    let turn = xtb_control::frames::wrap_rad(a.yaw_rad - b.yaw_rad);
    (a.x_m - b.x_m).abs() < 1e-9 && (a.y_m - b.y_m).abs() < 1e-9 && turn.abs() < 1e-9
}

#[test]
fn an_odometry_says_speed_in_the_robots_own_frame() {
    let odometry = robot().odometry(&stamp(), &motion(1.0, 2.0, FRAC_PI_2), &pose(0.0, 0.0, 0.0));
    assert_eq!(
        (odometry.header.frame_id.as_str(), odometry.child_frame_id.as_str()),
        ("xtb_1/odom", "xtb_1/base_link")
    );
    assert_eq!((odometry.twist.twist.linear.x, odometry.twist.twist.linear.y), (0.15, 0.0));
    assert_eq!(odometry.twist.twist.angular.z, -0.1);
    assert!((odometry.pose.covariance[0][0] - 0.01).abs() < 1e-12 && odometry.pose.covariance[5][5] < 0.001);
    let silent = Motion { speed_mps: None, yaw_rate_radps: None, ..motion(0.0, 0.0, 0.0) };
    let odometry = robot().odometry(&stamp(), &silent, &pose(0.0, 0.0, 0.0));
    assert_eq!((odometry.twist.covariance[0][0], odometry.twist.covariance[5][5]), (1e6, 1e6));
    assert_eq!(robot().imu(&stamp(), &silent), None);
    let imu = robot().imu(&stamp(), &motion(0.0, 0.0, 0.0)).unwrap();
    assert_eq!((imu.angular_velocity.z, imu.linear_acceleration_covariance[0]), (-0.1, -1.0));
}

proptest! {
    #[test]
    fn both_transforms_together_are_the_pose_in_the_map(
        map in (-100.0..100.0_f64, -100.0..100.0_f64, -3.0..3.0_f64),
        odom in (-100.0..100.0_f64, -100.0..100.0_f64, -3.0..3.0_f64),
    ) {
        let motion = motion(odom.0, odom.1, odom.2);
        let tf = robot().transforms(&stamp(), &motion, &pose(map.0, map.1, map.2));
        let of = |i: usize| {
            let it = &tf.transforms[i].transform;
            MapPose { x_m: it.translation.x, y_m: it.translation.y, yaw_rad: yaw_of(&it.rotation).unwrap() }
        };
        let (first, second) = (of(0), of(1));
        let (sin, cos) = first.yaw_rad.sin_cos();
        let chained = MapPose {
            x_m: first.x_m + second.x_m * cos - second.y_m * sin,
            y_m: first.y_m + second.x_m * sin + second.y_m * cos,
            yaw_rad: first.yaw_rad + second.yaw_rad,
        };
        prop_assert!(near(&chained, &MapPose { x_m: map.0, y_m: map.1, yaw_rad: map.2 }), "{:?}", chained);
    }

    #[test]
    fn a_pose_goes_to_ros_and_back(x_m in -1000.0..1000.0_f64, y_m in -1000.0..1000.0_f64, yaw_rad in -3.1..3.1_f64) {
        let sent = MapPose { x_m, y_m, yaw_rad };
        let header = Header { stamp: stamp(), frame_id: "map".into() };
        prop_assert!(near(&map_pose(&header, &planar_pose(&sent)).unwrap(), &sent));
    }

    #[test]
    fn no_pose_panics(x: f64, y: f64, z: f64, w: f64) {
        let header = Header { stamp: stamp(), frame_id: "map".into() };
        let pose = Pose { position: Point { x, y, z }, orientation: Quaternion { x, y, z, w } };
        let _ = map_pose(&header, &pose);
        prop_assert!(!yaw_of(&pose.orientation).is_ok_and(|yaw_rad| !yaw_rad.is_finite()));
    }
}

#[test]
fn a_pose_that_no_car_can_take_says_why() {
    let header = |frame: &str| Header { stamp: stamp(), frame_id: frame.to_owned() };
    let upright = planar_pose(&MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.3 });
    assert!(map_pose(&header("/map"), &upright).is_ok());
    let said = map_pose(&header("xtb_1/odom"), &upright).unwrap_err().to_string();
    assert_eq!(said, "the pose is in the frame \"xtb_1/odom\"; send it in \"map\"");
    let far = Pose { position: Point { x: 1e9, y: 0.0, z: 0.0 }, ..upright.clone() };
    assert!(matches!(map_pose(&header("map"), &far), Err(PoseError::Place { .. })));
    assert!(matches!(map_pose(&header("map"), &Pose::default()), Err(PoseError::Quaternion(_))));
    let nan = Pose { position: Point { x: f64::NAN, y: 0.0, z: 0.0 }, ..upright };
    assert!(map_pose(&header("map"), &nan).is_err());
    let lies = Quaternion { x: FRAC_PI_2.sin() / 2.0_f64.sqrt(), y: 0.0, z: 0.0, w: 0.5_f64.sqrt() };
    assert!(matches!(yaw_of(&lies), Err(PoseError::Tilt(_))));
}

#[test]
fn nothing_in_range_is_infinite_and_too_near_is_minus_infinite() {
    let front = [None, Some(9.74), Some(10.0), Some(25.0), Some(80.0), Some(95.0)];
    let [front, rear] = robot().ranges(&stamp(), &front, &[None; 6]);
    let values: Vec<f32> = front.iter().map(|range| range.range).collect();
    assert_eq!(values, [f32::INFINITY, f32::NEG_INFINITY, 0.1, 0.25, 0.8, f32::INFINITY]);
    assert!(rear.iter().all(|range| range.range == f32::INFINITY));
    assert_eq!((rear.len(), rear[0].header.frame_id.as_str()), (6, "xtb_1/ir_rear_0"));
}

#[test]
fn each_range_finder_that_is_fitted_has_its_own_frame_however_many_the_other_bumper_has() {
    let mut robot = robot();
    robot.vehicle.range_finders.front.0.resize(8, RangeFinder::at(0.0));
    robot.vehicle.range_finders.rear.0.truncate(1);
    let [front, rear] = robot.ranges(&stamp(), &[Some(40.0); 8], &[Some(50.0)]);
    let frames: Vec<&str> = front.iter().chain(&rear).map(|it| it.header.frame_id.as_str()).collect();
    assert_eq!(
        (frames[0], frames[7], frames[8]),
        ("xtb_1/ir_front_0", "xtb_1/ir_front_7", "xtb_1/ir_rear_0")
    );
    assert_eq!((frames.len(), rear[0].range), (9, 0.5));
    let fixed = robot.static_transforms(&stamp()).transforms;
    let fixed: Vec<&str> = fixed[1..].iter().map(|it| it.child_frame_id.as_str()).collect();
    assert_eq!(fixed, frames);
}

#[test]
fn the_sensors_sit_on_the_bumpers_left_to_right() {
    let tf = robot().static_transforms(&stamp());
    let of = |frame: &str| {
        let found = tf.transforms.iter().find(|it| it.child_frame_id == frame).unwrap();
        (found.transform.translation.clone(), yaw_of(&found.transform.rotation).unwrap())
    };
    let (front, yaw_rad) = of("xtb_1/ir_front_0");
    assert_eq!((front.x, front.y, yaw_rad), (0.25, 0.175_000_000_000_000_02, 0.0));
    let (rear, yaw_rad) = of("xtb_1/ir_rear_5");
    assert!(rear.x == -0.25 && rear.y < -0.17 && (yaw_rad.abs() - PI).abs() < 1e-9);
    assert_eq!(tf.transforms.len(), 13);
    assert!(tf.transforms.iter().all(|it| it.header.frame_id == "xtb_1/base_link"));
}

#[test]
fn the_description_has_a_link_for_each_frame() {
    let (text, robot) = (robot().description(), robot());
    for frame in [&robot.frames.base_link, &robot.frames.imu]
        .into_iter()
        .chain(robot.frames.ranges.iter().flat_map(|side| &side[..6]))
    {
        assert_eq!(text.matches(&format!("<link name=\"{frame}\"")).count(), 1, "{text}");
    }
    assert_eq!((text.matches("<joint ").count(), text.matches("<cylinder ").count()), (13, 4));
    assert!(text.starts_with("<?xml") && text.trim_end().ends_with("</robot>"));
}

#[test]
fn a_battery_says_only_what_is_measured() {
    let battery_of = |battery_v| battery(&stamp(), &RobotState { battery_v, ..state() });
    assert_eq!((battery_of(Some(7.5)).voltage, battery_of(Some(7.5)).power_supply_status), (7.5, 2));
    assert!(battery_of(None).voltage.is_nan() && battery_of(Some(7.5)).percentage.is_nan());
}

#[test]
fn diagnostics_name_what_is_wrong_and_what_to_do() {
    let mut state = state();
    assert_eq!(level(&state), Level::Ok);
    let fine = diagnostics(&stamp(), &state, &[("ros node", "/teleop_Twist".into())]);
    assert_eq!((fine.status.len(), fine.status[0].message.as_str()), (1, "stopped: no command"));
    assert!(fine.status[0].values.iter().any(|it| it.key == "ros node" && it.value == "/teleop_Twist"));
    state.faults =
        vec![FaultState { fault: Fault::RecordingFailed, age_ms: 0, detail: Some("disk full".into()) }];
    assert_eq!(level(&state), Level::Warn);
    state.latches = vec![LatchState { latch: Latch::Estop, age_ms: 0, by: "alice".into(), present: false }];
    let bad = diagnostics(&stamp(), &state, &[]);
    let parts: Vec<_> = bad.status.iter().map(|it| (it.level, it.name.as_str())).collect();
    assert_eq!(parts, [(2, "xtb_1: robot"), (1, "xtb_1: recording_failed"), (2, "xtb_1: latch estop")]);
    let remedies = bad.status.iter().skip(1).all(|it| it.values.iter().any(|value| value.key == "remedy"));
    assert!(remedies && bad.status[2].values[0].value.contains("fleet-cli reset xtb-1"), "{bad:?}");
}

#[test]
fn a_plan_is_the_routes_track_from_end_to_end() {
    assert!(plan(&stamp(), &state()).poses.is_empty());
    let arcs =
        vec![Arc { length_m: 1.0, curvature_per_m: 0.0 }, Arc { length_m: -FRAC_PI_2, curvature_per_m: 1.0 }];
    let track = Track { start: MapPose { x_m: 1.0, y_m: 2.0, yaw_rad: 0.0 }, arcs };
    let mut state = state();
    state.nav.route = Some(RouteState {
        source: RouteSource::Own,
        plan: 0,
        phase: NavPhase::Following,
        track: Some(track),
        done_m: 0.0,
        release_m: 0.0,
        off_m: 0.0,
        waits_for: None,
        blocked_at_m: None,
        plans: 1,
    });
    let path = plan(&stamp(), &state);
    let header = Header { stamp: stamp(), frame_id: "map".into() };
    let at = |i: usize| map_pose(&header, &path.poses[i].pose).unwrap();
    assert!(near(&at(0), &MapPose { x_m: 1.0, y_m: 2.0, yaw_rad: 0.0 }));
    let end = MapPose { x_m: 1.0, y_m: 3.0, yaw_rad: -FRAC_PI_2 };
    assert!(near(&at(path.poses.len() - 1), &end), "{:?}", path.poses.last());
    assert_eq!(path.poses.len(), 53);
    let far = Arc { length_m: 1000.0, curvature_per_m: 0.0 };
    let track = state.nav.route.as_mut().and_then(|route| route.track.as_mut()).unwrap();
    track.arcs = vec![far; Track::MOST_ARCS];
    assert_eq!(plan(&stamp(), &state).poses.len(), 2000, "bounded");
}

#[test]
fn a_map_keeps_its_rows() {
    use MapCell::{Free, Occupied, Unknown};
    let map = FleetMap {
        name: "lab".into(),
        hash: MapHash::new(0),
        resolution_m: 0.05,
        origin_m: [-1.0, 2.0],
        width: 3,
        height: 2,
        cells: vec![(Free, 1), (Occupied, 1), (Unknown, 1), (Free, 2), (Occupied, 1)],
        zones: Vec::new(),
    };
    let grid = occupancy_grid(&stamp(), &map);
    assert_eq!(grid.data, [0, 100, -1, 0, 0, 100]);
    assert_eq!((grid.info.width, grid.info.height, grid.info.origin.position.x), (3, 2, -1.0));
    assert_eq!(to_bytes(&grid).len(), 110, "as the vector of {}", crate::types::OccupancyGrid::TYPE.name);
    let cells = vec![(Occupied, u32::MAX); 3];
    assert_eq!(occupancy_grid(&stamp(), &FleetMap { cells, ..map.clone() }).data, [100; 6], "not validated");
    assert_eq!(occupancy_grid(&stamp(), &FleetMap { cells: Vec::new(), ..map }).data, [-1; 6]);
}
