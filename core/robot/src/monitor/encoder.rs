//! An encoder that counts what is not there: interference, a loose screen.

use super::alarm::Alarm;
use xtb_control::Stamp;
use xtb_control::vehicle::GuardLimits;

/// So many impossible windows in a row are a fault; one is a disturbance.
const WINDOWS: u32 = 2;

/// Watches one encoder.
#[derive(Debug, Clone, Default)]
pub(super) struct EncoderMonitor {
    in_a_row: u32,
    pub(super) out_of_range: Alarm,
}

impl EncoderMonitor {
    /// A window in which the wheels turned at `rpm`.
    pub(super) fn window(&mut self, limits: &GuardLimits, now: Stamp, rpm: f64) {
        if rpm > limits.top_rpm {
            self.impossible(&format!("{rpm:.0} rpm"));
        } else {
            self.in_a_row = 0;
            self.out_of_range.quiet(now);
        }
    }

    /// A window that cannot be.
    pub(super) fn impossible(&mut self, words: &str) {
        self.in_a_row = self.in_a_row.saturating_add(1);
        if self.in_a_row >= WINDOWS {
            self.out_of_range.raise(|| words.to_owned());
        }
    }

    pub(super) fn forget(&mut self) {
        self.in_a_row = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_windows_above_top_speed_are_a_fault_and_one_is_not() {
        let (limits, mut monitor) = (GuardLimits::default(), EncoderMonitor::default());
        for rpm in [371.0, 20.0, 371.0] {
            monitor.window(&limits, Stamp::ZERO, rpm);
            assert!(!monitor.out_of_range.is_present());
        }
        monitor.impossible("4711 pulses in one window");
        assert_eq!(monitor.out_of_range.words().as_deref(), Some("4711 pulses in one window"));
        monitor.window(&limits, Stamp::from_ms(50), 353.0);
        monitor.window(&limits, Stamp::from_ms(1050), 353.0);
        assert!(!monitor.out_of_range.is_present(), "gone a second after the last of them");
    }
}
