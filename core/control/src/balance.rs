//! Balance controller (§4.8.3, Fig. 14), the preferred one: levels the platform and keeps the
//! pistons near their middle, at each converter scan.
//!
//! ```text
//!   Δh_FR = ( lΦx − wΦy)/2   Δh_FL = ( lΦx + wΦy)/2        Δh' = Δh − μ, μ = mean of the four
//!   Δh_RR = (−lΦx − wΦy)/2   Δh_RL = (−lΦx + wΦy)/2        Δz  = K Δh' + mp − z
//!   PWM = A Δz/Δt + B, A and B of each piston from the calibration (Annex A.3)
//! ```
//! Reading: Φ in **radians** (the small-angle step needs it; the unit list says degrees: erratum).
//! Within ±0.8° on both axes all pistons stop. Each position is the mean of 64 scans.

use crate::pistons::{height_m, limited, standing};
use crate::tilt::TiltAngles;
use crate::units::{AdcCount, PwmCount};
use crate::vehicle::{Line, VehicleConfig};

/// Pulses of the pistons FL, FR, RL, RR for one scan.
#[must_use]
pub fn balance(
    vehicle: &VehicleConfig,
    lines: &[Line; 4],
    tilt: TiltAngles,
    positions: &[AdcCount; 4],
) -> [PwmCount; 4] {
    let config = &vehicle.balance;
    let level_enough = |deg: f64| deg.abs() <= config.tolerance_deg;
    let Some((x_deg, y_deg)) = tilt.both().filter(|(x, y)| !(level_enough(*x) && level_enough(*y))) else {
        return lines.map(standing);
    };
    let pitch_m = vehicle.geometry.wheelbase_m * x_deg.to_radians();
    let roll_m = vehicle.geometry.track_m * y_deg.to_radians();
    let rise_m = [pitch_m + roll_m, pitch_m - roll_m, -pitch_m + roll_m, -pitch_m - roll_m].map(|h| h / 2.0);
    let mean_m = rise_m.iter().sum::<f64>() / 4.0;
    let mut pulses = [PwmCount::NEUTRAL; 4];
    for (i, pulse) in pulses.iter_mut().enumerate() {
        let z_m = height_m(&vehicle.pistons, positions[i]);
        let dz_m = config.convergence * (rise_m[i] - mean_m) + vehicle.pistons.middle_m - z_m;
        *pulse = limited(&vehicle.pistons, lines[i], z_m, lines[i].count(dz_m / config.dt_s));
    }
    pulses
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pulses(x_deg: f64, y_deg: f64) -> [u16; 4] {
        let vehicle = VehicleConfig::default();
        let lines = vehicle.calibration.pistons();
        let tilt = TiltAngles { x: Some(x_deg), y: Some(y_deg) };
        let middle = [AdcCount::try_from(512_u16).unwrap(); 4];
        balance(&vehicle, &lines, tilt, &middle).map(PwmCount::get)
    }

    #[test]
    fn inside_the_tolerance_of_both_axes_all_pistons_stop() {
        assert_eq!(pulses(0.8, -0.8), [3750; 4]);
        assert_ne!(pulses(0.81, 0.0), [3750; 4]);
    }

    #[test]
    fn nose_down_lifts_the_front_and_left_down_lifts_the_left() {
        let [fl, fr, rl, rr] = pulses(1.0, 0.0);
        assert!(fl == fr && rl == rr && fl > 3750 && rl < 3750);
        let [fl, fr, rl, rr] = pulses(0.0, 1.0);
        assert!(fl == rl && fr == rr && fl > 3750 && fr < 3750);
    }

    #[test]
    fn without_an_angle_the_pistons_stand() {
        let vehicle = VehicleConfig::default();
        let lines = vehicle.calibration.pistons();
        let tilt = TiltAngles { x: None, y: Some(10.0) };
        let end = [AdcCount::try_from(1023_u16).unwrap(); 4];
        assert_eq!(balance(&vehicle, &lines, tilt, &end), [PwmCount::NEUTRAL; 4]);
    }
}
