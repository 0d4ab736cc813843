//! The floor that a rectangle of the car passes over while it drives an arc.
//!
//! Between samples it is grown by what its points can move, so nothing slips through. Let the pose in
//! the middle of a stretch be known, h the way from there to either end, κ the curvature, and (a, l) a
//! point of the car: ahead and left of the reference point. After the way s the car has turned by κs,
//! and in the frame of the middle pose the point moves, per metre of way, by R(κs) · (1 − κl, κa).
//! With |a| ≤ F, |l| ≤ W, |sin κs| ≤ |κs| and |cos κs| ≤ 1 the integral from 0 to s, |s| ≤ h, is at most
//!
//! ```text
//! ahead:  h (1 + |κ| W) + ½ h² κ² F
//! left:   h |κ| F + ½ h² |κ| (1 + |κ| W)
//! ```
//!
//! so the rectangle in the middle, grown by these, covers all that it covers on the stretch. Where the
//! grown rectangle is not free but the plain one is, the stretch is halved, down to [`FINEST_M`]; what
//! is undecided then counts as touching (gaps under about 2 mm). On a straight the sides do not grow at all.

use crate::MapPose;
use crate::geometry::Piece;
use crate::geometry::path::STRAIGHT_PER_M;

/// Way on which a rectangle that is still undecided counts as touching, in m; chosen, not measured.
pub(super) const FINEST_M: f64 = 0.002;

/// Way that is looked at in one go at most, in m; chosen, not measured.
const LONGEST_M: f64 = 0.2;

/// What touches by less than this may be rounding, in m.
pub(super) const ROUNDING_M: f64 = 1e-9;

/// A rectangle in the car's frame, from −`rear_m` to `front_m`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plate {
    pub(super) front_m: f64,
    pub(super) rear_m: f64,
    pub(super) half_width_m: f64,
}

impl Plate {
    /// Grown by all that its points move on `half_m` of way to either side.
    pub(super) fn grown(&self, half_m: f64, curvature_per_m: f64) -> Self {
        let bend = curvature_per_m.abs();
        let far = self.front_m.abs().max(self.rear_m.abs());
        let across = 1.0 + bend * self.half_width_m;
        let ahead = half_m * across + 0.5 * half_m * half_m * bend * bend * far;
        let left = half_m * bend * far + 0.5 * half_m * half_m * bend * across;
        Self {
            front_m: self.front_m + ahead,
            rear_m: self.rear_m + ahead,
            half_width_m: self.half_width_m + left,
        }
    }

    /// What touches this touches the plate, and not by rounding.
    fn shrunk(&self) -> Self {
        Self {
            front_m: self.front_m - ROUNDING_M,
            rear_m: self.rear_m - ROUNDING_M,
            half_width_m: self.half_width_m - ROUNDING_M,
        }
    }
}

/// A pose with its sine and cosine.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) sin: f64,
    pub(super) cos: f64,
}

impl Frame {
    pub(super) fn of(pose: &MapPose) -> Self {
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        Self { x_m: pose.x_m, y_m: pose.y_m, sin, cos }
    }

    /// A point ahead and left of the reference point.
    pub(super) fn point_m(&self, ahead_m: f64, left_m: f64) -> [f64; 2] {
        [self.x_m + ahead_m * self.cos - left_m * self.sin, self.y_m + ahead_m * self.sin + left_m * self.cos]
    }

    /// After `way_m` of an arc.
    pub(super) fn after(&self, way_m: f64, curvature_per_m: f64) -> Self {
        if curvature_per_m.abs() < STRAIGHT_PER_M {
            let [x_m, y_m] = self.point_m(way_m, 0.0);
            return Self { x_m, y_m, ..*self };
        }
        let (sin, cos) = libm::sincos(curvature_per_m * way_m);
        let [x_m, y_m] = self.point_m(sin / curvature_per_m, (1.0 - cos) / curvature_per_m);
        Self { x_m, y_m, sin: self.sin * cos + self.cos * sin, cos: self.cos * cos - self.sin * sin }
    }
}

/// What a sweep asks of the floor.
pub(super) trait FreeSpace {
    /// Whether all of the rectangle is free, for certain.
    fn free(&self, at: &Frame, plate: &Plate) -> bool;
}

/// The first way (signed, in m) on the piece at which the rectangle touches something; `None` = free.
pub(super) fn touch(floor: &impl FreeSpace, plate: &Plate, from: &Frame, piece: &Piece) -> Option<f64> {
    let parts = libm::ceil(piece.length_m.abs() / LONGEST_M).max(1.0);
    let half_m = 0.5 * piece.length_m / parts;
    (0..parts as usize).find_map(|part| {
        let middle_m = half_m * (2 * part + 1) as f64;
        touch_within(floor, plate, from, piece.curvature_per_m, middle_m, half_m)
    })
}

