//! From a path to steering and speed, at the gyro's rate: the second level's hand on the wheel.
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

mod law;
mod settings;
mod sweep;
mod track;
mod watch;
mod wheels;

pub use settings::FollowerSettings;

use crate::path::{Path, wrap_rad};
use crate::{Car, MapPose};
use law::Scene;
use thiserror::Error;
use track::{Place, Stretch, Track};
use watch::{Standing, Watch};
use wheels::Wheels;
use xtb_control::{Command, Stamp, Steering, VehicleConfig, WheelRpm};

/// A step counts as no longer than this, in s.
const LONGEST_STEP_S: f64 = 0.1;
/// Rounding that a planner's curvature may have.
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
    #[error("piece {piece} of the path has a radius of {radius_m:.3} m, the car needs {least_m:.3} m")]
    TooTight {
        /// Counted from 1.
        piece: usize,
        /// Of the piece.
        radius_m: f64,
        /// Of the car.
        least_m: f64,
    },
}

/// What counts as reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalTolerance {
    /// Along x and along y each, in m.
    pub position_m: f64,
    /// In rad; `None` = any yaw will do.
    pub yaw_rad: Option<f64>,
}

impl Default for GoalTolerance {
    /// The memorandum's box (§4.10), and 15°.
    fn default() -> Self {
        Self { position_m: 0.20, yaw_rad: Some(15_f64.to_radians()) }
    }
}

/// What may be driven now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Released {
    /// As far as this along the path, in m; beyond the path's end = all of it.
    pub way_m: f64,
    /// No faster than this, in m/s; 0 = stand.
    pub cruise_mps: f64,
    /// Room between the body and what stands around, here and a little ahead, in m.
    pub clearance_m: f64,
    /// The body may swing so far to either side, to look between its beams; 0 = not at all.
    pub swing_rad: f64,
}

/// Why it gets nowhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stuck {
    /// The wheels do not turn although they are asked to: an obstacle, or a drive that is held.
    NoMotion,
    /// The wheels turn, but the truck does not get on.
    NoProgress,
    /// It stands at the path's end, outside the tolerance.
    Missed,
    /// The pose, the speed or a limit is no number.
    NotANumber,
}

/// How it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Status {
    /// Under way.
    Following,
    /// Stands where the gear changes, turning its wheels.
    AtCusp,
    /// Stands at the end of what is released.
    AtReleaseEnd,
    /// Stands at the goal, within the tolerance.
    Reached,
    /// Too far off the path, and stopping.
    Deviated {
        /// From the path, in m.
        m: f64,
        /// Against the path's heading, in rad.
        heading_rad: f64,
    },
    /// Gets nowhere; it goes on asking, since what holds it may go away.
    Stuck(Stuck),
}

/// What a step decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Of the wheels, negative = astern.
    pub speed_mps: f64,
    /// + = left, as in [`crate::Piece`].
    pub curvature_per_m: f64,
    /// How far along the path, in m; never beyond the next change of gear.
    pub way_m: f64,
    /// Way to the next stop, in m; negative = overshot.
    pub left_m: f64,
    /// Beside the path, + = to its left (seen along the yaw), in m.
    pub cross_m: f64,
    /// Yaw against the path's, in rad.
    pub heading_rad: f64,
    /// How it goes.
    pub status: Status,
}

