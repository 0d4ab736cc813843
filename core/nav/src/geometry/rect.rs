//! Rectangles on the floor: bodies of trucks, and the strips ahead of them that must be clear.
//!
//! Traffic control and the solver of schedules both ask [`Rect`] whether two bodies overlap.
//! [`Car::overlaps`] finds that out by other means: schedules are judged by it.

use super::car::Car;
use super::grid::Grid;
use crate::MapPose;

/// What is this near to the bumper stops a truck, in m: the infrared rule's 25 cm (`obstacle.threshold_cm`,
/// §4.6) and 2 cm, since the published fit reads 25 cm for what is 27 cm away (`farther_m` in
/// `obstacle_layer/beams.rs`). Paths are planned for the default threshold: a truck with a larger one stops
/// before what they lead past.
pub const INFRARED_STOPS_M: f64 = 0.25 + 0.02;

/// Clear way beyond the bumper that a driving truck needs, in m: 4 cm more than stops it, for noise and for the
/// errors of two poses. The margin of each pair comes on top; a path of one's own keeps a little more
/// ([`navigator::LOOK_OUT_M`](crate::navigator::LOOK_OUT_M)).
pub const LOOK_OUT_M: f64 = INFRARED_STOPS_M + 0.04;

/// A rectangle that stands anyhow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Middle, in m.
    pub x_m: f64,
    /// Middle, in m.
    pub y_m: f64,
    sin: f64,
    cos: f64,
    half_length_m: f64,
    half_width_m: f64,
    reach_m: f64,
}

impl Rect {
    /// The body of a car.
    #[must_use]
    pub fn body(car: &Car, pose: &MapPose) -> Self {
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let (half_length_m, shift) = ((car.front_m + car.rear_m) / 2.0, (car.front_m - car.rear_m) / 2.0);
        let middle_m = [pose.x_m + shift * cos, pose.y_m + shift * sin];
        let reach_m = libm::hypot(half_length_m, car.half_width_m);
        Self::from_parts(middle_m, (sin, cos), [half_length_m, car.half_width_m], reach_m)
    }

    /// From what is already known: its middle, sine and cosine of its heading, half its length and half its
    /// width, and from its middle to its corners; lengths in m.
    #[inline]
    #[must_use]
    pub fn from_parts(middle_m: [f64; 2], (sin, cos): (f64, f64), half_m: [f64; 2], reach_m: f64) -> Self {
        let ([x_m, y_m], [half_length_m, half_width_m]) = (middle_m, half_m);
        Self { x_m, y_m, sin, cos, half_length_m, half_width_m, reach_m }
    }

    /// The body and what must be clear beyond its bumper when it drives in this gear.
    #[must_use]
    pub fn looking(car: &Car, pose: &MapPose, gear: f64) -> Self {
        Self::looking_to(car, pose, gear, LOOK_OUT_M)
    }

    /// The body and so many m beyond its bumper in this gear.
    #[must_use]
    pub fn looking_to(car: &Car, pose: &MapPose, gear: f64, beyond_m: f64) -> Self {
        let longer = if gear < 0.0 {
            Car { rear_m: car.rear_m + beyond_m, ..*car }
        } else {
            Car { front_m: car.front_m + beyond_m, ..*car }
        };
        Self::body(&longer, pose)
    }

    /// From the middle to the corners, in m.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Half of the shorter side, in m.
    #[must_use]
    pub fn core_m(&self) -> f64 {
        self.half_length_m.min(self.half_width_m)
    }

    /// How far a point is from it, in m; 0 inside.
    #[must_use]
    pub fn distance_m(&self, x_m: f64, y_m: f64) -> f64 {
        let (ahead, left) = self.beyond(x_m, y_m);
        libm::hypot(ahead.max(0.0), left.max(0.0))
    }

    /// Whether a point is farther from it than `than_m`, which is not negative: cheaper than the distance.
    #[inline]
    #[must_use]
    pub fn is_farther(&self, x_m: f64, y_m: f64, than_m: f64) -> bool {
        let (ahead, left) = self.beyond(x_m, y_m);
        let (ahead, left) = (ahead.max(0.0), left.max(0.0));
        ahead * ahead + left * left > than_m * than_m
    }

    /// How far the rim of a disc is away, in m; negative where they overlap.
    #[inline]
    #[must_use]
    pub fn gap_to_disc_m(&self, x_m: f64, y_m: f64, radius_m: f64) -> f64 {
        let (ahead, left) = self.beyond(x_m, y_m);
        let (out_ahead, out_left) = (ahead.max(0.0), left.max(0.0));
        let outside = (out_ahead * out_ahead + out_left * out_left).sqrt();
        if outside > 0.0 { outside - radius_m } else { ahead.max(left) - radius_m }
    }

