//! True curves of the range finders: voltage over distance.
//!
//! The GP2D12's is counts = 6787 / (cm + 4) + 3 beyond its peak. Those of its successors are read off the typical
//! graphs of their data sheets, straight from point to point: not the curves that the agent takes them for.

use crate::parameters::InfraredTruth;
use xtb_control::range_curve::RangeCurve;
use xtb_control::units::{ADC_FULL_SCALE, ADC_SUPPLY_V};

/// Of a GP2Y0A21YK0F, in cm and V.
const GP2Y0A21: [(f64, f64); 15] = [
    (0.0, 0.5),
    (3.0, 1.9),
    (6.0, 3.15),
    (7.0, 3.0),
    (8.0, 2.75),
    (10.0, 2.3),
    (15.0, 1.65),
    (20.0, 1.3),
    (25.0, 1.08),
    (30.0, 0.92),
    (40.0, 0.73),
    (50.0, 0.6),
    (60.0, 0.51),
    (70.0, 0.45),
    (80.0, 0.4),
];
/// Of a GP2Y0A02YK0F.
const GP2Y0A02: [(f64, f64); 15] = [
    (0.0, 0.5),
    (10.0, 2.2),
    (15.0, 2.75),
    (20.0, 2.5),
    (30.0, 2.0),
    (40.0, 1.55),
    (50.0, 1.25),
    (60.0, 1.07),
    (70.0, 0.92),
    (80.0, 0.82),
    (90.0, 0.73),
    (100.0, 0.66),
    (120.0, 0.55),
    (140.0, 0.46),
    (150.0, 0.43),
];

/// Farther than this its curve lies below any floor voltage, in m.
pub(crate) fn sight_m(curve: RangeCurve) -> f64 {
    match curve {
        RangeCurve::Gp2d12 | RangeCurve::Gp2y0a21 => 1.2,
        RangeCurve::Gp2y0a02 => 2.2,
    }
}

/// Voltage for an object at `cm`.
pub(crate) fn curve_v(truth: &InfraredTruth, curve: RangeCurve, cm: f64) -> f64 {
    match curve {
        RangeCurve::Gp2d12 => gp2d12_v(truth, cm),
        RangeCurve::Gp2y0a21 => between(&GP2Y0A21, cm),
        RangeCurve::Gp2y0a02 => between(&GP2Y0A02, cm),
    }
}

/// counts = 6787 / (cm + 4) + 3 beyond the peak, and a straight line down to `touch_v` below it.
fn gp2d12_v(truth: &InfraredTruth, cm: f64) -> f64 {
    let beyond_peak_v = |cm: f64| (6787.0 / (cm + 4.0) + 3.0) * ADC_SUPPLY_V / ADC_FULL_SCALE;
    if cm >= truth.fold_back_cm {
        return beyond_peak_v(cm);
    }
    let peak_v = beyond_peak_v(truth.fold_back_cm);
    truth.touch_v + (peak_v - truth.touch_v) * cm.max(0.0) / truth.fold_back_cm
}

/// On the straight line between the two points around it; beyond the last one it falls as one over the distance.
fn between(points: &[(f64, f64)], cm: f64) -> f64 {
    let next = points.iter().position(|point| point.0 > cm);
    match next.map(|next| (points.get(next.wrapping_sub(1)), points.get(next))) {
        Some((Some(from), Some(to))) => from.1 + (to.1 - from.1) * (cm - from.0) / (to.0 - from.0),
        Some(_) => points.first().map_or(0.0, |first| first.1),
        None => points.last().map_or(0.0, |last| last.1 * last.0 / cm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::units::AdcCount;
    use xtb_control::vehicle::Infrared;

    #[test]
    fn the_curve_peaks_at_8_cm_and_folds_back_to_the_touch_voltage() {
        let truth = InfraredTruth::default();
        let peak = curve_v(&truth, RangeCurve::Gp2d12, 8.0);
        assert!((2.7..2.8).contains(&peak), "{peak}");
        assert!(
            curve_v(&truth, RangeCurve::Gp2d12, 4.0) < peak
                && curve_v(&truth, RangeCurve::Gp2d12, 12.0) < peak
        );
        assert!((curve_v(&truth, RangeCurve::Gp2d12, 7.999_999) - peak).abs() < 1e-5, "continuous");
        assert_eq!(curve_v(&truth, RangeCurve::Gp2d12, 0.0), 0.5);
        let data_sheet = curve_v(&truth, RangeCurve::Gp2d12, 80.0);
        assert!((0.25..0.55).contains(&data_sheet), "{data_sheet}");
    }

    /// The distance that the agent makes of one.
    fn told_cm(curve: RangeCurve, cm: f64) -> Option<f64> {
        let volts = curve_v(&InfraredTruth::default(), curve, cm);
        let reading = AdcCount::try_from((volts * ADC_FULL_SCALE / ADC_SUPPLY_V).floor()).unwrap();
        curve.hypotenuse_cm(&Infrared::default(), reading)
    }

    #[test]
    fn what_the_agent_makes_of_the_successors_voltages_is_little_too_far_and_not_much_too_near() {
        for (curve, from_cm, to_cm) in [(RangeCurve::Gp2y0a21, 10, 75), (RangeCurve::Gp2y0a02, 21, 140)] {
            for cm in (from_cm..to_cm).map(f64::from) {
                let told = told_cm(curve, cm).unwrap();
                let off = (told - cm) / cm;
                assert!((-0.13..0.06).contains(&off), "{curve:?}: {cm} cm read as {told}");
                // What the obstacle rule is about.
                assert!(cm > 40.0 || told < cm + 1.0, "{curve:?}: {cm} cm read as {told}");
            }
        }
    }

    #[test]
    fn a_successor_folds_back_where_the_agent_does_not_trust_it() {
        for (curve, folds_cm) in [(RangeCurve::Gp2y0a21, 7.0), (RangeCurve::Gp2y0a02, 15.0)] {
            let peak_v = curve_v(&InfraredTruth::default(), curve, folds_cm);
            assert!(peak_v > curve_v(&InfraredTruth::default(), curve, folds_cm / 3.0));
            assert!(peak_v <= curve.most_v());
            assert!(folds_cm < curve.near_cm(&Infrared::default()));
        }
    }
}
