//! One robot without its I/O: brain, controller and line codecs, turned by whoever owns the clock.
//!
//! The whole of the path of a sample (docs/paths.md) between the serial port and Zenoh: bytes in, frames out.
//! `robot-agent` turns it against real time, the simulator in lockstep.
//!
//! ```text
//!   board bytes ─► line watch ─► frames ─► set-up gate (Fig. 8) ─┐
//!     (with those of a BNO085)                                   │
//!   gyro bytes ──► line watch ─► frames ─────────────────────────┼─► Controller::step ─► step_log
//!   requests, setpoints ─► Agent ─► at most one Command a turn ──┘        │
//!   PWM, set-up, channel reset, gyro start ◄──────────────────────────────┘
//! ```

mod ask;
mod early;
mod guards;
mod inputs;
mod lines;
mod views;
mod watch;

use crate::agent::{Agent, Arrival, RobotIdentity, STICK_NEUTRAL_COUNTS, TurnView};
use crate::authority::guard::{Guard, Guards};
use crate::faults::INPUT_LOST_MS;
use crate::line::{Device, LineWatch};
use crate::monitor::Monitors;
use crate::motion::MotionTracker;
use crate::step_log::{Step, StepLog};
use xtb_control::controller::{AdcSample, GyroSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, SetupTask, TpuSetup, WATCHDOG_MS};
use xtb_control::vehicle::Imu;
use xtb_control::{Command, Controller, Outputs, PwmCount, Sample, Stamp, VehicleConfig};
use xtb_protocol::bno085::Bno085Counter;
use xtb_protocol::board::rates::PWM_EVERY_S;
use xtb_protocol::board::{BoardStatus, Frame, FrameReader, FrameWriter};
use xtb_protocol::gyro_3dmg::{GyroReader, GyroStarter, START_CONTINUOUS};
use xtb_protocol::keys::Name;
use xtb_protocol::messages::{InputAges, ParamReply, ParamRequest, Reply, Request};

pub use views::Readings;

use ask::Asker;
use early::EarlyFrames;
use lines::{Bno085Link, BoardLine, GyroLine};

/// Length of a turn: half of the gyro's period, which comes most often, so that no sample waits for longer.
pub const TURN_NS: u64 = 5_000_000;
/// A PWM frame goes out this often: one for each PWM period of 22.2 ms, and five within the board's watchdog.
/// One goes at once when the motor becomes neutral, and when a new setpoint turns the wheels (`robot/early.rs`).
pub const PWM_FRAME_NS: u64 = (PWM_EVERY_S * 1e9) as u64;
/// A turn that is this late: the board's watchdog may have stopped the truck meanwhile, since the last frame
/// may be older than the last turn by the time between two; so what was under way is over.
pub const LOOP_STALL_MS: u64 = WATCHDOG_MS as u64 - PWM_FRAME_NS / 1_000_000;

#[derive(Debug, Clone, Copy, Default)]
struct Heard {
    gyro: Option<Stamp>,
    encoder: Option<Stamp>,
    adc: Option<Stamp>,
    remote: Option<Stamp>,
    board: Option<Stamp>,
}

/// The newest samples as they came.
#[derive(Debug, Clone, Copy, Default)]
struct Newest {
    gyro: GyroSample,
    pulses: u16,
    adc: Option<AdcSample>,
    battery_mv: Option<u16>,
    remote: RemoteSample,
    status: Option<BoardStatus>,
}

/// Brain and controller of one robot.
#[derive(Debug, Clone)]
pub struct Robot {
    agent: Agent,
    controller: Controller,
    outputs: Outputs,
    board: BoardLine,
    gyro: GyroLine,
    /// `None` = a 3DM-G is fitted.
    bno085: Option<Bno085Link>,
    setup: SetupTask,
    asker: Asker,
    reset: ResetMask,
    writer: FrameWriter,
    next_frame: Stamp,
    /// The pulses of the last frame.
    sent: PwmOutputs,
    early: EarlyFrames,
    heard: Heard,
    newest: Newest,
    step_log: StepLog,
    recording_failed: bool,
    state_seq: u64,
    /// When the next frame of the receiver counts as missing; `None` = there is no receiver.
    remote_due: Option<Stamp>,
    /// The speed stick must be seen neutral before it drives: at boot, and after the board was lost.
    stick_held: bool,
    /// What the controller was told last of how near an obstacle is.
    obstacle_cm: f64,
    /// The last turn, and since when the motor's pulse is neutral.
    turned: Option<Stamp>,
    neutral_since: Option<Stamp>,
    /// The worst delay of a turn since the last state.
    late_ns: u64,
    /// Turns that came a whole turn late.
    turns_late: u64,
    monitors: Monitors,
    guards: Guards,
    motion: MotionTracker,
}

