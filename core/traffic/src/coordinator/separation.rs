//! How far two trucks stay apart: less where they already stand nearer to each other.

use xtb_nav::geometry::rect::Stand;

/// Separations of a pair while it is planned, in m: the largest at which the two do not meet already, each
/// body being grown by it, so 16 cm at most. Chosen, not measured.
pub(super) const SEPARATIONS_M: [f64; 5] = [0.08, 0.06, 0.04, 0.02, 0.005];
/// So much less of it counts when the plan is driven, in m, for what trucks are off; chosen, not measured.
const SPARE_M: f64 = 0.02;

/// The largest of the planning separations at which nobody of the one meets anybody of the other, in m.
pub(super) fn separation_m(some: &[Stand], others: &[Stand]) -> f64 {
    let meets = |separation_m: f64| some.iter().any(|a| others.iter().any(|b| a.touches(b, separation_m)));
    SEPARATIONS_M.into_iter().find(|&separation_m| !meets(separation_m)).unwrap_or(0.0)
}

/// What counts of a planned separation when the plan is driven, in m.
pub(super) fn driven_separation_m(planned_m: f64) -> f64 {
    (planned_m - SPARE_M).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Car, MapPose};

    #[test]
    fn neighbours_that_stand_close_keep_what_they_have() {
        let car = Car::of(&VehicleConfig::default());
        let at = |y_m| [Stand::still(&car, &MapPose { x_m: 0.0, y_m, yaw_rad: 0.0 })];
        // Bodies are 0.4 m wide; both are grown by it.
        assert_eq!(separation_m(&at(0.0), &at(0.6)), 0.08);
        assert_eq!(separation_m(&at(0.0), &at(0.5)), 0.04);
        assert_eq!(separation_m(&at(0.0), &at(0.39)), 0.0);
        assert_eq!(driven_separation_m(0.005), 0.0);
    }
}
