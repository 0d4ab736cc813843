//! The simulated truck's *true* values, each with unit, range, default and origin.
//!
//! They are apart from the agent's `VehicleConfig` on purpose: the controller has to cope with a
//! truck that is not quite what its configuration says. What differs from truck to truck (wheel
//! scale, yaw drift, sensor phases) is drawn from the seed within the tolerances given here.

use xtb_control::VehicleConfig;
use xtb_control::config::{
    Allowed::Range,
    ConfigError,
    Origin::{Assumed, DataSheet, Ours, Printed},
    Parameter,
};
use xtb_control::config_section;

config_section! {
    /// The body, seen from above; its centre lies midway between the axles.
    Body "body" {
        length_m: f64 = 0.50, "m", Range(0.1, 3.0), Assumed, "Bumper to bumper.";
        width_m: f64 = 0.40, "m", Range(0.1, 3.0), Assumed, "Tyre to tyre.";
        wheelbase_m: f64 = 0.286, "m", Range(0.05, 2.0), Assumed, "Distance between the axles.";
        track_m: f64 = 0.262, "m", Range(0.05, 2.0), Assumed, "Distance between the wheels of an axle.";
    }
}

config_section! {
    /// The steering servos of both axles.
    SteeringTruth "steering" {
        front_centre: f64 = 3710.0, "counts", Range(2331.0, 5272.0), Printed("Table 4"), "Front pulse that steers straight ahead.";
        rear_centre: f64 = 4179.0, "counts", Range(2331.0, 5272.0), Printed("Table 4"), "Rear pulse that steers straight ahead.";
        range_counts: f64 = 975.0, "counts", Range(1.0, 1400.0), Printed("§4.10 (5° · 195)"), "Counts from the centre to the stop.";
        stop_deg: f64 = 20.0, "deg", Range(1.0, 45.0), Assumed, "Wheel angle at the stop.";
        rate_dps: f64 = 200.0, "deg/s", Range(1.0, 2000.0), Assumed, "Fastest the wheels turn.";
        lag_s: f64 = 0.03, "s", Range(0.001, 1.0), Assumed, "First-order lag near the wanted angle.";
    }
}

config_section! {
    /// Motor and electronic speed control (ESC).
    DriveTruth "drive" {
        dead_band_counts: f64 = 75.0, "counts", Range(0.0, 500.0), Assumed, "Either side of neutral nothing moves (30 µs).";
        top_speed_mps: f64 = 3.0, "m/s", Range(0.1, 10.0), Assumed, "At the longest and at the shortest pulse, full battery.";
        lag_s: f64 = 0.25, "s", Range(0.01, 5.0), Assumed, "First-order lag of motor, ESC and mass; also of coasting down.";
        brake_lag_s: f64 = 0.10, "s", Range(0.01, 5.0), Assumed, "The same while the ESC brakes.";
        standstill_mps: f64 = 0.02, "m/s", Range(0.0001, 0.5), Assumed, "Below this an opposite pulse reverses instead of braking.";
        grade_effect: f64 = 1.0, "1/rad", Range(0.0, 5.0), Assumed, "Part of the speed lost per rad of slope uphill.";
    }
}

config_section! {
    /// The encoder on the motor shaft.
    EncoderTruth "encoder" {
        window_s: f64 = 0.052_428_8, "s", Range(0.005, 1.0), Printed("§4.2.3 (0x8000 · 64 / 40 MHz)"), "Length of the counting window.";
        pulses_per_rev: f64 = 60.0, "pulses", Range(1.0, 10_000.0), Printed("§2.2"), "Pulses per revolution of the motor shaft.";
        gear_ratio: f64 = 34.0, "motor turns per wheel turn", Range(1.0, 1000.0), Printed("§2.1"), "Gear box.";
        wheel_diameter_m: f64 = 0.1651, "m", Range(0.02, 1.0), Printed("§2.1 (6.5 in)"), "Nominal tyre diameter.";
        scale_tolerance: f64 = 0.02, "of the diameter", Range(0.0, 0.5), Assumed, "A truck's own tyres differ from nominal by up to this.";
    }
}

