//! Drawing on a grid, on the safe side: every cell that a shape overlaps is marked, however little.
//!
//! Touching the border of a cell from outside is not overlapping: a wall that ends where a cell begins
//! leaves that cell alone.

use crate::MapPose;
use crate::geometry::{Cell, Grid};
use std::ops::{Range, RangeInclusive};

/// A shape reaches into a cell by this part of its side at least; keeps rounding out.
const EDGE: f64 = 1e-6;

/// Marks all cells that a simple polygon, (x, y) in m, overlaps.
pub fn polygon(grid: &mut Grid, points: &[[f64; 2]], cell: Cell) {
    let size = Size::of(grid);
    let points = in_cells(grid, points);
    runs(size, &points, &mut |indices| grid.fill(indices, cell));
}

/// Calls `mark` with runs of indices of all cells that a simple polygon, (x, y) in m, overlaps; a cell may
/// come more than once. The work is that of the polygon's own rows, whatever the size of the grid.
pub(super) fn polygon_runs(grid: &Grid, points: &[[f64; 2]], mut mark: impl FnMut(Range<usize>)) {
    runs(Size::of(grid), &in_cells(grid, points), &mut mark);
}

/// Columns and rows of a grid.
#[derive(Clone, Copy)]
struct Size {
    width: usize,
    height: usize,
}

impl Size {
    fn of(grid: &Grid) -> Self {
        Self { width: grid.width(), height: grid.height() }
    }

    /// Indices of the cells from one column to another, both included; `None` = there are none.
    fn run(self, row: i64, first: i64, last: i64) -> Option<Range<usize>> {
        let row = usize::try_from(row).ok().filter(|row| *row < self.height)?;
        let (first, last) = (usize::try_from(first).ok()?, usize::try_from(last).ok()?);
        (first <= last && last < self.width).then(|| row * self.width + first..row * self.width + last + 1)
    }
}

/// These points in cells, from the grid's south-west corner.
fn in_cells(grid: &Grid, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let scale = |p: &[f64; 2], i: usize| (p[i] - grid.origin_m()[i]) / grid.resolution_m();
    points.iter().map(|p| [scale(p, 0), scale(p, 1)]).collect()
}

fn runs(size: Size, points: &[[f64; 2]], mark: &mut dyn FnMut(Range<usize>)) {
    // Where no side passes, a cell is wholly inside or wholly outside.
    for (a, b) in super::polygon::sides(points) {
        side(size, a, b, mark);
    }
    inside(size, points, mark);
}

/// Marks all cells that a rectangle overlaps: `length_m` along its own x axis, `width_m` across, its
/// middle at `pose`.
pub fn rectangle(grid: &mut Grid, pose: &MapPose, length_m: f64, width_m: f64, cell: Cell) {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    polygon(grid, &corners(pose.x_m, pose.y_m, (cos, sin), length_m, width_m), cell);
}

