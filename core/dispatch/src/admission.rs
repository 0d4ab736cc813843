//! Which tasks are taken, and why not.

use crate::tracked_robot::{TrackedRobot, smallest_car};
use crate::travel_cost::TravelCost;
use std::collections::BTreeMap;
use xtb_nav::Car;
use xtb_protocol::Name;
use xtb_protocol::messages::{DispatchCode, DispatchError, TaskSpec, Waypoint, Who};

/// What a submission is measured against.
#[derive(Clone, Copy)]
pub struct AdmissionCtx<'a> {
    /// Now, in ms since 1970.
    pub now_ms: u64,
    /// Tasks that can still be taken.
    pub room: usize,
    /// Bound that this comes from.
    pub max_open: usize,
    /// Robots that are known.
    pub robots: &'a BTreeMap<Name, TrackedRobot>,
    /// Whether a roster says which robots there should be.
    pub has_roster: bool,
    /// The floor.
    pub travel_cost: &'a dyn TravelCost,
}

/// A refusal.
#[must_use]
pub fn refusal(code: DispatchCode, message: impl Into<String>, hint: &str) -> DispatchError {
    DispatchError { code, message: message.into(), hint: hint.to_owned() }
}

/// The ledger cannot be written.
pub(crate) fn ledger_failed(why: &str) -> DispatchError {
    let message = format!("the ledger cannot be written: {why}");
    refusal(
        DispatchCode::LedgerFailed,
        message,
        "nothing was changed; try again when the cause is gone, such as a full disk",
    )
}

/// Whether all of a submission can be taken.
///
/// # Errors
/// The first reason not to; names the task by its place, counted from 1.
pub fn check(tasks: &[TaskSpec], ctx: AdmissionCtx<'_>) -> Result<(), DispatchError> {
    if tasks.is_empty() {
        return Err(refusal(DispatchCode::Malformed, "the request has no task", "submit at least one"));
    }
    if tasks.len() > ctx.room {
        let message = format!("{} tasks are open, the limit is {}", ctx.max_open - ctx.room, ctx.max_open);
        return Err(refusal(DispatchCode::QueueFull, message, "wait until some are done, or cancel some"));
    }
    for (i, spec) in tasks.iter().enumerate() {
        one(spec, ctx).map_err(|error| {
            let place = if tasks.len() > 1 { format!("task {}: ", i + 1) } else { String::new() };
            DispatchError { message: format!("{place}{}", error.message), ..error }
        })?;
    }
    Ok(())
}

fn one(spec: &TaskSpec, ctx: AdmissionCtx<'_>) -> Result<(), DispatchError> {
    if let Err(error) = spec.validate() {
        return Err(refusal(DispatchCode::OutOfRange, error.to_string(), "docs/protocol.md has the ranges"));
    }
    if let Some(deadline_ms) = spec.deadline_ms.filter(|deadline_ms| *deadline_ms <= ctx.now_ms) {
        let late_s = (ctx.now_ms - deadline_ms) / 1000;
        let message = format!("the deadline passed {late_s} s ago");
        return Err(refusal(DispatchCode::DeadlinePast, message, "set a later deadline; check the clocks"));
    }
    known(&spec.who, ctx)?;
    let car = smallest_car(ctx.robots, &spec.who);
    spec.kind.points().iter().try_for_each(|point| admits_point(ctx.travel_cost, &car, point))
}

/// Whether there is room for a robot at a point.
pub(crate) fn admits_point(floor: &dyn TravelCost, car: &Car, point: &Waypoint) -> Result<(), DispatchError> {
    let hint = "`fleet-cli map show --live` shows the free space";
    floor.admits(car, point).map_err(|(code, message)| refusal(code, message, hint))?;
    if !floor.has_room(car, point) {
        let message = format!(
            "({:.2}, {:.2}) is too near to what is on the map for traffic control",
            point.x_m, point.y_m
        );
        return Err(refusal(
            DispatchCode::GoalBlocked,
            message,
            "choose a point farther from walls, or another yaw",
        ));
    }
    Ok(())
}

fn known(who: &Who, ctx: AdmissionCtx<'_>) -> Result<(), DispatchError> {
    let mut in_roster = ctx.robots.values().filter(|robot| robot.in_roster);
    match who {
        Who::Robot(name) if ctx.has_roster && !ctx.robots.get(name).is_some_and(|robot| robot.in_roster) => {
            let hint = "`fleet-cli list` shows the robots present; the roster lists those expected";
            Err(refusal(DispatchCode::UnknownRobot, format!("the roster has no robot {name}"), hint))
        }
        Who::Tag(tag) if ctx.has_roster && !in_roster.any(|robot| robot.is_eligible(who)) => {
            let message = format!("no robot of the roster has the tag {tag}");
            Err(refusal(DispatchCode::UnknownTag, message, "tags are set in the roster"))
        }
        Who::Able(able) => {
            let mut read = ctx.robots.values().filter(|robot| robot.capabilities.is_some()).peekable();
            if read.peek().is_none() || read.any(|robot| robot.is_eligible(who)) {
                return Ok(()); // nobody has said what it can do, or somebody can
            }
            let message = format!("no robot present has the capability {able}");
            Err(refusal(DispatchCode::UnknownCapability, message, "the factsheet (about) lists capabilities"))
        }
        _ => Ok(()),
    }
}
