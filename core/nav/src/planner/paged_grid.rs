//! Which node stands in which cell of (x, y, heading): pages of a flat array that appear where the
//! search comes by, so a large map costs no more than the part of it that is searched.

/// Cells to a side of a page; chosen, not measured.
const SIDE: usize = 8;
const NONE: u32 = u32::MAX;
/// Entries of all pages: 200 MB, what a robot's computer can spare; chosen, not measured.
const MOST_ENTRIES: usize = 50_000_000;

/// A cell: column, row and heading.
pub(super) type Key = (usize, usize, usize);

#[derive(Debug, Default)]
pub(super) struct PagedGrid {
    headings: usize,
    columns: usize,
    rows: usize,
    /// For each square of cells its page.
    table: Vec<u32>,
    pages: Vec<u32>,
}

impl PagedGrid {
    /// Forgets everything.
    pub(super) fn begin(&mut self, columns: usize, rows: usize, headings: usize) {
        (self.headings, self.columns, self.rows) = (headings, columns.div_ceil(SIDE), rows.div_ceil(SIDE));
        self.table.clear();
        self.table.resize(self.columns * self.rows, NONE);
        self.pages.clear();
    }

    /// The node in a cell.
    pub(super) fn get(&self, key: Key) -> Option<u32> {
        let page = *self.table.get(self.square(key)?)?;
        let node = if page == NONE { NONE } else { self.pages[page as usize + self.within(key)] };
        (node != NONE).then_some(node)
    }

    /// Puts a node into a cell; into none where a page is missing once they are full.
    pub(super) fn set(&mut self, key: Key, node: u32) {
        let Some(square) = self.square(key) else { return };
        if self.table[square] == NONE {
            if self.full() {
                return;
            }
            self.table[square] = self.pages.len() as u32;
            self.pages.resize(self.pages.len() + SIDE * SIDE * self.headings, NONE);
        }
        let entry = self.table[square] as usize + self.within(key);
        self.pages[entry] = node;
    }

    /// Whether there is no room for another page.
    pub(super) fn full(&self) -> bool {
        self.pages.len() + SIDE * SIDE * self.headings > MOST_ENTRIES
    }

    fn square(&self, (column, row, _): Key) -> Option<usize> {
        let (column, row) = (column / SIDE, row / SIDE);
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }

    fn within(&self, (column, row, heading): Key) -> usize {
        ((row % SIDE) * SIDE + column % SIDE) * self.headings + heading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_found_where_they_were_put_until_all_is_forgotten() {
        let mut pages = PagedGrid::default();
        pages.begin(20, 9, 5);
        assert_eq!(pages.get((19, 8, 4)), None);
        pages.set((19, 8, 4), 7);
        pages.set((19, 8, 3), 6);
        pages.set((0, 0, 0), 5);
        assert_eq!(
            [(19, 8, 4), (19, 8, 3), (0, 0, 0)].map(|key| pages.get(key)),
            [Some(7), Some(6), Some(5)]
        );
        assert_eq!((pages.get((18, 8, 4)), pages.get((99, 0, 0))), (None, None));
        pages.set((99, 0, 0), 1);
        pages.begin(20, 9, 5);
        assert_eq!(pages.get((19, 8, 4)), None);
    }
}
