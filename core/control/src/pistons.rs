//! Limits of the four suspension pistons (§4.8.2, §4.8.3): both platform controllers end here.
//!
//! "When a piston end is reached, the PWM value is set to stop the servo in the end direction", and
//! "the pulse width is also limited to avoid excessive servo speed". The end stops and the speed
//! limit are not printed. Order of the pistons everywhere: FL, FR, RL, RR.

use crate::units::{AdcCount, PwmCount};
use crate::vehicle::{Line, Pistons};

/// Resolution of the converter (§4.5).
const RESOLUTION: f64 = 1024.0;

/// Height of a piston in m from its position sensor: counts / 1024 of the travel.
#[must_use]
pub fn height_m(config: &Pistons, reading: AdcCount) -> f64 {
    reading.get() / RESOLUTION * config.travel_m
}

/// The pulse that a piston at `height_m` gets when its controller wants `counts`: within the speed
/// limit around zero movement, never further into an end stop.
#[must_use]
pub fn limited(config: &Pistons, line: Line, height_m: f64, counts: f64) -> PwmCount {
    let zero = line.count(0.0);
    let counts = counts.clamp(zero - config.max_offset_counts, zero + config.max_offset_counts);
    let upwards = (counts - zero) * line.slope > 0.0;
    let at_end = if upwards { height_m >= config.max_m } else { height_m <= config.min_m };
    PwmCount::saturating(if at_end { zero } else { counts })
}

/// The pulse at which a piston stands.
#[must_use]
pub fn standing(line: Line) -> PwmCount {
    PwmCount::saturating(line.count(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Calibration;

    #[test]
    fn a_piston_at_its_end_stop_is_never_driven_on() {
        let config = Pistons::default();
        let line = Calibration::default().pistons()[0];
        let counts = |height_m, wanted| limited(&config, line, height_m, wanted).get();
        assert_eq!(counts(0.038, 4000.0), 3750);
        assert_eq!(counts(0.038, 3500.0), 3500, "away from the stop it may go");
        assert_eq!(counts(0.002, 3500.0), 3750);
        assert_eq!(counts(0.002, 4000.0), 4000);
        assert_eq!((counts(0.02, 9e9), counts(0.02, -9e9)), (4150, 3350));
    }

    #[test]
    fn a_piston_mounted_the_other_way_round_stops_at_the_right_end() {
        let (config, line) = (Pistons::default(), Line { slope: -5.0e-5, intercept: 0.1875 });
        assert_eq!(limited(&config, line, 0.038, 3500.0).get(), 3750);
        assert_eq!(limited(&config, line, 0.038, 4000.0).get(), 4000);
        assert_eq!(limited(&config, line, 0.002, 4000.0).get(), 3750);
    }
}
