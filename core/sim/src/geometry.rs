//! Oriented boxes: the one shape of this world, for walls, boxes and trucks alike.
//!
//! Exact ray casts and separations come from `parry2d`; angles go through `libm`, so that the bits
//! do not depend on the platform.

use parry2d_f64::math::{Pose, Rotation, Vector};
use parry2d_f64::query::{Ray, RayCast, sat};
use parry2d_f64::shape::Cuboid;

/// An axis-aligned rectangle, in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) min_x_m: f64,
    pub(crate) min_y_m: f64,
    pub(crate) max_x_m: f64,
    pub(crate) max_y_m: f64,
}

impl Bounds {
    /// The rectangle of these sizes around a centre.
    pub(crate) fn around(x_m: f64, y_m: f64, width_m: f64, depth_m: f64) -> Self {
        let (half_x, half_y) = (width_m / 2.0, depth_m / 2.0);
        Self { min_x_m: x_m - half_x, min_y_m: y_m - half_y, max_x_m: x_m + half_x, max_y_m: y_m + half_y }
    }

    /// The smallest rectangle that holds both.
    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            min_x_m: self.min_x_m.min(other.min_x_m),
            min_y_m: self.min_y_m.min(other.min_y_m),
            max_x_m: self.max_x_m.max(other.max_x_m),
            max_y_m: self.max_y_m.max(other.max_y_m),
        }
    }

    /// Larger by `margin_m` on all four sides.
    pub(crate) fn grown(self, margin_m: f64) -> Self {
        Self {
            min_x_m: self.min_x_m - margin_m,
            min_y_m: self.min_y_m - margin_m,
            max_x_m: self.max_x_m + margin_m,
            max_y_m: self.max_y_m + margin_m,
        }
    }

    pub(crate) fn width_m(self) -> f64 {
        self.max_x_m - self.min_x_m
    }

    pub(crate) fn depth_m(self) -> f64 {
        self.max_y_m - self.min_y_m
    }

    pub(crate) fn centre_m(self) -> (f64, f64) {
        ((self.min_x_m + self.max_x_m) / 2.0, (self.min_y_m + self.max_y_m) / 2.0)
    }

    /// Whether the two have a point in common.
    pub(crate) fn meets(self, other: Self) -> bool {
        self.min_x_m <= other.max_x_m
            && other.min_x_m <= self.max_x_m
            && self.min_y_m <= other.max_y_m
            && other.min_y_m <= self.max_y_m
    }

    pub(crate) fn holds(self, x_m: f64, y_m: f64) -> bool {
        (self.min_x_m..=self.max_x_m).contains(&x_m) && (self.min_y_m..=self.max_y_m).contains(&y_m)
    }
}

/// A ray of the given greatest length; its direction is a unit vector.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beam {
    ray: Ray,
    length_m: f64,
}

impl Beam {
    pub(crate) fn new(x_m: f64, y_m: f64, direction_x: f64, direction_y: f64, length_m: f64) -> Self {
        Self { ray: Ray::new(Vector::new(x_m, y_m), Vector::new(direction_x, direction_y)), length_m }
    }

    pub(crate) fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Only what is nearer than `length_m` matters from now on.
    pub(crate) fn shorten(&mut self, length_m: f64) {
        self.length_m = length_m;
    }

    /// Whether a point is farther than `reach_m` from all of it; false says nothing beyond its ends.
    pub(crate) fn passes(&self, (x_m, y_m): (f64, f64), reach_m: f64) -> bool {
        let (dx_m, dy_m) = (x_m - self.ray.origin.x, y_m - self.ray.origin.y);
        let along_m = dx_m * self.ray.dir.x + dy_m * self.ray.dir.y;
        let across_m = dy_m * self.ray.dir.x - dx_m * self.ray.dir.y;
        across_m.abs() > reach_m || along_m < -reach_m || along_m > self.length_m + reach_m
    }

    pub(crate) fn bounds(&self) -> Bounds {
        let from = self.ray.origin;
        let to = from + self.ray.dir * self.length_m;
        Bounds {
            min_x_m: from.x.min(to.x),
            min_y_m: from.y.min(to.y),
            max_x_m: from.x.max(to.x),
            max_y_m: from.y.max(to.y),
        }
    }
}

/// A box anywhere, turned by any angle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OrientedBox {
    pose: Pose,
    cuboid: Cuboid,
}

impl OrientedBox {
    /// `length_m` lies along the box's own x axis, which `yaw_rad` turns counter-clockwise from +x.
    pub(crate) fn new(x_m: f64, y_m: f64, yaw_rad: f64, length_m: f64, width_m: f64) -> Self {
        let (sin, cos) = libm::sincos(yaw_rad);
        Self::turned(x_m, y_m, (cos, sin), length_m, width_m)
    }

    /// As [`Self::new`], with the cosine and sine of the yaw already at hand.
    pub(crate) fn turned(x_m: f64, y_m: f64, (cos, sin): (f64, f64), length_m: f64, width_m: f64) -> Self {
        let rotation = Rotation::from_cos_sin_unchecked(cos, sin);
        Self {
            pose: Pose::from_parts(Vector::new(x_m, y_m), rotation),
            cuboid: Cuboid::new(Vector::new(length_m / 2.0, width_m / 2.0)),
        }
    }

