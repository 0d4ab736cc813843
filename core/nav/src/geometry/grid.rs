//! Occupancy grid: which squares of the floor can be driven on.

use thiserror::Error;
use xtb_protocol::messages::MAX_MAP_CELLS;

/// What is known of a square.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Cell {
    /// Nothing stands there.
    #[default]
    Free,
    /// Something stands there.
    Occupied,
    /// Nobody has looked; planners treat it as occupied.
    Unknown,
}

/// Why a grid cannot be.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GridError {
    /// See [`Grid::RESOLUTION_M`].
    #[error("a resolution of {0} m is outside 0.005 to 1 m")]
    Resolution(f64),
    /// No cells, or more than [`Grid::MOST_CELLS`].
    #[error("{width} × {height} cells; a grid has 1 to {most}", most = Grid::MOST_CELLS)]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The origin is not finite or more than a kilometre away.
    #[error("an origin of ({0}, {1}) m is outside ± 1000 m")]
    Origin(f64, f64),
    /// As many cells are needed as width times height says.
    #[error("{cells} cells instead of {wanted}")]
    Cells {
        /// What came.
        cells: usize,
        /// What width and height say.
        wanted: usize,
    },
}

/// Square cells, rows from south to north, each from west to east.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    resolution_m: f64,
    origin_m: [f64; 2],
    width: usize,
    height: usize,
    cells: Vec<Cell>,
}

impl Grid {
    /// Side of a cell, in m; other maps are refused (docs/maps.md). Chosen, not measured.
    pub const RESOLUTION_M: std::ops::RangeInclusive<f64> = 0.005..=1.0;
    /// Most cells, as in a message: 200 m × 200 m at 5 cm.
    pub const MOST_CELLS: usize = MAX_MAP_CELLS as usize;

    /// A grid of these cells; `origin_m` is the south-west corner of the first one, (x, y).
    ///
    /// # Errors
    /// See [`GridError`].
    pub fn new(
        resolution_m: f64,
        origin_m: [f64; 2],
        width: usize,
        height: usize,
        cells: Vec<Cell>,
    ) -> Result<Self, GridError> {
        if !Self::RESOLUTION_M.contains(&resolution_m) {
            return Err(GridError::Resolution(resolution_m));
        }
        if !origin_m.iter().all(|v| (-1000.0..=1000.0).contains(v)) {
            return Err(GridError::Origin(origin_m[0], origin_m[1]));
        }
        let wanted = width.checked_mul(height).filter(|count| (1..=Self::MOST_CELLS).contains(count));
        let Some(wanted) = wanted else { return Err(GridError::Size { width, height }) };
        if cells.len() != wanted {
            return Err(GridError::Cells { cells: cells.len(), wanted });
        }
        Ok(Self { resolution_m, origin_m, width, height, cells })
    }

    /// A grid without anything on it.
    ///
    /// # Errors
    /// See [`GridError`].
    pub fn free(
        resolution_m: f64,
        origin_m: [f64; 2],
        width: usize,
        height: usize,
    ) -> Result<Self, GridError> {
        let count = width.saturating_mul(height).min(Self::MOST_CELLS);
        Self::new(resolution_m, origin_m, width, height, vec![Cell::Free; count])
    }

    /// Side of a cell, in m.
    #[must_use]
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// South-west corner, (x, y) in m.
    #[must_use]
    pub fn origin_m(&self) -> [f64; 2] {
        self.origin_m
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// All cells, rows from south to north.
    #[must_use]
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// The cell in this column and row; outside everything is occupied.
    #[must_use]
    pub fn cell(&self, column: i64, row: i64) -> Cell {
        self.index(column, row).map_or(Cell::Occupied, |index| self.cells[index])
    }

    /// The cell under a point, in m.
    #[must_use]
    pub fn at(&self, x_m: f64, y_m: f64) -> Cell {
        let (column, row) = self.place(x_m, y_m);
        self.cell(column, row)
    }

    /// Column and row of a point; may lie outside.
    #[must_use]
    pub fn place(&self, x_m: f64, y_m: f64) -> (i64, i64) {
        let along = |v: f64, origin: f64| floor((v - origin) / self.resolution_m);
        (along(x_m, self.origin_m[0]), along(y_m, self.origin_m[1]))
    }

    /// Middle of a cell, (x, y) in m.
    #[must_use]
    pub fn centre_m(&self, column: i64, row: i64) -> [f64; 2] {
        [
            self.origin_m[0] + (column as f64 + 0.5) * self.resolution_m,
            self.origin_m[1] + (row as f64 + 0.5) * self.resolution_m,
        ]
    }

    /// Marks a cell; outside nothing happens.
    pub fn set(&mut self, column: i64, row: i64, cell: Cell) {
        if let Some(index) = self.index(column, row) {
            self.cells[index] = cell;
        }
    }

    /// Marks the cells with these indices; outside nothing happens.
    pub(crate) fn fill(&mut self, indices: std::ops::Range<usize>, cell: Cell) {
        if let Some(cells) = self.cells.get_mut(indices) {
            cells.fill(cell);
        }
    }

    fn index(&self, column: i64, row: i64) -> Option<usize> {
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        (column < self.width && row < self.height).then(|| row * self.width + column)
    }
}

/// As `libm::floor` and a cast, in a tenth of their time.
pub(crate) fn floor(value: f64) -> i64 {
    let near = value as i64;
    near.saturating_sub(i64::from(near as f64 > value))
}
