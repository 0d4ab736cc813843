//! The obstacle rule (§4.6): anything nearer than 25 cm to the face of a bumper on one of its sensors.
//!
//! Ours: below 10 cm a GP2D12's voltage falls again and a touching wall reads as far away. A
//! sensor that was near and then suddenly reads "farther" stays near until the truck has backed off:
//! time proves nothing, since a wall that is touched reads clear for ever. `foldback_clear_s` above 0
//! lets time release it all the same.

use crate::infrared::BumperRanges;
use crate::units::Stamp;
use crate::vehicle::{BumperFinders, Obstacle, RangeFinder, SLOTS};

/// Which bumpers see an obstacle; four states (§4.6).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ObstacleState {
    /// Ahead.
    pub front: bool,
    /// Behind.
    pub rear: bool,
}

impl ObstacleState {
    /// Whether an obstacle lies in the driving direction of a reference of this sign.
    #[must_use]
    pub fn blocks(self, reference: f64) -> bool {
        (reference > 0.0 && self.front) || (reference < 0.0 && self.rear)
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Sensor {
    /// Travel towards this bumper's side, in m, when the sensor last read nearer than the fold-back limit.
    near_at_m: Option<f64>,
    clear_since: Option<Stamp>,
}

/// The sensors of one bumper.
#[derive(Debug, Clone, Default)]
pub struct Bumper {
    sensors: [Sensor; SLOTS],
}

impl Bumper {
    /// New ranges at `now`; `travel_m` counts the way driven *towards* this bumper's side.
    pub fn update(
        &mut self,
        config: &Obstacle,
        fitted: &BumperFinders,
        now: Stamp,
        ranges: &BumperRanges,
        travel_m: f64,
    ) -> bool {
        let mut obstacle = false;
        for ((sensor, range), finder) in self.sensors.iter_mut().zip(ranges).zip(&fitted.0) {
            obstacle |= sensor.is_near(config, finder, now, *range, travel_m);
        }
        obstacle
    }
}

impl Sensor {
    fn is_near(
        &mut self,
        config: &Obstacle,
        finder: &RangeFinder,
        now: Stamp,
        range: Option<f64>,
        travel_m: f64,
    ) -> bool {
        let near = range.is_some_and(|cm| finder.from_face_cm(cm) < config.threshold_cm);
        if !config.foldback_latch {
            return near;
        }
        if range.is_some_and(|cm| cm < finder.curve.folds_cm(config)) {
            *self = Self { near_at_m: Some(travel_m), clear_since: None };
        }
        let Some(near_at_m) = self.near_at_m else { return near };
        if near {
            self.clear_since = None;
        } else {
            let since = *self.clear_since.get_or_insert(now);
            let clear_long_enough =
                config.foldback_clear_s > 0.0 && now.since_s(since) >= config.foldback_clear_s;
            if clear_long_enough || near_at_m - travel_m >= config.foldback_retreat_m {
                *self = Self::default();
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: BumperRanges = [None; SLOTS];

    fn six() -> BumperFinders {
        BumperFinders::default()
    }

    fn one(cm: f64) -> BumperRanges {
        [None, None, Some(cm), None, None, None, None, None]
    }

    #[test]
    fn strictly_below_25_cm_is_an_obstacle() {
        let (config, mut bumper) = (Obstacle::default(), Bumper::default());
        assert!(!bumper.update(&config, &six(), Stamp::ZERO, &one(25.0), 0.0));
        assert!(bumper.update(&config, &six(), Stamp::ZERO, &one(24.999), 0.0));
        assert!(!bumper.update(&config, &six(), Stamp::ZERO, &one(25.0), 0.0));
    }

    #[test]
    fn clear_readings_never_release_the_latch() {
        let (config, mut bumper) = (Obstacle::default(), Bumper::default());
        assert!(bumper.update(&config, &six(), Stamp::from_ms(0), &one(12.0), 0.0));
        assert!(bumper.update(&config, &six(), Stamp::from_ms(40), &FAR, 0.0));
        assert!(bumper.update(&config, &six(), Stamp::from_ms(3_600_000), &FAR, 0.0), "an hour");
        assert!(!bumper.update(&config, &six(), Stamp::from_ms(3_600_040), &FAR, -0.05), "5 cm back");
    }

    #[test]
    fn a_time_that_is_configured_releases_the_latch() {
        let config = Obstacle { foldback_clear_s: 0.5, ..Obstacle::default() };
        let mut bumper = Bumper::default();
        assert!(bumper.update(&config, &six(), Stamp::from_ms(0), &one(12.0), 0.0));
        assert!(bumper.update(&config, &six(), Stamp::from_ms(40), &one(30.0), 0.0));
        assert!(bumper.update(&config, &six(), Stamp::from_ms(500), &FAR, 0.0));
        assert!(!bumper.update(&config, &six(), Stamp::from_ms(540), &FAR, 0.0));
    }

    #[test]
    fn backing_off_releases_the_latch() {
        let (config, mut bumper) = (Obstacle::default(), Bumper::default());
        assert!(bumper.update(&config, &six(), Stamp::from_ms(0), &one(12.0), 1.0));
        assert!(bumper.update(&config, &six(), Stamp::from_ms(40), &FAR, 0.96));
        assert!(!bumper.update(&config, &six(), Stamp::from_ms(80), &FAR, 0.95));
    }

    #[test]
    fn what_counts_is_the_way_from_the_bumpers_face() {
        let (config, mut bumper) =
            (Obstacle { foldback_latch: false, ..Obstacle::default() }, Bumper::default());
        let back = RangeFinder { ahead_m: -0.1, ..RangeFinder::at(0.0) };
        let aside = RangeFinder { turned_deg: -60.0, ..RangeFinder::at(-0.1) };
        let fitted = BumperFinders(vec![back, aside]);
        let mut sees = |first: f64, second: Option<f64>| {
            bumper.update(
                &config,
                &fitted,
                Stamp::ZERO,
                &[Some(first), second, Some(1.0), None, None, None, None, None],
                0.0,
            )
        };
        assert!(sees(34.9, None) && !sees(35.1, None), "10 cm of the beam lie on the car");
        assert!(sees(60.0, Some(49.9)) && !sees(60.0, Some(50.1)), "60° aside, half of it lies ahead");
    }

    #[test]
    fn without_the_latch_the_published_rule_stands() {
        let config = Obstacle { foldback_latch: false, ..Obstacle::default() };
        let mut bumper = Bumper::default();
        assert!(bumper.update(&config, &six(), Stamp::from_ms(0), &one(10.0), 0.0));
        assert!(!bumper.update(&config, &six(), Stamp::from_ms(40), &one(30.0), 0.0));
    }
}
