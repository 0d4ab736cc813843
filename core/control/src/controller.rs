//! The first-level controller: one deterministic `step(sample) -> outputs`.
//!
//! Each stage of the memorandum (§5, Figs. 7–16) is a file beside this one and runs when its own
//! sample arrives; nothing here reads a clock, a file or a global. Same samples, same bits.
//!
//! ```text
//!              ┌── gyro ───► odometry yaw ──► A-to-B ────────┐ reference,
//!              ├── encoder ► rpm ► odometry ► speed PID      │ steering
//!   sample ────┼── adc ────► infrared ► obstacle             ├─► obstacle rule ─► wander timers ─► Outputs
//!              │         └─► tilt ► balance or platform PID  │   (motor neutral)
//!              ├── remote ─► manual, automatic, lost         │
//!              ├── command ► mode ───────────────────────────┘
//!              └── obstacle ► how near one is, from now on
//! ```
//!
//! Words: *reference* is what the mode demands in wheel rpm; *blocked* means that an obstacle lies
//! in its direction, which holds the motor neutral without clearing the reference; *stop* sets the
//! motor neutral at once and resets the PID. In mode manual the transmitter's counts go to motor and
//! steering as they are, but never into a detected obstacle (§4.3, §5.2); commands are then ignored.

use crate::balance::balance;
use crate::bumper::{BumperServo, bumper_servos};
use crate::goto::{GotoDecision, GotoStage};
use crate::infrared::{BumperRanges, bumper_ranges};
use crate::obstacle::{Bumper, ObstacleState};
use crate::odometry::Odometry;
use crate::pistons::standing;
use crate::platform_pid::PlatformPid;
use crate::remote::{RemoteStage, Selector, Stick};
use crate::speed::{AssumedDirection, SpeedPid, wheel_rpm};
use crate::tilt::{TiltAngles, tilt_angles};
use crate::tpu::ResetMask;
use crate::units::{PwmCount, Stamp, Steering};
use crate::vehicle::{Line, Obstacle, Platform, VehicleConfig};
use crate::wander::WanderStage;

pub use crate::remote::RemoteSample;
pub use crate::signals::{AdcSample, Command, GyroSample, Mode, Outputs, PwmOutputs, Sample};

/// The first level of TM 2004-262.
#[derive(Debug, Clone)]
pub struct Controller {
    config: VehicleConfig,
    mode: Mode,
    reference_rpm: f64,
    /// Front servo offset from its centre in counts, within the limits.
    steering_counts: f64,
    motor: PwmCount,
    speed: SpeedPid,
    direction: AssumedDirection,
    rpm: f64,
    odometry: Odometry,
    /// Signed way driven, in m: what a bumper counts as approach or retreat.
    travel_m: f64,
    front: Bumper,
    rear: Bumper,
    ir_front_cm: BumperRanges,
    ir_rear_cm: BumperRanges,
    obstacle: ObstacleState,
    goto: Option<GotoStage>,
    decision: Option<GotoDecision>,
    wander: Option<WanderStage>,
    remote: RemoteStage,
    /// What the speed stick commands in mode manual, as a pulse.
    stick: PwmCount,
    /// What it may drive at most where no range finder looks, as a pulse.
    crawl: PwmCount,
    reset: ResetMask,
    rezeroed: bool,
    tilt: TiltAngles,
    platform_pid: PlatformPid,
    piston_lines: [Line; 4],
    pistons: [PwmCount; 4],
    bumpers: [BumperServo; 2],
    /// The obstacle rule in force: that of the configuration, or from farther away.
    rule: Obstacle,
}

impl Controller {
    /// A truck that stands, centred, at pose 0. `config` should have passed
    /// [`VehicleConfig::validate`]; an invalid one gives wrong but still bounded outputs.
    #[must_use]
    pub fn new(config: VehicleConfig) -> Self {
        let piston_lines = config.calibration.pistons();
        Self {
            bumpers: bumper_servos(&config.bumpers, &config.calibration),
            piston_lines,
            pistons: piston_lines.map(standing),
            rule: config.obstacle.clone(),
            config,
            mode: Mode::Idle,
            reference_rpm: 0.0,
            steering_counts: 0.0,
            motor: PwmCount::NEUTRAL,
            speed: SpeedPid::default(),
            direction: AssumedDirection::default(),
            rpm: 0.0,
            odometry: Odometry::default(),
            travel_m: 0.0,
            front: Bumper::default(),
            rear: Bumper::default(),
            ir_front_cm: BumperRanges::default(),
            ir_rear_cm: BumperRanges::default(),
            obstacle: ObstacleState::default(),
            goto: None,
            decision: None,
            wander: None,
            remote: RemoteStage::default(),
            stick: PwmCount::NEUTRAL,
            crawl: PwmCount::NEUTRAL,
            reset: ResetMask::default(),
            rezeroed: false,
            tilt: TiltAngles::default(),
            platform_pid: PlatformPid::default(),
        }
    }

