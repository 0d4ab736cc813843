//! Every guard of sensors, drive and battery sees its fault in time on a truck that drives, and none
//! sees one where there is none. The example `guard_table` prints the figures.

use crate::draw::in_parallel;
use crate::hazards::HAZARDS;
use crate::ordinary::{KINDS, Ordinary};
use crate::whole_robot::WholeRobot;
use std::collections::{BTreeMap, BTreeSet};
use xtb_control::frames::MapPose;
use xtb_control::vehicle::BumperFinders;
use xtb_control::{PwmCount, VehicleConfig};
use xtb_protocol::messages::{BatteryLevel, Body, Fault, GoalStatus, LinkLoss};
use xtb_robot::{Guard, Guards};
use xtb_sim::{DriveFault, RangeFinderFault, SensorFaults, Transmitter, TruckParameters, World};

fn whole(seed: u64) -> WholeRobot {
    let free = World::from_toml("").unwrap();
    let config = VehicleConfig::default();
    WholeRobot::new(free, &TruckParameters::default(), MapPose::default(), seed, &config)
}

#[test]
fn each_hazard_has_its_name_and_a_neutral_motor_within_its_time() {
    for hazard in &HAZARDS {
        for (seed, outcome) in hazard.measure(100).into_iter().enumerate() {
            for (what, ms) in [("named", outcome.named_ms), ("neutral", outcome.neutral_ms)] {
                let in_time = ms.is_some_and(|ms| ms <= hazard.limit_ms);
                assert!(in_time, "{}, seed {seed}: {what} after {ms:?} ms", hazard.name);
            }
        }
    }
}

#[test]
fn no_guard_sees_a_fault_in_two_thousand_ordinary_drives() {
    for kind in KINDS {
        let alarms = kind.alarms(400, &VehicleConfig::default());
        assert_eq!(alarms, BTreeMap::new(), "{kind:?}");
    }
}

#[test]
fn with_a_third_less_time_and_coasting_the_drives_guards_see_none_either() {
    let mut config = VehicleConfig::default();
    (config.guard.runaway_s, config.guard.coast_s, config.guard.stall_s) = (0.2, 0.35, 0.2);
    for kind in [Ordinary::Goto, Ordinary::Teleop, Ordinary::Slope] {
        assert_eq!(kind.alarms(200, &config), BTreeMap::new(), "{kind:?}");
    }
}

#[test]
fn a_guard_that_is_switched_off_lets_the_truck_drive_on() {
    type Break = fn(&mut WholeRobot);
    let cases: [(Guard, f64, Break); 3] = [
        (Guard::Frozen, 1.0, |whole| {
            let faults = SensorFaults { converter_frozen: true, ..SensorFaults::default() };
            whole.truck().set_sensor_faults(faults);
        }),
        (Guard::OutOfRange, 1.0, |whole| {
            let faults = SensorFaults::range_finder(8, RangeFinderFault::BrokenWire);
            whole.truck().set_sensor_faults(faults);
        }),
        (Guard::Battery, 3.0, |whole| whole.truck().set_battery_left(0.0)),
    ];
    for (guard, seconds, break_it) in cases {
        let drives_on = |off: bool| {
            let mut whole = whole(7);
            if off {
                whole.robot = whole.robot.clone().with_guards(Guards::without(guard));
            }
            whole.setpoint = Some((15.0, 0.0));
            whole.run_s(1.0);
            break_it(&mut whole);
            whole.run_s(seconds);
            whole.truck().truth().motor_counts != PwmCount::NEUTRAL.get()
        };
        assert_eq!((drives_on(false), drives_on(true)), (false, true), "{guard:?}");
    }
}

#[test]
fn without_the_obstacle_rule_the_truck_runs_into_the_wall_and_with_it_not() {
    let contacts = |off: bool| {
        let wall = "[[boxes]]\nx_m = 0.0\ny_m = 2.0\nwidth_m = 3.0\ndepth_m = 0.2";
        let (world, parameters) = (World::from_toml(wall).unwrap(), TruckParameters::default());
        let mut whole = WholeRobot::new(world, &parameters, MapPose::default(), 3, &VehicleConfig::default());
        if off {
            whole.robot = whole.robot.clone().with_guards(Guards::without(Guard::Obstacle));
        }
        whole.setpoint = Some((20.0, 0.0));
        whole.run_s(15.0);
        whole.truck().truth().contacts
    };
    assert_eq!((contacts(false), contacts(true)), (0, 1));
}

