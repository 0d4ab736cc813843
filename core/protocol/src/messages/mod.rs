//! What travels: one serde type for each message, the same in postcard and in JSON.
//!
//! Nested structs and enums only (no flatten, untagged or skipped fields: postcard cannot), JSON
//! fields with a default may be left out, unknown ones are errors. [`Message::validate`] holds what
//! the types cannot: finite, in range, bounded.

mod about;
mod alerts;
mod assign;
mod dispatch;
mod event;
mod fault;
mod goal;
mod history;
mod home;
mod identity;
mod latch;
mod log;
mod map;
mod map_edit;
mod nav;
mod near;
mod param;
mod places;
mod request;
mod sensors;
mod sim;
mod standby;
mod state;
mod suspension;
mod task;
pub mod texts;

pub use about::{
    About, BOARD_FIRMWARE, Limits, NEXT_LEG, ParameterInfo, REALTIME, REALTIME_OFF, REALTIME_ON,
    REALTIME_REMEDY, SPEAKS,
};
pub use alerts::{
    AckBody, AckReply, AckRequest, Acknowledged, Alert, AlertKind, AlertState, FleetAlerts, MAX_ALERT_TEXT,
    MAX_ALERTS, MAX_PERSON,
};
pub use assign::{Assignment, MAX_ASSIGN_SEQ, MAX_LEDGER, MAX_LEG, TaskAction};
pub use dispatch::{
    Adopted, DispatchBody, DispatchCode, DispatchError, DispatchOutcome, DispatchReply, DispatchRequest,
    DispatchStatus, MAX_SUBMISSION, PAGE_BYTES, TaskChange, TaskEvent, TaskHistory, TaskList, TaskStep,
    TaskView,
};
pub use event::{Event, EventKind};
pub use fault::{Fault, FaultState};
pub use goal::{GoalEnd, GoalKind, GoalState, GoalStatus};
pub use history::{
    HistoryEvent, HistoryKind, HistoryPlace, HistoryReply, HistoryRequest, MAX_HISTORY_PAGE, MAX_SEARCH,
    RobotReport, StopCount,
};
pub use home::{FleetHomes, HomeStatus, RobotHome};
pub use identity::IdentityStatus;
pub use latch::{Latch, LatchState, STOP_SWITCH};
pub use log::{LogCode, LogFile, LogReply, LogRequest, MAX_LOG_NAME, MAX_LOGS, MAX_PIECE, RecordingName};
pub use map::{
    FleetMap, MAX_MAP_CELLS, MAX_MAP_NAME, MAX_ZONE_POINTS, MAX_ZONES, MapCell, MapHash, MapZone,
    MapZoneKind, NoMapHash, is_map_name,
};
pub use map_edit::{
    MAX_MAP_VERSIONS, MAX_WHY, MapContent, MapEdit, MapEditCode, MapEditReply, MapHistory, MapVersion, is_why,
};
pub use nav::{
    Arc, Fix, FixSource, MapState, NavPhase, NavState, Route, RouteGoal, RouteSource, RouteState, Track,
    TrafficState,
};
pub use near::{NearRole, NearState, NearWay};
pub use param::{
    MAX_PARAM_CHANGES, MAX_PARAMS, ParamBody, ParamCareful, ParamChange, ParamCode, ParamError, ParamInfo,
    ParamList, ParamOutcome, ParamReply, ParamRequest, ParamValue, ParamWhen,
};
pub use places::{FleetPlaces, MAX_PLACE_TAGS, MAX_PLACES, MapPlace, PlaceKind, PlaceNameError, place_name};
pub use request::{
    Body, Done, ErrorBody, Estop, Estopped, Lease, LinkLoss, Outcome, RejectCode, Reply, Request, Setpoint,
    Via,
};
pub use sensors::Sensors;
pub use sim::{MAX_ROSTER, Roster, RosterEntry, SLOW_BELOW, SimStats, Truth, TruthRobot};
pub use standby::{
    Copied, CopiedRecord, MAX_TERM, STANDBY_PAGE_BYTES, StandbyReply, StandbyRequest, StandbyView, TERM_BITS,
    Witnesses,
};
pub use state::{
    BatteryLevel, InputAges, LeaseState, MAX_REPORTED_M, ObstacleView, PoseSource, PoseState, Rejected,
    RobotState, StopReason, TiltState,
};
pub use suspension::{Suspension, SuspensionCause};
pub use task::{
    MAX_POINTS, MAX_PRIORITY, NoTaskId, OnTakeover, TaskId, TaskKind, TaskSpec, TaskState, Waypoint, Who,
};

use crate::keys::Name;
use crate::wire::CodecError;
use serde::{Serialize, de::DeserializeOwned};
use xtb_control::units::check;

/// A message with a place in the table of wire types.
pub trait Message: Serialize + DeserializeOwned {
    /// Its name in the encoding: `application/x-postcard;xtb.<NAME>.v<VERSION>`.
    const NAME: &'static str;
    /// Version of its layout.
    const VERSION: u32 = 1;
    /// The version before, if programs that speak it are still understood: whether a message can be said in it. It has
    /// the layout of this one, with fewer variants at the end of its enums, unless
    /// [`read_previous`](Self::read_previous) and [`write_previous`](Self::write_previous) say otherwise.
    const PREVIOUS: Option<fn(&Self) -> bool> = None;
    /// Longest that is read or written, in bytes.
    const MAX_BYTES: usize = crate::wire::MAX_BYTES;

    /// The robot that says this of itself, if the message names it: the same as in the key, or the message
    /// is not believed.
    fn speaker(&self) -> Option<&Name> {
        None
    }

    /// Reads the bytes of the version before, and what is left of them.
    ///
    /// # Errors
    /// Not its layout.
    fn read_previous(bytes: &[u8]) -> postcard::Result<(Self, &[u8])> {
        postcard::take_from_bytes(bytes)
    }

    /// The bytes of the version before, which [can say it](Self::PREVIOUS).
    ///
    /// # Errors
    /// What serde cannot write.
    fn write_previous(&self) -> postcard::Result<Vec<u8>> {
        postcard::to_allocvec(self)
    }

    /// Checks what the type cannot hold.
    ///
    /// # Errors
    /// The first value that is not finite, out of range or too long.
    fn validate(&self) -> Result<(), CodecError> {
        Ok(())
    }
}

/// Largest |x| or |y| of a goal or pose in the map, in m.
pub const MAX_COORDINATE_M: f64 = 1000.0;

fn bounded(
    quantity: &'static str,
    value: f64,
    min: f64,
    max: f64,
    unit: &'static str,
) -> Result<(), CodecError> {
    Ok(check(quantity, value, min, max, unit).map(drop)?)
}

/// How long a goal may take with [`LinkLoss::Finish`], unless it says otherwise, in s.
fn finish_s() -> f64 {
    300.0
}

fn finite(quantity: &'static str, value: Option<f64>) -> Result<(), CodecError> {
    bounded(quantity, value.unwrap_or(0.0), f64::MIN, f64::MAX, "")
}

fn coordinate(quantity: &'static str, value: f64) -> Result<(), CodecError> {
    bounded(quantity, value, -MAX_COORDINATE_M, MAX_COORDINATE_M, "m")
}

fn angle(quantity: &'static str, value: f64) -> Result<(), CodecError> {
    bounded(quantity, value, -7.0, 7.0, "rad")
}
