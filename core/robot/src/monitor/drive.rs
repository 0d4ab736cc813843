//! Wheels that turn without being asked to, and wheels that do not although they are.
//!
//! ```text
//!   rpm │ ___                          what explains a speed:
//!       │    \ reference + 30 %          a reference, 30 % more for the PID's overshoot,
//!       │     \___                       and coasting down after it fell, twice as slowly
//!       │         ` .                    as expected, from the speed at that time
//!       │             ` · . _ _
//!       └───────────────────────── t   longer than 300 ms above all of it: runaway
//! ```
//! By hand any speed is explained while the stick is away from neutral: the receiver's pulse goes to the
//! motor as it is. A stall is a motor driven beyond its dead band without a pulse of the encoder: held
//! wheels, or an encoder whose wire is broken, which would let the speed controller go to full speed.

use super::alarm::Alarm;
use crate::agent::STICK_NEUTRAL_COUNTS;
use xtb_control::speed::wheel_rpm;
use xtb_control::{PwmCount, Stamp, VehicleConfig};

/// What changes within one window is seen by the next; a pulse takes a period to reach the motor.
const QUANTUM_PULSES: u32 = 2;
/// Coasting begins so many windows after the reference fell: the pulse's way to the motor, and the
/// window under way. Until then a truck that has just been started may still become faster.
const COAST_DELAY: u32 = 2;
/// Windows that come late and all at once prove less than their number: so much of the time has to be theirs.
/// Chosen, not measured.
const PART_OF_WINDOWS: f64 = 0.7;

/// How the motor is driven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Driven {
    /// By the transmitter.
    pub by_hand: bool,
    /// The pulse that the board was given last.
    pub motor: PwmCount,
    /// What the mode demands, signed.
    pub reference_rpm: f64,
}

impl Driven {
    fn offset_counts(self) -> f64 {
        (self.motor.as_f64() - PwmCount::NEUTRAL.as_f64()).abs()
    }

    /// The speed that is asked for; `None` = any.
    fn asked_rpm(self) -> Option<f64> {
        match self.by_hand {
            true if self.offset_counts() > STICK_NEUTRAL_COUNTS => None,
            true => Some(0.0),
            false if self.motor == PwmCount::NEUTRAL => Some(0.0),
            false => Some(self.reference_rpm.abs()),
        }
    }
}

/// How the motor has been driven since the last window.
#[derive(Debug, Clone, Copy)]
struct Span {
    /// The fastest that was asked for; `None` = any.
    asked_rpm: Option<f64>,
    /// The weakest pulse.
    offset_counts: f64,
}

impl Default for Span {
    fn default() -> Self {
        Self { asked_rpm: Some(0.0), offset_counts: 0.0 }
    }
}

impl Span {
    fn of(driven: Driven) -> Self {
        Self { asked_rpm: driven.asked_rpm(), offset_counts: driven.offset_counts() }
    }

    fn and(self, other: Self) -> Self {
        let fastest = |a: Option<f64>, b: Option<f64>| Some(a?.max(b?));
        Self {
            asked_rpm: fastest(self.asked_rpm, other.asked_rpm),
            offset_counts: self.offset_counts.min(other.offset_counts),
        }
    }
}

/// Since when something has been so, and in how many windows.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    since: Option<Stamp>,
    windows: u32,
}

impl Run {
    /// Another window. True once it has been so for `limit_s`; the window itself counts.
    fn lasts(&mut self, now: Stamp, so: bool, window_s: f64, limit_s: f64) -> bool {
        if !so {
            *self = Self::default();
            return false;
        }
        self.windows = self.windows.saturating_add(1);
        let since = *self.since.get_or_insert(now);
        let enough = f64::from(self.windows) * window_s >= limit_s * PART_OF_WINDOWS;
        enough && now.since_s(since) + window_s >= limit_s
    }
}

/// Watches the drive, window by window.
#[derive(Debug, Clone, Default)]
pub(super) struct DriveMonitor {
    driven: Span,
    /// Of the present window.
    span: Span,
    asked_rpm: Option<f64>,
    /// What coasting explains.
    coast_rpm: f64,
    coast_delay: u32,
    above: Run,
    still: Run,
    pub(super) runaway: Alarm,
    pub(super) stalled: Alarm,
}

impl DriveMonitor {
    /// The motor is driven so from now on.
    pub(super) fn drive(&mut self, driven: Driven) {
        self.driven = Span::of(driven);
        self.span = self.span.and(self.driven);
    }

