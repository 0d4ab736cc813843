//! Drawing is on the safe side, and not more than that.

use crate::any;
use allocation_counter::measure;
use proptest::prelude::*;
use xtb_nav::map::{ZoneLayers, Zones, polygon, raster};
use xtb_nav::{Cell, Grid, Map, MapPose, Zone, ZoneKind};

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

/// Drawing as it was before it went by runs: each cell on its own.
fn draw_each_cell(grid: &mut Grid, points: &[[f64; 2]], cell: Cell) {
    const EDGE: f64 = 1e-6;
    let scale = |p: &[f64; 2], i: usize| (p[i] - grid.origin_m()[i]) / grid.resolution_m();
    let points: Vec<[f64; 2]> = points.iter().map(|p| [scale(p, 0), scale(p, 1)]).collect();
    let between = |low: f64, high: f64, count: usize| {
        let first = libm::ceil(low + EDGE - 1.0).max(0.0) as i64;
        let last = libm::floor(high - EDGE).min(count as f64 - 1.0) as i64;
        first..=last
    };
    for (a, b) in polygon::sides(&points) {
        let (low, high) = if a[1] <= b[1] { (a, b) } else { (b, a) };
        let rise = high[1] - low[1];
        let (west, east) = (a[0].min(b[0]), a[0].max(b[0]));
        for row in between(low[1], high[1], grid.height()) {
            let (bottom, top) = (row as f64 + EDGE, (row + 1) as f64 - EDGE);
            let x_at = |y: f64| (low[0] + (high[0] - low[0]) * ((y - low[1]) / rise)).clamp(west, east);
            let from = if bottom <= low[1] { low[0] } else { x_at(bottom) };
            let to = if top >= high[1] { high[0] } else { x_at(top) };
            between(from.min(to), from.max(to), grid.width()).for_each(|column| grid.set(column, row, cell));
        }
    }
    let (low, high) = polygon::bounds(&points);
    for row in between(low[1], high[1], grid.height()) {
        let y = row as f64 + 0.5;
        let crosses = |(a, b): &([f64; 2], [f64; 2])| (a[1] <= y) != (b[1] <= y);
        let at = |(a, b): ([f64; 2], [f64; 2])| a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1]));
        let mut crossings: Vec<f64> = polygon::sides(&points).filter(crosses).map(at).collect();
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let first = libm::ceil(pair[0] - 0.5).max(0.0) as i64;
            let last = libm::floor(pair[1] - 0.5).min(grid.width() as f64 - 1.0) as i64;
            (first..=last).for_each(|column| grid.set(column, row, cell));
        }
    }
}

/// The layers as they were made before: for each zone a grid of its own, drawn and searched.
fn layers_by_whole_grids(map: &Map) -> ZoneLayers {
    let grid = map.grid();
    let count = grid.cells().len();
    let mut layers =
        ZoneLayers { keep_outs: Zones { names: Vec::new(), cells: vec![0; count] }, one_way: None };
    for zone in map.zones() {
        let mut drawn =
            Grid::free(grid.resolution_m(), grid.origin_m(), grid.width(), grid.height()).unwrap();
        draw_each_cell(&mut drawn, zone.points(), Cell::Occupied);
        let under = (0..count).filter(|&i| drawn.cells()[i] == Cell::Occupied);
        match zone.kind() {
            ZoneKind::KeepOut => {
                layers.keep_outs.names.push(zone.name().to_owned());
                let number = u16::try_from(layers.keep_outs.names.len()).unwrap();
                under.for_each(|i| layers.keep_outs.cells[i] = number);
            }
            ZoneKind::OneWay { heading_rad } => {
                let allowed = layers.one_way.get_or_insert_with(|| vec![None; count]);
                under.for_each(|i| allowed[i] = Some(heading_rad as f32));
            }
        }
    }
    layers
}

/// A floor that the stars of [`any::zones`] lie on, reach out of, or miss.
fn floor() -> impl Strategy<Value = Grid> {
    (1_usize..60, 1_usize..60, 0.05..0.5_f64, -8.0..2.0_f64, -8.0..2.0_f64).prop_map(
        |(width, height, resolution_m, x_m, y_m)| {
            Grid::free(resolution_m, [x_m, y_m], width, height).unwrap()
        },
    )
}

/// Many small zones on a large floor must not each cost a copy of it: a robot would be busy for minutes.
#[test]
fn a_zone_costs_no_copy_of_the_grid() {
    let grid = Grid::free(0.05, [0.0, 0.0], 1000, 1000).unwrap();
    let zone = |i: usize| {
        let (west, east) = (i as f64, i as f64 + 0.5);
        let points = vec![[west, 1.0], [east, 1.0], [east, 2.0], [west, 2.0]];
        Zone::new(&i.to_string(), ZoneKind::KeepOut, points).unwrap()
    };
    let map = Map::new("large", grid, (0..40).map(zone).collect()).unwrap();
    let counted = measure(|| drop(std::hint::black_box(ZoneLayers::of(&map))));
    // The layer has two bytes for each of the million cells; a copy of the grid would have one more.
    assert!(counted.bytes_total < 3_000_000, "{counted:?}");
}

proptest! {
    #[test]
    fn drawing_by_runs_marks_the_same_cells_as_drawing_each(
        mut grid in floor(), on_borders in any::<bool>(),
        points in prop::collection::vec((-9.0..9.0_f64, -9.0..9.0_f64), 3..12),
    ) {
        let (step_m, [x_m, y_m]) = (grid.resolution_m(), grid.origin_m());
        let place = |along: f64, from: f64| if on_borders { from + (along / step_m).round() * step_m } else { along };
        let points: Vec<[f64; 2]> = points.into_iter().map(|(x, y)| [place(x, x_m), place(y, y_m)]).collect();
        let mut each = grid.clone();
        draw_each_cell(&mut each, &points, Cell::Occupied);
        raster::polygon(&mut grid, &points, Cell::Occupied);
        prop_assert_eq!(grid, each);
    }

    #[test]
    fn zones_lie_on_the_same_cells_as_when_each_had_a_grid_of_its_own(grid in floor(), zones in any::zones()) {
        let map = Map::new("m", grid, zones).unwrap();
        prop_assert_eq!(ZoneLayers::of(&map), layers_by_whole_grids(&map));
    }

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
