//! Who is where in which step: the reservations of all cars.

use super::cars::{Cars, bits};
use super::instance::{Instance, MOST_STEPS};
use super::motion::{Spot, WAIT};
use std::rc::Rc;
use xtb_nav::Piece;

/// Steps that one number of bits stands for.
pub(super) const WORD: usize = u64::BITS as usize;
const _: () = assert!(MOST_STEPS.is_multiple_of(WORD));

/// The way of one car: a piece for each step, and where each begins. Then it stands.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Track {
    spots: Vec<Spot>,
    pieces: Vec<Piece>,
}

impl Track {
    pub(crate) fn new(start: Spot, pieces: Vec<Piece>) -> Self {
        let mut spots = vec![start];
        let mut spot = start;
        for piece in &pieces {
            spot = spot.after(piece, 1.0);
            spots.push(spot);
        }
        Self { spots, pieces }
    }

    /// Steps until it stands for good.
    pub(crate) fn steps(&self) -> usize {
        self.pieces.len()
    }

    /// Where step `step` begins, and what is driven in it.
    #[inline]
    pub(crate) fn at(&self, step: usize) -> (&Spot, &Piece) {
        match self.pieces.get(step) {
            Some(piece) => (&self.spots[step], piece),
            None => (&self.spots[self.pieces.len()], &WAIT),
        }
    }
}

/// The tracks of all cars that have one, and an index by step and by square.
#[derive(Debug)]
pub(crate) struct Table<'s> {
    instance: &'s Instance,
    tracks: Vec<Option<Rc<Track>>>,
    /// Cars that may be met in a block of squares in a step; block by block.
    near: Vec<Cars>,
    /// Squares along a side of a block, …
    block: usize,
    /// … and blocks along the floor.
    blocks: [usize; 2],
    /// Cars near a square in a step; square by square.
    counts: Vec<u8>,
    /// The same as bits: any.
    bits: Vec<u64>,
    words: usize,
    /// How many steps it holds.
    horizon: usize,
}

impl<'s> Table<'s> {
    pub(crate) fn new(instance: &'s Instance) -> Self {
        let (cars, steps, lattice) = (instance.cars(), instance.horizon, &instance.lattice);
        let squares = lattice.squares();
        // Middles move a little farther than reference points do; twice is plenty.
        let near = 2.0 * instance.reach + 4.0 * instance.step;
        let block = libm::ceil(near / lattice.side) as usize + 1;
        let blocks = [lattice.columns.div_ceil(block), lattice.rows.div_ceil(block)];
        Self {
            instance,
            tracks: vec![None; cars],
            near: vec![0; blocks[0] * blocks[1] * steps],
            block,
            blocks,
            counts: vec![0; squares * steps],
            bits: vec![0; squares * steps / WORD],
            words: steps / WORD,
            horizon: steps,
        }
    }

    pub(crate) fn track(&self, car: usize) -> Option<&Rc<Track>> {
        self.tracks[car].as_ref()
    }

    /// Steps until everyone stands for good.
    pub(crate) fn steps(&self) -> usize {
        self.tracks.iter().flatten().map(|track| track.steps()).max().unwrap_or(0)
    }

    pub(crate) fn put(&mut self, car: usize, track: Rc<Track>) {
        self.take(car);
        self.place(car, &track, true);
        self.mark(car, &track, true);
        self.tracks[car] = Some(track);
    }

    pub(crate) fn take(&mut self, car: usize) -> Option<Rc<Track>> {
        let track = self.tracks[car].take()?;
        self.place(car, &track, false);
        self.mark(car, &track, false);
        Some(track)
    }

    /// Block of squares that the middle of a body lies in: column and row.
    #[inline]
    fn block_of(&self, [x, y]: [f64; 2]) -> (usize, usize) {
        let (column, row) = self.instance.lattice.cell(x, y);
        (column / self.block, row / self.block)
    }

    /// Tells the blocks around a car that it is there, or no longer: whoever can meet it is in one of them.
    fn place(&mut self, car: usize, track: &Track, there: bool) {
        let body = &self.instance.drivers[car].body;
        for step in 0..=track.steps().min(self.horizon - 1) {
            let (column, row) = self.block_of(body.centre(track.at(step).0));
            let steps = if step == track.steps() { step..self.horizon } else { step..step + 1 };
            for row in row.saturating_sub(1)..(row + 2).min(self.blocks[1]) {
                for column in column.saturating_sub(1)..(column + 2).min(self.blocks[0]) {
                    let base = (row * self.blocks[0] + column) * self.horizon;
                    for cars in &mut self.near[base + steps.start..base + steps.end] {
                        *cars = if there { *cars | 1 << car } else { *cars & !(1 << car) };
                    }
                }
            }
        }
    }

