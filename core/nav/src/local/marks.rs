//! Marked cells: few, sorted, each with when it was seen last.

use xtb_control::units::Stamp;

/// Seen so often a mark counts: a single reading is a disturbance.
const COUNTS_FROM: u32 = 2;
/// Where something is, is the mean of so many readings.
const MEAN_OF: u32 = 32;
/// The other one may have been in a cell beside it, within this time: a reading is not that exact.
const AGAIN_MS: u64 = 500;

/// Something that stands where the map has nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalObstacle {
    /// Middle of its cell, east, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// When it was seen first.
    pub first: Stamp,
    /// When it was seen last.
    pub seen: Stamp,
}

impl LocalObstacle {
    /// From its middle to a point.
    #[must_use]
    pub fn distance_m(&self, point: [f64; 2]) -> f64 {
        libm::hypot(self.x_m - point[0], self.y_m - point[1])
    }
}

#[derive(Debug, Clone, Copy)]
struct Mark {
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

impl Mark {
    fn counts(&self) -> bool {
        self.times >= COUNTS_FROM
    }

    /// A beam that does not look just there says nothing about it.
    fn is_sure(&self) -> bool {
        self.near && !self.broad
    }
}

/// What one reading says of a thing besides its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Part {
    /// A neighbouring beam sees it as well.
    Broad,
    /// No other beam sees it, from so near that the place is sure.
    AloneNear,
    /// Nothing.
    Some,
}

#[derive(Debug, Clone)]
pub(super) struct Marks {
    resolution_m: f64,
    origin_m: [f64; 2],
    /// By place.
    marks: Vec<Mark>,
    most: usize,
    /// One that counted stays a doubt for so long after it has faded.
    doubtful_ms: u64,
    overflowed: u64,
}

impl Marks {
    /// None yet; never more than `most`. One that counted stays a doubt for so long after it has faded.
    pub(super) fn new(resolution_m: f64, origin_m: [f64; 2], most: usize, doubtful_ms: u64) -> Self {
        Self { resolution_m, origin_m, marks: Vec::with_capacity(most), most, doubtful_ms, overflowed: 0 }
    }

    pub(super) fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    pub(super) fn overflowed(&self) -> u64 {
        self.overflowed
    }

    pub(super) fn place(&self, point: [f64; 2]) -> (i64, i64) {
        let along = |axis: usize| libm::floor((point[axis] - self.origin_m[axis]) / self.resolution_m) as i64;
        (along(1), along(0))
    }

    /// When a cell was seen last.
    pub(super) fn seen(&self, place: (i64, i64)) -> Option<Stamp> {
        let known = self.marks.binary_search_by_key(&place, |mark| mark.place).ok()?;
        Some(self.marks[known].seen)
    }

