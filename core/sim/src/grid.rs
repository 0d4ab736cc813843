//! The broad phase: a uniform grid that says which boxes could matter near a place.
//!
//! What lies outside the grid belongs to its outermost cells: bounds are clamped on the way in and
//! on the way out alike, so nothing is ever missed, only found more slowly.

use crate::geometry::{Bounds, OrientedBox};
use std::collections::VecDeque;

const CELL_M: f64 = 1.0;
/// More cells a side than this are made larger instead.
const MAX_CELLS_A_SIDE: f64 = 256.0;
const NONE: u32 = u32::MAX;

/// How the plane is cut into cells.
#[derive(Debug, Clone)]
pub(crate) struct Cells {
    min_x_m: f64,
    min_y_m: f64,
    per_m: f64,
    columns: usize,
    rows: usize,
}

impl Cells {
    pub(crate) fn covering(bounds: Bounds) -> Self {
        let side_m = bounds.width_m().max(bounds.depth_m());
        let size_m = (side_m / MAX_CELLS_A_SIDE).max(CELL_M);
        let count = |length_m: f64| (libm::ceil(length_m / size_m) as usize).max(1);
        Self {
            min_x_m: bounds.min_x_m,
            min_y_m: bounds.min_y_m,
            per_m: 1.0 / size_m,
            columns: count(bounds.width_m()),
            rows: count(bounds.depth_m()),
        }
    }

    fn len(&self) -> usize {
        self.columns * self.rows
    }

    fn column(&self, x_m: f64) -> usize {
        // A negative float saturates to 0; 32 bits do so without a branch.
        (((x_m - self.min_x_m) * self.per_m) as u32 as usize).min(self.columns - 1)
    }

    fn row(&self, y_m: f64) -> usize {
        (((y_m - self.min_y_m) * self.per_m) as u32 as usize).min(self.rows - 1)
    }

    fn cell(&self, (x_m, y_m): (f64, f64)) -> usize {
        self.row(y_m) * self.columns + self.column(x_m)
    }

    fn span(&self, bounds: Bounds) -> Span {
        Span {
            first_column: self.column(bounds.min_x_m),
            last_column: self.column(bounds.max_x_m),
            first_row: self.row(bounds.min_y_m),
            last_row: self.row(bounds.max_y_m),
        }
    }

    fn each(&self, span: Span, mut cell: impl FnMut(usize)) {
        for row in span.first_row..=span.last_row {
            (row * self.columns + span.first_column..=row * self.columns + span.last_column)
                .for_each(&mut cell);
        }
    }
}

/// A rectangle of cells.
#[derive(Debug, Clone, Copy)]
struct Span {
    first_column: usize,
    last_column: usize,
    first_row: usize,
    last_row: usize,
}

/// For each cell of these lists how far the nearest that is not empty is, in cells (Chebyshev).
fn empty_around(cells: &Cells, lists: &[Vec<u32>]) -> Vec<u16> {
    let (columns, rows) = (cells.columns, cells.rows);
    let mut steps: Vec<u16> = lists.iter().map(|list| if list.is_empty() { u16::MAX } else { 0 }).collect();
    let mut near: VecDeque<usize> = (0..steps.len()).filter(|&cell| steps[cell] == 0).collect();
    while let Some(cell) = near.pop_front() {
        let (column, row) = (cell % columns, cell / columns);
        for row in row.saturating_sub(1)..(row + 2).min(rows) {
            for column in column.saturating_sub(1)..(column + 2).min(columns) {
                let other = row * columns + column;
                if steps[other] == u16::MAX {
                    steps[other] = steps[cell].saturating_add(1).min(u16::MAX - 1);
                    near.push_back(other);
                }
            }
        }
    }
    steps
}

/// Boxes that do not move, each listed in every cell that its bounds reach.
#[derive(Debug, Clone)]
pub(crate) struct StandingGrid {
    cells: Cells,
    /// `items[starts[c]..starts[c + 1]]` are the boxes of cell c.
    starts: Vec<u32>,
    items: Vec<u32>,
    /// From each cell to the nearest one with a box, in cells (Chebyshev); 0 = it has one itself.
    empty_around: Vec<u16>,
}

impl StandingGrid {
    pub(crate) fn new(cells: Cells, boxes: &[OrientedBox]) -> Self {
        let mut lists = vec![Vec::new(); cells.len()];
        for (i, b) in boxes.iter().enumerate() {
            cells.each(cells.span(b.bounds()), |cell| lists[cell].push(i as u32));
        }
        let empty_around = empty_around(&cells, &lists);
        let mut grid = Self { cells, starts: vec![0], items: Vec::new(), empty_around };
        for list in lists {
            grid.items.extend(list);
            grid.starts.push(grid.items.len() as u32);
        }
        grid
    }

    /// Boxes that may reach into `bounds`; one that lies in several cells comes more than once.
    pub(crate) fn near(&self, bounds: Bounds, mut found: impl FnMut(usize)) {
        let span = self.cells.span(bounds);
        if self.is_empty(&span) {
            return;
        }
        self.cells.each(span, |cell| {
            let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
            self.items[range].iter().for_each(|&i| found(i as usize));
        });
    }

