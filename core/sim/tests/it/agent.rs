//! A small agent: what `robot-agent` does between the lines, in simulated time.

use xtb_control::controller::{Outputs, PwmOutputs};
use xtb_control::frames::MapPose;
use xtb_control::tpu::{ResetMask, SetupTask, TpuSetup};
use xtb_control::units::{PwmCount, Stamp};
use xtb_control::{Command, Controller, Sample, VehicleConfig};
use xtb_protocol::board::{FrameReader, FrameWriter, FromBoard};
use xtb_protocol::gyro_3dmg::{GyroFrame, GyroReader, START_CONTINUOUS};
use xtb_sim::{STEP_NS, Simulation, Truck, TruckParameters, World};

/// Drives one truck through its two lines, one turn a step.
pub(crate) struct Agent {
    controller: Controller,
    board: FrameReader,
    gyro: GyroReader,
    setup: SetupTask,
    /// The board's watchdog waits for a frame with a neutral motor.
    starved: bool,
    writer: FrameWriter,
    bytes: Vec<u8>,
    samples: Vec<Sample>,
    sent: Option<(Stamp, PwmCount)>,
    /// Pulses of the last window, until somebody takes them.
    pub(crate) window: Option<u16>,
    pub(crate) outputs: Outputs,
}

impl Agent {
    pub(crate) fn new(config: VehicleConfig) -> Self {
        let setup = TpuSetup::of(&config).unwrap();
        let mut controller = Controller::new(config);
        let outputs = controller.step(Stamp::ZERO, &Sample::Command(Command::Idle));
        Self {
            controller,
            board: FrameReader::default(),
            gyro: GyroReader::default(),
            setup: SetupTask::new(setup),
            starved: true,
            writer: FrameWriter::default(),
            bytes: Vec::new(),
            samples: Vec::new(),
            sent: None,
            window: None,
            outputs,
        }
    }

    pub(crate) fn command(&mut self, now: Stamp, command: Command) {
        self.outputs = self.controller.step(now, &Sample::Command(command));
    }

    /// Reads what came, lets the controller decide, sends a PWM frame every 20 ms and at once on
    /// neutral; sets the board up whenever it is not, and answers its watchdog.
    pub(crate) fn turn(&mut self, now: Stamp, truck: &mut Truck) {
        self.read_board(truck);
        self.read_gyro(truck);
        let mut reset = ResetMask::default();
        for sample in self.samples.drain(..) {
            self.outputs = self.controller.step(now, &sample);
            reset = reset.or(self.outputs.reset);
        }
        if let Some(setup) = self.setup.request(now) {
            truck.board_rx(self.writer.setup(&setup).as_bytes());
        }
        if reset.any() {
            truck.board_rx(self.writer.reset(reset).as_bytes());
        }
        let motor = if self.starved { PwmCount::NEUTRAL } else { self.outputs.pwm.motor };
        let (at, was) = *self.sent.get_or_insert_with(|| {
            truck.gyro_rx(&START_CONTINUOUS);
            (Stamp::ZERO, motor)
        });
        let stops = motor == PwmCount::NEUTRAL && was != motor;
        if stops || now.since_ms(at) >= 20 {
            truck.board_rx(self.writer.pwm(&PwmOutputs { motor, ..self.outputs.pwm }).as_bytes());
            self.sent = Some((now, motor));
        }
    }

    fn read_board(&mut self, truck: &mut Truck) {
        let Self { board, setup, samples, bytes, window, starved, .. } = self;
        bytes.clear();
        truck.take_board_tx(bytes);
        board.from_board(bytes, |frame| match frame.unwrap() {
            FromBoard::Encoder { pulses } => {
                samples.push(Sample::Encoder { pulses: pulses.into() });
                *window = Some(pulses);
            }
            FromBoard::Adc { sample, .. } => samples.push(Sample::Adc(sample)),
            FromBoard::Remote(sample) => samples.push(Sample::Remote(sample)),
            FromBoard::Status(status) => {
                *starved = status.watchdog;
                setup.confirm(status.ready, status.setup_checksum);
            }
            FromBoard::Identity(_) | FromBoard::Bno085(_) => panic!("nobody asked"),
        });
    }

    fn read_gyro(&mut self, truck: &mut Truck) {
        let Self { gyro, samples, bytes, .. } = self;
        bytes.clear();
        truck.take_gyro_tx(bytes);
        gyro.push(bytes, |frame| {
            if let GyroFrame::Euler(frame) = frame {
                samples.push(Sample::Gyro(frame.angles));
            }
        });
    }
}

/// One truck with its agent in a world of their own.
pub(crate) struct Bench {
    pub(crate) simulation: Simulation,
    pub(crate) agent: Agent,
}

impl Bench {
    pub(crate) fn new(world: World, parameters: &TruckParameters, start: MapPose, seed: u64) -> Self {
        Self::with_config(world, parameters, start, seed, VehicleConfig::default())
    }

    pub(crate) fn with_config(
        world: World,
        parameters: &TruckParameters,
        start: MapPose,
        seed: u64,
        config: VehicleConfig,
    ) -> Self {
        let robots = [("xtb-1", start)];
        let simulation = Simulation::with_starts(world, parameters, &robots, seed).unwrap();
        Self { simulation, agent: Agent::new(config) }
    }

    pub(crate) fn truck(&mut self) -> &mut Truck {
        &mut self.simulation.trucks_mut()[0]
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

/// A truck whose steering is exactly as printed: no deviations, no play.
pub(crate) fn exact_steering() -> TruckParameters {
    let mut parameters = TruckParameters::default();
    parameters.steering.play_deg = 0.0;
    parameters.steering.centre_tolerance_counts = 0.0;
    parameters.steering.slope_tolerance = 0.0;
    parameters
}

/// Sets every board up as the default configuration wants it, and ends its watchdog; again is harmless.
pub(crate) fn set_up(simulation: &mut Simulation, writer: &mut FrameWriter) {
    let setup = TpuSetup::of(&VehicleConfig::default()).unwrap();
    for truck in simulation.trucks_mut() {
        truck.board_rx(writer.setup(&setup).as_bytes());
        truck.board_rx(writer.pwm(&pulses(PwmCount::NEUTRAL.get(), 0)).as_bytes());
    }
}

/// Sets the boards up and sends the same pulses in every step.
pub(crate) fn drive(simulation: &mut Simulation, writer: &mut FrameWriter, pwm: &PwmOutputs, seconds: f64) {
    set_up(simulation, writer);
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
