//! What only holds between two constants: axles within the body, speeds that the obstacle rule can stop, stops in their
//! order, calibrations that fit the servos, pins that do not share a channel.

use crate::config::ConfigError;
use crate::speed::MAX_WINDOW_PULSES;
use crate::tpu::TpuSetup;
use crate::units::PwmCount;
use crate::vehicle::VehicleConfig;

/// A servo whose quantity changes less per count than this does not move.
const MIN_SLOPE: f64 = 1.0e-6;
/// A steering centre may be this far from where the calibration has it.
const MAX_CENTRE_DEG: f64 = 3.0;

impl VehicleConfig {
    /// Checks each parameter against its range, then what only holds between two of them.
    ///
    /// # Errors
    /// The first violation, naming field, value and what is allowed.
    pub fn validate(&self) -> Result<(), ConfigError> {
        crate::config::validate(&self.parameters())?;
        let admitted_rpm = self.admitted_mps() / self.mps_per_rpm();
        for (name, rpm) in [
            ("goto.reference_rpm", self.goto.reference_rpm),
            ("wander.reference_rpm", self.wander.reference_rpm),
            ("teleop.max_rpm", self.teleop.max_rpm),
        ] {
            if rpm > admitted_rpm && self.range_finders.gears().is_any() {
                return Err(ConfigError::Conflict {
                    name: name.into(),
                    value: format!("{rpm:?}"),
                    reason: format!(
                        "the {} cm obstacle rule stops in time only up to {admitted_rpm:.1} rpm; \
                         for more, raise obstacle.threshold_cm",
                        self.obstacle.threshold_cm
                    ),
                });
            }
        }
        self.validate_body()?;
        self.validate_range_finders()?;
        self.validate_encoder()?;
        self.validate_order()?;
        self.validate_calibration()?;
        TpuSetup::of(self).map(drop)
    }

    /// The axles and the tyres stand within the body.
    fn validate_body(&self) -> Result<(), ConfigError> {
        let geometry = &self.geometry;
        let within = |name: &str, value: f64, most_name: &str, most: f64| match value > most {
            true => Err(conflict(name, value, format!("it must not be more than {most_name}, {most:?}"))),
            false => Ok(()),
        };
        within(
            "geometry.wheelbase_m",
            geometry.wheelbase_m,
            "geometry.body_length_m",
            geometry.body_length_m,
        )?;
        within("geometry.track_m", geometry.track_m, "geometry.body_width_m", geometry.body_width_m)?;
        let most_m = (geometry.body_length_m - geometry.wheelbase_m) / 2.0;
        if geometry.body_ahead_m.abs() > most_m {
            let reason = format!(
                "an axle would be outside the body; with geometry.body_length_m {:?} and geometry.wheelbase_m {:?} \
                 it is at most {most_m:.3} either way",
                geometry.body_length_m, geometry.wheelbase_m
            );
            return Err(conflict("geometry.body_ahead_m", geometry.body_ahead_m, reason));
        }
        Ok(())
    }

    /// The board's frame holds the pulses of a window at top speed.
    fn validate_encoder(&self) -> Result<(), ConfigError> {
        let encoder = &self.encoder;
        let per_turn = encoder.pulses_per_rev * encoder.gear_ratio;
        let pulses = self.guard.top_rpm / 60.0 * per_turn * encoder.window_s;
        if pulses > f64::from(MAX_WINDOW_PULSES) {
            let reason = format!(
                "with encoder.gear_ratio {:?} a window has {pulses:.0} pulses at guard.top_rpm {:?}; the board \
                 sends up to {MAX_WINDOW_PULSES}",
                encoder.gear_ratio, self.guard.top_rpm
            );
            return Err(conflict("encoder.pulses_per_rev", encoder.pulses_per_rev, reason));
        }
        Ok(())
    }

