//! What the range finders of a car look at: where each beam begins and points, how far its readings can be trusted,
//! and how wide a strip of floor they pass over together.
//!
//! All of it follows from the vehicle's `range_finders`. Only beams that point straight along the car make the strip,
//! and only as far as they stand no more than an XTB's 7 cm apart: between two that are farther apart something may
//! stand unseen.

use xtb_control::VehicleConfig;
use xtb_control::range_curve::RangeCurve;
use xtb_control::vehicle::{BumperFinders, Obstacle, RangeFinder, SLOTS};

/// Half of a beam's width, in m, of one that is 6 cm wide at 80 cm: 2.4 cm at 25 cm (docs/navigation.md, "Thin
/// legs").
const BEAM_HALF_WIDTH_M: f64 = 0.012;
/// The width at 80 cm that this is half of, at 25 cm.
const USUAL_BEAM_M: f64 = 0.06;
/// Half of the thickness of a leg that shall be seen, in m: 2 cm (docs/navigation.md, "Thin legs").
pub(crate) const LEG_HALF_WIDTH_M: f64 = 0.010;
/// Beams farther apart than this leave a gap, in m: an XTB's spacing, and what rounding adds.
const GAP_M: f64 = 0.0701;
/// A strip without a gap begins no farther from the middle, in m: half of that.
const MIDDLE_M: f64 = 0.036;
/// Beside the outermost beams something may be in the way of the obstacle rule, in m: their width and mounting.
const LOOK_OUT_BESIDE_M: f64 = 0.025;
/// The obstacle rule acts so far ahead, in m: a beam that is turned aside looks there.
const RULE_M: f64 = 0.27;

/// How far the readings of a part can be trusted, in m along its beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trust {
    /// Nearer than this it may fold back: "farther" then means nearer still (§4.5, Fig. 11).
    pub(super) folds_m: f64,
    /// A reading of nothing means at least this much free way: less than the farthest that counts, by more than
    /// the noise there.
    pub(super) free_m: f64,
    /// Readings beyond this say nothing: noise alone moves them by centimetres.
    pub(super) farthest_m: f64,
    /// The fit is the memorandum's, which reads far things too near.
    pub(super) is_published: bool,
}

impl Trust {
    /// As the first level's rule has it, `obstacle.foldback_cm`; the GP2D12's fit ends at 56 cm, where noise moves it
    /// by 10 cm; that of the others where noise of 15 mV moves them by 3 cm.
    fn of(curve: RangeCurve) -> Self {
        let folds_m = curve.folds_cm(&Obstacle::default()) / 100.0;
        let (free_m, farthest_m, is_published) = match curve {
            RangeCurve::Gp2d12 => (0.40, 0.52, true),
            RangeCurve::Gp2y0a21 => (0.50, 0.60, false),
            RangeCurve::Gp2y0a02 => (1.00, 1.10, false),
        };
        Self { folds_m, free_m, farthest_m, is_published }
    }
}

/// One range finder on the car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mount {
    pub(super) left_m: f64,
    /// From the bumper's face outwards.
    pub(super) ahead_m: f64,
    /// Sine and cosine of its direction against straight ahead, + = to the left.
    pub(super) turned: (f64, f64),
    /// From its middle to either side a beam that gets through speaks for this much: 1 mm less than half of the
    /// way to its neighbour, and no more than on an XTB.
    pub(super) beside_m: f64,
    pub(super) half_width_m: f64,
    pub(super) trust: Trust,
}

/// What the range finders of a car look at; the default is an XTB's.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    mounts: [Option<Mount>; 2 * SLOTS],
    /// From the middle of the front and of the rear bumper to either side a beam looks.
    half_width_m: [f64; 2],
    /// The same for something as thin as a leg.
    leg_half_width_m: [f64; 2],
    look_out_half_m: f64,
}

impl Default for Sight {
    fn default() -> Self {
        Self::of(&VehicleConfig::default())
    }
}

impl Sight {
    /// Of this vehicle.
    #[must_use]
    pub fn of(vehicle: &VehicleConfig) -> Self {
        let bumpers = [&vehicle.range_finders.front, &vehicle.range_finders.rear];
        let mounts = std::array::from_fn(|i| mount(bumpers[i / SLOTS], i % SLOTS));
        let outermost = bumpers.map(outermost_m);
        let all = bumpers.into_iter().flat_map(|finders| &finders.0);
        let look_outs = all.map(|f| (f.left_m + RULE_M * libm::tan(f.turned_deg.to_radians())).abs());
        Self {
            mounts,
            half_width_m: outermost.map(|m| m.map_or(0.0, |m| (m + beside_m(GAP_M)).max(0.0))),
            leg_half_width_m: outermost
                .map(|m| m.map_or(0.0, |m| (m + BEAM_HALF_WIDTH_M + LEG_HALF_WIDTH_M).max(0.0))),
            look_out_half_m: whole_um(look_outs.fold(0.0, f64::max) + LOOK_OUT_BESIDE_M),
        }
    }

    /// Front, then rear, by their channels.
    pub(super) fn mounts(&self) -> &[Option<Mount>; 2 * SLOTS] {
        &self.mounts
    }

    /// Whether a place so far beside the middle is looked at ahead of the car, or behind it.
    pub(crate) fn looks_at(&self, ahead: bool, left_m: f64) -> bool {
        left_m.abs() <= self.half_width_m[usize::from(!ahead)]
    }

