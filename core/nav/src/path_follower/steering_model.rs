//! Where the wheels should be by now: the servos' limited rate and lag, in terms of curvature.

use super::FollowerSettings;

/// Within this part of full lock the wheels are turned: 0.4° of an XTB's 20°, less than the linkage's play (±
/// 0.5°, assumed).
const TURNED_PART: f64 = 0.02;

/// A model of the steering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SteeringModel {
    /// Curvature that the wheels stand for.
    curvature_per_m: f64,
    /// For how long they have been where they were wanted.
    turned_for_s: f64,
}

impl SteeringModel {
    /// Straight ahead, as far as one knows.
    pub(super) fn new() -> Self {
        Self { curvature_per_m: 0.0, turned_for_s: 0.0 }
    }

    /// Something else is wanted from now on.
    pub(super) fn turn_anew(&mut self) {
        self.turned_for_s = 0.0;
    }

    /// `dt_s` later, with `wanted_per_m` commanded all the while; full lock is `most_per_m`.
    pub(super) fn step(
        &mut self,
        settings: &FollowerSettings,
        dt_s: f64,
        wanted_per_m: f64,
        most_per_m: f64,
    ) {
        let missing = wanted_per_m - self.curvature_per_m;
        let lagged = missing * (1.0 - libm::exp(-dt_s / settings.servo_lag_s));
        let most = if settings.lock_s > 0.0 { most_per_m * dt_s / settings.lock_s } else { f64::INFINITY };
        self.curvature_per_m += lagged.clamp(-most, most);
        let turned = (wanted_per_m - self.curvature_per_m).abs() <= TURNED_PART * most_per_m;
        self.turned_for_s = if turned { self.turned_for_s + dt_s } else { 0.0 };
    }

    /// Whether the wheels are where they were wanted, the command's way to them included.
    pub(super) fn are_turned(&self, settings: &FollowerSettings) -> bool {
        self.turned_for_s > settings.servo_delay_s + settings.turned_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_lock_to_lock_they_take_as_long_as_the_servos_do() {
        let settings = FollowerSettings::default();
        let mut wheels = SteeringModel::new();
        (0..100).for_each(|_| wheels.step(&settings, 0.01, -2.5, 2.5));
        assert!(wheels.are_turned(&settings));
        let steps = (1..100).find(|_| {
            wheels.step(&settings, 0.01, 2.5, 2.5);
            wheels.are_turned(&settings)
        });
        // 0.2 s at the limited rate, the lag's tail, the command's way and the pause.
        assert!((30..45).contains(&steps.unwrap()), "{steps:?}");
    }
}
