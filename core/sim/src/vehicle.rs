//! One simulated truck: bytes from the agent in, motion, bytes to the agent out.
//!
//! ```text
//!   transmitter ─► receiver ─┐
//!   board_rx ──────────────► board ─► steering servos ─┐
//!                              │  └─► ESC and motor  ──┴─► pose ─► range finders ─┐
//!                              ├────► bumper servos ──────────────────► (tilt) ───┤
//!                              └────► pistons ─► platform ─► tilt sensor ─────────┴─► board ─► take_board_tx
//!   gyro_rx ────────────────────────────────────────────► gyro ─────────────────────────────► take_gyro_tx
//!                                                 or a BNO085 ─► board
//! ```
//! Four-wheel-steered bicycle: the longitudinal speed u is common to both axles, an axle whose
//! wheels are turned by δ moves sideways by u tan δ, so the heading turns (clockwise) at
//! u (tan δ_front − tan δ_rear) / L. With both axles steered oppositely the radius is
//! R = L / (2 tan δ); the rear wheels of a front-steered car stand straight. Poses are those of the
//! reference point ([`Drivetrain`](xtb_control::vehicle::Drivetrain)).

mod motion;
mod pins;

use crate::bno085::Bno085;
use crate::board::{self, Board, ShaftTravel};
use crate::calibration::CalibrationTruth;
use crate::converter::Sums;
use crate::drive::{Battery, Drive};
use crate::external::External;
use crate::faults::{DriveFault, InjectedLineFault, LineFaults, SensorFaults};
use crate::geometry::OrientedBox;
use crate::gyro::{Attitude, Gyro};
use crate::hands::Hands;
use crate::impostors::Impostors;
use crate::infrared::RangeFinders;
use crate::lattice::footprint;
use crate::parameters::{Body, InstrumentTruth, TruckParameters};
use crate::platform::Platform;
use crate::receiver::Transmitter;
use crate::rng::Rng;
use crate::scene::StepContext;
use crate::servos::{BumperServo, SteeringAxle};
use crate::step::STEP_S;
use std::f64::consts::PI;
use xtb_control::calibration::Measured;
use xtb_control::controller::AdcSample;
use xtb_control::frames::{MapPose, wrap_rad};
use xtb_control::units::Stamp;
use xtb_control::vehicle::{Imu, SLOTS};
use xtb_protocol::board::LineCounters;
use xtb_protocol::messages::TruthRobot;

/// A simulated truck; see the module's documentation.
#[derive(Debug, Clone)]
pub struct Truck {
    index: usize,
    name: String,
    dimensions: Body,
    now: Stamp,
    noise: Rng,

    board: Board,
    external: Option<External>,
    gyro: Gyro,
    /// Fitted in place of the gyro.
    bno085: Option<Bno085>,
    emergency_stop: bool,
    front: SteeringAxle,
    rear: SteeringAxle,
    bumpers: [BumperServo; 2],
    drive: Drive,
    battery: Battery,
    platform: Platform,
    sums: Sums,
    range_finders: RangeFinders,

    yaw_rad: f64,
    body: OrientedBox,
    speed_mps: f64,
    /// The centre of the body goes no faster than this times the reference point.
    swings: f64,
    /// Sine of the slope under the truck towards +x and +y.
    rise: (f64, f64),
    /// Turns of the motor shaft in pulses, since the start; never backwards.
    pulses: f64,
    pulses_per_m: f64,

    contacts: u64,
    touching: bool,
    ran_into: Vec<usize>,

    instruments: InstrumentTruth,
    instrument_noise: Rng,
    impostors: Impostors,
    sensor_faults: SensorFaults,
    hands: Hands,
    /// The last scan, as a converter that freezes shows it.
    scan: Option<(AdcSample, u16)>,
}