/// Marks all cells that a polyline of this thickness overlaps; each piece is square at its ends and half
/// a thickness longer there, so that corners are closed.
pub fn polyline(grid: &mut Grid, points: &[[f64; 2]], thickness_m: f64, cell: Cell) {
    for ends in points.windows(2) {
        let (dx, dy) = (ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
        let length_m = libm::hypot(dx, dy);
        let direction = if length_m > 0.0 { (dx / length_m, dy / length_m) } else { (1.0, 0.0) };
        let (x_m, y_m) = ((ends[0][0] + ends[1][0]) / 2.0, (ends[0][1] + ends[1][1]) / 2.0);
        polygon(grid, &corners(x_m, y_m, direction, length_m + thickness_m, thickness_m), cell);
    }
}

fn corners(x_m: f64, y_m: f64, (cos, sin): (f64, f64), length_m: f64, width_m: f64) -> [[f64; 2]; 4] {
    let (half_length, half_width) = (length_m / 2.0, width_m / 2.0);
    [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(ahead, left)| {
        let (ahead, left) = (ahead * half_length, left * half_width);
        [x_m + ahead * cos - left * sin, y_m + ahead * sin + left * cos]
    })
}

/// The cells between two coordinates, in cells, clipped to `count`.
fn cells_between(low: f64, high: f64, count: usize) -> RangeInclusive<i64> {
    let first = libm::ceil(low + EDGE - 1.0).max(0.0) as i64;
    let last = libm::floor(high - EDGE).min(count as f64 - 1.0) as i64;
    first..=last
}

/// Marks the cells that a segment passes through.
fn side(size: Size, a: [f64; 2], b: [f64; 2], mark: &mut dyn FnMut(Range<usize>)) {
    let (low, high) = if a[1] <= b[1] { (a, b) } else { (b, a) };
    let rise = high[1] - low[1];
    let (west, east) = (a[0].min(b[0]), a[0].max(b[0]));
    for row in cells_between(low[1], high[1], size.height) {
        let (bottom, top) = (row as f64 + EDGE, (row + 1) as f64 - EDGE);
        let x_at = |y: f64| (low[0] + (high[0] - low[0]) * ((y - low[1]) / rise)).clamp(west, east);
        let from = if bottom <= low[1] { low[0] } else { x_at(bottom) };
        let to = if top >= high[1] { high[0] } else { x_at(top) };
        let (first, last) = cells_between(from.min(to), from.max(to), size.width).into_inner();
        size.run(row, first, last).into_iter().for_each(&mut *mark);
    }
}

/// Marks the cells whose middle is inside.
fn inside(size: Size, points: &[[f64; 2]], mark: &mut dyn FnMut(Range<usize>)) {
    let (low, high) = super::polygon::bounds(points);
    let mut crossings = Vec::new();
    for row in cells_between(low[1], high[1], size.height) {
        let y = row as f64 + 0.5;
        crossings.clear();
        for (a, b) in super::polygon::sides(points) {
            if (a[1] <= y) != (b[1] <= y) {
                crossings.push(a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1])));
            }
        }
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let first = libm::ceil(pair[0] - 0.5).max(0.0) as i64;
            let last = libm::floor(pair[1] - 0.5).min(size.width as f64 - 1.0) as i64;
            size.run(row, first, last).into_iter().for_each(&mut *mark);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid::free(0.1, [-1.0, -1.0], 20, 20).unwrap()
    }

    fn marked(grid: &Grid) -> usize {
        grid.cells().iter().filter(|cell| **cell == Cell::Occupied).count()
    }

    #[test]
    fn a_box_on_cell_borders_marks_its_own_cells_only() {
        let mut grid = grid();
        rectangle(&mut grid, &MapPose { x_m: 0.2, y_m: 0.1, yaw_rad: 0.0 }, 0.6, 0.4, Cell::Occupied);
        assert_eq!(marked(&grid), 24);
        assert_eq!((grid.at(-0.05, 0.0), grid.at(0.45, 0.25)), (Cell::Occupied, Cell::Occupied));
        assert_eq!((grid.at(-0.15, 0.0), grid.at(0.0, -0.15)), (Cell::Free, Cell::Free));
    }

    #[test]
    fn a_thin_wall_marks_both_sides_of_a_cell_border() {
        let mut grid = grid();
        polyline(&mut grid, &[[0.0, -0.5], [0.0, 0.5]], 0.002, Cell::Occupied);
        assert_eq!((grid.at(-0.05, 0.0), grid.at(0.05, 0.0)), (Cell::Occupied, Cell::Occupied));
        assert_eq!(marked(&grid), 2 * 12); // its square ends reach 1 mm into the next cells
    }

    #[test]
    fn what_lies_outside_is_clipped() {
        let mut grid = grid();
        polygon(&mut grid, &[[-500.0, -400.0], [0.05, 0.05], [-300.0, 900.0]], Cell::Occupied);
        assert_eq!(grid.at(0.04, 0.05), Cell::Occupied);
        assert_eq!(grid.at(0.95, 0.95), Cell::Free);
        polygon(&mut grid, &[[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]], Cell::Unknown);
        assert!(!grid.cells().contains(&Cell::Unknown));
    }
}
