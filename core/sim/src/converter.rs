//! The converter's sums: 64 readings of each slow voltage, spread over the scan.
//!
//! So what a frame says of tilt and pistons is the mean of the scan's 38 ms, not what is so at its end. It is
//! complete a step before the agent has it: a frame is on the line for 4 ms. Range finders, which measure by
//! themselves as seldom as a scan comes, are read once.

use crate::gyro::Attitude;
use crate::infrared::adc_count;
use crate::platform::Platform;
use xtb_control::units::AdcCount;
use xtb_protocol::board::ADC_SCANS;

/// Voltages of tilt sensor x and y and of the pistons' position sensors.
type Volts = [f64; 6];

/// The mean since the last frame.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sums {
    /// At the end of the last step, with the posture that gives them: most trucks keep it for long.
    last: Option<([f64; 6], Volts)>,
    mean: Volts,
    steps: u32,
    /// Whether anything has changed since the last frame.
    changed: bool,
}

impl Sums {
    /// Goes on by a step, at whose end the truck lies like this.
    pub(crate) fn step(&mut self, platform: &Platform, ground: &Attitude) {
        let posture = platform.posture(ground);
        let (began, ended) = match self.last {
            Some((same, volts)) if same == posture && !self.changed => {
                (self.mean, self.steps) = (volts, self.steps + 1);
                return;
            }
            Some((same, volts)) if same == posture => (volts, volts),
            Some((_, before)) => (before, volts(platform, ground)),
            None => [volts(platform, ground); 2].into(),
        };
        self.last = Some((posture, ended));
        (self.steps, self.changed) = (self.steps + 1, true);
        let part = 1.0 / f64::from(self.steps);
        for ((mean, began), ended) in self.mean.iter_mut().zip(began).zip(ended) {
            let during = (began + ended) / 2.0;
            // Exact also if nothing has changed.
            *mean = if self.steps == 1 { during } else { *mean + (during - *mean) * part };
        }
    }

    /// What the converter makes of tilt sensor and pistons, and begins again.
    pub(crate) fn take(&mut self, platform: &Platform, ground: &Attitude) -> ([AdcCount; 2], [AdcCount; 4]) {
        let mean = if self.steps == 0 { volts(platform, ground) } else { self.mean };
        (self.steps, self.changed) = (0, false);
        let [x, y, fl, fr, rl, rr] = mean.map(|v| adc_count(v, f64::from(ADC_SCANS)));
        ([x, y], [fl, fr, rl, rr])
    }
}

fn volts(platform: &Platform, ground: &Attitude) -> Volts {
    let ([x, y], [fl, fr, rl, rr]) = (platform.tilt_v(ground), platform.positions_v());
    [x, y, fl, fr, rl, rr]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::{Body, PlatformTruth};
    use crate::rng::Rng;
    use xtb_control::PwmCount;

    const LEVEL: Attitude = Attitude { heading_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
    const UPHILL: Attitude = Attitude { pitch_deg: 4.0, ..LEVEL };
    /// Steps in a scan.
    const SCAN: u32 = 8;

    fn platform() -> Platform {
        Platform::new(&PlatformTruth::default(), &Body::default(), &mut Rng::new(3, 0))
    }

    fn alone(platform: &Platform, ground: &Attitude) -> ([AdcCount; 2], [AdcCount; 4]) {
        Sums::default().take(platform, ground)
    }

    #[test]
    fn what_stays_as_it_is_is_read_as_it_is() {
        let (platform, mut sums) = (platform(), Sums::default());
        assert_eq!(alone(&platform, &LEVEL).1.map(AdcCount::get), [512.0; 4]);
        for _ in 0..3 {
            (0..SCAN).for_each(|_| sums.step(&platform, &UPHILL));
            assert_eq!(sums.take(&platform, &UPHILL), alone(&platform, &UPHILL));
        }
    }

    #[test]
    fn a_slope_that_comes_within_a_scan_is_shown_by_its_part() {
        let (platform, mut sums) = (platform(), Sums::default());
        let volts = |ground| alone(&platform, ground).0[0].volts();
        for level in [1, 4, 7] {
            (0..SCAN).for_each(|_| sums.step(&platform, &LEVEL));
            sums.take(&platform, &LEVEL);
            (0..level).for_each(|_| sums.step(&platform, &LEVEL));
            (level..SCAN).for_each(|_| sums.step(&platform, &UPHILL));
            let shown = sums.take(&platform, &UPHILL).0[0].volts();
            let part = (shown - volts(&LEVEL)) / (volts(&UPHILL) - volts(&LEVEL));
            // It came between two steps.
            let expected = (f64::from(SCAN - level) - 0.5) / f64::from(SCAN);
            assert!((part - expected).abs() < 0.01, "{part} after {level} of {SCAN} steps");
        }
    }

    #[test]
    fn a_piston_that_moves_evenly_is_read_half_a_scan_late() {
        let (mut platform, mut sums) = (platform(), Sums::default());
        let mut lift = || {
            platform.step(&[PwmCount::saturating(3950.0); 4], 0.005);
            let at = platform.positions_v()[0];
            (at, platform.clone())
        };
        sums.step(&lift().1, &LEVEL);
        sums.take(&lift().1, &LEVEL);
        let heights: Vec<f64> = (0..SCAN)
            .map(|_| {
                let (at, platform) = lift();
                sums.step(&platform, &LEVEL);
                at
            })
            .collect();
        let (end, a_step) = (heights[heights.len() - 1], heights[1] - heights[0]);
        let shown = sums.take(&lift().1, &LEVEL).1[0].volts();
        let late = (end - shown) / a_step;
        assert!((late - f64::from(SCAN) / 2.0).abs() < 0.7, "{late} steps");
    }
}
