//! TPU setup and reset (§4.2, Figs. 8 and 9).
//!
//! *Setup* (Fig. 8): "No task using the TPU can run without having received an event from the setup
//! as being completed." [`SetupTask`] is that rule: it asks the board to configure itself and opens
//! the gate for samples only when the board has confirmed exactly this [`TpuSetup`]; a board that
//! restarts closes it again. *Reset* (Fig. 9): a channel with an impossible reading ("420 %") is
//! reset; [`ResetMask`] says which.
//!
//! Printed: the 40 MHz clock, PWM counts of 16 clocks, the enhanced prescaler 64 (TPUMCR3 = 0x005f;
//! TPUMCR = 0x0020), the FQM window 0x8000 and the split into eight PWM channels and two of the TPU
//! (§4.1). Ours: the numbers of the channels, the place of the rear steering (the memorandum's list
//! forgets it), and that the set-up travels to a board of its own.

use crate::config::{ConfigError, Parameter};
use crate::units::{PWM_PERIOD_COUNTS, Stamp};
use crate::vehicle::VehicleConfig;
use std::fmt;
use std::str::FromStr;

/// The processor's clock (§4.2).
pub const SYSTEM_CLOCK_HZ: f64 = 40.0e6;
/// The PWM period in counts of 0.4 µs: 22.2 ms (§4.1).
pub const PWM_PERIOD: u16 = PWM_PERIOD_COUNTS as u16;
/// Without a PWM frame for this long the board goes neutral.
pub const WATCHDOG_MS: u16 = 100;
/// A set-up that is not confirmed is sent again after this time.
const ASK_AGAIN_MS: u64 = 100;

/// A pin's channel: one of eight PWM channels, or one of 16 of either TPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PinChannel {
    /// `pwm0` … `pwm7`.
    Pwm(u8),
    /// `tpua0` … `tpua15`.
    TpuA(u8),
    /// `tpub0` … `tpub15`.
    TpuB(u8),
}

impl PinChannel {
    /// What a configuration may say.
    pub const EXPECTED: &'static str = "pwm0 to pwm7, tpua0 to tpua15, or tpub0 to tpub15";

    /// One byte on the line to the board.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            Self::Pwm(n) => n,
            Self::TpuA(n) => 0x10 | n,
            Self::TpuB(n) => 0x20 | n,
        }
    }

    /// From its byte.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        match (code >> 4, code & 0x0F) {
            (0, n) if n < 8 => Some(Self::Pwm(n)),
            (1, n) => Some(Self::TpuA(n)),
            (2, n) => Some(Self::TpuB(n)),
            _ => None,
        }
    }
}

impl fmt::Display for PinChannel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pwm(n) => write!(f, "pwm{n}"),
            Self::TpuA(n) => write!(f, "tpua{n}"),
            Self::TpuB(n) => write!(f, "tpub{n}"),
        }
    }
}

impl FromStr for PinChannel {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbered = |prefix: &str| text.strip_prefix(prefix).and_then(|n| n.parse::<u8>().ok());
        if let Some(n) = numbered("pwm").filter(|n| *n < 8) {
            Ok(Self::Pwm(n))
        } else if let Some(n) = numbered("tpua").filter(|n| *n < 16) {
            Ok(Self::TpuA(n))
        } else if let Some(n) = numbered("tpub").filter(|n| *n < 16) {
            Ok(Self::TpuB(n))
        } else {
            Err(Self::EXPECTED)
        }
    }
}

/// Pins of a truck: ten outputs in [`PwmOutputs`](crate::controller::PwmOutputs) order, then the
/// encoder and the remote control's speed, steering and selector.
pub const PINS: usize = 14;

/// What the board has to be told before anything runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TpuSetup {
    /// In counts of 0.4 µs.
    pub pwm_period_counts: u16,
    /// Clock divider of the time count register.
    pub tcr_prescaler: u16,
    /// Counting window of the encoder, in time counts.
    pub fqm_window: u16,
    /// Longest time without a PWM frame.
    pub watchdog_ms: u16,
    /// Channel codes ([`PinChannel::code`]) of the [`PINS`].
    pub channels: [u8; PINS],
}

impl TpuSetup {
    /// Length on the line.
    pub const LEN: usize = 8 + PINS;

    /// As the vehicle's constants want it.
    ///
    /// # Errors
    /// A pin's channel that does not exist, or one that two pins share.
    pub fn of(vehicle: &VehicleConfig) -> Result<Self, ConfigError> {
        let parameters = vehicle.channels.parameters();
        let mut channels = [0; PINS];
        for (i, pin) in parameters.iter().enumerate().take(PINS) {
            let code = channel_of(pin)?.code();
            if let Some(other) = channels[..i].iter().position(|taken| *taken == code) {
                return Err(ConfigError::Conflict {
                    name: pin.name.clone(),
                    value: pin.value.clone(),
                    reason: format!("{} already uses that channel", parameters[other].name),
                });
            }
            channels[i] = code;
        }
        let tcr_prescaler = vehicle.remote.tick_us * 1e-6 * SYSTEM_CLOCK_HZ;
        let fqm_window = vehicle.encoder.window_s * SYSTEM_CLOCK_HZ / tcr_prescaler;
        Ok(Self {
            pwm_period_counts: PWM_PERIOD,
            tcr_prescaler: libm::round(tcr_prescaler) as u16,
            fqm_window: libm::round(fqm_window) as u16,
            watchdog_ms: WATCHDOG_MS,
            channels,
        })
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

    /// From the bytes on the line.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; Self::LEN]) -> Self {
        let word = |i: usize| u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]);
        let mut channels = [0; PINS];
        channels.copy_from_slice(&bytes[8..]);
        Self {
            pwm_period_counts: word(0),
            tcr_prescaler: word(1),
            fqm_window: word(2),
            watchdog_ms: word(3),
            channels,
        }
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