    /// The range finders stand within the body, and none shows what counts as a short circuit.
    fn validate_range_finders(&self) -> Result<(), ConfigError> {
        let (width_m, guard) = (self.geometry.body_width_m, &self.guard);
        for (name, finders) in [
            ("range_finders.front", &self.range_finders.front),
            ("range_finders.rear", &self.range_finders.rear),
        ] {
            for finder in &finders.0 {
                if 2.0 * finder.left_m.abs() > width_m {
                    let reason = format!("left_m is beside the body, geometry.body_width_m {width_m:?}");
                    return Err(conflict(name, finder.left_m, reason));
                }
                let (curve, most_v) = (finder.curve, finder.curve.most_v());
                if most_v > guard.infrared_max_v {
                    let reason = format!("with {} in {name} it must be at least {most_v:?}", curve.word());
                    return Err(conflict("guard.infrared_max_v", guard.infrared_max_v, reason));
                }
            }
        }
        Ok(())
    }

    fn validate_order(&self) -> Result<(), ConfigError> {
        let pistons = &self.pistons;
        for (name, below, above) in [
            ("pistons.middle_m", pistons.min_m, pistons.middle_m),
            ("pistons.max_m", pistons.middle_m, pistons.max_m),
            ("pistons.travel_m", pistons.max_m, pistons.travel_m),
            ("infrared.near_v", self.infrared.far_v, self.infrared.near_v),
            ("remote.max_duty_pct", self.remote.min_duty_pct, self.remote.max_duty_pct),
            ("battery.finish_v", self.battery.stop_v, self.battery.finish_v),
            ("battery.warn_v", self.battery.finish_v, self.battery.warn_v),
        ] {
            if below >= above {
                return Err(conflict(name, above, format!("it must be more than {below}")));
            }
        }
        Ok(())
    }

    fn validate_calibration(&self) -> Result<(), ConfigError> {
        let calibration = &self.calibration;
        let centres = [self.steering.front_centre, self.steering.rear_centre];
        let angles = [self.bumpers.front_deg, self.bumpers.rear_deg];
        let lines = [
            ("steering_front", calibration.steering()[0], centres[0]),
            ("steering_rear", calibration.steering()[1], centres[1]),
            ("bumper_front", calibration.bumpers()[0], calibration.bumpers()[0].count(angles[0])),
            ("bumper_rear", calibration.bumpers()[1], calibration.bumpers()[1].count(angles[1])),
            ("piston_fl", calibration.pistons()[0], calibration.pistons()[0].count(0.0)),
            ("piston_fr", calibration.pistons()[1], calibration.pistons()[1].count(0.0)),
            ("piston_rl", calibration.pistons()[2], calibration.pistons()[2].count(0.0)),
            ("piston_rr", calibration.pistons()[3], calibration.pistons()[3].count(0.0)),
        ];
        for (name, line, working_count) in lines {
            let slope = format!("calibration.{name}_slope");
            if line.slope.abs() < MIN_SLOPE {
                return Err(conflict(&slope, line.slope, "the servo does not move".into()));
            }
            let (min, max) = (PwmCount::MIN.as_f64(), PwmCount::MAX.as_f64());
            if !(min..=max).contains(&working_count) {
                let reason = format!("it would need count {working_count:.0}, servos accept {min}..={max}");
                return Err(conflict(&format!("calibration.{name}_intercept"), line.intercept, reason));
            }
        }
        for (name, line, centre) in [("front", lines[0].1, centres[0]), ("rear", lines[1].1, centres[1])] {
            let angle_deg = line.at(centre);
            if angle_deg.abs() > MAX_CENTRE_DEG {
                let reason = format!("the calibration gives {angle_deg:.1} deg there; straight is 0");
                return Err(conflict(&format!("steering.{name}_centre"), centre, reason));
            }
        }
        Ok(())
    }
}

fn conflict(name: &str, value: f64, reason: String) -> ConfigError {
    ConfigError::Conflict { name: name.to_owned(), value: format!("{value:?}"), reason }
}
