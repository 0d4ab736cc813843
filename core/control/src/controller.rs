//! The first-level controller: one deterministic `step(sample) -> outputs`.
//!
//! Each stage of the memorandum (§5, Figs. 7–16) is a file beside this one and runs when its own
//! sample arrives; nothing here reads a clock, a file or a global. Same samples, same bits.
//!
//! ```text
//!              ┌── gyro ───► odometry yaw ──► A-to-B ──┐ reference,
//!   sample ────┼── encoder ► rpm ► odometry ► speed PID│ steering
//!              ├── adc ────► infrared ► obstacle       ├──► obstacle rule ──► wander timers ──► Outputs
//!              └── command ► mode ─────────────────────┘     (motor neutral)
//! ```
//!
//! Words: *reference* is what the mode demands in wheel rpm; *blocked* means that an obstacle lies
//! in its direction, which holds the motor neutral without clearing the reference; *stop* sets the
//! motor neutral at once and resets the PID.

use crate::goto::{Goal, GotoDecision, GotoStage};
use crate::infrared::{BumperRanges, bumper_ranges};
use crate::obstacle::{Bumper, ObstacleState};
use crate::odometry::{OdomPose, Odometry};
use crate::speed::{Direction, SpeedPid, wheel_rpm};
use crate::units::{AdcCount, PwmCount, Stamp, Steering, WheelRpm};
use crate::vehicle::VehicleConfig;
use crate::wander::WanderStage;
use serde::{Deserialize, Serialize};

/// Raw Euler angles of the gyro, 360/65536 deg each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GyroSample {
    /// About the axis ahead.
    pub roll: i16,
    /// About the axis to the right.
    pub pitch: i16,
    /// Clockwise from magnetic north.
    pub yaw: i16,
}

/// One scan of the converter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdcSample {
    /// Front bumper, left to right.
    pub ir_front: [AdcCount; 6],
    /// Rear bumper, left to right seen from above with the truck pointing up.
    pub ir_rear: [AdcCount; 6],
    /// Tilt sensor x (pitch) and y (roll), means of 64 scans.
    pub tilt: [AdcCount; 2],
    /// Piston positions FL, FR, RL, RR, means of 64 scans.
    pub pistons: [AdcCount; 4],
}

/// What the level above asks for; already authorised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Stand.
    Idle,
    /// Wander (§4.6).
    Wander,
    /// A-to-B (§4.10) in the odometry's frame.
    Goto(Goal),
    /// A speed reference and a steering fraction.
    Teleop {
        /// Wheel speed.
        rpm: WheelRpm,
        /// + = right.
        steering: Steering,
    },
}

/// Everything that can make the controller take a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sample {
    /// 100 Hz.
    Gyro(GyroSample),
    /// Pulses in the window that just closed, each 52.4 ms.
    Encoder {
        /// Pulses of the motor shaft.
        pulses: u32,
    },
    /// Each 38 ms.
    Adc(AdcSample),
    /// From the level above.
    Command(Command),
}

/// What the controller is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// Standing.
    #[default]
    Idle,
    /// The R/C transmitter drives.
    Manual,
    /// Setpoints over the network.
    Teleop,
    /// A-to-B.
    Goto,
    /// Wander.
    Wander,
    /// The remote control's selector is lost.
    Fault,
}

/// The ten outputs (§4.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PwmOutputs {
    /// Below neutral = astern.
    pub motor: PwmCount,
    /// Below centre = right.
    pub steer_front: PwmCount,
    /// The front's mirror image.
    pub steer_rear: PwmCount,
    /// Front bumper servo.
    pub bumper_front: PwmCount,
    /// Rear bumper servo.
    pub bumper_rear: PwmCount,
    /// FL, FR, RL, RR.
    pub pistons: [PwmCount; 4],
    /// Not connected.
    pub spare: PwmCount,
}

/// Everything that one step decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// The sample's stamp.
    pub t: Stamp,
    /// The mode after the step.
    pub mode: Mode,
    /// For the board.
    pub pwm: PwmOutputs,
    /// What the mode demands, in rpm.
    pub reference_rpm: f64,
    /// Steering as a fraction of full lock, + = right.
    pub steering: f64,
    /// Measured, signed by the reference's direction.
    pub rpm: f64,
    /// Odometry.
    pub pose: OdomPose,
    /// Front bumper, cm.
    pub ir_front_cm: BumperRanges,
    /// Rear bumper, cm.
    pub ir_rear_cm: BumperRanges,
    /// The obstacle rule's view.
    pub obstacle: ObstacleState,
    /// Whether an obstacle holds the motor neutral.
    pub blocked: bool,
    /// What the last gyro reading decided for the goal; stays after arrival until the next command.
    pub goto: Option<GotoDecision>,
}

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
    direction: Direction,
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
}

