//! Where am I: an extended Kalman filter over odometry and, where something gives them, pose fixes.
//!
//! State: x, y, yaw in the map, the gyro's drift, how far the wheels differ from nominal and how much older
//! fixes are than they say. Each odometry step predicts, each fix corrects; drift, wheels and delay are
//! learnt on the way and go on serving when the fixes drop out. Angles are in rad, the yaw counter-clockwise as in the map.
//!
//! ```text
//!             odometry ──────► predict ───► history (¾ s)
//!                                 ▲            │ a late fix goes where it was measured,
//!   fix ─► valid? ─► young? ─► repeats? ─► gate ┘ and everything since is predicted again
//!                                 │ none    │ rejected
//!                                             ▼
//!        three in a row that could be of one truck: the pose is uncertain (contradicted)
//!             │ two that fit: as before         │ the truck drives on, with a bend in its way, and
//!             ▼                                 ▼ they move as the odometry says
//!        the pose is sure again            start again where they say
//! ```
//!
//! As long as nothing was learnt from a fix, the pose is the memorandum's odometry (§4.9) to the bit; only
//! its covariance grows. Steps allocate nothing.

mod estimate;
mod fix;
mod history;
mod model;
mod motion_increment;
mod relocalization;
mod repeats;
#[cfg(test)]
mod tests;
mod tuning;
mod uncertainty_speed;

pub use estimate::{Estimate, FixCounts};
pub use fix::{FixError, FixOutcome, StampedFix};
pub use tuning::FilterTuning;
pub use uncertainty_speed::{UncertaintyLimits, UncertaintySpeed};
pub use xtb_protocol::messages::FixSource;

use crate::MapPose;
use fix::Measurement;
use history::{After, History};
use model::State;
use motion_increment::MotionTracker;
use relocalization::{Agreement, Relocalization};
use repeats::Repeats;
use thiserror::Error;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapFromOdom;
use xtb_control::odometry::OdomPose;
use xtb_control::units::Stamp;

/// A step of the odometry that changes nothing is left out for this long, so that turns in which no sample
/// came do not fill the history; chosen, not measured.
const IDLE_MS: u64 = 50;

/// A truck that stands while fixes contradict its pose may have slipped: its place grows unsure by this much
/// in √s (2.6 s to the most; chosen, not measured), …
const SLIP_WALK_M: f64 = 0.05;
/// … up to this, in m: by the gate's 3.7 standard deviations that forgives a slip of 0.30 m. What is farther
/// off than a third of a metre, as another robot always is, that does not explain.
const SLIP_MOST_M: f64 = 0.08;

/// The odometry gave a pose that is none.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("the odometry's pose ({x_m}, {y_m}) is not finite")]
pub struct OdometryError {
    /// To the right of its start, in m.
    pub x_m: f64,
    /// Ahead of its start, in m.
    pub y_m: f64,
}

/// The filter of one truck; see the module's documentation.
#[derive(Debug, Clone)]
pub struct PoseFilter {
    tuning: FilterTuning,
    /// When the odometry last said something new.
    now: Stamp,
    odom: OdomPose,
    /// Present while nothing has been learnt, with the pose, which is then the odometry's.
    aligned: Option<(MapFromOdom, MapPose)>,
    state: State,
    motion: MotionTracker,
    history: History,
    relocalization: Relocalization,
    repeats: Repeats,
    last_fix: Option<Stamp>,
    counts: FixCounts,
}

impl PoseFilter {
    /// A truck that stands at `start` while its odometry says `odom`.
    #[must_use]
    pub fn new(
        vehicle: &VehicleConfig,
        tuning: FilterTuning,
        now: Stamp,
        odom: &OdomPose,
        start: &MapPose,
    ) -> Self {
        let state = State::at(start, &tuning);
        let alignment = MapFromOdom::aligning(odom, start);
        let mut filter = Self {
            now,
            odom: *odom,
            aligned: Some((alignment, alignment.pose(odom))),
            state,
            motion: MotionTracker::new(vehicle, tuning.yaw_noise_rad),
            history: History::default(),
            relocalization: Relocalization::default(),
            repeats: Repeats::default(),
            last_fix: None,
            counts: FixCounts::default(),
            tuning,
        };
        filter.begin_history();
        filter
    }

