//! A robot's state and samples as messages: odometry, frames, sensors, battery, path.

use super::frames::{Frames, transform};
use super::pose::{MAP, in_map, planar_pose, stamped};
use crate::types::{
    BatteryState, Header, Imu, Odometry, Path, PoseWithCovariance, Quaternion, Range, TfMessage, Time, Twist,
    TwistWithCovariance, Vector3,
};
use xtb_control::VehicleConfig;
use xtb_control::frames::{MapPose, wrap_rad};
use xtb_control::range_curve::RangeCurve;
use xtb_control::vehicle::RangeFinder;
use xtb_protocol::Name;
use xtb_protocol::messages::{PoseState, RobotState};
use xtb_robot::motion::Motion;

/// What stands in a covariance for what nothing measures; ROS's own drivers do so.
const NOT_MEASURED: f64 = 1e6;
/// Of the speed, in (m/s)²: a pulse of the encoder in a window (assumed).
const SPEED_VARIANCE: f64 = 1e-4;
/// Of the yaw rate, in (rad/s)²: half a degree in a second (assumed).
const YAW_RATE_VARIANCE: f64 = 1e-4;
/// A beam's width is given at this distance, in m.
const BEAM_AT_M: f64 = 0.8;
const INFRARED: u8 = 1;
const DISCHARGING: u8 = 2;
/// Poses of a path are this far apart, in m.
const PLAN_STEP_M: f64 = 0.05;
/// Most poses of a path; a longer one has them farther apart.
const PLAN_MOST: f64 = 2000.0;

/// What of a robot never changes.
#[derive(Debug, Clone)]
pub struct Robot {
    /// Its frames.
    pub frames: Frames,
    /// Its settings.
    pub vehicle: VehicleConfig,
}

impl Robot {
    /// A robot of this name and with these settings.
    #[must_use]
    pub fn new(name: &Name, vehicle: &VehicleConfig) -> Self {
        Self { frames: Frames::new(name), vehicle: vehicle.clone() }
    }

    /// Where the odometry has it. How sure that is, is taken from the pose in the map: without fixes it is the
    /// same, with fixes the odometry is at least as sure over the time that they reach back.
    #[must_use]
    pub fn odometry(&self, stamp: &Time, motion: &Motion, pose: &PoseState) -> Odometry {
        let (place, yaw) = (pose.sigma_m * pose.sigma_m, pose.sigma_yaw_rad * pose.sigma_yaw_rad);
        let known = |value: Option<f64>, variance| value.map_or(NOT_MEASURED, |_| variance);
        let (speed, rate) = (motion.speed_mps, motion.yaw_rate_radps);
        Odometry {
            header: header(stamp, &self.frames.odom),
            child_frame_id: self.frames.base_link.clone(),
            pose: PoseWithCovariance {
                pose: planar_pose(&motion.pose),
                covariance: diagonal([place, place, NOT_MEASURED, NOT_MEASURED, NOT_MEASURED, yaw]),
            },
            twist: TwistWithCovariance {
                twist: Twist {
                    linear: Vector3 { x: speed.unwrap_or(0.0), ..Vector3::default() },
                    angular: Vector3 { z: rate.unwrap_or(0.0), ..Vector3::default() },
                },
                covariance: diagonal([
                    known(speed, SPEED_VARIANCE),
                    // A car does not slide sideways.
                    SPEED_VARIANCE,
                    NOT_MEASURED,
                    NOT_MEASURED,
                    NOT_MEASURED,
                    known(rate, YAW_RATE_VARIANCE),
                ]),
            },
        }
    }

    /// `map` → odometry → robot. `pose` and `motion` have to be of the same moment.
    #[must_use]
    pub fn transforms(&self, stamp: &Time, motion: &Motion, pose: &PoseState) -> TfMessage {
        let map = planar_pose(&map_from_odom(pose, &motion.pose));
        let Frames { odom, base_link, .. } = &self.frames;
        let moved = planar_pose(&motion.pose);
        TfMessage {
            transforms: vec![transform(stamp, MAP, odom, &map), transform(stamp, odom, base_link, &moved)],
        }
    }

    /// The sensors' frames.
    #[must_use]
    pub fn static_transforms(&self, stamp: &Time) -> TfMessage {
        self.frames.static_transforms(stamp, &self.vehicle)
    }

