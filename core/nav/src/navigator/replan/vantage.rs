//! Going to look first: where all ways lead past something of which only the face was seen, or through
//! obstacles that nobody has seen for a while, a place from which the beams of a bumper show more.

use super::caution::{CAUTION_LEVELS, CautionLevel, LEAST_CAREFUL, MOST_CAREFUL};
use super::search::{START_SLACK_M, Search, TOLERANCE_M, first_on};
use crate::MapPose;
use crate::geometry::path::wrap_rad;
use crate::geometry::{Cell, Path, apart_m};
use crate::navigator::MARGIN_M;
use crate::obstacle_layer::SURE_WITHIN_M;
use crate::planner::space::Space;
use crate::planner::{Planner, PlannerGoal};
use std::f64::consts::{PI, TAU};

/// What a search for a place to look from may cost, about 0.05 s on a small computer; chosen, not measured.
const EXPANSIONS: usize = 8_000;
/// And one for the way that it is all about: as the most careful level may.
const WAY_EXPANSIONS: usize = 50_000;
/// Of [`CAUTION_LEVELS`] so many are careful enough to go there: those that keep off what nobody has seen.
const CAREFUL: usize = 2;
/// Doubts on the way that are looked at in turn, …
const DOUBTS: usize = 3;
/// … and how far apart they are, in m; both chosen, not measured.
const APART_M: f64 = 0.2;
/// From the bumper to what is looked at, in m: as far as a reading says where, and nearer where there is no
/// room; a beam that gets through says 40 cm. Chosen, not measured.
const SIGHTS_M: [f64; 3] = [SURE_WITHIN_M, 0.27, 0.20];
/// Directions to look from, 15° apart; chosen, not measured.
const DIRECTIONS: u32 = 24;
/// Places that a path is looked for to; chosen, not measured.
const PLACES: usize = 8;
/// A place as near as this to where it stands shows nothing new, in m, …
const SAME_M: f64 = 0.10;
/// … with a heading as near as this, in rad; both chosen, not measured.
const SAME_RAD: f64 = 0.25;
/// Nearer than this to what is looked at nothing hides it, in m: it is part of it, a diagonal of a cell of 5
/// cm and a little.
const AT_IT_M: f64 = 0.09;
/// And so far beside the line of sight, in m: half of the way to the next beam, and a little.
const BESIDE_SIGHT_M: f64 = 0.04;
/// The yaw in which it looks, in rad: 6° move a beam by 3 cm at 30 cm, half of the way to the next one.
const TOLERANCE_RAD: f64 = 0.1;

