//! What a robot says of itself, 20 times a second.

use super::{FaultState, GoalEnd, GoalState, LatchState, Message, NavState, bounded, finite};
use crate::keys::Name;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use xtb_control::Mode;

/// Who holds control.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LeaseState {
    /// The client.
    pub holder: Name,
    /// Since its last lease-bearing message.
    pub age_ms: u64,
}

/// Where a pose comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum PoseSource {
    /// The configured start pose; nothing has been measured yet.
    Start,
    /// Dead reckoning since the start pose or the last `set_pose`.
    Odometry,
    /// Dead reckoning corrected by pose fixes.
    Fixes,
}

/// The pose in the map (ENU, REP-103).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PoseState {
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Counter-clockwise from +x.
    pub yaw_rad: f64,
    /// Where it comes from.
    pub source: PoseSource,
    /// Age of the older of the two samples behind it; `None` = never measured.
    pub age_ms: Option<u64>,
    /// Standard deviation along the worse direction, in m.
    pub sigma_m: f64,
    /// Standard deviation of the yaw.
    pub sigma_yaw_rad: f64,
    /// Since the last accepted fix; `None` = none since boot or `set_pose`.
    pub fix_age_ms: Option<u64>,
    /// Way driven for each metre that the encoder counts, as pose fixes have shown: 1 = what the settings
    /// say; `None` = not known, there was no fix.
    pub odometry_scale: Option<f64>,
    /// Standard deviation of `odometry_scale`.
    pub odometry_scale_sigma: Option<f64>,
    /// By how much fixes are older than they say, as estimated from the motion; `None` = not known.
    pub fix_delay_ms: Option<i64>,
}

/// The obstacle rule's view; `None` = the range finders have not been heard lately.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObstacleView {
    /// Ahead.
    pub front: Option<bool>,
    /// Behind.
    pub rear: Option<bool>,
}

/// Platform tilt; `None` = not measured.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TiltState {
    /// Pitch, in degrees.
    pub x: Option<f64>,
    /// Roll, in degrees.
    pub y: Option<f64>,
}

/// What the battery's voltage means, a few seconds of load left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum BatteryLevel {
    /// Not measured: it may be empty.
    #[default]
    Unknown,
    /// Enough.
    Ok,
    /// Think of charging.
    Warn,
    /// Nothing new begins; what runs may finish.
    Finish,
    /// The robot stands, latched.
    Critical,
}

/// Why a robot stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// No command.
    NoCommand,
    /// Goal reached.
    GoalReached,
    /// Stop requested.
    Stop,
    /// Goal cancelled.
    Cancelled,
    /// Goal time limit reached.
    TimeUp,
    /// Setpoint timed out.
    SetpointExpired,
    /// Connection to the router lost.
    LinkLost,
    /// Setpoint is zero.
    SetpointZero,
    /// Obstacle ahead.
    ObstacleFront,
    /// Obstacle behind.
    ObstacleRear,
    /// Pausing while wandering.
    WanderPause,
    /// I/O board not responding.
    BoardLost,
    /// Gyro not responding.
    GyroLost,
    /// Remote control active, speed stick in neutral.
    RemoteNeutral,
    /// Remote control signal lost.
    RemoteLost,
    /// Latched: emergency stop.
    Estop,
    /// Latched: remote control took over.
    RemoteTakeover,
    /// Latched: runaway, wheels faster than commanded.
    Runaway,
    /// Latched: sensor fault.
    SensorFault,
    /// Latched: battery nearly empty.
    BatteryCritical,
    /// Controlling client timed out.
    LeaseExpired,
    /// Another client took control.
    LeaseTaken,
    /// Control released.
    LeaseReleased,
    /// Control loop stalled.
    LoopStalled,
    /// Motor driven, but wheels not turning.
    Stalled,
    /// Remote control too fast for obstacle detection.
    OverSpeed,
    /// Waiting for standstill before reversing.
    ChangingDirection,
    /// Coasting.
    Coasting,
    /// Starting.
    Starting,
    /// Planning a path.
    Planning,
    /// Waiting for traffic clearance.
    WaitingForTraffic,
    /// Giving way to another robot.
    GivingWay,
    /// Blocked by an unmapped obstacle.
    WayBlocked,
    /// Position too uncertain.
    PoseUncertain,
    /// Inside a keep-out zone.
    InKeepOut,
    /// Stopping to change direction.
    AtCusp,
}

/// Ages of the inputs in ms; `None` = never heard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct InputAges {
    /// Gyro frame.
    pub gyro: Option<u64>,
    /// Encoder window.
    pub encoder: Option<u64>,
    /// Converter scan.
    pub adc: Option<u64>,
    /// Frame of the remote control; `None` also for a truck without a receiver.
    pub remote: Option<u64>,
    /// Accepted setpoint.
    pub setpoint: Option<u64>,
}

