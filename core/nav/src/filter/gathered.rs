//! The way back for a filter that is lost: fixes that it had to reject, but that agree with each other.
//!
//! Each is kept with the pose that the filter had then. If the truck is only misplaced, one turn and one
//! shift take all of these poses to their fixes (least squares, closed form in the plane).

use super::fix::Measurement;
use crate::MapPose;
use xtb_control::frames::wrap_rad;

/// So many have to agree.
pub(crate) const ENOUGH: usize = 6;
/// So many are kept: a longer way shows the heading where the fixes have none.
const MOST: usize = 12;
/// A fix may miss the common turn and shift by this many of its standard deviations, and by the
/// odometry's error on the way, in m.
const MISS_SIGMAS: f64 = 3.5;
const MISS_M: f64 = 0.03;
/// The same for headings, in rad.
const MISS_RAD: f64 = 0.05;
/// A heading that comes from a way must be surer than this, in rad.
const SURE_RAD: f64 = 0.2;
/// Of a heading that nobody knows: uniform around the circle, in rad.
const UNKNOWN_RAD: f64 = 1.814;

#[derive(Debug, Clone, Copy)]
struct Sighting {
    fix: Measurement,
    pose: MapPose,
}

/// The fixes rejected in a row.
#[derive(Debug, Clone, Default)]
pub(crate) struct Gathered {
    /// The newest first.
    sightings: [Option<Sighting>; MOST],
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
        libm::hypot(self.to_m[0] - self.from_m[0], self.to_m[1] - self.from_m[1])
    }

    fn explains(&self, sighting: &Sighting) -> bool {
        let Sighting { fix, pose } = sighting;
        let moved = self.moved(pose);
        let missed_m = libm::hypot(fix.place_m[0] - moved.x_m, fix.place_m[1] - moved.y_m);
        let turned_rad = fix.yaw_rad.map_or(0.0, |yaw_rad| wrap_rad(yaw_rad - moved.yaw_rad).abs());
        missed_m <= MISS_SIGMAS * fix.sigma_m() + MISS_M
            && turned_rad <= MISS_SIGMAS * fix.yaw_rad.map_or(0.0, |_| fix.sigma_rad()) + MISS_RAD
    }
}

impl Gathered {
    pub(crate) fn clear(&mut self) {
        self.sightings = [None; MOST];
    }

    pub(crate) fn len(&self) -> usize {
        self.sightings.iter().flatten().count()
    }

    pub(crate) fn push(&mut self, fix: Measurement, pose: MapPose) {
        self.sightings.rotate_right(1);
        self.sightings[0] = Some(Sighting { fix, pose });
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