    /// Whether no box reaches into `bounds`, as far as one look tells.
    pub(crate) fn is_free(&self, bounds: Bounds) -> bool {
        self.is_empty(&self.cells.span(bounds))
    }

    /// Whether no cell of the span has a box, as far as its first cell tells.
    fn is_empty(&self, span: &Span) -> bool {
        let far = (span.last_column - span.first_column).max(span.last_row - span.first_row);
        let first = span.first_row * self.cells.columns + span.first_column;
        usize::from(self.empty_around[first]) > far
    }
}

/// What moves: each is listed in the cell of its centre only, so that a rebuild costs a few nanoseconds a body
/// and allocates nothing.
#[derive(Debug, Clone)]
pub(crate) struct MovingGrid {
    cells: Cells,
    /// The first body of each cell, and of each body the next one in its cell.
    head: Vec<u32>,
    next: Vec<u32>,
    cell_of: Vec<usize>,
}

impl MovingGrid {
    pub(crate) fn new(cells: Cells) -> Self {
        let head = vec![NONE; cells.len()];
        Self { cells, head, next: Vec::new(), cell_of: Vec::new() }
    }

    pub(crate) fn rebuild(&mut self, centres: &[(f64, f64)]) {
        for &cell in &self.cell_of {
            self.head[cell] = NONE;
        }
        self.cell_of.clear();
        self.next.clear();
        for (i, &centre) in centres.iter().enumerate() {
            let cell = self.cells.cell(centre);
            self.cell_of.push(cell);
            self.next.push(std::mem::replace(&mut self.head[cell], i as u32));
        }
    }

    /// Bodies whose centres may lie in `bounds`, each once.
    pub(crate) fn near(&self, bounds: Bounds, mut found: impl FnMut(usize)) {
        self.cells.each(self.cells.span(bounds), |cell| {
            let mut next = self.head[cell];
            while next != NONE {
                found(next as usize);
                next = self.next[next as usize];
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x_m: f64, y_m: f64) -> OrientedBox {
        OrientedBox::new(x_m, y_m, 0.0, 0.4, 0.4)
    }

    /// What a search for what is near finds, each once.
    fn found(search: impl FnOnce(&mut dyn FnMut(usize))) -> Vec<usize> {
        let mut all = Vec::new();
        search(&mut |i| all.push(i));
        all.sort_unstable();
        all.dedup();
        all
    }

    #[test]
    fn both_grids_find_what_is_near_even_beyond_their_edge() {
        let boxes = [square(0.5, 0.5), square(3.5, 3.5), square(-40.0, 2.0), square(90.0, 90.0)];
        let cells = Cells::covering(Bounds::around(0.0, 0.0, 10.0, 10.0));
        let standing = StandingGrid::new(cells.clone(), &boxes);
        let mut moving = MovingGrid::new(cells);
        moving.rebuild(&boxes.each_ref().map(OrientedBox::centre_m));
        for (i, b) in boxes.iter().enumerate() {
            assert!(found(|each| standing.near(b.bounds(), each)).contains(&i));
            assert!(found(|each| moving.near(b.bounds(), each)).contains(&i));
        }
        assert_eq!(found(|each| standing.near(boxes[0].bounds(), each)), [0]);
        assert_eq!(found(|each| moving.near(boxes[0].bounds(), each)), [0]);
    }

    #[test]
    fn where_nothing_stands_no_cell_is_looked_into() {
        let cells = Cells::covering(Bounds::around(0.0, 0.0, 20.0, 20.0));
        let standing = StandingGrid::new(cells, &[square(0.5, 0.5)]);
        let is_empty = |x_m, y_m, side_m| {
            standing.is_empty(&standing.cells.span(Bounds::around(x_m, y_m, side_m, side_m)))
        };
        assert!(is_empty(5.0, 5.0, 2.0) && is_empty(-9.0, 3.0, 4.0));
        assert!(!is_empty(0.5, 0.5, 0.1) && !is_empty(2.0, 2.0, 4.0));
        let nothing = StandingGrid::new(Cells::covering(Bounds::around(0.0, 0.0, 3.0, 3.0)), &[]);
        assert!(nothing.is_empty(&nothing.cells.span(Bounds::around(0.0, 0.0, 9.0, 9.0))));
    }

    #[test]
    fn bodies_that_come_and_go_are_found_while_they_are_there() {
        let cells = Cells::covering(Bounds::around(0.0, 0.0, 10.0, 10.0));
        let mut moving = MovingGrid::new(cells);
        let (here, there) = ((-3.5, -3.5), (3.5, 3.5));
        let around = |(x_m, y_m)| Bounds::around(x_m, y_m, 0.4, 0.4);
        moving.rebuild(&[here]);
        moving.rebuild(&[here, there]);
        assert_eq!(found(|each| moving.near(around(there), each)), [1]);
        moving.rebuild(&[here]);
        assert!(found(|each| moving.near(around(there), each)).is_empty());
        assert_eq!(found(|each| moving.near(around(here), each)), [0]);
        moving.rebuild(&[there]);
        assert!(found(|each| moving.near(around(here), each)).is_empty());
        assert_eq!(found(|each| moving.near(around(there), each)), [0]);
    }
}
