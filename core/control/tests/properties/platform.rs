//! Tilt sensor and both platform controllers (§4.8).

use crate::any::{adc_count, adc_sample, config};
use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::balance::balance;
use xtb_control::controller::AdcSample;
use xtb_control::pistons::{height_m, limited, standing};
use xtb_control::platform_pid::PlatformPid;
use xtb_control::tilt::{TiltAngles, tilt_angles};
use xtb_control::vehicle::{Line, Platform, VehicleConfig};
use xtb_control::{AdcCount, Controller, PwmCount, Sample, Stamp};

fn angles() -> impl Strategy<Value = TiltAngles> {
    let angle =
        || prop_oneof![8 => (-90.0..=90.0).prop_map(Some), 4 => (-1.0..=1.0).prop_map(Some), 1 => Just(None)];
    (angle(), angle()).prop_map(|(x, y)| TiltAngles { x, y })
}

fn positions() -> impl Strategy<Value = [AdcCount; 4]> {
    prop::array::uniform4(adc_count())
}

/// A pulse that drives a piston further into an end that it has reached.
fn drives_on(config: &VehicleConfig, line: Line, position: AdcCount, pulse: PwmCount) -> bool {
    let height_m = height_m(&config.pistons, position);
    // Rounding to whole counts is no movement.
    let offset = pulse.as_f64() - line.count(0.0);
    let upwards = offset * line.slope.signum();
    (height_m >= config.pistons.max_m && upwards > 0.5)
        || (height_m <= config.pistons.min_m && upwards < -0.5)
}

/// Every pulse is within the speed limit, and none drives on at an end.
fn check(
    config: &VehicleConfig,
    positions: &[AdcCount; 4],
    pulses: &[PwmCount; 4],
) -> Result<(), TestCaseError> {
    for (i, line) in config.calibration.pistons().into_iter().enumerate() {
        let offset = (pulses[i].as_f64() - line.count(0.0)).abs();
        prop_assert!(offset <= config.pistons.max_offset_counts + 0.5, "piston {i}: {offset}");
        prop_assert!(!drives_on(config, line, positions[i], pulses[i]), "piston {i}: {pulses:?}");
    }
    Ok(())
}