    /// A window in which `pulses` were counted.
    pub(super) fn window(&mut self, vehicle: &VehicleConfig, now: Stamp, pulses: u16) {
        let rpm = wheel_rpm(&vehicle.encoder, u32::from(pulses));
        let span = std::mem::replace(&mut self.span, self.driven);
        self.watch_runaway(vehicle, now, rpm, span.asked_rpm);
        let standing = u32::from(pulses) <= vehicle.speed.interlock_pulses;
        if standing {
            self.runaway.quiet(now);
        }
        self.watch_stall(vehicle, now, pulses, span.offset_counts);
    }

    fn watch_runaway(&mut self, vehicle: &VehicleConfig, now: Stamp, rpm: f64, asked: Option<f64>) {
        let (limits, window_s) = (&vehicle.guard, vehicle.encoder.window_s);
        let above = match asked {
            Some(asked) => {
                self.coast(limits.coast_s, window_s, asked, rpm);
                let quantum_rpm = wheel_rpm(&vehicle.encoder, QUANTUM_PULSES);
                rpm > (asked * (1.0 + limits.runaway_part)).max(self.coast_rpm) + quantum_rpm
            }
            None => {
                self.coast_rpm = rpm;
                false
            }
        };
        self.asked_rpm = asked;
        if self.above.lasts(now, above, window_s, limits.runaway_s) {
            let (asked, coast_rpm) = (asked.unwrap_or(0.0), self.coast_rpm);
            self.runaway.raise(|| format!("{rpm:.1} rpm, commanded {asked:.1}, coasting {coast_rpm:.1}"));
        }
    }

    /// Moves on by one window what coasting explains.
    fn coast(&mut self, coast_s: f64, window_s: f64, asked_rpm: f64, rpm: f64) {
        let fell = self.asked_rpm.is_none_or(|before| asked_rpm < before);
        if fell {
            (self.coast_rpm, self.coast_delay) = (self.coast_rpm.max(rpm), COAST_DELAY);
        } else if self.coast_delay > 0 {
            (self.coast_rpm, self.coast_delay) = (self.coast_rpm.max(rpm), self.coast_delay - 1);
        } else {
            self.coast_rpm *= libm::exp(-window_s / coast_s);
        }
    }

    fn watch_stall(&mut self, vehicle: &VehicleConfig, now: Stamp, pulses: u16, offset_counts: f64) {
        let limits = &vehicle.guard;
        let is_driven = offset_counts >= limits.stall_counts;
        let still = is_driven && pulses == 0;
        if self.still.lasts(now, still, vehicle.encoder.window_s, limits.stall_s) {
            let from_counts = limits.stall_counts;
            let limit = format!("guard.stall_counts is {from_counts:.0}");
            self.stalled
                .raise(|| format!("{offset_counts:.0} counts from neutral, but no encoder pulse ({limit})"));
        } else if !is_driven {
            self.stalled.quiet(now);
        }
    }

