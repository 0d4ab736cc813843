//! Where a car is after part of a step, without sines and cosines: the search asks millions of times.

use xtb_nav::geometry::path::wrap_rad;
use xtb_nav::{MapPose, Piece};

/// Most that a car turns within one step, in rad; up to this the series below are exact to 1e-9.
pub(crate) const MOST_TURN_RAD: f64 = 1.0;

/// A pose with the sine and cosine of its heading. In m and rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spot {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) yaw: f64,
    pub(crate) cos: f64,
    pub(crate) sin: f64,
}

/// A step without moving.
pub(crate) const WAIT: Piece = Piece { length_m: 0.0, curvature_per_m: 0.0 };

impl Spot {
    pub(crate) fn new(pose: &MapPose) -> Self {
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        Self { x: pose.x_m, y: pose.y_m, yaw: pose.yaw_rad, cos, sin }
    }

    pub(crate) fn pose(&self) -> MapPose {
        MapPose { x_m: self.x, y_m: self.y, yaw_rad: wrap_rad(self.yaw) }
    }

    /// After this fraction of a piece.
    #[inline]
    pub(crate) fn after(&self, piece: &Piece, fraction: f64) -> Self {
        Drive::new(piece, fraction).end(self)
    }
}

/// A fraction of a piece, ready to be driven from anywhere.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive {
    ahead: f64,
    left: f64,
    turned: f64,
    cos: f64,
    sin: f64,
}

impl Drive {
    #[inline]
    pub(crate) fn new(piece: &Piece, fraction: f64) -> Self {
        let way = piece.length_m * fraction;
        let turned = piece.curvature_per_m * way;
        let (along, across) = chord(turned);
        let (ahead, left) = (way * along, way * across);
        Self { ahead, left, turned, cos: 1.0 - turned * across, sin: turned * along }
    }

    /// Where it ends, from here.
    #[inline]
    pub(crate) fn end(&self, spot: &Spot) -> Spot {
        Spot {
            x: spot.x + self.ahead * spot.cos - self.left * spot.sin,
            y: spot.y + self.ahead * spot.sin + self.left * spot.cos,
            yaw: spot.yaw + self.turned,
            cos: spot.cos * self.cos - spot.sin * self.sin,
            sin: spot.sin * self.cos + spot.cos * self.sin,
        }
    }
}

/// sin θ / θ and (1 − cos θ) / θ for |θ| up to [`MOST_TURN_RAD`].
#[inline]
fn chord(turned: f64) -> (f64, f64) {
    let q = turned * turned;
    let along = 1.0
        - q / 6.0
            * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0 * (1.0 - q / 156.0)))));
    let across = turned / 2.0
        * (1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0 * (1.0 - q / 132.0)))));
    (along, across)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_agree_with_the_exact_arc() {
        let start = MapPose { x_m: 1.0, y_m: -2.0, yaw_rad: 0.4 };
        for curvature_per_m in [-0.9, -0.3, 0.0, 0.2, 1.0] {
            for length_m in [-1.0, -0.2, 0.6, 1.0] {
                let piece = Piece { length_m, curvature_per_m };
                let (exact, spot) =
                    (piece.after(&start, length_m * 0.7), Spot::new(&start).after(&piece, 0.7));
                let off = libm::hypot(exact.x_m - spot.x, exact.y_m - spot.y)
                    + (exact.yaw_rad - spot.yaw).abs()
                    + (libm::cos(spot.yaw) - spot.cos).abs()
                    + (libm::sin(spot.yaw) - spot.sin).abs();
                assert!(off < 1e-9, "{piece:?}: {off}");
            }
        }
    }
}
