//! Things that stand in a truck's way and are on no map: they are driven around for a while.

use super::held_up::{BELIEVED_MS, HALF_M, NAME};
use super::job::Block;
use super::truck::Truck;
use xtb_control::Stamp;
use xtb_nav::geometry::rect::{Rect, Stand};
use xtb_nav::{Car, MapPose};

/// Two reports nearer than this mean the same thing, in m: two cells of the obstacle layer.
const SAME_M: f64 = 0.1;
/// A thing so near to a truck's body is that truck, in m: more than the 20 cm ahead of its bumper at which a
/// truck reports what it does not know better.
const TRUCK_M: f64 = 0.25;
/// Most things; beyond, the one that was not reported for longest goes. A bound for the time of plans;
/// chosen, not measured.
const MOST: usize = 32;
/// Their blocks are numbered downwards from here: trucks are numbered upwards from 1.
const FIRST_ID: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
struct Thing {
    id: u32,
    at_m: [f64; 2],
    seen: Stamp,
}

/// What was reported lately.
#[derive(Debug, Clone, Default)]
pub(super) struct Unknown {
    things: Vec<Thing>,
    made: u32,
}

impl Unknown {
    /// Something is in the way of a truck at (x, y). True if that is news.
    pub(super) fn report(&mut self, now: Stamp, at_m: [f64; 2], trucks: &[Truck]) -> bool {
        let [x_m, y_m] = at_m;
        let is_truck =
            |truck: &Truck| Rect::body(&truck.car(), &truck.view.pose).distance_m(x_m, y_m) < TRUCK_M;
        if !x_m.is_finite() || !y_m.is_finite() || trucks.iter().any(is_truck) {
            return false;
        }
        let same = |thing: &&mut Thing| libm::hypot(thing.at_m[0] - x_m, thing.at_m[1] - y_m) < SAME_M;
        if let Some(thing) = self.things.iter_mut().find(same) {
            thing.seen = now;
            return false;
        }
        if self.things.len() == MOST
            && let Some(oldest) = (0..MOST).min_by_key(|&index| self.things[index].seen)
        {
            self.things.remove(oldest);
        }
        self.things.push(Thing { id: FIRST_ID - self.made, at_m, seen: now });
        self.made = (self.made + 1) % (FIRST_ID / 2);
        true
    }

    /// Forgets what was not reported for long.
    pub(super) fn fade(&mut self, now: Stamp) {
        self.things.retain(|thing| now.since_ms(thing.seen) < BELIEVED_MS);
    }

    /// Numbers of all of them.
    pub(super) fn ids(&self) -> impl Iterator<Item = u32> {
        self.things.iter().map(|thing| thing.id)
    }

    /// To be driven around.
    pub(super) fn blocks(&self) -> impl Iterator<Item = Block> {
        self.things.iter().map(|thing| {
            let pose = MapPose { x_m: thing.at_m[0], y_m: thing.at_m[1], yaw_rad: 0.0 };
            let square = Car {
                front_m: HALF_M,
                rear_m: HALF_M,
                half_width_m: HALF_M,
                radius_m: 1.0,
                gears: xtb_nav::Gears::BOTH,
            };
            let stands = vec![Stand::still(&square, &pose)];
            Block { id: thing.id, only: None, name: NAME.to_owned(), stands }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinator::ReportedRobot;
    use xtb_control::VehicleConfig;

    fn truck_at(x_m: f64) -> Truck {
        let view = ReportedRobot {
            name: "a".into(),
            epoch: 0,
            car: Some(Car::of(&VehicleConfig::default())),
            pose: MapPose { x_m, y_m: 0.0, yaw_rad: 0.0 },
            sigma_m: 0.02,
            speed_mps: 0.0,
            goal: None,
            route: None,
            blocked_at_m: None,
            drives: true,
            age_ms: 0,
        };
        Truck::new(1, Stamp::ZERO, view)
    }

    #[test]
    fn a_thing_is_believed_in_for_a_while_and_a_truck_is_none() {
        let mut unknown = Unknown::default();
        let trucks = [truck_at(0.0)];
        assert!(!unknown.report(Stamp::ZERO, [0.4, 0.0], &trucks), "the truck's own bumper");
        assert!(unknown.report(Stamp::ZERO, [0.8, 0.0], &trucks));
        assert!(!unknown.report(Stamp::from_ms(5000), [0.85, 0.0], &trucks), "the same again");
        assert_eq!(unknown.blocks().count(), 1);
        unknown.fade(Stamp::from_ms(24_000));
        assert_eq!(unknown.ids().count(), 1);
        unknown.fade(Stamp::from_ms(26_000));
        assert_eq!(unknown.ids().count(), 0);
    }

    #[test]
    fn the_memory_of_things_is_bounded() {
        let mut unknown = Unknown::default();
        for n in 0..100 {
            unknown.report(Stamp::from_ms(n), [n as f64, 5.0], &[]);
        }
        assert_eq!(unknown.ids().count(), MOST);
    }
}
