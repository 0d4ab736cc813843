//! What is counted and timed: the encoder's edges, and how long the receiver's three pins are high.
//!
//! Slices do it in hardware: 7 counts rising edges, 6 and 0 count 0.4 µs while their pin is high. The
//! selector's pin belongs to no slice that is free, so an interrupt before all others takes the time of its
//! edges, in cycles of the core's own counter.

use crate::outputs::{cycles_a_count, divider};
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use embassy_rp::Peri;
use embassy_rp::gpio::{Input, Pull};
use embassy_rp::interrupt::{InterruptExt, Priority};
use embassy_rp::pac::{IO_BANK0, PWM, SIO};
use embassy_rp::peripherals::{PIN_13, PIN_15, PIN_16, PIN_17, PWM_SLICE0, PWM_SLICE6, PWM_SLICE7};
use embassy_rp::pwm::{Config, InputMode, Pwm};
use rp_pac::{Interrupt, interrupt};
use xtb_firmware_logic::Gate;

const SPEED_PIN: u32 = 13;
const STEERING_PIN: u32 = 17;
const SELECTOR_PIN: u32 = 16;
const STEERING_SLICE: usize = 0;
const SPEED_SLICE: usize = 6;
const ENCODER_SLICE: usize = 7;

/// The core's counter has 24 bits and counts down: at 125 MHz it comes round in 134 ms.
const CYCLES: u32 = 0x00FF_FFFF;
/// No moment of that counter.
const NEVER: u32 = u32::MAX;

/// When the selector's pin rose, in cycles; [`NEVER`] while it is low.
static SELECTOR_ROSE: AtomicU32 = AtomicU32::new(NEVER);
/// For how long it has been high, in counts of 0.4 µs modulo 65,536.
static SELECTOR_HIGH: AtomicU32 = AtomicU32::new(0);

/// Slices 0, 6, 7.
pub(crate) struct Slices(
    pub(crate) Peri<'static, PWM_SLICE0>,
    pub(crate) Peri<'static, PWM_SLICE6>,
    pub(crate) Peri<'static, PWM_SLICE7>,
);

/// Input pins.
pub(crate) struct Pins {
    pub(crate) speed: Peri<'static, PIN_13>,
    pub(crate) steering: Peri<'static, PIN_17>,
    pub(crate) selector: Peri<'static, PIN_16>,
    pub(crate) encoder: Peri<'static, PIN_15>,
}

/// The running counters.
pub(crate) struct Gates {
    /// Alive as long as the counting.
    _slices: [Pwm<'static>; 3],
    _selector: Input<'static>,
}

impl Gates {
    pub(crate) fn new(slices: Slices, pins: Pins, mut cycles: SYST) -> Self {
        cycles.set_clock_source(SystClkSource::Core);
        cycles.set_reload(CYCLES);
        cycles.clear_current();
        cycles.enable_counter();
        let mut timed = Config::default();
        timed.divider = divider();
        let counted = Config::default();
        let down = Pull::Down;
        let slices = [
            Pwm::new_input(slices.0, pins.steering, down, InputMode::Level, timed.clone()),
            Pwm::new_input(slices.1, pins.speed, down, InputMode::Level, timed),
            Pwm::new_input(slices.2, pins.encoder, down, InputMode::RisingEdge, counted),
        ];
        let selector = Input::new(pins.selector, Pull::Down);
        IO_BANK0.int_proc(0).inte(SELECTOR_PIN as usize / 8).modify(|w| {
            w.set_edge_low(SELECTOR_PIN as usize % 8, true);
            w.set_edge_high(SELECTOR_PIN as usize % 8, true);
        });
        Interrupt::IO_IRQ_BANK0.set_priority(Priority::P0);
        // SAFETY: the handler below touches nothing but its own two numbers.
        #[expect(unsafe_code, reason = "an interrupt is enabled")]
        unsafe {
            Interrupt::IO_IRQ_BANK0.enable();
        }
        Self { _slices: slices, _selector: selector }
    }

    /// Rising edges of the encoder, modulo 65,536.
    pub(crate) fn encoder(&self) -> u16 {
        PWM.ch(ENCODER_SLICE).ctr().read().ctr()
    }

    /// Speed, steering, selector.
    pub(crate) fn read(&self) -> [Gate; 3] {
        // Low before and after the count is read: then it is the count of a whole pulse.
        let before = SIO.gpio_in(0).read();
        let speed = PWM.ch(SPEED_SLICE).ctr().read().ctr();
        let steering = PWM.ch(STEERING_SLICE).ctr().read().ctr();
        let selector = SELECTOR_HIGH.load(Ordering::Relaxed) as u16;
        let pins = before | SIO.gpio_in(0).read();
        let gate = |counts: u16, pin: u32| Gate { counts, high: pins & 1 << pin != 0 };
        [gate(speed, SPEED_PIN), gate(steering, STEERING_PIN), gate(selector, SELECTOR_PIN)]
    }
}

#[interrupt]
fn IO_IRQ_BANK0() {
    let now = SYST::get_current();
    IO_BANK0.intr(SELECTOR_PIN as usize / 8).write(|w| {
        w.set_edge_low(SELECTOR_PIN as usize % 8, true);
        w.set_edge_high(SELECTOR_PIN as usize % 8, true);
    });
    if SIO.gpio_in(0).read() & 1 << SELECTOR_PIN != 0 {
        SELECTOR_ROSE.store(now, Ordering::Relaxed);
        return;
    }
    let rose = SELECTOR_ROSE.load(Ordering::Relaxed);
    if rose != NEVER {
        let (cycles, count) = (rose.wrapping_sub(now) & CYCLES, cycles_a_count());
        let high = SELECTOR_HIGH.load(Ordering::Relaxed).wrapping_add((cycles + count / 2) / count);
        SELECTOR_HIGH.store(high, Ordering::Relaxed);
        SELECTOR_ROSE.store(NEVER, Ordering::Relaxed);
    }
}
