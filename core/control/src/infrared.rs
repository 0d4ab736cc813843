//! Infrared ranging (§4.5, Fig. 11): voltages of the range finders to horizontal distances.
//!
//! Readings: the sixth-order fit holds for 0.42..=2.35 V only. Its minimum is at 2.356 V and above
//! it *rises* (2.8 V gives 27 cm: a touched wall would count as clear), so above 2.35 V an object
//! is "too close", 9.74 cm. Below 0.42 V nothing is in range. Other parts: [`crate::range_curve`].

use crate::gp2d12::fit_cm;
use crate::units::AdcCount;
use crate::vehicle::{BumperFinders, Infrared, SLOTS};

/// Between neighbours of an XTB's range finders, in m (§2.2).
pub const SPACING_M: f64 = 0.07;

/// Horizontal distances of one bumper in cm, left to right, each along its beam; `None` = nothing in range, or
/// nothing fitted.
pub type BumperRanges = [Option<f64>; SLOTS];

/// Length of the hypotenuse in cm that one reading of a GP2D12 stands for.
#[must_use]
pub fn hypotenuse_cm(config: &Infrared, reading: AdcCount) -> Option<f64> {
    let volts = reading.volts();
    if volts < config.far_v {
        None
    } else if volts > config.near_v {
        Some(config.near_cm)
    } else {
        Some(fit_cm(volts))
    }
}

/// hyp · cos θ for the sensors of a bumper tilted by `angle_deg` (§4.5).
#[must_use]
pub fn bumper_ranges(
    config: &Infrared,
    fitted: &BumperFinders,
    angle_deg: f64,
    readings: &[AdcCount; SLOTS],
) -> BumperRanges {
    let cos = libm::cos(angle_deg.to_radians());
    std::array::from_fn(|slot| {
        let hyp = fitted.get(slot)?.curve.hypotenuse_cm(config, readings[slot]);
        hyp.map(|hyp| hyp * cos)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn above_the_turning_point_a_reading_is_never_clear() {
        let config = Infrared::default();
        for counts in 0..=1023_u16 {
            let reading = AdcCount::try_from(counts).unwrap();
            let hyp = hypotenuse_cm(&config, reading);
            if reading.volts() > 2.35 {
                assert_eq!(hyp, Some(9.74));
            } else if reading.volts() < 0.42 {
                assert_eq!(hyp, None);
            } else {
                assert!((9.7..60.0).contains(&hyp.unwrap()), "{counts}: {hyp:?}");
            }
        }
    }
}
