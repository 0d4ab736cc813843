//! What robots and the simulator do all the time: steps, turns, frames, states.

use super::Work;
use fleet_tests::name;
use std::hint::black_box;
use xtb_control::controller::{AdcSample, GyroSample, RemoteSample};
use xtb_control::frames::MapPose;
use xtb_control::goto::GotoGoal;
use xtb_control::{AdcCount, Command, Controller, Sample, Stamp, VehicleConfig};
use xtb_protocol::Uuid;
use xtb_protocol::board::{FrameReader, FrameWriter};
use xtb_protocol::codec::{self, Format};
use xtb_protocol::messages::{Body, Done, Lease, LinkLoss, Outcome, Request, RobotState, TruthRobot, Via};
use xtb_robot::{Robot, RobotIdentity};
use xtb_sim::lockstep::turn;
use xtb_sim::{Lockstep, MAP_RESOLUTION_M, STEP_NS, Sequential, Simulation, Truck, TruckParameters, World};

/// Steps of the simulator until everything is set up.
const BOOT_STEPS: usize = 400;

/// A scan with things in range of all twelve sensors, on a slope of a few degrees.
fn scan() -> AdcSample {
    let count = |counts: u16| AdcCount::try_from(counts).expect("in range");
    let side = [40, 120, 200, 300, 150, 90, 0, 0].map(count);
    AdcSample {
        ir_front: side,
        ir_rear: side,
        tilt: [540, 500].map(count),
        pistons: [500, 520, 480, 512].map(count),
    }
}

/// The receiver with the selector on automatic.
fn receiver() -> RemoteSample {
    RemoteSample { speed: Some(938), steering: Some(1000), selector: Some(1125) }
}

/// Each kind of sample as often as it comes in a second.
pub(super) fn controller_steps() -> Work {
    const SECONDS: usize = 200;
    let mut samples = Vec::new();
    for i in 0..100_u16 {
        samples.push(Sample::Gyro(GyroSample { roll: 3, pitch: -2, yaw: 120 }));
        let due = |each_s: u16| i * each_s / 100 != (i + 1) * each_s / 100;
        if due(45) {
            samples.push(Sample::Remote(receiver()));
        }
        if due(26) {
            samples.push(Sample::Adc(scan()));
        }
        if due(19) {
            samples.push(Sample::Encoder { pulses: 22 });
        }
    }
    let mut controller = Controller::new(VehicleConfig::default());
    controller.step(Stamp::ZERO, &samples[0]);
    let goal = GotoGoal::new(3.0, 40.0).expect("in range");
    let mut outputs = controller.step(Stamp::ZERO, &Sample::Command(Command::Goto(goal)));
    let (steps, mut now) = (SECONDS * samples.len(), Stamp::ZERO);
    Work::new(steps as f64, move || {
        for sample in samples.iter().cycle().take(steps) {
            now = now.plus_ms(10);
            controller.step_over(now, black_box(sample), &mut outputs); // as a robot does
            black_box(&outputs);
        }
    })
}

/// What a truck has sent before a turn.
struct Sent {
    now: Stamp,
    board: Vec<u8>,
    gyro: Vec<u8>,
}

/// A robot that wanders, with the bytes of its truck: the same turns again and again.
pub(super) fn robot_turns() -> Work {
    const TURNS: usize = 1000;
    let parameters = TruckParameters::default();
    let world = World::for_robots(1, &parameters.body);
    let mut simulation = Simulation::new(world, &parameters, &["xtb-1"], 1).expect("there is room");
    let TruthRobot { x_m, y_m, yaw_rad, .. } = simulation.trucks()[0].truth();
    let start_pose = MapPose { x_m, y_m, yaw_rad };
    let identity = RobotIdentity { fleet: name("lab"), robot: name("xtb-1"), epoch: 1, start_pose };
    let mut robot = Robot::new(identity, VehicleConfig::default(), "bench");
    let mut bytes = Vec::new();
    for _ in 0..BOOT_STEPS {
        simulation.step();
        let now = simulation.now();
        turn(&mut simulation.trucks_mut()[0], &mut robot, now, &mut bytes);
    }
    let lease = send_wandering(&mut robot, simulation.now());
    let (booted, mut sent) = (robot.clone(), Vec::new());
    for _ in 0..TURNS {
        simulation.step();
        let (now, truck) = (simulation.now(), &mut simulation.trucks_mut()[0]);
        let (mut board, mut gyro) = (Vec::new(), Vec::new());
        truck.take_board_tx(&mut board);
        truck.take_gyro_tx(&mut gyro);
        let said = Sent { now, board, gyro };
        one_turn(&mut robot, lease, &said, Some(truck));
        sent.push(said);
    }
    Work::new(TURNS as f64, move || {
        let mut robot = booted.clone();
        for said in &sent {
            one_turn(&mut robot, lease, said, None);
        }
        black_box(robot.outputs().reference_rpm);
    })
}

fn send_wandering(robot: &mut Robot, now: Stamp) -> Lease {
    let client = name("bench");
    let request = |id, lease, body| Request { id: Uuid::from_u128(id), lease, body };
    let reply = robot.request(now, 1, &client, &request(1, None, Body::Acquire { take: true }));
    let Outcome::Ok(Done { lease: Some(lease), .. }) = reply.result else { panic!("no lease: {reply:?}") };
    let body = Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 };
    let reply = robot.request(now, 2, &client, &request(2, Some(lease), body));
    assert!(matches!(reply.result, Outcome::Ok(_)), "it does not wander: {reply:?}");
    lease
}

