//! Floor on which nothing stood lately: where beams got through, and where the truck has been.
//!
//! Some 1,500 points of each scan fall on this floor, 25 scans a second, so it is kept in blocks of cells, and a cell
//! holds no more than the number of the scan that showed it last: all that one scan shows is shown at one time,
//! fades at one time, and the scans that are kept know how many cells are theirs.

use super::obstacle_cells::CellGrid;
use std::collections::{BTreeMap, VecDeque};
use xtb_control::units::Stamp;

/// Cells on the side of a block.
const SIDE: i64 = 8;

#[derive(Debug, Clone)]
struct Block {
    /// (row, column) of blocks.
    place: (i64, i64),
    /// The last scan that showed any of its cells.
    newest: u32,
    /// Which scan showed each cell last, row by row; 0 = none.
    scans: [u32; (SIDE * SIDE) as usize],
}

#[derive(Debug, Clone)]
pub(super) struct FreeCells {
    grid: CellGrid,
    blocks: Vec<Block>,
    /// By place, in `blocks`.
    index: BTreeMap<(i64, i64), usize>,
    /// The block that was touched last: most points fall on the one of the point before.
    last: usize,
    /// Scans that have not faded, oldest first: when, and of how many cells each is the last.
    scans: VecDeque<(Stamp, usize)>,
    /// Number of the first of them.
    first: u32,
    /// All their cells.
    count: usize,
    most: usize,
}

impl FreeCells {
    /// None yet; never more than `most` after a scan.
    pub(super) fn new(grid: CellGrid, most: usize) -> Self {
        let (blocks, index, scans) = (Vec::new(), BTreeMap::new(), VecDeque::new());
        Self { grid, blocks, index, last: 0, scans, first: 1, count: 0, most }
    }

    pub(super) fn clear(&mut self) {
        *self = Self::new(self.grid, self.most);
    }

    /// A scan begins: forgets what was shown longer ago than `fades_ms`.
    pub(super) fn begin(&mut self, now: Stamp, fades_ms: u64) {
        while self.scans.front().is_some_and(|(seen, count)| *count == 0 || now > seen.plus_ms(fades_ms)) {
            self.forget_first();
        }
        if self.first > u32::MAX / 2 {
            self.clear(); // after two years of scans
        }
        if self.scans.back().is_none_or(|(seen, _)| *seen < now) {
            self.scans.push_back((now, 0));
        }
    }

    /// This scan shows that nothing stands there.
    pub(super) fn see(&mut self, point: [f64; 2]) {
        let (row, column) = self.grid.place(point);
        let Some(this) = self.scans.len().checked_sub(1) else { return };
        let number = self.first + this as u32;
        let at = self.block((row.div_euclid(SIDE), column.div_euclid(SIDE)));
        let block = &mut self.blocks[at];
        let cell = &mut block.scans[inside(row, column)];
        if *cell == number {
            return;
        }
        match cell.checked_sub(self.first) {
            Some(before) => self.scans[before as usize].1 -= 1,
            None => self.count += 1,
        }
        (*cell, block.newest) = (number, number);
        self.scans[this].1 += 1;
    }

    /// The scan ends: what was shown longest ago goes where there is too much, by rows from the south.
    pub(super) fn end(&mut self) {
        while let Some(&(_, count)) = self.scans.front()
            && self.count > self.most
        {
            let over = self.count - self.most;
            if count <= over {
                self.forget_first();
                continue;
            }
            let mut oldest: Vec<_> = (0..self.blocks.len()).flat_map(|at| self.shown_by_first(at)).collect();
            oldest.sort_unstable();
            for &(_, at, inside) in &oldest[..over] {
                self.blocks[at].scans[inside] = 0;
            }
            self.scans[0].1 -= over;
            self.count -= over;
        }
    }

    /// When a cell was shown last.
    pub(super) fn seen(&self, (row, column): (i64, i64)) -> Option<Stamp> {
        let at = *self.index.get(&(row.div_euclid(SIDE), column.div_euclid(SIDE)))?;
        let scan = self.blocks[at].scans[inside(row, column)].checked_sub(self.first)?;
        self.scans.get(scan as usize).map(|(seen, _)| *seen)
    }

