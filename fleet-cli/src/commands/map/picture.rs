//! The picture itself: a character shows 2 × 4 dots, a dot a square of cells.

use crate::output::{Output, Tone};
use xtb_nav::{Cell, Map, Zone, ZoneKind};

/// Dots of a character, across and down.
const ACROSS: usize = 2;
const DOWN: usize = 4;
/// The bits of Unicode's braille patterns, by row and column.
const BRAILLE: [[u32; ACROSS]; DOWN] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
/// A map of few cells is not blown up beyond this.
const FEWEST_CELLS_PER_DOT: f64 = 0.2;
const ARROWS: [char; 8] = ['→', '↗', '↑', '↖', '←', '↙', '↓', '↘'];

/// How a heading looks.
pub(super) fn arrow(heading_rad: f64) -> char {
    let eighths = (heading_rad / std::f64::consts::FRAC_PI_4).round() as i64;
    ARROWS[eighths.rem_euclid(8) as usize]
}

/// How large a picture of a map is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Picture {
    cells_per_dot: f64,
    columns: usize,
    rows: usize,
}

impl Picture {
    /// The largest that fits; `None` = nothing does.
    pub(super) fn fit(map: &Map, columns: usize, rows: usize) -> Option<Self> {
        if columns == 0 || rows == 0 {
            return None;
        }
        let (width, height) = (map.grid().width() as f64, map.grid().height() as f64);
        let per_dot = (width / (ACROSS * columns) as f64).max(height / (DOWN * rows) as f64);
        // In steps: at 5 cm a dot is a whole number of centimetres.
        let cells_per_dot = ((per_dot * 5.0).ceil() / 5.0).max(FEWEST_CELLS_PER_DOT);
        let chars = |cells: f64, dots: usize| (cells / (cells_per_dot * dots as f64)).ceil() as usize;
        Some(Self { cells_per_dot, columns: chars(width, ACROSS), rows: chars(height, DOWN) })
    }

    pub(super) fn cells_per_dot(&self) -> f64 {
        self.cells_per_dot
    }

    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Line by line from the north, each of `columns` characters.
    pub(super) fn lines(&self, map: &Map, out: &Output) -> Vec<String> {
        (0..self.rows)
            .map(|row| {
                let chars: Vec<(Tone, char)> =
                    (0..self.columns).map(|column| self.look(map, column, row)).collect();
                let runs = chars.chunk_by(|a, b| a.0 == b.0);
                runs.map(|run| out.paint(run[0].0, &run.iter().map(|(_, c)| *c).collect::<String>()))
                    .collect()
            })
            .collect()
    }

    /// One character.
    fn look(&self, map: &Map, column: usize, row: usize) -> (Tone, char) {
        let (mut bits, mut unknown, mut seen) = (0, 0, 0);
        for (down, row_bits) in BRAILLE.iter().enumerate() {
            for (across, bit) in row_bits.iter().enumerate() {
                let dot = self.dot(map, column * ACROSS + across, row * DOWN + down);
                seen += usize::from(dot.is_some());
                match dot {
                    Some(Cell::Occupied) => bits |= bit,
                    Some(Cell::Unknown) => unknown += 1,
                    Some(Cell::Free) | None => {}
                }
            }
        }
        if bits != 0 {
            return (Tone::Plain, char::from_u32(0x2800 + bits).unwrap_or('⣿'));
        }
        match self.zone(map, column, row).map(Zone::kind) {
            Some(ZoneKind::KeepOut) => (Tone::Bad, '▒'),
            Some(ZoneKind::OneWay { heading_rad }) => (Tone::Good, arrow(heading_rad)),
            None if unknown > 0 && 2 * unknown >= seen => (Tone::Dim, '·'),
            None => (Tone::Plain, ' '),
        }
    }

    /// What is in a dot: occupied if any of its cells is, free if any is and none is occupied. `None` =
    /// beyond the map.
    fn dot(&self, map: &Map, across: usize, down: usize) -> Option<Cell> {
        let grid = map.grid();
        let span = |dot: usize, count: usize| {
            let first = (dot as f64 * self.cells_per_dot) as usize;
            let end = (((dot + 1) as f64 * self.cells_per_dot).ceil() as usize).min(count);
            first..end
        };
        let mut found = None;
        for below_north in span(down, grid.height()) {
            let row = grid.height() - 1 - below_north;
            for column in span(across, grid.width()) {
                match grid.cells()[row * grid.width() + column] {
                    Cell::Occupied => return Some(Cell::Occupied),
                    Cell::Free => found = Some(Cell::Free),
                    Cell::Unknown => found = found.or(Some(Cell::Unknown)),
                }
            }
        }
        found
    }

    /// The zone in the middle of a character, a keep-out before any other.
    fn zone<'a>(&self, map: &'a Map, column: usize, row: usize) -> Option<&'a Zone> {
        let grid = map.grid();
        let cells = |chars: f64, dots: usize| chars * dots as f64 * self.cells_per_dot;
        let [x_m, y_m] = grid.origin_m();
        let middle =
            [cells(column as f64 + 0.5, ACROSS), grid.height() as f64 - cells(row as f64 + 0.5, DOWN)];
        let (x_m, y_m) = (x_m + middle[0] * grid.resolution_m(), y_m + middle[1] * grid.resolution_m());
        // A little around the middle: a zone smaller than a character shows too.
        let half_m = cells(0.25, ACROSS) * grid.resolution_m();
        let around = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[a, b]: [f64; 2]| [x_m + a * half_m, y_m + b * half_m]);
        let touching = || map.zones().iter().filter(|zone| zone.touches(&around));
        touching().find(|zone| zone.kind() == ZoneKind::KeepOut).or_else(|| touching().next())
    }
}
