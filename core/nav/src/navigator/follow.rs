//! Along a path, and out of where there is none.

use super::among::{Errand, Held};
use super::blind::{GOES_ON_M, blind_on};
use super::job::points_of;
use super::{
    BLOCKED_MS, Decision, LOOKOUT_M, MARGIN_M, MOST_PLANS, Navigator, PAUSE_MS, PROGRESS_M, RECOVERY_MPS,
    RECOVERY_MS, Sensed, Stage, Standing, TRIES, Task, stand,
};
use crate::filter::Trust;
use crate::follower::{Follower, Released, Status, Stuck};
use crate::path::{Path, Piece};
use crate::{Cell, MapPose};
use xtb_control::{Command, Stamp, Steering, WheelRpm};

/// The way ahead is looked at this often.
const LOOK_MS: u64 = 200;
/// And so far, in m: more than it takes to stop.
const LOOK_M: f64 = 1.2;
/// In steps of this, in m.
const LOOK_STEP_M: f64 = 0.04;
/// An obstacle as near as this to the body on the path is in the way, in m.
pub(super) const IN_THE_WAY_M: f64 = 0.02;
/// Before a place where the body would go without looking it stops so far off, in m.
const BLIND_STOP_M: f64 = 0.12;
/// Things this far away have nothing to do with the way that is looked at, in m.
const NEAR_M: f64 = LOOK_M + 0.8;
/// A recovery that has gone so far is done, in m.
pub(super) const RECOVERED_M: f64 = 0.4;
/// What was seen goes on so far where nobody has looked, for a recovery, in m.
const RECOVERY_UNSEEN_M: f64 = 0.10;
/// Backing off by this much a range finder's readings are sure again, in m.
const LOOKS_AGAIN_M: f64 = 0.12;
/// Recoveries for one goal.
const RECOVERIES: u32 = 3;

/// A bend is tight from this part of the tightest one's curvature on.
pub(super) const TIGHT: f64 = 0.5;
/// Speed in it, and where something thin that is not on the map has been met, in m/s.
pub(super) const BEND_MPS: f64 = 0.12;
/// As near as this, in m.
const MET_M: f64 = 2.0;
/// And from so far before it on, in m.
const BEFORE_BEND_M: f64 = 0.06;

/// On its own path the body swings by this to either side, so that its beams pass over the strips between them
/// and over floor beside the body.
const SWING_RAD: f64 = 0.105;
/// On traffic control's path, which keeps the others off.
const LED_SWING_RAD: f64 = 0.052;
/// So far ahead what is not on the map counts for it, in m.
const SWING_LOOK_M: f64 = 0.5;
/// The pose is surely within so many standard deviations.
const SURE_SIGMAS: f64 = 2.0;
/// A corner that swings may take this part of the room beside the body.
const SWING_ROOM: f64 = 0.45;

/// A way without a path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Recovery {
    pub(super) until: Stamp,
    pub(super) steering: f64,
    pub(super) from: MapPose,
    /// Negative = astern.
    pub(super) way_m: f64,
}

/// A path under way.
#[derive(Debug, Clone)]
pub(super) struct Following {
    pub(super) path: Path,
    pub(super) follower: Follower,
    /// Traffic control's number of it; 0 = its own.
    pub(super) plan: u64,
    pub(super) release_m: f64,
    /// Stands until it is said.
    pub(super) cruise_mps: f64,
    pub(super) off_m: f64,
    /// It leads to where something can be seen, not to the goal.
    look: bool,
    /// It was planned with marks that were seen within this time.
    pub(super) lately_ms: u64,
    /// The first level has held the motor since.
    blocked_since: Option<Stamp>,
    looked: Option<Stamp>,
    /// Where the way ahead was found blocked: how far along, and by what.
    obstructed: Option<(f64, [f64; 2])>,
    obstructed_since: Option<Stamp>,
    /// Least room beside the body ahead, in m.
    clearance_m: f64,
    /// The same around the whole body, what is not on the map with it, less what it may be off the path.
    room_m: f64,
    /// Something thin that is not on the map has been met near by.
    met: bool,
    /// It was planned with that in mind.
    pub(super) wary: bool,
    /// Progress counted so far, in m.
    counted_m: f64,
    /// By other robots.
    pub(super) held: Held,
}