    /// Whether a square with this half side, parallel to the map's axes, reaches into it when it is
    /// grown by a margin; at its corners a little too careful.
    #[must_use]
    pub fn meets_square(&self, x_m: f64, y_m: f64, half_m: f64, margin_m: f64) -> bool {
        let (ahead, left) = self.inside(x_m, y_m);
        let spread = half_m * (self.sin.abs() + self.cos.abs()) + margin_m;
        ahead.abs() < self.half_length_m + spread && left.abs() < self.half_width_m + spread
    }

    /// Whether no blocked cell of a grid reaches into it when it is grown by a margin; at its corners a little too
    /// careful.
    #[must_use]
    pub fn is_free_on(&self, grid: &Grid, margin_m: f64, is_blocked: impl Fn(i64, i64) -> bool) -> bool {
        let reach = self.reach_m + 1.5 * margin_m;
        let (left, low) = grid.place(self.x_m - reach, self.y_m - reach);
        let (right, high) = grid.place(self.x_m + reach, self.y_m + reach);
        let half = grid.resolution_m() / 2.0;
        !(low..=high).any(|row| {
            (left..=right).any(|column| {
                let [x, y] = grid.centre_m(column, row);
                is_blocked(column, row) && self.meets_square(x, y, half, margin_m)
            })
        })
    }

    /// How far apart the two are along the axis that separates them best, in m: never more than their
    /// distance, negative where they overlap.
    #[inline]
    #[must_use]
    pub fn gap_m(&self, other: &Self) -> f64 {
        let (apart, turn) = ([other.x_m - self.x_m, other.y_m - self.y_m], self.turn(other));
        let half = |rect: &Self| [rect.half_length_m, rect.half_width_m];
        let (mine, theirs) = (half(self), half(other));
        let (ahead, left) = self.axis_gaps(apart, mine, theirs, turn);
        let (there, beside) = other.axis_gaps(apart, theirs, mine, turn);
        ahead.max(left).max(there.max(beside))
    }

    /// Whether the two overlap when each is grown by `margin_m` on all sides (separating axes).
    #[inline]
    #[must_use]
    pub fn overlaps(&self, other: &Self, margin_m: f64) -> bool {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        let reach = self.reach_m + other.reach_m + 3.0 * margin_m;
        if dx * dx + dy * dy >= reach * reach {
            return false;
        }
        let (apart, turn) = ([dx, dy], self.turn(other));
        let grown = |rect: &Self| [rect.half_length_m + margin_m, rect.half_width_m + margin_m];
        let (mine, theirs) = (grown(self), grown(other));
        let (ahead, left) = self.axis_gaps(apart, mine, theirs, turn);
        if ahead >= 0.0 || left >= 0.0 {
            return false;
        }
        let (there, beside) = other.axis_gaps(apart, theirs, mine, turn);
        there < 0.0 && beside < 0.0
    }

    /// The gaps along this one's own two axes, in m, to a rectangle whose middle is `apart` from this one's
    /// (or the other way round), from half the sides of both and [`Self::turn`].
    #[inline]
    fn axis_gaps(
        &self,
        apart: [f64; 2],
        [length, width]: [f64; 2],
        [their_length, their_width]: [f64; 2],
        (cos, sin): (f64, f64),
    ) -> (f64, f64) {
        let (ahead, left) = self.along(apart);
        (
            ahead.abs() - (length + their_length * cos + their_width * sin),
            left.abs() - (width + their_length * sin + their_width * cos),
        )
    }

    /// Cosine and sine of the angle between the two, without their signs.
    #[inline]
    fn turn(&self, other: &Self) -> (f64, f64) {
        let cos = self.cos * other.cos + self.sin * other.sin;
        let sin = self.cos * other.sin - self.sin * other.cos;
        (cos.abs(), sin.abs())
    }

    /// How far a point is beyond its ends and beyond its sides; negative between them.
    #[inline]
    fn beyond(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (ahead, left) = self.inside(x_m, y_m);
        (ahead.abs() - self.half_length_m, left.abs() - self.half_width_m)
    }

    /// A point in its own frame: ahead and left of its middle.
    #[inline]
    fn inside(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        self.along([x_m - self.x_m, y_m - self.y_m])
    }

    /// The parts of a vector ahead and to the left.
    #[inline]
    fn along(&self, [dx, dy]: [f64; 2]) -> (f64, f64) {
        (dx * self.cos + dy * self.sin, dy * self.cos - dx * self.sin)
    }
}

/// A truck at one place of its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// Its body.
    pub body: Rect,
    /// Body and look-out of the move that brought it here; `None` = it did not move.
    pub look: Option<Rect>,
}

