//! Requests to a robot, its replies, and teleoperation setpoints.

use super::{
    Assignment, Latch, MAX_ASSIGN_SEQ, MAX_LEDGER, Message, TaskAction, angle, bounded, coordinate, finish_s,
};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use xtb_control::units::{Steering, WheelRpm};

/// Proof that the robot granted control: which boot, and which grant of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Lease {
    /// Random at the robot's boot, below 2^53.
    pub epoch: u64,
    /// Raised by each grant to a new holder.
    pub root: u32,
}

/// What a goal does when its client falls silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LinkLoss {
    /// Stand.
    #[default]
    Halt,
    /// Carry on, for `finish_s` at most.
    Finish,
}

/// How a goal is driven to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Via {
    /// The memorandum's A-to-B (§4.10): straight, as Table 4 says.
    Direct,
    /// Along a planned path, around what the map and the range finders know of.
    Planned,
}

/// What is asked of a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Body {
    /// Ask for the lease.
    Acquire {
        /// Take it from its holder.
        #[serde(default)]
        take: bool,
    },
    /// Keep it; each 100 ms.
    Retain {},
    /// Give it back.
    Release {},
    /// Drive to a point of the map.
    Goto {
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// Yaw on arrival, counter-clockwise from +x; only by a planned path.
        #[serde(default)]
        yaw_rad: Option<f64>,
        /// How; `None` = planned as soon as the robot has a map, else direct.
        #[serde(default)]
        via: Option<Via>,
        /// When the client falls silent.
        #[serde(default)]
        on_link_loss: LinkLoss,
        /// Longest time that a goal with [`LinkLoss::Finish`] may take, in s.
        #[serde(default = "finish_s")]
        finish_s: f64,
    },
    /// Wander (§4.6).
    Wander {
        /// How long, in s; `None` = until stopped.
        #[serde(default)]
        for_s: Option<f64>,
        /// When the client falls silent.
        #[serde(default)]
        on_link_loss: LinkLoss,
        /// See [`Body::Goto`].
        #[serde(default = "finish_s")]
        finish_s: f64,
    },
    /// Drop the goal, stand; anyone may.
    Stop {},
    /// End this goal if it is the one that runs.
    Cancel {
        /// Its id.
        goal: Uuid,
    },
    /// Tell the robot where it stands in the map; refused while a goal runs.
    SetPose {
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// Counter-clockwise from +x.
        yaw_rad: f64,
    },
    /// End latched stops. It never moves the robot: a new command must follow.
    Reset {
        /// Only this one; `None` = all. Those whose cause is still there are refused.
        #[serde(default)]
        latch: Option<Latch>,
    },
    /// Drive under an assignment of the dispatcher; the goal's id is the assignment's. A lower one is
    /// refused, an equal one acknowledged again, a higher one replaces the goal; but the next leg of the one
    /// under way waits for it (capability [`NEXT_LEG`](super::NEXT_LEG)): the point between is passed.
    Assign {
        /// Which.
        assignment: Assignment,
        /// What to do.
        errand: TaskAction,
        /// When the client falls silent.
        #[serde(default)]
        on_link_loss: LinkLoss,
        /// See [`Body::Goto`].
        #[serde(default = "finish_s")]
        finish_s: f64,
    },
    /// End this assignment, and let it never begin: no drive of it or of an earlier one counts any more.
    /// It needs no lease, as it only ever ends what the same client began.
    Withdraw {
        /// The ledger.
        ledger: u64,
        /// Number of the assignment.
        assign_seq: u64,
    },
}

/// One question to a robot. The same id again gets the same answer and does nothing twice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Chosen by the client; a goal's id is its request's.
    pub id: Uuid,
    /// The client's lease, if it holds one.
    #[serde(default)]
    pub lease: Option<Lease>,
    /// What is asked.
    pub body: Body,
}

impl Message for Request {
    const NAME: &'static str = "Request";
    const VERSION: u32 = 2;

    fn validate(&self) -> Result<(), CodecError> {
        match &self.body {
            Body::Goto { x_m, y_m, yaw_rad, finish_s, .. } => {
                coordinate("x_m", *x_m)?;
                coordinate("y_m", *y_m)?;
                if let Some(yaw_rad) = yaw_rad {
                    angle("yaw_rad", *yaw_rad)?;
                }
                bounded("finish_s", *finish_s, 0.0, 86_400.0, "s")
            }
            Body::Wander { for_s, finish_s, .. } => {
                if let Some(for_s) = for_s {
                    bounded("for_s", *for_s, 0.0, 86_400.0, "s")?;
                }
                bounded("finish_s", *finish_s, 0.0, 86_400.0, "s")
            }
            Body::SetPose { x_m, y_m, yaw_rad } => {
                coordinate("x_m", *x_m)?;
                coordinate("y_m", *y_m)?;
                angle("yaw_rad", *yaw_rad)
            }
            Body::Assign { assignment, errand, finish_s, .. } => {
                assignment.validate()?;
                errand.validate()?;
                bounded("finish_s", *finish_s, 0.0, 86_400.0, "s")
            }
            Body::Withdraw { ledger, assign_seq } => {
                bounded("ledger", *ledger as f64, 0.0, MAX_LEDGER as f64, "")?;
                bounded("assign_seq", *assign_seq as f64, 0.0, MAX_ASSIGN_SEQ as f64, "")
            }
            Body::Acquire { .. }
            | Body::Retain {}
            | Body::Release {}
            | Body::Stop {}
            | Body::Cancel { .. }
            | Body::Reset { .. } => Ok(()),
        }
    }
}