config_section! {
    /// The battery pack.
    BatteryTruth "battery" {
        full_v: f64 = 8.2, "V", Range(1.0, 60.0), Assumed, "Open-circuit voltage when full.";
        empty_v: f64 = 6.6, "V", Range(1.0, 60.0), Assumed, "Open-circuit voltage when empty.";
        capacity_mah: f64 = 3000.0, "mAh", Range(10.0, 100_000.0), Printed("§2.1"), "Charge.";
        resistance_ohm: f64 = 0.05, "Ω", Range(0.0, 5.0), Assumed, "Pack and leads.";
        electronics_a: f64 = 1.0, "A", Range(0.0, 50.0), Assumed, "Drawn while standing.";
        cruise_a: f64 = 10.0, "A", Range(0.0, 200.0), Assumed, "Drawn by the motor on top of that at top speed.";
        surge_a: f64 = 40.0, "A", Range(0.0, 500.0), Assumed, "Drawn in addition when asked for top speed at a standstill.";
    }
}

config_section! {
    /// The twelve GP2D12 range finders, six at the face of each bumper.
    InfraredTruth "infrared" {
        spacing_m: f64 = 0.07, "m", Range(0.01, 0.5), Printed("§2.2"), "Between neighbours of a bumper.";
        noise_v: f64 = 0.015, "V", Range(0.0, 0.5), Assumed, "Standard deviation of a reading.";
        refresh_s: f64 = 0.0383, "s", Range(0.005, 1.0), DataSheet("GP2D12"), "Mean time between two measurements.";
        refresh_tolerance_s: f64 = 0.0096, "s", Range(0.0, 0.5), DataSheet("GP2D12"), "A sensor's own period differs by up to this.";
        fold_back_cm: f64 = 8.0, "cm", Range(1.0, 20.0), DataSheet("GP2D12"), "Nearer than this the voltage falls again.";
        touch_v: f64 = 0.5, "V", Range(0.0, 2.0), Assumed, "At a distance of 0.";
        floor_min_v: f64 = 0.25, "V", Range(0.0, 0.5), DataSheet("GP2D12"), "Least voltage with nothing in sight.";
        floor_max_v: f64 = 0.35, "V", Range(0.0, 0.5), Assumed, "Most voltage with nothing in sight.";
    }
}

config_section! {
    /// The 3DM-G orientation sensor.
    GyroTruth "gyro" {
        yaw_drift_dps: f64 = 0.2, "deg/s", Range(0.0, 0.3), Assumed, "A truck's own drift lies between 0 and this (0.1 in the mean).";
        noise_deg: f64 = 0.05, "deg", Range(0.0, 5.0), Assumed, "Standard deviation of each angle.";
    }
}

config_section! {
    /// Tilt sensor and the four pistons of the platform.
    PlatformTruth "platform" {
        tilt_x_v_per_deg: f64 = 0.034_813, "V/deg", Range(0.001, 1.0), Printed("§4.8.1"), "Sensitivity about x (pitch).";
        tilt_y_v_per_deg: f64 = 0.033_934, "V/deg", Range(0.001, 1.0), Printed("§4.8.1"), "Sensitivity about y (roll).";
        tilt_x_zero_v: f64 = 2.525, "V", Range(0.0, 5.0), Printed("§4.8.1"), "Voltage when level, x.";
        tilt_y_zero_v: f64 = 2.503, "V", Range(0.0, 5.0), Printed("§4.8.1"), "Voltage when level, y.";
        piston_travel_m: f64 = 0.04, "m", Range(0.001, 1.0), Assumed, "From end to end, 0..1024 counts of its sensor.";
        piston_mps_per_count: f64 = 1.0e-5, "m/s per count", Range(0.0, 0.01), Assumed, "Speed per count away from 1.5 ms; longer pulses lift.";
    }
}

config_section! {
    /// The I/O board.
    BoardTruth "board" {
        pwm_period_s: f64 = 0.0222, "s", Range(0.005, 1.0), Printed("§4.1"), "New pulses take effect when a period ends.";
        adc_period_s: f64 = 0.038, "s", Range(0.005, 1.0), Printed("§4.5"), "Between two scans.";
        watchdog_s: f64 = 0.1, "s", Range(0.02, 10.0), Ours, "Without a good frame for this long the motor goes neutral.";
    }
}

