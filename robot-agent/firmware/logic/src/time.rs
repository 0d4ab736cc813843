//! Time as whole ticks of the memorandum's 40 MHz clock: exact for every period that a set-up can name.

use xtb_board_codec::CLOCK_HZ;

/// Ticks of a count of 0.4 µs.
pub const TICKS_A_COUNT: u32 = 16;
const TICKS_A_US: u64 = (CLOCK_HZ / 1_000_000) as u64;
const TICKS_A_MS: u64 = (CLOCK_HZ / 1000) as u64;

/// A moment since power-on, or a time between two; one is 25 ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Ticks(u64);

impl Ticks {
    /// From ticks of 25 ns.
    #[must_use]
    pub const fn new(ticks: u64) -> Self {
        Self(ticks)
    }

    /// From µs.
    #[must_use]
    pub const fn from_us(us: u64) -> Self {
        Self(us * TICKS_A_US)
    }

    /// From ms.
    #[must_use]
    pub const fn from_ms(ms: u64) -> Self {
        Self(ms * TICKS_A_MS)
    }

    /// In whole µs, rounded down.
    #[must_use]
    pub const fn as_us(self) -> u64 {
        self.0 / TICKS_A_US
    }

    /// In ticks of 25 ns.
    #[must_use]
    pub const fn get(self) -> u64 {
        self.0
    }

    /// This much later.
    #[must_use]
    pub const fn plus(self, time: Self) -> Self {
        Self(self.0 + time.0)
    }

    /// This much earlier; 0 at the earliest.
    #[must_use]
    pub const fn minus(self, time: Self) -> Self {
        Self(self.0.saturating_sub(time.0))
    }

    /// The time since an earlier moment; 0 if that one is later.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        self.minus(earlier)
    }
}

/// Comes due again and again.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Every {
    pub(crate) next: Ticks,
    period: Ticks,
}

impl Every {
    /// For the first time a period after `now`.
    pub(crate) fn after(now: Ticks, period: Ticks) -> Self {
        Self { next: now.plus(period), period }
    }

    /// Whether it has come due until `now`; periods that were slept through are skipped.
    pub(crate) fn is_due(&mut self, now: Ticks) -> bool {
        if now < self.next {
            return false;
        }
        self.next = self.next.plus(self.period);
        if self.next <= now {
            self.next = now.plus(self.period);
        }
        true
    }
}
