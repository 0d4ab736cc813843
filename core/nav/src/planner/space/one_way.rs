//! One-way zones on the cells of a grid: the one rule by which all planners drive through them.
//!
//! What counts is the reference point's course, so a car may drive through astern.

use super::LayersError;
use crate::MapPose;
use crate::geometry::{Grid, Piece};
use crate::map::{Map, ZoneLayers};

/// A course this little beyond a right angle is rounding: far more than f64's.
const ROUNDING: f64 = 1e-9;
/// In a measure that goes from cell to cell in eighths of a turn, a course that is allowed looks up to so far
/// beyond a right angle (cosine): 30°, where half of an eighth are 22.5°.
const EIGHTHS: f64 = -0.5;

/// Nearer to a zone's direction than this (cosine) a car stands along it: 45°; chosen, not measured.
const ALONG: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// For each cell of a grid the direction of driving that is allowed.
#[derive(Debug, Clone, PartialEq)]
pub struct OneWay {
    resolution_m: f64,
    origin_m: [f64; 2],
    width: usize,
    height: usize,
    /// In rad, `None` = all.
    allowed: Vec<Option<f32>>,
}

impl OneWay {
    /// A layer on the cells of this grid.
    ///
    /// # Errors
    /// [`LayersError::Cells`]: it is not as large as the grid.
    pub fn new(grid: &Grid, allowed: Vec<Option<f32>>) -> Result<Self, LayersError> {
        let (cells, wanted) = (allowed.len(), grid.cells().len());
        if cells != wanted {
            return Err(LayersError::Cells { layer: "one-way", cells, wanted });
        }
        let (resolution_m, origin_m) = (grid.resolution_m(), grid.origin_m());
        Ok(Self { resolution_m, origin_m, width: grid.width(), height: grid.height(), allowed })
    }

    /// The one-way zones of a map; `None` = it has none.
    #[must_use]
    pub fn of(map: &Map) -> Option<Self> {
        Self::new(map.grid(), ZoneLayers::of(map).one_way?).ok()
    }

    /// The direction that is allowed at a point, in rad; `None` = all.
    fn allowed_rad(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let along = |v: f64, origin: f64| libm::floor((v - origin) / self.resolution_m) as i64;
        let column = usize::try_from(along(x_m, self.origin_m[0])).ok().filter(|&at| at < self.width)?;
        let row = usize::try_from(along(y_m, self.origin_m[1])).ok().filter(|&at| at < self.height)?;
        self.allowed[row * self.width + column].map(f64::from)
    }

    /// Whether a car that stands there can drive on: in a zone, one that stands across it may have a wall ahead, and
    /// astern is against the zone.
    #[must_use]
    pub fn lets_drive_on(&self, pose: &MapPose) -> bool {
        let along = |allowed_rad: f64| libm::cos(pose.yaw_rad - allowed_rad).abs() >= ALONG;
        self.allowed_rad(pose.x_m, pose.y_m).is_none_or(along)
    }

    /// Where the reference point would go against a zone on this piece, (x, y) in m.
    #[must_use]
    pub fn against(&self, from: &MapPose, piece: &Piece) -> Option<[f64; 2]> {
        let steps = libm::ceil(2.0 * piece.length_m.abs() / self.resolution_m).max(1.0);
        (0..=steps as usize).find_map(|step| {
            let pose = piece.after(from, piece.length_m * step as f64 / steps);
            let along = libm::cos(pose.yaw_rad - self.allowed_rad(pose.x_m, pose.y_m)?) * piece.gear();
            (along < -ROUNDING).then_some([pose.x_m, pose.y_m])
        })
    }

    /// Whether a step between neighbouring cells of a coarse measure, from one point to the other, may be
    /// part of an allowed way.
    #[must_use]
    pub fn lets_through(&self, from_m: [f64; 2], to_m: [f64; 2]) -> bool {
        let course_rad = libm::atan2(to_m[1] - from_m[1], to_m[0] - from_m[0]);
        [from_m, to_m].iter().all(|[x_m, y_m]| {
            self.allowed_rad(*x_m, *y_m).is_none_or(|allowed| libm::cos(course_rad - allowed) > EIGHTHS)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coarse_step_goes_along_or_across_but_not_back() {
        let grid = Grid::free(0.1, [0.0, 0.0], 20, 10).unwrap();
        let north_east = OneWay::new(&grid, vec![Some(0.4); 200]).unwrap();
        let from = [1.0, 0.5];
        for (to, may) in [([1.1, 0.5], true), ([1.0, 0.6], true), ([0.9, 0.6], true), ([0.9, 0.5], false)] {
            assert_eq!(north_east.lets_through(from, to), may, "{to:?}");
        }
        // Outside of the grid there are no zones.
        assert!(north_east.lets_through([-3.0, 0.5], [-3.1, 0.5]));
        let west = Piece { length_m: 1.0, curvature_per_m: 0.0 };
        let at = |x_m: f64| MapPose { x_m, y_m: 0.5, yaw_rad: 3.1 };
        assert_eq!(north_east.against(&at(-1.0), &west), None);
        assert!(north_east.against(&at(1.0), &west).is_some());
        assert_eq!(north_east.against(&at(1.0), &Piece { length_m: -0.5, ..west }), None);
    }

    #[test]
    fn a_layer_of_another_size_is_refused() {
        let grid = Grid::free(0.1, [0.0, 0.0], 20, 10).unwrap();
        let refused = LayersError::Cells { layer: "one-way", cells: 3, wanted: 200 };
        assert_eq!(OneWay::new(&grid, vec![None; 3]), Err(refused));
    }
}