    /// No place is looked at that is farther beside the middle than this, in m.
    pub(crate) fn widest_m(&self) -> f64 {
        self.half_width_m[0].max(self.half_width_m[1])
    }

    /// From the middle of that bumper to either side a leg is seen, in m.
    pub(crate) fn leg_half_width_m(&self, ahead: bool) -> f64 {
        self.leg_half_width_m[usize::from(!ahead)]
    }

    /// From the middle to either side something ahead of a bumper may trip the obstacle rule, in m.
    pub(crate) fn look_out_half_m(&self) -> f64 {
        self.look_out_half_m
    }
}

/// Free of what rounding has left: to micrometres.
fn whole_um(m: f64) -> f64 {
    libm::round(m * 1e6) / 1e6
}

/// What a beam speaks for to either side, with its neighbours so far away.
fn beside_m(apart_m: f64) -> f64 {
    apart_m.min(xtb_control::infrared::SPACING_M) / 2.0 - 0.001
}

fn mount(finders: &BumperFinders, slot: usize) -> Option<Mount> {
    let finder = finders.get(slot)?;
    let apart =
        |other: Option<&RangeFinder>| other.map(|other| whole_um((other.left_m - finder.left_m).abs()));
    let before = slot.checked_sub(1).and_then(|slot| finders.get(slot));
    let nearest = [apart(before), apart(finders.get(slot + 1))].into_iter().flatten().fold(GAP_M, f64::min);
    let turned = match finder.turned_deg {
        0.0 => (0.0, 1.0),
        deg => libm::sincos(deg.to_radians()),
    };
    Some(Mount {
        left_m: finder.left_m,
        ahead_m: finder.ahead_m,
        turned,
        beside_m: beside_m(nearest),
        half_width_m: BEAM_HALF_WIDTH_M * (finder.beam_m / USUAL_BEAM_M),
        trust: Trust::of(finder.curve),
    })
}

/// From the middle to the outermost beam on the side where that is nearer, as far as there is no gap; `None` = there is
/// one in the middle.
fn outermost_m(finders: &BumperFinders) -> Option<f64> {
    let straight = finders.0.iter().filter(|finder| finder.turned_deg == 0.0).map(|finder| finder.left_m);
    let mut runs: Vec<(f64, f64)> = Vec::new();
    for left_m in straight {
        match runs.last_mut().filter(|run| run.1 - left_m <= GAP_M) {
            Some(run) => run.1 = left_m,
            None => runs.push((left_m, left_m)),
        }
    }
    let middle = runs.into_iter().find(|(from_m, to_m)| *from_m >= -MIDDLE_M && *to_m <= MIDDLE_M);
    middle.map(|(from_m, to_m)| whole_um(from_m.min(-to_m)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(lefts: &[f64]) -> Sight {
        let mut vehicle = VehicleConfig::default();
        vehicle.range_finders.front =
            BumperFinders(lefts.iter().map(|left_m| RangeFinder::at(*left_m)).collect());
        Sight::of(&vehicle)
    }

    #[test]
    fn an_xtbs_beams_pass_over_21_cm_to_either_side_and_see_legs_in_20() {
        let sight = Sight::default();
        assert_eq!(sight.half_width_m, [0.175 + (0.07 / 2.0 - 0.001); 2]);
        assert_eq!(sight.leg_half_width_m, [0.175 + 0.012 + 0.010; 2]);
        assert_eq!(sight.look_out_half_m, 0.2);
        for mount in sight.mounts.iter().flatten() {
            assert_eq!((mount.beside_m, mount.half_width_m), (0.07 / 2.0 - 0.001, 0.012));
        }
    }

    #[test]
    fn a_gap_ends_the_strip_and_one_in_the_middle_leaves_none() {
        let half_m = |lefts: &[f64]| at(lefts).half_width_m[0];
        assert!((half_m(&[0.09, 0.03, -0.03, -0.09]) - 0.124).abs() < 1e-9);
        assert!((half_m(&[0.2, 0.03, -0.03, -0.2]) - 0.064).abs() < 1e-9, "the outer ones stand alone");
        assert!((half_m(&[0.09, 0.03, -0.03]) - 0.064).abs() < 1e-9, "as far as on the poorer side");
        assert_eq!(half_m(&[0.1, -0.1]), 0.0);
    }

    #[test]
    fn beams_that_stand_closer_speak_for_less() {
        let beside = |lefts: &[f64]| at(lefts).mounts[0].unwrap().beside_m;
        assert!((beside(&[0.02, -0.02]) - 0.019).abs() < 1e-9);
        assert!((beside(&[0.2, -0.2]) - 0.034).abs() < 1e-9, "no more than on an XTB");
    }

    #[test]
    fn a_beam_that_is_turned_aside_widens_the_look_out_and_not_the_strip() {
        let mut vehicle = VehicleConfig::default();
        vehicle.range_finders.front.0[0].turned_deg = 20.0;
        let sight = Sight::of(&vehicle);
        assert!((sight.look_out_half_m - (0.175 + 0.27 * 20_f64.to_radians().tan() + 0.025)).abs() < 1e-6);
        assert!((sight.half_width_m[0] - 0.139).abs() < 1e-9 && sight.half_width_m[1] > 0.2);
    }
}
