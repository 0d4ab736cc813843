//! Time of a scenario, in turns of 5 ms.

use xtb_control::units::Stamp;
use xtb_sim::STEP_NS;

/// Turns of 5 ms since the day began.
pub(crate) type Turn = u32;

pub(crate) const MS_PER_TURN: u64 = STEP_NS / 1_000_000;

pub(crate) const fn ms(ms: u32) -> Turn {
    ms / MS_PER_TURN as u32
}

pub(crate) fn turns(s: f64) -> Turn {
    (s * 1000.0 / MS_PER_TURN as f64) as Turn
}

pub(crate) fn stamp(turn: Turn) -> Stamp {
    Stamp::from_ms(u64::from(turn) * MS_PER_TURN)
}
