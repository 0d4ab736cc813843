//! The scan of all voltages in 38 ms (§4.5), through two multiplexers with common address lines.
//!
//! ```text
//!   channel       0..=5         6..=11       12      13      14        15
//!   first (GP26)  front IR 1–6  rear IR 1–6  tilt x  tilt y  battery   free
//!   second (GP27) 0..=3: IR     —            FL      FR      RL        RR     pistons
//!                 once, 4 conversions        eight rounds of 8 conversions (battery 4)
//!
//!   0, 1 of the second: the seventh and eighth of the front; 2, 3: those of the rear
//! ```
//! After each visit the next channel is selected, so that its voltage has 0.8 ms to settle. The converter
//! has 12 bits of 3.3 V; the frame has counts of 10 bits of 5 V. Range finders reach the pin directly, tilt
//! and pistons through dividers that make 3.3 V of 5 V, the battery through one of 1 : 4.

use crate::time::Ticks;
use xtb_board_codec::{ADC_SCANS, MAX_RANGE, NOT_FITTED};

/// A scan's time.
const SCAN: Ticks = Ticks::from_ms(38);
/// Range finders on the first multiplexer, and on the second one.
const RANGES: usize = 12;
const MORE_RANGES: usize = 4;
/// Numbers of a scan with six range finders a bumper, and with all.
pub(crate) const USUAL: usize = 19;
pub(crate) const WIDE: usize = USUAL + MORE_RANGES;
/// Numbers of a scan in the order of a wide frame, whose first ones are those of the usual frame.
pub(crate) type Readings = [u16; WIDE];
const ROUNDS: u32 = 8;
const VISITS: usize = RANGES + 4 * ROUNDS as usize;
const VISIT: Ticks = Ticks::new(SCAN.get() / VISITS as u64);

const RANGE_CONVERSIONS: u8 = 4;
const SUM_CONVERSIONS: u8 = (ADC_SCANS as u32 / ROUNDS) as u8;
const BATTERY_CONVERSIONS: u8 = 4;
/// Codes of the converter at 3.3 V.
const FULL_SCALE: u32 = 4096;
/// Counts of the frame at 5 V.
const COUNTS: u32 = 1024;
/// Below this there is no battery at the divider, in mV.
const NO_BATTERY_MV: u32 = 1000;

/// What to convert now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Visit {
    /// Channel that is selected, 0..=15.
    pub channel: u8,
    /// Conversions of the first multiplexer's output, to be added up.
    pub first: u8,
    /// Conversions of the second one's.
    pub second: u8,
}

#[derive(Debug, Clone)]
pub(crate) struct Scan {
    place: usize,
    next: Ticks,
    ranges: [u16; RANGES],
    more_ranges: [u16; MORE_RANGES],
    /// Sums of codes: tilt x and y, battery, nothing.
    first: [u32; 4],
    /// Pistons FL, FR, RL, RR.
    second: [u32; 4],
}

impl Scan {
    pub(crate) fn begin(now: Ticks) -> Self {
        Self {
            place: 0,
            next: now.plus(VISIT),
            ranges: [0; RANGES],
            more_ranges: [0; MORE_RANGES],
            first: [0; 4],
            second: [0; 4],
        }
    }

    fn channel(&self) -> usize {
        if self.place < RANGES { self.place } else { RANGES + (self.place - RANGES) % 4 }
    }

    /// The channel whose voltage has to settle.
    pub(crate) fn selected(&self) -> u8 {
        self.channel() as u8
    }

    /// What is to be converted, if it is time.
    pub(crate) fn visit(&self, now: Ticks) -> Option<Visit> {
        if now < self.next {
            return None;
        }
        let (first, second) = match self.channel() {
            0..MORE_RANGES => (RANGE_CONVERSIONS, RANGE_CONVERSIONS),
            MORE_RANGES..RANGES => (RANGE_CONVERSIONS, 0),
            14 => (BATTERY_CONVERSIONS, SUM_CONVERSIONS),
            15 => (0, SUM_CONVERSIONS),
            _ => (SUM_CONVERSIONS, SUM_CONVERSIONS),
        };
        Some(Visit { channel: self.selected(), first, second })
    }

    /// What was converted, as sums of codes; the numbers of a frame when the scan is complete.
    pub(crate) fn put(&mut self, first: u32, second: u32, now: Ticks) -> Option<Readings> {
        let channel = self.channel();
        if channel < RANGES {
            self.ranges[channel] = range(first);
            if let Some(reading) = self.more_ranges.get_mut(channel) {
                *reading = range(second);
            }
        } else {
            self.first[channel - RANGES] += first;
            self.second[channel - RANGES] += second;
        }
        self.place += 1;
        self.next = self.next.plus(VISIT).max(now);
        if self.place < VISITS {
            return None;
        }
        let mut numbers = [0; WIDE];
        numbers[..RANGES].copy_from_slice(&self.ranges);
        numbers[12] = sum(self.first[0]);
        numbers[13] = sum(self.first[1]);
        for (number, codes) in numbers[14..18].iter_mut().zip(self.second) {
            *number = sum(codes);
        }
        numbers[18] = battery_mv(self.first[2]);
        numbers[USUAL..].copy_from_slice(&self.more_ranges);
        (self.place, self.first, self.second) = (0, [0; 4], [0; 4]);
        Some(numbers)
    }
}

/// A range finder's count, 1024 at 5 V, from its conversions of 3.3 V.
fn range(codes: u32) -> u16 {
    const CODES: u32 = RANGE_CONVERSIONS as u32 * FULL_SCALE * 50;
    let count = (codes * (33 * COUNTS) + CODES / 2) / CODES;
    count.min(MAX_RANGE as u32) as u16
}

/// A sum of 64 counts, 1024 each at 5 V, from 64 conversions behind a divider.
fn sum(codes: u32) -> u16 {
    let sum = (codes * COUNTS + FULL_SCALE / 2) / FULL_SCALE;
    sum.min(MAX_RANGE as u32 * ADC_SCANS as u32) as u16
}

fn battery_mv(codes: u32) -> u16 {
    const CODES: u32 = ROUNDS * BATTERY_CONVERSIONS as u32 * FULL_SCALE;
    let mv = (codes * (4 * 3300) + CODES / 2) / CODES;
    if mv < NO_BATTERY_MV { NOT_FITTED } else { mv as u16 }
}