    pub(super) fn forget(&mut self) {
        let Self { runaway, stalled, .. } = std::mem::take(self);
        (self.runaway, self.stalled) = (runaway, stalled);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW_MS: f64 = 52.4288;

    /// A monitor with its own clock.
    #[derive(Default)]
    struct Bench {
        monitor: DriveMonitor,
        windows: u32,
    }

    fn counts(offset: f64) -> PwmCount {
        PwmCount::saturating(PwmCount::NEUTRAL.as_f64() + offset)
    }

    fn asked(rpm: f64) -> Driven {
        Driven {
            by_hand: false,
            motor: counts(150.0 * rpm.signum() * rpm.abs().min(1.0)),
            reference_rpm: rpm,
        }
    }

    impl Bench {
        fn window(&mut self, pulses: u16, driven: Driven) {
            self.windows += 1;
            let now = Stamp::from_s(f64::from(self.windows) * WINDOW_MS / 1000.0);
            self.monitor.drive(driven);
            self.monitor.window(&VehicleConfig::default(), now, pulses);
        }

        /// Windows until `fault` is there, at most 100.
        fn until(&mut self, pulses: u16, driven: Driven, fault: fn(&DriveMonitor) -> bool) -> Option<u32> {
            (1..=100).find(|_| {
                self.window(pulses, driven);
                fault(&self.monitor)
            })
        }
    }

    fn runaway(monitor: &DriveMonitor) -> bool {
        monitor.runaway.is_present()
    }

    fn stalled(monitor: &DriveMonitor) -> bool {
        monitor.stalled.is_present()
    }

    #[test]
    fn a_third_too_fast_for_300_ms_is_a_runaway() {
        let mut bench = Bench::default();
        // 13 rpm are 23 pulses a window, 30 % more and two pulses 32.
        assert_eq!(bench.until(32, asked(13.0), runaway), None);
        assert_eq!(bench.until(33, asked(13.0), runaway), Some(6), "315 ms");
        bench.window(0, asked(13.0));
        assert!(runaway(&bench.monitor), "shown for a second after the wheels stand");
        (0..21).for_each(|_| bench.window(0, asked(0.0)));
        assert!(!runaway(&bench.monitor));
    }

    #[test]
    fn five_windows_of_overshoot_are_not_a_runaway() {
        let mut bench = Bench::default();
        for _ in 0..20 {
            (0..5).for_each(|_| bench.window(40, asked(13.0)));
            bench.window(30, asked(13.0));
        }
        assert!(!runaway(&bench.monitor));
    }

    #[test]
    fn coasting_down_is_explained_and_rolling_on_is_not() {
        let speed = |windows: u32| 60.0 * libm::exp(-f64::from(windows) * WINDOW_MS / 450.0);
        let mut bench = Bench::default();
        (0..20).for_each(|_| bench.window(60, asked(40.0)));
        (0..60).for_each(|i| bench.window(speed(i) as u16, asked(0.0)));
        assert!(!runaway(&bench.monitor), "almost twice as slow as expected");
        (0..20).for_each(|_| bench.window(60, asked(40.0)));
        let windows = bench.until(60, asked(0.0), runaway).unwrap();
        assert!((6..=10).contains(&windows), "{windows}");
    }

    #[test]
    fn a_reference_that_falls_before_the_wheels_have_followed_it_explains_their_speed() {
        // 20 rpm for two windows, from a stand; then neutral.
        let mut bench = Bench::default();
        for pulses in [0, 4] {
            bench.window(pulses, asked(20.0));
        }
        for pulses in [9, 12, 10, 8, 7, 6, 5, 4, 3, 3, 2, 2, 1, 1] {
            bench.window(pulses, asked(0.0));
        }
        assert!(!runaway(&bench.monitor));
    }

    #[test]
    fn a_drive_that_begins_and_ends_within_a_window_explains_its_speed() {
        let mut bench = Bench::default();
        bench.window(0, asked(0.0));
        bench.monitor.drive(asked(20.0));
        for pulses in [2, 9, 8, 7, 6, 5, 4, 4, 3, 3, 2, 2, 1, 1] {
            bench.window(pulses, asked(0.0));
        }
        assert!(!runaway(&bench.monitor));
    }

    #[test]
    fn by_hand_only_a_neutral_stick_must_come_to_a_stand() {
        let by_hand = |offset| Driven { by_hand: true, motor: counts(offset), reference_rpm: 0.0 };
        let mut bench = Bench::default();
        assert_eq!(bench.until(500, by_hand(200.0), runaway), None);
        assert!(bench.until(500, by_hand(50.0), runaway).is_some_and(|windows| windows <= 10));
    }

    #[test]
    fn a_driven_motor_without_pulses_is_a_stall_until_it_is_neutral() {
        let mut bench = Bench::default();
        assert_eq!(
            bench.until(0, asked(13.0), stalled),
            Some(9),
            "0.42 s after the first window that it was driven in whole"
        );
        (0..50).for_each(|_| bench.window(0, asked(13.0)));
        assert!(stalled(&bench.monitor), "it is still driven");
        (0..19).for_each(|_| bench.window(0, asked(0.0)));
        assert!(stalled(&bench.monitor), "shown for a second after it was neutral");
        (0..2).for_each(|_| bench.window(0, asked(0.0)));
        assert!(!stalled(&bench.monitor));
    }

    #[test]
    fn within_the_dead_band_nothing_has_to_turn() {
        let driven = Driven { motor: counts(99.0), ..asked(13.0) };
        assert_eq!(Bench::default().until(0, driven, stalled), None);
    }

    #[test]
    fn windows_that_come_all_at_once_prove_nothing() {
        let mut monitor = DriveMonitor::default();
        monitor.drive(asked(13.0));
        for _ in 0..40 {
            monitor.window(&VehicleConfig::default(), Stamp::from_ms(1000), 0);
        }
        assert!(!stalled(&monitor));
        for _ in 0..40 {
            monitor.window(&VehicleConfig::default(), Stamp::from_ms(1000), 600);
        }
        assert!(!runaway(&monitor));
    }
}
