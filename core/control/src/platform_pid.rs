//! Platform PID (§4.8.2, Fig. 15): one [`Pid`] an axis towards level, at each converter scan.
//!
//! ```text
//!   Q_RR = zero + c_x + c_y   Q_RL = zero + c_x − c_y      c = PID of e = 0 − Φ, in degrees
//!   Q_FR = zero − c_x + c_y   Q_FL = zero − c_x − c_y
//! ```
//! Reading: t_s is its own sample period (the memorandum copies the encoder's; `published.toml` keeps
//! that). Without an angle on either axis the pistons get their zero value and the PID is reset.

use crate::pid::{Gains, Pid};
use crate::pistons::{height_m, limited, standing};
use crate::tilt::TiltAngles;
use crate::units::{AdcCount, PwmCount};
use crate::vehicle::{Line, VehicleConfig};

/// Memory of both axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlatformPid {
    x: Pid,
    y: Pid,
}

impl PlatformPid {
    /// Pulses of the pistons FL, FR, RL, RR for one scan.
    pub fn step(
        &mut self,
        vehicle: &VehicleConfig,
        lines: &[Line; 4],
        tilt: TiltAngles,
        positions: &[AdcCount; 4],
    ) -> [PwmCount; 4] {
        let Some((x_deg, y_deg)) = tilt.both() else {
            *self = Self::default();
            return lines.map(standing);
        };
        let config = &vehicle.platform_pid;
        let gains = Gains { kp: config.kp, ki: config.ki, kd: config.kd };
        let limit = vehicle.pistons.max_offset_counts;
        let saturated = |correction: f64| config.anti_windup && correction.abs() > limit;
        let x = self.x.step(gains, config.sample_s, 0.0 - x_deg, saturated);
        let y = self.y.step(gains, config.sample_s, 0.0 - y_deg, saturated);
        let corrections = [-x - y, -x + y, x - y, x + y];
        let mut pulses = [PwmCount::NEUTRAL; 4];
        for (i, pulse) in pulses.iter_mut().enumerate() {
            let z_m = height_m(&vehicle.pistons, positions[i]);
            // A correction upwards is a longer pulse; on a piston mounted the other way, a shorter one.
            let offset = corrections[i] * lines[i].slope.signum();
            *pulse = limited(&vehicle.pistons, lines[i], z_m, lines[i].count(0.0) + offset);
        }
        pulses
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(pid: &mut PlatformPid, vehicle: &VehicleConfig, x: Option<f64>, y: Option<f64>) -> [u16; 4] {
        let lines = vehicle.calibration.pistons();
        let middle = [AdcCount::try_from(512_u16).unwrap(); 4];
        pid.step(vehicle, &lines, TiltAngles { x, y }, &middle).map(PwmCount::get)
    }

    #[test]
    fn nose_down_lifts_the_front_and_left_down_lifts_the_left() {
        let vehicle = VehicleConfig::default();
        let [fl, fr, rl, rr] = step(&mut PlatformPid::default(), &vehicle, Some(0.5), Some(0.0));
        assert!(fl == fr && rl == rr && fl > 3750 && rl < 3750);
        let [fl, fr, rl, rr] = step(&mut PlatformPid::default(), &vehicle, Some(0.0), Some(0.5));
        assert!(fl == rl && fr == rr && fl > 3750 && fr < 3750);
    }

    #[test]
    fn a_missing_angle_stops_the_pistons_and_forgets_the_sum() {
        let vehicle = VehicleConfig::default();
        let mut pid = PlatformPid::default();
        for _ in 0..100 {
            step(&mut pid, &vehicle, Some(1.0), Some(1.0));
        }
        assert_eq!(step(&mut pid, &vehicle, None, Some(1.0)), [3750; 4]);
        assert_eq!(pid, PlatformPid::default());
    }
}
