//! Which of many trucks come near a place, and when, by a grid: a search in space and time asks few of them.
//!
//! It only leaves out whom the exact look would leave out as well: what a search finds does not depend on it.

use super::occupancy::{BLOCK, NEVER};
use super::task::Other;
use xtb_nav::geometry::rect::{Rect, Stand};

/// Circles larger than this are looked at everywhere, in m: parts of lines that are elsewhere before and after.
const LARGE_M: f64 = 6.0;
/// And what lies farther from the map's origin, in m: where nobody is.
const FAR_M: f64 = 1.0e6;
/// No fewer cells than one, no more than so many along each side of what all lines cover.
const MOST_CELLS: f64 = 400.0;
/// Most cells, each counted once for each block of ticks: where there would be more they are larger, so that lines
/// that lead far and take long need no more than 16 MB; chosen, not measured.
const MOST_BY_BLOCK: usize = 1 << 21;

/// Lines by cells, row by row: those of cells side by side follow each other.
struct Rows {
    from: Vec<u32>,
    lines: Vec<u32>,
}

impl Rows {
    /// From pairs of cell and line; in each cell they stay in their order.
    fn of(cells: usize, pairs: &[(u32, u32)]) -> Self {
        let mut from = vec![0; cells + 1];
        pairs.iter().for_each(|&(cell, _)| from[cell as usize + 1] += 1);
        (0..cells).for_each(|cell| from[cell + 1] += from[cell]);
        let (mut next, mut lines) = (from.clone(), vec![0; pairs.len()]);
        for &(cell, line) in pairs {
            let at = &mut next[cell as usize];
            lines[*at as usize] = line;
            *at += 1;
        }
        Self { from, lines }
    }

    /// Of the cells from one to another in one row.
    fn between(&self, first: usize, last: usize) -> &[u32] {
        &self.lines[self.from[first] as usize..self.from[last + 1] as usize]
    }
}

/// Cells of one size, and who is near them.
pub(super) struct Nearby {
    side_m: f64,
    origin_m: [f64; 2],
    width: usize,
    height: usize,
    /// In each cell: block of ticks and line, sorted.
    moving: Vec<Vec<(u32, u32)>>,
    blocks: usize,
    /// The same by blocks, and by cells in each.
    by_block: Rows,
    /// Lines that hold something in a cell, or end there.
    standing: Rows,
    /// Lines that are looked at everywhere.
    everywhere: Vec<u32>,
}

/// Columns and rows around a place.
struct Around {
    columns: [usize; 2],
    rows: std::ops::RangeInclusive<usize>,
}

impl Nearby {
    /// For a truck whose look-out reaches so far from its middle, in m.
    pub(super) fn new(others: &[Other<'_>], reach_m: f64) -> Self {
        let is_large = |other: &Other<'_>| {
            let (circles, held) = other.line.circles();
            circles.iter().chain(held).any(|circle| circle[2] > LARGE_M || circle[0].abs() > FAR_M)
        };
        let large: Vec<bool> = others.iter().map(is_large).collect();
        let circles = || {
            let small = others.iter().zip(&large).filter(|(_, large)| !**large);
            small.flat_map(|(other, _)| {
                let (circles, held) = other.line.circles();
                circles.iter().chain(held)
            })
        };
        let keep_m = others.iter().map(|other| 3.0 * other.separation_m).fold(0.0, f64::max);
        let radius_m = circles().map(|circle| circle[2]).fold(0.0, f64::max);
        let low = |axis: usize| circles().map(|circle| circle[axis]).fold(f64::MAX, f64::min);
        let high = |axis: usize| circles().map(|circle| circle[axis]).fold(f64::MIN, f64::max);
        let (low_m, high_m) = ([low(0), low(1)], [high(0), high(1)]);
        let long_m = (high_m[0] - low_m[0]).max(high_m[1] - low_m[1]).max(0.0);
        let small = others.iter().zip(&large).filter(|(_, large)| !**large);
        let blocks = small.map(|(other, _)| other.line.circles().0.len()).max().unwrap_or(0);
        let mut side_m = (radius_m + reach_m + keep_m).max(long_m / MOST_CELLS).max(0.1);
        let cells = |axis: usize, side_m: f64| ((high_m[axis] - low_m[axis]).max(0.0) / side_m) as usize + 1;
        while side_m < long_m && cells(0, side_m) * cells(1, side_m) * blocks > MOST_BY_BLOCK {
            side_m *= 2.0;
        }
        let (width, height) = (cells(0, side_m), cells(1, side_m));
        let mut nearby = Self {
            side_m,
            origin_m: low_m,
            width,
            height,
            moving: vec![Vec::new(); width * height],
            blocks,
            by_block: Rows::of(0, &[]),
            standing: Rows::of(0, &[]),
            everywhere: Vec::new(),
        };
        nearby.fill(others, &large);
        nearby
    }

