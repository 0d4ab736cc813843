//! Distance field: how far the nearest cell that is not free lies from any point.
//!
//! Kept at the corners of the cells, because the point of a square that is nearest to a corner is a
//! corner itself: a distance transform over corners is exact, one over middles is half a diagonal
//! off at either end. Between corners the field changes by at most 1 m per m, which bounds it from
//! both sides. A. Meijster, J. Roerdink and W. Hesselink, *A general algorithm for computing distance
//! transforms in linear time* (2000), the integer form of Felzenszwalb and Huttenlocher's.

use super::grid::{Cell, Grid};

/// Distances to the nearest cell that is not free; everything outside the grid is not.
#[derive(Debug, Clone, PartialEq)]
pub struct Clearance {
    resolution_m: f64,
    origin_m: [f64; 2],
    /// Corners from west to east, one more than cells.
    columns: usize,
    /// Corners from south to north.
    rows: usize,
    /// At the corners, rounded down.
    metres: Vec<f32>,
}

impl Clearance {
    /// The field of a grid.
    #[must_use]
    pub fn of(grid: &Grid) -> Self {
        Self::around(grid, |index| grid.cells()[index] != Cell::Free)
    }

    /// The field around all cells, by their index, that are `blocked`.
    pub(crate) fn around(grid: &Grid, blocked: impl Fn(usize) -> bool) -> Self {
        let (columns, rows) = (grid.width() + 1, grid.height() + 1);
        let mut metres = vec![0.0; columns * rows];
        squared_distances(&touching(grid, blocked), columns, |corner, squared| {
            metres[corner] = rounded_down(libm::sqrt(squared as f64) * grid.resolution_m());
        });
        Self { resolution_m: grid.resolution_m(), origin_m: grid.origin_m(), columns, rows, metres }
    }

    /// At least as far is the nearest cell that is not free, in m; at most half a diagonal of a cell
    /// is missing at the worst point. 0 outside.
    #[must_use]
    pub fn at_least_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.nearest(x_m, y_m).map_or(0.0, |(there, apart)| (there - apart).max(0.0))
    }

    /// At most as far is the nearest cell that is not free, in m. 0 outside.
    #[must_use]
    pub fn at_most_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.nearest(x_m, y_m).map_or(0.0, |(there, apart)| there * (1.0 + 1e-6) + apart)
    }

    /// What [`Self::at_least_m`] and [`Self::at_most_m`] say.
    pub(crate) fn bounds_m(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let bounds = |(there, apart): (f64, f64)| ((there - apart).max(0.0), there * (1.0 + 1e-6) + apart);
        self.nearest(x_m, y_m).map_or((0.0, 0.0), bounds)
    }

    /// The field at the nearest corner and how far that is.
    fn nearest(&self, x_m: f64, y_m: f64) -> Option<(f64, f64)> {
        let (u, v) =
            ((x_m - self.origin_m[0]) / self.resolution_m, (y_m - self.origin_m[1]) / self.resolution_m);
        let inside = u >= 0.0 && v >= 0.0 && u <= (self.columns - 1) as f64 && v <= (self.rows - 1) as f64;
        if !inside {
            return None;
        }
        let (column, row) = ((u + 0.5) as usize, (v + 0.5) as usize);
        let (du, dv) = (u - column as f64, v - row as f64);
        let there = f64::from(self.metres[row * self.columns + column]);
        Some((there, libm::sqrt(du * du + dv * dv) * self.resolution_m))
    }
}

/// The corners that touch something blocked or the edge of the grid.
fn touching(grid: &Grid, blocked: impl Fn(usize) -> bool) -> Vec<bool> {
    let (width, columns, rows) = (grid.width(), grid.width() + 1, grid.height() + 1);
    let mut corners = vec![false; columns * rows];
    corners[..columns].fill(true);
    corners[columns * (rows - 1)..].fill(true);
    for row in corners.chunks_mut(columns) {
        row[0] = true;
        row[columns - 1] = true;
    }
    for row in 0..grid.height() {
        for column in (0..width).filter(|column| blocked(row * width + column)) {
            let first = row * columns + column;
            for corner in [first, first + 1, first + columns, first + columns + 1] {
                corners[corner] = true;
            }
        }
    }
    corners
}

/// Tells for each point of a lattice with so many columns the squared distance to the nearest one that is
/// marked, by index. The first row must be.
pub(crate) fn squared_distances(marked: &[bool], columns: usize, mut tell: impl FnMut(usize, i64)) {
    let away = along_columns(marked, columns);
    let mut envelope = Vec::with_capacity(columns);
    for (row, away) in away.chunks(columns).enumerate() {
        along_row(away, &mut envelope, |column, squared| tell(row * columns + column, squared));
    }
}

/// In cells, how far the nearest marked corner of the same column is. The edge is marked, so there is one.
fn along_columns(marked: &[bool], columns: usize) -> Vec<i32> {
    let mut away: Vec<i32> = vec![0; marked.len()];
    for index in columns..marked.len() {
        away[index] = if marked[index] { 0 } else { away[index - columns] + 1 };
    }
    for index in (0..marked.len() - columns).rev() {
        away[index] = away[index].min(away[index + columns] + 1);
    }
    away
}

