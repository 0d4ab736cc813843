//! What the battery's voltage means, the sag of a start left out.
//!
//! ```text
//!   ok ── below warn_v ──► warn ── below finish_v ──► finish ── below stop_v ──► critical
//!      ◄── hysteresis_v above it ──    each step after hold_s without a break
//! ```
//! A board that does not measure it says so, and then the level is unknown, never "ok".

use super::alarm::Alarm;
use xtb_control::Stamp;
use xtb_control::vehicle::BatteryLevels;
use xtb_protocol::messages::BatteryLevel;

/// One limit: below it, or not.
#[derive(Debug, Clone, Copy, Default)]
struct Limit {
    below: bool,
    /// Since when the voltage has been on the other side.
    other_since: Option<Stamp>,
}

impl Limit {
    fn update(&mut self, levels: &BatteryLevels, now: Stamp, volts: f64, limit_v: f64) {
        let other = if self.below { volts >= limit_v + levels.hysteresis_v } else { volts < limit_v };
        if !other {
            self.other_since = None;
        } else if now.since_s(*self.other_since.get_or_insert(now)) >= levels.hold_s {
            *self = Self { below: !self.below, other_since: None };
        }
    }
}

/// Watches one battery.
#[derive(Debug, Clone, Default)]
pub(super) struct BatteryMonitor {
    measured: bool,
    /// Warn, finish, stop.
    limits: [Limit; 3],
    pub(super) low: Alarm,
    pub(super) critical: Alarm,
}

impl BatteryMonitor {
    /// A measurement; `None` = the board does not measure it.
    pub(super) fn scan(&mut self, levels: &BatteryLevels, now: Stamp, volts: Option<f64>) {
        if let Some(volts) = volts {
            let limits_v = [levels.warn_v, levels.finish_v, levels.stop_v];
            for (limit, limit_v) in self.limits.iter_mut().zip(limits_v) {
                limit.update(levels, now, volts, limit_v);
            }
            if !self.measured {
                self.limits[0].below = volts < levels.warn_v; // what it was before is not known
            }
        } else {
            self.forget(); // what was low before it was not measured any more is not known to be better
        }
        self.measured = volts.is_some();
        let words = || volts.map_or_else(|| "not measured since".to_owned(), |volts| format!("{volts:.2} V"));
        let [_, low, critical] = self.limits.map(|limit| limit.below);
        self.low.set(now, low && !critical, words);
        self.critical.set(now, critical, words);
    }

    /// What the voltage means.
    pub(super) fn level(&self) -> BatteryLevel {
        match self.limits.map(|limit| limit.below) {
            _ if !self.measured => BatteryLevel::Unknown,
            [_, _, true] => BatteryLevel::Critical,
            [_, true, _] => BatteryLevel::Finish,
            [true, ..] => BatteryLevel::Warn,
            _ => BatteryLevel::Ok,
        }
    }

    /// A pause: what lies on either side of it is not one stretch of time.
    pub(super) fn forget(&mut self) {
        for limit in &mut self.limits {
            limit.other_since = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A monitor with its own clock, measured each 40 ms.
    #[derive(Default)]
    struct Bench {
        monitor: BatteryMonitor,
        now_ms: u64,
    }

    impl Bench {
        fn run(&mut self, seconds: f64, volts: Option<f64>) -> BatteryLevel {
            for _ in 0..(seconds / 0.04) as u32 {
                self.now_ms += 40;
                self.monitor.scan(&BatteryLevels::default(), Stamp::from_ms(self.now_ms), volts);
            }
            self.monitor.level()
        }
    }

    #[test]
    fn the_levels_come_in_order_two_seconds_after_their_voltage_was_passed() {
        let mut bench = Bench::default();
        assert_eq!(bench.run(1.0, Some(7.8)), BatteryLevel::Ok);
        assert_eq!(bench.run(1.9, Some(7.1)), BatteryLevel::Ok);
        assert_eq!(bench.run(0.3, Some(7.1)), BatteryLevel::Warn);
        assert_eq!(bench.run(2.2, Some(6.8)), BatteryLevel::Finish);
        assert!(bench.monitor.low.is_present() && !bench.monitor.critical.is_present());
        assert_eq!(bench.run(2.2, Some(6.5)), BatteryLevel::Critical);
        assert_eq!(bench.monitor.critical.words().as_deref(), Some("6.50 V"));
    }

    #[test]
    fn an_empty_battery_is_critical_two_seconds_after_a_full_one() {
        let mut bench = Bench::default();
        bench.run(1.0, Some(8.0));
        assert_eq!(bench.run(2.2, Some(6.5)), BatteryLevel::Critical);
    }

    #[test]
    fn the_sag_of_a_start_changes_nothing() {
        let mut bench = Bench::default();
        bench.run(1.0, Some(7.8));
        for _ in 0..20 {
            assert_eq!(bench.run(1.8, Some(5.5)), BatteryLevel::Ok);
            assert_eq!(bench.run(0.2, Some(7.6)), BatteryLevel::Ok);
        }
    }

    #[test]
    fn a_pack_that_recovers_at_rest_stays_low() {
        let mut bench = Bench::default();
        bench.run(3.0, Some(6.85));
        assert_eq!(bench.run(60.0, Some(7.05)), BatteryLevel::Finish);
        assert_eq!(bench.run(2.2, Some(7.15)), BatteryLevel::Warn);
        assert_eq!(bench.run(2.2, Some(7.45)), BatteryLevel::Ok);
    }

    #[test]
    fn what_is_not_measured_is_unknown_and_what_was_critical_stays_so() {
        let mut bench = Bench::default();
        assert_eq!(bench.monitor.level(), BatteryLevel::Unknown);
        assert_eq!(bench.run(3.0, None), BatteryLevel::Unknown);
        assert!(!bench.monitor.critical.is_present());
        bench.run(3.0, Some(6.5));
        assert_eq!(bench.run(3.0, None), BatteryLevel::Unknown);
        assert!(bench.monitor.critical.is_present());
    }

    #[test]
    fn the_first_measurement_warns_at_once_and_stops_nothing() {
        assert_eq!(Bench::default().run(0.04, Some(6.0)), BatteryLevel::Warn);
    }
}