    /// The constants in force.
    #[must_use]
    pub fn config(&self) -> &VehicleConfig {
        &self.config
    }

    /// One sample in, everything decided out: its own stage, then the obstacle rule, then wander's
    /// timers, then the outputs. Allocates nothing.
    pub fn step(&mut self, t: Stamp, sample: &Sample) -> Outputs {
        self.take(t, sample);
        self.outputs(t)
    }

    /// As [`Controller::step`], over what the step before decided.
    pub fn step_over(&mut self, t: Stamp, sample: &Sample, outputs: &mut Outputs) {
        self.take(t, sample);
        self.put_outputs(t, outputs);
    }

    fn take(&mut self, t: Stamp, sample: &Sample) {
        (self.reset, self.rezeroed) = (ResetMask::default(), false);
        match sample {
            Sample::Gyro(gyro) => self.gyro(gyro),
            Sample::Encoder { pulses } => self.encoder(*pulses),
            Sample::Adc(adc) => self.adc(t, adc),
            Sample::Remote(remote) => self.remote(remote),
            Sample::Command(command) => self.command(command),
            Sample::Obstacle { threshold_cm } => {
                self.rule.threshold_cm = self.config.obstacle.threshold_cm.max(*threshold_cm);
            }
        }
        self.obstacle_rule(t);
        self.wander_timers(t);
    }

    fn gyro(&mut self, gyro: &GyroSample) {
        self.odometry.yaw(gyro.yaw);
        let Some(stage) = &mut self.goto else { return };
        let (decision, command) = stage.step(&self.config.goto, &self.odometry.pose());
        self.decision = Some(decision);
        if decision.arrived {
            self.goto = None;
            self.idle();
        } else {
            self.steer(command.steering_counts);
            self.demand(command.direction * self.config.goto.reference_rpm);
        }
    }

    fn encoder(&mut self, pulses: u32) {
        let speed = &self.config.speed;
        let may_drive = self.direction.admit(speed, self.demanded(), pulses);
        self.rpm = self.direction.sign() * wheel_rpm(&self.config.encoder, pulses);
        let window_s = self.config.encoder.window_s;
        self.odometry.advance(self.rpm, window_s, self.config.geometry.wheel_diameter_m);
        self.travel_m += self.rpm * self.config.mps_per_rpm() * window_s;
        let reference_rpm = match self.mode {
            Mode::Manual if self.is_seen() => return, // the transmitter commands the motor itself
            Mode::Manual => self.config.by_hand_rpm(f64::MAX.copysign(self.demanded())),
            _ => self.reference_rpm,
        };
        if reference_rpm == 0.0 || self.blocked() || !may_drive {
            self.hold();
            return;
        }
        let pulse = self.speed.step(speed, window_s, reference_rpm, self.rpm);
        match self.mode {
            Mode::Manual => {
                self.crawl = pulse;
                if self.by_stick() == self.stick {
                    self.speed.reset(); // it was not its pulse that drove
                }
            }
            _ => self.motor = pulse,
        }
    }

    fn adc(&mut self, t: Stamp, adc: &AdcSample) {
        let infrared = &self.config.infrared;
        let [front, rear] = self.bumpers.map(|bumper| bumper.angle_deg);
        let fitted = &self.config.range_finders;
        self.ir_front_cm = bumper_ranges(infrared, &fitted.front, front, &adc.ir_front);
        self.ir_rear_cm = bumper_ranges(infrared, &fitted.rear, rear, &adc.ir_rear);
        let rule = &self.rule;
        self.obstacle = ObstacleState {
            front: self.front.update(rule, &fitted.front, t, &self.ir_front_cm, self.travel_m),
            rear: self.rear.update(rule, &fitted.rear, t, &self.ir_rear_cm, -self.travel_m),
        };
        self.platform(adc);
    }

    /// Exactly one of the two platform controllers, in every mode.
    fn platform(&mut self, adc: &AdcSample) {
        let (vehicle, lines) = (&self.config, &self.piston_lines);
        self.tilt = tilt_angles(&vehicle.tilt, &adc.tilt);
        self.pistons = match vehicle.platform {
            Platform::Balance => balance(vehicle, lines, self.tilt, &adc.pistons),
            Platform::Pid => self.platform_pid.step(vehicle, lines, self.tilt, &adc.pistons),
            Platform::Off => lines.map(standing),
        };
    }

