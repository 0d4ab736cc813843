//! Simple polygons: inside or not, touching or not, crossing themselves or not. Borders count as inside.

type Point = [f64; 2];

/// Twice the area of the triangle; + = `c` lies left of the way from `a` to `b`.
fn side(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether `p`, which is in line with `a` and `b`, lies between them.
fn between(a: Point, b: Point, p: Point) -> bool {
    (0..2).all(|i| a[i].min(b[i]) <= p[i] && p[i] <= a[i].max(b[i]))
}

/// Whether two segments have a point in common.
fn meet(a: Point, b: Point, c: Point, d: Point) -> bool {
    let (c_side, d_side, a_side, b_side) = (side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b));
    let apart = |first: f64, second: f64| (first > 0.0 && second < 0.0) || (first < 0.0 && second > 0.0);
    (apart(c_side, d_side) && apart(a_side, b_side))
        || (c_side == 0.0 && between(a, b, c))
        || (d_side == 0.0 && between(a, b, d))
        || (a_side == 0.0 && between(c, d, a))
        || (b_side == 0.0 && between(c, d, b))
}

/// The sides of a polygon, from each corner to the next.
pub fn sides(points: &[Point]) -> impl Iterator<Item = (Point, Point)> {
    points.iter().enumerate().map(|(i, from)| (*from, points[(i + 1) % points.len()]))
}

/// Two sides (numbers of their first corners) that have more in common than the corner between them.
#[must_use]
pub fn crossing(points: &[Point]) -> Option<(usize, usize)> {
    let count = points.len();
    let corner = |i: usize| points[i % count];
    for first in 0..count {
        let (a, b) = (corner(first), corner(first + 1));
        if a == b {
            return Some((first, (first + 1) % count));
        }
        // The next side begins where this one ends: it must not turn straight back.
        let c = corner(first + 2);
        let back = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0.0;
        if side(a, b, c) == 0.0 && back {
            return Some((first, (first + 1) % count));
        }
        let last = if first == 0 { count - 1 } else { count };
        let other = (first + 2..last).find(|&second| meet(a, b, corner(second), corner(second + 1)));
        if let Some(second) = other {
            return Some((first, second));
        }
    }
    None
}

/// Whether a point is inside or on the border.
#[must_use]
pub fn holds(points: &[Point], p: Point) -> bool {
    let mut inside = false;
    for (a, b) in sides(points) {
        let turn = side(a, b, p);
        if turn == 0.0 && between(a, b, p) {
            return true;
        }
        // The ray from p to the east crosses sides that go up on their left and those that go down on
        // their right; a corner belongs to the side above it.
        if (a[1] <= p[1]) != (b[1] <= p[1]) && (turn > 0.0) == (b[1] > a[1]) {
            inside = !inside;
        }
    }
    inside
}

/// Whether two polygons have a point in common.
#[must_use]
pub fn touch(one: &[Point], other: &[Point]) -> bool {
    let ((a_low, a_high), (b_low, b_high)) = (bounds(one), bounds(other));
    if (0..2).any(|i| a_high[i] < b_low[i] || b_high[i] < a_low[i]) {
        return false;
    }
    let first = |points: &[Point]| points.first().copied();
    sides(one).any(|(a, b)| sides(other).any(|(c, d)| meet(a, b, c, d)))
        || first(other).is_some_and(|p| holds(one, p))
        || first(one).is_some_and(|p| holds(other, p))
}

/// The corners of the smallest upright rectangle around these points: south-west and north-east.
#[must_use]
pub fn bounds(points: &[Point]) -> (Point, Point) {
    points.iter().fold(([f64::MAX; 2], [f64::MIN; 2]), |(low, high), p| {
        ([low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])])
    })
}

/// How far a point is from a polygon, in m; 0 inside.
#[must_use]
pub fn distance_m(points: &[Point], p: Point) -> f64 {
    if holds(points, p) {
        return 0.0;
    }
    let to_side = |(a, b): (Point, Point)| {
        let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        let length2 = along[0] * along[0] + along[1] * along[1];
        let part = ((to[0] * along[0] + to[1] * along[1]) / length2).clamp(0.0, 1.0);
        libm::hypot(to[0] - part * along[0], to[1] - part * along[1])
    };
    sides(points).map(to_side).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square with a notch in its north side.
    const NOTCHED: [Point; 7] =
        [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [3.0, 4.0], [2.0, 1.0], [1.0, 4.0], [0.0, 4.0]];

    #[test]
    fn inside_is_told_from_the_notch_and_the_border_is_inside() {
        for inside in [[2.0, 0.5], [0.5, 3.9], [2.0, 1.0], [4.0, 2.0], [0.0, 0.0], [3.5, 4.0]] {
            assert!(holds(&NOTCHED, inside), "{inside:?}");
        }
        for outside in [[2.0, 1.1], [2.0, 4.0], [-0.1, 0.0], [5.0, 4.0], [-1.0, 1.0], [4.1, 1.0]] {
            assert!(!holds(&NOTCHED, outside), "{outside:?}");
        }
        let reversed: Vec<Point> = NOTCHED.iter().rev().copied().collect();
        assert!(holds(&reversed, [2.0, 0.5]) && !holds(&reversed, [2.0, 1.1]));
    }

    #[test]
    fn polygons_touch_inside_each_other_across_and_in_the_notch_not() {
        let square = |x: f64, y: f64, half: f64| {
            [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
        };
        assert!(touch(&NOTCHED, &square(0.5, 2.0, 0.1)) && touch(&square(0.5, 2.0, 0.1), &NOTCHED));
        assert!(touch(&NOTCHED, &square(4.0, 4.0, 0.5)));
        assert!(touch(&NOTCHED, &square(5.0, 2.0, 1.0))); // side by side
        assert!(touch(&NOTCHED, &square(2.0, 2.0, 10.0)));
        assert!(!touch(&NOTCHED, &square(2.0, 3.0, 0.3)));
        assert!(!touch(&NOTCHED, &square(5.0, 2.0, 0.99)));
    }

    #[test]
    fn the_distance_is_to_the_nearest_side() {
        assert_eq!(distance_m(&NOTCHED, [5.0, 2.0]), 1.0);
        assert_eq!(distance_m(&NOTCHED, [1.0, 1.0]), 0.0);
        assert!((distance_m(&NOTCHED, [-3.0, -4.0]) - 5.0).abs() < 1e-12);
    }
}
