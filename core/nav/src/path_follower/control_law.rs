//! The two laws: how sharply to turn, and how fast to go.
//!
//! Steering is pure pursuit around the exact arcs. Pursuit of a point at the look-ahead L on a straight
//! line asks for the curvature −2 e / L² − 2 ψ / L (e beside the line, ψ against it); the same two
//! terms, with the path's own curvature fed forward, follow an arc without cutting it. The feed-forward
//! is the mean curvature over the way that the servos need: a ramp that they can follow, early enough. The
//! body is meant to swing a little about the path ([`Swing`]): errors are against that.

use super::indexed_path::{IndexedPath, Projection, Stretch};
use super::swing::Swing;
use super::{DriveLimits, FollowerSettings};

/// What both laws look at.
pub(super) struct ControlInputs<'a> {
    pub(super) settings: &'a FollowerSettings,
    pub(super) track: &'a IndexedPath,
    pub(super) stretch: &'a Stretch,
    pub(super) place: &'a Projection,
    /// Measured, whichever way.
    pub(super) speed_mps: f64,
    pub(super) clearance_m: f64,
    pub(super) swing_rad: f64,
    /// Of the tightest circle.
    pub(super) most_per_m: f64,
}

impl ControlInputs<'_> {
    /// Over about this way errors fade.
    fn look_ahead_m(&self) -> f64 {
        let settings = self.settings;
        let tight = self.clearance_m < settings.look_ahead_tight_m;
        settings.look_ahead_m + if tight { 0.0 } else { settings.look_ahead_s * self.speed_mps }
    }

    /// Curvature to steer, + = left.
    pub(super) fn curvature_per_m(&self) -> f64 {
        let Self { settings, place, stretch, .. } = self;
        let swing = self.swing(place.way_m);
        let wanted = self.feed_forward_per_m() / (1.0 - place.curvature_per_m * place.cross_m).max(0.5);
        let wanted = wanted + self.swing(self.steered_m()).curvature_per_m;
        let look_ahead_m = self.look_ahead_m();
        let steepest = settings.approach_deg.to_radians();
        let back_rad = ((place.cross_m - swing.cross_m) / look_ahead_m).clamp(-steepest, steepest);
        let away_rad = stretch.gear * (place.heading_rad - swing.heading_rad);
        let turn_per_m = -2.0 / look_ahead_m * (away_rad + back_rad);
        (wanted + turn_per_m).clamp(-self.most_per_m, self.most_per_m)
    }

    fn swing(&self, way_m: f64) -> Swing {
        Swing::at(self.track, self.stretch, way_m, self.swing_rad, self.most_per_m)
    }

    /// Where it will be when the wheels have followed.
    fn steered_m(&self) -> f64 {
        let settings = self.settings;
        self.place.way_m + self.speed_mps * (settings.servo_delay_s + settings.servo_lag_s)
    }

    /// The path's own curvature where the wheels will be when they have turned.
    fn feed_forward_per_m(&self) -> f64 {
        let (middle_m, half_m) = (self.steered_m(), self.speed_mps * self.settings.lock_s);
        self.track.mean_curvature(self.stretch, middle_m - half_m, middle_m + half_m)
    }

    /// Speed to go with so much way left to the next stop, whichever gear.
    pub(super) fn speed_mps(&self, limits: &DriveLimits, left_m: f64) -> f64 {
        let settings = self.settings;
        let clear_mps = (self.clearance_m / settings.clearance_s).max(settings.tight_mps);
        let stop_mps = (left_m / settings.stop_s).max(settings.creep_mps);
        limits.cruise_mps.min(clear_mps).min(stop_mps).min(self.turning_mps()).max(0.0)
    }

    /// The fastest at which the wheels can turn from one piece's angle to the next one's in time.
    fn turning_mps(&self) -> f64 {
        let settings = self.settings;
        let ahead_m = settings.ramp_m + self.speed_mps * settings.stop_s;
        let way_m = self.place.way_m;
        let jump = self.track.sharpest(self.stretch, way_m - settings.ramp_m, way_m + ahead_m);
        let turning_s = jump / self.most_per_m * settings.lock_s;
        if turning_s > 0.0 { (settings.ramp_m / turning_s).max(settings.creep_mps) } else { f64::INFINITY }
    }
}
