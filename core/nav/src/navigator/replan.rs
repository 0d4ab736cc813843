//! A path to the goal as a job: everything it needs in one value, to be worked off wherever there is time.
//!
//! ```text
//!   PlanJob ──► from most to least careful (`caution`): a path off what was seen, and off unseen floor
//!                  │ none           │ found (`search`)
//!                  │                ├─ tight: its stretches again with the whole margin (`roominess`)
//!                  │                └─ the one of wider bends that is worth it (`path_choice`),
//!                  │                   near thin things with looks aside (`side_scan`)
//!                  ├─ at the first level: to where a doubt can be seen (`vantage`)
//!                  ├─ because of a robot: which one, and the path without it
//!                  └─ none at all: why, and where
//! ```
//! Whoever has to make room for another robot gets a path out of its way instead (`retreat`).

mod caution;
mod job;
mod path_choice;
mod retreat;
mod roominess;
mod search;
mod side_scan;
mod vantage;
mod visibility_grid;

pub(super) use job::{Blocker, Planned};
pub use job::{PlanDone, PlanFailure, PlanJob};

use super::visibility::{GOES_ON_M, IN_THE_WAY_M};
use super::{LOOK_OUT_M, MARGIN_M, ROBOT_MARGIN_M};
use crate::MapPose;
use crate::geometry::{Path, apart_m};
use crate::planner::Planner;
use crate::planner::space::GridSpace;
use caution::{CAUTION_LEVELS, CautionLevel, LEAST_CAREFUL};
use search::{START_SLACK_M, Search, first_on};

/// Paths that lead the body where no beam looks first are replaced so often by one that keeps off there;
/// chosen, not measured.
const ROUNDS: u32 = 6;
/// An obstacle that was not seen for this long, 26 scans, is not in sight; chosen, not measured.
const IN_SIGHT_MS: u64 = 1_000;

impl PlanJob {
    /// Works it off; takes milliseconds, in bad cases seconds.
    #[must_use]
    pub fn run(&self, planner: &mut Planner) -> PlanDone {
        let points = |counts: &dyn Fn(u64) -> bool| {
            let all = self.obstacles.obstacles(self.now);
            let counting = all.filter(|obstacle| counts(self.now.since_ms(obstacle.seen)));
            counting.map(|obstacle| [obstacle.x_m, obstacle.y_m]).collect::<Vec<_>>()
        };
        let mut stale = points(&|age_ms| age_ms > IN_SIGHT_MS);
        stale.extend(self.obstacles.doubts(self.now).map(|doubt| [doubt.x_m, doubt.y_m]));
        let here = [self.start.x_m, self.start.y_m];
        let search = Search {
            job: self,
            seen: points(&|age_ms| age_ms < self.seen_within_ms),
            unseen: CAUTION_LEVELS.map(|level| self.obstacles.unseen_around(self.now, level.unseen_m)),
            stale,
            unobserved: self.obstacles.unobserved(self.now, GOES_ON_M, here, f64::MAX),
            robots: self.robots(),
        };
        if let Some(sweep) = &self.retreat {
            return PlanDone { number: self.number, result: search.retreat(planner, sweep), by: None };
        }
        let result = search.plan(planner);
        if result.is_ok() || search.robots.is_empty() {
            return PlanDone { number: self.number, result, by: None };
        }
        // Is it one of them, or would there be no way without them either?
        match (Search { robots: Vec::new(), ..search }).plan(planner) {
            Ok(planned) => {
                let by = self.first_on(&planned.path).map(|name| Blocker { name, planned });
                PlanDone { number: self.number, result, by }
            }
            failed => PlanDone { number: self.number, result: failed, by: None },
        }
    }

    /// Points of the robots that stand around, with some room, but none where it stands itself.
    fn robots(&self) -> Vec<[f64; 2]> {
        let points =
            self.others.iter().flat_map(|(_, pose)| self.car.grown(ROBOT_MARGIN_M).body_points(pose));
        let own = self.car.grown(MARGIN_M + START_SLACK_M);
        points.filter(|point| own.distance_m(&self.start, *point) > 0.0).collect()
    }

    /// The first robot on a path, or else the nearest.
    fn first_on(&self, path: &Path) -> Option<String> {
        let body = self.car.grown(ROBOT_MARGIN_M + MARGIN_M);
        let first = first_on(path, &body, |touches| {
            let points = self.others.iter().flat_map(|(_, pose)| self.car.body_points(pose));
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
        let mut last = PlanFailure::for_good("no plan".to_owned());
        let obstacles_known = !self.unobserved.is_empty();
        for (index, (level, unseen)) in CAUTION_LEVELS.iter().zip(&self.unseen).enumerate() {
            let same = !obstacles_known && index > 0 && level.keeps_margin();
            if same || (obstacles_known && index + 1 == CAUTION_LEVELS.len()) {
                continue;
            }
            let planned = self.space(level, &self.seen, unseen).and_then(|space| {
                let path = self.plan_observed(planner, level, &space, unseen)?;
                let path = match level.keeps_margin() {
                    true => path,
                    false => self.with_room(planner, level, unseen, path)?,
                };
                Ok(self.least_blind(planner, level, &space, path))
            });
            match planned {
                Ok(planned) => return Ok(planned),
                Err(failure) => last = failure,
            }
            if index == 0
                && self.vantage_allowed
                && obstacles_known
                && let Some(path) = self.vantage(planner)
            {
                return Ok(Planned { path, to_vantage: true, expects_thin: true });
            }
        }
        if !obstacles_known {
            return Err(PlanFailure { for_good: !last.enclosed, ..last });
        }
        // Is it the map, or only what stands around today?
        match self.plan_with(planner, LEAST_CAREFUL, &[], &[]) {
            Ok(path) => {
                let things = || self.seen.iter().chain(&self.stale).copied();
                let at = [IN_THE_WAY_M, LOOK_OUT_M].into_iter().find_map(|room_m| {
                    first_on(&path, &self.car.grown(room_m), |touches| things().find(|p| touches(p)))
                });
                let nearest = |at: [f64; 2]| {
                    let off_m = |a: &[f64; 2]| apart_m(*a, at);
                    things().min_by(|a, b| off_m(a).total_cmp(&off_m(b))).filter(|a| off_m(a) <= GOES_ON_M)
                };
                let last_at = last.at.map(|at| nearest(at).unwrap_or(at));
                Err(PlanFailure { at: at.or(last_at), ..last })
            }
            Err(failure) => Err(PlanFailure { for_good: !failure.enclosed, ..failure }),
        }
    }

    /// A path that leads the body nowhere near a thing where no beam looks first. `space` is the world as this level
    /// has it, with `unseen`.
    fn plan_observed(
        &self,
        planner: &mut Planner,
        level: &CautionLevel,
        space: &GridSpace,
        unseen: &[[f64; 2]],
    ) -> Result<Path, PlanFailure> {
        let mut unseen = unseen.to_vec();
        let mut at = None;
        for round in 0..ROUNDS {
            let path = match round {
                0 => self.search(planner, space, &self.goal(), level.expansions)?,
                _ => self.plan_with(planner, level, &self.seen, &unseen)?,
            };
            let blind = self.blind(&path);
            if blind.is_empty() {
                return Ok(path);
            }
            at = at.or(blind.first().copied());
            unseen.extend(blind);
        }
        Err(PlanFailure::at_present("no path around it that lets the range finders see it", at))
    }
}
