//! The way back for a filter that is lost: fixes that it had to reject, but that agree with each other.
//!
//! Each is kept with the pose that the filter had then. If the truck is only misplaced, one turn and one
//! shift take all of these poses to their fixes (least squares, closed form in the plane).
//!
//! That fixes agree with each other proves little: those of another robot do so too. Against a pose that
//! the filter is sure of they count only when the truck has driven long enough, with a bend in its way,
//! and each fix has moved as the odometry says ([`Relocalization::confirmed`]).

use super::fix::Measurement;
use crate::MapPose;
use crate::geometry::{apart_m, distance_m};
use xtb_control::frames::wrap_rad;
use xtb_control::units::Stamp;

/// So many have to agree; chosen, not measured.
pub(crate) const ENOUGH: usize = 6;
/// So many are kept, 4 m of way or 10 s: a longer way shows the heading where the fixes have none.
const MOST: usize = 40;
/// One is kept when the truck has gone this far since the last one, so that those kept are spread, …
const SPACED_M: f64 = 0.10;
/// … or after this time; both chosen, not measured.
const SPACED_MS: u64 = 250;
/// Against a sure pose they have to agree for so long, in s, … (What came of these on 20 trucks:
/// docs/navigation.md, "Fixes that are wrong", the rows of another robot's fixes.)
const CONFIRM_S: f64 = 6.0;
/// … over a way that reaches so far, in m, …
const CONFIRM_M: f64 = 1.2;
/// … and so many of their standard deviations, or noise alone could turn it, …
const CONFIRM_SIGMAS: f64 = 6.0;
/// … and turns by so much, 40°: two that drive straight ahead move alike, in rad, …
const CONFIRM_TURN_RAD: f64 = 0.7;
/// … and miss the common turn and shift by no more than noise does: √2 of their standard deviation, both
/// axes, and a fifth more for chance, as the root of the mean square, …
const CONFIRM_MISS_SIGMAS: f64 = 1.7;
/// … and play, in m.
const CONFIRM_MISS_M: f64 = 0.02;
/// So many rejected in a row that could be of one truck contradict the pose: of good ones the gate rejects 1
/// in 1,000.
const CONTRADICT: u32 = 3;
/// So many of any do; chosen, not measured.
const CONTRADICT_ANY: u32 = 8;
/// After a contradiction so many that fit in a row end it: one may fit by chance.
const RECONCILED: u32 = 2;
/// A fix may miss the common turn and shift by this many of its standard deviations (1 in 450 good ones
/// misses by more in the plane), …
const MISS_SIGMAS: f64 = 3.5;
/// … and by the odometry's error on the way, in m: three standard deviations after a metre
/// (`filter.along_walk`).
const MISS_M: f64 = 0.03;
/// The same for headings, in rad: 3°; chosen, not measured.
const MISS_RAD: f64 = 0.05;
/// A heading that comes from a way must be surer than this, in rad: well within `filter.lost_rad` (0.35), or
/// it would be lost again at once.
const SURE_RAD: f64 = 0.2;
/// Of a heading that nobody knows: uniform around the circle, π / √3, in rad.
const UNKNOWN_RAD: f64 = 1.814;

#[derive(Debug, Clone, Copy)]
struct Sighting {
    at: Stamp,
    fix: Measurement,
    pose: MapPose,
}

/// The fixes rejected in a row.
#[derive(Debug, Clone)]
pub(crate) struct Relocalization {
    /// The newest first.
    sightings: [Option<Sighting>; MOST],
    /// Rejected in a row, the last of them, and how many of them in a row could be of one truck.
    rejected: u32,
    last: Option<Sighting>,
    alike: u32,
    /// How far the last one was off, in m and in rad.
    off: (f64, f64),
    /// What fitted in a row since the contradiction.
    fitted: u32,
}

/// A turn about `from_m` and a shift to `to_m` that takes the filter's poses to the fixes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Agreement {
    from_m: [f64; 2],
    to_m: [f64; 2],
    pub(crate) turn_rad: f64,
    pub(crate) sigma_m: f64,
    pub(crate) sigma_rad: f64,
}

impl Sighting {
    /// As the odometry says, in m.
    fn moved_m(&self, later: &Self) -> f64 {
        distance_m(&later.pose, &self.pose)
    }

