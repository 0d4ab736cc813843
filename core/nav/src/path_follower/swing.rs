//! A little to and fro on straight ways, so that the beams of the bumpers pass over the strips between them.
//!
//! The beams are parallel and 7 cm apart; what stands midway between two is seen by neither, however near it
//! comes. Turning the body by an angle ψ moves a beam sideways by D ψ at the distance D from the body's
//! middle, and the body itself by nearly nothing:
//!
//! ```text
//!   ψ(s) = A sin ω s        κ(s) = ± A ω cos ω s        y(s) = ∓ A / ω cos ω s
//! ```
//! With A = 6° that is 5 cm to either side half a metre ahead, and 5 mm beside the path. So a leg of 2 cm that
//! would be touched on a straight way has been in a beam 5 to 35 cm before the bumper, at least 12 cm of way
//! earlier: from 35 cm to 12 cm there is three quarters of a swing of 30 cm, and either side has its turn. It
//! also passes over the floor beside the outermost beams that the swinging corners take. The tests below show
//! that for each place of a leg; with swings of 40 cm there are places that no beam passes over.
//!
//! A bend leaves less steering for it, a tight one none: the swing is then as wide as the rest allows. On the
//! last way before a stop nothing is left to be seen.

use super::indexed_path::{IndexedPath, Stretch};
use std::f64::consts::TAU;

/// Way of a whole swing, in m: with one of 40 cm some places of a leg are in no beam; the tests below have it
/// for an XTB.
const SWING_M: f64 = 0.3;
/// Of the sharpest steering so much is for path and swing together: the rest is for errors; chosen, not
/// measured.
const STEERS: f64 = 0.9;
/// A bend begins and ends over about this way, in m: chosen, not measured.
const SMOOTH_M: f64 = 0.10;
/// It grows over this way, in m; chosen, not measured.
const BEGINS_M: f64 = 0.1;
/// So far before a stop it is straight, in m, as less way than 12 cm shows nothing in time (see above) …
const STRAIGHT_M: f64 = 0.12;
/// … and before that it becomes so over this way, half a swing, in m.
const FADES_M: f64 = 0.15;

/// Where the body is meant to be beside its path.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Swing {
    /// Against the path's yaw.
    pub(super) heading_rad: f64,
    /// + = to the left of the path, seen along the yaw.
    pub(super) cross_m: f64,
    /// On top of the path's own.
    pub(super) curvature_per_m: f64,
}

impl Swing {
    /// At a place of a stretch, by at most `swing_rad`, for a car that can steer as sharply as `most_per_m`.
    pub(super) fn at(
        track: &IndexedPath,
        stretch: &Stretch,
        way_m: f64,
        swing_rad: f64,
        most_per_m: f64,
    ) -> Self {
        let bend_per_m = track.mean_curvature(stretch, way_m - SMOOTH_M, way_m + SMOOTH_M).abs();
        let per_m = TAU / SWING_M;
        let spare_per_m = (most_per_m * STEERS - bend_per_m).max(0.0);
        let ends = ((stretch.to_m - way_m - STRAIGHT_M) / FADES_M).clamp(0.0, 1.0);
        let begins = ((way_m - stretch.from_m) / BEGINS_M).clamp(0.0, 1.0);
        let most_rad = swing_rad.min(spare_per_m / per_m) * ends * begins;
        let (sin, cos) = libm::sincos((way_m - stretch.to_m) * per_m);
        Self {
            heading_rad: most_rad * sin,
            cross_m: -stretch.gear * most_rad / per_m * cos,
            curvature_per_m: stretch.gear * most_rad * per_m * cos,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MapPose;
    use crate::geometry::{Car, Path, Piece};
    use xtb_control::VehicleConfig;

    /// Side of a leg, in m.
    const LEG_M: f64 = 0.02;
    /// Between two poses, in m.
    const STEP_M: f64 = 0.005;
    /// Where a beam is sure to see something, beyond the bumper, in m.
    const SIGHT_M: std::ops::RangeInclusive<f64> = 0.05..=0.35;

    /// Whether a leg there, in m ahead of the bumper's middle and to its left, is in one of the beams: as wide
    /// as their lens at the bumper and 6 cm at 80 cm.
    fn is_in_a_beam(ahead_m: f64, left_m: f64) -> bool {
        let half_m = (0.0075 + ahead_m * (0.06 - 0.0075) / 0.8) / 2.0 + 0.4 * LEG_M;
        SIGHT_M.contains(&ahead_m)
            && (0..6).any(|beam| (left_m - (2.5 - f64::from(beam)) * 0.07).abs() <= half_m)
    }

    /// Places of legs, from the path, that are touched on a straight way in this gear without having been in a
    /// beam so much way earlier.
    fn unseen(gear: f64, swing_rad: f64, earlier_m: f64) -> Vec<[f64; 2]> {
        let car = Car::of(&VehicleConfig::default());
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        let path = Path { start, pieces: vec![Piece { length_m: gear * 4.0, curvature_per_m: 0.0 }] };
        let track = IndexedPath::new(&path);
        let stretch = track.stretch(0);
        let pose = |way_m: f64| {
            let swing = Swing::at(&track, &stretch, way_m, swing_rad, 1.0 / car.radius_m);
            MapPose { x_m: gear * way_m, y_m: swing.cross_m, yaw_rad: swing.heading_rad }
        };
        let poses: Vec<MapPose> = (0..600).map(|step| pose(f64::from(step) * STEP_M)).collect();
        let places = (0..32).flat_map(|x| (-60..=60).map(move |y| (x, y)));
        let places = places.map(|(x, y)| [gear * (1.6 + f64::from(x) * 0.01), f64::from(y) * 0.005]);
        places
            .filter(|place| {
                let body = car.grown(LEG_M / 2.0);
                let Some(touched) = poses.iter().position(|pose| body.distance_m(pose, *place) <= 0.0) else {
                    return false;
                };
                let before = touched.saturating_sub((earlier_m / STEP_M) as usize);
                !poses[..before].iter().any(|pose| {
                    let (sin, cos) = libm::sincos(pose.yaw_rad);
                    let (dx, dy) = (place[0] - pose.x_m, place[1] - pose.y_m);
                    is_in_a_beam(gear * (dx * cos + dy * sin) - car.front_m, dy * cos - dx * sin)
                })
            })
            .collect()
    }

    #[test]
    fn no_leg_on_a_straight_way_is_touched_before_a_beam_has_passed_over_it() {
        for gear in [1.0, -1.0] {
            assert_eq!(unseen(gear, 0.105, 0.12), Vec::<[f64; 2]>::new(), "gear {gear}");
        }
    }

    #[test]
    fn without_a_swing_most_strips_between_the_beams_stay_unseen() {
        let unseen = unseen(1.0, 0.0, 0.12).len();
        assert!(unseen > 500, "{unseen} places");
    }
}
