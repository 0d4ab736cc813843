//! Wheel speed and the speed PID (§4.2.3, §4.7, Fig. 12), run by each encoder window.
//!
//! Readings: the window is 0x8000 · 64 / 40 MHz = 52.4288 ms (the memorandum's formula uses 8000
//! decimal and then needs a "4 of unknown origin"); the printed `rpm = f_w·60/f_sys` forgets the
//! 60 pulses per revolution and divides by the clock. The law itself is in [`crate::pid`].
//! Ours: anti-windup, and the direction interlock (the ESC brakes before it reverses).

use crate::pid::{Gains, Pid};
use crate::units::PwmCount;
use crate::vehicle::{Encoder, Speed};

/// Most pulses of a window that the board's frame holds (docs/io-board.md).
pub const MAX_WINDOW_PULSES: u16 = 660;

/// Slower than this is standing, in m/s: at most two pulses of the encoder in a window, one being 0.005 m/s
/// with the default encoder, gear and tyres. The path follower's own limit, `follower.standing_mps`, is lower, at
/// most one pulse: its wheels must not roll at all when it changes gear.
pub const STANDS_MPS: f64 = 0.01;

/// Unsigned wheel speed in rpm: pulses / t_s / pulses per turn / gear ratio · 60 (§4.2.3).
#[must_use]
pub fn wheel_rpm(encoder: &Encoder, pulses: u32) -> f64 {
    f64::from(pulses) / encoder.window_s / encoder.pulses_per_rev / encoder.gear_ratio * 60.0
}

/// The speed controller: [`Pid`] around motor neutral.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SpeedPid(Pid);

impl SpeedPid {
    /// Forgets Σ and e[n−1].
    pub fn reset(&mut self) {
        self.0.reset();
    }

    /// One window: the motor command for `reference` and measured `rpm` (§4.7).
    pub fn step(&mut self, config: &Speed, window_s: f64, reference: f64, rpm: f64) -> PwmCount {
        let neutral = PwmCount::NEUTRAL.as_f64();
        let range = PwmCount::MIN.as_f64() - neutral..=PwmCount::MAX.as_f64() - neutral;
        let gains = Gains { kp: config.kp, ki: config.ki, kd: config.kd };
        let saturated = |correction: f64| config.anti_windup && !range.contains(&correction);
        PwmCount::saturating(neutral + self.0.step(gains, window_s, reference - rpm, saturated))
    }
}

/// The direction that the single-channel encoder cannot see: the sign of the last non-zero
/// reference, which the interlock lets through only when the wheels stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssumedDirection {
    sign: f64,
}

impl Default for AssumedDirection {
    fn default() -> Self {
        Self { sign: 1.0 }
    }
}

impl AssumedDirection {
    /// +1 ahead, −1 astern.
    #[must_use]
    pub fn sign(self) -> f64 {
        self.sign
    }

    /// A new reference was demanded. Without the interlock the sign follows at once (published).
    pub fn demand(&mut self, config: &Speed, reference: f64) {
        if !config.direction_interlock && reference != 0.0 {
            self.sign = reference.signum();
        }
    }

    /// Whether the interlock holds `reference` back until the wheels stand.
    #[must_use]
    pub fn must_wait(&self, config: &Speed, reference: f64) -> bool {
        config.direction_interlock && reference != 0.0 && reference.signum() != self.sign
    }

    /// A window closed with `pulses`: true if `reference` may drive now. With the interlock, a
    /// reference of the other sign waits until one window reads at most `interlock_pulses`.
    pub fn admit(&mut self, config: &Speed, reference: f64, pulses: u32) -> bool {
        if reference == 0.0 || reference.signum() == self.sign {
            return true;
        }
        if pulses <= config.interlock_pulses {
            self.sign = reference.signum();
            return true;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirteen_rpm_is_23_pulses_a_window() {
        let encoder = Encoder::default();
        assert!((wheel_rpm(&encoder, 23) - 12.9).abs() < 0.01);
        assert!((wheel_rpm(&encoder, 22) - 12.341_667_6).abs() < 1e-6);
    }

    #[test]
    fn anti_windup_lets_go_at_once_and_the_published_law_does_not() {
        let config = Speed::default();
        let published = Speed { anti_windup: false, ..config.clone() };
        let after = |config: &Speed| {
            let mut pid = SpeedPid::default();
            (0..200).for_each(|_| assert_eq!(pid.step(config, 0.05, 300.0, 0.0), PwmCount::MAX));
            pid.step(config, 0.05, 0.0, 50.0)
        };
        assert!(after(&config) < PwmCount::NEUTRAL);
        assert_eq!(after(&published), PwmCount::MAX);
    }

    #[test]
    fn the_interlock_lets_the_sign_flip_only_at_standstill() {
        let config = Speed::default();
        let mut direction = AssumedDirection::default();
        assert!(!direction.admit(&config, -13.0, 20));
        assert_eq!(direction.sign(), 1.0);
        assert!(direction.admit(&config, -13.0, 1));
        assert_eq!(direction.sign(), -1.0);
    }
}