/// What was refused or dropped since boot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Rejected {
    /// Messages that could not be read.
    pub malformed: u64,
    /// Messages that were too long.
    pub oversized: u64,
    /// Messages of another version.
    pub wrong_version: u64,
    /// Messages with a number out of range.
    pub out_of_range: u64,
    /// Requests that were read and refused.
    pub refused: u64,
    /// Setpoints that were too old, repeated, or overtaken by a later stop or goal.
    pub stale: u64,
    /// Pose fixes that were too old or too far off to be true.
    pub fixes: u64,
    /// Setpoints without the present lease.
    pub fenced: u64,
    /// Requests that found the queue full.
    pub overloaded: u64,
    /// Setpoints that were replaced by newer ones before a turn saw them.
    pub setpoints_overwritten: u64,
    /// Events that fell out of their full queue.
    pub events_dropped: u64,
    /// Board frames dropped: CRC, type, range.
    pub board_frames: u64,
    /// Gaps in the board's sequence.
    pub board_lost: u64,
    /// Board frames that came again.
    pub board_repeated: u64,
    /// Bytes skipped to find a gyro frame.
    pub gyro_bytes: u64,
    /// Gyro frames that its own clock says are missing.
    pub gyro_lost: u64,
    /// Readings of the remote control that were missing or rejected.
    pub remote_readings: u64,
    /// Steps that the recorder could not keep.
    pub record_dropped: u64,
}

/// Everything about a robot, 20 times a second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotState {
    /// Whose.
    pub robot: Name,
    /// Random at boot.
    pub epoch: u64,
    /// Counts the states.
    pub seq: u64,
    /// The robot's monotonic clock.
    pub tick_ms: u64,
    /// What the controller does.
    pub mode: Mode,
    /// Who holds control.
    pub lease: Option<LeaseState>,
    /// Where it is.
    pub pose: PoseState,
    /// + = ahead; `None` = the encoder has not been heard lately.
    pub speed_mps: Option<f64>,
    /// What the mode demands of the wheels, in rpm.
    pub reference_rpm: f64,
    /// Commanded, −1..=1, + = right.
    pub steering: f64,
    /// What the range finders see.
    pub obstacle: ObstacleView,
    /// Platform tilt.
    pub tilt_deg: TiltState,
    /// `None` = not measured.
    pub battery_v: Option<f64>,
    /// What that means.
    pub battery_level: BatteryLevel,
    /// The present or last goal.
    pub goal: Option<GoalState>,
    /// How the goals before it ended, newest first; at most 8.
    pub ended_goals: Vec<GoalEnd>,
    /// What is broken, with the newest last.
    pub faults: Vec<FaultState>,
    /// Latched stops, oldest first.
    pub latches: Vec<LatchState>,
    /// Map, path and who leads along it.
    pub nav: NavState,
    /// Why it stands, what weighs most first; empty while it drives.
    pub stopped_because: Vec<StopReason>,
    /// Since when it stands; `None` while it drives.
    pub stopped_age_ms: Option<u64>,
    /// Ages of the inputs.
    pub input_age_ms: InputAges,
    /// How late the latest turn of the control loop since the last state was; it should be under 5000.
    pub turn_late_us: u64,
    /// Turns since boot that came more than 5 ms after their time.
    pub turns_late: u64,
    /// What was refused or dropped.
    pub rejected: Rejected,
}

/// Largest |x| or |y| that a state may tell of, in m. Goals and set poses end at 1 km, but dead reckoning may
/// go on from there: a robot at 2 m/s takes 5 days for this. More makes no sense, and what is added to it in
/// 32 bits would be lost.
pub const MAX_REPORTED_M: f64 = 1e6;
/// Largest speed that a state may tell of, in m/s. At its limit, through 1:1 and wheels of 1 m, an encoder says
/// 660; the rest is for what fixes make of it. Chosen, not measured.
pub(super) const MAX_REPORTED_MPS: f64 = 2000.0;

/// Where something is, as a robot reports it.
pub(super) fn reported(quantity: &'static str, value_m: Option<f64>) -> Result<(), CodecError> {
    bounded(quantity, value_m.unwrap_or(0.0), -MAX_REPORTED_M, MAX_REPORTED_M, "m")
}

impl Message for RobotState {
    const NAME: &'static str = "RobotState";
    const VERSION: u32 = 5;

    fn speaker(&self) -> Option<&Name> {
        Some(&self.robot)
    }

    /// Every number is finite: JSON has no other. Places and the speed are such as a robot can have.
    fn validate(&self) -> Result<(), CodecError> {
        let Self { pose, goal, tilt_deg, .. } = self;
        reported("pose x_m", Some(pose.x_m))?;
        reported("pose y_m", Some(pose.y_m))?;
        finite("pose yaw_rad", Some(pose.yaw_rad))?;
        finite("pose sigma_m", Some(pose.sigma_m))?;
        finite("pose sigma_yaw_rad", Some(pose.sigma_yaw_rad))?;
        finite("pose odometry_scale", pose.odometry_scale)?;
        finite("pose odometry_scale_sigma", pose.odometry_scale_sigma)?;
        let speed_mps = self.speed_mps.unwrap_or(0.0);
        bounded("speed_mps", speed_mps, -MAX_REPORTED_MPS, MAX_REPORTED_MPS, "m/s")?;
        finite("reference_rpm", Some(self.reference_rpm))?;
        finite("steering", Some(self.steering))?;
        finite("tilt_deg x", tilt_deg.x)?;
        finite("tilt_deg y", tilt_deg.y)?;
        finite("battery_v", self.battery_v)?;
        if let Some(goal) = goal {
            reported("goal x_m", goal.x_m)?;
            reported("goal y_m", goal.y_m)?;
            finite("goal yaw_rad", goal.yaw_rad)?;
            finite("goal distance_m", goal.distance_m)?;
        }
        self.nav.validate()
    }
}
