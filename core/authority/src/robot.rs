//! One robot without its I/O: brain, controller and line codecs, turned by whoever owns the clock.
//!
//! The whole of the walk "a sample up" between the serial port and Zenoh: bytes in, PWM frame out.
//! `robot-agent` turns it against real time, the simulator in lockstep.

use crate::agent::{Agent, Arrival, Identity, View};
use crate::inputs::INPUT_LOST_MS;
use xtb_control::controller::AdcSample;
use xtb_control::{Controller, Outputs, PwmCount, Sample, Stamp, VehicleConfig};
use xtb_protocol::board::{Frame, FrameReader, FrameWriter, FromBoard};
use xtb_protocol::gyro_3dmg::EulerReader;
use xtb_protocol::keys::Name;
use xtb_protocol::messages::{
    InputAges, ObstacleView, Rejected, Reply, Request, RobotState, Sensors, TiltState,
};

/// Length of a turn.
pub const TURN_NS: u64 = 5_000_000;
/// A PWM frame goes out this often, and at once when the motor becomes neutral.
pub const PWM_FRAME_NS: u64 = 20_000_000;

#[derive(Debug, Clone, Copy, Default)]
struct Heard {
    gyro: Option<Stamp>,
    encoder: Option<Stamp>,
    adc: Option<Stamp>,
}

/// Brain and controller of one robot.
#[derive(Debug, Clone)]
pub struct Robot {
    agent: Agent,
    controller: Controller,
    outputs: Outputs,
    board: FrameReader,
    gyro: EulerReader,
    writer: FrameWriter,
    next_frame: Stamp,
    sent_motor: PwmCount,
    heard: Heard,
    gyro_yaw: i16,
    pulses: u16,
    adc: Option<AdcSample>,
    battery_mv: Option<u16>,
    state_seq: u64,
}

impl Robot {
    /// A robot at boot. `vehicle` must have passed its validation.
    #[must_use]
    pub fn new(identity: Identity, vehicle: VehicleConfig, version: &str) -> Self {
        let agent = Agent::new(identity, &vehicle, version);
        let mut controller = Controller::new(vehicle);
        let outputs = controller.step(Stamp::ZERO, &Sample::Command(xtb_control::Command::Idle));
        Self {
            agent,
            controller,
            outputs,
            board: FrameReader::default(),
            gyro: EulerReader::default(),
            writer: FrameWriter::default(),
            next_frame: Stamp::ZERO,
            sent_motor: PwmCount::NEUTRAL,
            heard: Heard::default(),
            gyro_yaw: 0,
            pulses: 0,
            adc: None,
            battery_mv: None,
            state_seq: 0,
        }
    }

    /// Bytes from the I/O board, read at `now`; each sample among them takes one controller step.
    pub fn board_bytes(&mut self, now: Stamp, bytes: &[u8]) {
        let Self { board, controller, outputs, heard, pulses, adc, battery_mv, .. } = self;
        board.from_board(bytes, |frame| match frame {
            Ok(FromBoard::Encoder { pulses: counted }) => {
                heard.encoder = Some(now);
                *pulses = counted;
                *outputs = controller.step(now, &Sample::Encoder { pulses: u32::from(counted) });
            }
            Ok(FromBoard::Adc { sample, battery_mv: battery }) => {
                heard.adc = Some(now);
                *adc = Some(sample);
                *battery_mv = battery;
                *outputs = controller.step(now, &Sample::Adc(sample));
            }
            Err(_) => {} // the reader counts it
        });
    }

    /// Bytes from the gyro, read at `now`.
    pub fn gyro_bytes(&mut self, now: Stamp, bytes: &[u8]) {
        let Self { gyro, controller, outputs, heard, gyro_yaw, .. } = self;
        gyro.push(bytes, |frame| {
            heard.gyro = Some(now);
            *gyro_yaw = frame.angles.yaw;
            *outputs = controller.step(now, &Sample::Gyro(frame.angles));
        });
    }

    /// One request of a client.
    pub fn request(&mut self, now: Stamp, arrival: Arrival, client: &Name, request: &Request) -> Reply {
        let ages = self.ages(now);
        self.agent.request(now, arrival, client, request, View { outputs: &self.outputs, ages })
    }

    /// One turn, each [`TURN_NS`]: the frame for the board, if one is due.
    pub fn turn(&mut self, now: Stamp) -> Option<Frame> {
        let view = View { outputs: &self.outputs, ages: self.ages(now) };
        if let Some(command) = self.agent.turn(now, view) {
            self.outputs = self.controller.step(now, &Sample::Command(command));
        }
        let motor = self.outputs.pwm.motor;
        let became_neutral = motor == PwmCount::NEUTRAL && self.sent_motor != PwmCount::NEUTRAL;
        if now < self.next_frame && !became_neutral {
            return None;
        }
        self.sent_motor = motor;
        self.next_frame = now.plus_ns(PWM_FRAME_NS);
        Some(self.writer.pwm(&self.outputs.pwm))
    }