#[test]
fn a_low_battery_lets_the_goal_finish_and_an_unmeasured_one_is_unknown() {
    let mut whole = whole(4);
    assert_eq!(whole.state().battery_level, BatteryLevel::Ok);
    assert!(whole.goto(1.0, 0.0));
    whole.run_s(1.0);
    whole.truck().set_battery_left(0.15);
    whole.run_s(3.0);
    assert!(whole.has(Fault::BatteryLow) && whole.goal_runs());
    assert_eq!(whole.state().battery_level, BatteryLevel::Finish);
    whole.run_s(20.0);
    let status = whole.robot.agent().goal().map(|goal| goal.status);
    assert_eq!(status, Some(GoalStatus::Reached));
    let faults = SensorFaults { battery_unmeasured: true, ..SensorFaults::default() };
    whole.truck().set_sensor_faults(faults);
    whole.run_s(1.5);
    let state = whole.state();
    assert_eq!((state.battery_v, state.battery_level), (None, BatteryLevel::Unknown));
    assert!(whole.has(Fault::BatteryLow), "what was low is not known to be better");
}

#[test]
fn a_stick_at_its_end_drives_hardly_faster_than_the_obstacle_rule_can_stop() {
    let stick = Transmitter { on: true, speed: 0.0, steering: 0.0, selector_manual: true };
    let fastest_mps = |off: bool, seed: u64| {
        let mut whole = whole(seed);
        if off {
            whole.robot = whole.robot.clone().with_guards(Guards::without(Guard::OverSpeed));
        }
        whole.truck().set_transmitter(stick);
        whole.run_s(0.5);
        whole.truck().set_transmitter(Transmitter { speed: 1.0, ..stick });
        let (mut fastest_mps, mut held) = (0.0_f64, false);
        for _ in 0..1000 {
            whole.step();
            fastest_mps = fastest_mps.max(whole.truck().truth().speed_mps);
            held |= whole.robot.over_speed();
        }
        assert_eq!((held, &whole.seen), (!off, &BTreeSet::new()));
        fastest_mps
    };
    let with = in_parallel(0..100, |seed| fastest_mps(false, seed)).into_iter().fold(0.0, f64::max);
    // Two windows at full drive, 12 m/s², until the first one has been counted and neutral is there.
    assert!(with < 1.1, "{with} m/s");
    assert!(fastest_mps(true, 0) > 2.0);
}

#[test]
fn a_stick_at_its_end_crawls_where_no_range_finder_looks() {
    let mut config = VehicleConfig::default();
    config.range_finders.rear = BumperFinders(Vec::new());
    let stick = Transmitter { on: true, speed: 0.0, steering: 0.0, selector_manual: true };
    let fastest_mps = |seed: u64| {
        let free = World::from_toml("").unwrap();
        let mut whole = WholeRobot::new(free, &TruckParameters::default(), MapPose::default(), seed, &config);
        whole.truck().set_transmitter(stick);
        whole.run_s(0.5);
        whole.truck().set_transmitter(Transmitter { speed: -1.0, ..stick });
        (0..2000).fold(0.0_f64, |fastest_mps, _| {
            whole.step();
            fastest_mps.max(-whole.truck().truth().speed_mps)
        })
    };
    let speeds = in_parallel(0..100, fastest_mps);
    let (least, most) = speeds.iter().fold((f64::MAX, 0.0_f64), |(l, m), &mps| (l.min(mps), m.max(mps)));
    assert!(least > 0.05 && most < 0.2, "{least} to {most} m/s");
}

#[test]
fn held_wheels_under_the_transmitter_want_to_see_a_neutral_stick() {
    let stick = |speed| Transmitter { on: true, speed, steering: 0.0, selector_manual: true };
    let mut whole = whole(5);
    whole.truck().set_transmitter(stick(0.0));
    whole.run_s(0.5);
    whole.truck().set_transmitter(stick(0.15));
    whole.run_s(1.0);
    whole.truck().set_drive_fault(DriveFault::Held);
    whole.run_s(1.0);
    assert!(whole.has(Fault::Stalled));
    whole.truck().set_drive_fault(DriveFault::None);
    for _ in 0..1000 {
        whole.step();
        assert_eq!(whole.truck().truth().motor_counts, PwmCount::NEUTRAL.get());
    }
    assert!(!whole.has(Fault::Stalled), "shown for a moment only");
    whole.truck().set_transmitter(stick(0.0));
    whole.run_s(0.3);
    whole.truck().set_transmitter(stick(0.15));
    whole.run_s(0.5);
    assert!(whole.truck().truth().speed_mps > 0.1);
}

#[test]
fn a_touched_wall_that_no_sensor_sees_is_a_stall() {
    let mut whole = whole(6);
    whole.ask(Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 });
    whole.run_s(2.0);
    whole.truck().set_drive_fault(DriveFault::Held);
    whole.run_s(1.0);
    assert!(whole.has(Fault::Stalled));
    let goal = whole.robot.agent().goal().map(|goal| goal.status);
    assert_eq!(goal, Some(GoalStatus::Failed));
}