impl Drive {
    /// As a command for the first level of this vehicle.
    #[must_use]
    pub fn command(&self, vehicle: &VehicleConfig) -> Command {
        let rpm = (self.speed_mps / vehicle.mps_per_rpm()).clamp(-WheelRpm::MAX, WheelRpm::MAX);
        // Both axles steer opposite: R = L / (2 tan δ).
        let wheels_rad = libm::atan(self.curvature_per_m * vehicle.geometry.wheelbase_m / 2.0);
        let steering = (-wheels_rad / vehicle.steering.stop_deg.to_radians()).clamp(-1.0, 1.0);
        Command::Follow {
            rpm: WheelRpm::try_from(rpm).unwrap_or(WheelRpm::ZERO),
            steering: Steering::try_from(steering).unwrap_or(Steering::CENTRED),
        }
    }
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
pub struct Follower {
    settings: FollowerSettings,
    tolerance: GoalTolerance,
    track: Track,
    most_per_m: f64,
    phase: Phase,
    /// For how long it has been in this phase.
    phase_s: f64,
    /// Number of the stretch that is driven.
    stretch: usize,
    way_m: f64,
    asked_mps: f64,
    curvature_per_m: f64,
    wheels: Wheels,
    standing: Standing,
    watch: Watch,
    before: Option<Stamp>,
}

impl Follower {
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
        let track = Track::new(path);
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
            wheels: Wheels::new(),
            standing: Standing::default(),
            watch: Watch::default(),
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
        self.track = Track::new(path);
        Ok(())
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
    pub fn step(&mut self, now: Stamp, pose: &MapPose, speed_mps: f64, limits: &Released) -> Drive {
        let dt_s = self.before.map_or(0.0, |before| now.since_s(before)).min(LONGEST_STEP_S);
        let first = self.before.replace(now).is_none();
        let is_measured = [pose.x_m, pose.y_m, pose.yaw_rad, speed_mps].iter().all(|value| value.is_finite());
        let is_limited = ![limits.way_m, limits.cruise_mps, limits.clearance_m, limits.swing_rad]
            .iter()
            .any(|value| value.is_nan());
        if !is_measured || !is_limited {
            return self.stop(0.0, None, Status::Stuck(Stuck::NotANumber));
        }
        if first {
            self.begin(speed_mps);
        }
        let stands = self.standing.step(&self.settings, now, speed_mps);
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
            let status = Status::Deviated { m: place.off_m, heading_rad: place.heading_rad };
            return self.stop(left_m, Some(&place), status);
        }
        self.phase_s += dt_s;
        let next = self.next_phase(stands, stretch.gear * speed_mps, left_m);
        self.enter(next);
        self.ask(dt_s, &stretch, &place, speed_mps.abs(), left_m, limits);
        let stuck = self.watch.step(&self.settings, now, self.asked_mps > 0.0, speed_mps, place.way_m);
        let status = stuck.map_or_else(|| self.status(stands, &stretch, pose, limits), Status::Stuck);
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
    fn is_at_cusp(&self, stretch: &Stretch, place: &Place) -> bool {
        !self.track.is_last(self.stretch) && stretch.to_m - place.way_m <= self.settings.settle_m
    }

    fn enter(&mut self, phase: Phase) {
        if phase != self.phase {
            (self.phase, self.phase_s) = (phase, 0.0);
            self.wheels.turn_anew();
        }
    }

    /// `along_mps` is the speed measured in the stretch's direction.
    fn next_phase(&self, stands: bool, along_mps: f64, left_m: f64) -> Phase {
        let settings = &self.settings;
        let rolls_m = along_mps.abs() * settings.coast_s;
        let worth_it = left_m > settings.settle_m + rolls_m;
        let turned = self.wheels.are_turned(settings) || self.phase_s >= settings.turning_s;
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
        place: &Place,
        speed_mps: f64,
        left_m: f64,
        limits: &Released,
    ) {
        let Self { settings, track, most_per_m, .. } = self;
        let clearance_m = limits.clearance_m.max(0.0);
        let scene = Scene {
            settings,
            track,
            stretch,
            place,
            speed_mps,
            clearance_m,
            swing_rad: limits.swing_rad,
            most_per_m: *most_per_m,
        };
        self.curvature_per_m = scene.curvature_per_m();
        self.asked_mps = if self.phase == Phase::Driving {
            let faster = self.asked_mps + settings.acceleration_mps2 * dt_s;
            let faster = faster.min(speed_mps + settings.lead_mps);
            scene.speed_mps(limits, left_m).min(faster.max(settings.creep_mps))
        } else {
            0.0
        };
        self.wheels.step(&self.settings, dt_s, self.curvature_per_m, self.most_per_m);
    }

    fn status(&self, stands: bool, stretch: &Stretch, pose: &MapPose, limits: &Released) -> Status {
        if !stands || self.phase == Phase::Driving {
            return Status::Following;
        }
        let left_m = stretch.to_m.min(limits.way_m) - self.way_m;
        let arrived = left_m <= self.settings.settle_m;
        if !arrived {
            let at_cusp = self.stretch > 0 && self.way_m - stretch.from_m <= self.settings.settle_m;
            return if at_cusp { Status::AtCusp } else { Status::Following };
        }
        if limits.way_m < stretch.to_m || !self.track.is_last(self.stretch) {
            return Status::AtReleaseEnd;
        }
        if self.is_reached(pose) { Status::Reached } else { Status::Stuck(Stuck::Missed) }
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
    fn stop(&mut self, left_m: f64, place: Option<&Place>, status: Status) -> Drive {
        self.enter(Phase::Halting);
        self.asked_mps = 0.0;
        self.watch = Watch::default();
        self.drive(left_m, place, 0.0, status)
    }

    fn drive(&self, left_m: f64, place: Option<&Place>, speed_mps: f64, status: Status) -> Drive {
        Drive {
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