/// Everything that is true of a simulated truck, before its individual deviations.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TruckParameters {
    /// The body.
    pub body: Body,
    /// Steering servos.
    pub steering: SteeringTruth,
    /// Motor and ESC.
    pub drive: DriveTruth,
    /// Encoder.
    pub encoder: EncoderTruth,
    /// Battery.
    pub battery: BatteryTruth,
    /// Range finders.
    pub infrared: InfraredTruth,
    /// Orientation sensor.
    pub gyro: GyroTruth,
    /// Tilt sensor and pistons.
    pub platform: PlatformTruth,
    /// I/O board.
    pub board: BoardTruth,
}

impl TruckParameters {
    /// The truck that an agent with this configuration believes to sit in: the defaults, with the
    /// agent's dimensions, steering and encoder taken for nominal.
    #[must_use]
    pub fn for_vehicle(config: &VehicleConfig) -> Self {
        let mut truth = Self::default();
        let (geometry, steering) = (&config.geometry, &config.steering);
        truth.body = Body {
            length_m: geometry.body_length_m,
            width_m: geometry.body_width_m,
            wheelbase_m: geometry.wheelbase_m,
            track_m: geometry.track_m,
        };
        truth.steering.front_centre = steering.front_centre;
        truth.steering.rear_centre = steering.rear_centre;
        truth.steering.range_counts = steering.range_counts;
        truth.steering.stop_deg = steering.stop_deg;
        truth.encoder.window_s = config.encoder.window_s;
        truth.encoder.pulses_per_rev = config.encoder.pulses_per_rev;
        truth.encoder.gear_ratio = config.encoder.gear_ratio;
        truth.encoder.wheel_diameter_m = geometry.wheel_diameter_m;
        truth
    }

    /// Every parameter with its present value, section by section.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        [
            self.body.parameters(),
            self.steering.parameters(),
            self.drive.parameters(),
            self.encoder.parameters(),
            self.battery.parameters(),
            self.infrared.parameters(),
            self.gyro.parameters(),
            self.platform.parameters(),
            self.board.parameters(),
        ]
        .concat()
    }

    /// Checks each parameter against its range, then what only holds between two of them.
    ///
    /// # Errors
    /// The first violation, naming field, value and what is allowed.
    pub fn validate(&self) -> Result<(), ConfigError> {
        xtb_control::config::validate(&self.parameters())?;
        let (infrared, battery) = (&self.infrared, &self.battery);
        let conflict = |name: &str, value: f64, reason: &str| {
            Err(ConfigError::Conflict {
                name: name.into(),
                value: format!("{value:?}"),
                reason: reason.into(),
            })
        };
        if infrared.refresh_tolerance_s >= infrared.refresh_s {
            let reason = "must be smaller than infrared.refresh_s";
            return conflict("infrared.refresh_tolerance_s", infrared.refresh_tolerance_s, reason);
        }
        if infrared.floor_min_v > infrared.floor_max_v {
            let reason = "must not be above infrared.floor_max_v";
            return conflict("infrared.floor_min_v", infrared.floor_min_v, reason);
        }
        if battery.empty_v > battery.full_v {
            return conflict("battery.empty_v", battery.empty_v, "must not be above battery.full_v");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_valid_and_agree_with_the_agents() {
        TruckParameters::default().validate().unwrap();
        assert_eq!(TruckParameters::for_vehicle(&VehicleConfig::default()), TruckParameters::default());
    }

    #[test]
    fn a_value_out_of_range_is_named() {
        let mut truth = TruckParameters::default();
        truth.drive.lag_s = f64::NAN;
        assert!(truth.validate().unwrap_err().to_string().contains("drive.lag_s"));
        truth = TruckParameters::default();
        truth.infrared.floor_min_v = 0.4;
        assert!(truth.validate().unwrap_err().to_string().contains("floor_max_v"));
    }
}
