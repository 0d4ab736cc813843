//! What goes into the controller and what comes out: samples, commands, the ten outputs.
//!
//! Plain values without behaviour; [`crate::controller`] turns the first into the last.

use crate::goto::{GotoDecision, GotoGoal};
use crate::infrared::BumperRanges;
use crate::obstacle::ObstacleState;
use crate::odometry::OdomPose;
use crate::remote::{Duties, RemoteSample};
use crate::tilt::TiltAngles;
use crate::tpu::ResetMask;
use crate::units::{AdcCount, PwmCount, Stamp, Steering, WheelRpm};
use crate::vehicle::SLOTS;
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

/// One scan of the converter. Channels that the board's frame does not hold read 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdcSample {
    /// Front bumper, left to right.
    pub ir_front: [AdcCount; SLOTS],
    /// Rear bumper, left to right seen from above with the truck pointing up.
    pub ir_rear: [AdcCount; SLOTS],
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
    Goto(GotoGoal),
    /// A speed reference and a steering fraction.
    Teleop {
        /// Wheel speed.
        rpm: WheelRpm,
        /// + = right.
        steering: Steering,
    },
    /// The same from the second level's follower, on its way to a goal: mode goto without Table 4; who
    /// follows decides when it has arrived. Repeated at each gyro sample.
    Follow {
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
    /// Each 22.2 ms, if there is a receiver.
    Remote(RemoteSample),
    /// From the level above.
    Command(Command),
    /// The level above keeps more distance from now on: what is nearer is an obstacle. Less than the configuration's
    /// `obstacle.threshold_cm` counts as that.
    Obstacle {
        /// From the face of a bumper.
        threshold_cm: f64,
    },
}

/// What the controller is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
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
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outputs {
    /// The sample's stamp.
    pub t: Stamp,
    /// The mode after the step.
    pub mode: Mode,
    /// For the board.
    pub pwm: PwmOutputs,
    /// What the mode demands, in rpm.
    pub reference_rpm: f64,
    /// What is asked of the motor, + = ahead: the reference in rpm, in mode manual the stick in counts.
    pub demanded: f64,
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
    /// Platform tilt.
    pub tilt: TiltAngles,
    /// The remote control's last frame.
    pub duties: Duties,
    /// Channels of the remote control that *this* sample wants to have reset.
    pub reset: ResetMask,
    /// Whether *this* sample set the odometry back to 0.
    pub rezeroed: bool,
}
