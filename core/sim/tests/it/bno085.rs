//! A robot whose yaw comes from a BNO085 at the board, and the board's emergency stop.

use crate::whole_robot::WholeRobot;
use xtb_control::frames::MapPose;
use xtb_control::vehicle::{Imu, ImuYaw};
use xtb_control::{Controller, Sample, VehicleConfig};
use xtb_protocol::messages::{Body, Fault, Latch, LinkLoss, Request, Via};
use xtb_protocol::trace::{TraceReader, sample_line};
use xtb_protocol::{Name, Uuid};
use xtb_robot::robot::Readings;
use xtb_sim::{
    GyroFault, InjectedLineFault, LineFaults, Lockstep, SensorFaults, Simulation, TruckParameters,
    VehicleFile, World,
};

const FILE: &str = "imu = \"bno085-rvc\"\n[truth.gyro]\nyaw_drift_dps = 0.0";

fn robot(file: &VehicleFile) -> WholeRobot {
    WholeRobot::new(World::default(), &file.truth, MapPose::default(), 3, &file.vehicle)
}

/// How far the truck is from a goal ahead of it to its left after it has been sent there, in m.
fn left_m(file: &VehicleFile) -> f64 {
    let mut robot = robot(file);
    assert!(robot.goto(1.0, 1.5));
    for _ in 0..60 {
        robot.run_s(1.0);
        if !robot.goal_runs() {
            break;
        }
    }
    let truth = robot.truck().truth();
    assert_eq!(robot.seen, [].into(), "no fault");
    (truth.x_m - 1.0).hypot(truth.y_m - 1.5)
}

#[test]
fn it_drives_to_its_goal_as_with_a_gyro_and_not_with_the_yaw_the_wrong_way_round() {
    let gyro = VehicleFile::from_toml("[truth.gyro]\nyaw_drift_dps = 0.0").unwrap();
    let mut unit = VehicleFile::from_toml(FILE).unwrap();
    assert_eq!((unit.vehicle.imu, unit.truth.gyro.imu), (Imu::Bno085Rvc, Imu::Bno085Rvc));
    let (with_gyro, with_unit) = (left_m(&gyro), left_m(&unit));
    assert!(with_gyro < 0.35 && with_unit < 0.35, "{with_gyro} and {with_unit} m");
    unit.truth.gyro.imu_yaw = ImuYaw::Clockwise;
    let wrong = left_m(&unit);
    assert!(wrong > 1.0, "{wrong} m");
    unit.vehicle.imu_yaw = ImuYaw::Clockwise;
    let right = left_m(&unit);
    assert!(right < 0.35, "{right} m");
}

#[test]
fn a_drive_is_recorded_and_replayed_bit_for_bit() {
    let VehicleFile { vehicle, truth } = VehicleFile::from_toml(FILE).unwrap();
    let start = [("xtb-1", MapPose::default())];
    let simulation = Simulation::with_starts(World::default(), &truth, &start, 3).unwrap();
    let mut lockstep = Lockstep::new(simulation, &Name::new("lab").unwrap(), &vehicle).unwrap();
    lockstep.robot_mut(0).unwrap().record_steps();
    let (mut replay, mut reader, mut gyro) = (Controller::new(vehicle), TraceReader::default(), 0);
    for step in 0..2000 {
        if step == 100 {
            let (via, on_link_loss) = (Some(Via::Direct), LinkLoss::Halt);
            let body = Body::Goto { x_m: 0.5, y_m: 1.0, yaw_rad: None, via, on_link_loss, finish_s: 300.0 };
            let request = Request { id: Uuid::from_u128(1), lease: None, body };
            lockstep.request(0, &Name::new("tester").unwrap(), &request).unwrap();
        }
        lockstep.step();
        while let Some(step) = lockstep.robot_mut(0).unwrap().take_step() {
            // As a trace keeps it.
            let (t, sample) = reader.line(&sample_line(step.t, &step.sample)).unwrap();
            assert_eq!(replay.step(t, &sample), step.outputs, "step {}", step.number);
            gyro += u32::from(matches!(sample, Sample::Gyro(_)));
        }
    }
    assert!((980..=1000).contains(&gyro), "100 a second: {gyro}");
    let truth = lockstep.simulation().trucks()[0].truth();
    assert!(truth.x_m.hypot(truth.y_m) > 0.3, "it has driven");
}

