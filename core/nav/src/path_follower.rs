//! From a path to steering and speed, at the gyro's rate.
//!
//! ```text
//!              wheels turned             way left = what it rolls
//!   Turning ─────────────────► Driving ─────────────────────────► Halting ──┐ stands
//!    ▲  ▲                        ▲                                   │      │
//!    │  └──── more released ─────┼──── release end: AtReleaseEnd ◄───┤      │
//!    │                           └──── more released while rolling ──┘      │
//!    └──── cusp: the next gear ◄────────────────────────────────────────────┤
//!                                      goal: Reached, or Stuck(Missed) ◄────┘
//! ```
//! The truck stands before the gear changes (the ESC brakes before it reverses), and turns its wheels
//! before it moves again. What goes wrong (off the path, no motion, no progress) is reported and, off
//! the path, stopped; whoever holds the follower plans again. A step allocates nothing.
//!
//! Words: *way* is the length along the path in m whichever gear; a *stretch* is driven in one gear.

mod control_law;
mod drive;
mod indexed_path;
mod progress_monitor;
mod settings;
mod steering_model;
mod swing;

pub use drive::{DriveCommand, DriveLimits, FollowerStatus, GoalTolerance, Stuck, setpoint};
pub use settings::FollowerSettings;

use crate::MapPose;
use crate::geometry::path::wrap_rad;
use crate::geometry::{Car, Path};
use control_law::ControlInputs;
use indexed_path::{IndexedPath, Projection, Stretch};
use progress_monitor::{ProgressMonitor, StandstillDetector};
use steering_model::SteeringModel;
use thiserror::Error;
use xtb_control::Stamp;

/// A step counts as no longer than this, in s: ten samples of the gyro. After a longer gap nobody knows what
/// happened, and the control loop has ended the goal (80 ms).
pub(crate) const LONGEST_STEP_S: f64 = 0.1;
/// Rounding that a planner's curvature may have, in parts of it: far more than f64's, far less than the
/// servos'.
const ROUNDING: f64 = 1e-6;

/// Why a path cannot be followed.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum FollowerError {
    /// A pose, length or curvature is no number.
    #[error("piece {piece} of the path is not finite (0 = the start)")]
    NotFinite {
        /// Counted from 1.
        piece: usize,
    },
    /// Tighter than the car can turn.
    #[error("piece {piece} of the path has a radius of {radius_m:.3} m, the vehicle needs {least_m:.3} m")]
    TooTight {
        /// Counted from 1.
        piece: usize,
        /// Of the piece.
        radius_m: f64,
        /// Of the car.
        least_m: f64,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// Stands and turns its wheels.
    Turning,
    /// On its way to the next stop.
    Driving,
    /// Rolls out, or stands at a stop.
    Halting,
}

/// Drives one path, from its start to its end.
#[derive(Debug, Clone)]
pub struct PathFollower {
    settings: FollowerSettings,
    tolerance: GoalTolerance,
    track: IndexedPath,
    most_per_m: f64,
    phase: Phase,
    /// For how long it has been in this phase.
    phase_s: f64,
    /// Number of the stretch that is driven.
    stretch: usize,
    way_m: f64,
    asked_mps: f64,
    curvature_per_m: f64,
    steering: SteeringModel,
    standstill: StandstillDetector,
    progress: ProgressMonitor,
    before: Option<Stamp>,
}

impl PathFollower {
    /// Follows `path` with `car`; the truck may stand at its start or be rolling there already.
    ///
    /// # Errors
    /// See [`FollowerError`].
    pub fn new(
        path: &Path,
        car: &Car,
        settings: FollowerSettings,
        tolerance: GoalTolerance,
    ) -> Result<Self, FollowerError> {
        check(path, car)?;
        let track = IndexedPath::new(path);
        Ok(Self {
            settings,
            tolerance,
            most_per_m: 1.0 / car.radius_m,
            track,
            phase: Phase::Turning,
            phase_s: 0.0,
            stretch: 0,
            way_m: 0.0,
            asked_mps: 0.0,
            curvature_per_m: 0.0,
            steering: SteeringModel::new(),
            standstill: StandstillDetector::default(),
            progress: ProgressMonitor::default(),
            before: None,
        })
    }

    /// Goes on along another path that is the same as this one as far as it has been driven and beyond to
    /// where it can stop: what has been driven still counts.
    ///
    /// # Errors
    /// See [`FollowerError`]; the path is then the one before.
    pub fn go_on(&mut self, path: &Path, car: &Car) -> Result<(), FollowerError> {
        check(path, car)?;
        self.track = IndexedPath::new(path);
        Ok(())
    }

