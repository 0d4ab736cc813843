//! Encoder windows (§4.4): a free-running counter in hardware, read when a window closes.

use crate::time::{Every, Ticks};
use xtb_board_codec::MAX_PULSES;

/// Most pulses that wait for the next window when one was full: a shaft at its very limit has windows
/// of 660 and 661. More is interference, and is cut off.
const MOST_CARRIED: u16 = 66;

#[derive(Debug, Clone)]
pub(crate) struct Encoder {
    window: Every,
    /// The counter when the last window closed.
    seen: u16,
    carried: u16,
}

impl Encoder {
    /// Windows begin now.
    pub(crate) fn begin(window: Ticks, counter: u16, now: Ticks) -> Self {
        Self { window: Every::after(now, window), seen: counter, carried: 0 }
    }

    /// When the window closes.
    pub(crate) fn next(&self) -> Ticks {
        self.window.next
    }

    /// Pulses of the window, 0..=660, if it has closed. `counter` counts the encoder's edges modulo 65,536.
    pub(crate) fn turn(&mut self, counter: u16, now: Ticks) -> Option<u16> {
        if !self.window.is_due(now) {
            return None;
        }
        let counted = counter.wrapping_sub(self.seen).saturating_add(self.carried);
        self.seen = counter;
        let pulses = counted.min(MAX_PULSES);
        self.carried = (counted - pulses).min(MOST_CARRIED);
        Some(pulses)
    }
}
