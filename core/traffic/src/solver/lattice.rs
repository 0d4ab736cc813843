//! The floor in squares.

use super::problem::{FloorBounds, Problem};

/// Most squares along a side of the map: a bound for the tables' memory, of larger maps the squares grow;
/// chosen, not measured.
const MOST_ALONG: f64 = 400.0;

/// Squares of the floor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lattice {
    west: f64,
    south: f64,
    pub(crate) side: f64,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
}

impl Lattice {
    /// Squares with sides of this part of a step.
    pub(crate) fn new(problem: &Problem, part: f64) -> Self {
        let FloorBounds { west_m, south_m, east_m, north_m } = problem.bounds;
        let (wide, deep) = (east_m - west_m, north_m - south_m);
        let side = (problem.step_m * part).max(wide.max(deep) / MOST_ALONG);
        let along = |length: f64| libm::floor(length / side) as usize + 1;
        Self { west: west_m, south: south_m, side, columns: along(wide), rows: along(deep) }
    }

    pub(crate) fn squares(&self) -> usize {
        self.columns * self.rows
    }

    #[inline]
    pub(crate) fn square(&self, x: f64, y: f64) -> usize {
        let (column, row) = self.cell(x, y);
        row * self.columns + column
    }

    /// Column and row of the square that a point lies in, or is nearest to.
    #[inline]
    pub(crate) fn cell(&self, x: f64, y: f64) -> (usize, usize) {
        let column = (((x - self.west) / self.side).max(0.0) as usize).min(self.columns - 1);
        let row = (((y - self.south) / self.side).max(0.0) as usize).min(self.rows - 1);
        (column, row)
    }

    /// Middle of the square in this column and row.
    pub(crate) fn middle(&self, column: usize, row: usize) -> [f64; 2] {
        [self.west + (column as f64 + 0.5) * self.side, self.south + (row as f64 + 0.5) * self.side]
    }

    /// Column and row of a point, which may lie outside and between.
    pub(crate) fn place(&self, x: f64, y: f64) -> [f64; 2] {
        [(x - self.west) / self.side, (y - self.south) / self.side]
    }
}
