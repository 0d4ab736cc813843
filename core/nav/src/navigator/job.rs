//! A plan as a job: everything it needs in one value, to be worked off wherever there is time.

use super::blind::{GOES_ON_M, blind_on};
use super::follow::IN_THE_WAY_M;
use super::look::first_on;
use super::{Aim, Floor, LOOKOUT_M, MARGIN_M, RADIUS_FACTOR};
use crate::MapPose;
use crate::car::Car;
use crate::local::{LocalLayer, LocalObstacle};
use crate::path::Path;
use crate::planner::{End, Goal, PlanError, Planner, PlannerSettings};
use crate::rect::Rect;
use crate::space::{GridSpace, Hit, Layers, LookOut, Zones};
use std::sync::Arc;
use xtb_control::Stamp;

/// How careful a plan is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Care {
    /// Room beside the body, in m.
    pub(super) margin_m: f64,
    /// What was seen goes on so far where nobody has looked, in m.
    pub(super) unseen_m: f64,
    /// As much as the search may cost.
    pub(super) expansions: usize,
}

/// As careful as there is room, least last. A search that finds nothing costs most, so only the last ones
/// may take long: 300 000 expansions are about two seconds on a small computer. The last one is for what the
/// map knows exactly, and never taken past anything that is not on it.
pub(super) const CARES: [Care; 5] = [
    Care { margin_m: MARGIN_M, unseen_m: 0.40, expansions: 50_000 },
    Care { margin_m: MARGIN_M, unseen_m: 0.20, expansions: 100_000 },
    Care { margin_m: MARGIN_M, unseen_m: 0.0, expansions: 100_000 },
    Care { margin_m: 0.03, unseen_m: 0.0, expansions: 100_000 },
    Care { margin_m: 0.005, unseen_m: 0.0, expansions: 300_000 },
];
/// From this one of them on there is less room than [`MARGIN_M`].
pub(super) const MARGINAL: usize = 3;
/// As if it were a zone: where what is not on the map may go on.
const UNSEEN: &str = "unseen";
/// Where the truck stands it may be nearer than this to what nobody has seen, in m.
pub(super) const STANDS_M: f64 = 0.04;

/// A path ends this near to its goal: the follower needs the rest of the box for itself.
pub(super) const TOLERANCE_M: f64 = 0.05;
/// And this near to its yaw.
const TOLERANCE_RAD: f64 = 0.05;
/// Paths that lead the body where no beam looks first are replaced so often by one that keeps off there.
const ROUNDS: u32 = 6;
/// Kept free beside another robot, on top of the margin, in m.
const BESIDE_M: f64 = 0.08;
/// Others move on: a search around them costs no more than this.
const AMONG_OTHERS: usize = 60_000;
/// A mark that was not seen for this long is not in sight.
const IN_SIGHT_MS: u64 = 1_000;

/// A path to look for.
#[derive(Debug, Clone)]
pub struct PlanJob {
    /// For the answer.
    pub(super) number: u64,
    pub(super) now: Stamp,
    pub(super) floor: Arc<Floor>,
    /// What is not on the map.
    pub(super) layer: LocalLayer,
    /// Marks count that were seen within this time.
    pub(super) lately_ms: u64,
    /// Whether it may go and look first.
    pub(super) may_look: bool,
    pub(super) car: Car,
    /// As fast as it drives on a straight way.
    pub(super) cruise_mps: f64,
    pub(super) start: MapPose,
    pub(super) aim: Aim,
    /// Robots that stand around.
    pub(super) others: Vec<(String, MapPose)>,
    /// Not to the goal, but out of what somebody drives through.
    pub(super) retreat: Option<Vec<Rect>>,
}

