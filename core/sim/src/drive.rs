//! What turns the motor's pulse into motion: ESC, motor and mass, and the battery behind them.
//!
//! ```text
//!   ESC   pulse with the rolling direction, or wheels (nearly) standing ─► drive towards its speed
//!         pulse against the rolling direction                          ─► brake towards 0
//!         pulse in the dead band                                       ─► coast down
//! ```
//! So the drive stops before it reverses, as the Novak Super Rooster does.

use crate::faults::DriveFault;
use crate::parameters::{BatteryTruth, DriveTruth};
use crate::servos::response;
use crate::step::STEP_S;
use xtb_control::PwmCount;

/// Below this a coasting truck stands: the exponential alone would never end.
const CREEP_MPS: f64 = 1e-3;
/// What rounding may add to the way of some steps, in m.
const ROUNDING_M: f64 = 1e-9;

/// Motor, ESC and the truck's mass.
#[derive(Debug, Clone)]
pub(crate) struct Drive {
    truth: DriveTruth,
    drive_response: f64,
    brake_response: f64,
    /// Rolling speed of the tyres, + = ahead.
    wheel_mps: f64,
    /// What the motor is asked for and does not reach yet, 0..=2 of top speed.
    shortfall: f64,
    fault: DriveFault,
    /// The last pulse that the ESC obeyed.
    obeyed: PwmCount,
}

impl Drive {
    pub(crate) fn new(truth: &DriveTruth, dt_s: f64) -> Self {
        Self {
            truth: truth.clone(),
            drive_response: response(dt_s, truth.lag_s),
            brake_response: response(dt_s, truth.brake_lag_s),
            wheel_mps: 0.0,
            shortfall: 0.0,
            fault: DriveFault::None,
            obeyed: PwmCount::NEUTRAL,
        }
    }

    pub(crate) fn wheel_mps(&self) -> f64 {
        self.wheel_mps
    }

    /// The wheels roll no farther in so many steps where no slope has a larger sine than this: each step brings
    /// the speed nearer to what is asked for by the same part, and what is missing is a geometric series.
    pub(crate) fn farthest_m(&self, steps: u64, steepest: f64) -> f64 {
        let most_mps = self.truth.top_speed_mps * (1.0 + self.truth.grade_effect * steepest);
        let (most_mps, slower_mps) =
            (most_mps.max(self.wheel_mps.abs()), (most_mps - self.wheel_mps.abs()).max(0.0));
        let rest = 1.0 - self.drive_response;
        let missing_mps = slower_mps * rest * (1.0 - rest.powi(steps as i32)) / self.drive_response;
        (most_mps * steps as f64 - missing_mps) * STEP_S + ROUNDING_M
    }

    /// Breaks or mends it.
    pub(crate) fn set_fault(&mut self, fault: DriveFault) {
        self.fault = fault;
    }

    /// Somebody turns the wheels by hand.
    pub(crate) fn roll_by_hand(&mut self, mps: f64) {
        self.wheel_mps = mps;
    }

    /// The wheels stand at once: contact, or a truck put elsewhere.
    pub(crate) fn halt(&mut self) {
        self.wheel_mps = 0.0;
    }

    /// Speed that a pulse stands for on the level with a full battery, + = ahead.
    fn demanded_mps(&self, count: PwmCount) -> f64 {
        let offset = count.as_f64() - PwmCount::NEUTRAL.as_f64();
        let beyond = offset.abs() - self.truth.dead_band_counts;
        if beyond <= 0.0 {
            return 0.0;
        }
        // The range astern is a little shorter than the range ahead; both end at top speed.
        let end = if offset > 0.0 { PwmCount::MAX } else { PwmCount::MIN };
        let range = (end.as_f64() - PwmCount::NEUTRAL.as_f64()).abs() - self.truth.dead_band_counts;
        self.truth.top_speed_mps * (beyond / range) * offset.signum()
    }

    /// One step. `supply` is the battery's voltage as a part of its full one, `climb` the sine of
    /// the slope ahead (+ = uphill).
    pub(crate) fn step(&mut self, count: PwmCount, supply: f64, climb: f64) {
        if self.fault != DriveFault::Stuck {
            self.obeyed = count;
        }
        self.turn(self.obeyed, supply, climb);
        if self.fault == DriveFault::Held {
            self.halt();
        }
    }