impl Following {
    /// Its own path: nobody vouches for the others, so it drives as if one came head-on.
    pub(super) fn own(path: Path, follower: Follower, look: bool) -> Self {
        Self { look, ..Self::new(path, follower, 0, f64::MAX) }
    }

    /// Traffic control's path.
    pub(super) fn led(path: Path, follower: Follower, plan: u64) -> Self {
        Self::new(path, follower, plan, 0.0)
    }

    fn new(path: Path, follower: Follower, plan: u64, release_m: f64) -> Self {
        Self {
            path,
            follower,
            plan,
            release_m,
            cruise_mps: 0.0,
            off_m: 0.0,
            look: false,
            lately_ms: u64::MAX,
            blocked_since: None,
            looked: None,
            obstructed: None,
            obstructed_since: None,
            clearance_m: 0.0,
            room_m: 0.0,
            met: false,
            wary: true,
            counted_m: 0.0,
            held: Held::default(),
        }
    }

    /// On its own path: slowly where the corner that leads, the inner side or the tail gets to floor that no
    /// beam has passed over, so that a beam that sees something at last is soon enough.
    fn bend_mps(&self, radius_m: f64) -> f64 {
        let way_m = self.follower.way_m();
        let tight = |ahead_m: f64| {
            let (_, piece) = self.path.at((way_m + ahead_m).min(self.path.length_m()));
            piece.is_some_and(|piece| piece.curvature_per_m.abs() * radius_m >= TIGHT)
        };
        let slowly = self.plan == 0 && (self.met || tight(0.0) || tight(BEFORE_BEND_M));
        if slowly { BEND_MPS } else { f64::MAX }
    }

    /// How far it may swing, so that no corner takes more than a part of the room that there is.
    fn swing_rad(&self, front_m: f64) -> f64 {
        let most_rad = match self.plan {
            0 => SWING_RAD,
            _ => LED_SWING_RAD,
        };
        most_rad.min(SWING_ROOM * self.room_m / front_m)
    }
}

