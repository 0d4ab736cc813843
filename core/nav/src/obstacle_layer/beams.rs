//! The beams and what their readings are worth.

use super::sight::{Mount, Sight};
use crate::MapPose;
use crate::geometry::Car;
use xtb_control::vehicle::SLOTS;

/// Farther away a reading does not say well enough where, in m: here fit and data sheet are 3 cm apart, at 51
/// cm 13.
pub(crate) const SURE_WITHIN_M: f64 = 0.35;
/// Backing off by this much ends the doubt, in m: as the first level's rule, `obstacle.foldback_retreat_m`.
const RETREAT_M: f64 = 0.05;
/// So does having gone elsewhere, in m: more than twice as far as it may be folded; chosen, not measured.
const ELSEWHERE_M: f64 = 0.30;
/// Two beams that hit at the same distance, within this, in m, hit the same thing: on a side that is aslant
/// by up to 65°, as beams are 7 cm apart.
const SAME_M: f64 = 0.15;

/// How much farther away than the published fit (§4.5) the sensor's data sheet has a thing, in m: 1 cm at
/// 18, 2 cm at 27, 4 cm at 41 and 13 cm at 51 cm.
fn farther_m(range_m: f64) -> f64 {
    let steep_m = (range_m - 0.40).max(0.0);
    0.12 * (range_m - 0.10).max(0.0) + 6.5 * steep_m * steep_m
}

/// One beam in the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Beam {
    from_m: [f64; 2],
    towards: [f64; 2],
    mount: Mount,
}

impl Beam {
    /// To either side a beam that gets through speaks for this much, in m.
    pub(super) fn beside_m(&self) -> f64 {
        self.mount.beside_m
    }

    /// Half of its width, in m.
    pub(super) fn half_width_m(&self) -> f64 {
        self.mount.half_width_m
    }

    /// The point so far along it.
    pub(super) fn at(&self, m: f64) -> [f64; 2] {
        self.beside(m, 0.0)
    }

    /// The point so far along it and so far to its left.
    pub(super) fn beside(&self, m: f64, left_m: f64) -> [f64; 2] {
        let [x, y] = self.towards;
        [self.from_m[0] + m * x - left_m * y, self.from_m[1] + m * y + left_m * x]
    }

    /// How far along it a point is, in m.
    pub(super) fn along_m(&self, point: [f64; 2]) -> f64 {
        let [x, y] = self.towards;
        (point[0] - self.from_m[0]) * x + (point[1] - self.from_m[1]) * y
    }

    /// From its middle to a point, in m.
    pub(super) fn off_m(&self, point: [f64; 2]) -> f64 {
        let [x, y] = self.towards;
        ((point[1] - self.from_m[1]) * x - (point[0] - self.from_m[0]) * y).abs()
    }
}

/// Front, then rear, left to right with the truck pointing up; `None` where no range finder is fitted.
pub(super) fn beams(sight: &Sight, car: &Car, pose: &MapPose) -> [Option<Beam>; 2 * SLOTS] {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    std::array::from_fn(|i| {
        let mount = sight.mounts()[i]?;
        let (bumper_m, facing) = if i < SLOTS { (car.front_m, 1.0) } else { (car.rear_m, -1.0) };
        let (ahead_m, left_m) = (facing * (bumper_m + mount.ahead_m), mount.left_m);
        let (aside, along) = (mount.turned.0, facing * mount.turned.1);
        Some(Beam {
            from_m: [pose.x_m + cos * ahead_m - sin * left_m, pose.y_m + sin * ahead_m + cos * left_m],
            towards: [cos * along - sin * aside, sin * along + cos * aside],
            mount,
        })
    })
}

/// What a reading says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum BeamReading {
    /// Nothing up to here.
    Free { to_m: f64 },
    /// Something between here and there.
    Hit { from_m: f64, to_m: f64 },
    /// The reading is worth nothing: what was seen last is still there.
    Folded([f64; 2]),
    /// There is no range finder.
    Unfitted,
}

/// Whether a sensor may be folding back.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Foldback {
    /// Where the sensor was, and what it saw, when it last was too near to be sure.
    near: Option<([f64; 2], [f64; 2])>,
}

impl Foldback {
    /// Whether something was too near, and it has not backed off since.
    pub(super) fn may_fold(&self) -> bool {
        self.near.is_some()
    }

    /// What a reading in cm is worth. One that is not finite counts as none.
    pub(super) fn interpret(&mut self, beam: &Beam, range_cm: Option<f64>) -> BeamReading {
        let trust = &beam.mount.trust;
        let range_m = range_cm.filter(|cm| cm.is_finite() && *cm >= 0.0).map(|cm| cm / 100.0);
        if let Some(at_m) = range_m.filter(|m| *m < trust.folds_m) {
            self.near = Some((beam.from_m, beam.at(at_m)));
            return BeamReading::Hit { from_m: at_m, to_m: at_m };
        }
        if let Some((from_m, seen_m)) = self.near {
            let (dx, dy) = (beam.from_m[0] - from_m[0], beam.from_m[1] - from_m[1]);
            let nearer_m = dx * beam.towards[0] + dy * beam.towards[1];
            if nearer_m > -RETREAT_M && libm::hypot(dx, dy) < ELSEWHERE_M {
                return BeamReading::Folded(seen_m);
            }
            self.near = None;
        }
        match range_m {
            Some(at_m) if at_m <= trust.farthest_m => {
                let farther_m = if trust.is_published { farther_m(at_m) } else { 0.0 };
                BeamReading::Hit { from_m: at_m, to_m: at_m + farther_m }
            }
            _ => BeamReading::Free { to_m: trust.free_m },
        }
    }
}

/// What one reading says of a thing besides its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Extent {
    /// A neighbouring beam sees it as well.
    Broad,
    /// No other beam sees it, from so near that the place is sure.
    AloneNear,
    /// Nothing.
    Unknown,
}

/// What this beam, which hits something, and its neighbours say of that.
pub(super) fn extent(readings: &[BeamReading; 2 * SLOTS], n: usize) -> Extent {
    let BeamReading::Hit { from_m, to_m } = readings[n] else { return Extent::Unknown };
    let first = n / SLOTS * SLOTS;
    let bumper = first..first + SLOTS;
    let beside = || [n.wrapping_sub(1), n + 1].into_iter().filter(|other| bumper.contains(other));
    let same = |other: usize| match readings[other] {
        BeamReading::Hit { to_m: there_m, .. } => (there_m - to_m).abs() <= SAME_M,
        _ => false,
    };
    let unsure = |other: usize| matches!(readings[other], BeamReading::Folded(_));
    if beside().any(same) {
        Extent::Broad
    } else if from_m <= SURE_WITHIN_M && !beside().any(unsure) {
        Extent::AloneNear
    } else {
        Extent::Unknown
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;

    #[test]
    fn sensors_fold_back_here_as_for_the_first_levels_rule() {
        let obstacle = VehicleConfig::default().obstacle;
        let mounts = Sight::default();
        let folds = mounts.mounts().iter().flatten().map(|mount| mount.trust.folds_m);
        assert!(folds.into_iter().all(|folds_m| folds_m == 0.14 && folds_m == obstacle.foldback_cm / 100.0));
        assert_eq!(RETREAT_M, obstacle.foldback_retreat_m);
    }
}
