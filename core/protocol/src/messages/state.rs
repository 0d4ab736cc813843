//! What a robot says of itself: state, samples, events and its factsheet.

use super::{Fault, FaultState, Latch, LatchState, LinkLoss, Message, NavState, Via};
use crate::codec::CodecError;
use crate::keys::Name;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use xtb_control::Mode;
use xtb_control::frames::MapPose;

/// Who holds control.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeaseState {
    /// The client.
    pub holder: Name,
    /// Since its last lease-bearing message.
    pub age_ms: u64,
}

/// Where a pose comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
}

/// The obstacle rule's view; `None` = the range finders have not been heard lately.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleView {
    /// Ahead.
    pub front: Option<bool>,
    /// Behind.
    pub rear: Option<bool>,
}

/// Platform tilt; `None` = not measured.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TiltState {
    /// Pitch, in degrees.
    pub x: Option<f64>,
    /// Roll, in degrees.
    pub y: Option<f64>,
}

/// What kind of goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GoalKind {
    /// To a point.
    Goto,
    /// Wander.
    Wander,
}

/// The life of a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GoalStatus {
    /// Taken, not yet begun.
    Accepted,
    /// Under way.
    Running,
    /// An obstacle in the driving direction.
    Blocked,
    /// Done.
    Reached,
    /// Ended by `stop`, `cancel` or teleoperation.
    Cancelled,
    /// Ended by a newer goal.
    Replaced,
    /// Could not be done.
    Failed,
    /// The robot restarted.
    Interrupted,
}

impl GoalStatus {
    /// Whether the goal has ended.
    #[must_use]
    pub fn is_final(self) -> bool {
        !matches!(self, Self::Accepted | Self::Running | Self::Blocked)
    }
}

/// The present or last goal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalState {
    /// Its request's id.
    pub id: Uuid,
    /// What kind.
    pub kind: GoalKind,
    /// East, in m; `None` for wander.
    pub x_m: Option<f64>,
    /// North, in m; `None` for wander.
    pub y_m: Option<f64>,
    /// Yaw on arrival, where one was asked for.
    pub yaw_rad: Option<f64>,
    /// How it is driven to; `None` for wander.
    pub via: Option<Via>,
    /// How it stands.
    pub status: GoalStatus,
    /// Still to go, in a straight line.
    pub distance_m: Option<f64>,
    /// Since it has this status.
    pub age_ms: u64,
    /// Why it has this status, where that is not plain.
    pub reason: Option<String>,
    /// Who sent it.
    pub by: Name,
    /// What it does when its client falls silent.
    pub on_link_loss: LinkLoss,
}

/// How an earlier goal ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalEnd {
    /// Its request's id.
    pub id: Uuid,
    /// As what.
    pub status: GoalStatus,
}

/// What the battery's voltage means, a few seconds of load left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
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
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// Nobody asked for anything.
    NoCommand,
    /// The last goal was reached.
    GoalReached,
    /// Told to.
    Stop,
    /// The goal was cancelled.
    Cancelled,
    /// The goal's time was up.
    TimeUp,
    /// The last setpoint is older than its lifetime.
    SetpointExpired,
    /// The session to the router was lost while teleoperating.
    LinkLost,
    /// A setpoint of 0 rpm.
    SetpointZero,
    /// Something ahead.
    ObstacleFront,
    /// Something behind.
    ObstacleRear,
    /// Wander's pause.
    WanderPause,
    /// The I/O board has fallen silent.
    BoardLost,
    /// The gyro has fallen silent.
    GyroLost,
    /// The transmitter drives, and its speed stick is neutral.
    RemoteNeutral,
    /// The remote control's selector is lost.
    RemoteLost,
    /// Latched: somebody called an emergency stop.
    Estop,
    /// Latched: the transmitter took over.
    RemoteTakeover,
    /// Latched: the wheels ran away.
    Runaway,
    /// Latched: a sensor froze or said what cannot be.
    SensorFault,
    /// Latched: the battery is nearly empty.
    BatteryCritical,
    /// Whoever sent the goal or the setpoints fell silent.
    LeaseExpired,
    /// Somebody else took the lease.
    LeaseTaken,
    /// The holder gave the lease back.
    LeaseReleased,
    /// The control loop itself was held up.
    LoopStalled,
    /// The motor was driven and the wheels did not turn.
    Stalled,
    /// The transmitter drives faster than the obstacle rule could stop.
    OverSpeed,
    /// The wheels have yet to stand before it drives the other way.
    ChangingDirection,
    /// The wheels turn as fast as they should by themselves.
    Coasting,
    /// It has only just been told to drive.
    Starting,
    /// A path is being planned.
    Planning,
    /// At the end of the stretch that traffic control has released.
    WaitingForTraffic,
    /// Another robot goes first.
    GivingWay,
    /// It waits for something unknown in its way to go away, before it looks for another way.
    WayBlocked,
    /// It does not know well enough where it is.
    PoseUncertain,
    /// It stands in a keep-out zone.
    InKeepOut,
    /// It stands to change gear or to turn its wheels.
    AtCusp,
}