    fn fill(&mut self, others: &[Other<'_>], large: &[bool]) {
        let (mut standing, mut by_block) = (Vec::new(), Vec::new());
        for (line, other) in others.iter().enumerate() {
            if large[line] {
                self.everywhere.push(line as u32);
                continue;
            }
            let (circles, held) = other.line.circles();
            let stays = circles.last().into_iter().chain(held);
            standing.extend(stays.map(|circle| (self.cell(circle) as u32, line as u32)));
        }
        // Block by block, so that each cell has them in this order.
        for block in 0..self.blocks {
            for (line, other) in others.iter().enumerate().filter(|(line, _)| !large[*line]) {
                let Some(circle) = other.line.circles().0.get(block) else { continue };
                let cell = self.cell(circle);
                self.moving[cell].push((block as u32, line as u32));
                by_block.push(((block * self.width * self.height + cell) as u32, line as u32));
            }
        }
        let cells = self.width * self.height;
        self.by_block = Rows::of(self.blocks * cells, &by_block);
        self.standing = Rows::of(cells, &standing);
    }

    /// Of a circle that is inside.
    fn cell(&self, circle: &[f64; 3]) -> usize {
        let [column, row] = self.place(circle[0], circle[1]);
        row as usize * self.width + column as usize
    }

    fn place(&self, x_m: f64, y_m: f64) -> [i64; 2] {
        let along = |v: f64, axis: usize| libm::floor((v - self.origin_m[axis]) / self.side_m) as i64;
        [along(x_m, 0), along(y_m, 1)]
    }

    /// The cells in which whoever can be too near to this one is; `None` = it is far outside.
    fn around(&self, stand: &Stand) -> Option<Around> {
        let rect: Rect = stand.look.unwrap_or(stand.body);
        let [column, row] = self.place(rect.x_m, rect.y_m);
        let of = |place: i64, count: usize| {
            let (from, to) = (place.saturating_sub(1).max(0), place.saturating_add(1).min(count as i64 - 1));
            (from <= to).then_some((from as usize, to as usize))
        };
        let ((left, right), (low, high)) = (of(column, self.width)?, of(row, self.height)?);
        Some(Around { columns: [left, right], rows: low..=high })
    }

    /// Whether any of the lines that may be near the stand at this tick is what `hits` says.
    pub(super) fn any_at(&self, stand: &Stand, tick: u32, mut hits: impl FnMut(usize) -> bool) -> bool {
        let mut any = |lines: &[u32]| lines.iter().any(|&line| hits(line as usize));
        let block = tick as usize / BLOCK;
        if let Some(Around { columns: [left, right], rows }) = self.around(stand) {
            for row in rows {
                let at = row * self.width;
                if any(self.standing.between(at + left, at + right)) {
                    return true;
                }
                let at = (block * self.height + row) * self.width;
                if block < self.blocks && any(self.by_block.between(at + left, at + right)) {
                    return true;
                }
            }
        }
        any(&self.everywhere)
    }

    /// The first tick after `from` at which a truck that stays there is in somebody's way.
    pub(super) fn next_hit(&self, others: &[Other<'_>], stand: &Stand, from: u32) -> u32 {
        let of = |line: u32| &others[line as usize];
        let large =
            self.everywhere.iter().map(|&line| of(line).line.next_hit(stand, from, of(line).separation_m));
        let mut first = large.min().unwrap_or(NEVER);
        let Some(Around { columns: [left, right], rows }) = self.around(stand) else { return first };
        for cell in rows.flat_map(|row| (left..=right).map(move |column| row * self.width + column)) {
            let moving = &self.moving[cell];
            let begin = moving.partition_point(|&(at, _)| at < (from + 1) / BLOCK as u32);
            for &(block, line) in &moving[begin..] {
                if block.saturating_mul(BLOCK as u32) > first {
                    break;
                }
                let (line, separation_m) = (of(line).line, of(line).separation_m);
                first = first.min(line.next_hit_in(block as usize, stand, from, separation_m));
            }
        }
        first
    }
}

#[cfg(test)]
mod tests {
    use super::super::discretized_path::DiscretizedPath;
    use super::super::occupancy::{Occupancy, TICK_WAY_M};
    use super::*;
    use std::f64::consts::FRAC_PI_4;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Car, MapPose, Path, Piece};

    #[test]
    fn lines_that_lead_far_and_take_long_need_no_more_room_and_are_found() {
        let car = Car::of(&VehicleConfig::default());
        let mut path = Path::standing(MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: FRAC_PI_4 });
        path.push(Piece { length_m: 400.0, curvature_per_m: 0.0 });
        let at_m: Vec<f64> = (0..4000).map(|tick| (f64::from(tick) * TICK_WAY_M).min(400.0)).collect();
        let line = Occupancy::driving(&DiscretizedPath::new(path, &car), &car, &at_m, 0);
        let others = [Other { line: &line, separation_m: 0.08, is_thing: false }];
        let nearby = Nearby::new(&others, 1.0);
        assert!(nearby.by_block.from.len() <= MOST_BY_BLOCK + 1, "{}", nearby.by_block.from.len());
        let mut met = 0;
        for step in 0..200 {
            let along_m = f64::from(step) * 1.4;
            let stand = Stand::still(&car, &MapPose { x_m: along_m, y_m: along_m, yaw_rad: 0.0 });
            for tick in (0..4000).step_by(50) {
                let hits = line.hits(&stand, tick, 0.08);
                assert_eq!(nearby.any_at(&stand, tick, |_| line.hits(&stand, tick, 0.08)), hits);
                met += u32::from(hits);
            }
            assert_eq!(nearby.next_hit(&others, &stand, 0), line.next_hit(&stand, 0, 0.08));
        }
        assert!(met > 10, "{met}");
    }
}
