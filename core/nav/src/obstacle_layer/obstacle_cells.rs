//! Marked cells: few, sorted, each with when it was seen last.

use super::beams::Extent;
use crate::geometry::grid::floor;
use xtb_control::units::Stamp;

/// Seen so often an obstacle counts: a single reading is a disturbance.
const COUNTS_FROM: u32 = 2;
/// Where something is, is the mean of so many readings: 1.2 s of scans, after which noise is a sixth.
const MEAN_OF: u32 = 32;
/// The other one may have been in a cell beside it, within this time, 13 scans: a reading is not that exact;
/// chosen, not measured.
const AGAIN_MS: u64 = 500;

/// Something that stands where the map has nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnmappedObstacle {
    /// Middle of its cell, east, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// When it was seen first.
    pub first: Stamp,
    /// When it was seen last.
    pub seen: Stamp,
}

impl UnmappedObstacle {
    /// From its middle to a point.
    #[must_use]
    pub fn distance_m(&self, point: [f64; 2]) -> f64 {
        libm::hypot(self.x_m - point[0], self.y_m - point[1])
    }
}

#[derive(Debug, Clone, Copy)]
struct ObservedCell {
    /// (row, column)
    place: (i64, i64),
    /// Where in it something was seen, on average.
    at: [f64; 2],
    /// Two beams have seen it at once.
    broad: bool,
    /// One has, and no other, from so near that the place is sure.
    near: bool,
    first: Stamp,
    seen: Stamp,
    /// It counts as long as this.
    fades: Stamp,
    times: u32,
}

impl ObservedCell {
    fn counts(&self) -> bool {
        self.times >= COUNTS_FROM
    }

    /// A beam that does not look just there says nothing about it.
    fn is_sure(&self) -> bool {
        self.near && !self.broad
    }
}

/// Square cells of a side in m, from an origin on.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellGrid {
    pub(super) resolution_m: f64,
    pub(super) origin_m: [f64; 2],
}

impl CellGrid {
    /// (row, column)
    pub(super) fn place(&self, point: [f64; 2]) -> (i64, i64) {
        let along = |axis: usize| floor((point[axis] - self.origin_m[axis]) / self.resolution_m);
        (along(1), along(0))
    }

    /// The middle of a cell, in m.
    pub(super) fn middle(&self, (row, column): (i64, i64)) -> [f64; 2] {
        let along = |axis: usize, n: i64| self.origin_m[axis] + (n as f64 + 0.5) * self.resolution_m;
        [along(0, column), along(1, row)]
    }
}

#[derive(Debug, Clone)]
pub(super) struct ObservedCells {
    grid: CellGrid,
    /// By place.
    cells: Vec<ObservedCell>,
    most: usize,
    /// One that counted stays a doubt for so long after it has faded.
    doubtful_ms: u64,
    overflowed: u64,
}

impl ObservedCells {
    /// None yet; never more than `most`. One that counted stays a doubt for so long after it has faded.
    pub(super) fn new(grid: CellGrid, most: usize, doubtful_ms: u64) -> Self {
        Self { grid, cells: Vec::new(), most, doubtful_ms, overflowed: 0 }
    }

    pub(super) fn resolution_m(&self) -> f64 {
        self.grid.resolution_m
    }

    /// Whether nothing was seen anywhere.
    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    pub(super) fn overflowed(&self) -> u64 {
        self.overflowed
    }

    pub(super) fn place(&self, point: [f64; 2]) -> (i64, i64) {
        self.grid.place(point)
    }

    /// When a cell was seen last.
    pub(super) fn seen(&self, place: (i64, i64)) -> Option<Stamp> {
        let known = self.cells.binary_search_by_key(&place, |cell| cell.place).ok()?;
        Some(self.cells[known].seen)
    }

    /// Something was seen there; it counts for so long.
    pub(super) fn see(&mut self, now: Stamp, point: [f64; 2], fades_ms: u64) {
        let (place, fades) = (self.place(point), now.plus_ms(fades_ms));
        match self.cells.binary_search_by_key(&place, |cell| cell.place) {
            Ok(known) => {
                let cell = &mut self.cells[known];
                cell.first = if now <= cell.fades { cell.first } else { now };
                (cell.seen, cell.times) = (cell.seen.max(now), cell.times.saturating_add(1));
                let part = 1.0 / f64::from(cell.times.min(MEAN_OF));
                cell.at = std::array::from_fn(|axis| cell.at[axis] + part * (point[axis] - cell.at[axis]));
                cell.fades = cell.fades.max(fades);
            }
            Err(_) => {
                self.make_room();
                let index = self.cells.partition_point(|cell| cell.place < place);
                self.cells.insert(
                    index,
                    ObservedCell {
                        place,
                        at: point,
                        first: now,
                        seen: now,
                        fades,
                        times: 1,
                        broad: false,
                        near: false,
                    },
                );
            }
        }
    }

