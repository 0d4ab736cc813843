//! Rectangles and discs: how far apart they are, standing and on the move.

use super::motion::Spot;
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

/// A rectangle somewhere.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) cos: f64,
    pub(crate) sin: f64,
    pub(crate) half_length: f64,
    pub(crate) half_width: f64,
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

    #[inline]
    pub(crate) fn at(&self, spot: &Spot) -> Placed {
        let [x, y] = self.centre(spot);
        let Self { half_length, half_width, .. } = *self;
        Placed { x, y, cos: spot.cos, sin: spot.sin, half_length, half_width }
    }

    /// Longest way of any point of the body on this piece.
    #[inline]
    pub(crate) fn way(&self, piece: &Piece) -> f64 {
        let bend = piece.curvature_per_m.abs();
        let (across, along) = (1.0 + bend * self.half_width, bend * self.far);
        piece.length_m.abs() * (across * across + along * along).sqrt()
    }
}

impl Placed {
    /// How far two rectangles are apart along the axis that separates them best; never more than their
    /// distance, negative where they overlap.
    #[inline]
    pub(crate) fn gap(&self, other: &Self) -> f64 {
        let (dx, dy) = (other.x - self.x, other.y - self.y);
        let cos = (self.cos * other.cos + self.sin * other.sin).abs();
        let sin = (self.sin * other.cos - self.cos * other.sin).abs();
        let (a, b) = (self, other);
        let ahead =
            (dx * a.cos + dy * a.sin).abs() - (a.half_length + b.half_length * cos + b.half_width * sin);
        let aside =
            (dy * a.cos - dx * a.sin).abs() - (a.half_width + b.half_length * sin + b.half_width * cos);
        let there =
            (dx * b.cos + dy * b.sin).abs() - (b.half_length + a.half_length * cos + a.half_width * sin);
        let beside =
            (dy * b.cos - dx * b.sin).abs() - (b.half_width + a.half_length * sin + a.half_width * cos);
        ahead.max(aside).max(there.max(beside))
    }

    /// How far the rim of a disc is away; negative inside.
    #[inline]
    pub(crate) fn gap_to_disc(&self, x: f64, y: f64, radius: f64) -> f64 {
        let (dx, dy) = (x - self.x, y - self.y);
        let ahead = (dx * self.cos + dy * self.sin).abs() - self.half_length;
        let aside = (dy * self.cos - dx * self.sin).abs() - self.half_width;
        let (out_ahead, out_aside) = (ahead.max(0.0), aside.max(0.0));
        let outside = (out_ahead * out_ahead + out_aside * out_aside).sqrt();
        if outside > 0.0 { outside - radius } else { ahead.max(aside) - radius }
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
        a.0.at(&a.1.after(a.2, fraction)).gap(&b.0.at(&b.1.after(b.2, fraction)))
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
        stays_clear(their_way, margin + between, |fraction| mine.gap(&b.0.at(&b.1.after(b.2, fraction))))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_nav::MapPose;

    const CAR: Car = Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0 };

    fn spot(x_m: f64, y_m: f64, yaw_rad: f64) -> Spot {
        Spot::new(&MapPose { x_m, y_m, yaw_rad })
    }

    #[test]
    fn a_gap_is_negative_exactly_where_the_cars_overlap() {
        let (body, here) = (Body::new(&CAR), spot(0.0, 0.0, 0.3));
        for step in 0..400 {
            let there =
                spot(f64::from(step % 20) * 0.5 - 5.0, f64::from(step / 20) * 0.5 - 5.0, f64::from(step));
            let overlap = CAR.overlaps(&here.pose(), &CAR, &there.pose());
            assert_eq!(body.at(&here).gap(&body.at(&there)) < 0.0, overlap, "{there:?}");
        }
    }

    #[test]
    fn cars_that_swap_places_within_a_step_touch() {
        let body = Body::new(&Car { front_m: 0.2, rear_m: 0.2, half_width_m: 0.2, radius_m: 3.0 });
        let ahead = Piece { length_m: 2.0, curvature_per_m: 0.0 };
        let (a, b) = (spot(0.0, 0.0, 0.0), spot(2.0, 0.0, std::f64::consts::PI));
        assert!(!pass((&body, &a, &ahead), (&body, &b, &ahead), 0.01));
        let beside = spot(2.0, 0.5, std::f64::consts::PI);
        assert!(pass((&body, &a, &ahead), (&body, &beside, &ahead), 0.01));
    }

    #[test]
    fn a_disc_is_as_far_as_its_rim() {
        let placed = Body::new(&CAR).at(&spot(0.0, 0.0, 0.0));
        assert!((placed.gap_to_disc(5.0, 5.0, 0.8) - (5.0 - 0.8)).abs() < 1e-12);
        assert!(placed.gap_to_disc(0.5, 0.5, 0.8) < -0.8);
    }
}