    /// Whether a later one is not farther from this one than a truck gets meanwhile, and its noise.
    fn could_become(&self, later: &Self) -> bool {
        apart_m(later.fix.place_m, self.fix.place_m)
            <= self.moved_m(later) + MISS_SIGMAS * later.fix.sigma_m() + MISS_M
    }
}

impl Agreement {
    /// Where a pose of the filter really is.
    pub(crate) fn moved(&self, pose: &MapPose) -> MapPose {
        let (sin, cos) = libm::sincos(self.turn_rad);
        let (dx, dy) = (pose.x_m - self.from_m[0], pose.y_m - self.from_m[1]);
        MapPose {
            x_m: self.to_m[0] + dx * cos - dy * sin,
            y_m: self.to_m[1] + dx * sin + dy * cos,
            yaw_rad: wrap_rad(pose.yaw_rad + self.turn_rad),
        }
    }

    fn shift_m(&self) -> f64 {
        apart_m(self.to_m, self.from_m)
    }

    fn missed_m(&self, sighting: &Sighting) -> f64 {
        let moved = self.moved(&sighting.pose);
        apart_m(sighting.fix.place_m, [moved.x_m, moved.y_m])
    }

    fn explains(&self, sighting: &Sighting) -> bool {
        let Sighting { fix, pose, .. } = sighting;
        let (moved, missed_m) = (self.moved(pose), self.missed_m(sighting));
        let turned_rad = fix.yaw_rad.map_or(0.0, |yaw_rad| wrap_rad(yaw_rad - moved.yaw_rad).abs());
        missed_m <= MISS_SIGMAS * fix.sigma_m() + MISS_M
            && turned_rad <= MISS_SIGMAS * fix.yaw_rad.map_or(0.0, |_| fix.sigma_rad()) + MISS_RAD
    }
}

impl Default for Relocalization {
    fn default() -> Self {
        Self { sightings: [None; MOST], rejected: 0, last: None, alike: 0, off: (0.0, 0.0), fitted: 0 }
    }
}

impl Relocalization {
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Whether what is rejected says so much against the pose that it is not sure any more.
    pub(crate) fn contradicts(&self) -> bool {
        self.alike >= CONTRADICT || self.rejected >= CONTRADICT_ANY
    }

    /// How far the last rejected fix was off, in m and in rad, while they contradict the pose.
    pub(crate) fn contradiction(&self) -> Option<(f64, f64)> {
        self.contradicts().then_some(self.off)
    }

    /// A fix fits the pose: whether it counts. After a contradiction the first one does not yet.
    pub(crate) fn fits(&mut self) -> bool {
        self.fitted += 1;
        let counts = !self.contradicts() || self.fitted >= RECONCILED;
        if counts {
            self.clear();
        }
        counts
    }

    /// A fix was rejected, being so far off.
    pub(crate) fn reject(&mut self, at: Stamp, fix: Measurement, pose: MapPose, off: (f64, f64)) {
        let new = Sighting { at, fix, pose };
        let alike = self.last.is_some_and(|last| last.could_become(&new));
        self.alike = if alike || self.contradicts() { self.alike + 1 } else { 1 };
        self.rejected = self.rejected.saturating_add(1);
        (self.last, self.off, self.fitted) = (Some(new), off, 0);
        self.push(at, fix, pose);
    }

    pub(crate) fn len(&self) -> usize {
        self.sightings.iter().flatten().count()
    }

    /// Keeps a fix, unless it is too near to the last one.
    pub(crate) fn push(&mut self, at: Stamp, fix: Measurement, pose: MapPose) {
        let new = Sighting { at, fix, pose };
        let far = |last: &Sighting| at.since_ms(last.at) >= SPACED_MS || last.moved_m(&new) >= SPACED_M;
        if self.sightings[0].as_ref().is_none_or(far) {
            self.sightings.rotate_right(1);
            self.sightings[0] = Some(new);
        }
    }

    /// What fixes say that contradict a sure pose, once the truck's own motion has confirmed them: the
    /// longest run of the newest ones that does.
    pub(crate) fn confirmed(&self) -> Option<Agreement> {
        let have = self.len();
        [1, 2, 3, 4].map(|part| have / part).into_iter().filter(|few| *few >= ENOUGH).find_map(|few| {
            let agreement = self.fit(few)?;
            let sure = agreement.sigma_rad <= SURE_RAD && self.is_close(few, &agreement);
            (sure && self.has_moved(few)).then_some(agreement)
        })
    }

