//! In which directions a car sees where it goes, and so may drive by itself.

use super::{RangeFinders, VehicleConfig};

/// By hand a car goes no faster than this in a direction in which it has no range finder, in m/s: whoever drives looks,
/// and it stands within some centimetres. Chosen, not measured.
pub const UNSEEN_MPS: f64 = 0.1;

/// Directions in which a car may drive by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gears {
    /// Ahead.
    pub ahead: bool,
    /// Astern.
    pub astern: bool,
}

impl Gears {
    /// Either way.
    pub const BOTH: Self = Self { ahead: true, astern: true };

    /// Whether that is either way.
    #[must_use]
    pub fn are_both(self) -> bool {
        self.ahead && self.astern
    }

    /// Whether there is any.
    #[must_use]
    pub fn is_any(self) -> bool {
        self.ahead || self.astern
    }

    /// Whether the direction of a speed or a way of this sign is among them, + = ahead; standing always is.
    #[must_use]
    pub fn allow(self, signed: f64) -> bool {
        (self.ahead || signed <= 0.0) && (self.astern || signed >= 0.0)
    }

    /// The bumper without range finders, in words, if there is one.
    #[must_use]
    pub fn unseen(self) -> Option<&'static str> {
        match (self.ahead, self.astern) {
            (true, true) => None,
            (true, false) => Some("the rear bumper has no range finder"),
            (false, true) => Some("the front bumper has no range finder"),
            (false, false) => Some("no bumper has a range finder"),
        }
    }
}

impl RangeFinders {
    /// The directions that a range finder looks in.
    #[must_use]
    pub fn gears(&self) -> Gears {
        Gears { ahead: !self.front.0.is_empty(), astern: !self.rear.0.is_empty() }
    }
}

impl VehicleConfig {
    /// The fastest speed by hand of a sign, + = ahead, in m/s: what the obstacle rule can stop from, or
    /// [`UNSEEN_MPS`] where no range finder looks.
    #[must_use]
    pub fn by_hand_mps(&self, signed: f64) -> f64 {
        let admitted_mps = self.admitted_mps();
        if self.range_finders.gears().allow(signed) { admitted_mps } else { admitted_mps.min(UNSEEN_MPS) }
    }

    /// What is driven of a wheel speed that is asked for by hand, in rpm: all of it, or a crawl where no range finder
    /// looks.
    #[must_use]
    pub fn by_hand_rpm(&self, rpm: f64) -> f64 {
        if self.range_finders.gears().allow(rpm) {
            return rpm;
        }
        let most_rpm = self.by_hand_mps(rpm) / self.mps_per_rpm();
        rpm.clamp(-most_rpm, most_rpm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::BumperFinders;

    #[test]
    fn a_bumper_without_range_finders_takes_its_direction_and_standing_is_always_allowed() {
        let none = BumperFinders(Vec::new());
        let of = |front: bool, rear: bool| {
            let mut fitted = RangeFinders::default();
            for (side, is_fitted) in [(&mut fitted.front, front), (&mut fitted.rear, rear)] {
                if !is_fitted {
                    *side = none.clone();
                }
            }
            fitted.gears()
        };
        assert_eq!(of(true, true), Gears::BOTH);
        for (gears, allowed) in [
            (of(true, true), [true; 3]),
            (of(true, false), [false, true, true]),
            (of(false, true), [true, true, false]),
            (of(false, false), [false, true, false]),
        ] {
            assert_eq!([-0.1, 0.0, 0.1].map(|mps| gears.allow(mps)), allowed, "{gears:?}");
            assert_eq!(gears.unseen().is_none(), gears.are_both());
        }
    }

    #[test]
    fn by_hand_it_crawls_where_no_range_finder_looks() {
        let mut config = VehicleConfig::default();
        config.range_finders.rear = BumperFinders(Vec::new());
        config.validate().unwrap();
        assert_eq!((config.by_hand_mps(1.0), config.by_hand_mps(-1.0)), (config.admitted_mps(), UNSEEN_MPS));
        config.range_finders.front = BumperFinders(Vec::new());
        config.validate().unwrap();
        assert_eq!((config.by_hand_mps(1.0), config.admitted_mps()), (UNSEEN_MPS, UNSEEN_MPS));
    }
}
