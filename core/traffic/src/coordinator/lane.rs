//! Keep right: in a corridor in which two trucks can pass each other each keeps to its own side, so that they
//! do without either of them making room.

use super::room::RoomGeometry;
use std::f64::consts::FRAC_PI_2;
use xtb_nav::{Car, MapPose};

/// Walls farther away than this to one side do not matter, in widths of the truck: 1.6 m for an XTB of 0.40 m;
/// chosen, not measured.
const FAR: f64 = 4.0;
/// Narrower than two trucks side by side and so much more, in m, it has no lanes: for what each keeps from
/// the other and from the walls; chosen, not measured.
const ROOM_M: f64 = 0.3;
/// Wider than so many trucks it is no corridor; chosen, not measured.
const WIDEST: f64 = 5.5;
/// The side of a truck keeps so far from the wall on its right, in m; chosen, not measured.
const WALL_M: f64 = 0.09;
/// A wall counts as met this near, in m: the usual cell of a map.
const MET_M: f64 = 0.05;

/// How far to the left of its lane a truck is that drives so, in m; 0 where there are no lanes.
pub(super) fn beside_m(room: &dyn RoomGeometry, car: &Car, pose: &MapPose, gear: f64) -> f64 {
    let right_rad = pose.yaw_rad - FRAC_PI_2 * gear.signum();
    let truck_m = 2.0 * car.half_width_m;
    let Some(right_m) = to_wall_m(room, pose, right_rad, FAR * truck_m) else { return 0.0 };
    let Some(left_m) = to_wall_m(room, pose, right_rad + 2.0 * FRAC_PI_2, FAR * truck_m) else { return 0.0 };
    let wide_m = right_m + left_m;
    if wide_m < 2.0 * truck_m + ROOM_M || wide_m > WIDEST * truck_m {
        return 0.0;
    }
    // The middle of its half, or nearer to the wall where the half is narrow.
    let lane_m = (wide_m / 4.0).min(wide_m / 2.0 - car.half_width_m - WALL_M).max(car.half_width_m + WALL_M);
    (right_m - lane_m).max(0.0)
}

/// From a truck's middle to the next fixed thing in a direction; `None` = farther than that.
fn to_wall_m(room: &dyn RoomGeometry, pose: &MapPose, toward_rad: f64, far_m: f64) -> Option<f64> {
    let (sin, cos) = libm::sincos(toward_rad);
    let mut way_m = 0.0;
    while way_m < far_m {
        let free_m = room.clearance_m(pose.x_m + way_m * cos, pose.y_m + way_m * sin);
        if free_m < MET_M {
            return Some(way_m);
        }
        way_m += free_m;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinator::room::GridRoom;
    use std::f64::consts::PI;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Cell, Grid};

    /// Along x, from y = 0 to its width.
    fn corridor(width_m: f64) -> GridRoom {
        let mut grid = Grid::free(0.05, [0.0, -1.0], 200, 100).unwrap();
        for row in 0..grid.height() as i64 {
            for column in 0..grid.width() as i64 {
                let [_, y_m] = grid.centre_m(column, row);
                if y_m < 0.0 || y_m > width_m {
                    grid.set(column, row, Cell::Occupied);
                }
            }
        }
        GridRoom::new(grid)
    }

    fn beside(width_m: f64, y_m: f64, yaw_rad: f64, gear: f64) -> f64 {
        let car = Car::of(&VehicleConfig::default());
        beside_m(&corridor(width_m), &car, &MapPose { x_m: 5.0, y_m, yaw_rad }, gear)
    }

    #[test]
    fn in_a_corridor_the_lane_is_on_the_right_in_either_gear() {
        assert!(beside(1.5, 0.40, 0.0, 1.0) < 0.05, "{}", beside(1.5, 0.40, 0.0, 1.0));
        assert!(beside(1.5, 1.10, 0.0, 1.0) > 0.6);
        assert!(beside(1.5, 1.10, PI, 1.0) < 0.05);
        assert!(beside(1.5, 1.10, 0.0, -1.0) < 0.05, "astern, westwards");
        assert!(beside(1.5, 0.40, 0.0, -1.0) > 0.6);
    }

    #[test]
    fn where_two_cannot_pass_and_in_halls_there_are_no_lanes() {
        for y_m in [0.25, 0.45, 0.65] {
            assert_eq!(beside(0.9, y_m, 0.0, 1.0), 0.0);
            assert_eq!(beside(2.6, y_m, 0.0, 1.0), 0.0);
        }
    }
}
