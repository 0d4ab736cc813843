//! The broad phase: a uniform grid that says which boxes could matter near a place.
//!
//! What lies outside the grid belongs to its outermost cells: bounds are clamped on the way in and
//! on the way out alike, so nothing is ever missed, only found more slowly.

use crate::geometry::{Bounds, OrientedBox};

const CELL_M: f64 = 1.0;
/// More cells a side than this are made larger instead.
const MAX_CELLS_A_SIDE: f64 = 256.0;
const NONE: u32 = u32::MAX;

/// How the plane is cut into cells.
#[derive(Debug, Clone)]
pub(crate) struct Cells {
    min_x_m: f64,
    min_y_m: f64,
    size_m: f64,
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
            size_m,
            columns: count(bounds.width_m()),
            rows: count(bounds.depth_m()),
        }
    }

    fn len(&self) -> usize {
        self.columns * self.rows
    }

    fn column(&self, x_m: f64) -> usize {
        // A negative float saturates to 0.
        (((x_m - self.min_x_m) / self.size_m) as usize).min(self.columns - 1)
    }

    fn row(&self, y_m: f64) -> usize {
        (((y_m - self.min_y_m) / self.size_m) as usize).min(self.rows - 1)
    }

    fn cell(&self, (x_m, y_m): (f64, f64)) -> usize {
        self.row(y_m) * self.columns + self.column(x_m)
    }

    fn within(&self, bounds: Bounds) -> impl Iterator<Item = usize> + use<> {
        let (first, last) = (self.column(bounds.min_x_m), self.column(bounds.max_x_m));
        let columns = self.columns;
        (self.row(bounds.min_y_m)..=self.row(bounds.max_y_m))
            .flat_map(move |row| (row * columns + first)..=(row * columns + last))
    }
}

/// Boxes that do not move, each listed in every cell that its bounds reach.
#[derive(Debug, Clone)]
pub(crate) struct StandingGrid {
    cells: Cells,
    /// `items[starts[c]..starts[c + 1]]` are the boxes of cell c.
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl StandingGrid {
    pub(crate) fn new(cells: Cells, boxes: &[OrientedBox]) -> Self {
        let mut lists = vec![Vec::new(); cells.len()];
        for (i, b) in boxes.iter().enumerate() {
            for cell in cells.within(b.bounds()) {
                lists[cell].push(i as u32);
            }
        }
        let mut grid = Self { cells, starts: vec![0], items: Vec::new() };
        for list in lists {
            grid.items.extend(list);
            grid.starts.push(grid.items.len() as u32);
        }
        grid
    }

    /// Boxes that may reach into `bounds`; one that lies in several cells comes more than once.
    pub(crate) fn near(&self, bounds: Bounds) -> impl Iterator<Item = usize> {
        self.cells.within(bounds).flat_map(|cell| {
            let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
            self.items[range].iter().map(|&i| i as usize)
        })
    }
}

/// Boxes that move: each is listed in the cell of its centre only, so that a rebuild costs a few
/// nanoseconds a box and allocates nothing.
#[derive(Debug, Clone)]
pub(crate) struct MovingGrid {
    cells: Cells,
    /// The first box of each cell, and of each box the next one in its cell.
    head: Vec<u32>,
    next: Vec<u32>,
    cell_of: Vec<usize>,
    reach_m: f64,
}

impl MovingGrid {
    /// No box of the `count` reaches farther than `reach_m` from its centre.
    pub(crate) fn new(cells: Cells, count: usize, reach_m: f64) -> Self {
        let head = vec![NONE; cells.len()];
        Self { cells, head, next: vec![NONE; count], cell_of: vec![0; count], reach_m }
    }

    pub(crate) fn rebuild(&mut self, boxes: &[OrientedBox]) {
        for &cell in &self.cell_of {
            self.head[cell] = NONE;
        }
        self.cell_of.resize(boxes.len(), 0);
        self.next.resize(boxes.len(), NONE);
        for (i, b) in boxes.iter().enumerate() {
            let cell = self.cells.cell(b.centre_m());
            self.cell_of[i] = cell;
            self.next[i] = std::mem::replace(&mut self.head[cell], i as u32);
        }
    }

    /// From now on boxes may reach so far from their centres.
    pub(crate) fn reach_at_least(&mut self, reach_m: f64) {
        self.reach_m = self.reach_m.max(reach_m);
    }

    /// Boxes that may reach into `bounds`, each once.
    pub(crate) fn near(&self, bounds: Bounds) -> impl Iterator<Item = usize> {
        self.cells.within(bounds.grown(self.reach_m)).flat_map(move |cell| {
            let known = |i: u32| (i != NONE).then_some(i as usize);
            std::iter::successors(known(self.head[cell]), move |&i| known(self.next[i]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x_m: f64, y_m: f64) -> OrientedBox {
        OrientedBox::new(x_m, y_m, 0.0, 0.4, 0.4)
    }

    fn sorted(found: impl Iterator<Item = usize>) -> Vec<usize> {
        let mut found: Vec<_> = found.collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    #[test]
    fn both_grids_find_what_is_near_even_beyond_their_edge() {
        let boxes = [square(0.5, 0.5), square(3.5, 3.5), square(-40.0, 2.0), square(90.0, 90.0)];
        let cells = Cells::covering(Bounds::around(0.0, 0.0, 10.0, 10.0));
        let standing = StandingGrid::new(cells.clone(), &boxes);
        let mut moving = MovingGrid::new(cells, boxes.len(), 0.3);
        moving.rebuild(&boxes);
        for (i, b) in boxes.iter().enumerate() {
            assert!(sorted(standing.near(b.bounds())).contains(&i));
            assert!(sorted(moving.near(b.bounds())).contains(&i));
        }
        assert_eq!(sorted(standing.near(boxes[0].bounds())), [0]);
        assert_eq!(sorted(moving.near(boxes[0].bounds())), [0]);
    }

    #[test]
    fn boxes_that_come_and_go_are_found_while_they_are_there() {
        let cells = Cells::covering(Bounds::around(0.0, 0.0, 10.0, 10.0));
        let mut moving = MovingGrid::new(cells, 1, 0.3);
        let (here, there) = (square(-3.5, -3.5), square(3.5, 3.5));
        moving.rebuild(&[here]);
        moving.rebuild(&[here, there]);
        assert_eq!(sorted(moving.near(there.bounds())), [1]);
        moving.rebuild(&[here]);
        assert_eq!((moving.near(there.bounds()).count(), moving.near(here.bounds()).count()), (0, 1));
    }

    #[test]
    fn a_box_that_moved_is_found_at_its_new_place_only() {
        let cells = Cells::covering(Bounds::around(0.0, 0.0, 10.0, 10.0));
        let mut moving = MovingGrid::new(cells, 1, 0.3);
        moving.rebuild(&[square(-3.5, -3.5)]);
        moving.rebuild(&[square(3.5, 3.5)]);
        assert_eq!(moving.near(square(-3.5, -3.5).bounds()).count(), 0);
        assert_eq!(moving.near(square(3.5, 3.5).bounds()).count(), 1);
    }
}