    /// What the odometry says at `now`; to be called whenever it may have changed, the oftener the better.
    ///
    /// # Errors
    /// A pose that is not finite; it is left out.
    pub fn odometry(&mut self, now: Stamp, odom: &OdomPose) -> Result<(), OdometryError> {
        if !(odom.x_m.is_finite() && odom.y_m.is_finite()) {
            return Err(OdometryError { x_m: odom.x_m, y_m: odom.y_m });
        }
        if *odom == self.odom && now.since_ms(self.now) < IDLE_MS {
            return Ok(());
        }
        let mut increment = self.motion.step(self.now, now, &self.odom, odom);
        (self.now, self.odom) = (self.now.max(now), *odom);
        if self.aligned.is_some() {
            increment.stood_radps = None; // learning from standing would leave the odometry's bits
        }
        self.state.predict(&increment, &self.tuning);
        let after = match &mut self.aligned {
            Some((alignment, pose)) => {
                *pose = alignment.pose(odom);
                After::Pose(*pose)
            }
            None if self.relocalization.contradicts() && self.motion.rests(now) => After::Slip,
            None => After::Nothing,
        };
        after.apply(&mut self.state, increment.dt_s);
        self.history.push(self.now, increment, after, &self.state);
        Ok(())
    }

    /// The odometry started again elsewhere, without the truck having moved.
    pub fn rezeroed(&mut self, before: &OdomPose, after: &OdomPose) {
        if let Some((alignment, pose)) = &mut self.aligned {
            *alignment = MapFromOdom::aligning(after, &alignment.pose(before));
            *pose = alignment.pose(after);
        }
        self.odom = *after;
        self.motion.rezeroed();
        self.repeats.forget();
    }

    /// From the odometry's frame to the map's, as it is now.
    #[must_use]
    pub fn map_from_odom(&self) -> MapFromOdom {
        let learnt = || MapFromOdom::aligning(&self.odom, &self.state.pose());
        self.aligned.map_or_else(learnt, |(alignment, _)| alignment)
    }

    /// Somebody says where the truck is. What was learnt of gyro and wheels is kept.
    pub fn set_pose(&mut self, now: Stamp, odom: &OdomPose, pose: &MapPose) {
        self.now = self.now.max(now);
        self.odom = *odom;
        self.motion.rezeroed();
        self.aligned = self.aligned.map(|_| {
            let alignment = MapFromOdom::aligning(odom, pose);
            (alignment, alignment.pose(odom))
        });
        self.state.restart(pose, self.tuning.start_m, self.tuning.start_rad);
        self.last_fix = None;
        self.relocalization.clear();
        self.repeats.forget();
        self.begin_history();
    }

    /// What something else than the truck measured of it.
    ///
    /// # Errors
    /// A fix that cannot be: not finite, without a usable covariance, measured after `now`.
    pub fn fix(&mut self, now: Stamp, fix: &StampedFix) -> Result<FixOutcome, FixError> {
        let measurement = fix.check(now)?;
        let age_s = now.since_s(fix.stamp);
        let slot = self.history.slot(fix.stamp).filter(|_| age_s <= self.tuning.late_s);
        let Some(slot) = slot else {
            self.counts.too_old += 1;
            return Ok(FixOutcome::TooOld { age_s, limit_s: self.tuning.late_s });
        };
        if self.repeats.is_repeat(now, &measurement, &self.odom) {
            self.counts.repeated += 1;
            return Ok(FixOutcome::Repeated);
        }
        if self.is_lost() {
            return Ok(self.gather(fix.stamp, slot, measurement));
        }
        let mut state = self.history.state(slot, &self.tuning);
        if self.aligned.is_some() {
            state.open_scale(self.tuning.open_scale);
        }
        let test = state.correct(&measurement, &self.history.twist(slot), self.tuning.gate);
        let outcome = FixOutcome::Rejected { mahalanobis: test.mahalanobis, limit: test.limit };
        if !test.passed() {
            return Ok(self.contradicted(fix.stamp, slot, measurement).unwrap_or(outcome));
        }
        if !self.relocalization.fits() {
            self.counts.rejected += 1;
            return Ok(outcome);
        }
        self.aligned = None;
        self.counts.accepted += 1;
        self.last_fix = self.last_fix.max(Some(fix.stamp));
        self.state = self.history.insert(slot, measurement, state, &self.tuning);
        Ok(FixOutcome::Accepted { mahalanobis: test.mahalanobis, limit: test.limit })
    }

