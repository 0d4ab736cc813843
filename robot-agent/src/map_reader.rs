//! The fleet's map is read beside the network, as a blocking task: a message of some kilobytes can describe
//! millions of cells under hundreds of zones, and until a callback of Zenoh's returns, no stop and no command
//! comes in on that link.
//!
//! One slot: a map that was not begun yet gives way to a newer one, and a published map is published again.

use crate::counters::Counters;
use crate::mailbox::NavInput;
use std::collections::BTreeSet;
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use xtb_bus::Incoming;
use xtb_nav::map::Map;
use xtb_nav::navigator::PreparedMap;
use xtb_protocol::messages::{FleetMap, MapHash};

/// From the end of one map to the beginning of the next: whoever floods with maps must not take a processor
/// from the control loop. Chosen, not measured.
const PAUSE: Duration = Duration::from_secs(1);
/// So many different complaints go to the log; who makes up names and hashes must not fill it. Chosen, not
/// measured.
const MOST_COMPLAINTS: usize = 16;

/// The newest map that nobody has read yet.
#[derive(Default)]
pub(crate) struct MapSlot {
    waiting: Mutex<Option<Incoming>>,
    news: Notify,
}

impl MapSlot {
    fn lock(&self) -> MutexGuard<'_, Option<Incoming>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a message, unread: this is all that a callback does. Another one that still waits is dropped and
    /// counted; the same one again is no loss.
    pub(crate) fn put(&self, incoming: Incoming, counters: &Counters) {
        let before = self.lock().replace(incoming.clone());
        if before.is_some_and(|before| before != incoming) {
            counters.overloaded();
        }
        self.news.notify_one();
    }

    /// The next message.
    async fn next(&self) -> Incoming {
        loop {
            if let Some(incoming) = self.lock().take() {
                return incoming;
            }
            self.news.notified().await;
        }
    }
}

/// The task's owner: dropping it ends the task after its present map.
pub(crate) struct MapReader {
    slot: Arc<MapSlot>,
    task: JoinHandle<()>,
}

impl MapReader {
    /// Starts the task.
    pub(crate) fn start(reading: MapReading) -> Self {
        Self::pausing(reading, PAUSE)
    }

    fn pausing(mut reading: MapReading, pause: Duration) -> Self {
        let slot = Arc::new(MapSlot::default());
        let theirs = slot.clone();
        let task = tokio::spawn(async move {
            loop {
                let incoming = theirs.next().await;
                let read = tokio::task::spawn_blocking(move || {
                    reading.read(&incoming);
                    reading
                });
                let Ok(back) = read.await else { return };
                reading = back;
                tokio::time::sleep(pause).await;
            }
        });
        Self { slot, task }
    }

    /// Where messages are put.
    pub(crate) fn slot(&self) -> Arc<MapSlot> {
        self.slot.clone()
    }
}

impl Drop for MapReader {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// Maps that some robot of this program has, by their hash: each is prepared once, and kept as long as a robot
/// has it.
#[derive(Debug, Default)]
pub(crate) struct MapCache(Mutex<Vec<(MapHash, Weak<PreparedMap>)>>);

/// What is wrong with a map.
type MapError = <Map as TryFrom<&'static FleetMap>>::Error;

impl MapCache {
    /// The map of a message. Robots that ask for the same one at the same time wait for the first of them.
    fn prepared(&self, message: &FleetMap) -> Result<Arc<PreparedMap>, MapError> {
        let mut cache = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        cache.retain(|(_, map)| map.strong_count() > 0);
        let known = cache.iter().find(|(hash, _)| *hash == message.hash);
        if let Some(map) = known.and_then(|(_, map)| map.upgrade()) {
            return Ok(map);
        }
        let map = Arc::new(PreparedMap::of(Map::try_from(message)?));
        cache.push((message.hash, Arc::downgrade(&map)));
        Ok(map)
    }
}

/// What becomes of a message.
pub(crate) struct MapReading {
    nav_inputs: SyncSender<NavInput>,
    counters: Arc<Counters>,
    cache: Arc<MapCache>,
    /// The robot has a map of its own.
    own_map: bool,
    /// The map that was told last: it is published again and again.
    told: Option<MapHash>,
    complaints: Complaints,
}

impl MapReading {
    pub(crate) fn new(
        nav_inputs: SyncSender<NavInput>,
        counters: Arc<Counters>,
        cache: Arc<MapCache>,
        own_map: bool,
    ) -> Self {
        Self { nav_inputs, counters, cache, own_map, told: None, complaints: Complaints::default() }
    }

    /// Reads a map, measures it if the robot needs it, and tells the control loop.
    fn read(&mut self, incoming: &Incoming) {
        let message = match incoming.decode::<FleetMap>() {
            Ok(message) => message,
            Err(error) => {
                self.counters.rejected(&error);
                return self.complain(&format!("the fleet's map cannot be read: {error}"));
            }
        };
        if self.told == Some(message.hash) {
            return;
        }
        if !self.own_map {
            let map = match self.cache.prepared(&message) {
                Ok(map) => map,
                Err(error) => {
                    let words = format!("the fleet's map {} cannot be used: {error}", message.name);
                    return self.complain(&words);
                }
            };
            // Measured here, not in the control loop. Without room for it, it is published again.
            if !self.put(NavInput::Floor(map)) {
                return;
            }
        }
        if self.put(NavInput::FleetMap(message.hash)) {
            self.told = Some(message.hash);
        }
    }

    /// Whether there was room for it.
    fn put(&self, input: NavInput) -> bool {
        let put = self.nav_inputs.try_send(input).is_ok();
        if !put {
            self.counters.overloaded();
        }
        put
    }

