//! Which free cells hang together for a disc: cells join in the order of the room around them, widest
//! first, so where two islands meet is the widest way between them.

use super::{Island, Narrow};
use crate::geometry::clearance::squared_distances;
use crate::geometry::{Car, Cell, Grid};

/// Narrower than this is a gap between things, no door, in m: a quarter of an XTB's width; chosen, not
/// measured.
const NARROWEST_DOOR_M: f64 = 0.1;
/// No island.
const NONE: u32 = u32::MAX;

/// The islands of a grid; an island's id is the cell that stood for it when all its cells had joined.
pub(super) struct Islands {
    /// Of each cell.
    islands: Vec<u32>,
    /// Id, cells, and the cell with the most room; largest first.
    sizes: Vec<(u32, u32, u32)>,
    /// Where two islands meet, and with how much room (cells² from centre to centre), widest first.
    meetings: Vec<(u32, u32)>,
}

impl Islands {
    pub(super) fn of(grid: &Grid, car: &Car) -> Self {
        let room = room2(grid);
        let resolution_m = grid.resolution_m();
        let passes = |room2: u32| clearance_m(room2, resolution_m) >= car.half_width_m;
        let least = (car.front_m + car.rear_m) * 2.0 * car.half_width_m / (resolution_m * resolution_m);
        let mut order: Vec<u32> = (0..room.len() as u32).filter(|&cell| room[cell as usize] > 0).collect();
        // The index makes the order, and with it the result, the same everywhere.
        order.sort_unstable_by_key(|&cell| (std::cmp::Reverse(room[cell as usize]), cell));
        let wide = order.partition_point(|&cell| passes(room[cell as usize]));

        let mut sets = Sets::new(room.len());
        for &cell in &order[..wide] {
            sets.add(cell);
            for other in neighbours(grid, cell) {
                sets.join(cell, other);
            }
        }
        let mut islands = vec![NONE; room.len()];
        let mut sizes = Vec::new();
        for &cell in &order[..wide] {
            let id = sets.root(cell);
            if f64::from(sets.size[id as usize]) < least {
                continue;
            }
            islands[cell as usize] = id;
            // The first of an island is the one with the most room.
            if !std::mem::replace(&mut sets.holds_island[id as usize], true) {
                sizes.push((id, sets.size[id as usize], cell));
            }
        }
        sizes.sort_by_key(|&(_, size, first)| (std::cmp::Reverse(size), first));

        let mut meetings = Vec::new();
        for &cell in &order[wide..] {
            if 2.0 * clearance_m(room[cell as usize], resolution_m) < NARROWEST_DOOR_M {
                break;
            }
            sets.add(cell);
            for other in neighbours(grid, cell) {
                if sets.join(cell, other) {
                    meetings.push((cell, room[cell as usize]));
                }
            }
        }
        Self { islands, sizes, meetings }
    }

    pub(super) fn ids(&self) -> Vec<u32> {
        self.sizes.iter().map(|(id, _, _)| *id).collect()
    }

    pub(super) fn island_at(&self, cell: usize) -> Option<u32> {
        self.islands.get(cell).copied().filter(|id| *id != NONE)
    }

    /// The cell of an island with the most room around.
    pub(super) fn peak_of(&self, id: u32) -> usize {
        self.sizes.iter().find(|(other, _, _)| *other == id).map_or(usize::MAX, |(_, _, peak)| *peak as usize)
    }

    pub(super) fn islands(&self, grid: &Grid) -> Vec<Island> {
        let cell_m2 = grid.resolution_m() * grid.resolution_m();
        let island = |&(_, size, peak): &(u32, u32, u32)| Island {
            area_m2: f64::from(size) * cell_m2,
            at_m: middle_m(grid, peak),
        };
        self.sizes.iter().map(island).collect()
    }

    pub(super) fn narrows(&self, grid: &Grid) -> Vec<Narrow> {
        let narrow = |&(cell, room2): &(u32, u32)| Narrow {
            at_m: middle_m(grid, cell),
            // Between the odd and the even number of cells that look the same from the middle.
            width_m: 2.0 * clearance_m(room2, grid.resolution_m()) + grid.resolution_m() / 2.0,
        };
        self.meetings.iter().map(narrow).collect()
    }
}