    fn turn(&mut self, count: PwmCount, supply: f64, climb: f64) {
        let demanded = self.demanded_mps(count);
        let against = demanded * self.wheel_mps < 0.0;
        if against && self.wheel_mps.abs() > self.truth.standstill_mps {
            self.wheel_mps -= self.wheel_mps * self.brake_response;
            self.shortfall = 0.0;
            return;
        }
        let grade = 1.0 - self.truth.grade_effect * climb * demanded.signum();
        let reachable = demanded * supply * grade.max(0.0);
        self.shortfall = (reachable - self.wheel_mps).abs() / self.truth.top_speed_mps;
        self.wheel_mps += (reachable - self.wheel_mps) * self.drive_response;
        if demanded == 0.0 {
            self.shortfall = 0.0;
            if self.wheel_mps.abs() < CREEP_MPS {
                self.wheel_mps = 0.0;
            }
        }
    }
}

/// The battery pack: sags with the current and with the charge used.
#[derive(Debug, Clone)]
pub(crate) struct Battery {
    truth: BatteryTruth,
    used_mah: f64,
    current_a: f64,
}

impl Battery {
    pub(crate) fn new(truth: &BatteryTruth) -> Self {
        Self { truth: truth.clone(), used_mah: 0.0, current_a: truth.electronics_a }
    }

    /// One step; at a dock the pack is charged until it is full, and after that only what is drawn is replaced.
    pub(crate) fn step(&mut self, drive: &Drive, at_dock: bool, dt_s: f64) {
        let cruise = drive.wheel_mps.abs() / drive.truth.top_speed_mps * self.truth.cruise_a;
        let drawn_a = self.truth.electronics_a + cruise + drive.shortfall * self.truth.surge_a;
        let given_a = match at_dock {
            false => 0.0,
            true if self.used_mah > 0.0 => self.truth.charge_a,
            true => drawn_a.min(self.truth.charge_a),
        };
        self.current_a = drawn_a - given_a;
        self.used_mah = (self.used_mah + self.current_a * dt_s / 3.6).max(0.0);
    }

    /// How much of its charge is left, 0..=1.
    pub(crate) fn left(&self) -> f64 {
        (1.0 - self.used_mah / self.truth.capacity_mah).max(0.0)
    }

    /// So much of its charge is left, 0..=1.
    pub(crate) fn set_left(&mut self, left: f64) {
        self.used_mah = self.truth.capacity_mah * (1.0 - left.clamp(0.0, 1.0));
    }

    /// Voltage at the terminals.
    pub(crate) fn volts(&self) -> f64 {
        let open_circuit = self.truth.empty_v + (self.truth.full_v - self.truth.empty_v) * self.left();
        (open_circuit - self.current_a * self.truth.resistance_ohm).max(0.0)
    }

    /// Voltage as a part of the full one.
    pub(crate) fn supply(&self) -> f64 {
        self.volts() / self.truth.full_v
    }