    /// The gyro: how fast it turns about the vertical, nothing else. `None` = not measured.
    #[must_use]
    pub fn imu(&self, stamp: &Time, motion: &Motion) -> Option<Imu> {
        let z = motion.yaw_rate_radps?;
        let none = [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        Some(Imu {
            header: header(stamp, &self.frames.imu),
            orientation: Quaternion { w: 1.0, ..Quaternion::default() },
            orientation_covariance: none,
            angular_velocity: Vector3 { z, ..Vector3::default() },
            angular_velocity_covariance: [
                NOT_MEASURED,
                0.0,
                0.0,
                0.0,
                NOT_MEASURED,
                0.0,
                0.0,
                0.0,
                YAW_RATE_VARIANCE,
            ],
            linear_acceleration: Vector3::default(),
            linear_acceleration_covariance: none,
        })
    }

    /// The range finders that are fitted, on the front and on the rear bumper, left to right, as the message `Sensors`
    /// has them in cm.
    #[must_use]
    pub fn ranges(&self, stamp: &Time, front_cm: &[Option<f64>], rear_cm: &[Option<f64>]) -> [Vec<Range>; 2] {
        let range = |((finder, frame), cm): ((&RangeFinder, &String), &Option<f64>)| {
            let limits_m = limits_m(finder.curve);
            Range {
                header: header(stamp, frame),
                radiation_type: INFRARED,
                field_of_view: (finder.beam_m / BEAM_AT_M) as f32,
                min_range: limits_m.0,
                max_range: limits_m.1,
                range: range_m(*cm, limits_m),
                variance: 0.0,
            }
        };
        let (fitted, [front, rear]) = (&self.vehicle.range_finders, &self.frames.ranges);
        [(&fitted.front, front, front_cm), (&fitted.rear, rear, rear_cm)]
            .map(|(fitted, frames, cm)| fitted.0.iter().zip(frames).zip(cm).map(range).collect())
    }
}

/// Nearest and farthest that a part measures by its data sheet, in m.
fn limits_m(curve: RangeCurve) -> (f32, f32) {
    match curve {
        RangeCurve::Gp2d12 | RangeCurve::Gp2y0a21 => (0.10, 0.80),
        RangeCurve::Gp2y0a02 => (0.20, 1.50),
    }
}

/// REP 117: nothing in range is +Inf, nearer than can be measured −Inf.
fn range_m(cm: Option<f64>, (least_m, most_m): (f32, f32)) -> f32 {
    match cm.map(|cm| (cm / 100.0) as f32) {
        Some(m) if m < least_m => f32::NEG_INFINITY,
        Some(m) if m <= most_m => m,
        _ => f32::INFINITY,
    }
}

/// The battery: its voltage is all that is measured.
#[must_use]
pub fn battery(stamp: &Time, state: &RobotState) -> BatteryState {
    BatteryState {
        header: header(stamp, ""),
        voltage: state.battery_v.map_or(f32::NAN, |volts| volts as f32),
        temperature: f32::NAN,
        current: f32::NAN,
        charge: f32::NAN,
        capacity: f32::NAN,
        design_capacity: f32::NAN,
        percentage: f32::NAN,
        power_supply_status: DISCHARGING,
        present: true,
        ..BatteryState::default()
    }
}

/// The path of the present goal; without one it is empty, which takes an old one off the screen.
#[must_use]
pub fn plan(stamp: &Time, state: &RobotState) -> Path {
    let track = state.nav.route.as_ref().and_then(|route| route.track.as_ref());
    let path = track.map(xtb_nav::Path::from);
    let poses = path.map_or_else(Vec::new, |path| {
        let length_m = path.length_m();
        let steps = (length_m / PLAN_STEP_M).ceil().clamp(1.0, PLAN_MOST - 1.0);
        (0..=steps as usize).map(|i| stamped(stamp, &path.at(length_m * i as f64 / steps).0)).collect()
    });
    Path { header: in_map(stamp), poses }
}

/// Where the odometry's frame is in the map, so that both have the robot at the same place.
fn map_from_odom(map: &PoseState, odom: &MapPose) -> MapPose {
    let yaw_rad = wrap_rad(map.yaw_rad - odom.yaw_rad);
    let (sin, cos) = libm::sincos(yaw_rad);
    MapPose {
        x_m: map.x_m - (odom.x_m * cos - odom.y_m * sin),
        y_m: map.y_m - (odom.x_m * sin + odom.y_m * cos),
        yaw_rad,
    }
}

fn header(stamp: &Time, frame: &str) -> Header {
    Header { stamp: stamp.clone(), frame_id: frame.to_owned() }
}

fn diagonal(variances: [f64; 6]) -> [[f64; 6]; 6] {
    let mut covariance = [[0.0; 6]; 6];
    for (i, (row, variance)) in covariance.iter_mut().zip(variances).enumerate() {
        if let Some(cell) = row.get_mut(i) {
            *cell = variance;
        }
    }
    covariance
}