/// A job that is being worked off.
pub(super) struct Search<'a> {
    job: &'a PlanJob,
    /// What is not on the map, (x, y) in m.
    pub(super) local: Vec<[f64; 2]>,
    /// Where that may go on, for each of [`CARES`].
    pub(super) unseen: [Vec<[f64; 2]>; CARES.len()],
    /// Those that are not in sight now, doubts among them.
    pub(super) stale: Vec<[f64; 2]>,
    /// Where something thin was met.
    pub(super) thin: Vec<[f64; 2]>,
    /// Where something may stand for all that is known.
    pub(super) unverified: Vec<[f64; 2]>,
    /// Of the robots that stand around, (x, y) in m.
    pub(super) bodies: Vec<[f64; 2]>,
}

impl std::ops::Deref for Search<'_> {
    type Target = PlanJob;

    fn deref(&self) -> &PlanJob {
        self.job
    }
}

/// What came of a job.
#[derive(Debug, Clone)]
pub struct PlanDone {
    pub(super) number: u64,
    pub(super) result: Result<Planned, PlanFailure>,
    /// Who is in the way, where there is no path because of a robot.
    pub(super) by: Option<Blamed>,
}

/// A robot that is in the way.
#[derive(Debug, Clone)]
pub(super) struct Blamed {
    pub(super) name: String,
    /// The path without it.
    pub(super) planned: Planned,
}

/// A path, and what it is for.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Planned {
    pub(super) path: Path,
    /// It leads to where something can be seen, not to the goal.
    pub(super) look: bool,
    /// Where something thin turns up on the way it need not be planned anew.
    pub(super) wary: bool,
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
    /// Works it off; takes milliseconds, in bad cases seconds.
    #[must_use]
    pub fn run(&self, planner: &mut Planner) -> PlanDone {
        let age_ms = |mark: &LocalObstacle| self.now.since_ms(mark.seen);
        let marks = |counts: &dyn Fn(u64) -> bool| {
            let counting = self.layer.obstacles(self.now).filter(|mark| counts(age_ms(mark)));
            counting.map(|mark| [mark.x_m, mark.y_m]).collect::<Vec<_>>()
        };
        let mut stale = marks(&|age_ms| age_ms > IN_SIGHT_MS);
        stale.extend(self.layer.doubts(self.now).map(|mark| [mark.x_m, mark.y_m]));
        let search = Search {
            job: self,
            local: marks(&|age_ms| age_ms < self.lately_ms),
            unseen: CARES.map(|care| self.layer.unseen_around(self.now, care.unseen_m)),
            stale,
            thin: self.layer.thin().collect(),
            unverified: self.layer.unverified(
                self.now,
                GOES_ON_M,
                [self.start.x_m, self.start.y_m],
                f64::MAX,
            ),
            bodies: self.bodies(),
        };
        if let Some(sweep) = &self.retreat {
            return PlanDone { number: self.number, result: search.back(planner, sweep), by: None };
        }
        let result = search.plan(planner);
        if result.is_ok() || search.bodies.is_empty() {
            return PlanDone { number: self.number, result, by: None };
        }
        // Is it one of them, or would there be no way without them either?
        match (Search { bodies: Vec::new(), ..search }).plan(planner) {
            Ok(planned) => {
                let by = self.first_on(&planned.path).map(|name| Blamed { name, planned });
                PlanDone { number: self.number, result, by }
            }
            failed => PlanDone { number: self.number, result: failed, by: None },
        }
    }

    /// Points of the robots that stand around, with some room, but none where it stands itself.
    fn bodies(&self) -> Vec<[f64; 2]> {
        let bodies = self.others.iter().flat_map(|(_, pose)| points_of(&self.car.grown(BESIDE_M), pose));
        let own = self.car.grown(MARGIN_M + STANDS_M);
        bodies.filter(|point| own.distance_m(&self.start, *point) > 0.0).collect()
    }

    /// The first robot on a path, or else the nearest.
    fn first_on(&self, path: &Path) -> Option<String> {
        let body = self.car.grown(BESIDE_M + MARGIN_M);
        let first = first_on(path, &body, |touches| {
            let points = self.others.iter().flat_map(|(_, pose)| points_of(&self.car, pose));
            points.into_iter().find(|point| touches(point))
        });
        let from = first.unwrap_or([self.start.x_m, self.start.y_m]);
        let far_m = |pose: &MapPose| self.car.distance_m(pose, from);
        let near = self.others.iter().min_by(|a, b| far_m(&a.1).total_cmp(&far_m(&b.1)));
        near.map(|(name, _)| name.clone())
    }
}

