//! What a person holds before a range finder.

use super::{Simulation, SimulationError};
use crate::world::BoxSpec;
use xtb_control::vehicle::RangeFinder;

/// The name of the box that is held before a range finder.
const HELD: &str = "held in a hand";
/// It is so wide and so thick, in m: a bottle, which only one of two neighbours sees.
const HELD_M: (f64, f64) = (0.04, 0.03);

impl Simulation {
    /// Holds a bottle so far before a range finder of a truck, in m along its beam.
    ///
    /// # Errors
    /// No such truck, or the bottle would be inside it.
    pub fn hold_before(
        &mut self,
        index: usize,
        finder: &RangeFinder,
        is_rear: bool,
        range_m: f64,
    ) -> Result<(), SimulationError> {
        let count = self.trucks().len();
        let truck = self.trucks().get(index).ok_or(SimulationError::NoSuchTruck { index, count })?;
        let ((x_m, y_m), yaw_rad) = (truck.body().centre_m(), truck.truth().yaw_rad);
        let facing = if is_rear { -1.0 } else { 1.0 };
        let lens_m = facing * (truck.dimensions().length_m / 2.0 + finder.ahead_m);
        let (beam_rad, way_m) = (finder.turned_deg.to_radians(), range_m + HELD_M.1 / 2.0);
        let ahead_m = lens_m + facing * way_m * libm::cos(beam_rad);
        let left_m = finder.left_m + way_m * libm::sin(beam_rad);
        let (sin, cos) = libm::sincos(yaw_rad);
        let (x_m, y_m) = (x_m + cos * ahead_m - sin * left_m, y_m + sin * ahead_m + cos * left_m);
        let (width_m, depth_m) = (HELD_M.1, HELD_M.0);
        self.put_box(HELD, BoxSpec { x_m, y_m, width_m, depth_m, yaw_rad: yaw_rad + facing * beam_rad })
    }

    /// Takes it away, if it is there.
    pub fn take_away(&mut self) {
        let _ = self.remove_box(HELD);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hands::Hands;
    use crate::parameters::TruckParameters;
    use crate::world::World;
    use xtb_control::frames::wrap_rad;
    use xtb_control::units::Stamp;
    use xtb_control::vehicle::SLOTS;

    fn simulation() -> Simulation {
        Simulation::new(World::default(), &TruckParameters::default(), &["xtb-1"], 1).unwrap()
    }

    fn run_s(simulation: &mut Simulation, seconds: f64) {
        let end = simulation.now().plus_ns(Stamp::from_s(seconds).ns());
        while simulation.now() < end {
            simulation.step();
        }
    }

    #[test]
    fn hands_roll_and_turn_by_what_is_asked_and_let_go() {
        let mut simulation = simulation();
        let before = simulation.trucks()[0].truth();
        simulation.trucks_mut()[0].set_hands(Hands { turn_deg: 90.0, ..Hands::default() });
        run_s(&mut simulation, 3.0);
        let turned = simulation.trucks()[0].truth();
        let clockwise_deg = wrap_rad(before.yaw_rad - turned.yaw_rad).to_degrees();
        assert!((clockwise_deg - 90.0).abs() < 1e-9, "{clockwise_deg}");
        simulation.trucks_mut()[0].set_hands(Hands { roll_m: 0.3, ..Hands::default() });
        run_s(&mut simulation, 5.0);
        let rolled = simulation.trucks()[0].truth();
        let way_m = libm::hypot(rolled.x_m - turned.x_m, rolled.y_m - turned.y_m);
        // It rolls out when it is let go.
        assert!((0.3..0.36).contains(&way_m) && rolled.speed_mps == 0.0, "{way_m} {rolled:?}");
    }

    #[test]
    fn what_is_held_before_one_range_finder_is_seen_by_that_one() {
        let finders = xtb_control::VehicleConfig::default().range_finders;
        let mut simulation = simulation();
        for (is_rear, slot) in [(false, 0), (false, 3), (true, 0), (true, 5)] {
            let finder = if is_rear { finders.rear.0[slot] } else { finders.front.0[slot] };
            simulation.hold_before(0, &finder, is_rear, 0.2).unwrap();
            run_s(&mut simulation, 0.2);
            let volts = simulation.trucks()[0].range_finder_volts();
            let seen: Vec<_> = (0..volts.len()).filter(|i| volts[*i] > 0.8).collect();
            assert_eq!(seen, [slot + SLOTS * usize::from(is_rear)], "{volts:?}");
        }
        simulation.take_away();
        run_s(&mut simulation, 0.2);
        assert!(simulation.trucks()[0].range_finder_volts().iter().all(|volts| *volts < 0.5));
    }
}