fn channel_of(pin: &Parameter) -> Result<PinChannel, ConfigError> {
    pin.value.trim_matches('"').parse().map_err(|expected: &str| ConfigError::OutOfRange {
        name: pin.name.clone(),
        value: pin.value.clone(),
        allowed: expected.to_owned(),
        unit: String::new(),
    })
}

/// Channels of the remote control whose reading asked for a reset (Fig. 9).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ResetMask {
    /// Speed.
    pub speed: bool,
    /// Steering.
    pub steering: bool,
    /// Manual or automatic.
    pub selector: bool,
}

impl ResetMask {
    /// Whether any channel asks.
    #[must_use]
    pub fn any(self) -> bool {
        self.speed || self.steering || self.selector
    }

    /// Both together.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            speed: self.speed || other.speed,
            steering: self.steering || other.steering,
            selector: self.selector || other.selector,
        }
    }

    /// Names of the channels that ask, in their order.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        [(self.speed, "speed"), (self.steering, "steering"), (self.selector, "selector")]
            .into_iter()
            .filter_map(|(asks, name)| asks.then_some(name))
    }
}

/// The gate of Fig. 8: no sample of the board counts before the board has confirmed its set-up.
#[derive(Debug, Clone)]
pub struct SetupTask {
    setup: TpuSetup,
    done: bool,
    asked: Option<Stamp>,
}

impl SetupTask {
    /// Nothing is set up yet.
    #[must_use]
    pub fn new(setup: TpuSetup) -> Self {
        Self { setup, done: false, asked: None }
    }

    /// Whether the board has confirmed.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.done
    }

    /// What the board should be.
    #[must_use]
    pub fn setup(&self) -> &TpuSetup {
        &self.setup
    }

    /// The board told its state: ready or not, and for which set-up.
    pub fn confirm(&mut self, ready: bool, checksum: u16) {
        self.done = ready && checksum == self.setup.checksum();
    }

    /// The line was cut: whatever is plugged in next has to confirm again.
    pub fn forget(&mut self) {
        self.done = false;
        self.asked = None;
    }

    /// The set-up to send now, if any: at once, then every 100 ms until it is confirmed.
    pub fn request(&mut self, now: Stamp) -> Option<TpuSetup> {
        let waiting = self.asked.is_some_and(|at| now.since_ms(at) < ASK_AGAIN_MS);
        if self.done || waiting {
            return None;
        }
        self.asked = Some(now);
        Some(self.setup)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setup() -> TpuSetup {
        TpuSetup::of(&VehicleConfig::default()).unwrap()
    }

    #[test]
    fn the_printed_registers_come_out() {
        let setup = setup();
        assert_eq!((setup.tcr_prescaler, setup.fqm_window, setup.pwm_period_counts), (64, 0x8000, 55_500));
    }

    #[test]
    fn eight_outputs_on_pwm_channels_and_two_on_the_tpu() {
        let outputs = setup().channels[..10].to_vec();
        let pwm =
            outputs.iter().filter(|code| matches!(PinChannel::from_code(**code), Some(PinChannel::Pwm(_))));
        assert_eq!(pwm.count(), 8);
        // §4.1: the front bumper and the front-right piston are the two on the TPU.
        for pin in [3, 6] {
            assert!(matches!(PinChannel::from_code(outputs[pin]), Some(PinChannel::TpuA(_))));
        }
    }

    #[test]
    fn a_set_up_round_trips_and_its_check_sum_sees_every_byte() {
        let setup = setup();
        let bytes = setup.to_bytes();
        assert_eq!(TpuSetup::from_bytes(&bytes), setup);
        for i in 0..TpuSetup::LEN {
            let mut other = bytes;
            other[i] ^= 1;
            assert_ne!(TpuSetup::from_bytes(&other).checksum(), setup.checksum(), "byte {i}");
        }
    }

    #[test]
    fn two_pins_on_one_channel_are_refused_by_name() {
        let mut vehicle = VehicleConfig::default();
        vehicle.channels.steer_rear = vehicle.channels.motor.clone();
        let error = vehicle.validate().unwrap_err().to_string();
        assert!(error.contains("channels.steer_rear") && error.contains("channels.motor"), "{error}");
        vehicle.channels.steer_rear = "pwm8".into();
        let error = vehicle.validate().unwrap_err().to_string();
        assert!(error.contains("pwm0 to pwm7"), "{error}");
    }

    #[test]
    fn the_gate_opens_only_for_exactly_this_set_up_and_closes_when_the_board_restarts() {
        let mut task = SetupTask::new(setup());
        let sum = setup().checksum();
        assert!(task.request(Stamp::ZERO).is_some());
        assert!(task.request(Stamp::from_ms(99)).is_none());
        assert!(task.request(Stamp::from_ms(100)).is_some());
        task.confirm(true, sum ^ 1);
        assert!(!task.is_done());
        task.confirm(true, sum);
        assert!(task.is_done() && task.request(Stamp::from_ms(300)).is_none());
        task.confirm(false, 0);
        assert!(!task.is_done() && task.request(Stamp::from_ms(300)).is_some());
    }
}