impl Search<'_> {
    fn plan(&self, planner: &mut Planner) -> Result<Planned, PlanFailure> {
        let mut last = PlanFailure::for_good("no plan was made".to_owned());
        let stranger = !self.unverified.is_empty();
        for (index, (care, unseen)) in CARES.iter().zip(&self.unseen).enumerate() {
            let same = !stranger && index > 0 && care.margin_m == MARGIN_M;
            if same || (stranger && index + 1 == CARES.len()) {
                continue;
            }
            let path = self.plan_looking(planner, care, unseen);
            let path = if index < MARGINAL {
                path
            } else {
                path.and_then(|path| self.with_room(planner, care, unseen, path))
            };
            match path {
                Ok(path) => return Ok(self.least_unseen(planner, care, unseen, path)),
                Err(failure) => last = failure,
            }
            if index == 0
                && self.may_look
                && stranger
                && let Some(path) = self.look(planner)
            {
                return Ok(Planned { path, look: true, wary: true });
            }
        }
        if !stranger {
            return Err(PlanFailure { for_good: !last.enclosed, ..last });
        }
        // Is it the map, or only what stands around today?
        match self.plan_with(planner, &CARES[CARES.len() - 1], &[], &[]) {
            Ok(path) => {
                let things = || self.local.iter().chain(&self.stale).copied();
                let at = [IN_THE_WAY_M, LOOKOUT_M].into_iter().find_map(|room_m| {
                    first_on(&path, &self.car.grown(room_m), |touches| things().find(|p| touches(p)))
                });
                let nearest = |at: [f64; 2]| {
                    let off_m = |a: &[f64; 2]| libm::hypot(a[0] - at[0], a[1] - at[1]);
                    things().min_by(|a, b| off_m(a).total_cmp(&off_m(b))).filter(|a| off_m(a) <= GOES_ON_M)
                };
                let last_at = last.at.map(|at| nearest(at).unwrap_or(at));
                Err(PlanFailure { at: at.or(last_at), ..last })
            }
            Err(failure) => Err(PlanFailure { for_good: !failure.enclosed, ..failure }),
        }
    }

    /// A path that leads the body nowhere near a thing where no beam looks first.
    fn plan_looking(
        &self,
        planner: &mut Planner,
        care: &Care,
        unseen: &[[f64; 2]],
    ) -> Result<Path, PlanFailure> {
        let mut unseen = unseen.to_vec();
        let mut at = None;
        for _ in 0..ROUNDS {
            let path = self.plan_with(planner, care, &self.local, &unseen)?;
            let blind = self.blind(&path);
            if blind.is_empty() {
                return Ok(path);
            }
            at = at.or(blind.first().copied());
            unseen.extend(blind);
        }
        let words = "no way past it on which it could be looked at".to_owned();
        Err(PlanFailure { words, at, for_good: false, enclosed: false })
    }

    /// Where a path leads the body without looking.
    pub(super) fn blind(&self, path: &Path) -> Vec<[f64; 2]> {
        let ways_m = [0.0, path.length_m()];
        blind_on(path, ways_m, &self.car, &self.unverified).into_iter().map(|(_, at)| at).collect()
    }

    /// Keep-out zones, and where what is not on the map may go on: the body keeps off both, while the
    /// look-out may reach into either.
    fn zones(&self, care: &Care, unseen: &[[f64; 2]]) -> Zones {
        let grid = self.floor.map.grid();
        let mut zones = self.floor.zones.keep_outs.clone();
        zones.cells.resize(grid.cells().len(), 0);
        zones.names.push(UNSEEN.to_owned());
        let number = zones.names.len() as u16;
        let least_m = care.margin_m + STANDS_M;
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
    pub(super) fn goal(&self) -> Goal {
        let Aim { x_m, y_m, yaw_rad } = self.aim;
        Goal { x_m, y_m, yaw_rad, tolerance_m: TOLERANCE_M, tolerance_rad: TOLERANCE_RAD }
    }

    pub(super) fn plan_with(
        &self,
        planner: &mut Planner,
        care: &Care,
        local: &[[f64; 2]],
        unseen: &[[f64; 2]],
    ) -> Result<Path, PlanFailure> {
        self.search(planner, &self.space(care, local, unseen)?, &self.goal(), care.expansions)
    }

    /// The world as this care has it.
    pub(super) fn space(
        &self,
        care: &Care,
        local: &[[f64; 2]],
        unseen: &[[f64; 2]],
    ) -> Result<GridSpace, PlanFailure> {
        let car = Car { radius_m: self.car.radius_m * RADIUS_FACTOR, ..self.car };
        self.space_for(&car, care, local, unseen)
    }

    /// The same for a car that turns as tightly as this one.
    pub(super) fn space_for(
        &self,
        car: &Car,
        care: &Care,
        local: &[[f64; 2]],
        unseen: &[[f64; 2]],
    ) -> Result<GridSpace, PlanFailure> {
        let margin_m = care.margin_m;
        let car = car.grown(margin_m);
        let zones = self.zones(care, unseen);
        let mut things = [local, &self.bodies].concat();
        if care.unseen_m > 0.0 {
            let half_m = self.floor.map.grid().resolution_m() / 2.0;
            let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
            things.extend(local.iter().flat_map(|[x_m, y_m]| {
                corners.map(|[east, north]| [x_m + east * half_m, y_m + north * half_m])
            }));
        }
        let layers = Layers {
            grid: self.floor.map.grid(),
            zones: Some(&zones),
            one_way: self.floor.zones.one_way.as_deref(),
            local_m: &things,
        };
        let look_out = LookOut { ahead_m: LOOKOUT_M - margin_m, half_width_m: 0.2 };
        GridSpace::new(&layers, car, look_out).map_err(|error| PlanFailure::for_good(error.to_string()))
    }

    /// A path in it, for so many expansions.
    pub(super) fn search(
        &self,
        planner: &mut Planner,
        space: &GridSpace,
        goal: &Goal,
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
        goal: &Goal,
        expansions: usize,
    ) -> Result<Path, PlanFailure> {
        let most_expansions = if self.bodies.is_empty() { expansions } else { expansions.min(AMONG_OTHERS) };
        let settings = PlannerSettings { most_expansions, ..PlannerSettings::default() };
        match planner.plan_on_grid(space, start, goal, &settings, &mut || true) {
            Ok(plan) => Ok(plan.path),
            Err(error) => Err(failure(&error)),
        }
    }
}

/// Points of a body that no cell of a map lies between.
pub(super) fn points_of(car: &Car, pose: &MapPose) -> Vec<[f64; 2]> {
    const STEP_M: f64 = 0.05;
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let steps = |from_m: f64, to_m: f64| {
        let steps = libm::ceil((to_m - from_m) / STEP_M);
        (0..=steps as u32).map(move |step| from_m + (to_m - from_m) * f64::from(step) / steps)
    };
    let all = steps(-car.rear_m, car.front_m)
        .flat_map(|ahead_m| steps(-car.half_width_m, car.half_width_m).map(move |left_m| (ahead_m, left_m)));
    all.map(|(ahead, left)| [pose.x_m + ahead * cos - left * sin, pose.y_m + ahead * sin + left * cos])
        .collect()
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
    let words = error.to_string().replace("keep-out unseen", "what nobody has looked at");
    PlanFailure { words, at, for_good: false, enclosed }
}
