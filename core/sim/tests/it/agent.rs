//! A small agent: what `robot-agent` does between the lines, in simulated time.

use xtb_control::controller::{Outputs, PwmOutputs};
use xtb_control::frames::MapPose;
use xtb_control::units::{PwmCount, Stamp};
use xtb_control::{Command, Controller, Sample, VehicleConfig};
use xtb_protocol::board::{FrameReader, FrameWriter, FromBoard};
use xtb_protocol::gyro_3dmg::{EulerReader, START_CONTINUOUS};
use xtb_sim::{STEP_NS, Simulation, Truck, TruckParameters, World};

/// Drives one truck through its two lines, one turn a step.
pub(crate) struct Agent {
    controller: Controller,
    board: FrameReader,
    gyro: EulerReader,
    writer: FrameWriter,
    bytes: Vec<u8>,
    samples: Vec<Sample>,
    sent: Option<(Stamp, PwmCount)>,
    pub(crate) outputs: Outputs,
}

impl Agent {
    pub(crate) fn new(config: VehicleConfig) -> Self {
        let mut controller = Controller::new(config);
        let outputs = controller.step(Stamp::ZERO, &Sample::Command(Command::Idle));
        Self {
            controller,
            board: FrameReader::default(),
            gyro: EulerReader::default(),
            writer: FrameWriter::default(),
            bytes: Vec::new(),
            samples: Vec::new(),
            sent: None,
            outputs,
        }
    }

    pub(crate) fn command(&mut self, now: Stamp, command: Command) {
        self.outputs = self.controller.step(now, &Sample::Command(command));
    }

    /// Reads what came, lets the controller decide, sends a PWM frame every 20 ms and at once on
    /// neutral.
    pub(crate) fn turn(&mut self, now: Stamp, truck: &mut Truck) {
        let samples = &mut self.samples;
        self.bytes.clear();
        truck.take_board_tx(&mut self.bytes);
        self.board.from_board(&self.bytes, |frame| {
            samples.push(match frame.unwrap() {
                FromBoard::Encoder { pulses } => Sample::Encoder { pulses: pulses.into() },
                FromBoard::Adc { sample, .. } => Sample::Adc(sample),
            });
        });
        self.bytes.clear();
        truck.take_gyro_tx(&mut self.bytes);
        self.gyro.push(&self.bytes, |frame| samples.push(Sample::Gyro(frame.angles)));
        for sample in self.samples.drain(..) {
            self.outputs = self.controller.step(now, &sample);
        }
        let motor = self.outputs.pwm.motor;
        let (at, was) = *self.sent.get_or_insert_with(|| {
            truck.gyro_rx(&START_CONTINUOUS);
            (Stamp::ZERO, motor)
        });
        let stops = motor == PwmCount::NEUTRAL && was != motor;
        if stops || now.since_ms(at) >= 20 {
            truck.board_rx(self.writer.pwm(&self.outputs.pwm).as_bytes());
            self.sent = Some((now, motor));
        }
    }
}

/// One truck with its agent in a world of their own.
pub(crate) struct Bench {
    pub(crate) simulation: Simulation,
    pub(crate) agent: Agent,
}

impl Bench {
    pub(crate) fn new(world: World, parameters: &TruckParameters, start: MapPose, seed: u64) -> Self {
        let robots = [("xtb-1", start)];
        let simulation = Simulation::with_starts(world, parameters, &robots, seed).unwrap();
        Self { simulation, agent: Agent::new(VehicleConfig::default()) }
    }

    pub(crate) fn command(&mut self, command: Command) {
        self.agent.command(self.simulation.now(), command);
    }

    pub(crate) fn step(&mut self) {
        let now = self.simulation.now();
        self.agent.turn(now, &mut self.simulation.trucks_mut()[0]);
        self.simulation.step();
    }

    pub(crate) fn run_s(&mut self, seconds: f64) {
        (0..steps(seconds)).for_each(|_| self.step());
    }
}

/// Steps in so many seconds.
pub(crate) fn steps(seconds: f64) -> u64 {
    Stamp::from_s(seconds).ns() / STEP_NS
}

/// Pulses for a raw drive, with the steering as offset of the front from its centre, the rear
/// mirrored.
pub(crate) fn pulses(motor: u16, front_offset: i16) -> PwmOutputs {
    let neutral = PwmCount::NEUTRAL;
    PwmOutputs {
        motor: PwmCount::try_from(motor).unwrap(),
        steer_front: PwmCount::saturating(3710.0 + f64::from(front_offset)),
        steer_rear: PwmCount::saturating(4179.0 - f64::from(front_offset)),
        bumper_front: neutral,
        bumper_rear: neutral,
        pistons: [neutral; 4],
        spare: neutral,
    }
}

/// Sends the same pulses in every step.
pub(crate) fn drive(simulation: &mut Simulation, writer: &mut FrameWriter, pwm: &PwmOutputs, seconds: f64) {
    for _ in 0..steps(seconds) {
        for truck in simulation.trucks_mut() {
            truck.board_rx(writer.pwm(pwm).as_bytes());
        }
        simulation.step();
    }
}

/// What the board of a truck has sent since it was last asked.
pub(crate) fn board_frames(truck: &mut Truck) -> Vec<FromBoard> {
    let (mut bytes, mut frames) = (Vec::new(), Vec::new());
    truck.take_board_tx(&mut bytes);
    // The buffer may have dropped the head of its first frame.
    FrameReader::default().from_board(&bytes, |frame| frames.extend(frame.ok()));
    frames
}
