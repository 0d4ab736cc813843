//! Traffic control's paths: what it last said, and when to go by it.

use super::{ALONE_AFTER_MS, NO_WAY_MS, Navigator, Sensed, Stage, TRAFFIC_LOST_MS, Task};
use crate::MapPose;
use crate::car::Car;
use crate::follower::Follower;
use crate::navigator::follow::Following;
use crate::path::Path;
use xtb_control::Stamp;

/// What traffic control says to a robot about its present goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Led {
    /// Its paths, counted.
    pub plan: u64,
    /// `None` = stand, there is none yet.
    pub path: Option<Path>,
    /// Released along it, in m.
    pub release_m: f64,
    /// At most this fast.
    pub cruise_mps: f64,
    /// Who has to pass first.
    pub waits_for: Option<String>,
    /// Why there is no way: after [`NO_WAY_MS`] the goal fails with it.
    pub reason: Option<String>,
}

/// A path that begins farther away than this is not for where it is now, in m.
const START_M: f64 = 0.12;
/// Poses of others are good for this long, in ms.
const OTHERS_MS: u64 = 600;
/// What moves is a little farther on by now, in m.
const OTHERS_GROWN_M: f64 = 0.08;

/// What was heard of traffic control.
#[derive(Debug, Clone, Default)]
pub(super) struct LedBook {
    heard: Option<Stamp>,
    led: Option<Led>,
    /// Since when it has said that there is no way.
    no_way_since: Option<Stamp>,
    others: Vec<MapPose>,
}

impl LedBook {
    /// Whether traffic control lives.
    pub(super) fn leads(&self, now: Stamp) -> bool {
        self.heard.is_some_and(|at| now.since_ms(at) < TRAFFIC_LOST_MS)
    }

    /// Whether it lives, or was there a moment ago and may come back.
    pub(super) fn may_lead(&self, now: Stamp) -> bool {
        self.heard.is_some_and(|at| now.since_ms(at) < ALONE_AFTER_MS)
    }

    /// The path belongs to a goal that is over.
    pub(super) fn forget_track(&mut self) {
        (self.led, self.no_way_since) = (None, None);
    }

    /// Why there is no way, once traffic control has said so for long.
    pub(super) fn no_way(&self, now: Stamp) -> Option<&str> {
        self.no_way_since.filter(|since| self.leads(now) && now.since_ms(*since) >= NO_WAY_MS)?;
        self.led.as_ref()?.reason.as_deref()
    }

    /// Where the others are, as far as that is known.
    pub(super) fn others(&self, now: Stamp, car: &Car) -> Vec<(MapPose, Car)> {
        let fresh = self.heard.is_some_and(|at| now.since_ms(at) < OTHERS_MS);
        let car = car.grown(OTHERS_GROWN_M);
        self.others.iter().filter(|_| fresh).map(|pose| (*pose, car)).collect()
    }

    pub(super) fn led(&self) -> Option<&Led> {
        self.led.as_ref()
    }
}

impl Navigator {
    /// Traffic control was heard; `led` is about the goal that runs now, or none.
    pub fn led(&mut self, now: Stamp, led: Option<Led>, others: &[MapPose]) {
        // What was seen while nobody said where the others are may have been one of them.
        let was_gone = self.led.heard.is_some_and(|at| now.since_ms(at) >= TRAFFIC_LOST_MS);
        if let Some(local) = self.local.as_mut().filter(|_| was_gone) {
            local.clear();
        }
        self.led.heard = Some(now);
        self.led.others = others.to_vec();
        if self.task.is_some() {
            let says_no = led.as_ref().is_some_and(|led| led.reason.is_some());
            self.led.no_way_since =
                says_no.then(|| self.led.no_way_since.filter(|_| !was_gone).unwrap_or(now));
            self.led.led = led;
        }
    }

    /// Whether traffic control has been heard lately.
    #[must_use]
    pub fn is_led(&self, now: Stamp) -> bool {
        self.led.leads(now)
    }

    /// Takes over a new path once it stands, and each release at once. Without traffic control for
    /// [`ALONE_AFTER_MS`] a robot that stands at the end of what was released looks for itself.
    pub(super) fn follow_lead(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) {
        let stands = sensed.stands();
        if task.is_touching() {
            return;
        }
        if !self.led.leads(now) {
            if self.led.may_lead(now) {
                return;
            }
            if let Stage::Following(following) = &task.stage
                && following.plan > 0
                && stands
            {
                task.seek();
            }
            return;
        }
        let Some(led) = self.led.led() else {
            return;
        };
        if let Stage::Following(following) = &mut task.stage
            && following.plan == led.plan
        {
            following.release_m = following.release_m.max(led.release_m);
            following.cruise_mps = led.cruise_mps;
            return;
        }
        let Some(path) = led.path.as_ref().filter(|path| task.lost_start != Some(path.start)) else { return };
        // A plan that continues the one before is driven on; any other waits until it stands.
        if let Stage::Following(following) = &mut task.stage
            && following.plan > 0
            && following.path.start == path.start
        {
            if following.follower.go_on(path, &self.car).is_ok() {
                (following.path, following.plan) = (path.clone(), led.plan);
                following.release_m = following.release_m.max(led.release_m);
                following.cruise_mps = led.cruise_mps;
                task.blocked_at = None;
            }
            return;
        }
        let (start, here) = (&path.start, &sensed.estimate.pose);
        if !stands || libm::hypot(start.x_m - here.x_m, start.y_m - here.y_m) > START_M {
            return;
        }
        let tolerance = self.settings.tolerance(task.aim.yaw_rad.is_some());
        let Ok(follower) = Follower::new(path, &self.car, self.follower.clone(), tolerance) else {
            return;
        };
        task.plans += 1;
        task.blocked_at = None;
        let mut following = Following::led(path.clone(), follower, led.plan);
        (following.release_m, following.cruise_mps) = (led.release_m, led.cruise_mps);
        task.stage = Stage::Following(Box::new(following));
    }
}
