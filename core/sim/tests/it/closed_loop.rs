//! The real controller on the simulated truck, through the real frames.

use crate::agent::Bench;
use std::f64::consts::PI;
use xtb_control::frames::MapPose;
use xtb_control::goto::GotoGoal;
use xtb_control::{Command, Mode, Steering, WheelRpm};
use xtb_sim::{BoxSpec, TruckParameters, World};

fn bench(seed: u64) -> Bench {
    Bench::new(World::default(), &TruckParameters::default(), MapPose::default(), seed)
}

fn teleop(rpm: f64) -> Command {
    Command::Teleop { rpm: WheelRpm::try_from(rpm).unwrap(), steering: Steering::CENTRED }
}

#[test]
fn the_speed_controller_holds_13_rpm_against_the_dead_band() {
    for (seed, rpm) in [(1, 13.0), (2, 13.0), (3, -13.0), (4, 40.0)] {
        let mut bench = bench(seed);
        bench.run_s(0.2);
        bench.command(teleop(rpm));
        bench.run_s(3.0);
        let mps_per_rpm = PI * 0.1651 / 60.0;
        for _ in 0..1000 {
            bench.step();
            let outputs = &bench.agent.outputs;
            let true_rpm = bench.simulation.trucks()[0].truth().speed_mps / mps_per_rpm;
            assert!((outputs.rpm - rpm).abs() <= 2.0, "measured {} for {rpm}", outputs.rpm);
            assert!((true_rpm - rpm).abs() <= 2.0, "true {true_rpm} for {rpm}");
        }
    }
}

#[test]
fn a_goal_at_1_5_and_2_0_is_reached() {
    for seed in 1..=10 {
        let mut bench = bench(seed);
        bench.run_s(0.5);
        bench.command(Command::Goto(GotoGoal::new(1.5, 2.0).unwrap()));
        bench.run_s(60.0);
        assert_eq!(bench.agent.outputs.mode, Mode::Idle, "seed {seed}");
        let truth = bench.simulation.trucks()[0].truth();
        let missed_m = (truth.x_m - 1.5).hypot(truth.y_m - 2.0);
        assert!(missed_m < 0.6, "seed {seed}: {missed_m} m off with drift and wheel scale: {truth:?}");
        assert_eq!((truth.contacts, truth.speed_mps), (0, 0.0));
    }
}

#[test]
fn an_obstacle_holds_the_truck_until_it_is_taken_away() {
    let mut bench = bench(5);
    bench.run_s(0.5);
    bench.command(Command::Goto(GotoGoal::new(0.0, 3.0).unwrap()));
    bench.run_s(5.0);
    let ahead_m = bench.simulation.trucks()[0].truth().y_m + 0.25 + 0.5;
    let spec = BoxSpec { x_m: 0.0, y_m: ahead_m + 0.1, width_m: 1.5, depth_m: 0.2, yaw_rad: 0.0 };
    bench.simulation.put_box("crate", spec).unwrap();
    bench.run_s(10.0);
    let truth = bench.simulation.trucks()[0].truth();
    let gap_m = ahead_m - truth.y_m - 0.25;
    assert!(bench.agent.outputs.blocked && truth.contacts == 0, "{truth:?}");
    assert!((0.1..0.26).contains(&gap_m), "{gap_m}");
    assert!(truth.neutral_since_s.is_some());
    bench.simulation.remove_box("crate").unwrap();
    bench.run_s(40.0);
    assert_eq!(bench.agent.outputs.mode, Mode::Idle);
    assert!(bench.simulation.trucks()[0].truth().y_m > 2.5);
}

#[test]
fn wander_in_a_small_room_touches_nothing_in_five_minutes() {
    for seed in 1..=3 {
        let room = World::from_toml("[room]\nwidth_m = 5.0\ndepth_m = 5.0").unwrap();
        let mut bench = Bench::new(room, &TruckParameters::default(), MapPose::default(), seed);
        bench.command(Command::Wander);
        bench.run_s(300.0);
        let truth = bench.simulation.trucks()[0].truth();
        assert_eq!(truth.contacts, 0, "seed {seed}: {truth:?}");
    }
}