    /// A frame of the receiver (Fig. 10): who drives, and in mode manual with what.
    fn remote(&mut self, sample: &RemoteSample) {
        if !self.config.remote.enabled {
            return;
        }
        self.reset = self.remote.step(&self.config.remote, sample);
        match (self.remote.selector(), self.mode) {
            (Selector::Manual, Mode::Manual) => self.drive_by_sticks(),
            (Selector::Manual, _) => {
                self.take_over(Mode::Manual);
                self.stick = PwmCount::NEUTRAL;
                self.drive_by_sticks();
            }
            (Selector::Automatic, Mode::Manual) => {
                self.take_over(Mode::Idle);
                if !self.config.odometry.keep_pose {
                    self.odometry.rezero();
                    self.rezeroed = true;
                }
            }
            (Selector::Automatic, Mode::Fault) => self.take_over(Mode::Idle),
            (Selector::Lost, mode) if mode != Mode::Fault => self.take_over(Mode::Fault),
            _ => {}
        }
    }

    /// The remote control changes the mode: stopped, centred, goal and wander dropped.
    fn take_over(&mut self, mode: Mode) {
        self.drop_command();
        self.idle();
        self.mode = mode;
    }

    fn drive_by_sticks(&mut self) {
        match self.remote.speed(&self.config.remote) {
            Stick::Counts(counts) => self.stick = PwmCount::saturating(counts),
            Stick::Keep => {}
            Stick::Lost => self.stick = PwmCount::NEUTRAL,
        }
        self.direction.demand(&self.config.speed, self.demanded());
        match self.remote.steering(&self.config.remote) {
            Stick::Counts(counts) => self.steer(counts - self.config.steering.front_centre),
            Stick::Keep => {}
            Stick::Lost => self.steer(0.0),
        }
    }

    fn command(&mut self, command: &Command) {
        if matches!(self.mode, Mode::Manual | Mode::Fault) {
            return;
        }
        let before = self.mode;
        self.drop_command();
        match command {
            Command::Idle => self.idle(),
            Command::Goto(goal) => {
                self.idle();
                self.mode = Mode::Goto;
                self.goto = Some(GotoStage::new(*goal));
            }
            Command::Wander => {
                self.idle();
                self.mode = Mode::Wander;
                let stage = WanderStage::new(&self.config.wander);
                self.wander = Some(stage);
                self.demand(stage.reference_rpm(&self.config.wander));
            }
            Command::Teleop { rpm, steering } => {
                self.drive(Mode::Teleop, self.config.by_hand_rpm(rpm.get()), *steering);
            }
            Command::Follow { rpm, steering } => self.drive(Mode::Goto, rpm.get(), *steering),
        }
        if self.config.speed.reset_on_change && self.mode != before {
            self.speed.reset();
        }
    }

    /// The level above has decided speed and steering itself. The same again changes nothing.
    fn drive(&mut self, mode: Mode, rpm: f64, steering: Steering) {
        self.mode = mode;
        self.steer_fraction(steering);
        self.demand(rpm);
        if rpm == 0.0 {
            self.hold();
        }
    }

    /// Each command drops what the one before left.
    fn drop_command(&mut self) {
        self.goto = None;
        self.decision = None;
        self.wander = None;
    }

    fn obstacle_rule(&mut self, t: Stamp) {
        if let Some(stage) = &mut self.wander {
            let turned = stage.obstacle(&self.config.wander, t, self.obstacle);
            self.wander_phase(turned);
        }
        if self.mode == Mode::Manual {
            self.motor = self.by_stick();
        }
        if self.blocked() {
            self.hold();
        }
    }

    fn wander_timers(&mut self, t: Stamp) {
        if let Some(stage) = &mut self.wander {
            let turned = stage.timers(&self.config.wander, t);
            self.wander_phase(turned);
        }
    }

    /// A phase of wander began, with this steering: stop, turn the wheels, demand its reference.
    fn wander_phase(&mut self, steering: Option<Steering>) {
        let (Some(steering), Some(stage)) = (steering, self.wander) else { return };
        self.hold();
        self.steer_fraction(steering);
        self.demand(stage.reference_rpm(&self.config.wander));
    }

    /// What is asked of the motor, + = ahead: the reference in rpm, in mode manual the stick in counts.
    fn demanded(&self) -> f64 {
        match self.mode {
            Mode::Manual => self.stick.as_f64() - PwmCount::NEUTRAL.as_f64(),
            _ => self.reference_rpm,
        }
    }

