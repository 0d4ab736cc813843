//! Which set-ups this board can carry out, and the times that follow from one.

use crate::time::{TICKS_A_COUNT, Ticks};
use xtb_board_codec::{PINS, Setup};

/// The channel codes of this board's wiring, in the order of a set-up's pins: those of the default
/// settings. A set-up that names others is refused.
pub const WIRING: [u8; PINS] =
    [0x00, 0x01, 0x02, 0x10, 0x03, 0x04, 0x11, 0x05, 0x06, 0x07, 0x12, 0x13, 0x14, 0x15];
/// PWM period until a set-up says otherwise, in counts of 0.4 µs: 22.2 ms.
pub(crate) const POWER_ON_PERIOD: u16 = 55_500;
/// Shortest period and window: less would be no time to do anything in.
const SHORTEST: Ticks = Ticks::from_ms(5);

/// A set-up that the board carries out.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Running {
    pub(crate) setup: Setup,
    /// Counting window of the encoder.
    pub(crate) window: Ticks,
    /// Longest time without a PWM frame.
    pub(crate) watchdog: Ticks,
}

impl Running {
    /// `None` if the board cannot do it: foreign channels, a period or window below 5 ms, a watchdog of 0.
    pub(crate) fn of(setup: Setup) -> Option<Self> {
        let period = Ticks::new(u64::from(setup.pwm_period_counts) * u64::from(TICKS_A_COUNT));
        let window = Ticks::new(u64::from(setup.fqm_window) * u64::from(setup.tcr_prescaler));
        let possible =
            setup.channels == WIRING && period >= SHORTEST && window >= SHORTEST && setup.watchdog_ms > 0;
        let watchdog = Ticks::from_ms(u64::from(setup.watchdog_ms));
        possible.then_some(Self { setup, window, watchdog })
    }
}
