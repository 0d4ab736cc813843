//! What the board has to be told before anything runs (Fig. 8), as it goes over the line.

use crate::words;

/// The clock of which the set-up's times are made, in Hz (§4.2).
pub const CLOCK_HZ: u32 = 40_000_000;
/// Outputs of a PWM frame: motor, steering front and rear, bumpers front and rear, pistons FL, FR, RL
/// and RR, spare.
pub const OUTPUTS: usize = 10;
/// Pins that a set-up names: the [`OUTPUTS`], the encoder, and the receiver's speed, steering and selector.
pub const PINS: usize = OUTPUTS + 4;

/// The payload of a set-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setup {
    /// In counts of 0.4 µs.
    pub pwm_period_counts: u16,
    /// Clock divider of the time count register: a time count is this / [`CLOCK_HZ`].
    pub tcr_prescaler: u16,
    /// Counting window of the encoder, in time counts.
    pub fqm_window: u16,
    /// Longest time without a PWM frame, in ms.
    pub watchdog_ms: u16,
    /// Channel codes of the [`PINS`].
    pub channels: [u8; PINS],
}

impl Setup {
    /// Length on the line.
    pub const LEN: usize = 8 + PINS;

    /// From a payload; `None` if it has another length.
    #[must_use]
    pub fn from_payload(payload: &[u8]) -> Option<Self> {
        let bytes = <&[u8; Self::LEN]>::try_from(payload).ok()?;
        let [pwm_period_counts, tcr_prescaler, fqm_window, watchdog_ms] = words(&bytes[..8])?;
        let mut channels = [0; PINS];
        channels.copy_from_slice(&bytes[8..]);
        Some(Self { pwm_period_counts, tcr_prescaler, fqm_window, watchdog_ms, channels })
    }

    /// The bytes on the line: four little-endian numbers, then the channels.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        let words = [self.pwm_period_counts, self.tcr_prescaler, self.fqm_window, self.watchdog_ms];
        for (place, word) in bytes.chunks_exact_mut(2).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        bytes[8..].copy_from_slice(&self.channels);
        bytes
    }

    /// What the board echoes to confirm: Fletcher-16 of the bytes.
    #[must_use]
    pub fn checksum(&self) -> u16 {
        let (low, high) = self.to_bytes().iter().fold((0_u16, 0_u16), |(low, high), byte| {
            let low = (low + u16::from(*byte)) % 255;
            (low, (high + low) % 255)
        });
        high << 8 | low
    }
}