/// Ages of the inputs in ms; `None` = never heard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
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

impl Message for RobotState {
    const NAME: &'static str = "RobotState";
    const VERSION: u32 = 4;

    fn validate(&self) -> Result<(), CodecError> {
        self.nav.validate()
    }
}

/// Raw and converted samples, 10 times a second while somebody listens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensors {
    /// Whose.
    pub robot: Name,
    /// The robot's monotonic clock.
    pub tick_ms: u64,
    /// Raw yaw counts, 360/65536 deg.
    pub gyro_yaw: i16,
    /// Pulses of the last encoder window.
    pub encoder_pulses: u16,
    /// Front range finders, counts.
    pub ir_front: [u16; 6],
    /// Rear range finders, counts.
    pub ir_rear: [u16; 6],
    /// Front range finders, cm; `None` = nothing in range.
    pub ir_front_cm: [Option<f64>; 6],
    /// Rear range finders, cm.
    pub ir_rear_cm: [Option<f64>; 6],
    /// Tilt sensor x and y, counts (means of 64 scans).
    pub tilt: [f64; 2],
    /// Positions of the pistons FL, FR, RL, RR, counts (means of 64 scans).
    pub pistons: [f64; 4],
    /// Heights of the pistons FL, FR, RL, RR.
    pub pistons_m: [f64; 4],
    /// Remote control: speed, steering, selector in time counts of 1.6 µs; `None` = no pulse.
    pub remote: [Option<u32>; 3],
    /// The gyro's firmware (1300 = 1.3.00); `None` = it has not answered.
    pub gyro_firmware: Option<u16>,
    /// The board's firmware, major in the high byte; `None` = no status has come.
    pub board_firmware: Option<u16>,
    /// Signed wheel speed.
    pub rpm: f64,
    /// Motor pulse in counts of 0.4 µs, as commanded.
    pub motor_counts: u16,
    /// Front steering pulse.
    pub steer_front_counts: u16,
    /// Rear steering pulse.
    pub steer_rear_counts: u16,
    /// Bumper pulses, front and rear.
    pub bumper_counts: [u16; 2],
    /// Piston pulses FL, FR, RL, RR.
    pub piston_counts: [u16; 4],
}

impl Message for Sensors {
    const NAME: &'static str = "Sensors";
    const VERSION: u32 = 2;
}

/// Something happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum EventKind {
    /// The agent began to run.
    Started {
        /// Its version.
        version: String,
    },
    /// The controller's mode changed.
    Mode {
        /// Before.
        from: Mode,
        /// After.
        to: Mode,
    },
    /// A goal changed its status.
    Goal {
        /// Which.
        id: Uuid,
        /// To what.
        status: GoalStatus,
        /// Why, where that is not plain.
        reason: Option<String>,
    },
    /// The lease changed hands.
    Lease {
        /// To whom; `None` = free.
        holder: Option<Name>,
    },
    /// Something broke, or works again.
    Fault {
        /// What.
        fault: Fault,
        /// False: it works again.
        present: bool,
        /// The system's words, where there are any.
        detail: Option<String>,
    },
    /// A stop was latched, or reset.
    Latch {
        /// Which.
        latch: Latch,
        /// False: it was reset.
        set: bool,
        /// Who or what did so.
        by: String,
    },
}

/// An event with its place in the robot's history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// Whose.
    pub robot: Name,
    /// Random at boot.
    pub epoch: u64,
    /// Counts the events of this boot.
    pub seq: u64,
    /// The robot's monotonic clock.
    pub tick_ms: u64,
    /// What happened.
    pub kind: EventKind,
}

impl Message for Event {
    const NAME: &'static str = "Event";
    const VERSION: u32 = 3;
}

/// A parameter as the factsheet lists it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterInfo {
    /// `section.field`.
    pub name: String,
    /// In TOML.
    pub value: String,
    /// Empty for switches.
    pub unit: String,
    /// Printed, data sheet, assumed or ours.
    pub origin: String,
}

/// What the robot accepts at most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Fastest setpoint, in wheel rpm.
    pub max_rpm: f64,
    /// Fastest speed that the obstacle rule stops from, in m/s.
    pub admitted_mps: f64,
    /// How long a setpoint lives.
    pub setpoint_lifetime_ms: u32,
    /// Largest |x| or |y| of a goal.
    pub max_coordinate_m: f64,
}

/// The factsheet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// Who.
    pub robot: Name,
    /// Of which fleet.
    pub fleet: Name,
    /// The agent's version.
    pub version: String,
    /// Random at boot.
    pub epoch: u64,
    /// `simulated` or `serial`.
    pub hardware: String,
    /// Where it started.
    pub start_pose: MapPose,
    /// What it accepts at most.
    pub limits: Limits,
    /// Which requests it understands.
    pub capabilities: Vec<String>,
    /// CRC-32 of the vehicle parameters, in hexadecimal.
    pub vehicle_hash: String,
    /// The vehicle parameters.
    pub vehicle: Vec<ParameterInfo>,
}

impl Message for About {
    const NAME: &'static str = "About";
}
