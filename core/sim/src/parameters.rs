//! The simulated truck's *true* values, each with unit, range, default and origin.
//!
//! They are apart from the agent's `VehicleConfig` on purpose: the controller has to cope with a
//! truck that is not quite what its configuration says. What differs from truck to truck (wheel
//! scale, servo lines, piston curves, yaw drift, sensor phases) is drawn from the seed within the
//! tolerances given here.

use xtb_control::config::{
    Allowed::{OneOf, Range, Switch},
    ConfigError,
    DefaultOrigin::{Assumed, DataSheet, Printed},
    Parameter,
};
use xtb_control::vehicle::{Drivetrain, Imu, ImuYaw, RangeFinders};
use xtb_control::{VehicleConfig, config_section};

config_section! {
    /// The body, seen from above, and which axles steer.
    Body "body" {
        drivetrain: Drivetrain = Drivetrain::BothAxles, "", OneOf(&Drivetrain::WORDS), Printed("§2.1"), "Which axles steer: both, in opposite directions, or the front one.";
        length_m: f64 = 0.50, "m", Range(0.1, 3.0), Assumed, "Bumper to bumper.";
        width_m: f64 = 0.40, "m", Range(0.1, 3.0), Assumed, "Tyre to tyre.";
        wheelbase_m: f64 = 0.286, "m", Range(0.05, 2.0), Assumed, "Distance between the axles.";
        track_m: f64 = 0.262, "m", Range(0.05, 2.0), Assumed, "Distance between the wheels of an axle.";
        ahead_m: f64 = 0.0, "m", Range(-1.0, 1.0), Assumed, "From midway between the axles ahead to the middle of the body.";
    }
}

impl Body {
    /// One that reaches as far from its reference point as any of these, ahead, astern and to the sides; without
    /// any, the default.
    #[must_use]
    pub fn around<'a>(bodies: impl Iterator<Item = &'a Self>) -> Self {
        let larger = |a: Self, b: Self| {
            let (front_m, rear_m) = (a.front_m().max(b.front_m()), a.rear_m().max(b.rear_m()));
            let (length_m, ahead_m) = (front_m + rear_m, (front_m - rear_m) / 2.0);
            Self {
                drivetrain: Drivetrain::BothAxles,
                length_m,
                ahead_m,
                width_m: a.width_m.max(b.width_m),
                ..a
            }
        };
        bodies.cloned().reduce(larger).unwrap_or_default()
    }

    /// From the reference point ahead to the middle of the body, in m.
    pub(crate) fn middle_m(&self) -> f64 {
        self.drivetrain.midway_m(self.wheelbase_m) + self.ahead_m
    }

    /// From the reference point to the front bumper, in m.
    pub(crate) fn front_m(&self) -> f64 {
        self.length_m / 2.0 + self.middle_m()
    }

    /// From the reference point back to the rear bumper, in m.
    pub(crate) fn rear_m(&self) -> f64 {
        self.length_m / 2.0 - self.middle_m()
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
        play_deg: f64 = 0.5, "deg", Range(0.0, 5.0), Assumed, "Play of the linkage either side (the hysteresis of Annex A.2).";
        centre_tolerance_counts: f64 = 15.0, "counts", Range(0.0, 300.0), Assumed, "An axle's own centre differs from nominal by up to this.";
        slope_tolerance: f64 = 0.03, "of the slope", Range(0.0, 0.5), Assumed, "An axle's own angle per count differs from nominal by up to this.";
    }
}

