//! What the second level hears from Zenoh: measured poses, traffic control's paths, the fleet's map.
//!
//! The callbacks run on Zenoh's threads and never wait; a map they do not even read, see [`map_reader`]. What
//! cannot be read is counted as rejected, what finds the queue full as overloaded; a newer pose or path follows.
//!
//! [`map_reader`]: crate::map_reader

use crate::AgentError;
use crate::clock::Clock;
use crate::config::AgentConfig;
use crate::counters::Counters;
use crate::mailbox::{NavInput, SessionEnds};
use crate::map_reader::{MapCache, MapReader, MapReading, MapSlot};
use crc::{CRC_32_ISO_HDLC, Crc};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::time::Duration;
use tokio::task::JoinSet;
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_protocol::Name;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Fix, Route};

/// So often the fleet's map is asked for, over one to two minutes: whoever serves one publishes it every 30 s too.
/// Chosen, not measured.
const MOST_QUESTIONS: u32 = 7;

/// Holds the declarations, the question for a map and the thread that reads maps; dropping it ends them.
pub(crate) struct NavInputs {
    _subscriptions: [Subscription; 3],
    _asking: JoinSet<()>,
    _map_reader: MapReader,
}

/// When a robot asks for the fleet's map until it has one: at its start all robots of a fleet may ask at once, and a
/// server that has too much to do must not be asked more.
#[derive(Clone, Copy)]
struct Asking {
    /// For the first answer; for the others up to 16 times as long, as a large map on a slow link needs.
    within: Duration,
    /// After the first question; doubles each time.
    pause: Duration,
    /// 0 to 1: so much longer are this robot's pauses than the shortest.
    spread: f64,
}

impl Asking {
    fn of(robot: &Name) -> Self {
        let hash = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(robot.as_str().as_bytes());
        let spread = f64::from(hash) / f64::from(u32::MAX);
        Self { within: Duration::from_secs(2), pause: Duration::from_secs(1), spread }
    }

    /// How long the answer to the n-th question from 0 is waited for, and how long it is until the next question.
    fn nth(&self, n: u32) -> (Duration, Duration) {
        let pause = self.pause.mul_f64(1.0 + self.spread);
        (self.within * (1_u32 << n.min(4)), pause * (1_u32 << n))
    }
}

/// Where they come in.
#[derive(Clone)]
struct Inbox {
    nav_inputs: SyncSender<NavInput>,
    counters: Arc<Counters>,
    maps: Arc<MapSlot>,
    /// Whether any map has come.
    has_map: Arc<AtomicBool>,
}

impl Inbox {
    fn put(&self, input: NavInput) {
        if self.nav_inputs.try_send(input).is_err() {
            self.counters.overloaded();
        }
    }

    fn fix(&self, clock: &Clock, incoming: &Incoming) {
        match incoming.decode::<Fix>() {
            Ok(fix) => self.put(NavInput::Fix(clock.now(), fix)),
            Err(error) => self.counters.rejected(&error),
        }
    }

    fn route(&self, incoming: &Incoming) {
        match incoming.decode::<Route>() {
            Ok(route) => self.put(NavInput::Route(Box::new(route))),
            Err(error) => self.counters.rejected(&error),
        }
    }

    fn map(&self, incoming: Incoming) {
        self.has_map.store(true, Ordering::Relaxed);
        self.maps.put(incoming, &self.counters);
    }
}