impl Search<'_> {
    /// A path to where a doubt on the way to the goal can be seen.
    pub(super) fn vantage(&self, planner: &mut Planner) -> Option<Path> {
        let doubts = self.doubts(planner);
        CAUTION_LEVELS[..CAREFUL].iter().zip(&self.unseen).find_map(|(level, unseen)| {
            let space = self.space(level, &self.seen, unseen).ok()?;
            doubts.iter().find_map(|at| {
                let free = self.places(*at).filter(|pose| space.standing(pose).is_none());
                let mut places: Vec<(f64, MapPose)> = free.map(|pose| (self.far(&pose), pose)).collect();
                places.sort_by(|a, b| a.0.total_cmp(&b.0));
                places.iter().filter(|place| place.0 < f64::MAX).take(PLACES).find_map(|(_, pose)| {
                    let MapPose { x_m, y_m, yaw_rad } = *pose;
                    let (tolerance_m, tolerance_rad) = (TOLERANCE_M, TOLERANCE_RAD);
                    let goal = PlannerGoal { x_m, y_m, yaw_rad: Some(yaw_rad), tolerance_m, tolerance_rad };
                    let path = self.search(planner, &space, &goal, EXPANSIONS).ok()?;
                    self.blind(&path).is_empty().then_some(path)
                })
            })
        })
    }

    /// Things on the way to the goal that are only supposed to stand there, the first one first.
    fn doubts(&self, planner: &mut Planner) -> Vec<[f64; 2]> {
        let fresh: Vec<[f64; 2]> =
            self.seen.iter().filter(|point| !self.stale.contains(point)).copied().collect();
        let (all, careful, barely) = (&self.seen, MOST_CAREFUL, LEAST_CAREFUL);
        let ways = [(all, careful), (all, barely), (&fresh, careful), (&fresh, barely)];
        let path = ways.into_iter().find_map(|(seen, level)| {
            let level = CautionLevel { expansions: WAY_EXPANSIONS, ..*level };
            self.plan_with(planner, &level, seen, &[]).ok()
        });
        let Some(path) = path else { return Vec::new() };
        let mut doubts: Vec<[f64; 2]> = Vec::new();
        // Where it would go without looking first of all.
        for at in self.blind(&path) {
            let apart = doubts.iter().all(|b| apart_m(at, *b) >= APART_M);
            if apart && doubts.len() < DOUBTS {
                doubts.push(at);
            }
        }
        let most = doubts.len() + DOUBTS;
        let least_m = MARGIN_M + START_SLACK_M;
        let known = |point: &[f64; 2]| self.car.distance_m(&self.start, *point) <= least_m;
        while doubts.len() < most {
            let next = first_on(&path, &self.car.grown(MARGIN_M), |touches| {
                let supposed = self.unseen[0].iter().chain(&self.stale).filter(|point| !known(point));
                let apart = |a: &[f64; 2]| doubts.iter().all(|b| apart_m(*a, *b) >= APART_M);
                supposed.copied().find(|point| apart(point) && touches(point))
            });
            match next {
                Some(next) => doubts.push(next),
                None => break,
            }
        }
        doubts
    }

    /// Where a bumper faces a point with nothing in between.
    fn places(&self, at: [f64; 2]) -> impl Iterator<Item = MapPose> {
        let directions = (0..DIRECTIONS).map(|n| f64::from(n) * TAU / f64::from(DIRECTIONS));
        let sights = directions.flat_map(|towards| SIGHTS_M.map(|sight_m| (towards, sight_m)));
        sights.filter(move |&(towards, sight_m)| self.sees(at, towards, sight_m)).flat_map(
            move |(towards, sight_m)| {
                let (sin, cos) = libm::sincos(towards);
                let [ahead_m, astern_m] = [self.car.front_m, self.car.rear_m].map(|m| m + sight_m);
                [(ahead_m, towards), (astern_m, wrap_rad(towards + PI))].map(|(from_m, yaw_rad)| MapPose {
                    x_m: at[0] - from_m * cos,
                    y_m: at[1] - from_m * sin,
                    yaw_rad,
                })
            },
        )
    }

    /// Whether nothing hides a point from a bumper so far away.
    fn sees(&self, at: [f64; 2], towards: f64, sight_m: f64) -> bool {
        let (sin, cos) = libm::sincos(towards);
        let hides = |point: &[f64; 2]| {
            let (dx, dy) = (at[0] - point[0], at[1] - point[1]);
            let (before_m, beside_m) = (dx * cos + dy * sin, dy * cos - dx * sin);
            (AT_IT_M..sight_m).contains(&before_m) && beside_m.abs() < BESIDE_SIGHT_M
        };
        let grid = self.map.map.grid();
        let steps = libm::ceil(2.0 * sight_m / grid.resolution_m()) as u32;
        let mut line = (0..=steps).map(|step| sight_m * f64::from(step) / f64::from(steps));
        !self.seen.iter().any(hides) && line.all(|m| grid.at(at[0] - m * cos, at[1] - m * sin) == Cell::Free)
    }

    /// How far away a place is, with its turn; what shows nothing new is far.
    fn far(&self, pose: &MapPose) -> f64 {
        let away_m = libm::hypot(pose.x_m - self.start.x_m, pose.y_m - self.start.y_m);
        let turn_rad = wrap_rad(pose.yaw_rad - self.start.yaw_rad).abs();
        if away_m < SAME_M && turn_rad < SAME_RAD { f64::MAX } else { away_m + self.car.radius_m * turn_rad }
    }
}
