//! The ten pulses: who may change them, and when motor and pistons are held at rest.
//!
//! A frame is only *requested* here; [`Outputs::latch`] decides at each period's end. Once held, a frame
//! whose motor is neutral is the only one that is heard (`docs/io-board.md`, Watchdog).

use crate::time::Ticks;
use xtb_board_codec::{NEUTRAL, OUTPUTS, PULSES};

const MOTOR: usize = 0;
const PISTONS: core::ops::Range<usize> = 5..9;

/// Pulses of a board that nobody has set up, in counts of 0.4 µs: everything at rest, steering straight.
pub const AT_REST: [u16; OUTPUTS] =
    [NEUTRAL, 3710, 4179, NEUTRAL, NEUTRAL, NEUTRAL, NEUTRAL, NEUTRAL, NEUTRAL, NEUTRAL];

/// Whether an output may get each of these pulses; a frame with any other is refused as a whole.
pub(crate) fn in_range(pulses: &[u16; OUTPUTS]) -> bool {
    pulses.iter().all(|pulse| PULSES.contains(pulse))
}

#[derive(Debug, Clone)]
pub(crate) struct Outputs {
    requested: [u16; OUTPUTS],
    /// What the pins carry, from the last latch on.
    current: [u16; OUTPUTS],
    /// When the last PWM frame was heard that counts for the watchdog.
    heard: Option<Ticks>,
    held: bool,
}

impl Outputs {
    pub(crate) const fn new() -> Self {
        Self { requested: AT_REST, current: AT_REST, heard: None, held: true }
    }

    /// Motor and pistons are held at 3750.
    pub(crate) fn is_held(&self) -> bool {
        self.held
    }

    /// The first set-up: whatever was asked before it counts for nothing.
    pub(crate) fn begin(&mut self) {
        (self.requested, self.heard) = (AT_REST, None);
    }

    /// A PWM frame of the agent, whose pulses are [in range](in_range).
    pub(crate) fn request(&mut self, pulses: [u16; OUTPUTS], watchdog: Ticks, now: Ticks) {
        if pulses[MOTOR] == NEUTRAL || !self.is_starved(watchdog, now) {
            (self.requested, self.heard) = (pulses, Some(now));
        }
    }

    /// No frame for too long.
    fn is_starved(&self, watchdog: Ticks, now: Ticks) -> bool {
        self.heard.is_none_or(|heard| now.since(heard) >= watchdog)
    }

    /// The pulses of the period that begins at `wrap`.
    pub(crate) fn latch(&mut self, watchdog: Ticks, wrap: Ticks, stop_pressed: bool) -> [u16; OUTPUTS] {
        if stop_pressed {
            self.heard = None; // releasing it starts nothing: a neutral frame has to come first
        }
        self.held = self.is_starved(watchdog, wrap);
        if self.held {
            self.current[MOTOR] = NEUTRAL;
            self.current[PISTONS].fill(NEUTRAL);
        } else {
            self.current = self.requested;
        }
        self.current
    }

    /// The pulses before any set-up.
    pub(crate) fn rest(&mut self) -> [u16; OUTPUTS] {
        self.held = true;
        self.current = AT_REST;
        self.current
    }
}
