//! The converter behind the two multiplexers.

use embassy_rp::Peri;
use embassy_rp::adc::{Adc, Blocking, Channel, Config};
use embassy_rp::gpio::{Level, Output, Pull};
use embassy_rp::peripherals::{ADC, PIN_26, PIN_27};
use xtb_firmware_logic::Visit;

/// Converter, its two pins, and the address lines.
pub(crate) struct Analog {
    converter: Adc<'static, Blocking>,
    first: Channel<'static>,
    second: Channel<'static>,
    address: [Output<'static>; 4],
}

impl Analog {
    pub(crate) fn new(
        adc: Peri<'static, ADC>,
        first: Peri<'static, PIN_26>,
        second: Peri<'static, PIN_27>,
        address: [Output<'static>; 4],
    ) -> Self {
        Self {
            converter: Adc::new_blocking(adc, Config::default()),
            first: Channel::new_pin(first, Pull::None),
            second: Channel::new_pin(second, Pull::None),
            address,
        }
    }

    /// Selects a channel of both multiplexers, 0..=15.
    pub(crate) fn select(&mut self, channel: u8) {
        for (bit, line) in self.address.iter_mut().enumerate() {
            line.set_level(Level::from(channel & 1 << bit != 0));
        }
    }

    /// Sums of 12-bit codes; a conversion takes 2 µs, and one that fails counts as 0.
    pub(crate) fn convert(&mut self, visit: &Visit) -> (u32, u32) {
        let mut sum = |pin: &mut Channel<'static>, conversions: u8| {
            (0..conversions).map(|_| u32::from(self.converter.blocking_read(pin).unwrap_or(0))).sum()
        };
        (sum(&mut self.first, visit.first), sum(&mut self.second, visit.second))
    }
}