    /// The end of the path is to be reached within this.
    pub fn arrive(&mut self, within: GoalTolerance) {
        self.tolerance = within;
    }

    /// How far along the path it is, in m; never beyond the next change of gear.
    #[must_use]
    pub fn way_m(&self) -> f64 {
        let stretch = self.track.stretch(self.stretch);
        self.way_m.clamp(stretch.from_m, stretch.to_m)
    }

    /// Length of the path, in m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.track.length_m()
    }

    /// One step, at each gyro sample: the truck is at `pose` and goes at `speed_mps` (negative =
    /// astern), as measured.
    pub fn step(&mut self, now: Stamp, pose: &MapPose, speed_mps: f64, limits: &DriveLimits) -> DriveCommand {
        let dt_s = self.before.map_or(0.0, |before| now.since_s(before)).min(LONGEST_STEP_S);
        let first = self.before.replace(now).is_none();
        let is_measured = [pose.x_m, pose.y_m, pose.yaw_rad, speed_mps].iter().all(|value| value.is_finite());
        let is_limited = ![limits.way_m, limits.cruise_mps, limits.clearance_m, limits.swing_rad]
            .iter()
            .any(|value| value.is_nan());
        if !is_measured || !is_limited {
            return self.stop(0.0, None, FollowerStatus::Stuck(Stuck::NotANumber));
        }
        if first {
            self.begin(speed_mps);
        }
        let stands = self.standstill.step(&self.settings, now, speed_mps);
        let mut stretch = self.track.stretch(self.stretch);
        let mut place = self.track.nearest(&stretch, self.way_m, pose);
        if stands && self.phase != Phase::Driving && self.is_at_cusp(&stretch, &place) {
            self.stretch += 1;
            self.enter(Phase::Turning);
            stretch = self.track.stretch(self.stretch);
            place = self.track.nearest(&stretch, stretch.from_m, pose);
        }
        self.way_m = place.way_m;
        let left_m = stretch.to_m.min(limits.way_m) - place.way_m;
        if place.off_m > self.settings.deviation_m
            || place.heading_rad.abs() > self.settings.deviation_deg.to_radians()
        {
            let status = FollowerStatus::Deviated { m: place.off_m, heading_rad: place.heading_rad };
            return self.stop(left_m, Some(&place), status);
        }
        self.phase_s += dt_s;
        let next = self.next_phase(stands, stretch.gear * speed_mps, left_m);
        self.enter(next);
        self.ask(dt_s, &stretch, &place, speed_mps.abs(), left_m, limits);
        let stuck = self.progress.step(&self.settings, now, self.asked_mps > 0.0, speed_mps, place.way_m);
        let status = stuck.map_or_else(|| self.status(stands, &stretch, pose, limits), FollowerStatus::Stuck);
        self.drive(left_m, Some(&place), stretch.gear * self.asked_mps, status)
    }

    /// The first step: a truck that rolls the right way goes on, one that rolls the other way stops first.
    fn begin(&mut self, speed_mps: f64) {
        if speed_mps.abs() >= self.settings.standing_mps {
            let along = speed_mps * self.track.stretch(0).gear > 0.0;
            self.enter(if along { Phase::Driving } else { Phase::Halting });
            self.asked_mps = if along { speed_mps.abs() } else { 0.0 };
        }
    }

    /// Whether the stretch is done and another one follows.
    fn is_at_cusp(&self, stretch: &Stretch, place: &Projection) -> bool {
        !self.track.is_last(self.stretch) && stretch.to_m - place.way_m <= self.settings.settle_m
    }

    fn enter(&mut self, phase: Phase) {
        if phase != self.phase {
            (self.phase, self.phase_s) = (phase, 0.0);
            self.steering.turn_anew();
        }
    }

    /// `along_mps` is the speed measured in the stretch's direction.
    fn next_phase(&self, stands: bool, along_mps: f64, left_m: f64) -> Phase {
        let settings = &self.settings;
        let rolls_m = along_mps.abs() * settings.coast_s;
        let worth_it = left_m > settings.settle_m + rolls_m;
        let turned = self.steering.are_turned(settings) || self.phase_s >= settings.turning_s;
        match self.phase {
            Phase::Turning if turned && worth_it => Phase::Driving,
            Phase::Driving if left_m <= rolls_m.max(settings.settle_m / 2.0) => Phase::Halting,
            Phase::Halting if stands && worth_it => Phase::Turning,
            // More was released meanwhile.
            Phase::Halting if along_mps > 0.0 && worth_it => Phase::Driving,
            phase => phase,
        }
    }

    /// Decides on speed and curvature.
    fn ask(
        &mut self,
        dt_s: f64,
        stretch: &Stretch,
        place: &Projection,
        speed_mps: f64,
        left_m: f64,
        limits: &DriveLimits,
    ) {
        let Self { settings, track, most_per_m, .. } = self;
        let clearance_m = limits.clearance_m.max(0.0);
        let inputs = ControlInputs {
            settings,
            track,
            stretch,
            place,
            speed_mps,
            clearance_m,
            swing_rad: limits.swing_rad,
            most_per_m: *most_per_m,
        };
        self.curvature_per_m = inputs.curvature_per_m();
        self.asked_mps = if self.phase == Phase::Driving {
            let faster = self.asked_mps + settings.acceleration_mps2 * dt_s;
            let faster = faster.min(speed_mps + settings.lead_mps);
            inputs.speed_mps(limits, left_m).min(faster.max(settings.creep_mps))
        } else {
            0.0
        };
        self.steering.step(&self.settings, dt_s, self.curvature_per_m, self.most_per_m);
    }

    fn status(
        &self,
        stands: bool,
        stretch: &Stretch,
        pose: &MapPose,
        limits: &DriveLimits,
    ) -> FollowerStatus {
        if !stands || self.phase == Phase::Driving {
            return FollowerStatus::Following;
        }
        let left_m = stretch.to_m.min(limits.way_m) - self.way_m;
        let arrived = left_m <= self.settings.settle_m;
        if !arrived {
            let at_cusp = self.stretch > 0 && self.way_m - stretch.from_m <= self.settings.settle_m;
            return if at_cusp { FollowerStatus::AtCusp } else { FollowerStatus::Following };
        }
        if limits.way_m < stretch.to_m || !self.track.is_last(self.stretch) {
            return FollowerStatus::AtReleaseEnd;
        }
        if self.is_reached(pose) { FollowerStatus::Reached } else { FollowerStatus::Stuck(Stuck::Missed) }
    }

    fn is_reached(&self, pose: &MapPose) -> bool {
        let (goal, tolerance) = (self.track.end(), &self.tolerance);
        let near = |a: f64, b: f64| (a - b).abs() <= tolerance.position_m;
        let turned_rad = wrap_rad(pose.yaw_rad - goal.yaw_rad).abs();
        near(pose.x_m, goal.x_m)
            && near(pose.y_m, goal.y_m)
            && tolerance.yaw_rad.is_none_or(|most_rad| turned_rad <= most_rad)
    }

    /// Speed 0 and the wheels as they are.
    fn stop(&mut self, left_m: f64, place: Option<&Projection>, status: FollowerStatus) -> DriveCommand {
        self.enter(Phase::Halting);
        self.asked_mps = 0.0;
        self.progress = ProgressMonitor::default();
        self.drive(left_m, place, 0.0, status)
    }

    fn drive(
        &self,
        left_m: f64,
        place: Option<&Projection>,
        speed_mps: f64,
        status: FollowerStatus,
    ) -> DriveCommand {
        DriveCommand {
            speed_mps,
            curvature_per_m: self.curvature_per_m,
            way_m: self.way_m(),
            left_m,
            cross_m: place.map_or(0.0, |place| place.cross_m),
            heading_rad: place.map_or(0.0, |place| place.heading_rad),
            status,
        }
    }
}

fn check(path: &Path, car: &Car) -> Result<(), FollowerError> {
    let MapPose { x_m, y_m, yaw_rad } = path.start;
    if ![x_m, y_m, yaw_rad].iter().all(|value| value.is_finite()) {
        return Err(FollowerError::NotFinite { piece: 0 });
    }
    for (index, piece) in path.pieces.iter().enumerate() {
        let (piece, number) = (piece, index + 1);
        if !piece.length_m.is_finite() || !piece.curvature_per_m.is_finite() {
            return Err(FollowerError::NotFinite { piece: number });
        }
        if piece.curvature_per_m.abs() * car.radius_m > 1.0 + ROUNDING {
            let radius_m = 1.0 / piece.curvature_per_m.abs();
            return Err(FollowerError::TooTight { piece: number, radius_m, least_m: car.radius_m });
        }
    }
    Ok(())
}
