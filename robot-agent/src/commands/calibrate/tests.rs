//! Whole sweeps on simulated trucks that are not as they should be.

use super::*;
use robot_agent::clock::WorldTime;
use robot_agent::hardware::simulated::{RunningWorld, SimulatedHardware};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use xtb_control::VehicleConfig;
use xtb_control::vehicle::Line;
use xtb_sim::{Simulation, TruckParameters, World};

/// A truck on its bench, set up; how often a piston was driven on at its end.
struct Rig {
    // First: it sends its last frame while the world still runs.
    bench: Bench,
    world: RunningWorld,
    pushes: Arc<AtomicU64>,
}

fn rig(parameters: &TruckParameters, vehicle: &VehicleConfig) -> Rig {
    let simulation = Simulation::new(World::default(), parameters, &["xtb-1"], 3).unwrap();
    let (lines, world_lines) = SimulatedHardware::connect();
    let time = WorldTime::new();
    let (clock, pushes) = (time.join(), Arc::new(AtomicU64::new(0)));
    let seen = pushes.clone();
    let each_step = move |simulation: &Simulation| {
        seen.store(simulation.trucks()[0].end_stop_pushes(), Ordering::Relaxed);
    };
    let world = RunningWorld::start(simulation, vec![world_lines], time, SIMULATED_SPEED, each_step).unwrap();
    let instruments = Some(world.instruments(0));
    let mut bench = Bench::new((Box::new(lines), clock), instruments, vehicle, Arc::default()).unwrap();
    bench.set_up().unwrap();
    Rig { bench, world, pushes }
}

fn steering(parameters: &TruckParameters) -> Vec<Point> {
    let (what, vehicle) = (Actuator::SteeringFront, VehicleConfig::default());
    let mut rig = rig(parameters, &vehicle);
    let steps = what.default_sweep(&vehicle).there_and_back().unwrap();
    let console = Console::start(Input::Terminal).unwrap();
    let progress = ProgressBar::hidden();
    let mut truck =
        sweep::Truck { bench: &mut rig.bench, actuator: what, console: &console, progress: &progress };
    let points = sweep::angles(&steps, &mut truck).unwrap();
    drop(rig.bench);
    drop(rig.world);
    points
}

#[test]
fn a_steering_with_a_lot_of_play_is_refused() {
    let mut parameters = TruckParameters::default();
    assert_eq!(judge(&steering(&parameters)).1, None);
    parameters.steering.play_deg = 3.5;
    let (fit, refused) = judge(&steering(&parameters));
    let refused = refused.unwrap();
    assert!(matches!(refused, FitError::WeakCorrelation { r } if r > 0.8), "{refused}");
    let apart_deg = fit.unwrap().hysteresis().unwrap();
    assert!((5.0..7.5).contains(&apart_deg), "twice the play, as far as it was taken up: {apart_deg}");
}

fn piston(vehicle: &VehicleConfig) -> (Result<Vec<Point>, Trouble>, u64) {
    let what = Actuator::PistonRl;
    let mut rig = rig(&TruckParameters::default(), vehicle);
    let counts = what.default_sweep(vehicle).outwards().unwrap();
    let line = what.line(&vehicle.calibration);
    let points = Piston::new(&mut rig.bench, (what, 2), &vehicle.pistons, line).speeds(&counts, |_| {});
    let pushes = rig.pushes.load(Ordering::Relaxed);
    drop(rig.bench);
    drop(rig.world);
    (points, pushes)
}

#[test]
fn a_piston_configured_the_wrong_way_round_is_found_out_and_no_end_stop_is_touched() {
    let mut vehicle = VehicleConfig::default();
    let right = judge(&piston(&vehicle).0.unwrap()).0.unwrap();
    let Line { slope, intercept } = vehicle.calibration.pistons()[2];
    (vehicle.calibration.piston_rl_slope, vehicle.calibration.piston_rl_intercept) = (-slope, -intercept);
    vehicle.validate().unwrap();
    let (points, pushes) = piston(&vehicle);
    let (fit, refused) = judge(&points.unwrap());
    assert_eq!((refused, pushes), (None, 0));
    let found = fit.unwrap();
    assert!((found.line.slope / right.line.slope - 1.0).abs() < 0.01, "{found:?} {right:?}");
}

#[test]
fn a_piston_whose_sensor_does_not_move_is_given_up() {
    let mut vehicle = VehicleConfig::default();
    // As if the sensor of a piston that stands in its middle said "almost at the lower end".
    (vehicle.pistons.middle_m, vehicle.pistons.travel_m) = (0.037, 0.04);
    let mut parameters = TruckParameters::default();
    parameters.platform.piston_mps_per_count = 0.0;
    let mut rig = rig(&parameters, &vehicle);
    let line = vehicle.calibration.pistons()[0];
    let mut piston = Piston::new(&mut rig.bench, (Actuator::PistonFl, 0), &vehicle.pistons, line);
    let trouble = piston.speeds(&[PwmCount::NEUTRAL], |_| {}).unwrap_err();
    assert!(
        matches!(trouble, Trouble::Stuck { height_mm, .. } if (height_mm - 20.0).abs() < 0.1),
        "{trouble}"
    );
}
