//! The memorandum's PID law, which §4.7 (speed) and §4.8.2 (platform) share.
//!
//! ```text
//!   A = K_P + 0.5 K_I t_s + K_D / t_s     B = 0.5 K_I t_s − K_D / t_s     C = K_I
//!   Σ[n] = Σ[n−1] + 0.5 (e[n] + e[n−1]) t_s
//!   corr = A e[n] + B e[n−1] + C Σ[n]
//! ```
//! As printed, the newest trapezoid enters twice (once in A and B, once in C Σ), which adds
//! K_I·t_s to K_P (10 % for the speed); kept as published.

/// K_P, K_I and K_D in counts per unit of error (and second).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// Proportional.
    pub kp: f64,
    /// Integral.
    pub ki: f64,
    /// Differential.
    pub kd: f64,
}

/// The law's memory: Σ e (in error units · s) and e[n−1].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pid {
    sum: f64,
    previous_error: f64,
}

impl Pid {
    /// Forgets Σ and e[n−1].
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// One sample: the correction in counts. `saturated` says whether a correction is beyond what
    /// the actuator can do; Σ is then not pushed further that way (ours: `|_| false` as published).
    pub fn step(&mut self, gains: Gains, t_s: f64, error: f64, saturated: impl Fn(f64) -> bool) -> f64 {
        let a = gains.kp + 0.5 * gains.ki * t_s + gains.kd / t_s;
        let b = 0.5 * gains.ki * t_s - gains.kd / t_s;
        let sum = self.sum + 0.5 * (error + self.previous_error) * t_s;
        let correction = |sum: f64| a * error + b * self.previous_error + gains.ki * sum;
        let wanted = correction(sum);
        let held = saturated(wanted) && wanted * error > 0.0;
        let result = if held { correction(self.sum) } else { wanted };
        if !held {
            self.sum = sum;
        }
        self.previous_error = error;
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAINS: Gains = Gains { kp: 10.0, ki: 20.0, kd: 0.1 };

    #[test]
    fn the_first_sample_is_the_printed_formula() {
        let mut pid = Pid::default();
        let t_s = 0.052_428_8;
        let corr = pid.step(GAINS, t_s, 13.0, |_| false);
        let a = 10.0 + 0.5 * 20.0 * t_s + 0.1 / t_s;
        assert!((corr - (a * 13.0 + 20.0 * 0.5 * 13.0 * t_s)).abs() < 1e-9);
    }

    #[test]
    fn the_sum_stands_still_while_saturated_in_the_errors_direction() {
        let (mut held, mut wound) = (Pid::default(), Pid::default());
        for _ in 0..200 {
            held.step(GAINS, 0.05, 300.0, |corr| corr.abs() > 1500.0);
            wound.step(GAINS, 0.05, 300.0, |_| false);
        }
        assert_eq!(held.sum, 0.0);
        assert!(wound.sum > 1000.0);
    }

    #[test]
    fn an_error_the_other_way_always_unwinds() {
        let mut pid = Pid { sum: 100.0, previous_error: 1.0 };
        pid.step(GAINS, 0.05, -1.0, |_| true);
        assert_eq!(pid.sum, 100.0, "the trapezoid of +1 and −1 is nothing");
        pid.step(GAINS, 0.05, -1.0, |_| true);
        assert!(pid.sum < 100.0);
    }
}