    pub(crate) fn millivolts(&self) -> u16 {
        // The last value of the range stands for "not fitted" on the line.
        (self.volts() * 1000.0).min(f64::from(u16::MAX - 1)) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 0.005;

    fn count(counts: u16) -> PwmCount {
        PwmCount::try_from(counts).unwrap()
    }

    fn drive() -> Drive {
        Drive::new(&DriveTruth::default(), DT_S)
    }

    #[test]
    fn the_dead_band_does_not_move_and_the_limits_reach_top_speed() {
        let drive = drive();
        assert_eq!(drive.demanded_mps(count(3750 + 75)), 0.0);
        assert_eq!(drive.demanded_mps(count(3750 - 75)), 0.0);
        assert!(drive.demanded_mps(count(3826)) > 0.0);
        assert!((drive.demanded_mps(PwmCount::MAX) - 3.0).abs() < 1e-12);
        assert!((drive.demanded_mps(PwmCount::MIN) + 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_lag_is_first_order() {
        let mut drive = drive();
        for _ in 0..50 {
            drive.step(PwmCount::MAX, 1.0, 0.0);
        }
        let expected = 3.0 * (1.0 - libm::exp(-1.0));
        assert!((drive.wheel_mps() - expected).abs() < 1e-9, "{}", drive.wheel_mps());
    }

    #[test]
    fn the_wheels_roll_no_farther_than_told_whatever_is_asked_for() {
        let mut drive = drive();
        let pulses = [PwmCount::MAX, PwmCount::MIN, count(4500), PwmCount::NEUTRAL, count(3000)];
        for round in 0..200 {
            // Straight down half of the time, on a slope of 8 degrees.
            let steepest = libm::sin(8.0_f64.to_radians());
            let steps = [10, 40][round % 2];
            let told_m = drive.farthest_m(steps as u64, steepest);
            let mut way_m = 0.0;
            for step in 0..steps {
                let pulse = pulses[(round * round / 3 + step / 7) % pulses.len()];
                drive.step(pulse, 1.0, if round % 4 < 2 { -steepest } else { steepest });
                way_m += drive.wheel_mps().abs() * DT_S;
            }
            assert!(way_m <= told_m, "{way_m} {told_m}");
        }
        let standing = Drive::new(&DriveTruth::default(), DT_S);
        assert!(standing.farthest_m(10, 0.0) < 0.02, "not at top speed at once");
    }

    #[test]
    fn an_opposite_pulse_brakes_to_a_standstill_before_it_reverses() {
        let mut drive = drive();
        for _ in 0..400 {
            drive.step(count(4500), 1.0, 0.0);
        }
        let (mut slowest_brake, mut speed) = (f64::MAX, drive.wheel_mps());
        assert!(speed > 1.0);
        let mut steps_to_reverse = 0;
        while drive.wheel_mps() >= 0.0 {
            drive.step(PwmCount::MIN, 1.0, 0.0);
            if drive.wheel_mps() > 0.02 {
                slowest_brake = slowest_brake.min(speed - drive.wheel_mps());
            }
            speed = drive.wheel_mps();
            steps_to_reverse += 1;
        }
        assert!(slowest_brake > 0.0, "never accelerates while braking");
        // ln(1.5 / 0.02) · 0.1 s; a drive without the brake would cross zero within 0.11 s.
        assert!(steps_to_reverse > 60, "{steps_to_reverse} steps");
        for _ in 0..400 {
            drive.step(PwmCount::MIN, 1.0, 0.0);
        }
        assert!((drive.wheel_mps() + 3.0).abs() < 0.01);
    }

    #[test]
    fn neutral_coasts_down_and_ends_standing() {
        let mut drive = drive();
        for _ in 0..400 {
            drive.step(count(4500), 1.0, 0.0);
        }
        let start = drive.wheel_mps();
        for _ in 0..50 {
            drive.step(PwmCount::NEUTRAL, 1.0, 0.0);
        }
        assert!((drive.wheel_mps() / start - libm::exp(-1.0)).abs() < 1e-6);
        for _ in 0..600 {
            drive.step(PwmCount::NEUTRAL, 1.0, 0.0);
        }
        assert_eq!(drive.wheel_mps(), 0.0);
    }

    #[test]
    fn the_battery_sags_under_load_and_empties() {
        let mut drive = drive();
        let mut battery = Battery::new(&BatteryTruth::default());
        battery.step(&drive, false, DT_S);
        let resting = battery.volts();
        drive.step(PwmCount::MAX, 1.0, 0.0);
        battery.step(&drive, false, DT_S);
        assert!(battery.volts() < resting - 1.0, "{}", battery.volts());
        battery.used_mah = 1e9;
        assert!(battery.volts() > 0.0 && battery.volts() < 6.6);
        assert!(battery.millivolts() > 4000);
    }

    #[test]
    fn a_dock_charges_the_pack_until_it_is_full_and_its_voltage_rises() {
        let (drive, truth) = (drive(), BatteryTruth::default());
        let mut battery = Battery::new(&truth);
        battery.set_left(0.5);
        let mut charge_s = |seconds: u32| {
            (0..seconds * 200).for_each(|_| battery.step(&drive, true, DT_S));
            (battery.volts(), battery.left())
        };
        let (early_v, _) = charge_s(10);
        let (later_v, left) = charge_s(60);
        assert!(later_v > early_v + 0.02 && left < 0.6, "{early_v} {later_v} {left}");
        // Half of it at what the dock gives less what the electronics draw, and a tenth more.
        let hour_s = 3.6 * truth.capacity_mah / (truth.charge_a - truth.electronics_a);
        let (full_v, left) = charge_s((0.6 * hour_s) as u32);
        assert!(left > 0.9999 && (full_v - truth.full_v).abs() < 0.3, "{full_v} {left}");
        assert!(charge_s(60).1 > 0.9999, "it stays full");
    }
}