    /// Counts the car in or out in all squares in which another one could not stand beside it.
    fn mark(&mut self, car: usize, track: &Track, there: bool) {
        let Instance { lattice, drivers, farthest, .. } = self.instance;
        let horizon = self.horizon;
        let body = &drivers[car].body;
        for step in 0..=track.steps().min(horizon - 1) {
            let (spot, piece) = track.at(step);
            let ([ax, ay], [bx, by]) = (body.centre(spot), body.centre(&spot.after(piece, 1.0)));
            let far = body.reach + farthest + piece.length_m.abs() / 2.0 + lattice.side * 0.75;
            let [x, y] = [(ax + bx) / 2.0, (ay + by) / 2.0];
            let last = step == track.steps();
            let until = if last { horizon } else { step + 1 };
            let ([column, row], around) = (lattice.place(x, y), far / lattice.side);
            let span = |v: f64, count: usize| {
                ((v - around).max(0.0) as usize, ((v + around).max(0.0) as usize + 1).min(count))
            };
            let ((west, east), (south, north)) = (span(column, lattice.columns), span(row, lattice.rows));
            for row in south..north {
                for column in west..east {
                    let [mx, my] = lattice.middle(column, row);
                    if (mx - x) * (mx - x) + (my - y) * (my - y) < far * far {
                        self.count(row * lattice.columns + column, step..until, there);
                    }
                }
            }
        }
    }

    fn count(&mut self, square: usize, steps: std::ops::Range<usize>, there: bool) {
        let base = square * self.horizon;
        for step in steps {
            let count = &mut self.counts[base + step];
            *count = if there { *count + 1 } else { *count - 1 };
            let (word, bit) = (square * self.words + step / WORD, 1 << (step % WORD));
            if *count == 0 {
                self.bits[word] &= !bit;
            } else {
                self.bits[word] |= bit;
            }
        }
    }

    /// When a car may have come to this square, as far as that matters: all moments of a time in which
    /// nobody is near are one, each step in which somebody is near is its own.
    #[inline]
    pub(crate) fn moment(&self, square: usize, step: usize) -> u32 {
        let bits = &self.bits[square * self.words..(square + 1) * self.words];
        let (mut word, bit) = (step / WORD, step % WORD);
        if bits[word] >> bit & 1 == 1 {
            return 2 * step as u32 + 1;
        }
        let mut before = bits[word] & ((1 << bit) - 1);
        while before == 0 && word > 0 {
            word -= 1;
            before = bits[word];
        }
        if before == 0 { 0 } else { 2 * (word * WORD + WORD - before.leading_zeros() as usize) as u32 }
    }

    /// Whether somebody comes near this square in this step or later.
    #[inline]
    pub(crate) fn busy_later(&self, square: usize, step: usize) -> bool {
        let bits = &self.bits[square * self.words..(square + 1) * self.words];
        let word = step / WORD;
        bits[word] >> (step % WORD) != 0 || bits[word + 1..].iter().any(|&bits| bits != 0)
    }

    /// Tells who touches a car on this piece in this step; `found` says whether to look further.
    #[inline]
    pub(crate) fn meets(
        &self,
        me: usize,
        (spot, piece): (&Spot, &Piece),
        step: usize,
        mut found: impl FnMut(usize) -> bool,
    ) {
        let Instance { drivers, reach, step: longest, .. } = self.instance;
        let body = &drivers[me].body;
        let [x, y] = body.centre(spot);
        let near = body.reach + reach + 2.0 * (piece.length_m.abs() + longest);
        let near = near * near;
        let (column, row) = self.block_of([x, y]);
        let cars = self.near[(row * self.blocks[0] + column) * self.horizon + step];
        for other in bits(cars & !(1 << me)) {
            let Some(track) = &self.tracks[other] else { continue };
            let (there, driven) = track.at(step);
            let centre = drivers[other].body.centre(there);
            let (dx, dy) = (centre[0] - x, centre[1] - y);
            if dx * dx + dy * dy > near {
                continue;
            }
            if !self.instance.pass((me, spot, piece), (other, there, driven)) && !found(other) {
                return;
            }
        }
    }
}