proptest! {
    #[test]
    fn an_angle_is_finite_or_there_is_none(config in config(), x in adc_count(), y in adc_count()) {
        let tilt = tilt_angles(&config.tilt, &[x, y]);
        let sine = (x.volts() - config.tilt.x_zero_v) / config.tilt.x_v_per_deg.to_degrees();
        prop_assert_eq!(tilt.x.is_none(), sine.abs() > 1.0);
        for angle in [tilt.x, tilt.y].into_iter().flatten() {
            prop_assert!((-90.0..=90.0).contains(&angle));
        }
        prop_assert!(tilt.x.is_none_or(|deg| (deg.to_radians().sin() - sine).abs() < 1e-9));
    }

    #[test]
    fn the_limits_hold_for_every_line_height_and_wish(
        config in config(), positions in positions(), wanted in -1.0e9..=1.0e9,
    ) {
        let lines = config.calibration.pistons();
        let pulses: Vec<_> = (0..4)
            .map(|i| limited(&config.pistons, lines[i], height_m(&config.pistons, positions[i]), wanted))
            .collect();
        check(&config, &positions, &pulses.try_into().unwrap())?;
    }

    #[test]
    fn the_balance_controller_never_drives_a_piston_on_at_its_end(
        config in config(), tilt in angles(), positions in positions(),
    ) {
        let lines = config.calibration.pistons();
        check(&config, &positions, &balance(&config, &lines, tilt, &positions))?;
    }

    #[test]
    fn the_platform_pid_never_drives_a_piston_on_at_its_end(
        config in config(), scans in vec((angles(), positions()), 1..40),
    ) {
        let (lines, mut pid) = (config.calibration.pistons(), PlatformPid::default());
        for (tilt, positions) in scans {
            check(&config, &positions, &pid.step(&config, &lines, tilt, &positions))?;
        }
    }

    #[test]
    fn nor_does_the_whole_controller_in_either_way(config in config(), scans in vec(adc_sample(), 1..20)) {
        for platform in [Platform::Balance, Platform::Pid, Platform::Off] {
            let config = VehicleConfig { platform, ..config.clone() };
            let mut controller = Controller::new(config.clone());
            for (i, scan) in scans.iter().enumerate() {
                let out = controller.step(Stamp::from_ms(38 * i as u64), &Sample::Adc(*scan));
                check(&config, &scan.pistons, &out.pwm.pistons)?;
                let stands = platform == Platform::Off || out.tilt.both().is_none();
                prop_assert!(!stands || out.pwm.pistons == config.calibration.pistons().map(standing));
            }
        }
    }

    #[test]
    fn without_an_angle_the_pistons_stand_and_the_pid_forgets(
        before in vec(angles(), 0..20), y in -90.0..=90.0, positions in positions(), missing_x: bool,
    ) {
        let config = VehicleConfig::default();
        let lines = config.calibration.pistons();
        let tilt = if missing_x {
            TiltAngles { x: None, y: Some(y) }
        } else {
            TiltAngles { x: Some(y), y: None }
        };
        prop_assert_eq!(balance(&config, &lines, tilt, &positions), [PwmCount::NEUTRAL; 4]);
        let mut pid = PlatformPid::default();
        for tilt in before {
            pid.step(&config, &lines, tilt, &positions);
        }
        prop_assert_eq!(pid.step(&config, &lines, tilt, &positions), [PwmCount::NEUTRAL; 4]);
        prop_assert_eq!(pid, PlatformPid::default());
    }

    #[test]
    fn inside_0_8_degrees_on_both_axes_the_balance_controller_stops_all_pistons(
        x in -0.8..=0.8, y in -0.8..=0.8, positions in positions(),
    ) {
        let config = VehicleConfig::default();
        let tilt = TiltAngles { x: Some(x), y: Some(y) };
        let pulses = balance(&config, &config.calibration.pistons(), tilt, &positions);
        prop_assert_eq!(pulses, [PwmCount::NEUTRAL; 4]);
    }

    #[test]
    fn both_lift_the_lower_end_or_side_of_a_platform_in_its_middle(deg in 0.81..45.0, down: bool, pitch: bool) {
        let config = VehicleConfig::default();
        let lines = config.calibration.pistons();
        let sign = if down { 1.0 } else { -1.0 };
        let (x, y) = if pitch { (sign * deg, 0.0) } else { (0.0, sign * deg) };
        let tilt = TiltAngles { x: Some(x), y: Some(y) };
        let middle = [AdcCount::try_from(512_u16).unwrap(); 4];
        let balance = balance(&config, &lines, tilt, &middle);
        let pid = PlatformPid::default().step(&config, &lines, tilt, &middle);
        for pulses in [balance, pid] {
            let [fl, fr, rl, rr] = pulses.map(|pulse| (pulse.as_f64() - 3750.0) * sign);
            let (lower, upper) = if pitch { ([fl, fr], [rl, rr]) } else { ([fl, rl], [fr, rr]) };
            prop_assert!(lower[0] > 0.0 && lower[0] == lower[1], "{pulses:?}");
            prop_assert!(upper[0] < 0.0 && upper[0] == upper[1], "{pulses:?}");
        }
    }

    #[test]
    fn the_pistons_have_nothing_to_do_with_driving(scans in vec(adc_sample(), 1..20)) {
        let run = |platform| {
            let mut controller = Controller::new(VehicleConfig { platform, ..VehicleConfig::default() });
            let step = |(i, scan): (usize, &AdcSample)| {
                let pwm = controller.step(Stamp::from_ms(38 * i as u64), &Sample::Adc(*scan)).pwm;
                (pwm.motor, pwm.steer_front, pwm.steer_rear)
            };
            scans.iter().enumerate().map(step).collect::<Vec<_>>()
        };
        prop_assert_eq!(run(Platform::Balance), run(Platform::Off));
    }
}