    /// Part of a thing was seen there: it has stood there for as long as the obstacles that it joins.
    pub(super) fn see_part(
        &mut self,
        now: Stamp,
        point: [f64; 2],
        part: Extent,
        fades_ms: u64,
        joins_m: f64,
    ) {
        let joined = self.counting(now).filter(|cell| cell.distance_m(point) <= joins_m);
        let since = joined.map(|cell| cell.first).min();
        let (row, column) = self.place(point);
        let around = (-1..=1).flat_map(|up| (-1..=1).map(move |right| (row + up, column + right)));
        let lately = around.filter_map(|place| self.seen(place)).any(|seen| now.since_ms(seen) <= AGAIN_MS);
        self.see(now, point, fades_ms);
        if let Ok(seen) = self.cells.binary_search_by_key(&(row, column), |cell| cell.place) {
            let cell = &mut self.cells[seen];
            cell.first = cell.first.min(since.unwrap_or(cell.first));
            cell.broad |= part == Extent::Broad;
            if part == Extent::AloneNear {
                cell.near = true;
                cell.times = if lately { cell.times.max(COUNTS_FROM) } else { cell.times };
            }
        }
    }

    /// Something stands there, and has all along.
    pub(super) fn know(&mut self, now: Stamp, point: [f64; 2], fades_ms: u64) {
        self.see(now, point, fades_ms);
        let place = self.place(point);
        if let Ok(known) = self.cells.binary_search_by_key(&place, |cell| cell.place) {
            let cell = &mut self.cells[known];
            (cell.first, cell.times) = (Stamp::ZERO, cell.times.max(COUNTS_FROM));
        }
    }

    /// Nothing stands there.
    pub(super) fn remove(&mut self, point: [f64; 2]) {
        let place = self.place(point);
        if let Ok(known) = self.cells.binary_search_by_key(&place, |cell| cell.place) {
            self.cells.remove(known);
        }
    }

    fn make_room(&mut self) {
        if self.cells.len() < self.most {
            return;
        }
        let oldest = self.cells.iter().enumerate().min_by_key(|(_, cell)| cell.seen).map(|(i, _)| i);
        if let Some(oldest) = oldest {
            self.cells.remove(oldest);
            self.overflowed += 1;
        }
    }

    /// A beam got through here: what is marked in this cell is not there, unless it was seen just now, or is
    /// surely in a place at which this beam does not look.
    pub(super) fn remove_before(&mut self, now: Stamp, point: [f64; 2], is_seen: impl Fn([f64; 2]) -> bool) {
        let place = self.place(point);
        if let Ok(known) = self.cells.binary_search_by_key(&place, |cell| cell.place)
            && self.cells[known].seen < now
            && (!self.cells[known].is_sure() || is_seen(self.cells[known].at))
        {
            self.cells.remove(known);
        }
    }

    /// Keeps those for which this is true: of their cell's middle, or of where they were seen if that is sure.
    pub(super) fn retain(&mut self, keep: impl Fn([f64; 2], bool) -> bool) {
        let grid = self.grid;
        self.cells.retain(|cell| match cell.is_sure() {
            true => keep(cell.at, true),
            false => keep(grid.middle(cell.place), false),
        });
    }

    pub(super) fn fade(&mut self, now: Stamp) {
        let doubtful_ms = self.doubtful_ms;
        let doubtful = |cell: &ObservedCell| cell.counts() && now <= cell.fades.plus_ms(doubtful_ms);
        self.cells.retain(|cell| now <= cell.fades || doubtful(cell));
    }

    /// Those that are `meant` count until then, but no longer than `most_ms` after they were seen.
    pub(super) fn hold(&mut self, until: Stamp, most_ms: u64, meant: impl Fn([f64; 2]) -> bool) {
        for cell in &mut self.cells {
            if meant(self.grid.middle(cell.place)) {
                cell.fades = cell.fades.max(until.min(cell.seen.plus_ms(most_ms)));
            }
        }
    }

    /// The middle of a cell, in m.
    pub(super) fn middle(&self, place: (i64, i64)) -> [f64; 2] {
        self.grid.middle(place)
    }

    pub(super) fn clear(&mut self) {
        self.cells.clear();
    }

    /// Those that count at `now`.
    pub(super) fn counting(&self, now: Stamp) -> impl Iterator<Item = UnmappedObstacle> {
        self.obstacles(move |cell| now <= cell.fades)
    }

    /// Those that have faded, and nothing has shown to be gone.
    pub(super) fn doubtful(&self, now: Stamp) -> impl Iterator<Item = UnmappedObstacle> {
        self.obstacles(move |cell| now > cell.fades)
    }

    /// Where something was seen at `now` that counts, and whether it is broad: or something within `apart_m`.
    pub(super) fn seen_now(&self, now: Stamp, apart_m: f64) -> impl Iterator<Item = ([f64; 2], bool)> {
        let counting = || self.cells.iter().filter(|cell| cell.counts());
        let is_broad = move |at: [f64; 2]| {
            let off_m = |cell: &ObservedCell| libm::hypot(cell.at[0] - at[0], cell.at[1] - at[1]);
            counting().any(|cell| cell.broad && off_m(cell) <= apart_m)
        };
        counting().filter(move |cell| cell.seen == now).map(move |cell| (cell.at, is_broad(cell.at)))
    }

    fn obstacles(&self, meant: impl Fn(&ObservedCell) -> bool) -> impl Iterator<Item = UnmappedObstacle> {
        self.cells.iter().filter(move |cell| cell.counts() && meant(cell)).map(|cell| {
            let [x_m, y_m] = self.grid.middle(cell.place);
            UnmappedObstacle { x_m, y_m, first: cell.first, seen: cell.seen }
        })
    }
}
