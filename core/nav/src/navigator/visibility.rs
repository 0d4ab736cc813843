//! Where the body would go without looking: the beams are parallel and look ahead and astern only, so a
//! corner that swings out, or the inner side of a tight bend, gets to floor that no beam has passed over.
//!
//! Around a thing that is not on the map such floor may be taken: only its face was seen. So a path may lead
//! the body there only if a beam will have looked from the path itself, early enough to stop. This is asked
//! of every path, and again on the way, as more of the thing comes into sight.

use crate::MapPose;
use crate::geometry::{Car, Path};
use crate::obstacle_layer::{SURE_WITHIN_M, Sight};

/// An obstacle as near as this to the body on the path is in the way, in m; chosen, not measured.
pub(super) const IN_THE_WAY_M: f64 = 0.02;
/// Between two poses at which the body is laid on the floor, in m: less than a cell of a map.
pub(super) const BODY_STEP_M: f64 = 0.04;
/// A thing goes on so far where nobody has looked, in m; chosen, not measured by itself (journeys and legs in
/// docs/navigation.md were driven with it).
pub(super) const GOES_ON_M: f64 = 0.40;
/// From where something comes into sight to where it is touched, at least, in m of way: the time to see it
/// twice, to look ahead, and to stop from 0.2 m/s.
pub(super) const STOPS_WITHIN_M: f64 = 0.15;
/// Of what stands nearer than that already: so much nearer is not nearer, in m; chosen, not measured.
const NEARER_M: f64 = 0.003;
/// Way between two looks at the path, in m: less than half of the usual cell of a map.
const STEP_M: f64 = 0.02;

/// The first of some points, and the way there, that the body touches between two places of a path before a
/// beam has looked there on the way.
pub(super) fn blind_points(
    path: &Path,
    ways_m: [f64; 2],
    (car, sight): (&Car, &Sight),
    points: &[[f64; 2]],
) -> Vec<(f64, [f64; 2])> {
    let here = path.at(ways_m[0]).0;
    let mut open: Vec<Open> = points.iter().filter_map(|point| Open::at(*point, car, &here)).collect();
    let mut blind = Vec::new();
    let steps = libm::ceil((ways_m[1] - ways_m[0]).max(0.0) / STEP_M) as u32;
    let far_m2 = beyond_reach_m2(car, sight);
    for step in 0..=steps {
        let way_m = (ways_m[0] + f64::from(step) * STEP_M).min(ways_m[1]);
        let (pose, _) = path.at(way_m);
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        // Thousands of points, at thousands of places of a long path: nearly all are far.
        open.retain_mut(|Open { point, least_m, seen_m }| {
            let (dx, dy) = (point[0] - pose.x_m, point[1] - pose.y_m);
            if dx * dx + dy * dy > far_m2 {
                return true;
            }
            let (ahead_m, left_m) = (dx * cos + dy * sin, dy * cos - dx * sin);
            if car.distance_from_m(ahead_m, left_m) <= *least_m {
                if *seen_m > way_m - STOPS_WITHIN_M {
                    blind.push((way_m, *point));
                }
                return false;
            }
            if *seen_m > way_m && looks_at(car, sight, ahead_m, left_m) {
                *seen_m = way_m;
            }
            true
        });
        if open.is_empty() {
            break;
        }
    }
    blind
}

/// A point that no beam has passed over yet, or only so far along the path.
struct Open {
    point: [f64; 2],
    /// As near as this the body touches it.
    least_m: f64,
    /// Where a beam first looks there; without one, never.
    seen_m: f64,
}

impl Open {
    /// `None` under the body. What is that near already may stay so, but the body gets no nearer.
    fn at(point: [f64; 2], car: &Car, here: &MapPose) -> Option<Self> {
        let off_m = car.distance_m(here, point);
        let least_m = if off_m > IN_THE_WAY_M { IN_THE_WAY_M } else { off_m - NEARER_M };
        (off_m > 0.0).then_some(Self { point, least_m, seen_m: f64::MAX })
    }
}

/// The square of a distance from the reference point from which on nothing is touched or looked at, in m².
fn beyond_reach_m2(car: &Car, sight: &Sight) -> f64 {
    let along_m = car.front_m.max(car.rear_m) + SURE_WITHIN_M.max(IN_THE_WAY_M);
    let across_m = sight.widest_m().max(car.half_width_m + IN_THE_WAY_M);
    (along_m * along_m + across_m * across_m) * 1.001 // more than any rounding
}

/// Whether a beam of either bumper passes over a point that is so far ahead of the reference point, and to its left.
fn looks_at(car: &Car, sight: &Sight, ahead_m: f64, left_m: f64) -> bool {
    let beyond_m = (ahead_m - car.front_m).max(-car.rear_m - ahead_m);
    (0.0..=SURE_WITHIN_M).contains(&beyond_m) && sight.looks_at(ahead_m > 0.0, left_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Piece;
    use xtb_control::VehicleConfig;

    const TIGHT_PER_M: f64 = 1.0 / 0.45;

    fn car() -> Car {
        Car::of(&VehicleConfig::default())
    }

    /// From the origin, facing east.
    fn blind(length_m: f64, curvature_per_m: f64, point: [f64; 2]) -> bool {
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        let path = Path { start, pieces: vec![Piece { length_m, curvature_per_m }] };
        !blind_points(&path, [0.0, path.length_m()], (&car(), &Sight::default()), &[point]).is_empty()
    }

    #[test]
    fn straight_ahead_and_straight_astern_the_beams_look_first() {
        for (ahead_m, left_m) in [(0.6, 0.0), (0.6, 0.2), (0.6, -0.2), (0.6, 0.25)] {
            assert!(!blind(1.0, 0.0, [ahead_m, left_m]), "({ahead_m}, {left_m})");
            assert!(!blind(-1.0, 0.0, [-ahead_m, left_m]), "({ahead_m}, {left_m})");
        }
    }

    #[test]
    fn a_corner_that_swings_out_goes_where_no_beam_looks() {
        // Beside the right rear wheel, 3 cm off the body.
        assert!(blind(0.5, TIGHT_PER_M, [-0.1, -0.23]));
        assert!(!blind(0.5, 0.0, [-0.1, -0.23]), "driving straight on it does not");
    }

    #[test]
    fn so_does_the_inner_side_of_a_tight_bend() {
        // The circle's middle is at (0, 0.45); the side gets as near to it as 0.25 m, the beams only 0.37 m.
        assert!(blind(1.2, TIGHT_PER_M, [0.29, 0.45]));
        assert!(!blind(1.2, TIGHT_PER_M, [0.47, 0.45]), "in the middle of the lane they look first");
    }

    #[test]
    fn a_look_that_comes_too_late_to_stop_is_none() {
        assert!(blind(0.5, 0.0, [0.25 + 0.08, 0.0]));
        assert!(!blind(0.5, 0.0, [0.25 + 0.25, 0.0]));
    }

    #[test]
    fn what_is_nearly_touched_already_is_left_and_not_driven_into() {
        let corner = [0.26, -0.19];
        assert!(blind(0.5, 0.0, corner) && blind(0.5, TIGHT_PER_M, corner));
        assert!(!blind(-0.5, 0.0, corner), "astern is away from it");
    }
}
