//! Drawing is on the safe side, and not more than that.

use crate::any;
use proptest::prelude::*;
use xtb_nav::map::{polygon, raster};
use xtb_nav::{Cell, Grid, MapPose};

/// A cell, grown or shrunk by `margin_m`, as a polygon.
fn square(grid: &Grid, column: i64, row: i64, margin_m: f64) -> [[f64; 2]; 4] {
    let [x, y] = grid.centre_m(column, row);
    let half = grid.resolution_m() / 2.0 + margin_m;
    [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
}

fn exact(grid: &Grid, shape: &[[f64; 2]]) -> Result<(), TestCaseError> {
    for row in 0..grid.height() as i64 {
        for column in 0..grid.width() as i64 {
            let marked = grid.cell(column, row) == Cell::Occupied;
            let within = polygon::touch(&square(grid, column, row, -1e-5), shape);
            let around = polygon::touch(&square(grid, column, row, 1e-5), shape);
            prop_assert!(marked || !within, "({column}, {row}) is overlapped and free");
            prop_assert!(!marked || around, "({column}, {row}) is occupied by nothing");
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn a_polygon_marks_the_cells_that_it_overlaps_and_no_other(star in any::star()) {
        let mut grid = Grid::free(0.23, [-4.0, -3.0], 30, 30).unwrap();
        raster::polygon(&mut grid, &star, Cell::Occupied);
        exact(&grid, &star)?;
    }

    #[test]
    fn a_rectangle_anywhere_marks_its_cells(
        x_m in -3.0..3.0_f64, y_m in -3.0..3.0_f64, yaw_rad in -3.2..3.2_f64,
        length_m in 0.001..4.0_f64, width_m in 0.001..1.0_f64,
    ) {
        let mut grid = Grid::free(0.1, [-2.0, -2.0], 40, 40).unwrap();
        raster::rectangle(&mut grid, &MapPose { x_m, y_m, yaw_rad }, length_m, width_m, Cell::Occupied);
        let (sin, cos) = (yaw_rad.sin(), yaw_rad.cos());
        let corner = |(a, b): (f64, f64)| {
            let (a, b) = (a * length_m / 2.0, b * width_m / 2.0);
            [x_m + a * cos - b * sin, y_m + a * sin + b * cos]
        };
        exact(&grid, &[(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(corner))?;
    }

    #[test]
    fn every_point_of_a_polyline_is_occupied(
        points in prop::collection::vec((-2.0..2.0_f64, -2.0..2.0_f64), 2..6), part in 0.0..1.0_f64,
    ) {
        let points: Vec<[f64; 2]> = points.into_iter().map(|(x, y)| [x, y]).collect();
        let mut grid = Grid::free(0.05, [-2.5, -2.5], 100, 100).unwrap();
        raster::polyline(&mut grid, &points, 0.05, Cell::Occupied);
        for ends in points.windows(2) {
            let at = |i: usize| ends[0][i] + part * (ends[1][i] - ends[0][i]);
            prop_assert_eq!(grid.at(at(0), at(1)), Cell::Occupied);
        }
    }
}
