//! Set-up, power cycles and the remote control, through the real frames.

use crate::agent::Bench;
use xtb_control::frames::MapPose;
use xtb_control::{Command, Mode, Steering, WheelRpm};
use xtb_sim::{Transmitter, TruckParameters, World};

fn bench(parameters: &TruckParameters, seed: u64) -> Bench {
    Bench::new(World::for_robots(100, &parameters.body), parameters, MapPose::default(), seed)
}

const MANUAL: Transmitter = Transmitter { on: true, speed: 0.0, steering: 0.0, selector_manual: true };

#[test]
fn on_manual_the_sticks_drive_and_on_automatic_they_do_not() {
    let mut bench = bench(&TruckParameters::default(), 1);
    bench.truck().set_transmitter(Transmitter { speed: 0.3, steering: 0.5, ..Transmitter::default() });
    bench.run_s(1.0);
    assert_eq!((bench.agent.outputs.mode, bench.truck().truth().speed_mps), (Mode::Idle, 0.0));
    bench.truck().set_transmitter(Transmitter { speed: 0.3, steering: 0.5, ..MANUAL });
    bench.run_s(1.5);
    let truth = bench.truck().truth();
    assert_eq!(bench.agent.outputs.mode, Mode::Manual);
    assert!(truth.speed_mps > 0.3 && truth.yaw_rad < 1.2, "ahead and to the right: {truth:?}");
    bench.truck().set_transmitter(Transmitter { speed: -0.3, ..MANUAL });
    bench.run_s(3.0);
    assert!(bench.truck().truth().speed_mps < -0.3, "astern");
    bench.truck().set_transmitter(Transmitter::default());
    bench.run_s(2.0);
    assert_eq!((bench.agent.outputs.mode, bench.truck().truth().speed_mps), (Mode::Idle, 0.0));
}

#[test]
fn a_transmitter_that_is_switched_off_stops_the_truck() {
    let mut bench = bench(&TruckParameters::default(), 2);
    bench.truck().set_transmitter(Transmitter { speed: 0.4, ..MANUAL });
    bench.run_s(1.5);
    assert!(bench.truck().truth().speed_mps > 0.5);
    bench.truck().set_transmitter(Transmitter { on: false, ..MANUAL });
    bench.run_s(0.35);
    assert_eq!((bench.agent.outputs.mode, bench.truck().truth().motor_counts), (Mode::Fault, 3750));
    bench.truck().set_transmitter(Transmitter::default());
    bench.run_s(0.2);
    assert_eq!(bench.agent.outputs.mode, Mode::Idle);
}

#[test]
fn wrong_edges_and_420_percent_every_few_seconds_never_lose_a_channel() {
    for seed in 1..=3 {
        let mut parameters = TruckParameters::default();
        parameters.receiver.glitch_every_s = 5.0;
        parameters.receiver.interference = 0.02;
        let mut bench = bench(&parameters, seed);
        bench.truck().set_transmitter(Transmitter { speed: 0.1, ..MANUAL });
        bench.run_s(0.5);
        let mut impossible = 0;
        for _ in 0..24_000 {
            bench.step();
            assert_eq!(bench.agent.outputs.mode, Mode::Manual, "seed {seed}");
            impossible += u32::from(bench.agent.outputs.reset.any());
        }
        assert!(impossible > 20, "two minutes, three channels: {impossible}");
        let truth = bench.truck().truth();
        assert!((3865..=3885).contains(&truth.motor_counts), "the stick's 1.55 ms: {truth:?}");
    }
}

#[test]
fn a_board_that_restarts_stands_still_until_the_agent_has_set_it_up_again() {
    let mut bench = bench(&TruckParameters::default(), 3);
    bench.run_s(0.5);
    let rpm = WheelRpm::try_from(20.0).unwrap();
    bench.command(Command::Teleop { rpm, steering: Steering::CENTRED });
    bench.run_s(2.0);
    assert!(bench.truck().truth().motor_counts > 3825);
    bench.truck().power_cycle_board();
    assert_eq!(bench.truck().truth().motor_counts, 3750, "at once");
    bench.run_s(1.0);
    assert!(bench.truck().truth().motor_counts > 3825, "set up again, under way again");
}

#[test]
fn a_truck_whose_agent_never_sets_it_up_never_moves() {
    let mut bench = bench(&TruckParameters::default(), 4);
    let mut writer = xtb_protocol::board::FrameWriter::default();
    for _ in 0..400 {
        bench.truck().board_rx(writer.pwm(&crate::agent::pulses(4300, 300)).as_bytes());
        bench.simulation.step();
    }
    let truth = bench.truck().truth();
    assert_eq!((truth.motor_counts, truth.x_m, truth.y_m), (3750, 0.0, 0.0));
    let frames = crate::agent::board_frames(bench.truck());
    assert_eq!(frames.len(), 20, "2 s of nothing but its status");
}
