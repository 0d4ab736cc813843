//! Where something thin was met, like the leg of a table: only one beam at a time has seen it, or none.
//!
//! The place is remembered when its obstacle is long gone, since others of its kind stand around: one leg of a
//! table is easily missed by the beams that pass it later. What turns out to be broad is forgotten.

use crate::geometry::apart_m;
use xtb_control::units::Stamp;

/// Most places; beyond, the oldest goes. A bound: the legs of 16 tables.
const MOST: usize = 64;
/// As near as this it is the same thing, in m; chosen, not measured.
const SAME_M: f64 = 0.2;
/// As near as this to something broad it belongs to it, in m: its corner, or another truck's; chosen, not
/// measured.
pub(super) const BROAD_M: f64 = 0.3;

#[derive(Debug, Clone, Default)]
pub(super) struct ThinObstacles {
    /// Place, and when something was seen there last.
    places: Vec<([f64; 2], Stamp)>,
}

impl ThinObstacles {
    /// Something was seen there, by one beam or by none.
    pub(super) fn meet(&mut self, now: Stamp, at: [f64; 2]) {
        self.forget(at);
        if self.places.len() == MOST {
            self.places.remove(0);
        }
        self.places.push((at, now));
    }

    /// It was not there after all.
    pub(super) fn forget(&mut self, at: [f64; 2]) {
        self.places.retain(|(place, _)| apart_m(*place, at) > SAME_M);
    }

    /// Something broad was seen there.
    pub(super) fn is_broad(&mut self, at: [f64; 2]) {
        self.places.retain(|(place, _)| apart_m(*place, at) > BROAD_M);
    }

    pub(super) fn fade(&mut self, now: Stamp, after_ms: u64) {
        self.places.retain(|(_, seen)| now.since_ms(*seen) <= after_ms);
    }

    /// Whether that is one of them.
    pub(super) fn is_at(&self, at: [f64; 2]) -> bool {
        self.places().any(|place| apart_m(place, at) <= SAME_M)
    }

    pub(super) fn places(&self) -> impl Iterator<Item = [f64; 2]> {
        self.places.iter().map(|(place, _)| *place)
    }

    pub(super) fn clear(&mut self) {
        self.places.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_remembered_for_some_time_and_only_once() {
        let mut thin = ThinObstacles::default();
        thin.meet(Stamp::ZERO, [0.0, 0.0]);
        thin.meet(Stamp::from_ms(500), [0.05, 0.0]);
        assert_eq!(thin.places().count(), 1);
        thin.fade(Stamp::from_ms(1_500), 1_000);
        assert_eq!(thin.places().count(), 1, "it was seen again");
        thin.fade(Stamp::from_ms(1_501), 1_000);
        assert_eq!(thin.places().count(), 0);
    }

    #[test]
    fn what_turns_out_to_be_broad_is_forgotten_with_what_belongs_to_it() {
        let mut thin = ThinObstacles::default();
        [0.0, 0.25, 1.0].into_iter().for_each(|x_m| thin.meet(Stamp::ZERO, [x_m, 0.0]));
        thin.is_broad([0.1, 0.0]);
        assert_eq!(thin.places().collect::<Vec<_>>(), [[1.0, 0.0]]);
    }

    #[test]
    fn places_are_bounded_and_the_oldest_goes() {
        let mut thin = ThinObstacles::default();
        (0..MOST + 3).for_each(|n| thin.meet(Stamp::ZERO, [n as f64, 0.0]));
        assert_eq!((thin.places().count(), thin.places().next()), (MOST, Some([3.0, 0.0])));
    }
}