impl Robot {
    /// A robot at boot. `vehicle` must have passed its validation; one whose channel map has not is
    /// never set up, so it stands.
    #[must_use]
    pub fn new(identity: RobotIdentity, vehicle: VehicleConfig, version: &str) -> Self {
        let agent = Agent::new(identity, &vehicle, version);
        let setup = TpuSetup::of(&vehicle).unwrap_or(TpuSetup {
            pwm_period_counts: 0,
            tcr_prescaler: 0,
            fqm_window: 0,
            watchdog_ms: 0,
            channels: [0; xtb_control::tpu::PINS],
        });
        let bno085 = (vehicle.imu == Imu::Bno085Rvc).then(|| Bno085Link {
            yaw: vehicle.imu_yaw,
            counter: Bno085Counter::default(),
            yaw_cdeg: 0,
        });
        let obstacle_cm = vehicle.obstacle.threshold_cm;
        let controller = Controller::new(vehicle);
        let outputs = controller.outputs(Stamp::ZERO);
        Self {
            agent,
            sent: outputs.pwm,
            outputs,
            controller,
            board: BoardLine {
                watch: LineWatch::new(Device::Board, Stamp::ZERO),
                reader: FrameReader::default(),
                foreign: GyroReader::default(),
                detail: None,
                refused: None,
                other_layout: None,
                has_stop: false,
                open_since: Stamp::ZERO,
                speaks_since: Stamp::ZERO,
                fed: false,
                starved: None,
                excused_until: Stamp::ZERO,
            },
            gyro: GyroLine {
                watch: LineWatch::new(Device::Gyro, Stamp::ZERO),
                reader: GyroReader::default(),
                foreign: FrameReader::default(),
                starter: GyroStarter::default(),
                detail: bno085.is_some().then(|| "BNO085 at the I/O board".into()),
            },
            bno085,
            setup: SetupTask::new(setup),
            asker: Asker::default(),
            reset: ResetMask::default(),
            writer: FrameWriter::default(),
            next_frame: Stamp::ZERO,
            early: EarlyFrames::default(),
            heard: Heard::default(),
            newest: Newest::default(),
            step_log: StepLog::default(),
            recording_failed: false,
            state_seq: 0,
            remote_due: None,
            stick_held: true,
            obstacle_cm,
            turned: None,
            neutral_since: Some(Stamp::ZERO),
            late_ns: 0,
            turns_late: 0,
            monitors: Monitors::default(),
            guards: Guards::default(),
            motion: MotionTracker::default(),
        }
    }

    /// The only place where the controller takes a step.
    fn step(&mut self, now: Stamp, sample: &Sample) {
        let before = self.outputs.pose;
        self.controller.step_over(now, sample, &mut self.outputs);
        self.reset = self.reset.or(self.outputs.reset);
        if self.outputs.rezeroed {
            self.agent.rezeroed(&before, &self.outputs.pose);
            self.motion.step(now, &before, false);
            self.motion.step(now, &self.outputs.pose, true);
        }
        self.step_log.push(now, sample, &self.outputs);
    }

    /// One request of a client.
    pub fn request(&mut self, now: Stamp, arrival: Arrival, client: &Name, request: &Request) -> Reply {
        let ages = self.ages(now);
        let view = TurnView {
            outputs: &self.outputs,
            ages,
            neutral: self.neutral_since.is_some(),
            over_speed: self.over_speed(),
        };
        self.agent.request(now, arrival, client, request, view)
    }

    /// One question of a client about settings that may change, or a change of them.
    pub fn param(&mut self, now: Stamp, client: &Name, request: &ParamRequest) -> ParamReply {
        let ages = self.ages(now);
        let view = TurnView {
            outputs: &self.outputs,
            ages,
            neutral: self.neutral_since.is_some(),
            over_speed: self.over_speed(),
        };
        self.agent.param(now, client, request, view)
    }

