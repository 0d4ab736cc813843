//! What a scan takes away: nothing stands where beams got through, nor where the truck does.

use super::ObstacleLayer;
use super::beams::{Beam, BeamReading};
use crate::MapPose;
use crate::geometry::apart_m;
use xtb_control::units::Stamp;
use xtb_control::vehicle::SLOTS;

/// A beam clears up to this much before what it hits, in m: more than the diagonal of a cell of 5 cm, 7.1 cm.
const BEFORE_HIT_M: f64 = 0.08;
/// Something thin is in a beam only this near to its middle, in m: less than half of the beam's width (1.2
/// cm), since a pose is a little off; chosen, not measured by itself.
const THIN_M: f64 = 0.007;

impl ObstacleLayer {
    /// Nothing stands where beams got through, nor where the truck does.
    pub(super) fn clear_seen(
        &mut self,
        now: Stamp,
        pose: &MapPose,
        beams: &[Option<Beam>; 2 * SLOTS],
        readings: &[BeamReading; 2 * SLOTS],
    ) {
        let here = [pose.x_m, pose.y_m];
        let is_thin_near = self.thin_obstacles().any(|at| apart_m(at, here) <= Self::THIN_NEAR_M);
        for (beam, reading) in beams.iter().zip(readings) {
            let Some(beam) = beam else { continue };
            let to_m = match reading {
                BeamReading::Free { to_m } => *to_m,
                BeamReading::Hit { from_m, .. } => from_m - BEFORE_HIT_M,
                BeamReading::Folded(_) | BeamReading::Unfitted => continue,
            };
            self.clear_beam(now, beam, to_m);
            if is_thin_near {
                self.swept.pass(beam, to_m);
            }
        }
        if is_thin_near {
            self.swept.stand(&self.car, pose);
        }
        self.stand_on(pose);
    }

    /// Takes away what stood in a beam that got through, unless another beam hits it now.
    fn clear_beam(&mut self, now: Stamp, beam: &Beam, to_m: f64) {
        let step_m = self.occupied.resolution_m() / 2.0;
        let steps = libm::floor(to_m / step_m);
        if steps < 0.0 {
            return;
        }
        let along_m = || (0..=steps as u32).map(|step| f64::from(step) * step_m);
        if !self.occupied.is_empty() {
            let is_seen = |at| beam.off_m(at) <= THIN_M || !self.thin.is_at(at);
            along_m().for_each(|along_m| self.occupied.remove_before(now, beam.at(along_m), is_seen));
        }
        for left_m in [-beam.beside_m(), 0.0, beam.beside_m()] {
            along_m().for_each(|along_m| self.free.see(beam.beside(along_m, left_m)));
        }
    }

    /// Nothing stands where the truck does.
    fn stand_on(&mut self, pose: &MapPose) {
        let step_m = self.occupied.resolution_m() / 2.0;
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let steps = |from_m: f64, to_m: f64| {
            let steps = libm::ceil((to_m - from_m) / step_m).max(1.0);
            (0..=steps as u32).map(move |step| from_m + (to_m - from_m) * f64::from(step) / steps)
        };
        for ahead_m in steps(-self.car.rear_m, self.car.front_m) {
            for left_m in steps(-self.car.half_width_m, self.car.half_width_m) {
                let (x_m, y_m) = (ahead_m * cos - left_m * sin, ahead_m * sin + left_m * cos);
                self.free.see([pose.x_m + x_m, pose.y_m + y_m]);
            }
        }
    }
}
