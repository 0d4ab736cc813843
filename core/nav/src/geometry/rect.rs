//! Rectangles on the floor: bodies of trucks, and the strips ahead of them that must be clear.

use super::car::Car;
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
        Self {
            x_m: pose.x_m + shift * cos,
            y_m: pose.y_m + shift * sin,
            sin,
            cos,
            half_length_m,
            half_width_m: car.half_width_m,
            reach_m: libm::hypot(half_length_m, car.half_width_m),
        }
    }

    /// The body and what must be clear beyond its bumper when it drives in this gear.
    #[must_use]
    pub fn looking(car: &Car, pose: &MapPose, gear: f64) -> Self {
        let longer = if gear < 0.0 {
            Car { rear_m: car.rear_m + LOOK_OUT_M, ..*car }
        } else {
            Car { front_m: car.front_m + LOOK_OUT_M, ..*car }
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
        let (ahead, left) = self.inside(x_m, y_m);
        libm::hypot((ahead.abs() - self.half_length_m).max(0.0), (left.abs() - self.half_width_m).max(0.0))
    }

    /// Whether a square with this half side, parallel to the map's axes, reaches into it when it is
    /// grown by a margin; at its corners a little too careful.
    #[must_use]
    pub fn meets_square(&self, x_m: f64, y_m: f64, half_m: f64, margin_m: f64) -> bool {
        let (ahead, left) = self.inside(x_m, y_m);
        let spread = half_m * (self.sin.abs() + self.cos.abs()) + margin_m;
        ahead.abs() < self.half_length_m + spread && left.abs() < self.half_width_m + spread
    }

    fn inside(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        (dx * self.cos + dy * self.sin, dy * self.cos - dx * self.sin)
    }

    /// Whether the two overlap when each is grown by `margin_m` on all sides (separating axes).
    #[must_use]
    pub fn overlaps(&self, other: &Self, margin_m: f64) -> bool {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        let reach = self.reach_m + other.reach_m + 3.0 * margin_m;
        if dx * dx + dy * dy >= reach * reach {
            return false;
        }
        let c = (self.cos * other.cos + self.sin * other.sin).abs();
        let s = (self.cos * other.sin - self.sin * other.cos).abs();
        let (al, aw) = (self.half_length_m + margin_m, self.half_width_m + margin_m);
        let (bl, bw) = (other.half_length_m + margin_m, other.half_width_m + margin_m);
        let (ahead, left) = self.inside(other.x_m, other.y_m);
        if ahead.abs() >= al + bl * c + bw * s || left.abs() >= aw + bl * s + bw * c {
            return false;
        }
        let (ahead, left) = other.inside(self.x_m, self.y_m);
        ahead.abs() < bl + al * c + aw * s && left.abs() < bw + al * s + aw * c
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
            assert_eq!(Rect::body(&car, &here).overlaps(&Rect::body(&car, &there), 0.0), both, "{there:?}");
            met[usize::from(both)] += 1;
        }
        assert!(met[0] > 500 && met[1] > 500, "{met:?}");
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