    /// Whether a range finder looks where it is to drive.
    fn is_seen(&self) -> bool {
        self.config.range_finders.gears().allow(self.demanded())
    }

    /// The motor's pulse in mode manual: the stick's, and where no range finder looks no more than holds the speed
    /// there.
    fn by_stick(&self) -> PwmCount {
        let offset = |pulse: PwmCount| pulse.as_f64() - PwmCount::NEUTRAL.as_f64();
        let (stick, crawl) = (offset(self.stick), offset(self.crawl));
        if self.is_seen() || (stick * crawl > 0.0 && stick.abs() < crawl.abs()) {
            self.stick
        } else if stick * crawl > 0.0 {
            self.crawl
        } else {
            PwmCount::NEUTRAL
        }
    }

    /// Whether an obstacle lies in the driving direction, or nobody looks there: neither a range finder nor a person who
    /// drives. Wander's reversing has a rule of its own for obstacles.
    fn blocked(&self) -> bool {
        let (demanded, by_hand) = (self.demanded(), matches!(self.mode, Mode::Manual | Mode::Teleop));
        let is_seen = by_hand || self.is_seen();
        let reversing_in_wander = self.mode == Mode::Wander && self.reference_rpm < 0.0;
        !is_seen || (!reversing_in_wander && self.obstacle.blocks(demanded))
    }

    /// Mode idle: stopped and centred.
    fn idle(&mut self) {
        self.mode = Mode::Idle;
        self.reference_rpm = 0.0;
        self.steering_counts = 0.0;
        self.hold();
    }

    /// Motor neutral at once, PID reset; the reference stays.
    fn hold(&mut self) {
        (self.motor, self.crawl) = (PwmCount::NEUTRAL, PwmCount::NEUTRAL);
        self.speed.reset();
    }

    fn demand(&mut self, reference_rpm: f64) {
        if self.config.speed.reset_on_change && reference_rpm * self.reference_rpm < 0.0 {
            self.speed.reset();
        }
        self.reference_rpm = reference_rpm;
        self.direction.demand(&self.config.speed, reference_rpm);
        if self.direction.must_wait(&self.config.speed, reference_rpm) {
            self.hold(); // not at the next window: until then the motor would go on the old way
        }
    }

    fn steer(&mut self, front_offset_counts: f64) {
        let range = self.config.steering.range_counts;
        self.steering_counts = front_offset_counts.clamp(-range, range);
    }

    fn steer_fraction(&mut self, steering: Steering) {
        self.steer(-steering.get() * self.config.steering.range_counts);
    }

    /// What is decided at `t`, without a sample.
    #[must_use]
    pub fn outputs(&self, t: Stamp) -> Outputs {
        let mut outputs = Outputs::default();
        self.put_outputs(t, &mut outputs);
        outputs
    }

    /// Writes all of them where they are: they are 0.6 kB, and made with each sample.
    #[inline]
    fn put_outputs(&self, now: Stamp, outputs: &mut Outputs) {
        let Outputs {
            t,
            mode,
            pwm,
            reference_rpm,
            demanded,
            steering,
            rpm,
            pose,
            ir_front_cm,
            ir_rear_cm,
            obstacle,
            blocked,
            goto,
            tilt,
            duties,
            reset,
            rezeroed,
        } = outputs; // all of them
        let axles = &self.config.steering;
        let rear_counts = self.config.drivetrain.rear_counts(self.steering_counts);
        *t = now;
        *mode = self.mode;
        *pwm = PwmOutputs {
            motor: self.motor,
            steer_front: PwmCount::saturating(axles.front_centre + self.steering_counts),
            steer_rear: PwmCount::saturating(axles.rear_centre - rear_counts),
            bumper_front: self.bumpers[0].pulse,
            bumper_rear: self.bumpers[1].pulse,
            pistons: self.pistons,
            spare: PwmCount::NEUTRAL,
        };
        *reference_rpm = self.reference_rpm;
        *demanded = self.demanded();
        // + 0.0 turns −0 into 0.
        *steering = -self.steering_counts / axles.range_counts + 0.0;
        *rpm = self.rpm;
        *pose = self.odometry.pose();
        *ir_front_cm = self.ir_front_cm;
        *ir_rear_cm = self.ir_rear_cm;
        *obstacle = self.obstacle;
        *blocked = self.blocked();
        *goto = self.decision;
        *tilt = self.tilt;
        *duties = self.remote.duties();
        *reset = self.reset;
        *rezeroed = self.rezeroed;
    }

    /// Readings of the remote control that were missing or rejected since the start.
    #[must_use]
    pub fn remote_rejected(&self) -> u64 {
        self.remote.rejected()
    }
}
