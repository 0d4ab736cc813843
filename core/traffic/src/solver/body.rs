//! Bodies of cars: where they are, and whether they stay apart on the move.

use super::motion::Spot;
use xtb_nav::geometry::Rect;
use xtb_nav::{Car, Piece};

/// Part of a step below which two moments count as the same; chosen, not measured.
const FINEST: f64 = 1.0 / 64.0;
/// Moments of one move at which a body is compared with the whole of another one's; chosen, not measured.
const LOOKS: u32 = 4;

/// A car's body around its own middle. Lengths in m.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body {
    /// From the reference point to the middle of the body, ahead.
    middle: f64,
    half_length: f64,
    half_width: f64,
    /// From the middle to a corner.
    pub(crate) reach: f64,
    /// From the reference point to the end that is farther away.
    far: f64,
}

impl Body {
    pub(crate) fn new(car: &Car) -> Self {
        let (half_length, half_width) = ((car.front_m + car.rear_m) / 2.0, car.half_width_m);
        Self {
            middle: (car.front_m - car.rear_m) / 2.0,
            half_length,
            half_width,
            reach: libm::hypot(half_length, half_width),
            far: car.front_m.max(car.rear_m),
        }
    }

    /// Farthest corner from the reference point.
    pub(crate) fn reach_of_reference(&self) -> f64 {
        libm::hypot(self.far, self.half_width)
    }

    #[inline]
    pub(crate) fn centre(&self, spot: &Spot) -> [f64; 2] {
        [spot.x + self.middle * spot.cos, spot.y + self.middle * spot.sin]
    }

    /// From the middle to an end.
    pub(crate) fn half_length(&self) -> f64 {
        self.half_length
    }

    #[inline]
    pub(crate) fn at(&self, spot: &Spot) -> Rect {
        let half = [self.half_length, self.half_width];
        Rect::from_parts(self.centre(spot), (spot.sin, spot.cos), half, self.reach)
    }

    /// Longest way of any point of the body on this piece.
    #[inline]
    pub(crate) fn way(&self, piece: &Piece) -> f64 {
        let bend = piece.curvature_per_m.abs();
        let (across, along) = (1.0 + bend * self.half_width, bend * self.far);
        piece.length_m.abs() * (across * across + along * along).sqrt()
    }
}

/// Whether two things stay at least `margin` apart where it is looked at, and never touch between:
/// `gap` says how far apart they are after a fraction of the step (at most their distance), `way` how
/// much nearer they can come in the whole step.
#[inline]
pub(crate) fn stays_clear(way: f64, margin: f64, mut gap: impl FnMut(f64) -> f64) -> bool {
    let mut fraction = 0.0;
    loop {
        let apart = gap(fraction);
        if apart < margin {
            return false;
        }
        if fraction >= 1.0 || way <= 0.0 {
            return true;
        }
        fraction = (fraction + ((apart + margin) / way).max(FINEST)).min(1.0);
    }
}

/// Whether two moving cars stay clear of each other in one step.
#[inline]
pub(crate) fn pass(a: (&Body, &Spot, &Piece), b: (&Body, &Spot, &Piece), margin: f64) -> bool {
    let way = a.0.way(a.2) + b.0.way(b.2);
    let ([ax, ay], [bx, by]) = (a.0.centre(a.1), b.0.centre(b.1));
    let near = a.0.reach + b.0.reach + way + margin;
    if (ax - bx) * (ax - bx) + (ay - by) * (ay - by) > near * near {
        return true;
    }
    stays_clear(way, margin, |fraction| {
        a.0.at(&a.1.after(a.2, fraction)).gap_m(&b.0.at(&b.1.after(b.2, fraction)))
    })
}

/// Whether two moves have no place in common, whenever each of them is driven.
pub(crate) fn never_meet(a: (&Body, &Spot, &Piece), b: (&Body, &Spot, &Piece), margin: f64) -> bool {
    let (way, their_way) = (a.0.way(a.2), b.0.way(b.2));
    let ([ax, ay], [bx, by]) = (a.0.centre(a.1), b.0.centre(b.1));
    let near = a.0.reach + b.0.reach + way + their_way + margin;
    if (ax - bx) * (ax - bx) + (ay - by) * (ay - by) > near * near {
        return true;
    }
    // Between two looks the body moves half of the distance at most away from one of them.
    let looks = if way > 0.0 { LOOKS } else { 0 };
    let between = way / f64::from(2 * LOOKS);
    (0..=looks).all(|look| {
        let mine = a.0.at(&a.1.after(a.2, f64::from(look) / f64::from(LOOKS)));
        stays_clear(their_way, margin + between, |fraction| mine.gap_m(&b.0.at(&b.1.after(b.2, fraction))))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_nav::MapPose;

    fn spot(x_m: f64, y_m: f64, yaw_rad: f64) -> Spot {
        Spot::new(&MapPose { x_m, y_m, yaw_rad })
    }

    #[test]
    fn at_a_spot_a_body_is_what_it_is_at_its_pose() {
        let car =
            Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0, gears: xtb_nav::Gears::BOTH };
        for step in 0..400 {
            let pose = MapPose { x_m: f64::from(step % 20), y_m: 3.7, yaw_rad: f64::from(step) * 0.1 };
            assert_eq!(Body::new(&car).at(&Spot::new(&pose)), Rect::body(&car, &pose));
        }
    }

    #[test]
    fn cars_that_swap_places_within_a_step_touch() {
        let body = Body::new(&Car {
            front_m: 0.2,
            rear_m: 0.2,
            half_width_m: 0.2,
            radius_m: 3.0,
            gears: xtb_nav::Gears::BOTH,
        });
        let ahead = Piece { length_m: 2.0, curvature_per_m: 0.0 };
        let (a, b) = (spot(0.0, 0.0, 0.0), spot(2.0, 0.0, std::f64::consts::PI));
        assert!(!pass((&body, &a, &ahead), (&body, &b, &ahead), 0.01));
        let beside = spot(2.0, 0.5, std::f64::consts::PI);
        assert!(pass((&body, &a, &ahead), (&body, &beside, &ahead), 0.01));
    }
}