impl Navigator {
    /// A turn along the path.
    pub(super) fn follow(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> Decision {
        let Stage::Following(following) = &mut task.stage else { return stand(Standing::Planning) };
        self.look_ahead(now, sensed, following);
        if following.met && !following.wary && following.plan == 0 {
            task.seek();
            return stand(Standing::Planning);
        }
        let pose = sensed.estimate.pose;
        let trust = Trust::of(sensed.estimate, following.clearance_m, &self.settings.trust());
        let trusted_mps = match trust {
            Trust::Full => self.settings.drive.cruise_mps,
            Trust::Slow { mps } => mps,
            Trust::Stop => 0.0,
        };
        let held_m = following.held.hold.as_ref().map_or(f64::MAX, |hold| hold.way_m);
        let free_m = following.obstructed.map_or(held_m, |(way_m, _)| way_m.min(held_m));
        // Its own path ends where traffic control takes over again.
        let release_m = match following.plan {
            0 if self.led.leads(now) => 0.0,
            _ => following.release_m,
        };
        let released = Released {
            way_m: release_m.min(free_m),
            cruise_mps: following.cruise_mps.min(trusted_mps).min(following.bend_mps(self.car.radius_m)),
            clearance_m: following.clearance_m,
            swing_rad: following.swing_rad(self.car.front_m),
        };
        let drive = following.follower.step(now, &pose, sensed.speed_mps, &released);
        following.off_m = drive.cross_m;
        if drive.way_m > following.counted_m + PROGRESS_M {
            following.counted_m = drive.way_m;
            (task.tries, task.lost, task.touches, task.blocked_at) = (0, 0, 0, None);
        }
        let held = sensed.blocked || drive.status == Status::Stuck(Stuck::NoMotion);
        following.blocked_since = held.then(|| following.blocked_since.unwrap_or(now));
        let command = drive.command(&self.vehicle);
        let go = |why| Decision::Go(command, why);
        if trust == Trust::Stop {
            return go(Some(Standing::PoseUncertain));
        }
        match drive.status {
            Status::Reached | Status::Stuck(Stuck::Missed) if following.look => {
                task.seek();
                stand(Standing::Planning)
            }
            Status::Reached | Status::Stuck(Stuck::Missed) if following.held.errand == Errand::Retreat => {
                task.has_made_room(now);
                stand(task.pausing())
            }
            Status::Reached => Decision::Reached,
            Status::Deviated { .. }
            | Status::Stuck(Stuck::Missed | Stuck::NoProgress | Stuck::NotANumber) => {
                self.lose_the_path(task, "it gets off its path")
            }
            Status::AtReleaseEnd if following.held.hold.is_some() && sensed.stands() => {
                match self.wait_for_other(now, task) {
                    Ok(standing) => go(Some(standing)),
                    Err(decision) => decision,
                }
            }
            _ if following.blocked_since.is_some_and(|since| now.since_ms(since) >= BLOCKED_MS) => {
                let ahead_m = drive.speed_mps.signum() * (self.car.front_m + 0.2);
                let (sin, cos) = libm::sincos(pose.yaw_rad);
                let at = [pose.x_m + ahead_m * cos, pose.y_m + ahead_m * sin];
                let mark = self.local.as_ref().and_then(|local| local.nearest(now, at));
                let mark = mark.filter(|mark| mark.distance_m(at) < 0.4);
                self.find_blocked(now, task, mark.map_or(at, |mark| [mark.x_m, mark.y_m]))
            }
            _ if following.obstructed_since.is_some_and(|since| now.since_ms(since) >= LOOK_MS)
                && sensed.stands() =>
            {
                let at = following.obstructed.map_or([pose.x_m, pose.y_m], |(_, at)| at);
                self.find_blocked(now, task, at)
            }
            Status::AtReleaseEnd if following.obstructed.is_some() => go(Some(Standing::WayBlocked)),
            Status::AtReleaseEnd => go(Some(Standing::WaitingForTraffic)),
            Status::AtCusp => go(Some(Standing::AtCusp)),
            Status::Following | Status::Stuck(Stuck::NoMotion) => go(None),
        }
    }

    /// What the local layer says of the next metre, and how much room the map leaves.
    fn look_ahead(&self, now: Stamp, sensed: &Sensed<'_>, following: &mut Following) {
        if following.looked.is_some_and(|at| now.since_ms(at) < LOOK_MS) {
            return;
        }
        following.looked = Some(now);
        let alone = following.plan == 0 && !self.led.leads(now);
        let hold = alone.then(|| self.hold(now, &following.path, following.follower.way_m()));
        following.held.is(now, hold.flatten(), sensed.stands());
        let (Some(local), Some(floor)) = (&self.local, &self.floor) else { return };
        let from_m = following.follower.way_m();
        let to_m = (from_m + LOOK_M).min(following.follower.length_m());
        let marks: Vec<[f64; 2]> = {
            let counting = local.obstacles(now).filter(|mark| now.since_ms(mark.seen) < following.lately_ms);
            counting.map(|mark| [mark.x_m, mark.y_m]).collect()
        };
        let here = sensed.estimate.pose;
        let near = |[x_m, y_m]: [f64; 2]| libm::hypot(x_m - here.x_m, y_m - here.y_m) <= MET_M;
        following.met = local.thin().any(near);
        let (mut way_m, mut least_m, mut beside_m) = (from_m, f64::MAX, f64::MAX);
        let mut obstructed = None;
        let body = self.car.grown(IN_THE_WAY_M);
        while obstructed.is_none() {
            let (pose, _) = following.path.at(way_m);
            let room_m = floor.clearance.at_least_m(pose.x_m, pose.y_m) - self.car.half_width_m;
            least_m = least_m.min(room_m);
            if way_m <= from_m + SWING_LOOK_M {
                let off_m = marks.iter().map(|mark| self.car.distance_m(&pose, *mark));
                let outline = self.car.outline(&pose);
                let off_map_m = outline.map(|[x_m, y_m]| floor.clearance.at_least_m(x_m, y_m));
                beside_m = off_m.chain(off_map_m).fold(beside_m, f64::min);
            }
            let there = |point: &[f64; 2]| body.distance_m(&pose, *point) <= 0.0;
            obstructed = marks.iter().copied().find(there).map(|at| (way_m, at));
            if way_m >= to_m {
                break;
            }
            way_m = (way_m + LOOK_STEP_M).min(to_m);
        }
        // Less room than the margin was accepted by whoever planned the path: no reason to stop there.
        following.clearance_m = least_m.max(MARGIN_M);
        // The body is off the path, and nobody knows better than this where it really is.
        let unsure_m = sensed.estimate.sigma_m + sensed.estimate.sigma_yaw_rad * self.car.front_m;
        let off_m = following.off_m.abs() + SURE_SIGMAS * unsure_m;
        following.room_m = (beside_m - off_m).max(0.0);
        // A stop with the look-out's room before it.
        let seen = obstructed.map(|(way_m, at)| (way_m - LOOKOUT_M, at));
        let blind = (following.plan == 0).then(|| {
            let things = local.unverified(now, GOES_ON_M, [here.x_m, here.y_m], NEAR_M);
            blind_on(&following.path, [from_m, to_m], &self.car, &things).first().copied()
        });
        let blind = blind.flatten().map(|(way_m, at)| (way_m - BLIND_STOP_M, at));
        let first = seen.into_iter().chain(blind).min_by(|a, b| a.0.total_cmp(&b.0));
        following.obstructed = first.map(|(way_m, at)| (way_m.max(from_m), at));
        following.obstructed_since = match following.obstructed {
            Some((way_m, _)) if way_m - from_m < 0.05 && sensed.stands() => {
                following.obstructed_since.or(Some(now))
            }
            _ => None,
        };
    }

    /// Something unknown is in the way: another path, or, on traffic control's, a word to it.
    fn find_blocked(&mut self, now: Stamp, task: &mut Task, at: [f64; 2]) -> Decision {
        task.blocked_at = Some(at);
        let Stage::Following(following) = &task.stage else { return stand(Standing::WayBlocked) };
        if following.plan > 0 && self.led.leads(now) {
            return stand(Standing::WayBlocked);
        }
        self.lose_the_path(task, "something that is not on the map")
    }

    /// Another path from here, unless that was tried often enough.
    pub(super) fn lose_the_path(&mut self, task: &mut Task, why: &str) -> Decision {
        task.lost += 1;
        why.clone_into(&mut task.trouble);
        if task.lost > TRIES || task.plans >= MOST_PLANS {
            return Decision::Failed(task.failure());
        }
        if let Stage::Following(following) = &task.stage {
            task.lost_start = (following.plan > 0).then_some(following.path.start);
        }
        task.seek();
        stand(Standing::Planning)
    }

    /// After a plan that failed: again, or astern out of it, or the end.
    pub(super) fn pause(
        &mut self,
        now: Stamp,
        until: Stamp,
        sensed: &Sensed<'_>,
        task: &mut Task,
    ) -> Decision {
        if task.tries > TRIES {
            return Decision::Failed(task.failure());
        }
        if now < until {
            return stand(task.pausing());
        }
        // What passed by, or was seen from too near, stays there until it backs off and looks again.
        let folded = self.local.as_ref().and_then(crate::LocalLayer::folded);
        if let Some(side) = folded.filter(|_| task.recoveries < RECOVERIES)
            && let Some(decision) = self.get_out(now, sensed, task, -side * LOOKS_AGAIN_M, [0.0, 1.0, -1.0])
        {
            task.recoveries += 1;
            return decision;
        }
        if task.enclosed && task.recoveries < RECOVERIES {
            task.recoveries += 1;
            let side = if task.recoveries % 2 == 1 { 1.0 } else { -1.0 };
            if let Some(decision) = self.get_out(now, sensed, task, -RECOVERED_M, [side, -side, 0.0]) {
                return decision;
            }
        }
        task.seek();
        stand(Standing::Planning)
    }

    /// So much way without a path, with the first of some steerings for which there is room.
    fn get_out(
        &mut self,
        now: Stamp,
        sensed: &Sensed<'_>,
        task: &mut Task,
        way_m: f64,
        steerings: [f64; 3],
    ) -> Option<Decision> {
        let from = sensed.estimate.pose;
        let steering = self.way_out(now, &from, way_m, steerings)?;
        let until = now.plus_ms(RECOVERY_MS);
        task.stage = Stage::Recovering(Recovery { until, steering, from, way_m });
        Some(self.recover(now, sensed, task))
    }

    /// The first of some steerings with which there is room for so much way, negative = astern.
    pub(super) fn way_out(&self, now: Stamp, pose: &MapPose, way_m: f64, steerings: [f64; 3]) -> Option<f64> {
        const STEP_M: f64 = 0.04;
        let things = self.things_around(now, pose);
        let unverified = self
            .local
            .as_ref()
            .map_or_else(Vec::new, |local| local.unverified(now, GOES_ON_M, [pose.x_m, pose.y_m], NEAR_M));
        let body = self.car.grown(IN_THE_WAY_M);
        let nears = |pose: &MapPose, point: &[f64; 2]| body.distance_m(pose, *point) <= 0.0;
        // What is that near already does not hold it there.
        let away: Vec<[f64; 2]> = things.into_iter().filter(|point| !nears(pose, point)).collect();
        steerings.into_iter().find(|steering| {
            let back = Piece { length_m: way_m, curvature_per_m: -steering / self.car.radius_m };
            let steps = libm::ceil(way_m.abs() / STEP_M) as u32;
            (1..=steps).all(|step| {
                let there = back.after(pose, f64::from(step) * STEP_M * way_m.signum());
                !away.iter().any(|point| nears(&there, point))
            }) && {
                let path = Path { start: *pose, pieces: vec![back] };
                blind_on(&path, [0.0, way_m.abs()], &self.car, &unverified).is_empty()
            }
        })
    }

    /// Middles of all cells nearby that are not free, or not known to be.
    fn things_around(&self, now: Stamp, pose: &MapPose) -> Vec<[f64; 2]> {
        let mut things = Vec::new();
        if let Some(local) = &self.local {
            things.extend(local.obstacles(now).map(|mark| [mark.x_m, mark.y_m]));
            things.extend(local.unseen_around(now, RECOVERY_UNSEEN_M));
        }
        things.extend(self.others(now).iter().flat_map(|(pose, car)| points_of(car, pose)));
        if let Some(floor) = &self.floor {
            let grid = floor.map.grid();
            let reach = libm::ceil((self.car.reach_m() + RECOVERED_M) / grid.resolution_m()) as i64;
            let (column, row) = grid.place(pose.x_m, pose.y_m);
            let cells = (-reach..=reach).flat_map(|up| (-reach..=reach).map(move |right| (right, up)));
            let cells = cells.map(|(right, up)| (column + right, row + up));
            let taken = cells.filter(|&(column, row)| grid.cell(column, row) != Cell::Free);
            things.extend(taken.map(|(column, row)| grid.centre_m(column, row)));
        }
        things
    }

    /// The memorandum's avoidance (§4.6), astern while turning, or away from what was touched.
    pub(super) fn recover(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> Decision {
        let Stage::Recovering(Recovery { until, steering, from, way_m }) = task.stage else {
            return stand(Standing::Planning);
        };
        let gone_m = distance_m(&from, &sensed.estimate.pose);
        if now >= until || gone_m >= way_m.abs() || (sensed.blocked && sensed.speed_mps == 0.0) {
            task.stage = Stage::Pausing { until: now.plus_ms(PAUSE_MS / 6) };
            task.enclosed = false;
            return stand(Standing::WayBlocked);
        }
        let rpm = WheelRpm::try_from(RECOVERY_MPS * way_m.signum() / self.vehicle.mps_per_rpm())
            .unwrap_or(WheelRpm::ZERO);
        let steering = Steering::try_from(steering).unwrap_or(Steering::CENTRED);
        Decision::Go(Command::Follow { rpm, steering }, None)
    }
}

fn distance_m(a: &MapPose, b: &MapPose) -> f64 {
    libm::hypot(a.x_m - b.x_m, a.y_m - b.y_m)
}
