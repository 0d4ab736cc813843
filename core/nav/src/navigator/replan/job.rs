//! A path to look for, with everything that takes in one value, and what comes of it.

use crate::MapPose;
use crate::geometry::{Car, Path, Rect};
use crate::navigator::{PreparedMap, TargetPose};
use crate::obstacle_layer::ObstacleLayer;
use std::sync::Arc;
use xtb_control::Stamp;

/// A path to look for.
#[derive(Debug, Clone)]
pub struct PlanJob {
    /// For the answer.
    pub(in crate::navigator) number: u64,
    pub(in crate::navigator) now: Stamp,
    pub(in crate::navigator) map: Arc<PreparedMap>,
    /// What is not on the map.
    pub(in crate::navigator) obstacles: ObstacleLayer,
    /// Obstacles count that were seen within this time.
    pub(in crate::navigator) seen_within_ms: u64,
    /// Whether it may go and look first.
    pub(in crate::navigator) vantage_allowed: bool,
    pub(in crate::navigator) car: Car,
    /// As fast as it drives on a straight way.
    pub(in crate::navigator) cruise_mps: f64,
    pub(in crate::navigator) start: MapPose,
    pub(in crate::navigator) target: TargetPose,
    /// Robots that stand around.
    pub(in crate::navigator) others: Vec<(String, MapPose)>,
    /// Not to the goal, but out of what somebody drives through.
    pub(in crate::navigator) retreat: Option<Vec<Rect>>,
}

/// What came of a job.
#[derive(Debug, Clone)]
pub struct PlanDone {
    pub(in crate::navigator) number: u64,
    pub(in crate::navigator) result: Result<Planned, PlanFailure>,
    /// Who is in the way, where there is no path because of a robot.
    pub(in crate::navigator) by: Option<Blocker>,
}

/// A robot that is in the way.
#[derive(Debug, Clone)]
pub(in crate::navigator) struct Blocker {
    pub(in crate::navigator) name: String,
    /// The path without it.
    pub(in crate::navigator) planned: Planned,
}

/// A path, and what it is for.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::navigator) struct Planned {
    pub(in crate::navigator) path: Path,
    /// It leads to where something can be seen, not to the goal.
    pub(in crate::navigator) to_vantage: bool,
    /// Where something thin turns up on the way it need not be planned anew.
    pub(in crate::navigator) expects_thin: bool,
}

/// Why there is no path.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanFailure {
    /// In words.
    pub words: String,
    /// Where something is in the way, (x, y) in m.
    pub at: Option<[f64; 2]>,
    /// The map itself says so: trying again changes nothing.
    pub for_good: bool,
    /// It cannot even leave the place where it stands.
    pub enclosed: bool,
}

impl PlanFailure {
    /// Nothing that time could change.
    pub(in crate::navigator) fn for_good(words: String) -> Self {
        Self { words, at: None, for_good: true, enclosed: false }
    }

    /// Something that stands there today.
    pub(super) fn at_present(words: &str, at: Option<[f64; 2]>) -> Self {
        Self { words: words.to_owned(), at, for_good: false, enclosed: false }
    }
}