fn touch_within(
    floor: &impl FreeSpace,
    plate: &Plate,
    from: &Frame,
    curvature_per_m: f64,
    middle_m: f64,
    half_m: f64,
) -> Option<f64> {
    let at = from.after(middle_m, curvature_per_m);
    if floor.free(&at, &plate.grown(half_m.abs(), curvature_per_m)) {
        return None;
    }
    if half_m.abs() <= 0.5 * FINEST_M || !floor.free(&at, plate) {
        return Some(middle_m);
    }
    let quarter_m = 0.5 * half_m;
    touch_within(floor, plate, from, curvature_per_m, middle_m - quarter_m, quarter_m)
        .or_else(|| touch_within(floor, plate, from, curvature_per_m, middle_m + quarter_m, quarter_m))
}

/// Whether [`touch`] finds nothing: sooner known than where something is, since what a car drives into it mostly
/// still touches at the end.
pub(super) fn clear(floor: &impl FreeSpace, plate: &Plate, from: &Frame, piece: &Piece) -> bool {
    let parts = libm::ceil(piece.length_m.abs() / LONGEST_M).max(1.0);
    let (half_m, curvature_per_m) = (0.5 * piece.length_m / parts, piece.curvature_per_m);
    (0..parts as usize).all(|part| {
        let middle_m = half_m * (2 * part + 1) as f64;
        let at = from.after(middle_m, curvature_per_m);
        if floor.free(&at, &plate.grown(half_m.abs(), curvature_per_m)) {
            return true;
        }
        let end = from.after(middle_m + half_m, curvature_per_m);
        floor.free(&end, &plate.shrunk())
            && clear_halves(floor, plate, from, curvature_per_m, (middle_m, half_m))
    })
}

/// The same on a stretch around `middle_m`, `half_m` to either side, by its halves.
fn clear_halves(
    floor: &impl FreeSpace,
    plate: &Plate,
    from: &Frame,
    curvature_per_m: f64,
    (middle_m, half_m): (f64, f64),
) -> bool {
    let quarter_m = 0.5 * half_m;
    let may_halve = half_m.abs() > 0.5 * FINEST_M;
    let grown = plate.grown(quarter_m.abs(), curvature_per_m);
    may_halve
        && [middle_m + quarter_m, middle_m - quarter_m].into_iter().all(|middle_m| {
            let at = from.after(middle_m, curvature_per_m);
            floor.free(&at, &grown)
                || floor.free(&at, plate)
                    && clear_halves(floor, plate, from, curvature_per_m, (middle_m, quarter_m))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: Plate = Plate { front_m: 0.25, rear_m: 0.25, half_width_m: 0.2 };

    #[test]
    fn a_grown_rectangle_covers_all_that_the_plain_one_covers_on_the_way() {
        let from = Frame::of(&MapPose { x_m: 1.0, y_m: -2.0, yaw_rad: 0.8 });
        let strip = Plate { front_m: 0.55, rear_m: -0.25, half_width_m: 0.17 };
        for (plate, curvature) in
            [BODY, strip].into_iter().flat_map(|p| [-2.545, -1.0, 0.0, 2.545].map(|c| (p, c)))
        {
            for half in [0.001, 0.02, 0.1, 0.4] {
                let grown = plate.grown(half, curvature);
                for step in -50..=50 {
                    let there = from.after(half * f64::from(step) / 50.0, curvature);
                    for (ahead, left) in [
                        (plate.front_m, 1.0),
                        (-plate.rear_m, 1.0),
                        (plate.front_m, -1.0),
                        (-plate.rear_m, -1.0),
                    ] {
                        let [x, y] = there.point_m(ahead, left * plate.half_width_m);
                        let (dx, dy) = (x - from.x_m, y - from.y_m);
                        let (a, l) = (dx * from.cos + dy * from.sin, dy * from.cos - dx * from.sin);
                        let inside = a <= grown.front_m + 1e-12 && -a <= grown.rear_m + 1e-12;
                        assert!(
                            inside && l.abs() <= grown.half_width_m + 1e-12,
                            "{plate:?} {curvature} {half} {step}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn frames_follow_arcs_as_poses_do() {
        let from = MapPose { x_m: 1.0, y_m: -2.0, yaw_rad: 0.8 };
        for (way, curvature) in [(0.7, 2.0), (-0.7, 2.0), (1.3, -0.4), (-0.2, 0.0)] {
            let piece = Piece { length_m: way, curvature_per_m: curvature };
            let (pose, frame) = (piece.end(&from), Frame::of(&from).after(way, curvature));
            let (sin, cos) = libm::sincos(pose.yaw_rad);
            let off = (pose.x_m - frame.x_m).abs() + (pose.y_m - frame.y_m).abs();
            assert!(off + (sin - frame.sin).abs() + (cos - frame.cos).abs() < 1e-12);
        }
    }
}