/// The turn of `xtb_sim::lockstep`, with bytes that are known already; a truck obeys if there is one.
fn one_turn(robot: &mut Robot, lease: Lease, said: &Sent, mut truck: Option<&mut Truck>) {
    let now = said.now;
    robot.agent_mut().heard(now, lease);
    robot.board_bytes(now, &said.board);
    robot.gyro_bytes(now, &said.gyro);
    let mut frame = robot.turn(now);
    while let Some(due) = frame.or_else(|| robot.board_request(now)) {
        let bytes = black_box(&due).as_bytes();
        if let Some(truck) = truck.as_deref_mut() {
            truck.board_rx(bytes);
        }
        frame = None;
    }
    if let (Some(command), Some(truck)) = (robot.gyro_request(now), truck) {
        truck.gyro_rx(command);
    }
    while robot.agent_mut().next_event().is_some() {}
}

/// Robots that wander in a room for all, as in the bench `lockstep`.
fn wandering(robots: usize) -> Lockstep {
    let parameters = TruckParameters::default();
    let names: Vec<String> = (1..=robots).map(|n| format!("xtb-{n}")).collect();
    let world = World::for_robots(robots, &parameters.body);
    let simulation = Simulation::new(world, &parameters, &names, 1).expect("there is room");
    let mut fleet =
        Lockstep::new(simulation, &name("lab"), &VehicleConfig::default()).expect("names of robots");
    for _ in 0..100 {
        fleet.step();
    }
    for robot in 0..robots {
        let body = Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 };
        let request = Request { id: Uuid::from_u128(robot as u128), lease: None, body };
        fleet.request(robot, &name("bench"), &request);
    }
    fleet
}

/// So many steps of the simulator; the fleet goes on from one measurement to the next.
pub(super) fn wanderers(robots: usize, steps: usize) -> Work {
    let mut fleet = wandering(robots);
    let simulated_s = (steps as u64 * STEP_NS) as f64 * 1e-9;
    Work::new(robots as f64 * simulated_s, move || {
        fleet.run(steps as u64, &Sequential);
    })
}

/// The same with planned goals, another one for everybody each time: in turn on either side of the room.
pub(super) fn drivers(robots: usize, steps: usize) -> Work {
    let mut fleet = wandering(robots);
    let map = fleet.simulation().world().to_map(MAP_RESOLUTION_M).expect("a room");
    fleet.set_map(&map);
    let simulated_s = (steps as u64 * STEP_NS) as f64 * 1e-9;
    let mut time = 0_u128;
    Work::new(robots as f64 * simulated_s, move || {
        time += 1;
        let side = if time.is_multiple_of(2) { 1.0 } else { -1.0 };
        for robot in 0..robots {
            let (x_m, y_m) = (5.0 * side, robot as f64 + 0.5 - robots as f64 / 2.0);
            let (via, on_link_loss) = (Some(Via::Planned), LinkLoss::Finish);
            let body = Body::Goto { x_m, y_m, yaw_rad: None, via, on_link_loss, finish_s: 300.0 };
            let request = Request { id: Uuid::from_u128((time << 32) + robot as u128), lease: None, body };
            fleet.request(robot, &name("bench"), &request);
        }
        fleet.run(steps as u64, &Sequential);
    })
}

/// Frames of both directions, about as often as they come.
pub(super) fn board_frames() -> Work {
    const ROUNDS: usize = 1000;
    const FRAMES: usize = 6 * ROUNDS;
    let pwm = Controller::new(VehicleConfig::default()).outputs(Stamp::ZERO).pwm;
    let (mut board, mut agent) = (FrameWriter::default(), FrameWriter::default());
    let (mut from_board, mut to_board) = (FrameReader::default(), FrameReader::default());
    let (scan, receiver) = (scan(), receiver());
    Work::new(FRAMES as f64, move || {
        let mut read = 0;
        for _ in 0..ROUNDS {
            let frames = [
                board.adc(black_box(&scan), Some(7400)),
                board.remote(black_box(&receiver)),
                board.encoder(black_box(22)),
                board.remote(black_box(&receiver)),
            ];
            for frame in &frames {
                from_board.from_board(frame.as_bytes(), |found| read += usize::from(found.is_ok()));
            }
            for frame in [agent.pwm(black_box(&pwm)), agent.pwm(black_box(&pwm))] {
                to_board.to_board(frame.as_bytes(), |found| read += usize::from(found.is_ok()));
            }
        }
        assert_eq!(read, FRAMES, "a frame was refused");
    })
}

/// The state of a robot that wanders, between our own programs.
pub(super) fn state_messages() -> Work {
    const MESSAGES: usize = 2000;
    let mut fleet = wandering(1);
    for _ in 0..BOOT_STEPS {
        fleet.step();
    }
    let state = fleet.state(0).expect("a robot");
    let encoding = codec::encoding::<RobotState>(Format::Postcard);
    Work::new(MESSAGES as f64, move || {
        for _ in 0..MESSAGES {
            let bytes = codec::encode(black_box(&state), Format::Postcard).expect("a valid state");
            black_box(codec::decode::<RobotState>(&encoding, &bytes).expect("a state"));
        }
    })
}

/// Whole scenarios of `xtb-chaos`.
pub(super) fn scenarios() -> Work {
    Work::new(four_scenarios_s(), || {
        black_box(four_scenarios_s());
    })
}

/// Virtual time of the fleets, in s.
fn four_scenarios_s() -> f64 {
    let lasted_s = |seed: u64| {
        let report = xtb_chaos::run(seed, xtb_chaos::ScenarioOptions::default()).expect("a scenario");
        report.lasted_ms as f64 / 1000.0
    };
    (0..4).map(lasted_s).sum()
}
