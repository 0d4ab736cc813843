//! What a robot's sensors and its drive say about themselves: readings that stand still or cannot be,
//! wheels that run away or do not turn, a battery that empties.
//!
//! ```text
//!   gyro frame ──────► gyro ──────► frozen
//!   encoder window ──► encoder ───► out of range
//!            │  └────► drive ─────► runaway · stalled · over speed
//!            ▼ turning
//!   converter scan ──► converter ─► frozen · one range finder frozen · out of range
//!            └───────► battery ───► low · critical
//! ```
//! Pure: samples and time go in, the present faults come out. A fault stays present for a moment after
//! its cause has gone ([`HOLD_MS`]), so that people see it and it does not flap.

mod alarm;
mod battery;
mod converter;
mod drive;
mod encoder;
mod gyro;

pub use alarm::HOLD_MS;
pub use drive::Driven;
pub use gyro::SignsOfLife;

use crate::authority::guard::{Guard, Guards};
use alarm::Alarm;
use battery::BatteryMonitor;
use converter::ConverterMonitor;
use drive::DriveMonitor;
use encoder::EncoderMonitor;
use gyro::GyroMonitor;
use std::sync::Arc;
use xtb_control::controller::AdcSample;
use xtb_control::speed::wheel_rpm;
use xtb_control::{Stamp, VehicleConfig};
use xtb_protocol::messages::{BatteryLevel, Fault};

/// The monitors of one robot.
#[derive(Debug, Clone, Default)]
pub struct Monitors {
    gyro: GyroMonitor,
    encoder: EncoderMonitor,
    converter: ConverterMonitor,
    drive: DriveMonitor,
    battery: BatteryMonitor,
    turning: bool,
    over_speed: bool,
}

impl Monitors {
    /// A frame of the gyro. True if it is the last one again, unchanged to the timer.
    pub fn gyro(&mut self, vehicle: &VehicleConfig, now: Stamp, frame: SignsOfLife) -> bool {
        self.gyro.frame(&vehicle.guard, now, frame, self.turning)
    }

    /// How the motor is driven from now on.
    pub fn drive(&mut self, driven: Driven) {
        self.drive.drive(driven);
    }

    /// A window of the encoder; faster than `most_mps`, which is asked for when the wheels turn, is too fast by hand.
    pub fn window(
        &mut self,
        vehicle: &VehicleConfig,
        now: Stamp,
        pulses: u16,
        most_mps: impl FnOnce() -> f64,
    ) {
        let rpm = wheel_rpm(&vehicle.encoder, u32::from(pulses));
        self.turning = pulses > 0;
        self.over_speed = self.turning && rpm * vehicle.mps_per_rpm() > most_mps();
        self.encoder.window(&vehicle.guard, now, rpm);
        self.drive.window(vehicle, now, pulses);
    }

    /// A window with more pulses than its frame may hold.
    pub fn impossible_window(&mut self, pulses: u16) {
        self.encoder.impossible(&format!("{pulses} pulses in one window"));
    }

    /// A scan of the converter; `battery_mv` is `None` if the board does not measure it.
    pub fn scan(&mut self, vehicle: &VehicleConfig, now: Stamp, scan: &AdcSample, battery_mv: Option<u16>) {
        self.converter.scan((&vehicle.guard, &vehicle.range_finders), now, scan, self.turning);
        let volts = battery_mv.map(|mv| f64::from(mv) / 1000.0);
        self.battery.scan(&vehicle.battery, now, volts);
    }

    /// The gyro's line was cut: what comes next has nothing to do with what came before.
    pub fn forget_gyro(&mut self) {
        self.gyro.forget();
    }

    /// The same of the board's line.
    pub fn forget_board(&mut self) {
        self.encoder.forget();
        self.converter.forget();
        self.drive.forget();
        self.battery.forget();
        (self.turning, self.over_speed) = (false, false);
    }

    /// No time from before counts. What is broken stays so until it is seen well again: a battery that was empty
    /// is no better for a clock that has jumped.
    pub fn clock_went_back(&mut self) {
        self.forget_gyro();
        self.forget_board();
        let Self { gyro, encoder, converter, drive, battery, .. } = self;
        for alarm in [
            &mut gyro.frozen,
            &mut encoder.out_of_range,
            &mut converter.frozen,
            &mut converter.finder_frozen,
            &mut converter.finder_out_of_range,
            &mut drive.runaway,
            &mut drive.stalled,
            &mut battery.low,
            &mut battery.critical,
        ] {
            alarm.forget_time();
        }
    }

    /// Whether the wheels are faster than the obstacle rule can stop, or than a crawl where no range finder looks.
    #[must_use]
    pub fn over_speed(&self) -> bool {
        self.over_speed
    }

    /// What the battery's voltage means.
    #[must_use]
    pub fn battery_level(&self) -> BatteryLevel {
        self.battery.level()
    }

    /// The present faults of the guards that are in force, with what was seen.
    pub fn faults(&self, guards: Guards) -> impl Iterator<Item = (Fault, Option<Arc<str>>)> {
        let alarms = [
            (Guard::Frozen, Fault::GyroFrozen, &self.gyro.frozen),
            (Guard::Frozen, Fault::ConverterFrozen, &self.converter.frozen),
            (Guard::Frozen, Fault::InfraredFrozen, &self.converter.finder_frozen),
            (Guard::OutOfRange, Fault::InfraredOutOfRange, &self.converter.finder_out_of_range),
            (Guard::OutOfRange, Fault::EncoderOutOfRange, &self.encoder.out_of_range),
            (Guard::Runaway, Fault::Runaway, &self.drive.runaway),
            (Guard::Stall, Fault::Stalled, &self.drive.stalled),
            (Guard::Battery, Fault::BatteryLow, &self.battery.low),
            (Guard::Battery, Fault::BatteryCritical, &self.battery.critical),
        ];
        let on = move |(guard, ..): &(Guard, Fault, &Alarm)| guards.on(*guard);
        alarms.into_iter().filter(on).filter_map(|(_, fault, alarm)| Some((fault, Some(alarm.words()?))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::units::AdcCount;
    use xtb_control::vehicle::SLOTS;

    #[test]
    fn a_battery_that_was_empty_is_so_after_the_clock_has_gone_back_until_it_is_measured_better() {
        let (vehicle, mut monitors, zero) = (VehicleConfig::default(), Monitors::default(), AdcCount::ZERO);
        let (ir_front, ir_rear) = ([zero; SLOTS], [zero; SLOTS]);
        let scan = AdcSample { ir_front, ir_rear, tilt: [zero; 2], pistons: [zero; 4] };
        let scans = |from_ms: u64, seconds: f64, mv: u16, monitors: &mut Monitors| {
            for i in 0..(seconds / 0.04) as u64 {
                monitors.scan(&vehicle, Stamp::from_ms(from_ms + 40 * i), &scan, Some(mv));
            }
            monitors.faults(Guards::default()).any(|(fault, _)| fault == Fault::BatteryCritical)
        };
        assert!(scans(60_000, 3.0, 6_500, &mut monitors));
        monitors.clock_went_back();
        assert!(scans(100, 0.2, 6_500, &mut monitors));
        assert!(scans(300, 2.5, 8_000, &mut monitors), "two seconds better, and a moment more");
        assert!(!scans(2_800, 1.0, 8_000, &mut monitors));
    }
}
