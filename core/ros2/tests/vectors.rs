//! Bytes that other implementations wrote (`data/README.md`): read, and written again bit for bit.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Debug;
use xtb_ros2::cdr::{Cdr, from_bytes, to_bytes};
use xtb_ros2::types::*;

/// The vectors that have not been asked for yet.
struct Vectors {
    all: Value,
    left: BTreeSet<String>,
}

impl Vectors {
    fn load() -> Self {
        let all: Value = serde_json::from_str(include_str!("data/cdr-vectors.json")).unwrap();
        let left = all.as_object().unwrap().keys().cloned().collect();
        Self { all, left }
    }

    fn bytes(&mut self, name: &str) -> Vec<u8> {
        assert!(self.left.remove(name), "{name}");
        let hex = self.all[name]["cdr_hex"].as_str().unwrap();
        let digits = hex.as_bytes().chunks(2);
        digits.map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
    }

    /// The vector of a message is this one.
    fn message<M: Message + PartialEq + Debug>(&mut self, message: &M) {
        let bytes = self.bytes(M::TYPE.name);
        assert_eq!(from_bytes::<M>(&bytes).as_ref(), Ok(message), "{}", M::TYPE.name);
        assert_eq!(to_bytes(message), bytes, "{}", M::TYPE.name);
    }

    /// The same of what has bytes at these places that nobody wrote: padding.
    fn padded<T: Cdr + PartialEq + Debug>(&mut self, name: &str, padding: &[usize], expected: &T) {
        let mut bytes = self.bytes(name);
        assert_eq!(from_bytes::<T>(&bytes).as_ref(), Ok(expected), "{name}");
        padding.iter().for_each(|at| bytes[*at] = 0);
        let mut ours = to_bytes(expected);
        ours.resize(bytes.len(), 0); // genuine serializers pad the end, too
        assert_eq!(ours, bytes, "{name}");
    }
}

const UUID: GoalId = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

fn stamp() -> Time {
    Time { sec: 7, nanosec: 5 }
}

fn header(frame: &str) -> Header {
    Header { stamp: stamp(), frame_id: frame.into() }
}

fn pose() -> Pose {
    Pose {
        position: Point { x: 1.5, y: -2.25, z: 0.0 },
        orientation: Quaternion { x: 0.0, y: 0.0, z: 0.5, w: 0.866_025_403_784_438_6 },
    }
}

fn twist() -> Twist {
    Twist {
        linear: Vector3 { x: 0.15, ..Vector3::default() },
        angular: Vector3 { z: -0.1, ..Vector3::default() },
    }
}

fn covariance() -> [[f64; 6]; 6] {
    let mut covariance = [[0.0; 6]; 6];
    (covariance[0][0], covariance[5][5]) = (0.01, 0.02);
    covariance
}

fn pose_with_covariance() -> PoseWithCovariance {
    PoseWithCovariance { pose: pose(), covariance: covariance() }
}

fn goal() -> GoalInfo {
    GoalInfo { goal_id: UUID, stamp: stamp() }
}

#[test]
fn every_vector_is_read_and_written_bit_for_bit() {
    let mut vectors = Vectors::load();
    vectors.message(&twist());
    vectors.message(&TwistStamped { header: header("xtb_1/base_link"), twist: twist() });
    vectors.message(&PoseStamped { header: header("map"), pose: pose() });
    vectors.message(&PoseWithCovarianceStamped { header: header("map"), pose: pose_with_covariance() });
    vectors.message(&Odometry {
        header: header("xtb_1/odom"),
        child_frame_id: "xtb_1/base_link".into(),
        pose: pose_with_covariance(),
        twist: TwistWithCovariance { twist: twist(), covariance: covariance() },
    });
    vectors.message(&OccupancyGrid {
        header: header("map"),
        info: MapMetaData { map_load_time: stamp(), resolution: 0.05, width: 3, height: 2, origin: pose() },
        data: vec![0, 100, -1, 0, 0, 100],
    });
    let poses = vec![PoseStamped { header: header("map"), pose: pose() }];
    vectors.message(&Path { header: header("map"), poses });
    vectors.message(&TfMessage {
        transforms: vec![TransformStamped {
            header: header("map"),
            child_frame_id: "xtb_1/odom".into(),
            transform: Transform {
                translation: Vector3 { x: 1.0, y: 2.0, z: 0.0 },
                rotation: Quaternion { w: 1.0, ..Quaternion::default() },
            },
        }],
    });
    vectors.message(&Clock { clock: stamp() });
    vectors.message(&Text { data: "hé".into() });
    let status_list = vec![GoalStatusEntry { goal_info: goal(), status: Status::Executing as i8 }];
    vectors.message(&GoalStatusArray { status_list });
    sensors(&mut vectors);
    vectors.padded("std_srvs/srv/Trigger_Request", &[5, 6, 7], &EmptyRequest::default());
    vectors.padded("std_srvs/srv/Trigger_Response", &[5, 6, 7], &Verdict::done("ok"));
    vectors.padded("action_msgs/srv/CancelGoal_Request", &[], &CancelGoalRequest { goal_info: goal() });
    let response = CancelGoalResponse { return_code: CancelCode::None as i8, goals_canceling: vec![goal()] };
    vectors.padded("action_msgs/srv/CancelGoal_Response", &[5, 6, 7], &response);
    assert_eq!(vectors.left, BTreeSet::new(), "not compared");
}

fn sensors(vectors: &mut Vectors) {
    vectors.message(&Range {
        header: header("xtb_1/ir_front_0"),
        radiation_type: 1,
        field_of_view: 0.1,
        min_range: 0.1,
        max_range: 0.8,
        range: f32::INFINITY,
        variance: 0.0,
    });
    vectors.message(&LaserScan {
        header: header("xtb_1/base_link"),
        angle_min: -1.0,
        angle_max: 1.0,
        angle_increment: 0.4,
        time_increment: 0.0,
        scan_time: 0.05,
        range_min: 0.1,
        range_max: 0.8,
        ranges: vec![0.3, f32::INFINITY],
        intensities: Vec::new(),
    });
    vectors.message(&Imu {
        header: header("xtb_1/base_link"),
        orientation: Quaternion { w: 1.0, ..Quaternion::default() },
        angular_velocity: Vector3 { z: 0.1, ..Vector3::default() },
        linear_acceleration: Vector3 { z: 9.81, ..Vector3::default() },
        linear_acceleration_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        ..Imu::default()
    });
    vectors.message(&BatteryState {
        header: header(""),
        voltage: 8.1,
        temperature: 1.0,
        current: 2.0,
        charge: 3.0,
        capacity: 4.0,
        design_capacity: 5.0,
        percentage: 0.5,
        power_supply_status: 2,
        power_supply_health: 1,
        power_supply_technology: 0,
        present: true,
        cell_voltage: vec![4.0, 4.1],
        cell_temperature: Vec::new(),
        location: "bay".into(),
        serial_number: "sn".into(),
    });
    vectors.message(&DiagnosticArray {
        header: header(""),
        status: vec![DiagnosticStatus {
            level: Level::Error as u8,
            name: "xtb_1: drive".into(),
            message: "board_lost".into(),
            hardware_id: "xtb-1".into(),
            values: vec![KeyValue { key: "mode".into(), value: "idle".into() }],
        }],
    });
}
