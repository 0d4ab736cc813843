//! The R/C receiver's three channels (§4.2.2, §4.3), as lengths of their pulses.
//!
//! Hardware adds up how long each pin was high; a pulse is what was added between two moments at which
//! the pin was low. So a channel cannot begin on the wrong edge, as the MPC555's NITC function could;
//! a pin that stays high reads 65,534 until it falls or is reset (the memorandum's "420 %").

use crate::time::{Every, TICKS_A_COUNT, Ticks};
use xtb_board_codec::NO_PULSE;

/// Between two frames of the receiver: 22.2 ms.
const PERIOD: Ticks = Ticks::from_us(22_200);
/// A pulse older than this has no successor: a period and a half, since receivers have periods of their own.
const FRESH: Ticks = Ticks::from_us(33_300);
/// A pin that is high for longer has no pulses.
const STUCK: Ticks = Ticks::from_us(22_200);
/// The reading of a pin that is stuck.
const LONGEST: u16 = NO_PULSE - 1;

/// Index of a channel, and of its bit in a reset frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// The speed stick.
    Speed = 0,
    /// The steering stick.
    Steering = 1,
    /// Manual or automatic.
    Selector = 2,
}

/// A channel's pin, as hardware sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Gate {
    /// For how long it has been high since power-on, in counts of 0.4 µs modulo 65,536; steady while it is low.
    pub counts: u16,
    /// It is high now.
    pub high: bool,
}

#[derive(Debug, Clone, Copy, Default)]
struct Measured {
    /// The counts when it was last low; `None`: it has not been low since its reset.
    low: Option<u16>,
    high_since: Option<Ticks>,
    stuck: bool,
    /// The last pulse in counts, and when it was seen.
    pulse: Option<(u16, Ticks)>,
}

impl Measured {
    fn turn(&mut self, gate: Gate, now: Ticks) {
        if gate.high {
            let since = *self.high_since.get_or_insert(now);
            self.stuck |= now.since(since) >= STUCK;
            return;
        }
        if let Some(low) = self.low
            && low != gate.counts
            && !self.stuck
        {
            self.pulse = Some((gate.counts.wrapping_sub(low), now));
        }
        (self.low, self.high_since, self.stuck) = (Some(gate.counts), None, false);
    }

    /// In time counts.
    fn reading(&self, prescaler: u16, now: Ticks) -> u16 {
        if self.stuck {
            return LONGEST;
        }
        let fresh = self.pulse.filter(|(_, seen)| now.since(*seen) < FRESH);
        fresh.map_or(NO_PULSE, |(counts, _)| {
            let (ticks, prescaler) = (u32::from(counts) * TICKS_A_COUNT, u32::from(prescaler.max(1)));
            ((ticks + prescaler / 2) / prescaler).min(u32::from(LONGEST)) as u16
        })
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Receiver {
    due: Every,
    channels: [Measured; 3],
}

impl Receiver {
    pub(crate) fn new(now: Ticks) -> Self {
        Self { due: Every::after(now, PERIOD), channels: [Measured::default(); 3] }
    }

    /// Channels start again whose bit is set.
    pub(crate) fn reset(&mut self, bits: u16) {
        for (i, channel) in self.channels.iter_mut().enumerate() {
            if bits & (1 << i) != 0 {
                *channel = Measured::default();
            }
        }
    }

    /// The three readings in time counts, when they are due.
    pub(crate) fn turn(&mut self, gates: [Gate; 3], prescaler: u16, now: Ticks) -> Option<[u16; 3]> {
        for (channel, gate) in self.channels.iter_mut().zip(gates) {
            channel.turn(gate, now);
        }
        self.due.is_due(now).then(|| self.channels.map(|channel| channel.reading(prescaler, now)))
    }
}
