//! Robots of the same world that another simulator moves: bodies here, from its ground truth.
//!
//! Each simulator moves its own robots and tells where they are; what one of them drives into is its own
//! simulator's business, and its contact. So a meeting of two is as true as the truth is fresh: 20 times a second,
//! and forgotten after [`FRESH_S`].

use robot_agent::hardware::simulated::WorldOrders;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_client::Result;
use xtb_control::frames::MapPose;
use xtb_protocol::Name;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Roster, Truth};
use xtb_sim::parameters::Body;
use xtb_sim::{MOST_FOREIGN, Simulation};

/// Where a robot was is true for so long, in s of real time.
const FRESH_S: f64 = 0.1;

/// Where the others are, until the world takes it: at most [`MOST_FOREIGN`] of them.
type Waiting = Arc<Mutex<BTreeMap<Name, MapPose>>>;

/// Takes in the truth of other simulators until it is dropped. Their robots are taken to be as large as `body`.
///
/// # Errors
/// Zenoh would not.
pub(super) async fn listen(
    bus: &Bus,
    keys: &FleetKeys,
    own: &Roster,
    body: Body,
    world: WorldOrders,
    speed: f64,
) -> Result<Subscription> {
    let own: BTreeSet<Name> = own.robots.iter().map(|robot| robot.name.clone()).collect();
    let waiting = Waiting::default();
    let fresh_ms = (FRESH_S * 1e3 * speed) as u64;
    let each = move |incoming: Incoming| {
        let truth = match incoming.decode::<Truth>() {
            Ok(truth) => truth,
            Err(error) => return tracing::debug!("the truth of another simulator cannot be read: {error}"),
        };
        if put(&waiting, &own, truth) {
            let (waiting, body) = (waiting.clone(), body.clone());
            world.change(move |simulation| meet(simulation, &waiting, &body, fresh_ms));
        }
    };
    Ok(bus.subscribe_remote(&keys.sim_truth(), each).await?)
}

/// Keeps where the others are. True: the world has to be told that something waits.
fn put(waiting: &Waiting, own: &BTreeSet<Name>, truth: Truth) -> bool {
    let mut waiting = waiting.lock().unwrap_or_else(PoisonError::into_inner);
    let was_empty = waiting.is_empty();
    for (name, robot) in truth.robots {
        if own.contains(&name) || (waiting.len() >= MOST_FOREIGN && !waiting.contains_key(&name)) {
            continue;
        }
        waiting.insert(name, MapPose { x_m: robot.x_m, y_m: robot.y_m, yaw_rad: robot.yaw_rad });
    }
    was_empty && !waiting.is_empty()
}

/// Puts them into the world.
fn meet(simulation: &mut Simulation, waiting: &Waiting, body: &Body, fresh_ms: u64) {
    let taken = std::mem::take(&mut *waiting.lock().unwrap_or_else(PoisonError::into_inner));
    let until = simulation.now().plus_ms(fresh_ms);
    for (name, pose) in taken {
        simulation.put_foreign(name.as_str(), &pose, body, until);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::TruthRobot;
    use xtb_sim::{TruckParameters, World};

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    fn truth(robots: &[(&str, f64)]) -> Truth {
        let robot = |x_m| TruthRobot {
            x_m,
            y_m: 5.0,
            yaw_rad: 0.0,
            speed_mps: 0.0,
            motor_counts: 3750,
            neutral_since_s: Some(0.0),
            contacts: 0,
        };
        let robots = robots.iter().map(|(text, x_m)| (name(text), robot(*x_m))).collect();
        Truth { t_s: 1.0, robots }
    }

    #[test]
    fn the_world_is_told_once_of_the_latest_of_each_robot_but_its_own() {
        let (waiting, own) = (Waiting::default(), BTreeSet::from([name("xtb-1")]));
        assert!(!put(&waiting, &own, truth(&[("xtb-1", 9.0)])), "nobody else");
        assert!(put(&waiting, &own, truth(&[("xtb-1", 9.0), ("xtb-2", 1.0)])));
        assert!(!put(&waiting, &own, truth(&[("xtb-2", 2.0), ("xtb-3", 3.0)])), "it is told already");
        let parameters = TruckParameters::default();
        let mut simulation = Simulation::new(World::default(), &parameters, &["xtb-1"], 1).unwrap();
        meet(&mut simulation, &waiting, &parameters.body, 100);
        simulation.step();
        assert_eq!(simulation.foreign().collect::<Vec<_>>(), ["xtb-2", "xtb-3"]);
        assert!(put(&waiting, &own, truth(&[("xtb-2", 2.0)])), "it has been taken");
    }
}
