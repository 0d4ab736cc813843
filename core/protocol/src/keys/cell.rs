//! Squares of the floor, which stand in keys: who listens to a few of them hears only those who are, or will
//! be, in these.

use std::fmt;

/// Side of a square, in m: more than the give-way rule of an XTB looks at around it, so its own square and the
/// eight around it are enough.
pub const CELL_M: f64 = 8.0;

/// A square of the floor: column and row, counted from the map's origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FloorCell {
    /// To the east.
    pub column: i32,
    /// To the north.
    pub row: i32,
}

impl FloorCell {
    /// The square of a place in the map.
    #[must_use]
    pub fn at(x_m: f64, y_m: f64) -> Self {
        let index = |m: f64| libm::floor(m / CELL_M) as i32;
        Self { column: index(x_m), row: index(y_m) }
    }

    /// Reads it from a key: exactly as it is written.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (column, row) = text.strip_prefix('x')?.split_once('y')?;
        let cell = Self { column: column.parse().ok()?, row: row.parse().ok()? };
        (cell.to_string() == text).then_some(cell)
    }

    /// Itself and those around it, so many squares far.
    pub fn around(self, squares: i32) -> impl Iterator<Item = Self> {
        let near = move |index: i32| index.saturating_sub(squares)..=index.saturating_add(squares);
        near(self.column).flat_map(move |column| near(self.row).map(move |row| Self { column, row }))
    }

    /// Whether it is so many squares away at most, also diagonally.
    #[must_use]
    pub fn is_within(self, squares: u32, of: Self) -> bool {
        self.column.abs_diff(of.column) <= squares && self.row.abs_diff(of.row) <= squares
    }

    /// How far a place is outside of it, in m, along the axis on which it is farther; 0 within.
    #[must_use]
    pub fn outside_m(self, x_m: f64, y_m: f64) -> f64 {
        let outside = |m: f64, index: i32| {
            let from_m = f64::from(index) * CELL_M;
            (from_m - m).max(m - from_m - CELL_M).max(0.0)
        };
        outside(x_m, self.column).max(outside(y_m, self.row))
    }
}

impl fmt::Display for FloorCell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "x{}y{}", self.column, self.row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_in_one_square_and_that_reads_back() {
        for (x_m, y_m, text) in [(0.0, 0.0, "x0y0"), (-0.1, 7.9, "x-1y0"), (8.0, -16.1, "x1y-3")] {
            let cell = FloorCell::at(x_m, y_m);
            assert_eq!((cell.to_string().as_str(), FloorCell::parse(text)), (text, Some(cell)));
            assert!(cell.outside_m(x_m, y_m) <= 0.0);
        }
        for text in ["", "x1", "1y2", "x1y", "x01y2", "x+1y2", "x1y2 ", "x1y-0", "x9999999999y1", "y1x2"] {
            assert_eq!(FloorCell::parse(text), None, "{text}");
        }
    }

    #[test]
    fn those_around_hold_all_that_is_nearer_than_a_side() {
        let cell = FloorCell::at(3.0, 3.0);
        let ring: Vec<FloorCell> = cell.around(1).collect();
        assert_eq!(ring.len(), 9);
        assert!(ring.iter().all(|near| near.is_within(1, cell)));
        for (x_m, y_m) in [(-4.9, 3.0), (3.0, 10.9), (10.9, -4.9)] {
            assert!(ring.contains(&FloorCell::at(x_m, y_m)), "{x_m} {y_m}");
        }
        assert!((cell.outside_m(8.5, -0.25) - 0.5).abs() < 1e-12);
        assert_eq!(cell.around(2).count(), 25);
        // At the end of the numbers there is nobody beside it.
        assert_eq!(FloorCell::at(f64::MAX, f64::MIN).around(1).count(), 4);
    }
}
