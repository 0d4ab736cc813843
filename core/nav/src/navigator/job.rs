//! A plan as a job: everything it needs in one value, to be worked off wherever there is time.

use super::{Aim, LOOKOUT_M, MARGIN_M, RADIUS_FACTOR};
use crate::MapPose;
use crate::car::Car;
use crate::map::{Map, ZoneLayers};
use crate::path::Path;
use crate::planner::{End, Goal, PlanError, Planner, PlannerSettings};
use crate::space::{GridSpace, Hit, Layers, LookOut};
use std::sync::Arc;

/// Room beside the body, in m: as much as there is, least last.
const MARGINS_M: [f64; 3] = [MARGIN_M, 0.03, 0.005];

/// A path ends this near to its goal: the follower needs the rest of the box for itself.
const TOLERANCE_M: f64 = 0.05;
/// And this near to its yaw.
const TOLERANCE_RAD: f64 = 0.05;
/// About two seconds on a small computer.
const EXPANSIONS: usize = 300_000;

/// A path to look for.
#[derive(Debug, Clone)]
pub struct PlanJob {
    /// For the answer.
    pub(super) number: u64,
    pub(super) map: Arc<Map>,
    pub(super) zones: Arc<ZoneLayers>,
    /// What is not on the map, (x, y) in m.
    pub(super) local: Vec<[f64; 2]>,
    pub(super) car: Car,
    pub(super) start: MapPose,
    pub(super) aim: Aim,
}

/// What came of a job.
#[derive(Debug, Clone)]
pub struct PlanDone {
    pub(super) number: u64,
    pub(super) result: Result<Path, PlanFailure>,
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
    pub(super) fn for_good(words: String) -> Self {
        Self { words, at: None, for_good: true, enclosed: false }
    }
}

impl PlanJob {
    /// Works it off; takes milliseconds, in bad cases a few hundred.
    #[must_use]
    pub fn run(&self, planner: &mut Planner) -> PlanDone {
        PlanDone { number: self.number, result: self.plan(planner) }
    }

    fn plan(&self, planner: &mut Planner) -> Result<Path, PlanFailure> {
        let mut first = None;
        for margin_m in MARGINS_M {
            match self.plan_with(planner, margin_m, &self.local) {
                Ok(path) => return Ok(path),
                Err(error) => first = Some(first.unwrap_or(error)),
            }
        }
        let error = first.unwrap_or_else(|| PlanFailure::for_good("no plan was made".to_owned()));
        // Is it the map, or only what stands around today?
        let alone = self.local.is_empty() || self.plan_with(planner, MARGINS_M[1], &[]).is_err();
        Err(PlanFailure { for_good: alone, ..error })
    }

    fn plan_with(
        &self,
        planner: &mut Planner,
        margin_m: f64,
        local: &[[f64; 2]],
    ) -> Result<Path, PlanFailure> {
        let car = Car { radius_m: self.car.radius_m * RADIUS_FACTOR, ..self.car.grown(margin_m) };
        let layers = Layers {
            grid: self.map.grid(),
            zones: Some(&self.zones.keep_outs),
            one_way: self.zones.one_way.as_deref(),
            local_m: local,
        };
        let look_out = LookOut { ahead_m: LOOKOUT_M - margin_m, half_width_m: 0.2 };
        let space = GridSpace::new(&layers, car, look_out)
            .map_err(|error| PlanFailure::for_good(error.to_string()))?;
        let Aim { x_m, y_m, yaw_rad } = self.aim;
        let goal = Goal { x_m, y_m, yaw_rad, tolerance_m: TOLERANCE_M, tolerance_rad: TOLERANCE_RAD };
        let settings = PlannerSettings { most_expansions: EXPANSIONS, ..PlannerSettings::default() };
        match planner.plan_on_grid(&space, &self.start, &goal, &settings, &mut || true) {
            Ok(plan) => Ok(plan.path),
            Err(error) => Err(failure(&error)),
        }
    }
}

fn failure(error: &PlanError) -> PlanFailure {
    let hit = |hit: &Hit| Some([hit.x_m, hit.y_m]);
    let at = match error {
        PlanError::StartInCollision(at) | PlanError::GoalInCollision(at) => hit(at),
        PlanError::GoalKeptOut { at, .. } => hit(at),
        PlanError::Unreachable { at_m, by, .. } => by.as_ref().map_or(Some(*at_m), hit),
        PlanError::Budget { nearest, by, .. } => by.as_ref().map_or(Some([nearest.x_m, nearest.y_m]), hit),
        PlanError::NotAPose(_) | PlanError::Settings(_) => None,
    };
    let enclosed =
        matches!(error, PlanError::StartInCollision(_) | PlanError::Unreachable { end: End::Start, .. });
    PlanFailure { words: error.to_string(), at, for_good: false, enclosed }
}
