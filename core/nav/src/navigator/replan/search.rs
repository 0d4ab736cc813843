//! One search of a job: the world as a level of caution has it, and a path in it.

use super::caution::{CAUTION_LEVELS, CautionLevel};
use super::job::{PlanFailure, PlanJob};
use crate::MapPose;
use crate::geometry::{Car, Path};
use crate::map::Zones;
use crate::navigator::visibility::{BODY_STEP_M, blind_points};
use crate::navigator::{LOOK_OUT_M, RADIUS_FACTOR, TargetPose};
use crate::planner::space::{GridLayers, GridSpace, Hit, LookOut};
use crate::planner::{End, PlanError, Planner, PlannerGoal, PlannerSettings};

/// As if it were a zone: where what is not on the map may go on.
const UNSEEN_ZONE: &str = "unseen";
/// Where the truck stands it may be nearer than this to what nobody has seen, in m, or it could not begin;
/// chosen, not measured.
pub(super) const START_SLACK_M: f64 = 0.04;
/// A path ends this near to its goal: the follower needs the rest of the box of 20 cm
/// (`navigation.arrival.tolerance_m`) for itself.
pub(super) const TOLERANCE_M: f64 = 0.05;
/// And this near to its yaw, 3° of 15° (`navigation.arrival.tolerance_deg`).
const TOLERANCE_RAD: f64 = 0.05;
/// Others move on: a search around them costs no more than this, about 0.4 s on a small computer.
const MOST_AMONG_ROBOTS: usize = 60_000;

/// A job that is being worked off.
pub(super) struct Search<'a> {
    pub(super) job: &'a PlanJob,
    /// What is not on the map, (x, y) in m.
    pub(super) seen: Vec<[f64; 2]>,
    /// Where that may go on, for each of [`CAUTION_LEVELS`].
    pub(super) unseen: [Vec<[f64; 2]>; CAUTION_LEVELS.len()],
    /// Those that are not in sight now, doubts among them.
    pub(super) stale: Vec<[f64; 2]>,
    /// Where something may stand for all that is known.
    pub(super) unobserved: Vec<[f64; 2]>,
    /// Of the robots that stand around, (x, y) in m.
    pub(super) robots: Vec<[f64; 2]>,
}

impl std::ops::Deref for Search<'_> {
    type Target = PlanJob;

    fn deref(&self) -> &PlanJob {
        self.job
    }
}

impl Search<'_> {
    /// Where a path leads the body without looking.
    pub(super) fn blind(&self, path: &Path) -> Vec<[f64; 2]> {
        let ways_m = [0.0, path.length_m()];
        let blind = blind_points(path, ways_m, (&self.car, self.obstacles.sight()), &self.unobserved);
        blind.into_iter().map(|(_, at)| at).collect()
    }

    /// Keep-out zones, and where what is not on the map may go on: the body keeps off both, while the
    /// look-out may reach into either.
    fn zones(&self, level: &CautionLevel, unseen: &[[f64; 2]]) -> Zones {
        let grid = self.map.map.grid();
        let mut zones = self.map.zones.keep_outs.clone();
        zones.cells.resize(grid.cells().len(), 0);
        zones.names.push(UNSEEN_ZONE.to_owned());
        let number = zones.names.len() as u16;
        let least_m = level.margin_m + START_SLACK_M;
        for point in unseen.iter().filter(|point| self.car.distance_m(&self.start, **point) > least_m) {
            let (column, row) = grid.place(point[0], point[1]);
            let (Ok(column), Ok(row)) = (usize::try_from(column), usize::try_from(row)) else { continue };
            if column < grid.width() && row < grid.height() {
                let zone = &mut zones.cells[row * grid.width() + column];
                *zone = if *zone == 0 { number } else { *zone };
            }
        }
        zones
    }

    /// The goal itself.
    pub(super) fn goal(&self) -> PlannerGoal {
        let TargetPose { x_m, y_m, yaw_rad } = self.target;
        PlannerGoal { x_m, y_m, yaw_rad, tolerance_m: TOLERANCE_M, tolerance_rad: TOLERANCE_RAD }
    }

    pub(super) fn plan_with(
        &self,
        planner: &mut Planner,
        level: &CautionLevel,
        seen: &[[f64; 2]],
        unseen: &[[f64; 2]],
    ) -> Result<Path, PlanFailure> {
        self.search(planner, &self.space(level, seen, unseen)?, &self.goal(), level.expansions)
    }

    /// The world as this level of caution has it.
    pub(super) fn space(
        &self,
        level: &CautionLevel,
        seen: &[[f64; 2]],
        unseen: &[[f64; 2]],
    ) -> Result<GridSpace, PlanFailure> {
        let zones = self.zones(level, unseen);
        let mut things = [seen, &self.robots].concat();
        if level.unseen_m > 0.0 {
            let half_m = self.map.map.grid().resolution_m() / 2.0;
            let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
            things.extend(seen.iter().flat_map(|[x_m, y_m]| {
                corners.map(|[east, north]| [x_m + east * half_m, y_m + north * half_m])
            }));
        }
        let layers = GridLayers {
            grid: self.map.map.grid(),
            zones: Some(&zones),
            one_way: self.map.zones.one_way.as_deref(),
            local_m: &things,
        };
        let (car, look_out) = self.planned_car(level, RADIUS_FACTOR);
        GridSpace::new(&layers, car, look_out).map_err(|error| PlanFailure::for_good(error.to_string()))
    }

    /// The car at this level of caution, with its tightest circle so many times as large, and how far it looks out.
    pub(super) fn planned_car(&self, level: &CautionLevel, wider: f64) -> (Car, LookOut) {
        let car = Car { radius_m: self.car.radius_m * wider, ..self.car };
        let half_width_m = self.obstacles.sight().look_out_half_m();
        (car.grown(level.margin_m), LookOut { ahead_m: LOOK_OUT_M - level.margin_m, half_width_m })
    }

    /// A path in it, for so many expansions.
    pub(super) fn search(
        &self,
        planner: &mut Planner,
        space: &GridSpace,
        goal: &PlannerGoal,
        expansions: usize,
    ) -> Result<Path, PlanFailure> {
        self.search_from(planner, space, &self.start, goal, expansions)
    }

    /// The same from another place.
    pub(super) fn search_from(
        &self,
        planner: &mut Planner,
        space: &GridSpace,
        start: &MapPose,
        goal: &PlannerGoal,
        expansions: usize,
    ) -> Result<Path, PlanFailure> {
        let most_expansions =
            if self.robots.is_empty() { expansions } else { expansions.min(MOST_AMONG_ROBOTS) };
        let settings = PlannerSettings { most_expansions, ..PlannerSettings::default() };
        match planner.plan_on_grid(space, start, goal, &settings, &mut || true) {
            Ok(plan) => Ok(plan.path),
            Err(error) => Err(failure(&error)),
        }
    }
}

/// The first of some points that a body touches on its path.
pub(super) fn first_on(
    path: &Path,
    body: &Car,
    find: impl Fn(&dyn Fn(&[f64; 2]) -> bool) -> Option<[f64; 2]>,
) -> Option<[f64; 2]> {
    let steps = libm::ceil(path.length_m() / BODY_STEP_M) as u32;
    (0..=steps).find_map(|step| {
        let (pose, _) = path.at(f64::from(step) * BODY_STEP_M);
        find(&|point| body.distance_m(&pose, *point) <= 0.0)
    })
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
    let words = error.to_string().replace("keep-out unseen", "an unobserved area");
    PlanFailure { words, at, for_good: false, enclosed }
}
