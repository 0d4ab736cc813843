//! What stands on the floor for good, as the traffic search asks for it.

use xtb_nav::geometry::rect::Rect;
use xtb_nav::planner::space::OneWay;
use xtb_nav::{Cell, Clearance, Grid, Map};

/// A floor with fixed things on it.
pub trait RoomGeometry: std::fmt::Debug + Send + Sync {
    /// Whether nothing fixed is inside the rectangle grown by `margin_m`.
    fn is_free(&self, rect: &Rect, margin_m: f64) -> bool;
    /// How far the nearest fixed thing is from a point, in m; no farther than it cares for.
    fn clearance_m(&self, x_m: f64, y_m: f64) -> f64;
    /// South-west and north-east corner, in m.
    fn corners_m(&self) -> [[f64; 2]; 2];
    /// Where it may be driven in one direction only; `None` = nowhere.
    fn one_way(&self) -> Option<&OneWay> {
        None
    }
}

/// Farther than this the distance to the nearest thing does not matter, in m: more than half the width of a
/// truck of 2 m; one of 2.15 m would find no way.
const FAR_M: f64 = 1.0;

/// An occupancy grid with its distance field.
#[derive(Debug, Clone)]
pub struct GridRoom {
    grid: Grid,
    clearance: Clearance,
    one_way: Option<OneWay>,
}

impl GridRoom {
    /// Measures the distances. What lies outside the grid is occupied.
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        Self { clearance: Clearance::of(&grid), grid, one_way: None }
    }

    /// The floor of a map, with its keep-outs as things and its one-way zones.
    #[must_use]
    pub fn of(map: &Map) -> Self {
        Self { one_way: OneWay::of(map), ..Self::new(map.grid_with_keep_outs()) }
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }
}

impl RoomGeometry for GridRoom {
    fn is_free(&self, rect: &Rect, margin_m: f64) -> bool {
        let reach = rect.reach_m() + 1.5 * margin_m;
        if self.clearance.at_least_m(rect.x_m, rect.y_m) > reach {
            return true;
        }
        if self.clearance.at_most_m(rect.x_m, rect.y_m) < rect.core_m() {
            return false;
        }
        rect.is_free_on(&self.grid, margin_m, |column, row| self.grid.cell(column, row) != Cell::Free)
    }

    fn clearance_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.clearance.at_least_m(x_m, y_m).min(FAR_M)
    }

    fn corners_m(&self) -> [[f64; 2]; 2] {
        let [x, y] = self.grid.origin_m();
        let side = self.grid.resolution_m();
        [[x, y], [x + side * self.grid.width() as f64, y + side * self.grid.height() as f64]]
    }

    fn one_way(&self) -> Option<&OneWay> {
        self.one_way.as_ref()
    }
}

#[cfg(test)]
impl GridRoom {
    /// A room with walls around it and these boxes in it: x, y, width, depth in m.
    pub(super) fn with(width_m: f64, height_m: f64, boxes: &[[f64; 4]]) -> Self {
        let cells = |length: f64| libm::round(length / 0.05) as usize;
        let mut grid = Grid::free(0.05, [0.0, 0.0], cells(width_m), cells(height_m)).unwrap();
        for row in 0..grid.height() as i64 {
            for column in 0..grid.width() as i64 {
                let [x, y] = grid.centre_m(column, row);
                if boxes.iter().any(|b| x > b[0] && x < b[0] + b[2] && y > b[1] && y < b[1] + b[3]) {
                    grid.set(column, row, Cell::Occupied);
                }
            }
        }
        Self::new(grid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Car, MapPose};

    /// 4 m × 4 m with one pillar of 20 cm in the middle.
    fn pillar() -> GridRoom {
        GridRoom::with(4.0, 4.0, &[[1.9, 1.9, 0.2, 0.2]])
    }

    #[test]
    fn a_body_is_free_exactly_until_it_meets_a_cell() {
        let (room, car) = (pillar(), Car::of(&VehicleConfig::default()));
        let at = |x_m, y_m| Rect::body(&car, &MapPose { x_m, y_m, yaw_rad: 0.0 });
        // The pillar's west side is at 1.9 m, the truck's front 0.25 m ahead of its middle.
        assert!(room.is_free(&at(1.649, 2.0), 0.0));
        assert!(!room.is_free(&at(1.651, 2.0), 0.0));
        assert!(!room.is_free(&at(1.649, 2.0), 0.01));
        // The room's own walls.
        assert!(room.is_free(&at(0.251, 1.0), 0.0));
        assert!(!room.is_free(&at(0.249, 1.0), 0.0));
    }

    #[test]
    fn the_quick_answers_agree_with_the_slow_one() {
        let (room, car) = (pillar(), Car::of(&VehicleConfig::default()));
        for step in 0..3000 {
            let step = f64::from(step);
            let pose = MapPose {
                x_m: 2.0 + libm::sin(step) * 2.0,
                y_m: 2.0 + libm::cos(1.3 * step) * 2.0,
                yaw_rad: step,
            };
            let rect = Rect::body(&car, &pose);
            let meets = |half_m: f64| {
                (-1..=80).any(|row| {
                    (-1..=80).any(|column| {
                        let [x, y] = room.grid.centre_m(column, row);
                        room.grid.cell(column, row) != Cell::Free && rect.meets_square(x, y, half_m, 0.0)
                    })
                })
            };
            let free = room.is_free(&rect, 0.0);
            assert!(free || meets(0.025), "{pose:?} is free");
            assert!(!free || !meets(0.001), "{pose:?} is not free");
        }
    }
}
