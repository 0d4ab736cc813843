//! Robots that are nearly done: where and how far behind a busy one will be free.
//!
//! A task may be reserved for such a robot when it will be there sooner than any that is free, but only for a while
//! ([`reserve_ms`](crate::DispatcherSettings::reserve_ms)): what it does may take longer than its way.

use crate::assign::Candidate;
use crate::task::Task;
use crate::travel_cost::TravelCost;
use xtb_nav::{Car, MapPose};
use xtb_protocol::messages::{TaskKind, TaskState, Waypoint};

/// A robot with more way than this before it, in m, is not free soon.
const MAX_LEFT_M: f64 = 15.0;
/// What it has to be nearer by than one that is free, in m: its way is a guess.
const PREDICTION_MARGIN_M: f64 = 2.0;
/// How far a robot drives in a second, about: for the time that it stands at points.
const TYPICAL_SPEED_MPS: f64 = 0.5;

/// Where this car at `from` will be when it has done this task, and how much farther it counts for the way
/// until then; `None` = not soon, or nobody knows where.
#[must_use]
pub fn predict(task: &Task, car: &Car, from: MapPose, travel_cost: &dyn TravelCost) -> Option<Candidate> {
    let dwell_s = match task.spec.kind {
        TaskKind::Goto { .. } => 0.0,
        TaskKind::Route { dwell_s, .. } => dwell_s,
        TaskKind::Patrol { .. } | TaskKind::Wander { .. } => return None,
    };
    if task.state != TaskState::Running {
        return None;
    }
    let (mut pose, mut way_m) = (from, 0.0);
    for leg in task.legs_done..task.legs()? {
        let to = task.point(leg)?;
        way_m += travel_cost.distance_m(car, &pose, to) + dwell_s * TYPICAL_SPEED_MPS;
        if way_m > MAX_LEFT_M {
            return None;
        }
        pose = arrived(&pose, to);
    }
    Some(Candidate { pose, car: *car, extra_m: way_m + PREDICTION_MARGIN_M })
}

/// At a point, looking as it says, or the way that it came.
fn arrived(from: &MapPose, to: &Waypoint) -> MapPose {
    let yaw_rad = to.yaw_rad.unwrap_or_else(|| libm::atan2(to.y_m - from.y_m, to.x_m - from.x_m));
    MapPose { x_m: to.x_m, y_m: to.y_m, yaw_rad }
}