config_section! {
    /// The servos that tilt the bumpers.
    BumperTruth "bumper" {
        deg_per_count: f64 = 0.036, "deg/count", Range(0.001, 0.1), Assumed, "Angle per count, + = up (90° a millisecond, as hobby servos turn).";
        zero_count: f64 = 3750.0, "counts", Range(2331.0, 5272.0), Assumed, "Pulse that points the range finders straight ahead.";
        stop_deg: f64 = 60.0, "deg", Range(1.0, 80.0), Assumed, "Angle at the stop, either way.";
        rate_dps: f64 = 260.87, "deg/s", Range(1.0, 2000.0), Assumed, "Fastest turn (0.23 s/60°, printed for the suspension's servos in §2.1).";
        zero_tolerance_counts: f64 = 15.0, "counts", Range(0.0, 300.0), Assumed, "A bumper's own zero differs from nominal by up to this.";
        slope_tolerance: f64 = 0.03, "of the slope", Range(0.0, 0.5), Assumed, "A bumper's own angle per count differs from nominal by up to this.";
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
    /// The encoder on the motor shaft. Its counting window is that of the board's set-up.
    EncoderTruth "encoder" {
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
        electronics_a: f64 = 1.0, "A", Range(0.0, 50.0), Assumed, "Drawn at standstill.";
        cruise_a: f64 = 10.0, "A", Range(0.0, 200.0), Assumed, "Drawn by the motor on top of that at top speed.";
        surge_a: f64 = 40.0, "A", Range(0.0, 500.0), Assumed, "Drawn in addition when asked for top speed at a standstill.";
        charge_a: f64 = 6.0, "A", Range(0.0, 100.0), Assumed, "What a dock gives until the pack is full (2 C, as fast chargers do).";
    }
}

config_section! {
    /// What all range finders have in common; which are fitted, and where, is in `range_finders`.
    InfraredTruth "infrared" {
        lens_m: f64 = 0.0075, "m", Range(0.0, 0.02), Assumed, "Width of the beam at the lens.";
        noise_v: f64 = 0.015, "V", Range(0.0, 0.5), Assumed, "Standard deviation of a reading.";
        refresh_s: f64 = 0.0383, "s", Range(0.005, 1.0), DataSheet("GP2D12"), "Mean time between two measurements.";
        refresh_tolerance_s: f64 = 0.0096, "s", Range(0.0, 0.5), DataSheet("GP2D12"), "A sensor's own period differs by up to this.";
        fold_back_cm: f64 = 8.0, "cm", Range(1.0, 20.0), DataSheet("GP2D12"), "Nearer than this the voltage of a GP2D12 falls again.";
        touch_v: f64 = 0.5, "V", Range(0.0, 2.0), Assumed, "Of a GP2D12 at a distance of 0.";
        floor_min_v: f64 = 0.25, "V", Range(0.0, 0.5), DataSheet("GP2D12"), "Least voltage with nothing in sight.";
        floor_max_v: f64 = 0.35, "V", Range(0.0, 0.5), Assumed, "Most voltage with nothing in sight.";
    }
}

config_section! {
    /// The orientation sensor.
    GyroTruth "gyro" {
        imu: Imu = Imu::ThreeDmG, "", OneOf(&Imu::WORDS), Printed("§2.2"), "Which unit is fitted.";
        imu_yaw: ImuYaw = ImuYaw::CounterClockwise, "", OneOf(&ImuYaw::WORDS), DataSheet("BNO080, §4"), "Which way the yaw of a BNO085 grows, seen from above.";
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
        piston_mps_per_count: f64 = 5.0e-5, "m/s per count", Range(0.0, 0.01), Assumed, "Speed per count beyond the dead band around 1.5 ms; longer pulses lift.";
        piston_dead_band_counts: f64 = 12.0, "counts", Range(0.0, 500.0), Assumed, "Either side of zero movement nothing moves.";
        piston_flat_counts: f64 = 1000.0, "counts", Range(10.0, 5000.0), Assumed, "So far beyond the dead band the curve of the 4th order (Annex A.3) is flat.";
        piston_load_effect: f64 = 0.03, "of the speed", Range(0.0, 0.5), Assumed, "Lifting is slower by this, lowering faster.";
        piston_zero_tolerance_counts: f64 = 10.0, "counts", Range(0.0, 300.0), Assumed, "A piston's own zero movement differs from 1.5 ms by up to this.";
        piston_gain_tolerance: f64 = 0.1, "of the slope", Range(0.0, 0.5), Assumed, "A piston's own speed per count differs from nominal by up to this.";
    }
}

config_section! {
    /// The R/C transmitter and receiver, and how the TPU's NITC function reads the pulses (§4.2.2).
    ReceiverTruth "receiver" {
        fitted: bool = true, "", Switch, Printed("§2.1"), "Whether the truck has a receiver.";
        period_s: f64 = 0.0222, "s", Range(0.005, 0.1), Printed("§4.2.2"), "Between two pulses of a channel.";
        centre_ms: f64 = 1.5, "ms", Range(1.0, 2.0), Printed("§2.1"), "Pulse of a centred stick.";
        stroke_ms: f64 = 0.5, "ms", Range(0.05, 0.6), Printed("§2.1 (1.0 to 2.0 ms)"), "Longest way of a stick's pulse from its centre.";
        manual_ms: f64 = 1.2, "ms", Range(0.8, 2.2), Assumed, "Pulse of the selector on manual.";
        automatic_ms: f64 = 1.8, "ms", Range(0.8, 2.2), Assumed, "Pulse of the selector on automatic.";
        jitter_ticks: f64 = 1.0, "ticks", Range(0.0, 100.0), Assumed, "A pulse differs by up to this, beside the rounding to whole ticks.";
        wrong_edge: f64 = 0.5, "", Range(0.0, 1.0), Assumed, "Probability that a channel starts on the other edge (§4.2.2 says that it happens).";
        glitch_every_s: f64 = 60.0, "s", Range(0.1, 1.0e9), Assumed, "Mean time until a channel gets into the 420 % state (§4.2.2 says that it happens).";
        interference: f64 = 0.0, "", Range(0.0, 1.0), Assumed, "Probability that a single pulse is not seen.";
    }
}

config_section! {
    /// What a person measures with while calibrating (Annex A).
    InstrumentTruth "instruments" {
        wheel_noise_deg: f64 = 0.3, "deg", Range(0.0, 10.0), Assumed, "Standard deviation of a wheel angle read from lines on the floor.";
        bumper_noise_deg: f64 = 0.3, "deg", Range(0.0, 10.0), Assumed, "Standard deviation of a bumper angle read from a protractor.";
    }
}

config_section! {
    /// The I/O board. Its PWM period, encoder window and watchdog are those of the set-up it gets.
    BoardTruth "board" {
        adc_period_s: f64 = 0.038, "s", Range(0.005, 1.0), Printed("§4.5"), "Between two scans.";
        answers_asks: bool = false, "", Switch, Assumed, "Its firmware is 1.1 (1.2 with more than six range finders on a bumper): it says who it is, whether its emergency stop is pressed, and what its BNO085 or its range finders beyond the sixth measure. Else 1.0.";
    }
}

/// Everything that is true of a simulated truck, before its individual deviations.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TruckParameters {
    /// The body.
    pub body: Body,
    /// Steering servos and linkages.
    pub steering: SteeringTruth,
    /// Bumper servos.
    pub bumper: BumperTruth,
    /// Motor and ESC.
    pub drive: DriveTruth,
    /// Encoder.
    pub encoder: EncoderTruth,
    /// Battery.
    pub battery: BatteryTruth,
    /// Range finders.
    pub infrared: InfraredTruth,
    /// Those that are fitted.
    pub range_finders: RangeFinders,
    /// Orientation sensor.
    pub gyro: GyroTruth,
    /// Tilt sensor and pistons.
    pub platform: PlatformTruth,
    /// R/C receiver.
    pub receiver: ReceiverTruth,
    /// I/O board.
    pub board: BoardTruth,
    /// Protractors.
    pub instruments: InstrumentTruth,
}

