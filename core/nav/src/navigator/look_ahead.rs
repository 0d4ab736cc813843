//! The way ahead: what is in it, how much room there is beside it, and where no beam has looked.

use super::following::Following;
use super::turn::Sensed;
use super::visibility::{BODY_STEP_M, GOES_ON_M, IN_THE_WAY_M, blind_points};
use super::{LOOK_OUT_M, MARGIN_M, Navigator};
use crate::geometry::Car;
use xtb_control::Stamp;

/// The way ahead is looked at this often: each 7 cm at 0.35 m/s, each five scans of the range finders.
pub(super) const LOOK_MS: u64 = 200;
/// And so far, in m: more than it takes to stop, 0.16 m from 0.35 m/s (`follower.stop_s`), and the look-out
/// before that; the rest is chosen, not measured.
const LOOK_M: f64 = 1.2;
/// Beyond that way things may matter so far, in m: enough for an XTB, whose corners reach 0.32 m, and for
/// what goes on 0.40 m beside a thing that was seen.
const AROUND_M: f64 = 0.8;
/// Before a place where the body would go without looking it stops so far off, in m; chosen, not measured.
const BLIND_STOP_M: f64 = 0.12;
/// It stands before what obstructs it when it is as near as this, in m: more than a stop falls short of its
/// point (`follower.settle_m`, 0.008).
const AT_STOP_M: f64 = 0.05;
/// Something thin as near as this makes it slow, in m; chosen, not measured.
const MET_M: f64 = 2.0;
/// So far ahead what is not on the map counts for the swing, in m: more than a whole swing of 0.30 m.
const SWING_LOOK_M: f64 = 0.5;
/// The pose is surely within so many standard deviations: 95 %.
const SURE_SIGMAS: f64 = 2.0;

/// Things this far away have nothing to do with the way that is looked at, in m.
pub(super) fn near_m(car: &Car) -> f64 {
    LOOK_M + AROUND_M.max(GOES_ON_M + car.reach_m() + IN_THE_WAY_M)
}

impl Navigator {
    /// What the obstacle layer says of the next metre, and how much room the map leaves.
    pub(super) fn look_ahead(&self, now: Stamp, sensed: &Sensed<'_>, following: &mut Following) {
        if following.looked.is_some_and(|at| now.since_ms(at) < LOOK_MS) {
            return;
        }
        following.looked = Some(now);
        let alone = following.plan == 0 && !self.guidance.is_alive(now);
        let hold = alone.then(|| self.hold(now, &following.path, following.follower.way_m()));
        following.held.update(now, hold.flatten(), sensed.stands());
        let (Some(obstacles), Some(map)) = (&self.obstacles, &self.map) else { return };
        let from_m = following.follower.way_m();
        let to_m = (from_m + LOOK_M).min(following.follower.length_m());
        let seen: Vec<[f64; 2]> = {
            let counting = obstacles
                .obstacles(now)
                .filter(|obstacle| now.since_ms(obstacle.seen) < following.seen_within_ms);
            counting.map(|obstacle| [obstacle.x_m, obstacle.y_m]).collect()
        };
        let here = sensed.estimate.pose;
        let near = |[x_m, y_m]: [f64; 2]| libm::hypot(x_m - here.x_m, y_m - here.y_m) <= MET_M;
        following.met_thin = obstacles.thin_obstacles().any(near);
        let (mut way_m, mut least_m, mut beside_m) = (from_m, f64::MAX, f64::MAX);
        let mut obstructed = None;
        let body = self.car.grown(IN_THE_WAY_M);
        while obstructed.is_none() {
            let (pose, _) = following.path.at(way_m);
            let room_m = map.clearance.at_least_m(pose.x_m, pose.y_m) - self.car.half_width_m;
            least_m = least_m.min(room_m);
            if way_m <= from_m + SWING_LOOK_M {
                let off_m = seen.iter().map(|obstacle| self.car.distance_m(&pose, *obstacle));
                let outline = self.car.outline(&pose);
                let off_map_m = outline.map(|[x_m, y_m]| map.clearance.at_least_m(x_m, y_m));
                beside_m = off_m.chain(off_map_m).fold(beside_m, f64::min);
            }
            let there = |point: &[f64; 2]| body.distance_m(&pose, *point) <= 0.0;
            obstructed = seen.iter().copied().find(there).map(|at| (way_m, at));
            if way_m >= to_m {
                break;
            }
            way_m = (way_m + BODY_STEP_M).min(to_m);
        }
        // Less room than the margin was accepted by whoever planned the path: no reason to stop there.
        following.clearance_m = least_m.max(MARGIN_M);
        // The body is off the path, and nobody knows better than this where it really is.
        let unsure_m = sensed.estimate.sigma_m + sensed.estimate.sigma_yaw_rad * self.car.front_m;
        let off_m = following.off_m.abs() + SURE_SIGMAS * unsure_m;
        following.room_m = (beside_m - off_m).max(0.0);
        // A stop with the look-out's room before it.
        let at_obstacle = obstructed.map(|(way_m, at)| (way_m - LOOK_OUT_M, at));
        let blind = (following.plan == 0).then(|| {
            let things = obstacles.unobserved(now, GOES_ON_M, [here.x_m, here.y_m], near_m(&self.car));
            blind_points(&following.path, [from_m, to_m], (&self.car, obstacles.sight()), &things)
                .first()
                .copied()
        });
        let blind = blind.flatten().map(|(way_m, at)| (way_m - BLIND_STOP_M, at));
        let first = at_obstacle.into_iter().chain(blind).min_by(|a, b| a.0.total_cmp(&b.0));
        following.obstructed = first.map(|(way_m, at)| (way_m.max(from_m), at));
        following.obstructed_since = match following.obstructed {
            Some((way_m, _)) if way_m - from_m < AT_STOP_M && sensed.stands() => {
                following.obstructed_since.or(Some(now))
            }
            _ => None,
        };
    }
}
