//! What Annex A measures on a simulated truck agrees with what is true of it.

use crate::agent::{board_frames, drive, exact_steering, pulses};
use xtb_control::PwmCount;
use xtb_control::calibration::Measured;
use xtb_control::controller::{AdcSample, PwmOutputs};
use xtb_control::vehicle::Line;
use xtb_protocol::board::{FrameWriter, FromBoard};
use xtb_sim::{Simulation, TruckParameters, World};

struct Stand {
    simulation: Simulation,
    writer: FrameWriter,
}

impl Stand {
    fn new(parameters: &TruckParameters, seed: u64) -> Self {
        let simulation = Simulation::new(World::default(), parameters, &["xtb-1"], seed).unwrap();
        Self { simulation, writer: FrameWriter::default() }
    }

    fn hold(&mut self, pwm: &PwmOutputs, seconds: f64) {
        drive(&mut self.simulation, &mut self.writer, pwm, seconds);
    }

    fn measured(&mut self) -> Measured {
        self.simulation.trucks_mut()[0].measured()
    }

    fn scans(&mut self) -> Vec<AdcSample> {
        let frames = board_frames(&mut self.simulation.trucks_mut()[0]);
        let scan = |frame: &FromBoard| match frame {
            FromBoard::Adc { sample, .. } => Some(*sample),
            _ => None,
        };
        frames.iter().filter_map(scan).collect()
    }
}

fn count(counts: f64) -> PwmCount {
    PwmCount::saturating(counts)
}

/// Least squares, and the correlation coefficient R.
fn fit(points: &[(f64, f64)]) -> (Line, f64) {
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let sum = |f: fn(f64, f64) -> f64| points.iter().map(|p| f(p.0 - mx, p.1 - my)).sum::<f64>();
    let (xx, xy, yy) = (sum(|x, _| x * x), sum(|x, y| x * y), sum(|_, y| y * y));
    let slope = xy / xx;
    (Line { slope, intercept: my - slope * mx }, xy / (xx * yy).sqrt())
}

/// Counts from −900 to 900 around a centre and back again.
fn there_and_back(centre: f64) -> impl Iterator<Item = f64> {
    let up = (-9..=9).map(move |i| centre + 100.0 * f64::from(i));
    up.clone().chain(up.rev())
}

#[test]
fn a_sweep_there_and_back_finds_each_axles_own_line_in_spite_of_the_play() {
    for seed in 1..=5 {
        let mut stand = Stand::new(&TruckParameters::default(), seed);
        for (axle, centre) in [(0, 3710.0), (1, 4179.0)] {
            let mut points = Vec::new();
            for counts in there_and_back(centre) {
                let pwm =
                    PwmOutputs { steer_front: count(counts), steer_rear: count(counts), ..pulses(3750, 0) };
                stand.hold(&pwm, 0.4);
                points.push((counts, stand.measured().steering_deg[axle]));
            }
            let (line, r) = fit(&points);
            let truth = stand.simulation.trucks()[0].calibration_truth().steering[axle];
            assert!((line.slope / truth.slope - 1.0).abs() < 0.03, "seed {seed}: {line:?} {truth:?}");
            let centre_error = line.count(0.0) - truth.count(0.0);
            assert!(centre_error.abs() < 12.0, "seed {seed}: {centre_error} counts");
            assert!((-0.9999..-0.99).contains(&r), "a fit as good as Annex A's 0.996: {r}");
        }
    }
}

#[test]
fn the_same_pulse_gives_two_angles_from_two_sides_a_play_apart() {
    let mut parameters = TruckParameters::default();
    parameters.instruments.wheel_noise_deg = 0.0;
    let mut stand = Stand::new(&parameters, 2);
    let mut angle_deg = |from: i16| {
        stand.hold(&pulses(3750, from), 1.0);
        stand.hold(&pulses(3750, 100), 1.0);
        stand.measured().steering_deg
    };
    let (from_right, from_left) = (angle_deg(-600), angle_deg(800));
    assert!((from_right[0] - from_left[0] - 1.0).abs() < 1e-6, "{from_right:?} {from_left:?}");
    assert!((from_right[1] - from_left[1] + 1.0).abs() < 1e-6, "the rear is mirrored");
}