fn middle_m(grid: &Grid, cell: u32) -> [f64; 2] {
    let cell = cell as usize;
    grid.centre_m((cell % grid.width()) as i64, (cell / grid.width()) as i64)
}

/// From the middle of a cell to the side of the nearest one that is not free.
fn clearance_m(room2: u32, resolution_m: f64) -> f64 {
    (f64::from(room2).sqrt() - 0.5) * resolution_m
}

/// The cells beside, not those across a corner: nothing passes between two things that touch there.
fn neighbours(grid: &Grid, cell: u32) -> impl Iterator<Item = u32> + use<> {
    let (width, count) = (grid.width() as u32, grid.cells().len() as u32);
    let column = cell % width;
    let west = (column > 0).then(|| cell - 1);
    let east = (column + 1 < width).then_some(cell + 1);
    let south = cell.checked_sub(width);
    let north = Some(cell + width).filter(|north| *north < count);
    [west, east, south, north].into_iter().flatten()
}

/// Disjoint sets of cells.
struct Sets {
    parent: Vec<u32>,
    size: Vec<u32>,
    holds_island: Vec<bool>,
}

impl Sets {
    fn new(cells: usize) -> Self {
        Self { parent: vec![NONE; cells], size: vec![0; cells], holds_island: vec![false; cells] }
    }

    fn add(&mut self, cell: u32) {
        self.parent[cell as usize] = cell;
        self.size[cell as usize] = 1;
    }

    fn root(&mut self, mut cell: u32) -> u32 {
        while self.parent[cell as usize] != cell {
            let up = self.parent[self.parent[cell as usize] as usize];
            self.parent[cell as usize] = up;
            cell = up;
        }
        cell
    }

    /// Joins the sets of two cells, if the other one is in any; whether that joined two islands.
    fn join(&mut self, cell: u32, other: u32) -> bool {
        if self.parent[other as usize] == NONE {
            return false;
        }
        let (a, b) = (self.root(cell), self.root(other));
        if a == b {
            return false;
        }
        let (small, large) = if self.size[a as usize] < self.size[b as usize] { (a, b) } else { (b, a) };
        self.parent[small as usize] = large;
        self.size[large as usize] += self.size[small as usize];
        let both = self.holds_island[a as usize] && self.holds_island[b as usize];
        self.holds_island[large as usize] |= self.holds_island[small as usize];
        both
    }
}

/// The square of the distance from each cell to the nearest that is not free, from centre to centre, in
/// cells; 0 where it is not free itself. Beyond the grid nothing is free.
fn room2(grid: &Grid) -> Vec<u32> {
    let (width, height) = (grid.width(), grid.height());
    // One cell more on each side, which is not free.
    let columns = width + 2;
    let mut taken = vec![true; columns * (height + 2)];
    for (row, cells) in grid.cells().chunks(width).enumerate() {
        for (column, cell) in cells.iter().enumerate() {
            taken[(row + 1) * columns + column + 1] = *cell != Cell::Free;
        }
    }
    let mut room = vec![0; width * height];
    squared_distances(&taken, columns, |index, squared| {
        let (column, row) = (index % columns, index / columns);
        if (1..=width).contains(&column) && (1..=height).contains(&row) {
            room[(row - 1) * width + column - 1] = u32::try_from(squared).unwrap_or(u32::MAX);
        }
    });
    room
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_is_what_asking_every_cell_finds() {
        let (width, height) = (13_usize, 9_usize);
        let mut cells = vec![Cell::Free; width * height];
        for taken in [3, 17, 40, 41, 66, 90, 110] {
            cells[taken] = Cell::Occupied;
        }
        let grid = Grid::new(0.05, [0.0, 0.0], width, height, cells).unwrap();
        let (w, h) = (width as i64, height as i64);
        for (i, found) in room2(&grid).into_iter().enumerate() {
            let (x, y) = (i as i64 % w, i as i64 / w);
            let all = (-1..=h).flat_map(|row| (-1..=w).map(move |column| (column, row)));
            let taken = all.filter(|&(column, row)| grid.cell(column, row) != Cell::Free);
            let nearest = taken.map(|(column, row)| (column - x).pow(2) + (row - y).pow(2)).min().unwrap();
            assert_eq!(i64::from(found), nearest, "({x}, {y})");
        }
    }
}