impl Controller {
    /// A truck that stands, centred, at pose 0. `config` should have passed
    /// [`VehicleConfig::validate`]; an invalid one gives wrong but still bounded outputs.
    #[must_use]
    pub fn new(config: VehicleConfig) -> Self {
        Self {
            config,
            mode: Mode::Idle,
            reference_rpm: 0.0,
            steering_counts: 0.0,
            motor: PwmCount::NEUTRAL,
            speed: SpeedPid::default(),
            direction: Direction::default(),
            rpm: 0.0,
            odometry: Odometry::default(),
            travel_m: 0.0,
            front: Bumper::default(),
            rear: Bumper::default(),
            ir_front_cm: [None; 6],
            ir_rear_cm: [None; 6],
            obstacle: ObstacleState::default(),
            goto: None,
            decision: None,
            wander: None,
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
        match sample {
            Sample::Gyro(gyro) => self.gyro(gyro),
            Sample::Encoder { pulses } => self.encoder(*pulses),
            Sample::Adc(adc) => self.adc(t, adc),
            Sample::Command(command) => self.command(command),
        }
        self.obstacle_rule(t);
        self.wander_timers(t);
        self.outputs(t)
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
        let may_drive = self.direction.admit(speed, self.reference_rpm, pulses);
        self.rpm = self.direction.sign() * wheel_rpm(&self.config.encoder, pulses);
        let window_s = self.config.encoder.window_s;
        self.odometry.advance(self.rpm, window_s, self.config.geometry.wheel_diameter_m);
        self.travel_m += self.rpm * self.config.mps_per_rpm() * window_s;
        if self.reference_rpm == 0.0 || self.blocked() || !may_drive {
            self.hold();
        } else {
            self.motor = self.speed.step(speed, window_s, self.reference_rpm, self.rpm);
        }
    }

    fn adc(&mut self, t: Stamp, adc: &AdcSample) {
        let infrared = &self.config.infrared;
        self.ir_front_cm = bumper_ranges(infrared, infrared.front_angle_deg, &adc.ir_front);
        self.ir_rear_cm = bumper_ranges(infrared, infrared.rear_angle_deg, &adc.ir_rear);
        let rule = &self.config.obstacle;
        self.obstacle = ObstacleState {
            front: self.front.update(rule, t, &self.ir_front_cm, self.travel_m),
            rear: self.rear.update(rule, t, &self.ir_rear_cm, -self.travel_m),
        };
    }

    fn command(&mut self, command: &Command) {
        if matches!(self.mode, Mode::Manual | Mode::Fault) {
            return;
        }
        let before = self.mode;
        self.goto = None;
        self.decision = None;
        self.wander = None;
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
                self.mode = Mode::Teleop;
                self.steer_fraction(*steering);
                self.demand(rpm.get());
                if rpm.get() == 0.0 {
                    self.hold();
                }
            }
        }
        if self.config.speed.reset_on_change && self.mode != before {
            self.speed.reset();
        }
    }

    fn obstacle_rule(&mut self, t: Stamp) {
        if let Some(stage) = &mut self.wander {
            let turned = stage.obstacle(&self.config.wander, t, self.obstacle);
            self.wander_phase(turned);
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

    /// Whether an obstacle lies in the driving direction. Wander's reversing has a rule of its own.
    fn blocked(&self) -> bool {
        let reversing_in_wander = self.mode == Mode::Wander && self.reference_rpm < 0.0;
        !reversing_in_wander && self.obstacle.blocks(self.reference_rpm)
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
        self.motor = PwmCount::NEUTRAL;
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

    fn outputs(&self, t: Stamp) -> Outputs {
        let steering = &self.config.steering;
        Outputs {
            t,
            mode: self.mode,
            pwm: PwmOutputs {
                motor: self.motor,
                steer_front: PwmCount::saturating(steering.front_centre + self.steering_counts),
                steer_rear: PwmCount::saturating(steering.rear_centre - self.steering_counts),
                bumper_front: PwmCount::NEUTRAL,
                bumper_rear: PwmCount::NEUTRAL,
                pistons: [PwmCount::NEUTRAL; 4],
                spare: PwmCount::NEUTRAL,
            },
            reference_rpm: self.reference_rpm,
            // + 0.0 turns −0 into 0.
            steering: -self.steering_counts / steering.range_counts + 0.0,
            rpm: self.rpm,
            pose: self.odometry.pose(),
            ir_front_cm: self.ir_front_cm,
            ir_rear_cm: self.ir_rear_cm,
            obstacle: self.obstacle,
            blocked: self.blocked(),
            goto: self.decision,
        }
    }
}