#[test]
fn a_sweep_finds_each_bumpers_own_line() {
    let mut stand = Stand::new(&TruckParameters::default(), 3);
    let mut points = [Vec::new(), Vec::new()];
    for counts in there_and_back(3750.0) {
        let pwm = PwmOutputs { bumper_front: count(counts), bumper_rear: count(counts), ..pulses(3750, 0) };
        stand.hold(&pwm, 0.4);
        let angles = stand.measured().bumpers_deg;
        (0..2).for_each(|i| points[i].push((counts, angles[i])));
    }
    let truth = stand.simulation.trucks()[0].calibration_truth().bumpers;
    for (points, truth) in points.iter().zip(truth) {
        let (line, r) = fit(points);
        assert!((line.slope / truth.slope - 1.0).abs() < 0.02 && r > 0.999, "{line:?} {truth:?} {r}");
        assert!((line.count(0.0) - truth.count(0.0)).abs() < 6.0, "{line:?} {truth:?}");
        assert!((truth.slope / 0.036 - 1.0).abs() <= 0.03 && (truth.count(0.0) - 3750.0).abs() <= 15.0);
    }
}

#[test]
fn the_boards_own_position_readings_find_each_pistons_line() {
    let mut stand = Stand::new(&TruckParameters::default(), 4);
    let mut points: [Vec<(f64, f64)>; 4] = Default::default();
    for offset in (-300..=300).step_by(50) {
        for pulse in [3750 + offset, 3750 - offset] {
            let pwm = PwmOutputs { pistons: [count(f64::from(pulse)); 4], ..pulses(3750, 0) };
            stand.hold(&pwm, 0.05);
            stand.scans();
            stand.hold(&pwm, 0.4);
            let scans = stand.scans();
            let seconds = (scans.len() - 1) as f64 * 0.038;
            for (i, points) in points.iter_mut().enumerate() {
                let height_m = |scan: &AdcSample| scan.pistons[i].get() / 1024.0 * 0.04;
                let moved_m = height_m(&scans[scans.len() - 1]) - height_m(&scans[0]);
                points.push((f64::from(pulse), moved_m / seconds));
            }
        }
    }
    let truth = stand.simulation.trucks()[0].calibration_truth().pistons;
    for (points, truth) in points.iter().zip(truth) {
        let (line, r) = fit(points);
        // The dead band in the middle and the bend at the ends are in the data, not in the line.
        assert!((line.slope / truth.slope - 1.0).abs() < 0.08 && r > 0.99, "{line:?} {truth:?} {r}");
        assert!((line.count(0.0) - truth.count(0.0)).abs() < 12.0, "{line:?} {truth:?}");
    }
    let slopes = truth.map(|line| line.slope);
    assert!(slopes.iter().any(|slope| (slope / slopes[0] - 1.0).abs() > 0.01), "each its own: {slopes:?}");
}

#[test]
fn trucks_differ_seeds_reproduce_and_measuring_changes_nothing() {
    let truth =
        |seed| Stand::new(&TruckParameters::default(), seed).simulation.trucks()[0].calibration_truth();
    assert_eq!(truth(1), truth(1));
    assert_ne!(truth(1), truth(2));
    let exact = Stand::new(&exact_steering(), 1).simulation.trucks()[0].calibration_truth();
    assert!((exact.steering[0].count(0.0) - 3710.0).abs() < 1e-9, "{exact:?}");
    assert!((exact.steering[1].at(4179.0 - 975.0) - 20.0).abs() < 1e-9, "{exact:?}");

    let run = |measurements: usize| {
        let mut stand = Stand::new(&TruckParameters::default(), 1);
        let readings: Vec<Measured> = (0..measurements).map(|_| stand.measured()).collect();
        stand.hold(&pulses(4000, -300), 1.0);
        (stand.scans(), readings)
    };
    let (scans, readings) = run(3);
    assert_eq!(run(0).0, scans);
    assert_ne!(readings[0], readings[1], "an instrument has noise");
}