    /// Whether the gyro should be asked to start: nothing has been heard of it for 200 ms.
    #[must_use]
    pub fn gyro_is_silent(&self, now: Stamp) -> bool {
        self.ages(now).gyro.is_none_or(|ms| ms > INPUT_LOST_MS)
    }

    /// Motor neutral and wheels straight, for the last frame before the agent ends.
    pub fn neutral_frame(&mut self, now: Stamp) -> Frame {
        self.outputs = self.controller.step(now, &Sample::Command(xtb_control::Command::Idle));
        self.writer.pwm(&self.outputs.pwm)
    }

    /// The brain.
    #[must_use]
    pub fn agent(&self) -> &Agent {
        &self.agent
    }

    /// The brain, to take events from or to tell of the link.
    pub fn agent_mut(&mut self) -> &mut Agent {
        &mut self.agent
    }

    /// The controller's last outputs.
    #[must_use]
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// The vehicle's constants in force.
    #[must_use]
    pub fn vehicle(&self) -> &VehicleConfig {
        self.controller.config()
    }

    fn ages(&self, now: Stamp) -> InputAges {
        let age = |heard: Option<Stamp>| heard.map(|at| now.since_ms(at));
        InputAges {
            gyro: age(self.heard.gyro),
            encoder: age(self.heard.encoder),
            adc: age(self.heard.adc),
            setpoint: self.agent.setpoint_age_ms(now),
        }
    }

    /// The state at `now`. `rejected` brings what the links outside have counted.
    pub fn state(&mut self, now: Stamp, rejected: Rejected) -> RobotState {
        let ages = self.ages(now);
        let view = View { outputs: &self.outputs, ages };
        let fresh = |age: Option<u64>| age.is_some_and(|ms| ms <= INPUT_LOST_MS);
        let seen = |side: bool| fresh(ages.adc).then_some(side);
        let board = self.board.counters();
        let seq = self.state_seq;
        self.state_seq += 1;
        RobotState {
            robot: self.agent.identity().robot.clone(),
            epoch: self.agent.identity().epoch,
            seq,
            tick_ms: now.ms(),
            mode: self.outputs.mode,
            lease: self.agent.lease().state(now),
            pose: self.agent.pose(view),
            speed_mps: fresh(ages.encoder).then(|| self.outputs.rpm * self.controller.config().mps_per_rpm()),
            reference_rpm: self.outputs.reference_rpm,
            steering: self.outputs.steering,
            obstacle: ObstacleView {
                front: seen(self.outputs.obstacle.front),
                rear: seen(self.outputs.obstacle.rear),
            },
            tilt_deg: TiltState::default(),
            battery_v: self.battery_mv.filter(|_| fresh(ages.adc)).map(|mv| f64::from(mv) / 1000.0),
            goal: self.agent.goal().map(|goal| goal.state()),
            latches: Vec::new(),
            stopped_because: self.agent.stopped_because(view),
            input_age_ms: ages,
            rejected: Rejected {
                refused: self.agent.refused,
                stale: self.agent.stale,
                events_dropped: self.agent.events_dropped + rejected.events_dropped,
                board_frames: board.rejected,
                board_lost: board.lost,
                gyro_bytes: self.gyro.skipped,
                ..rejected
            },
        }
    }

    /// The last samples; `None` until the converter has been heard.
    #[must_use]
    pub fn sensors(&self, now: Stamp) -> Option<Sensors> {
        let adc = self.adc?;
        let counts = |side: &[xtb_control::AdcCount; 6]| side.map(|count| count.get() as u16);
        let pwm = &self.outputs.pwm;
        Some(Sensors {
            robot: self.agent.identity().robot.clone(),
            tick_ms: now.ms(),
            gyro_yaw: self.gyro_yaw,
            encoder_pulses: self.pulses,
            ir_front: counts(&adc.ir_front),
            ir_rear: counts(&adc.ir_rear),
            ir_front_cm: self.outputs.ir_front_cm,
            ir_rear_cm: self.outputs.ir_rear_cm,
            rpm: self.outputs.rpm,
            motor_counts: pwm.motor.get(),
            steer_front_counts: pwm.steer_front.get(),
            steer_rear_counts: pwm.steer_rear.get(),
        })
    }
}