    fn complain(&mut self, words: &str) {
        if self.complaints.is_new(words) {
            tracing::warn!("{words}");
            if self.complaints.is_full() {
                tracing::warn!("further faulty maps of the fleet are not logged");
            }
        }
    }
}

/// What has been logged already.
#[derive(Default)]
struct Complaints(BTreeSet<String>);

impl Complaints {
    /// Whether this has to be logged.
    fn is_new(&mut self, words: &str) -> bool {
        !self.is_full() && self.0.insert(words.to_owned())
    }

    fn is_full(&self) -> bool {
        self.0.len() >= MOST_COMPLAINTS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mailbox::{LoopEnds, mailbox};
    use std::time::Instant;
    use xtb_nav::Grid;
    use xtb_protocol::codec::{Format, encode, encoding};

    fn raw(payload: &[u8]) -> Incoming {
        let encoding = encoding::<FleetMap>(Format::Postcard);
        Incoming { key: "xtb/lab/map".into(), encoding, payload: payload.to_vec() }
    }

    fn message(name: &str, hash: Option<MapHash>) -> Incoming {
        let grid = Grid::free(0.05, [0.0; 2], 4, 1 + name.len()).unwrap();
        let mut message = FleetMap::from(&Map::new(name, grid, vec![]).unwrap());
        message.hash = hash.unwrap_or(message.hash);
        raw(&encode(&message, Format::Postcard).unwrap())
    }

    fn reading() -> (MapReading, LoopEnds, Arc<Counters>) {
        reading_from(&Arc::default())
    }

    fn reading_from(cache: &Arc<MapCache>) -> (MapReading, LoopEnds, Arc<Counters>) {
        let (loop_ends, session_ends, _) = mailbox();
        let counters = session_ends.counters.clone();
        let reading = MapReading::new(session_ends.nav_inputs, counters.clone(), cache.clone(), false);
        (reading, loop_ends, counters)
    }

    /// The map that a robot was told.
    fn floor(loop_ends: &LoopEnds) -> Arc<PreparedMap> {
        match loop_ends.nav_inputs.try_recv() {
            Ok(NavInput::Floor(floor)) => floor,
            _ => panic!("no map"),
        }
    }

    #[test]
    fn the_robots_of_a_program_share_a_map_as_long_as_one_has_it() {
        let cache = Arc::default();
        let (mut first, first_ends, _) = reading_from(&cache);
        let (mut second, second_ends, counters) = reading_from(&cache);
        first.read(&message("lab", None));
        second.read(&message("lab", None));
        let (one, other) = (floor(&first_ends), floor(&second_ends));
        assert!(Arc::ptr_eq(&one, &other));
        second.read(&message("lab", Some(MapHash::new(1))));
        assert!(second_ends.nav_inputs.try_iter().all(|input| !matches!(input, NavInput::Floor(_))));
        assert_eq!(counters.rejected_so_far().overloaded, 0);
        drop((one, other));
        let (mut third, third_ends, _) = reading_from(&cache);
        third.read(&message("lab", None));
        assert_eq!((Arc::strong_count(&floor(&third_ends)), cache.0.lock().unwrap().len()), (1, 1));
    }

    #[tokio::test]
    async fn a_put_reads_nothing_and_the_newest_map_displaces_the_one_that_waits() {
        let (slot, counters) = (MapSlot::default(), Counters::default());
        slot.put(raw(&[1]), &counters);
        slot.put(raw(&[1]), &counters);
        assert_eq!(counters.rejected_so_far().overloaded, 0, "the same again");
        slot.put(raw(&[2]), &counters);
        let rejected = counters.rejected_so_far();
        assert_eq!((rejected.overloaded, rejected.malformed), (1, 0));
        assert_eq!(slot.next().await, raw(&[2]));
        assert_eq!(*slot.lock(), None);
    }

    #[tokio::test]
    async fn the_next_map_waits_for_its_time_and_the_end_does_not() {
        let (reading, loop_ends, counters) = reading();
        let reader = MapReader::pausing(reading, Duration::from_millis(20));
        let told = async || {
            loop {
                if let Ok(NavInput::FleetMap(_)) = loop_ends.nav_inputs.try_recv() {
                    return Instant::now();
                }
                tokio::task::yield_now().await;
            }
        };
        reader.slot().put(message("first", None), &counters);
        let first = told().await;
        reader.slot().put(message("second", None), &counters);
        // The pause began a moment before the first one was heard of here.
        assert!(told().await - first >= Duration::from_millis(15));
        let slot = Arc::downgrade(&reader.slot());
        drop(reader);
        while slot.strong_count() > 0 {
            tokio::task::yield_now().await;
        }
    }

    #[test]
    fn a_map_is_told_once() {
        let (mut reading, loop_ends, counters) = reading();
        reading.read(&message("lab", None));
        reading.read(&message("lab", None));
        let told: Vec<NavInput> = loop_ends.nav_inputs.try_iter().collect();
        assert!(matches!(told.as_slice(), [NavInput::Floor(_), NavInput::FleetMap(_)]));
        assert_eq!(counters.rejected_so_far().overloaded, 0);
    }

    #[test]
    fn each_fault_of_a_map_is_logged_once_and_not_without_end() {
        let (mut reading, loop_ends, counters) = reading();
        for _ in 0..3 {
            reading.read(&raw(&[0xff; 9]));
            reading.read(&message("lab", Some(MapHash::new(1))));
        }
        assert_eq!(counters.rejected_so_far().malformed, 3, "each is counted");
        assert_eq!(reading.complaints.0.len(), 2);
        for hash in 0..100 {
            reading.read(&message("lab", Some(MapHash::new(hash))));
        }
        assert_eq!(reading.complaints.0.len(), MOST_COMPLAINTS);
        assert_eq!(loop_ends.nav_inputs.try_iter().count(), 0);
    }
}