impl TruckParameters {
    /// A truck that is what an agent's configuration says, where it says something of the truck; else the defaults.
    #[must_use]
    pub fn of(vehicle: &VehicleConfig) -> Self {
        let VehicleConfig { geometry, steering, encoder, tilt, pistons, .. } = vehicle;
        let body = Body {
            drivetrain: vehicle.drivetrain,
            length_m: geometry.body_length_m,
            width_m: geometry.body_width_m,
            wheelbase_m: geometry.wheelbase_m,
            track_m: geometry.track_m,
            ahead_m: geometry.body_ahead_m,
        };
        let mut truth = Self { body, ..Self::default() };
        truth.range_finders = vehicle.range_finders.clone();
        truth.receiver.fitted = vehicle.remote.enabled;
        (truth.gyro.imu, truth.gyro.imu_yaw) = (vehicle.imu, vehicle.imu_yaw);
        truth.board.answers_asks = vehicle.imu == Imu::Bno085Rvc || vehicle.range_finders.need_wide_scan();
        truth.steering.front_centre = steering.front_centre;
        truth.steering.rear_centre = steering.rear_centre;
        truth.steering.range_counts = steering.range_counts;
        truth.steering.stop_deg = steering.stop_deg;
        truth.encoder.pulses_per_rev = encoder.pulses_per_rev;
        truth.encoder.gear_ratio = encoder.gear_ratio;
        truth.encoder.wheel_diameter_m = geometry.wheel_diameter_m;
        truth.platform.tilt_x_zero_v = tilt.x_zero_v;
        truth.platform.tilt_y_zero_v = tilt.y_zero_v;
        truth.platform.tilt_x_v_per_deg = tilt.x_v_per_deg;
        truth.platform.tilt_y_v_per_deg = tilt.y_v_per_deg;
        truth.platform.piston_travel_m = pistons.travel_m;
        truth
    }

    /// Every parameter with its present value, section by section.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        [
            self.body.parameters(),
            self.steering.parameters(),
            self.bumper.parameters(),
            self.drive.parameters(),
            self.encoder.parameters(),
            self.battery.parameters(),
            self.infrared.parameters(),
            self.range_finders.parameters(),
            self.gyro.parameters(),
            self.platform.parameters(),
            self.receiver.parameters(),
            self.board.parameters(),
            self.instruments.parameters(),
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
    fn the_defaults_are_valid_and_nominally_what_an_agent_believes() {
        let (truth, config) = (TruckParameters::default(), VehicleConfig::default());
        truth.validate().unwrap();
        assert_eq!(truth, TruckParameters::of(&config));
    }

    #[test]
    fn the_nominal_lines_are_those_of_an_uncalibrated_agent() {
        let (truth, config) = (TruckParameters::default(), VehicleConfig::default());
        let [front, rear] = config.calibration.steering();
        let steering = &truth.steering;
        assert_eq!((steering.front_centre, steering.rear_centre), (3710.0, 4179.0));
        assert_eq!((steering.range_counts, steering.stop_deg), (975.0, 20.0));
        let at_the_stop = (front.at(3710.0 - 975.0), rear.at(4179.0 - 975.0));
        assert!((at_the_stop.0 - 20.0).abs() < 1e-9 && (at_the_stop.1 - 20.0).abs() < 1e-9);
        for line in config.calibration.bumpers() {
            assert!((line.at(truth.bumper.zero_count)).abs() < 1e-9);
            assert_eq!(line.slope, truth.bumper.deg_per_count);
        }
        for line in config.calibration.pistons() {
            assert!((line.at(3750.0)).abs() < 1e-9);
            assert_eq!(line.slope, truth.platform.piston_mps_per_count);
        }
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