    fn is_close(&self, newest: usize, agreement: &Agreement) -> bool {
        let missed_m = self.sightings.iter().flatten().take(newest).map(|s| agreement.missed_m(s));
        let mean_m2 = missed_m.map(|missed_m| missed_m * missed_m).sum::<f64>() / newest as f64;
        mean_m2.sqrt() <= CONFIRM_MISS_SIGMAS * agreement.sigma_m + CONFIRM_MISS_M
    }

    /// Whether the truck has driven enough meanwhile to be told from any other.
    fn has_moved(&self, newest: usize) -> bool {
        let sightings = || self.sightings.iter().flatten().take(newest);
        let (Some(last), Some(first)) = (sightings().next(), sightings().last()) else { return false };
        let of_first = |of: &dyn Fn(&Sighting) -> f64| sightings().map(of).fold(0.0, f64::max);
        let reach_m = of_first(&|s| first.moved_m(s));
        let turned_rad = of_first(&|s| wrap_rad(s.pose.yaw_rad - first.pose.yaw_rad).abs());
        last.at.since_s(first.at) >= CONFIRM_S
            && reach_m >= CONFIRM_M.max(CONFIRM_SIGMAS * first.fix.sigma_m())
            && turned_rad >= CONFIRM_TURN_RAD
    }

    /// The filter has gone where these fixes said; its poses then are others now.
    pub(crate) fn follow(&mut self, agreement: &Agreement) {
        for sighting in self.sightings.iter_mut().flatten() {
            sighting.pose = agreement.moved(&sighting.pose);
        }
    }

    /// What enough of the newest ones say together: all that are kept, or else the last few. Without a
    /// heading that is worth something only if the place is another.
    pub(crate) fn agreement(&self) -> Option<Agreement> {
        let have = self.len();
        if have < ENOUGH {
            return None;
        }
        let all = self.fit(have);
        if all.is_some_and(|agreement| agreement.sigma_rad <= SURE_RAD) {
            return all;
        }
        let worth = |few: &Agreement| few.sigma_rad <= SURE_RAD || few.shift_m() > MISS_SIGMAS * few.sigma_m;
        self.fit(ENOUGH).filter(worth)
    }

    fn fit(&self, newest: usize) -> Option<Agreement> {
        let sightings = || self.sightings.iter().flatten().take(newest);
        let n = newest as f64;
        let mean = |of: &dyn Fn(&Sighting) -> f64| sightings().map(of).sum::<f64>() / n;
        let from_m = [mean(&|s| s.pose.x_m), mean(&|s| s.pose.y_m)];
        let to_m = [mean(&|s| s.fix.place_m[0]), mean(&|s| s.fix.place_m[1])];
        let fix_m = mean(&|s| s.fix.sigma_m());
        let (turn_rad, sigma_rad) = if sightings().all(|s| s.fix.yaw_rad.is_some()) {
            let turn = |s: &Sighting| s.fix.yaw_rad.unwrap_or(0.0) - s.pose.yaw_rad;
            let (sin, cos) = (mean(&|s| libm::sin(turn(s))), mean(&|s| libm::cos(turn(s))));
            (libm::atan2(sin, cos), mean(&|s| s.fix.sigma_rad()) / n.sqrt())
        } else {
            let arms = |s: &Sighting| {
                let before = [s.pose.x_m - from_m[0], s.pose.y_m - from_m[1]];
                (before, [s.fix.place_m[0] - to_m[0], s.fix.place_m[1] - to_m[1]])
            };
            let spread_m = mean(&|s| {
                let (b, _) = arms(s);
                b[0] * b[0] + b[1] * b[1]
            })
            .sqrt();
            let along = mean(&|s| {
                let (b, a) = arms(s);
                b[0] * a[0] + b[1] * a[1]
            });
            let turned = mean(&|s| {
                let (b, a) = arms(s);
                b[0] * a[1] - b[1] * a[0]
            });
            let sigma_rad = fix_m / (spread_m * n.sqrt());
            if sigma_rad <= SURE_RAD { (libm::atan2(turned, along), sigma_rad) } else { (0.0, UNKNOWN_RAD) }
        };
        // The mean is as sure as this; how the newest pose lies to it, the odometry knows.
        let agreement = Agreement { from_m, to_m, turn_rad, sigma_m: fix_m, sigma_rad };
        sightings().all(|s| agreement.explains(s)).then_some(agreement)
    }
}
