//! What other robots tell those near them, while no traffic control leads.
//!
//! A robot tells what it does in the squares of the floor in which it is and drives, and listens to those around
//! it, only while it drives to a planned goal alone: so it hears those that matter, however large the fleet is.
//! The callback runs on Zenoh's threads, and the control loop finds the latest of each of the
//! [`MOST_NEIGHBOURS`] nearest.

use crate::clock::Clock;
use crate::counters::Counters;
use crate::snapshot::Snapshot;
use std::collections::BTreeMap;
use std::mem;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;
use xtb_bus::{Bus, BusError, Incoming, Publisher, Subscription};
use xtb_control::Stamp;
use xtb_nav::geometry::Car;
use xtb_nav::navigator::near::Surroundings;
use xtb_nav::navigator::right_of_way::{HEARD_MS, MOST_NEIGHBOURS, Neighbour};
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys, FloorCell, Key, RobotKeys};
use xtb_protocol::messages::NearState;

/// A robot tells what it does this often, by its own clock: five times within the time after which one that is
/// not heard is unknown.
const TOLD_EACH_MS: u64 = HEARD_MS / 5;
/// What comes sooner after the last one is left unread: the same, told in several squares.
const READ_EACH_MS: u64 = TOLD_EACH_MS / 2;

#[derive(Default)]
struct Inner {
    /// Where this robot is, (x, y) in m.
    here_m: (f64, f64),
    /// When each was heard last, and how far away it was, in m.
    heard: BTreeMap<Name, (Stamp, f64)>,
    /// For the control loop.
    latest: BTreeMap<Name, (Stamp, Neighbour)>,
}

impl Inner {
    /// Room for one more at this distance.
    fn make_room(&mut self, now: Stamp, far_m: f64) -> Room {
        if self.heard.len() < MOST_NEIGHBOURS {
            return Room::Enough;
        }
        self.heard.retain(|_, (at, _)| now.since_ms(*at) <= HEARD_MS);
        self.latest.retain(|name, _| self.heard.contains_key(name));
        if self.heard.len() < MOST_NEIGHBOURS {
            return Room::Enough;
        }
        let distances = self.heard.iter().map(|(name, (_, far_m))| (name, *far_m));
        match distances.max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((farthest, most_m)) if most_m > far_m => {
                let farthest = farthest.clone();
                self.heard.remove(&farthest);
                self.latest.remove(&farthest);
                Room::MadeByLeavingOne
            }
            _ => Room::None,
        }
    }
}

/// For one more robot.
enum Room {
    Enough,
    /// One that was farther away is no longer kept in mind.
    MadeByLeavingOne,
    /// All others are nearer.
    None,
}

/// The latest of each robot, for the control loop.
#[derive(Default)]
pub(crate) struct NeighbourSlot(Mutex<Inner>);

impl NeighbourSlot {
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Where this robot is: the nearest others count.
    fn stand_at(&self, x_m: f64, y_m: f64) {
        self.lock().here_m = (x_m, y_m);
    }

    /// Whether what this robot tells now says nothing new.
    fn is_read(&self, now: Stamp, robot: &Name) -> bool {
        self.lock().heard.get(robot).is_some_and(|(at, _)| now.since_ms(*at) < READ_EACH_MS)
    }

    fn put(&self, now: Stamp, robot: Name, said: Neighbour, counters: &Counters) {
        let mut inner = self.lock();
        let (x_m, y_m) = inner.here_m;
        let far_m = (said.pose.x_m - x_m).hypot(said.pose.y_m - y_m);
        if !inner.heard.contains_key(&robot) {
            match inner.make_room(now, far_m) {
                Room::Enough => {}
                Room::MadeByLeavingOne => counters.overloaded(),
                Room::None => return counters.overloaded(),
            }
        }
        inner.heard.insert(robot.clone(), (now, far_m));
        inner.latest.insert(robot, (now, said));
    }

    /// Takes what has come.
    pub(crate) fn take(&self) -> impl Iterator<Item = (Stamp, Neighbour)> {
        mem::take(&mut self.lock().latest).into_values()
    }

    /// Some robot tells what it does.
    fn hear(&self, now: Stamp, me: &Name, incoming: &Incoming, counters: &Counters) {
        let Some(Key { robot: Some(robot), channel: Channel::Near(cell), .. }) = Key::parse(&incoming.key)
        else {
            return;
        };
        if robot == *me || self.is_read(now, &robot) {
            return;
        }
        match incoming.decode::<NearState>() {
            Ok(said) => match Neighbour::told(&said, cell) {
                Some(said) => self.put(now, robot, said, counters),
                None => counters.impossible(),
            },
            Err(error) => counters.rejected(&error),
        }
    }
}