fn readings(robot: &WholeRobot) -> Readings {
    robot.robot.readings(robot.simulation.now())
}

#[test]
fn a_unit_that_breaks_is_named_and_ends_the_drive() {
    let file = VehicleFile::from_toml(FILE).unwrap();
    let lines = |gyro| LineFaults { gyro, ..LineFaults::default() };
    let sensors = |gyro| SensorFaults { gyro, ..SensorFaults::default() };
    for (line, sensor, fault) in [
        (InjectedLineFault::Silent, GyroFault::None, Fault::GyroSilent),
        (InjectedLineFault::Garbage, GyroFault::None, Fault::GyroSilent),
        (InjectedLineFault::Frozen, GyroFault::None, Fault::GyroFrozen),
        (InjectedLineFault::None, GyroFault::Frozen, Fault::GyroFrozen),
        (InjectedLineFault::None, GyroFault::TimerFrozen, Fault::GyroFrozen),
        (InjectedLineFault::None, GyroFault::AnglesFrozen, Fault::GyroFrozen),
    ] {
        let mut robot = robot(&file);
        assert!(robot.goto(0.0, 4.0));
        robot.run_s(3.0);
        assert!(robot.goal_runs());
        robot.truck().set_line_faults(lines(line));
        robot.truck().set_sensor_faults(sensors(sensor));
        robot.run_s(0.5);
        let state = robot.state();
        let said = state.faults.iter().find(|said| said.fault == fault);
        let words = said.and_then(|said| said.detail.clone());
        assert!(words.is_some_and(|words| words.starts_with("BNO085")), "{line:?}, {sensor:?}: {state:?}");
        assert!(!robot.goal_runs());
        let bad = readings(&robot).gyro_skipped;
        robot.truck().set_line_faults(LineFaults::default());
        robot.truck().set_sensor_faults(SensorFaults::default());
        robot.run_s(2.0);
        assert!(!robot.has(fault), "{line:?}, {sensor:?}");
        let counted = readings(&robot).gyro_skipped - bad;
        assert_eq!(
            counted > 0,
            line == InjectedLineFault::Garbage,
            "wrong check sums are counted: {counted} bytes"
        );
    }
}

#[test]
fn a_board_with_a_bno085_says_who_it_is_and_one_without_is_not_asked() {
    let with = robot(&VehicleFile::from_toml(FILE).unwrap());
    let said = readings(&with).identity.unwrap();
    assert_eq!((said.model_name(), said.firmware.to_string().as_str()), ("simulated", "1.1"));
    assert!(readings(&with).bno085_yaw_cdeg.is_some());
    let without = robot(&VehicleFile::default());
    let readings = readings(&without);
    assert_eq!((readings.identity, readings.bno085_yaw_cdeg), (None, None));
    assert_eq!(readings.status.unwrap().rejected, 0, "an older board has nothing to refuse");
}

#[test]
fn its_emergency_stop_holds_the_truck_until_it_is_released_and_reset() {
    let vehicle = VehicleConfig::default();
    let mut truth = TruckParameters::of(&vehicle);
    for answers_asks in [false, true] {
        truth.board.answers_asks = answers_asks;
        let mut robot = robot(&VehicleFile { vehicle: vehicle.clone(), truth: truth.clone() });
        assert!(robot.goto(0.0, 4.0));
        robot.run_s(3.0);
        robot.truck().set_emergency_stop(true);
        robot.run_s(0.1);
        assert!(robot.truck().truth().neutral_since_s.is_some());
        robot.run_s(2.0);
        assert!(robot.truck().truth().speed_mps.abs() < 0.01);
        let state = robot.state();
        assert_eq!((state.latches[0].latch, state.latches[0].present), (Latch::Estop, true));
        assert_eq!(state.faults, [], "the board stays set up");
        robot.ask(Body::Reset { latch: None });
        robot.truck().set_emergency_stop(false);
        robot.run_s(1.0);
        assert!(!robot.goto(0.0, 5.0), "still latched");
        robot.ask(Body::Reset { latch: None });
        assert!(robot.goto(0.0, 5.0));
        robot.run_s(2.0);
        assert!(robot.truck().truth().speed_mps > 0.05);
    }
}