    /// Where the truck is now, and how sure that is.
    #[must_use]
    pub fn estimate(&self, now: Stamp) -> Estimate {
        let pose = self.aligned.map_or_else(|| self.state.pose(), |(_, pose)| pose);
        let fix_age_ms = self.last_fix.map(|at| now.since_ms(at));
        let estimate = Estimate::of(&self.state, pose, fix_age_ms, self.counts);
        let estimate = Estimate { frozen: self.is_frozen(now), ..estimate };
        match self.relocalization.contradiction() {
            Some((off_m, off_rad)) => estimate.with_contradiction(off_m, off_rad),
            None => estimate,
        }
    }

    /// Whether the fixes repeat one pose while the wheels turn; none of them counts.
    #[must_use]
    pub fn is_frozen(&self, now: Stamp) -> bool {
        self.repeats.is_frozen(now)
    }

    /// Whether fixes say another pose, and it is not known which is right.
    #[must_use]
    pub fn is_contradicted(&self) -> bool {
        self.relocalization.contradiction().is_some()
    }

    /// By which part the wheels go farther than nominal ones, and its standard deviation; `None` = nothing was
    /// learnt.
    #[must_use]
    pub fn wheel_scale(&self) -> Option<(f64, f64)> {
        (self.counts.accepted > 0).then(|| self.state.wheel_scale())
    }

    /// Too unsure of the heading for a correction to point the right way.
    fn is_lost(&self) -> bool {
        self.state.sigma_yaw_rad() > self.tuning.lost_rad
    }

    /// The heading is lost: keeps a fix, and starts again if those kept agree with each other.
    fn gather(&mut self, at: Stamp, slot: usize, fix: Measurement) -> FixOutcome {
        self.relocalization.push(at, fix, self.history.state(slot, &self.tuning).pose());
        if let Some(agreement) = self.relocalization.agreement() {
            return self.start_again(at, &agreement);
        }
        self.counts.relocalizing += 1;
        FixOutcome::Relocalizing { have: self.relocalization.len(), need: relocalization::ENOUGH }
    }

    /// A fix does not fit: starts again where those rejected say, if the truck's motion has confirmed them.
    fn contradicted(&mut self, at: Stamp, slot: usize, fix: Measurement) -> Option<FixOutcome> {
        let state = self.history.state(slot, &self.tuning);
        let (off_m, off_rad) = state.off(&fix, &self.history.twist(slot));
        // As far as the fix itself may be off.
        let off = (off_m + 3.0 * fix.sigma_m(), off_rad + fix.yaw_rad.map_or(0.0, |_| 3.0 * fix.sigma_rad()));
        self.relocalization.reject(at, fix, state.pose(), off);
        let confirmed = self.relocalization.confirmed();
        if confirmed.is_none() {
            self.counts.rejected += 1;
        }
        confirmed.map(|agreement| self.start_again(at, &agreement))
    }

    fn start_again(&mut self, at: Stamp, agreement: &Agreement) -> FixOutcome {
        let before = self.state.pose();
        let pose = agreement.moved(&before);
        self.state.restart(&pose, agreement.sigma_m, agreement.sigma_rad);
        self.state.reopen_learnt(&self.tuning);
        self.aligned = None;
        self.last_fix = self.last_fix.max(Some(at));
        self.counts.restarts += 1;
        if self.is_lost() {
            self.relocalization.follow(agreement);
        } else {
            self.relocalization.clear();
        }
        self.begin_history();
        FixOutcome::Restarted {
            moved_m: libm::hypot(pose.x_m - before.x_m, pose.y_m - before.y_m),
            turned_rad: agreement.turn_rad,
        }
    }

    /// What was before now has another pose: no fix from then fits any more.
    fn begin_history(&mut self) {
        self.history.begin(self.now, &self.state);
    }
}