/// Why a request was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum RejectCode {
    /// Not a message of ours.
    Malformed,
    /// Longer than any message of ours.
    Oversized,
    /// A version that this robot does not speak.
    WrongVersion,
    /// A number that is not finite or out of its range.
    OutOfRange,
    /// Somebody else holds the lease.
    LeaseHeld,
    /// The lease given is not the present one.
    LeaseLost,
    /// A goal runs, and this cannot be done meanwhile.
    Busy,
    /// No goal of that id runs, or may begin any more.
    UnknownGoal,
    /// A sensor that this needs has not been heard lately.
    NotReady,
    /// This robot cannot do that.
    Unsupported,
    /// Too many requests are waiting.
    Overloaded,
    /// A stop arrived after this and was carried out before it.
    Overtaken,
    /// This needs a lease, and none was given.
    LeaseRequired,
    /// A latched stop holds the robot: reset it first.
    Latched,
    /// What set the latch is still so.
    CausePresent,
    /// The battery is too low to begin anything.
    BatteryLow,
    /// A planned goal needs a map, and the robot has none, or another one than the fleet.
    NoMap,
    /// The goal lies in a keep-out zone.
    KeepOut,
    /// Something on the map stands where the robot shall stand.
    GoalBlocked,
}

impl CodecError {
    /// The code that a reply or a counter gives it.
    #[must_use]
    pub fn code(&self) -> RejectCode {
        match self {
            Self::Oversized { .. } => RejectCode::Oversized,
            Self::WrongVersion { .. } | Self::TooNew { .. } => RejectCode::WrongVersion,
            Self::UnknownEncoding { .. } | Self::Malformed { .. } => RejectCode::Malformed,
            Self::OutOfRange(_) => RejectCode::OutOfRange,
        }
    }
}

/// What a successful request gave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Done {
    /// From `acquire`.
    #[serde(default)]
    pub lease: Option<Lease>,
    /// From `goto` and `wander`.
    #[serde(default)]
    pub goal: Option<Uuid>,
}

/// A refusal, for people and programs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ErrorBody {
    /// For programs.
    pub code: RejectCode,
    /// What was wrong.
    #[serde(deserialize_with = "text::read")]
    pub message: String,
    /// What to do.
    #[serde(deserialize_with = "text::read")]
    pub hint: String,
}

/// `ok` or `error`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Done.
    Ok(Done),
    /// Refused; nothing changed.
    Error(ErrorBody),
}

/// The answer to a request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Reply {
    /// The request's id; nil if it could not be read.
    pub id: Uuid,
    /// What came of it.
    pub result: Outcome,
}

impl Message for Reply {
    const NAME: &'static str = "Reply";
}

impl Reply {
    /// A success.
    #[must_use]
    pub fn done(id: Uuid, done: Done) -> Self {
        Self { id, result: Outcome::Ok(done) }
    }

    /// A refusal.
    #[must_use]
    pub fn refused(id: Uuid, code: RejectCode, message: impl Into<String>, hint: impl Into<String>) -> Self {
        let error = ErrorBody { code, message: message.into(), hint: hint.into() };
        Self { id, result: Outcome::Error(error) }
    }
}

/// An emergency stop, put or asked: latched, whoever sends it. It needs no lease.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Estop {
    /// The same in each repetition: after a reset, a repetition that was held up does not latch again.
    pub id: Uuid,
}

impl Message for Estop {
    const NAME: &'static str = "Estop";
}

/// A robot's acknowledgement of an emergency stop.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Estopped {
    /// Who stands.
    pub robot: Name,
    /// Whether the latch `estop` is set now.
    pub latched: bool,
}

impl Message for Estopped {
    const NAME: &'static str = "Estopped";

    fn speaker(&self) -> Option<&Name> {
        Some(&self.robot)
    }
}

/// A teleoperation setpoint; lives 200 ms on the robot's own clock.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Setpoint {
    /// The client's lease.
    #[serde(default)]
    pub lease: Option<Lease>,
    /// Counts the client's setpoints; one that is not above the last accepted one is dropped.
    #[serde(default)]
    pub seq: u64,
    /// `tick_ms` of the robot as last seen in its state; at most 300 ms old, or the setpoint is dropped.
    #[serde(default)]
    pub echo_tick_ms: Option<u64>,
    /// Wheel speed, + = ahead.
    pub rpm: f64,
    /// −1..=1, + = right.
    pub steering: f64,
}

impl Message for Setpoint {
    const NAME: &'static str = "Setpoint";

    fn validate(&self) -> Result<(), CodecError> {
        WheelRpm::try_from(self.rpm)?;
        Steering::try_from(self.steering)?;
        Ok(())
    }
}