/// Declares `fix`, `route` and the fleet's `map`, and asks for a map that is there already.
///
/// # Errors
/// [`AgentError::Bus`], [`AgentError::Thread`].
pub(crate) async fn declare(
    bus: &Bus,
    fleet: &FleetKeys,
    config: &AgentConfig,
    clock: &Clock,
    ends: &SessionEnds,
    cache: &Arc<MapCache>,
) -> Result<NavInputs, AgentError> {
    let keys = fleet.robot(&config.robot);
    let (nav_inputs, counters) = (ends.nav_inputs.clone(), ends.counters.clone());
    let reading = MapReading::new(nav_inputs.clone(), counters.clone(), cache.clone(), config.map.is_some());
    let map_reader = MapReader::start(reading);
    let inbox = Inbox { nav_inputs, counters, maps: map_reader.slot(), has_map: Arc::default() };
    let (fixes, routes, maps) = (inbox.clone(), inbox.clone(), inbox.clone());
    let clock = clock.clone();
    let subscriptions = [
        bus.subscribe(&keys.fix(), move |incoming| fixes.fix(&clock, &incoming)).await?,
        bus.subscribe(&keys.route(), move |incoming| routes.route(&incoming)).await?,
        bus.subscribe(&fleet.map(), move |incoming| maps.map(incoming)).await?,
    ];
    let (bus, key, asking) = (bus.clone(), fleet.map(), Asking::of(&config.robot));
    let mut _asking = JoinSet::new();
    _asking.spawn(async move { ask_for_map(&bus, &key, &inbox, asking).await });
    Ok(NavInputs { _subscriptions: subscriptions, _asking, _map_reader: map_reader })
}

/// Asks until a map has come, as an answer or published. Nobody has to serve one; who does so later publishes it.
async fn ask_for_map(bus: &Bus, key: &str, inbox: &Inbox, asking: Asking) {
    for n in 0..MOST_QUESTIONS {
        let (within, pause) = asking.nth(n);
        if let Ok(answers) = bus.get(key, within).await
            && let Some(answer) = answers.into_iter().next()
        {
            return inbox.map(answer);
        }
        tokio::time::sleep(pause).await;
        if inbox.has_map.load(Ordering::Relaxed) {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mailbox::mailbox;
    use std::collections::BTreeSet;
    use tokio::sync::mpsc;
    use xtb_bus::{Question, SessionRole};
    use xtb_nav::{Grid, Map};
    use xtb_protocol::codec::Format;
    use xtb_protocol::messages::FleetMap;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_map_server_whose_answer_came_too_late_is_asked_again() {
        let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
        let bus = xtb_bus::open(&role).await.unwrap();
        let key = FleetKeys::new(Name::new("lab").unwrap()).map();
        let (sender, mut questions) = mpsc::unbounded_channel::<Question>();
        let each = move |question| sender.send(question).unwrap_or_default();
        let _service = bus.serve(&key, each).await.unwrap();
        let map = Map::new("lab", Grid::free(0.05, [0.0; 2], 4, 4).unwrap(), vec![]).unwrap();
        let answering = async {
            let _unanswered = questions.recv().await;
            while let Some(question) = questions.recv().await {
                question.reply(&key, &FleetMap::from(&map), Format::Postcard).await.unwrap();
            }
        };
        let (_loop_ends, ends, _) = mailbox();
        let (nav_inputs, counters) = (ends.nav_inputs.clone(), ends.counters.clone());
        let inbox = Inbox { nav_inputs, counters, maps: Arc::default(), has_map: Arc::default() };
        let (within, pause) = (Duration::from_millis(100), Duration::from_millis(5));
        tokio::select! {
            () = ask_for_map(&bus, &key, &inbox, Asking { within, pause, spread: 0.0 }) => {}
            () = answering => {}
        }
        assert!(inbox.has_map.load(Ordering::Relaxed));
    }

    #[test]
    fn questions_for_a_map_become_rarer_and_those_of_many_robots_are_spread() {
        let of = |number: u32| Asking::of(&Name::new(&format!("xtb-{number}")).unwrap());
        let pauses: Vec<Duration> = (0..MOST_QUESTIONS).map(|n| of(1).nth(n).1).collect();
        assert!(pauses.windows(2).all(|two| two[1] == 2 * two[0]), "{pauses:?}");
        let first: Vec<Duration> = (1..=100).map(|number| of(number).nth(0).1).collect();
        let ms = |pause: &Duration| pause.as_millis();
        assert!(first.iter().map(ms).all(|ms| (1000..=2000).contains(&ms)), "{first:?}");
        let tenths: BTreeSet<u128> = first.iter().map(|pause| ms(pause) / 100).collect();
        assert!(tenths.len() >= 9, "{first:?}");
    }
}