    /// Something was seen there; it counts for so long.
    pub(super) fn see(&mut self, now: Stamp, point: [f64; 2], fades_ms: u64) {
        let (place, fades) = (self.place(point), now.plus_ms(fades_ms));
        match self.marks.binary_search_by_key(&place, |mark| mark.place) {
            Ok(known) => {
                let mark = &mut self.marks[known];
                mark.first = if now <= mark.fades { mark.first } else { now };
                (mark.seen, mark.times) = (mark.seen.max(now), mark.times.saturating_add(1));
                let part = 1.0 / f64::from(mark.times.min(MEAN_OF));
                mark.at = std::array::from_fn(|axis| mark.at[axis] + part * (point[axis] - mark.at[axis]));
                mark.fades = mark.fades.max(fades);
            }
            Err(_) => {
                self.make_room();
                let index = self.marks.partition_point(|mark| mark.place < place);
                self.marks.insert(
                    index,
                    Mark {
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

    /// Part of a thing was seen there: it has stood there for as long as the marks that it joins.
    pub(super) fn see_part(&mut self, now: Stamp, point: [f64; 2], part: Part, fades_ms: u64, joins_m: f64) {
        let joined = self.counting(now).filter(|mark| mark.distance_m(point) <= joins_m);
        let since = joined.map(|mark| mark.first).min();
        let (row, column) = self.place(point);
        let around = (-1..=1).flat_map(|up| (-1..=1).map(move |right| (row + up, column + right)));
        let lately = around.filter_map(|place| self.seen(place)).any(|seen| now.since_ms(seen) <= AGAIN_MS);
        self.see(now, point, fades_ms);
        if let Ok(seen) = self.marks.binary_search_by_key(&(row, column), |mark| mark.place) {
            let mark = &mut self.marks[seen];
            mark.first = mark.first.min(since.unwrap_or(mark.first));
            mark.broad |= part == Part::Broad;
            if part == Part::AloneNear {
                mark.near = true;
                mark.times = if lately { mark.times.max(COUNTS_FROM) } else { mark.times };
            }
        }
    }

    /// Something stands there, and has all along.
    pub(super) fn know(&mut self, now: Stamp, point: [f64; 2], fades_ms: u64) {
        self.see(now, point, fades_ms);
        let place = self.place(point);
        if let Ok(known) = self.marks.binary_search_by_key(&place, |mark| mark.place) {
            let mark = &mut self.marks[known];
            (mark.first, mark.times) = (Stamp::ZERO, mark.times.max(COUNTS_FROM));
        }
    }

    /// Nothing stands there.
    pub(super) fn remove(&mut self, point: [f64; 2]) {
        let place = self.place(point);
        if let Ok(known) = self.marks.binary_search_by_key(&place, |mark| mark.place) {
            self.marks.remove(known);
        }
    }

    fn make_room(&mut self) {
        if self.marks.len() < self.most {
            return;
        }
        let oldest = self.marks.iter().enumerate().min_by_key(|(_, mark)| mark.seen).map(|(i, _)| i);
        if let Some(oldest) = oldest {
            self.marks.remove(oldest);
            self.overflowed += 1;
        }
    }

    /// A beam got through here: what is marked in this cell is not there, unless it was seen just now, or is
    /// surely in a place at which this beam does not look.
    pub(super) fn remove_before(&mut self, now: Stamp, point: [f64; 2], is_seen: impl Fn([f64; 2]) -> bool) {
        let place = self.place(point);
        if let Ok(known) = self.marks.binary_search_by_key(&place, |mark| mark.place)
            && self.marks[known].seen < now
            && (!self.marks[known].is_sure() || is_seen(self.marks[known].at))
        {
            self.marks.remove(known);
        }
    }

    /// Keeps those for which this is true: of their cell's middle, or of where they were seen if that is sure.
    pub(super) fn retain(&mut self, keep: impl Fn([f64; 2], bool) -> bool) {
        let (resolution_m, origin_m) = (self.resolution_m, self.origin_m);
        self.marks.retain(|mark| match mark.is_sure() {
            true => keep(mark.at, true),
            false => keep(middle(resolution_m, origin_m, mark.place), false),
        });
    }

    pub(super) fn fade(&mut self, now: Stamp) {
        let doubtful_ms = self.doubtful_ms;
        let doubtful = |mark: &Mark| mark.counts() && now <= mark.fades.plus_ms(doubtful_ms);
        self.marks.retain(|mark| now <= mark.fades || doubtful(mark));
    }

    /// Those that are `meant` count until then, but no longer than `most_ms` after they were seen.
    pub(super) fn hold(&mut self, until: Stamp, most_ms: u64, meant: impl Fn([f64; 2]) -> bool) {
        let (resolution_m, origin_m) = (self.resolution_m, self.origin_m);
        for mark in &mut self.marks {
            if meant(middle(resolution_m, origin_m, mark.place)) {
                mark.fades = mark.fades.max(until.min(mark.seen.plus_ms(most_ms)));
            }
        }
    }

    /// The middle of a cell, in m.
    pub(super) fn middle(&self, place: (i64, i64)) -> [f64; 2] {
        middle(self.resolution_m, self.origin_m, place)
    }

    pub(super) fn clear(&mut self) {
        self.marks.clear();
    }

    /// Those that count at `now`.
    pub(super) fn counting(&self, now: Stamp) -> impl Iterator<Item = LocalObstacle> {
        self.obstacles(move |mark| now <= mark.fades)
    }

    /// Those that have faded, and nothing has shown to be gone.
    pub(super) fn doubtful(&self, now: Stamp) -> impl Iterator<Item = LocalObstacle> {
        self.obstacles(move |mark| now > mark.fades)
    }

    /// Where something was seen at `now` that counts, and whether it is broad: or something within `apart_m`.
    pub(super) fn seen_now(&self, now: Stamp, apart_m: f64) -> impl Iterator<Item = ([f64; 2], bool)> {
        let counting = || self.marks.iter().filter(|mark| mark.counts());
        let is_broad = move |at: [f64; 2]| {
            let off_m = |mark: &Mark| libm::hypot(mark.at[0] - at[0], mark.at[1] - at[1]);
            counting().any(|mark| mark.broad && off_m(mark) <= apart_m)
        };
        counting().filter(move |mark| mark.seen == now).map(move |mark| (mark.at, is_broad(mark.at)))
    }

    fn obstacles(&self, meant: impl Fn(&Mark) -> bool) -> impl Iterator<Item = LocalObstacle> {
        self.marks.iter().filter(move |mark| mark.counts() && meant(mark)).map(|mark| {
            let [x_m, y_m] = middle(self.resolution_m, self.origin_m, mark.place);
            LocalObstacle { x_m, y_m, first: mark.first, seen: mark.seen }
        })
    }
}

fn middle(resolution_m: f64, origin_m: [f64; 2], (row, column): (i64, i64)) -> [f64; 2] {
    [origin_m[0] + (column as f64 + 0.5) * resolution_m, origin_m[1] + (row as f64 + 0.5) * resolution_m]
}
