//! Ten pulses on five PWM slices that wrap in step.
//!
//! A slice takes over its new compare values and its new top when it wraps, so pulses that are written
//! to all five before the wrap change together; [`Outputs::write`] refuses to begin too close to it.

use crate::clock;
use embassy_rp::Peri;
use embassy_rp::clocks::clk_sys_freq;
use embassy_rp::pac::PWM;
use embassy_rp::peripherals::{
    PIN_2, PIN_3, PIN_4, PIN_5, PIN_6, PIN_7, PIN_8, PIN_9, PIN_10, PIN_11, PWM_SLICE1, PWM_SLICE2,
    PWM_SLICE3, PWM_SLICE4, PWM_SLICE5,
};
use embassy_rp::pwm::{Config, Pwm, PwmBatch};
use fixed::FixedU16;
use fixed::types::extra::U4;
use xtb_firmware_logic::{AT_REST, Latch, TICKS_A_COUNT, Ticks};

/// Counts of 0.4 µs in a second.
const COUNTS_A_SECOND: u32 = 2_500_000;
/// The default period, in counts of 0.4 µs.
const PERIOD: u16 = 55_500;
/// Writing takes less: 10 µs, in counts of 0.4 µs.
const WRITING: u16 = 25;

/// Slices 1..=5.
pub(crate) struct Slices(
    pub(crate) Peri<'static, PWM_SLICE1>,
    pub(crate) Peri<'static, PWM_SLICE2>,
    pub(crate) Peri<'static, PWM_SLICE3>,
    pub(crate) Peri<'static, PWM_SLICE4>,
    pub(crate) Peri<'static, PWM_SLICE5>,
);

/// GP2..=11, in the order of a PWM frame.
pub(crate) struct Pins(
    pub(crate) Peri<'static, PIN_2>,
    pub(crate) Peri<'static, PIN_3>,
    pub(crate) Peri<'static, PIN_4>,
    pub(crate) Peri<'static, PIN_5>,
    pub(crate) Peri<'static, PIN_6>,
    pub(crate) Peri<'static, PIN_7>,
    pub(crate) Peri<'static, PIN_8>,
    pub(crate) Peri<'static, PIN_9>,
    pub(crate) Peri<'static, PIN_10>,
    pub(crate) Peri<'static, PIN_11>,
);

/// Cycles of the core in a count of 0.4 µs: 50 at 125 MHz.
pub(crate) fn cycles_a_count() -> u32 {
    clk_sys_freq() / COUNTS_A_SECOND
}

/// The divider that makes a slice count 0.4 µs.
pub(crate) fn divider() -> FixedU16<U4> {
    FixedU16::from_num(cycles_a_count())
}

/// The running slices.
pub(crate) struct Outputs {
    /// Alive as long as the pulses.
    _slices: [Pwm<'static>; 5],
    wrap: Ticks,
    period_counts: u16,
}

impl Outputs {
    /// Every output at rest, from now on.
    pub(crate) fn start(s: Slices, p: Pins) -> Self {
        let config = |first: usize| {
            let mut config = Config::default();
            config.enable = false;
            config.divider = divider();
            config.top = PERIOD - 1;
            (config.compare_a, config.compare_b) = (AT_REST[first], AT_REST[first + 1]);
            config
        };
        let slices = [
            Pwm::new_output_ab(s.0, p.0, p.1, config(0)),
            Pwm::new_output_ab(s.1, p.2, p.3, config(2)),
            Pwm::new_output_ab(s.2, p.4, p.5, config(4)),
            Pwm::new_output_ab(s.3, p.6, p.7, config(6)),
            Pwm::new_output_ab(s.4, p.8, p.9, config(8)),
        ];
        PwmBatch::set_enabled(true, |batch| slices.iter().for_each(|slice| batch.enable(slice)));
        let mut outputs = Self { _slices: slices, wrap: clock::now(), period_counts: PERIOD };
        outputs.wrap = outputs.next_wrap();
        outputs
    }

    /// When the running period ends.
    pub(crate) fn wrap(&self) -> Ticks {
        self.wrap
    }

    fn next_wrap(&self) -> Ticks {
        self.wrap.plus(Ticks::new(u64::from(self.period_counts) * u64::from(TICKS_A_COUNT)))
    }

    /// Writes what takes effect at [`Self::wrap`]; false if that is too near or past, and nothing was
    /// written. From then on `wrap` is the next one.
    pub(crate) fn write(&mut self, latch: &Latch) -> bool {
        let in_time = cortex_m::interrupt::free(|_| {
            let counter = PWM.ch(1).ctr().read().ctr();
            let left = self.period_counts.saturating_sub(counter);
            if left < WRITING || counter < self.period_counts / 2 {
                return false;
            }
            for (slice, pair) in (1..).zip(latch.pulses.chunks_exact(2)) {
                let slice = PWM.ch(slice);
                slice.cc().write(|w| {
                    w.set_a(pair[0]);
                    w.set_b(pair[1]);
                });
                slice.top().write(|w| w.set_top(latch.period_counts - 1));
            }
            true
        });
        if in_time {
            self.period_counts = latch.period_counts;
        }
        self.wrap = self.next_wrap();
        in_time
    }
}