/// Where the snapshots of the control loop come.
type Snapshots = watch::Receiver<Option<Snapshot>>;

/// Listens to those near it.
pub(crate) struct Listener {
    /// The session.
    pub(crate) bus: Bus,
    /// Whose robots are heard.
    pub(crate) fleet: FleetKeys,
    /// Itself is not.
    pub(crate) me: Name,
    /// Its body: how far it has to listen.
    pub(crate) car: Car,
    /// The robot's.
    pub(crate) clock: Clock,
    /// Where what is heard goes.
    pub(crate) slot: Arc<NeighbourSlot>,
    /// What could not be read.
    pub(crate) counters: Arc<Counters>,
}

impl Listener {
    /// Listens while that is `wanted`, until the control loop ends.
    ///
    /// # Errors
    /// [`BusError`].
    pub(crate) async fn run(
        self,
        mut wanted: watch::Receiver<bool>,
        mut snapshots: Snapshots,
    ) -> Result<(), BusError> {
        while wanted.wait_for(|wanted| *wanted).await.is_ok() {
            if !self.listen(&mut wanted, &mut snapshots).await? {
                break;
            }
        }
        Ok(())
    }

    /// Listens to the squares around the robot until that is not wanted any more; false = the control loop has
    /// ended.
    async fn listen(
        &self,
        wanted: &mut watch::Receiver<bool>,
        snapshots: &mut Snapshots,
    ) -> Result<bool, BusError> {
        let mut around = Surroundings::of(&self.car);
        let mut heard = BTreeMap::<FloorCell, Subscription>::new();
        while *wanted.borrow_and_update() {
            let here =
                snapshots.borrow_and_update().as_ref().map(|now| (now.state.pose.x_m, now.state.pose.y_m));
            if let Some((x_m, y_m)) = here {
                self.slot.stand_at(x_m, y_m);
                if let Some(cells) = around.moved(x_m, y_m) {
                    // The new ones first: who is heard in both is not lost on the way.
                    for cell in cells.iter().copied() {
                        if heard.contains_key(&cell) {
                            continue;
                        }
                        let subscription = self.subscribe(cell).await?;
                        heard.insert(cell, subscription);
                    }
                    heard.retain(|cell, _| cells.contains(cell));
                }
            }
            let changed = tokio::select! {
                changed = wanted.changed() => changed,
                changed = snapshots.changed() => changed,
            };
            if changed.is_err() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    async fn subscribe(&self, cell: FloorCell) -> Result<Subscription, BusError> {
        let (me, clock) = (self.me.clone(), self.clock.clone());
        let (slot, counters) = (self.slot.clone(), self.counters.clone());
        let each = move |incoming: Incoming| slot.hear(clock.now(), &me, &incoming, &counters);
        self.bus.subscribe(&self.fleet.any_robot().near(cell), each).await
    }
}

/// Tells those near it what the robot does, until the control loop ends.
///
/// # Errors
/// [`BusError`] if a publisher cannot be declared; a message that cannot be sent is only logged.
pub(crate) async fn tell(bus: Bus, keys: RobotKeys, mut snapshots: Snapshots) -> Result<(), BusError> {
    let mut publishers = BTreeMap::<FloorCell, Publisher<NearState>>::new();
    let mut next_ms = 0;
    while snapshots.changed().await.is_ok() {
        let said = {
            let snapshot = snapshots.borrow_and_update();
            let due = snapshot.as_ref().map(|now| &now.state).filter(|state| state.tick_ms >= next_ms);
            let Some(state) = due else { continue };
            // In step with the clock, not with the snapshots: else 5 Hz would be 4.
            next_ms = (next_ms + TOLD_EACH_MS).max(state.tick_ms);
            Neighbour::of(state).map(|said| (said.near_state(&state.robot), said.cells()))
        };
        let Some((said, cells)) = said else { continue };
        // One that it comes back to is kept: its listeners are known already.
        let own = FloorCell::at(said.x_m, said.y_m);
        publishers.retain(|cell, _| cells.contains(cell) || cell.is_within(1, own));
        for cell in cells.iter().copied() {
            if publishers.contains_key(&cell) {
                continue;
            }
            let publisher = bus.publisher(&keys.near(cell), &Channel::Near(cell), Format::Postcard).await?;
            publishers.insert(cell, publisher);
        }
        for publisher in cells.iter().filter_map(|cell| publishers.get(cell)) {
            // Where nobody listens Zenoh sends nothing.
            if let Err(error) = publisher.put(&said).await {
                tracing::debug!("{error}");
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::codec;
    use xtb_protocol::messages::NearRole;

    fn at(ms: u64) -> Stamp {
        Stamp::ZERO.plus_ms(ms)
    }

    /// A robot that stands at (x, 0) tells that.
    fn parked(robot: &str, x_m: f64) -> Incoming {
        let said = NearState {
            robot: Name::new(robot).unwrap(),
            x_m,
            y_m: 0.0,
            yaw_rad: 0.0,
            speed_mps: 0.0,
            role: NearRole::Parked,
            way: None,
            waits_for: None,
        };
        told(&said, FloorCell::at(x_m, 0.0))
    }

    fn told(said: &NearState, cell: FloorCell) -> Incoming {
        Incoming {
            key: FleetKeys::new(Name::new("lab").unwrap()).robot(&said.robot).near(cell),
            encoding: codec::encoding::<NearState>(Format::Postcard),
            payload: codec::encode(said, Format::Postcard).unwrap(),
        }
    }

    fn hear(slot: &NeighbourSlot, now: Stamp, incoming: &Incoming, counters: &Counters) {
        slot.hear(now, &Name::new("me").unwrap(), incoming, counters);
    }

    fn names(slot: &NeighbourSlot) -> Vec<String> {
        slot.take().map(|(_, said)| said.name).collect()
    }

    #[test]
    fn what_is_told_in_several_squares_is_read_once() {
        let (slot, counters) = (NeighbourSlot::default(), Counters::default());
        let mut read = 0;
        for told_at_ms in (0..1_000).step_by(TOLD_EACH_MS as usize) {
            for later_ms in [0, 1, 30] {
                hear(&slot, at(told_at_ms + later_ms), &parked("xtb-2", 1.0), &counters);
                read += names(&slot).len();
            }
        }
        assert_eq!(read, 5);
    }

    #[test]
    fn of_more_robots_than_it_can_keep_the_nearest_are_kept() {
        let (slot, counters) = (NeighbourSlot::default(), Counters::default());
        slot.stand_at(0.0, 0.0);
        // From far to near.
        for n in (0..MOST_NEIGHBOURS + 3).rev() {
            hear(&slot, at(0), &parked(&format!("xtb-{n}"), 0.01 * n as f64), &counters);
        }
        let kept = names(&slot);
        assert_eq!(kept.len(), MOST_NEIGHBOURS);
        assert!((0..MOST_NEIGHBOURS).all(|n| kept.contains(&format!("xtb-{n}"))), "{kept:?}");
        assert_eq!(counters.rejected_so_far().overloaded, 3);
        hear(&slot, at(0), &parked("far", 5.0), &counters);
        assert_eq!((names(&slot).len(), counters.rejected_so_far().overloaded), (0, 4));
        // The others have fallen silent.
        hear(&slot, at(HEARD_MS + 1), &parked("far", 5.0), &counters);
        assert_eq!((names(&slot), counters.rejected_so_far().overloaded), (vec!["far".to_owned()], 4));
    }

    #[test]
    fn itself_is_not_heard_and_who_cannot_be_there_is_counted() {
        let (slot, counters) = (NeighbourSlot::default(), Counters::default());
        hear(&slot, at(0), &parked("me", 1.0), &counters);
        assert_eq!((names(&slot).len(), counters.rejected_so_far().out_of_range), (0, 0));
        let mut far = parked("xtb-2", 1.0);
        far.key = "xtb/lab/xtb-2/near/x9y0".to_owned();
        hear(&slot, at(0), &far, &counters);
        assert_eq!((names(&slot).len(), counters.rejected_so_far().out_of_range), (0, 1));
        // In the name of another one.
        far.key = "xtb/lab/xtb-3/near/x0y0".to_owned();
        hear(&slot, at(0), &far, &counters);
        assert_eq!((names(&slot).len(), counters.rejected_so_far().malformed), (0, 1));
        hear(&slot, at(0), &parked("xtb-2", 1.0), &counters);
        assert_eq!(names(&slot), ["xtb-2"]);
    }
}