    /// The same of the cell of a point.
    pub(super) fn seen_at(&self, point: [f64; 2]) -> Option<Stamp> {
        self.seen(self.grid.place(point))
    }

    fn forget_first(&mut self) {
        if let Some((_, count)) = self.scans.pop_front() {
            (self.first, self.count) = (self.first + 1, self.count - count);
        }
    }

    /// The cells of a block that the first scan showed last: place, block, and where in it.
    fn shown_by_first(&self, at: usize) -> impl Iterator<Item = ((i64, i64), usize, usize)> {
        let Block { place: (row, column), scans, .. } = &self.blocks[at];
        scans.iter().enumerate().filter(|(_, scan)| **scan == self.first).map(move |(inside, _)| {
            let (up, right) = (inside as i64 / SIDE, inside as i64 % SIDE);
            ((row * SIDE + up, column * SIDE + right), at, inside)
        })
    }

    /// The block of this place: one in which everything has faded is used again.
    fn block(&mut self, place: (i64, i64)) -> usize {
        if self.blocks.get(self.last).is_some_and(|block| block.place == place) {
            return self.last;
        }
        if let Some(&at) = self.index.get(&place) {
            self.last = at;
            return at;
        }
        let new = Block { place, newest: 0, scans: [0; (SIDE * SIDE) as usize] };
        let faded = self.blocks.iter().position(|block| block.newest < self.first);
        match faded {
            Some(at) => {
                let before = std::mem::replace(&mut self.blocks[at], new);
                self.index.remove(&before.place);
                self.last = at;
            }
            None => {
                self.last = self.blocks.len();
                self.blocks.push(new);
            }
        }
        self.index.insert(place, self.last);
        self.last
    }
}

/// Where in its block a cell is.
fn inside(row: i64, column: i64) -> usize {
    (row.rem_euclid(SIDE) * SIDE + column.rem_euclid(SIDE)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    const MOST: usize = 300;
    const FADES_MS: u64 = 1_000;

    /// The same rules by the book: a table of cells, the oldest of which goes for a new one.
    #[derive(Default)]
    struct Table(BTreeMap<(i64, i64), Stamp>);

    impl Table {
        fn see(&mut self, now: Stamp, place: (i64, i64)) {
            if !self.0.contains_key(&place) && self.0.len() == MOST {
                let oldest = self.0.iter().min_by_key(|(place, seen)| (**seen, **place)).map(|(at, _)| *at);
                oldest.map(|oldest| self.0.remove(&oldest));
            }
            self.0.insert(place, now);
        }
    }

    #[test]
    fn it_holds_what_a_table_of_single_cells_would() {
        let grid = CellGrid { resolution_m: 0.05, origin_m: [-0.3, 0.7] };
        let (mut cells, mut table) = (FreeCells::new(grid, MOST), Table::default());
        let (mut state, mut now, mut full) = (7_u64, Stamp::ZERO, 0);
        let mut draw = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for scan in 0..400 {
            // Sometimes a long way on, sometimes the same moment again.
            now = now.plus_ms([0, 40, 40, 40, 700][draw(5) as usize]);
            let (east_m, north_m) = (f64::from(scan) * 0.02 - 4.0, draw(100) as f64 * 0.02 - 1.0);
            cells.begin(now, FADES_MS);
            table.0.retain(|_, seen| now <= seen.plus_ms(FADES_MS));
            for _ in 0..draw(120) {
                let point = [east_m + draw(50) as f64 * 0.01, north_m + draw(50) as f64 * 0.01];
                cells.see(point);
                table.see(now, grid.place(point));
            }
            cells.end();
            full += u32::from(table.0.len() == MOST);
            assert_eq!(cells.count, table.0.len(), "scan {scan}");
            for (row, column) in (-60..60).flat_map(|row| (-90..120).map(move |column| (row, column))) {
                let (seen, meant) = (cells.seen((row, column)), table.0.get(&(row, column)).copied());
                assert_eq!(seen, meant, "scan {scan}, row {row}, column {column}");
            }
        }
        assert!(full > 50 && full < 350, "{full} scans were full");
        assert!(cells.blocks.len() < 100, "{} blocks", cells.blocks.len());
    }
}