/// The lower envelope of the parabolas (column − i)² + away[i]², told column by column.
fn along_row(away: &[i32], envelope: &mut Vec<(i64, i64)>, mut tell: impl FnMut(usize, i64)) {
    let squared = |at: i64, column: i64| {
        let own = i64::from(away[at as usize]);
        (column - at) * (column - at) + own * own
    };
    envelope.clear(); // (lowest point of the parabola, first column where it is the least)
    for column in 0..away.len() as i64 {
        while let Some(&(at, since)) = envelope.last() {
            if squared(at, since) <= squared(column, since) {
                break;
            }
            envelope.pop();
        }
        let since = envelope.last().map_or(0, |&(at, _)| {
            let (own, other) = (i64::from(away[column as usize]), i64::from(away[at as usize]));
            1 + (column * column - at * at + own * own - other * other).div_euclid(2 * (column - at))
        });
        if since < away.len() as i64 {
            envelope.push((column, since));
        }
    }
    let mut part = envelope.len();
    for column in (0..away.len() as i64).rev() {
        while part > 1 && envelope[part - 1].1 > column {
            part -= 1;
        }
        tell(column as usize, squared(envelope[part - 1].0, column));
    }
}

fn rounded_down(metres: f64) -> f32 {
    let rounded = metres as f32;
    if f64::from(rounded) > metres { rounded.next_down() } else { rounded }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;
    use rand_pcg::Pcg32;

    fn scattered(width: usize, height: usize, one_in: u32, seed: u64) -> Grid {
        let mut random = Pcg32::new(seed, 1);
        let mut cell = || if random.next_u32().is_multiple_of(one_in) { Cell::Occupied } else { Cell::Free };
        let cells = (0..width * height).map(|_| cell()).collect();
        Grid::new(0.05, [-1.0, 2.0], width, height, cells).unwrap()
    }

    /// Distance from a point inside to the nearest square that is not free, by looking at all.
    fn brute_m(grid: &Grid, x_m: f64, y_m: f64) -> f64 {
        let side = grid.resolution_m();
        let (u, v) = ((x_m - grid.origin_m()[0]) / side, (y_m - grid.origin_m()[1]) / side);
        let (width, height) = (grid.width(), grid.height());
        let mut least = u.min(v).min(width as f64 - u).min(height as f64 - v);
        for (index, _) in grid.cells().iter().enumerate().filter(|(_, cell)| **cell != Cell::Free) {
            let beyond = |v: f64, low: usize| (low as f64 - v).max(v - low as f64 - 1.0).max(0.0);
            least = least.min(libm::hypot(beyond(u, index % width), beyond(v, index / width)));
        }
        least * side
    }

    #[test]
    fn the_field_bounds_the_distance_from_both_sides_within_half_a_diagonal() {
        for seed in 0..20 {
            let grid = scattered(20 + seed as usize, 35, 3 << (seed % 7), seed);
            let field = Clearance::of(&grid);
            let mut random = Pcg32::new(seed, 2);
            for _ in 0..500 {
                let mut along =
                    |cells: usize| f64::from(random.next_u32()) / 4_294_967_296.0 * cells as f64 * 0.05;
                let (x_m, y_m) = (along(grid.width()) - 1.0, along(grid.height()) + 2.0);
                let truth = brute_m(&grid, x_m, y_m);
                let (low, high) = (field.at_least_m(x_m, y_m), field.at_most_m(x_m, y_m));
                assert!(low <= truth + 1e-12 && truth <= high + 1e-12, "{low} ≤ {truth} ≤ {high}");
                assert!(truth - low < 0.0708, "{truth} is known to be {low} at least");
            }
        }
    }

    #[test]
    fn corners_are_exact() {
        let grid = scattered(40, 30, 60, 5);
        let field = Clearance::of(&grid);
        for (column, row) in (0..=40).flat_map(|column| (0..=30).map(move |row| (column, row))) {
            let (x_m, y_m) = (f64::from(column) * 0.05 - 1.0, f64::from(row) * 0.05 + 2.0);
            let kept = f64::from(field.metres[row as usize * 41 + column as usize]);
            assert!((kept - brute_m(&grid, x_m, y_m)).abs() < 1e-6);
        }
    }

    #[test]
    fn outside_is_never_clear() {
        let field = Clearance::of(&Grid::free(0.05, [0.0, 0.0], 10, 10).unwrap());
        for (x_m, y_m) in [(-0.01, 0.2), (0.2, 0.51), (9.0, 9.0), (f64::NAN, 0.2)] {
            assert_eq!((field.at_least_m(x_m, y_m), field.at_most_m(x_m, y_m)), (0.0, 0.0));
        }
        assert!((field.at_least_m(0.25, 0.25) - 0.25).abs() < 1e-6);
    }
}
