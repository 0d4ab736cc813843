//! Wheels that are not what the settings say: how fast the truck goes, and what its robot says of it.

use crate::draw::{Draw, in_parallel};
use crate::drive::Drive;
use std::f64::consts::PI;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{Fault, GoalStatus, Outcome};
use xtb_sim::{TruckParameters, World};

const ROOM: &str = "[room]\nwidth_m = 10.0\ndepth_m = 10.0\n";
/// After the scale is known, what is asked of the wheels follows it within this, in s.
const SETTLES_S: f64 = 4.0;

/// One truck that goes from goal to goal for some time.
#[derive(Debug, Clone, Default)]
pub(crate) struct WheelRun {
    /// When the scale was known, in s of driving; `None` = never.
    pub(crate) known_s: Option<f64>,
    /// Fastest before that, in m/s.
    pub(crate) before_mps: f64,
    /// How fast it really was from some seconds after that on, in m/s, each 0.1 s in which it drove a goal.
    pub(crate) after_mps: Vec<f64>,
    /// By how much the speed that it says of itself was off meanwhile, in m/s.
    pub(crate) said_off_mps: Vec<f64>,
    /// The scale that it says, at the end.
    pub(crate) scale: Option<f64>,
    /// The robot has said that its odometry's scale is wrong.
    pub(crate) fault: bool,
    /// A goal was refused for it.
    pub(crate) refused: bool,
    /// Goals that were reached.
    pub(crate) reached: u32,
}

/// The run of this seed, with this part of the pulses that the settings say, for so long.
pub(crate) fn run(seed: u64, pulses: f64, seconds: f64) -> WheelRun {
    let mut draw = Draw::new(seed);
    let mut truck = TruckParameters::default();
    truck.encoder.pulses_per_rev *= pulses;
    let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: draw.uniform(-PI, PI) };
    let mut drive = Drive::of(World::from_toml(ROOM).unwrap(), &[start], &truck, seed);
    let (mut made, mut driven_s) = (WheelRun::default(), 0.0);
    while driven_s < seconds && !made.refused {
        let (x_m, y_m) = (draw.uniform(-4.0, 4.0), draw.uniform(-4.0, 4.0));
        if let Outcome::Error(error) = drive.goto(0, x_m, y_m, None) {
            made.refused = error.message.contains("per metre of the encoder");
            driven_s += 1.0;
            continue;
        }
        loop {
            drive.run_s(0.1);
            driven_s += 0.1;
            let state = drive.lockstep.state(0).unwrap();
            let mps = drive.lockstep.simulation().trucks()[0].truth().speed_mps.abs();
            made.fault |= state.faults.iter().any(|fault| fault.fault == Fault::OdometryScale);
            made.scale = state.pose.odometry_scale;
            let known =
                made.scale.is_some() && state.pose.odometry_scale_sigma.is_some_and(|sigma| sigma <= 0.03);
            if known {
                made.known_s.get_or_insert(driven_s);
            }
            match made.known_s {
                None => made.before_mps = made.before_mps.max(mps),
                Some(at_s) if driven_s > at_s + SETTLES_S => {
                    made.after_mps.push(mps);
                    made.said_off_mps.extend(state.speed_mps.map(|said| (said.abs() - mps).abs()));
                }
                Some(_) => {}
            }
            let status = state.goal.as_ref().map(|goal| goal.status);
            if status.is_none_or(GoalStatus::is_final) {
                made.reached += u32::from(status == Some(GoalStatus::Reached));
                break;
            }
        }
    }
    made
}

/// Several.
pub(crate) fn runs(seeds: std::ops::Range<u64>, pulses: f64, seconds: f64) -> Vec<WheelRun> {
    in_parallel(seeds, |seed| run(seed, pulses, seconds))
}

/// It was 0.28 m/s where 0.20 was allowed, without a word.
#[test]
fn a_truck_whose_wheels_go_farther_than_the_settings_say_is_not_faster_for_long_and_says_so() {
    for made in runs(0..2, 0.75, 120.0) {
        assert!(made.fault && made.refused, "{:?} {:?}", made.scale, made.known_s);
        let fastest = made.after_mps.iter().copied().fold(0.0, f64::max);
        assert!(fastest <= 0.22, "{fastest} m/s");
    }
}

#[test]
fn a_scale_that_is_a_little_off_is_known_applied_and_no_fault() {
    for made in runs(0..2, 0.9, 60.0) {
        assert!(!made.fault && made.reached > 0, "{:?}", made.scale);
        assert!(made.scale.is_some_and(|scale| (scale - 1.0 / 0.9).abs() < 0.03), "{:?}", made.scale);
        let fastest = made.after_mps.iter().copied().fold(0.0, f64::max);
        assert!(fastest <= 0.22, "{fastest} m/s");
    }
}
