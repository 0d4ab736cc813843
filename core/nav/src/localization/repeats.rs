//! A source that has frozen: its fixes stay where they are while the wheels turn.

use super::fix::Measurement;
use crate::geometry::apart_m;
use xtb_control::Stamp;
use xtb_control::frames::wrap_rad;
use xtb_control::odometry::OdomPose;

/// A fix that is the same to the last digit repeats once the wheels have gone this far, in m: 20 pulses of
/// the default encoder, so they surely turn. (What came of these: docs/navigation.md, "Fixes that are wrong",
/// the frozen rows.)
const SAME_MOVED_M: f64 = 0.005;
/// One that is nearly the same repeats once they have gone this far, in m; chosen, not measured.
const NEAR_MOVED_M: f64 = 0.03;
/// A source that has repeated goes on repeating within this part of its standard deviation; chosen, not
/// measured.
const STILL_SIGMAS: f64 = 0.5;
/// Nearly the same: within this part of its standard deviation (docs/navigation.md: a fifth), …
const NEAR_SIGMAS: f64 = 0.2;
/// … but at least so much, in m: the noise of a frozen tracker in the table …
const NEAR_M: f64 = 1.0e-3;
/// … and in rad, the same at a metre's distance, …
const NEAR_RAD: f64 = 1.0e-3;
/// … and within this part of the way that the wheels have gone: fixes that are smoothed follow it.
const NEAR_PART: f64 = 0.3;
/// A source counts as frozen after so many repeats: 1.5 s at 2 Hz; chosen, not measured.
const FROZEN: u32 = 3;
/// What has not repeated for this long is not known to be frozen any more, in ms: six fixes at 2 Hz.
const FORGOTTEN_MS: u64 = 3_000;

/// The fix that the following ones are compared with.
#[derive(Debug, Clone, Copy)]
struct Anchor {
    fix: Measurement,
    odom: OdomPose,
}

/// Watches for fixes that repeat.
#[derive(Debug, Clone, Default)]
pub(crate) struct Repeats {
    anchor: Option<Anchor>,
    repeats: u32,
    last: Option<Stamp>,
}

impl Repeats {
    /// The odometry jumped, or the truck was moved: nothing follows from before.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Whether a fix that came `now`, while the odometry says `odom`, only repeats an earlier one.
    pub(crate) fn is_repeat(&mut self, now: Stamp, fix: &Measurement, odom: &OdomPose) -> bool {
        let sigmas = if self.repeats > 0 { STILL_SIGMAS } else { NEAR_SIGMAS };
        let near = self.anchor.filter(|anchor| anchor.is_near(fix, sigmas));
        let Some(anchor) = near else {
            *self = Self { anchor: Some(Anchor { fix: *fix, odom: *odom }), ..Self::default() };
            return false;
        };
        // Once it has repeated it goes on repeating, also while the truck stands or comes back.
        let repeats = self.repeats > 0 || anchor.has_left(fix, odom);
        if repeats {
            self.repeats = self.repeats.saturating_add(1);
            self.last = Some(now);
        }
        repeats
    }

    /// Whether the source is known to be frozen.
    pub(crate) fn is_frozen(&self, now: Stamp) -> bool {
        self.repeats >= FROZEN && self.last.is_some_and(|at| now.since_ms(at) < FORGOTTEN_MS)
    }
}

impl Anchor {
    fn off_m(&self, fix: &Measurement) -> f64 {
        apart_m(fix.place_m, self.fix.place_m)
    }

    fn turned_rad(&self, fix: &Measurement) -> f64 {
        match (self.fix.yaw_rad, fix.yaw_rad) {
            (Some(before), Some(now)) => wrap_rad(now - before).abs(),
            (None, None) => 0.0,
            _ => f64::MAX,
        }
    }

    fn is_near(&self, fix: &Measurement, sigmas: f64) -> bool {
        let yaw_rad = fix.yaw_rad.map_or(0.0, |_| (sigmas * fix.sigma_rad()).max(NEAR_RAD));
        self.off_m(fix) <= (sigmas * fix.sigma_m()).max(NEAR_M) && self.turned_rad(fix) <= yaw_rad
    }

    /// Whether the wheels have gone where this fix has not.
    fn has_left(&self, fix: &Measurement, odom: &OdomPose) -> bool {
        let moved_m = libm::hypot(odom.x_m - self.odom.x_m, odom.y_m - self.odom.y_m);
        let off_m = self.off_m(fix);
        let same = off_m == 0.0 && self.turned_rad(fix) == 0.0;
        (same && moved_m >= SAME_MOVED_M) || (moved_m >= NEAR_MOVED_M && off_m <= NEAR_PART * moved_m)
    }
}