impl Truck {
    /// Its individual values come from `seed` and its number alone.
    pub(crate) fn new(
        index: usize,
        name: &str,
        start: &MapPose,
        parameters: &TruckParameters,
        seed: u64,
    ) -> Self {
        let mut noise = Rng::new(seed, index as u64);
        let encoder = &parameters.encoder;
        let scale = 1.0 + noise.uniform(-encoder.scale_tolerance, encoder.scale_tolerance);
        let pulses_per_turn = encoder.pulses_per_rev * encoder.gear_ratio;
        let steering = &parameters.steering;
        let mut axle = |centre| SteeringAxle::new(steering, centre, STEP_S, &mut noise);
        let (front, rear) = (axle(steering.front_centre), axle(steering.rear_centre));
        let mut bumper = || BumperServo::new(&parameters.bumper, STEP_S, &mut noise);
        let bumpers = [bumper(), bumper()];
        Self {
            index,
            name: name.to_owned(),
            dimensions: parameters.body.clone(),
            now: Stamp::ZERO,
            board: Board::new(parameters, &mut noise),
            external: None,
            gyro: Gyro::new(&parameters.gyro, &mut noise),
            bno085: (parameters.gyro.imu == Imu::Bno085Rvc)
                .then(|| Bno085::new(&parameters.gyro, Rng::new(seed ^ 0xB085_0000, index as u64))),
            emergency_stop: false,
            front,
            rear,
            bumpers,
            drive: Drive::new(&parameters.drive, STEP_S),
            battery: Battery::new(&parameters.battery),
            platform: Platform::new(&parameters.platform, &parameters.body, &mut noise),
            sums: Sums::default(),
            range_finders: RangeFinders::new(
                &parameters.infrared,
                &parameters.range_finders,
                &parameters.body,
                &mut noise,
            ),
            yaw_rad: wrap_rad(start.yaw_rad),
            body: footprint(start, &parameters.body),
            speed_mps: 0.0,
            swings: swings(parameters),
            rise: (0.0, 0.0),
            pulses: 0.0,
            pulses_per_m: pulses_per_turn / (PI * encoder.wheel_diameter_m * scale),
            contacts: 0,
            touching: false,
            ran_into: Vec::with_capacity(8),
            instruments: parameters.instruments.clone(),
            instrument_noise: noise.fork(),
            impostors: Impostors::default(),
            sensor_faults: SensorFaults::default(),
            hands: Hands::default(),
            scan: None,
            noise,
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its number in the simulation.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index
    }

    /// What is really so.
    #[must_use]
    pub fn truth(&self) -> TruthRobot {
        let (x_m, y_m) = self.reference_m();
        TruthRobot {
            x_m,
            y_m,
            yaw_rad: self.yaw_rad,
            speed_mps: self.speed_mps,
            motor_counts: self.board.outputs().motor.get(),
            neutral_since_s: self.board.neutral_since().map(Stamp::s),
            contacts: self.contacts,
        }
    }

    /// The lines that a calibration has to find.
    #[must_use]
    pub fn calibration_truth(&self) -> CalibrationTruth {
        CalibrationTruth {
            steering: [self.front.line(), self.rear.line()],
            bumpers: [self.bumpers[0].line(), self.bumpers[1].line()],
            pistons: self.platform.lines(),
        }
    }

    /// What a person with a protractor reads off the truck now, errors included. Measuring changes
    /// nothing about the truck.
    pub fn measured(&mut self) -> Measured {
        let noise = &mut self.instrument_noise;
        let (wheel_deg, bumper_deg) = (self.instruments.wheel_noise_deg, self.instruments.bumper_noise_deg);
        Measured {
            steering_deg: [&self.front, &self.rear].map(|axle| axle.wheels_deg() + noise.bell(wheel_deg)),
            bumpers_deg: [0, 1].map(|i: usize| self.bumpers[i].angle_deg() + noise.bell(bumper_deg)),
        }
    }

    /// Steps so far in which a piston was at its mechanical end and driven on by more than its dead
    /// band.
    #[must_use]
    pub fn end_stop_pushes(&self) -> u64 {
        self.platform.end_stop_pushes()
    }

    /// What the person with the R/C transmitter does from now on; ignored by a truck without a
    /// receiver.
    pub fn set_transmitter(&mut self, transmitter: Transmitter) {
        self.board.set_transmitter(transmitter);
    }

    /// Switches the I/O board off and on again: all outputs neutral at once, until the next set-up.
    pub fn power_cycle_board(&mut self) {
        self.board.power_cycle(self.now);
    }

    /// Breaks or mends the lines to the agent.
    pub fn set_line_faults(&mut self, faults: LineFaults) {
        self.board.outbox().set_fault(faults.board);
        self.gyro.outbox().set_fault(faults.gyro);
        if let Some(unit) = &mut self.bno085 {
            unit.set_line_fault(faults.gyro);
        }
    }

    /// Breaks or mends its sensors.
    pub fn set_sensor_faults(&mut self, faults: SensorFaults) {
        self.sensor_faults = faults;
        self.range_finders.set_faults(&faults.range_finders);
        self.gyro.set_fault(faults.gyro);
        if let Some(unit) = &mut self.bno085 {
            unit.set_fault(faults.gyro);
        }
        self.board.set_encoder_fault(faults.encoder);
    }

    /// The person beside it presses its emergency stop, or releases it. The board holds motor and pistons, and says
    /// so; that the switch cuts the power of the ESC by itself is the same motor at rest.
    pub fn set_emergency_stop(&mut self, pressed: bool) {
        self.emergency_stop = pressed;
        if self.external.is_none() {
            self.board.set_emergency_stop(pressed);
        }
    }

    /// Breaks or mends its drive.
    pub fn set_drive_fault(&mut self, fault: DriveFault) {
        self.drive.set_fault(fault);
    }

    /// What a person's hands do to it from now on.
    pub fn set_hands(&mut self, hands: Hands) {
        self.hands = hands;
    }

    /// From now on so much of the battery's charge is left, 0..=1.
    pub fn set_battery_left(&mut self, left: f64) {
        self.battery.set_left(left);
    }

    /// How much of the battery's charge is left, 0..=1.
    #[must_use]
    pub fn battery_left(&self) -> f64 {
        self.battery.left()
    }

    /// Voltage at the battery's terminals, in V.
    #[must_use]
    pub fn battery_v(&self) -> f64 {
        self.battery.volts()
    }

    /// What its range finders show, front, then rear, eight of each, left to right, in V; 0 where none is fitted.
    #[must_use]
    pub fn range_finder_volts(&self) -> [f64; 2 * SLOTS] {
        self.range_finders.volts()
    }

    /// Bytes from the agent to the I/O board: set-up, PWM and reset frames.
    pub fn board_rx(&mut self, bytes: &[u8]) {
        match &mut self.external {
            Some(external) => external.receive(bytes),
            None => self.board.rx(bytes, self.now, &mut self.noise),
        }
    }

    /// Moves everything that the board has sent to the end of `into`.
    pub fn take_board_tx(&mut self, into: &mut Vec<u8>) {
        self.board.outbox().take(into);
    }

    /// Bytes from the agent to the gyro: `10 00 0E`, `10 00 00`, `0E`, `F0`. A truck with a BNO085 has no such line.
    pub fn gyro_rx(&mut self, bytes: &[u8]) {
        if self.bno085.is_some() {
            return;
        }
        let attitude = self.attitude();
        self.gyro.rx(bytes, self.now, &attitude, &mut self.noise);
    }

    /// Moves everything that the gyro has sent to the end of `into`.
    pub fn take_gyro_tx(&mut self, into: &mut Vec<u8>) {
        self.gyro.outbox().take(into);
    }

    /// Bytes that board and gyro had to drop because nobody took them.
    #[must_use]
    pub fn dropped_bytes(&self) -> u64 {
        self.board.dropped() + self.gyro.dropped()
    }

    /// What the board has seen of the agent's frames.
    #[must_use]
    pub fn board_counters(&self) -> LineCounters {
        self.board.counters()
    }

    /// What stands around has changed.
    pub(crate) fn look_again(&mut self) {
        self.range_finders.look_again();
    }

    /// One step, once for each context; it must come from [`crate::Simulation::split_step`] of the
    /// simulation that the truck belongs to. Allocates nothing.
    pub fn step(&mut self, context: &StepContext<'_>) {
        if self.external.is_none() {
            self.board.latch(context.start());
        }
        self.move_servos();
        let from_pulses = self.pulses;
        self.roll(context);
        self.now = context.now();
        let travel =
            ShaftTravel { start: context.start(), end: self.now, from_pulses, to_pulses: self.pulses };
        let stretch = [self.bumpers[0].stretch(), self.bumpers[1].stretch()];
        self.range_finders.step(context, self.index, &self.body, stretch, &mut self.noise);
        let attitude = self.attitude();
        let imu = self.bno085.as_mut().and_then(|unit| unit.step(self.now, &attitude));
        if self.external.is_some() {
            self.step_external(&travel, &attitude, imu.as_ref());
        } else {
            if let Some(sample) = &imu {
                self.board.pass_on(sample);
            }
            self.board.count(&travel);
            if self.board.scan_due(self.now) {
                self.send_scan(&attitude);
            }
            if self.board.is_set_up() {
                self.sums.step(&self.platform, &attitude);
            }
            self.board.report(self.now, &mut self.noise);
        }
        self.gyro.step(self.now, &attitude, &mut self.noise);
        self.swap_lines(&attitude);
    }

    /// Where the reference point is.
    fn reference_m(&self) -> (f64, f64) {
        let ((x_m, y_m), (cos, sin)) = (self.body.centre_m(), self.body.direction());
        let middle_m = self.dimensions.middle_m();
        (x_m - cos * middle_m, y_m - sin * middle_m)
    }

    pub(crate) fn body(&self) -> OrientedBox {
        self.body
    }

    pub(crate) fn dimensions(&self) -> &Body {
        &self.dimensions
    }

    /// It sees nothing farther than this from its centre.
    pub(crate) fn sight_m(&self) -> f64 {
        self.range_finders.sight_m()
    }

    /// Its centre goes no farther in so many steps where no slope has a larger sine than this: the reference point
    /// no faster than the wheels roll, and the centre swings about it.
    pub(crate) fn farthest_m(&self, steps: u64, steepest: f64) -> f64 {
        self.drive.farthest_m(steps, steepest) * self.swings
    }

    /// Trucks that stopped this one during the last step.
    pub(crate) fn ran_into(&self) -> &[usize] {
        &self.ran_into
    }

    /// Puts it elsewhere, standing and touching nothing.
    pub(crate) fn place(&mut self, pose: &MapPose) {
        self.yaw_rad = wrap_rad(pose.yaw_rad);
        self.body = footprint(pose, &self.dimensions);
        self.drive.halt();
        self.speed_mps = 0.0;
        self.touching = false;
        self.ran_into.clear();
    }

    /// Lets devices that hang on the wrong line send.
    fn swap_lines(&mut self, attitude: &Attitude) {
        let (board_line, gyro_line) = (self.board.outbox(), self.gyro.outbox());
        if board_line.fault() == InjectedLineFault::WrongDevice {
            self.impostors.on_board_line(self.now, attitude, board_line);
        }
        if gyro_line.fault() == InjectedLineFault::WrongDevice {
            self.impostors.on_gyro_line(self.now, board::FIRMWARE, gyro_line);
        }
    }

    fn send_scan(&mut self, attitude: &Attitude) {
        let (ir_front, ir_rear) = self.range_finders.readings();
        let (tilt, pistons) = self.sums.take(&self.platform, attitude);
        let sample = AdcSample { ir_front, ir_rear, tilt, pistons };
        let newest = (sample, self.battery.millivolts());
        let (sample, battery_mv) =
            self.scan.filter(|_| self.sensor_faults.converter_frozen).unwrap_or(newest);
        self.scan = Some((sample, battery_mv));
        self.board.send_scan(&sample, (!self.sensor_faults.battery_unmeasured).then_some(battery_mv));
    }
}

/// How much faster than the reference point the middle of the body goes on the tightest circle, at most.
fn swings(parameters: &TruckParameters) -> f64 {
    let (body, stop_deg) = (&parameters.body, parameters.steering.stop_deg);
    let lever_m = body.drivetrain.lever_m(body.wheelbase_m);
    libm::hypot(1.0, body.middle_m() / lever_m * libm::tan(stop_deg.to_radians()))
}
