//! One layer of cells, and whether a rectangle on it is free: accepted or refused by the distance field
//! where circles decide, and cell by cell where they do not.

use super::sweep::{Frame, FreeSpace, Plate};
use crate::geometry::{Clearance, Grid};

/// Bits of a word.
const WORD: usize = 64;

/// A cell with nothing on it.
pub(super) const FREE: u16 = 0;

/// Cells and how far each point is from those that are not free.
#[derive(Debug, Clone)]
pub(super) struct Layer {
    pub(super) resolution_m: f64,
    pub(super) origin_m: [f64; 2],
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) cells: Vec<u16>,
    pub(super) clearance: Clearance,
    /// A bit for each cell that is not free, rows apart.
    taken: Vec<u64>,
    /// Words of `taken` in a row.
    words: usize,
}

impl Layer {
    pub(super) fn new(grid: &Grid, cells: Vec<u16>) -> Self {
        let (width, words) = (grid.width(), grid.width().div_ceil(WORD));
        let mut taken = vec![0; words * grid.height()];
        for (row, cells) in cells.chunks(width).enumerate() {
            for (column, _) in cells.iter().enumerate().filter(|(_, cell)| **cell != FREE) {
                taken[row * words + column / WORD] |= 1 << (column % WORD);
            }
        }
        Self {
            resolution_m: grid.resolution_m(),
            origin_m: grid.origin_m(),
            width,
            height: grid.height(),
            clearance: Clearance::around(grid, |index| cells[index] != FREE),
            cells,
            taken,
            words,
        }
    }

    fn place(&self, x_m: f64, y_m: f64) -> (i64, i64) {
        let along = |v: f64, origin: f64| libm::floor((v - origin) / self.resolution_m) as i64;
        (along(x_m, self.origin_m[0]), along(y_m, self.origin_m[1]))
    }

    pub(super) fn index(&self, (column, row): (i64, i64)) -> Option<usize> {
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        (column < self.width && row < self.height).then(|| row * self.width + column)
    }

    /// A cell that is not free, or lies outside, and that the rectangle touches. Exact: row by row,
    /// the part of a convex shape that lies within the row covers all columns from its least to its
    /// greatest x there.
    pub(super) fn touched(&self, at: &Frame, plate: &Plate) -> Option<(i64, i64)> {
        let corners =
            [(plate.front_m, 1.0), (-plate.rear_m, 1.0), (-plate.rear_m, -1.0), (plate.front_m, -1.0)]
                .map(|(ahead, left)| at.point_m(ahead, left * plate.half_width_m))
                .map(|[x, y]| {
                    [(x - self.origin_m[0]) / self.resolution_m, (y - self.origin_m[1]) / self.resolution_m]
                });
        let spans = RowSpans::of(&corners);
        let inside = spans.west[0] >= 0.0
            && spans.south[1] >= 0.0
            && spans.east[0] <= self.width as f64
            && spans.north[1] <= self.height as f64;
        if !inside {
            return Some(self.outside(at, &spans));
        }
        // Never negative here: a cast by way of a signed number is the shorter one.
        let whole = |v: f64| v as i64 as usize;
        let last = whole(spans.north[1]).min(self.height - 1);
        (whole(spans.south[1])..=last).find_map(|row| {
            let (left, right) = spans.of_row(row as f64);
            let column = self.first_taken(row, whole(left), whole(right).min(self.width - 1))?;
            Some((column as i64, row as i64))
        })
    }

    /// The first column from `first` to `last` whose cell in this row is not free.
    fn first_taken(&self, row: usize, first: usize, last: usize) -> Option<usize> {
        let row = &self.taken[row * self.words..(row + 1) * self.words];
        let before = !0 << (first % WORD);
        let after = !0 >> (WORD - 1 - last % WORD);
        (first / WORD..=last / WORD).find_map(|word| {
            let mut bits = row[word];
            bits &= if word == first / WORD { before } else { !0 };
            bits &= if word == last / WORD { after } else { !0 };
            (bits != 0).then(|| word * WORD + bits.trailing_zeros() as usize)
        })
    }

    /// A cell beyond the edge that a rectangle reaches.
    fn outside(&self, at: &Frame, spans: &RowSpans) -> (i64, i64) {
        let place = self.place(at.x_m, at.y_m);
        if self.index(place).is_none() {
            return place;
        }
        let beyond = |low: f64, high: f64, cells: usize| match (low < 0.0, high > cells as f64) {
            (true, _) => -1,
            (false, true) => cells as i64,
            (false, false) => low as i64,
        };
        (
            beyond(spans.west[0], spans.east[0], self.width),
            beyond(spans.south[1], spans.north[1], self.height),
        )
    }
}

/// The outermost corners of a rectangle, in cells, and how its sides lean from the southern and the northern one.
struct RowSpans {
    south: [f64; 2],
    east: [f64; 2],
    north: [f64; 2],
    west: [f64; 2],
    /// Columns per row of the sides from the south to the west and to the east, and from there to the north.
    slopes: [f64; 4],
}

impl RowSpans {
    /// Of corners in counter-clockwise order.
    fn of(corners: &[[f64; 2]; 4]) -> Self {
        let first = (1..4).fold(0, |low, next| if corners[next][1] < corners[low][1] { next } else { low });
        let [south, east, north, west] = [0, 1, 2, 3].map(|next| corners[(first + next) % 4]);
        let slope = |low: [f64; 2], high: [f64; 2]| (high[0] - low[0]) / (high[1] - low[1]);
        let slopes = [slope(south, west), slope(south, east), slope(west, north), slope(east, north)];
        Self { south, east, north, west, slopes }
    }

    /// Least and greatest x in a row that it reaches.
    fn of_row(&self, low: f64) -> (f64, f64) {
        let high = low + 1.0;
        let on = |from: [f64; 2], side: usize, y: f64| from[0] + (y - from[1]) * self.slopes[side];
        let end = |corner: [f64; 2], below: usize, above: usize| {
            if corner[1] > high {
                on(self.south, below, high)
            } else if corner[1] < low {
                on(corner, above, low)
            } else {
                corner[0]
            }
        };
        (end(self.west, 0, 2), end(self.east, 1, 3))
    }
}

impl FreeSpace for Layer {
    /// Circles around the rectangle, or around its halves, prove it free; those within prove it
    /// is not; what they leave open is looked at cell by cell.
    fn free(&self, at: &Frame, plate: &Plate) -> bool {
        let middle_m = 0.5 * (plate.front_m - plate.rear_m);
        let (half_m, half_width_m) = (0.5 * (plate.front_m + plate.rear_m), plate.half_width_m);
        let clearance = |ahead_m: f64| {
            let [x_m, y_m] = at.point_m(middle_m + ahead_m, 0.0);
            self.clearance.bounds_m(x_m, y_m)
        };
        let (least, most) = clearance(0.0);
        if least * least > half_m * half_m + half_width_m * half_width_m {
            return true;
        }
        if most < half_m.min(half_width_m) {
            return false;
        }
        let reach = 0.25 * half_m * half_m + half_width_m * half_width_m;
        let [front, rear] = [clearance(0.5 * half_m), clearance(-0.5 * half_m)];
        if front.0 * front.0 > reach && rear.0 * rear.0 > reach {
            return true;
        }
        if front.1.min(rear.1) < half_width_m.min(0.5 * half_m) {
            return false;
        }
        self.touched(at, plate).is_none()
    }
}