impl Stand {
    /// A truck that just stands there.
    #[must_use]
    pub fn still(car: &Car, pose: &MapPose) -> Self {
        Self { body: Rect::body(car, pose), look: None }
    }

    /// Whether the bodies come too near to each other.
    #[must_use]
    pub fn touches(&self, other: &Self, margin_m: f64) -> bool {
        self.body.overlaps(&other.body, margin_m)
    }

    /// Whether the other's body is in this one's look-out.
    #[must_use]
    pub fn sees(&self, other: &Self, margin_m: f64) -> bool {
        self.look.is_some_and(|look| look.overlaps(&other.body, margin_m))
    }

    /// Any of these, both ways.
    #[must_use]
    pub fn conflicts(&self, other: &Self, margin_m: f64) -> bool {
        self.touches(other, margin_m) || self.sees(other, margin_m) || other.sees(self, margin_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;

    const CAR: Car =
        Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0, gears: crate::Gears::BOTH };

    fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
        MapPose { x_m, y_m, yaw_rad }
    }

    #[test]
    fn without_margin_it_agrees_with_the_cars_own_test() {
        let car = Car::of(&VehicleConfig::default());
        let here = pose(0.0, 0.0, 0.3);
        let mut met = [0, 0];
        for step in 0..4000 {
            let step = f64::from(step);
            let there = pose(libm::sin(step) * 0.8, libm::cos(step * 1.7) * 0.8, step * 0.37);
            let both = car.overlaps(&here, &car, &there);
            let (body, other) = (Rect::body(&car, &here), Rect::body(&car, &there));
            assert_eq!(body.overlaps(&other, 0.0), both, "{there:?}");
            assert_eq!(body.gap_m(&other) < 0.0, both, "{there:?}");
            assert_eq!(body.gap_m(&other), other.gap_m(&body), "{there:?}");
            met[usize::from(both)] += 1;
        }
        assert!(met[0] > 500 && met[1] > 500, "{met:?}");
    }

    #[test]
    fn a_gap_is_negative_exactly_where_the_cars_overlap() {
        let here = pose(0.0, 0.0, 0.3);
        for step in 0..400 {
            let (column, row) = (f64::from(step % 20), f64::from(step / 20));
            let there = pose(column * 0.5 - 5.0, row * 0.5 - 5.0, f64::from(step));
            let overlap = CAR.overlaps(&here, &CAR, &there);
            let (body, other) = (Rect::body(&CAR, &here), Rect::body(&CAR, &there));
            assert_eq!(body.gap_m(&other) < 0.0, overlap, "{there:?}");
            assert_eq!(body.overlaps(&other, 0.0), overlap, "{there:?}");
        }
    }

    #[test]
    fn a_margin_is_as_good_as_larger_cars() {
        let car = Car::of(&VehicleConfig::default());
        let (here, larger) = (pose(0.0, 0.0, 0.3), car.grown(0.05));
        for step in 0..4000 {
            let step = f64::from(step);
            let there = pose(libm::sin(step) * 0.9, libm::cos(step * 1.7) * 0.9, step * 0.37);
            let overlap = Rect::body(&car, &here).overlaps(&Rect::body(&car, &there), 0.05);
            let gap_m = Rect::body(&larger, &here).gap_m(&Rect::body(&larger, &there));
            assert_eq!(gap_m < 0.0, overlap, "{there:?}");
        }
    }

    #[test]
    fn a_disc_is_as_far_as_its_rim() {
        let body = Rect::body(&CAR, &pose(0.0, 0.0, 0.0));
        assert!((body.gap_to_disc_m(5.0, 5.0, 0.8) - (5.0 - 0.8)).abs() < 1e-12);
        assert!(body.gap_to_disc_m(0.5, 0.5, 0.8) < -0.8);
        assert!(body.is_farther(5.0, 5.0, 4.999) && !body.is_farther(5.0, 5.0, 5.001));
        assert!(!body.is_farther(0.5, 0.5, 0.0));
    }

    #[test]
    fn the_look_out_is_made_for_the_default_obstacle_rule() {
        let threshold_m = VehicleConfig::default().obstacle.threshold_cm / 100.0;
        assert_eq!(INFRARED_STOPS_M, threshold_m + 0.02);
    }

    #[test]
    fn the_look_out_is_on_the_side_where_it_drives() {
        let car = Car::of(&VehicleConfig::default());
        let (here, ahead) = (pose(0.0, 0.0, 0.0), Rect::body(&car, &pose(0.7, 0.0, 0.0)));
        assert!(Rect::looking(&car, &here, 1.0).overlaps(&ahead, 0.0));
        assert!(!Rect::looking(&car, &here, -1.0).overlaps(&ahead, 0.0));
    }
}