    /// A wall of this thickness from one point to another, square at its ends.
    pub(crate) fn wall(from: [f64; 2], to: [f64; 2], thickness_m: f64) -> Self {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length_m = libm::hypot(dx, dy);
        let (x_m, y_m) = ((from[0] + to[0]) / 2.0, (from[1] + to[1]) / 2.0);
        // Half a thickness more at each end closes the corner to the next segment.
        Self::turned(x_m, y_m, (dx / length_m, dy / length_m), length_m + thickness_m, thickness_m)
    }

    pub(crate) fn centre_m(&self) -> (f64, f64) {
        (self.pose.translation.x, self.pose.translation.y)
    }

    /// Cosine and sine of the yaw.
    pub(crate) fn direction(&self) -> (f64, f64) {
        (self.pose.rotation.re, self.pose.rotation.im)
    }

    /// Distance from the centre to a corner.
    pub(crate) fn radius_m(&self) -> f64 {
        libm::hypot(self.cuboid.half_extents.x, self.cuboid.half_extents.y)
    }

    pub(crate) fn bounds(&self) -> Bounds {
        let (cos, sin) = (self.pose.rotation.re.abs(), self.pose.rotation.im.abs());
        let half = self.cuboid.half_extents;
        let (x_m, y_m) = self.centre_m();
        Bounds::around(x_m, y_m, 2.0 * (cos * half.x + sin * half.y), 2.0 * (sin * half.x + cos * half.y))
    }

    /// Its corners, counter-clockwise.
    pub(crate) fn corners(&self) -> [[f64; 2]; 4] {
        let half = self.cuboid.half_extents;
        [(half.x, half.y), (-half.x, half.y), (-half.x, -half.y), (half.x, -half.y)].map(|(x, y)| {
            let corner = self.pose.transform_point(Vector::new(x, y));
            [corner.x, corner.y]
        })
    }

    pub(crate) fn holds(&self, x_m: f64, y_m: f64) -> bool {
        let local = self.pose.inverse_transform_point(Vector::new(x_m, y_m));
        local.x.abs() <= self.cuboid.half_extents.x && local.y.abs() <= self.cuboid.half_extents.y
    }

    /// Separation in m; negative is the depth by which both penetrate each other. Never more than
    /// the true distance.
    pub(crate) fn separation_m(&self, other: &Self) -> f64 {
        let there = self.pose.inv_mul(&other.pose);
        let (here, _) =
            sat::cuboid_cuboid_find_local_separating_normal_oneway(&self.cuboid, &other.cuboid, &there);
        let (back, _) = sat::cuboid_cuboid_find_local_separating_normal_oneway(
            &other.cuboid,
            &self.cuboid,
            &there.inverse(),
        );
        here.max(back)
    }

    /// Where the beam meets the box, in m from its origin; 0 if it starts inside.
    pub(crate) fn hit_m(&self, beam: &Beam) -> Option<f64> {
        self.cuboid.cast_ray(&self.pose, &beam.ray, beam.length_m, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

    #[test]
    fn a_beam_meets_the_near_face_of_a_turned_box() {
        let square = OrientedBox::new(3.0, 0.0, FRAC_PI_4, 2.0, 2.0);
        let hit = square.hit_m(&Beam::new(0.0, 0.0, 1.0, 0.0, 5.0)).unwrap();
        assert!((hit - (3.0 - SQRT_2)).abs() < 1e-12, "{hit}");
        assert_eq!(square.hit_m(&Beam::new(0.0, 0.0, -1.0, 0.0, 5.0)), None);
        assert_eq!(square.hit_m(&Beam::new(0.0, 0.0, 1.0, 0.0, 1.0)), None);
        assert_eq!(square.hit_m(&Beam::new(3.0, 0.0, 1.0, 0.0, 5.0)), Some(0.0));
    }

    #[test]
    fn separation_is_negative_inside_and_positive_outside() {
        let a = OrientedBox::new(0.0, 0.0, 0.0, 2.0, 1.0);
        assert!((a.separation_m(&OrientedBox::new(2.0, 0.0, FRAC_PI_2, 1.0, 1.0)) - 0.5).abs() < 1e-12);
        assert!((a.separation_m(&OrientedBox::new(1.4, 0.0, 0.0, 1.0, 1.0)) + 0.1).abs() < 1e-12);
    }

    #[test]
    fn a_wall_reaches_past_its_points_by_half_its_thickness() {
        let wall = OrientedBox::wall([0.0, 0.0], [0.0, 2.0], 0.1);
        let bounds = wall.bounds();
        assert!((bounds.min_y_m + 0.05).abs() < 1e-12 && (bounds.max_y_m - 2.05).abs() < 1e-12);
        assert!((bounds.max_x_m - 0.05).abs() < 1e-12);
        assert!(wall.holds(0.04, 1.0) && !wall.holds(0.06, 1.0));
    }
}
