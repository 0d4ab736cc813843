//! The timer: what time it is, and sleep until it is another. It counts µs of the crystal that also
//! clocks the PWM slices, so that the two never drift apart. Alarm 0 is embassy-rp's, and is never set.

use embassy_rp::interrupt::{InterruptExt, Priority};
#[cfg(not(feature = "pico2"))]
use embassy_rp::pac::TIMER;
#[cfg(feature = "pico2")]
use embassy_rp::pac::TIMER0 as TIMER;
use rp_pac::{Interrupt, interrupt};
use xtb_firmware_logic::Ticks;

#[cfg(not(feature = "pico2"))]
const ALARM: Interrupt = Interrupt::TIMER_IRQ_1;
#[cfg(feature = "pico2")]
const ALARM: Interrupt = Interrupt::TIMER0_IRQ_1;

fn now_us() -> u64 {
    loop {
        let high = TIMER.timerawh().read();
        let low = TIMER.timerawl().read();
        if TIMER.timerawh().read() == high {
            return u64::from(high) << 32 | u64::from(low);
        }
    }
}

/// Since power-on.
pub(crate) fn now() -> Ticks {
    Ticks::from_us(now_us())
}

/// Sleeps, with interrupts served, until a moment or a little later.
pub(crate) fn sleep_until(moment: Ticks) {
    let target = moment.as_us();
    TIMER.inte().modify(|w| w.set_alarm(1, true));
    ALARM.set_priority(Priority::P1);
    // SAFETY: the handler below touches nothing but the alarm's own flag.
    #[expect(unsafe_code, reason = "an interrupt is enabled")]
    unsafe {
        ALARM.enable();
    }
    TIMER.alarm(1).write_value(target as u32);
    while now_us() < target {
        cortex_m::interrupt::free(|_| {
            // An alarm that fires from here on is pending, and wakes the core.
            if now_us() < target {
                cortex_m::asm::wfi();
            }
        });
    }
}

fn acknowledge() {
    TIMER.intr().write(|w| w.set_alarm(1, true));
}

#[cfg(not(feature = "pico2"))]
#[interrupt]
fn TIMER_IRQ_1() {
    acknowledge();
}

#[cfg(feature = "pico2")]
#[interrupt]
fn TIMER0_IRQ_1() {
    acknowledge();
}
