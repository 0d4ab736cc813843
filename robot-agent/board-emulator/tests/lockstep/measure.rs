//! Drives, levellings, walls and deaths with the firmware, and the same with the simulated board.

use crate::rig::{Rig, Trouble};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::Path;
use std::thread;
use xtb_control::VehicleConfig;
use xtb_protocol::messages::GoalStatus;

/// A goal takes no longer, in s.
const PATIENCE_S: f64 = 180.0;
/// What §4.8.3 calls level, on both axes.
const LEVEL_DEG: f64 = 0.8;
const SLOPE_DEG: f64 = 4.0;

/// The same with the firmware and with the simulated board: times in s, gaps in cm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pair {
    pub(crate) emulated: f64,
    pub(crate) simulated: f64,
}

/// What came of a drive from goal to goal with the firmware.
#[derive(Debug)]
pub(crate) struct Drives {
    pub(crate) times: Vec<Pair>,
    /// Frames of the board.
    pub(crate) frames: u64,
    pub(crate) trouble: Trouble,
    /// A second drive gave the same bits.
    pub(crate) same: bool,
}

/// Goals within 3 m, each in another direction: a sequence of low discrepancy, the same for every run.
fn goal(i: usize) -> (f64, f64) {
    let place = |step: f64| ((i as f64 + 1.0) * step).fract() * 6.0 - 3.0;
    (place(0.754_877_666), place(0.569_840_290))
}

fn drive(rig: &mut Rig, goals: usize) -> Vec<f64> {
    let times = (0..goals).map(|i| {
        let (x_m, y_m) = goal(i);
        let began_s = rig.now_s();
        rig.goto(x_m, y_m);
        while !rig.goal().is_final() && rig.now_s() < began_s + PATIENCE_S {
            rig.step();
        }
        assert_eq!(rig.goal(), GoalStatus::Reached, "goal {} at {x_m}, {y_m}", i + 1);
        rig.now_s() - began_s
    });
    times.collect()
}

/// So many goals one after the other; twice with the firmware, at the same time.
pub(crate) fn drives(firmware: &Path, goals: usize) -> Drives {
    let emulated = || {
        let mut rig = Rig::ready(Some(firmware), "", 1);
        let times = drive(&mut rig, goals);
        (times, rig.frames(), rig.bits())
    };
    let (first, second) = thread::scope(|scope| {
        let second = scope.spawn(emulated);
        (emulated(), second.join().unwrap())
    });
    let simulated = drive(&mut Rig::ready(None, "", 1), goals);
    let pair = |(&emulated, simulated)| Pair { emulated, simulated };
    let times = first.0.iter().zip(simulated).map(pair).collect();
    let (frames, trouble) = first.1;
    Drives { times, frames, trouble, same: first == second }
}

/// From the moment when the truck is put onto a slope until its platform is level and stays so.
fn levelling_s(firmware: Option<&Path>, seed: u64) -> f64 {
    let uphill_rad = FRAC_PI_2 + (seed % 8) as f64 / 8.0 * TAU;
    let world = format!(
        "[[ramps]]\nx_m = 9.0\ny_m = 0.0\nlength_m = 4.0\nwidth_m = 4.0\nslope_deg = {SLOPE_DEG:?}\n\
         uphill_rad = {uphill_rad:?}"
    );
    let mut rig = Rig::ready(firmware, &world, seed);
    rig.run_s(0.5 + 0.007 * seed as f64);
    let began_s = rig.now_s();
    rig.put(9.0, 0.0);
    let (mut level_since, mut tilted) = (None, false);
    for _ in 0..400 {
        rig.step();
        let (x_deg, y_deg) = rig.tilt_deg();
        if x_deg.abs() <= LEVEL_DEG && y_deg.abs() <= LEVEL_DEG {
            level_since.get_or_insert(rig.now_s());
        } else {
            (level_since, tilted) = (None, true);
        }
    }
    assert!(tilted, "it has not been tilted");
    level_since.unwrap() - began_s
}

/// The mean time of so many levellings, each on a slope in another direction.
pub(crate) fn levellings(firmware: &Path, count: u64) -> Pair {
    let mean_s = |firmware| (0..count).map(|seed| levelling_s(firmware, seed)).sum::<f64>() / count as f64;
    Pair { emulated: mean_s(Some(firmware)), simulated: mean_s(None) }
}

/// The gap that is left before a wall at which a truck has driven straight on, nearly as fast as is admitted, in cm.
fn gap_cm(firmware: Option<&Path>, seed: u64) -> f64 {
    let mut vehicle = VehicleConfig::default();
    vehicle.goto.reference_rpm = (vehicle.admitted_mps() / vehicle.mps_per_rpm()).floor();
    // Another moment of the scan each time.
    let wall_m = 1.8 + 0.0137 * seed as f64;
    let world = format!(
        "[[boxes]]\nname = \"wall\"\nx_m = 0.0\ny_m = {:?}\nwidth_m = 3.0\ndepth_m = 0.2",
        wall_m + 0.1
    );
    let mut rig = Rig::ready_with(firmware, &world, seed, &vehicle);
    rig.goto(0.0, 6.0);
    let mut fastest_mps = 0.0_f64;
    let truth = loop {
        rig.step();
        let truth = rig.truth();
        fastest_mps = fastest_mps.max(truth.speed_mps);
        if fastest_mps > 0.2 && truth.speed_mps.abs() < 0.001 {
            break truth;
        }
        assert!(rig.now_s() < PATIENCE_S, "{truth:?}");
    };
    assert!(fastest_mps > 0.9 * vehicle.admitted_mps() && truth.contacts == 0, "{fastest_mps} {truth:?}");
    (wall_m - truth.y_m - vehicle.geometry.body_length_m / 2.0) * 100.0
}

/// What is left before so many walls.
pub(crate) fn gaps(firmware: &Path, count: u64) -> Vec<Pair> {
    let pair = |seed| Pair { emulated: gap_cm(Some(firmware), seed), simulated: gap_cm(None, seed) };
    (0..count).map(pair).collect()
}

/// How long after the beginning of a killed agent's last frame the neutral pulse began, in ms, for so many moments
/// of death.
pub(crate) fn kills(firmware: &Path, count: u64) -> Vec<f64> {
    let killed_ms = |i: u64| {
        let mut rig = Rig::ready(Some(firmware), "", i);
        rig.goto(0.0, 6.0);
        rig.run_s(1.5 + 0.02 * i as f64);
        assert!(rig.truth().speed_mps > 0.1 && rig.truth().neutral_since_s.is_none(), "{:?}", rig.truth());
        rig.kill();
        rig.run_s(0.2);
        let truth = rig.truth();
        let neutral_s = truth.neutral_since_s.unwrap_or(f64::INFINITY);
        (neutral_s - rig.heard_s()) * 1e3
    };
    (0..count).map(killed_ms).collect()
}
