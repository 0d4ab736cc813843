//! What other robots say of themselves, while no traffic control leads: their states, thinned.
//!
//! The states of a large fleet are many, so they are asked for only while the robot drives to a planned
//! goal alone. The callback runs on Zenoh's threads: of each robot it reads a state each [`EACH_MS`], and the
//! control loop finds the latest of each, of at most [`MOST_NEIGHBOURS`].

use crate::clock::Clock;
use crate::counters::Counters;
use std::collections::BTreeMap;
use std::mem;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;
use xtb_bus::{Bus, BusError, Incoming};
use xtb_control::Stamp;
use xtb_nav::navigator::right_of_way::{HEARD_MS, MOST_NEIGHBOURS, Neighbour};
use xtb_protocol::Name;
use xtb_protocol::keys::{FleetKeys, Key};
use xtb_protocol::messages::RobotState;

/// States of one robot that come sooner than this after the last one are left unread.
const EACH_MS: u64 = 200;

#[derive(Default)]
struct Inner {
    /// When a state of each was read last.
    read: BTreeMap<Name, Stamp>,
    /// For the control loop.
    latest: BTreeMap<Name, (Stamp, Neighbour)>,
}

/// The latest of each robot, for the control loop.
#[derive(Default)]
pub(crate) struct NeighbourSlot(Mutex<Inner>);

impl NeighbourSlot {
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a state of this robot shall be read now; `None` = there are too many robots.
    fn is_due(&self, now: Stamp, robot: &Name) -> Option<bool> {
        let read = &mut self.lock().read;
        if read.get(robot).is_some_and(|at| now.since_ms(*at) < EACH_MS) {
            return Some(false);
        }
        if !read.contains_key(robot) && read.len() >= MOST_NEIGHBOURS {
            read.retain(|_, at| now.since_ms(*at) <= HEARD_MS);
            if read.len() >= MOST_NEIGHBOURS {
                return None;
            }
        }
        read.insert(robot.clone(), now);
        Some(true)
    }

    fn put(&self, now: Stamp, robot: Name, said: Neighbour) {
        let mut inner = self.lock();
        if inner.latest.len() < MOST_NEIGHBOURS || inner.latest.contains_key(&robot) {
            inner.latest.insert(robot, (now, said));
        }
    }

    /// Takes what has come.
    pub(crate) fn take(&self) -> impl Iterator<Item = (Stamp, Neighbour)> {
        mem::take(&mut self.lock().latest).into_values()
    }

    /// A state of some robot came in.
    fn hear(&self, now: Stamp, me: &Name, incoming: &Incoming, counters: &Counters) {
        let Some(robot) = Key::parse(&incoming.key).and_then(|key| key.robot) else { return };
        if robot == *me {
            return;
        }
        match self.is_due(now, &robot) {
            None => return counters.overloaded(),
            Some(false) => return,
            Some(true) => {}
        }
        match incoming.decode::<RobotState>() {
            Ok(state) => match Neighbour::of(&state).filter(|_| state.robot == robot) {
                Some(said) => self.put(now, robot, said),
                None => counters.impossible(),
            },
            Err(error) => counters.rejected(&error),
        }
    }
}

/// Listens to the others while that is `wanted`.
///
/// # Errors
/// [`BusError`].
pub(crate) async fn listen(
    bus: Bus,
    fleet: FleetKeys,
    me: Name,
    clock: Clock,
    slot: Arc<NeighbourSlot>,
    counters: Arc<Counters>,
    mut wanted: watch::Receiver<bool>,
) -> Result<(), BusError> {
    // Not the expression that others ask: see there.
    let key = fleet.neighbour_states();
    while wanted.wait_for(|wanted| *wanted).await.is_ok() {
        let (me, clock, slot, counters) = (me.clone(), clock.clone(), slot.clone(), counters.clone());
        let each = move |incoming: Incoming| slot.hear(clock.now(), &me, &incoming, &counters);
        let _subscription = bus.subscribe(&key, each).await?;
        if wanted.wait_for(|wanted| !*wanted).await.is_err() {
            break;
        }
    }
    // The control loop has ended.
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Stamp {
        Stamp::ZERO.plus_ms(ms)
    }

    #[test]
    fn of_each_robot_five_states_a_second_are_read() {
        let (slot, robot) = (NeighbourSlot::default(), Name::new("xtb-2").unwrap());
        let read = (0..20).filter(|n| slot.is_due(at(n * 50), &robot) == Some(true)).count();
        assert_eq!(read, 5);
    }

    #[test]
    fn more_robots_than_it_can_keep_are_counted_until_others_fall_silent() {
        let (slot, counters) = (NeighbourSlot::default(), Counters::default());
        let me = Name::new("me").unwrap();
        let said = |now, n: usize| {
            let key = format!("xtb/lab/xtb-{n}/state");
            let incoming = Incoming { key, encoding: String::new(), payload: Vec::new() };
            slot.hear(now, &me, &incoming, &counters);
        };
        (0..MOST_NEIGHBOURS + 3).for_each(|n| said(at(0), n));
        let rejected = counters.rejected_so_far();
        assert_eq!((rejected.overloaded, rejected.malformed), (3, MOST_NEIGHBOURS as u64));
        said(at(HEARD_MS + 1), 999);
        assert_eq!(counters.rejected_so_far().overloaded, 3);
        assert_eq!(slot.take().count(), 0, "nothing of it could be read");
    }

    #[test]
    fn its_own_states_are_not_heard() {
        let (slot, counters) = (NeighbourSlot::default(), Counters::default());
        let incoming = |robot: &str| Incoming {
            key: format!("xtb/lab/{robot}/state"),
            encoding: String::new(),
            payload: Vec::new(),
        };
        slot.hear(at(0), &Name::new("xtb-1").unwrap(), &incoming("xtb-1"), &counters);
        assert_eq!(counters.rejected_so_far().malformed, 0);
        slot.hear(at(0), &Name::new("xtb-1").unwrap(), &incoming("xtb-2"), &counters);
        assert_eq!(counters.rejected_so_far().malformed, 1);
    }
}
