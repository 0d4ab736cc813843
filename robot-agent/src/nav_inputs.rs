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
use crate::map_reader::{MapReader, MapReading, MapShelf, MapSlot};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::Duration;
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Fix, Route};

const ASK_WITHIN: Duration = Duration::from_secs(2);

/// Holds the declarations and the thread that reads maps; dropping it ends them.
pub(crate) struct NavInputs {
    _subscriptions: [Subscription; 3],
    _map_reader: MapReader,
}

/// Where they come in.
#[derive(Clone)]
struct Inbox {
    nav_inputs: SyncSender<NavInput>,
    counters: Arc<Counters>,
    maps: Arc<MapSlot>,
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
    shelf: &Arc<MapShelf>,
) -> Result<NavInputs, AgentError> {
    let keys = fleet.robot(&config.robot);
    let (nav_inputs, counters) = (ends.nav_inputs.clone(), ends.counters.clone());
    let reading = MapReading::new(nav_inputs.clone(), counters.clone(), shelf.clone(), config.map.is_some());
    let map_reader = MapReader::start(&config.robot, reading)?;
    let inbox = Inbox { nav_inputs, counters, maps: map_reader.slot() };
    let (fixes, routes, maps) = (inbox.clone(), inbox.clone(), inbox.clone());
    let clock = clock.clone();
    let subscriptions = [
        bus.subscribe(&keys.fix(), move |incoming| fixes.fix(&clock, &incoming)).await?,
        bus.subscribe(&keys.route(), move |incoming| routes.route(&incoming)).await?,
        bus.subscribe(&fleet.map(), move |incoming| maps.map(incoming)).await?,
    ];
    let (bus, key) = (bus.clone(), fleet.map());
    tokio::spawn(async move {
        // Nobody has to serve one; who does so later publishes it.
        if let Ok(answers) = bus.get(&key, ASK_WITHIN).await
            && let Some(answer) = answers.into_iter().next()
        {
            inbox.map(answer);
        }
    });
    Ok(NavInputs { _subscriptions: subscriptions, _map_reader: map_reader })
}