    /// One turn, each [`TURN_NS`], or sooner for what must not wait that long: the PWM frame for the board, if
    /// one is due.
    pub fn turn(&mut self, now: Stamp) -> Option<Frame> {
        self.watch_loop(now);
        self.miss_remote(now);
        let line_fault = self.board.watch.fault(now);
        if !self.setup.is_done() || line_fault.is_some() {
            self.board.speaks_since = now;
        }
        if line_fault.is_some() && self.guards.on(Guard::LineLost) {
            self.lose_remote(now);
        }
        if self.obstacle_cm != self.agent.obstacle_cm() {
            self.obstacle_cm = self.agent.obstacle_cm();
            self.step(now, &Sample::Obstacle { threshold_cm: self.obstacle_cm });
        }
        let gyro_fault = self.gyro_fault(now, line_fault);
        self.agent.set_faults(now, &self.faults(now, line_fault, gyro_fault));
        let (ages, neutral) = (self.ages(now), self.neutral_since.is_some());
        let view = TurnView { outputs: &self.outputs, ages, neutral, over_speed: self.over_speed() };
        let command = self.agent.turn(now, view);
        if let Some(command) = command {
            self.step(now, &Sample::Command(command));
        }
        // A reset moves nothing: a stick that was held through the latch has to be let go.
        self.stick_held |= self.agent.take_stick_to_rest();
        let pwm = self.pulses();
        let motor = pwm.motor;
        // Within the dead band of the ESC nothing moves: a stick at rest is never quite neutral.
        let offset_counts = f64::from(motor.get().abs_diff(PwmCount::NEUTRAL.get()));
        let stands = offset_counts <= STICK_NEUTRAL_COUNTS;
        self.neutral_since = stands.then(|| self.neutral_since.unwrap_or(now));
        let became_neutral = motor == PwmCount::NEUTRAL && self.sent.motor != PwmCount::NEUTRAL;
        // Its speed is the PID's (§4.7): the next encoder window decides the motor's pulse.
        let steers = matches!(command, Some(Command::Teleop { .. }))
            && (pwm.steer_front, pwm.steer_rear) != (self.sent.steer_front, self.sent.steer_rear);
        let due = now >= self.next_frame || became_neutral || (steers && self.early.admit(now));
        if due {
            self.sent = pwm;
        }
        self.watch_drive(self.sent.motor);
        if !due {
            return None;
        }
        self.next_frame = now.plus_ns(PWM_FRAME_NS);
        Some(self.writer.pwm(&pwm))
    }

    /// What else the board has to be told after a turn: its set-up (Fig. 8), what it is asked for, or the channels
    /// to reset (Fig. 9). Ask until there is nothing.
    pub fn board_request(&mut self, now: Stamp) -> Option<Frame> {
        if self.board.refused.is_none()
            && let Some(setup) = self.setup.request(now)
        {
            return Some(self.writer.setup(&setup));
        }
        if let Some(ask) = self.ask(now) {
            return Some(self.writer.ask(ask));
        }
        let reset = std::mem::take(&mut self.reset);
        reset.any().then(|| self.writer.reset(reset))
    }

    /// What the gyro has to be told after a turn.
    pub fn gyro_request(&mut self, now: Stamp) -> Option<&'static [u8]> {
        if self.bno085.is_some() {
            return None; // there is no such line
        }
        let silent = self.ages(now).gyro.is_none_or(|ms| ms > INPUT_LOST_MS);
        let command = self.gyro.starter.request(now, silent);
        if command == Some(&START_CONTINUOUS) {
            // It had been told to stop, or was off: its clock says nothing about lost frames.
            self.gyro.reader.forget();
        }
        command
    }

    /// Keeps every step for [`Robot::take_step`].
    pub fn record_steps(&mut self) {
        self.step_log.start();
    }

    /// The oldest step on the step_log.
    pub fn take_step(&mut self) -> Option<Step> {
        self.step_log.take()
    }

    /// Whether the recorder fails: a fault that people can see.
    pub fn set_recording_failed(&mut self, failed: bool) {
        self.recording_failed = failed;
    }

    /// A turn began this much after its time.
    pub fn turn_was_late(&mut self, ns: u64) {
        self.late_ns = self.late_ns.max(ns);
        self.turns_late += u64::from(ns > TURN_NS);
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
            remote: age(self.heard.remote),
            setpoint: self.agent.setpoint_age_ms(now),
        }
    }
}
