//! What the second level hears from Zenoh: measured poses, traffic control's paths, the fleet's map.
//!
//! The callbacks run on Zenoh's threads and never wait. What cannot be read is counted as rejected, what
//! finds the queue full as overloaded; a newer pose or path follows.

use crate::clock::Clock;
use crate::config::AgentConfig;
use crate::counters::Counters;
use crate::mailbox::{NavInput, SessionEnds};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use xtb_bus::{Bus, BusError, Incoming, Subscription};
use xtb_nav::map::Map;
use xtb_nav::navigator::PreparedMap;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Fix, FleetMap, MapHash, Route};

const ASK_WITHIN: Duration = Duration::from_secs(2);

/// Holds the declarations; dropping it ends them.
pub(crate) struct NavInputs {
    _subscriptions: [Subscription; 3],
}

/// Where they come in.
#[derive(Clone)]
struct Inbox {
    nav_inputs: SyncSender<NavInput>,
    counters: Arc<Counters>,
    /// The robot has a map of its own.
    own_map: bool,
    /// The map that was told last: it is published again and again.
    told: Arc<Mutex<Option<MapHash>>>,
}

impl Inbox {
    /// Whether there was room for it.
    fn put(&self, input: NavInput) -> bool {
        let put = self.nav_inputs.try_send(input).is_ok();
        if !put {
            self.counters.overloaded();
        }
        put
    }

    fn fix(&self, clock: &Clock, incoming: &Incoming) {
        match incoming.decode::<Fix>() {
            Ok(fix) => drop(self.put(NavInput::Fix(clock.now(), fix))),
            Err(error) => self.counters.rejected(&error),
        }
    }

    fn route(&self, incoming: &Incoming) {
        match incoming.decode::<Route>() {
            Ok(route) => drop(self.put(NavInput::Route(Box::new(route)))),
            Err(error) => self.counters.rejected(&error),
        }
    }

    fn map(&self, incoming: &Incoming) {
        let message = match incoming.decode::<FleetMap>() {
            Ok(message) => message,
            Err(error) => return self.counters.rejected(&error),
        };
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if *told == Some(message.hash) {
            return;
        }
        if !self.own_map {
            let map = match Map::try_from(&message) {
                Ok(map) => map,
                Err(error) => {
                    return tracing::warn!("the fleet's map {} cannot be used: {error}", message.name);
                }
            };
            // Measured here, not in the control loop. Without room for it, it is published again.
            if !self.put(NavInput::Floor(Arc::new(PreparedMap::of(map)))) {
                return;
            }
        }
        if self.put(NavInput::FleetMap(message.hash)) {
            *told = Some(message.hash);
        }
    }
}

/// Declares `fix`, `route` and the fleet's `map`, and asks for a map that is there already.
///
/// # Errors
/// [`BusError`].
pub(crate) async fn declare(
    bus: &Bus,
    fleet: &FleetKeys,
    config: &AgentConfig,
    clock: &Clock,
    ends: &SessionEnds,
) -> Result<NavInputs, BusError> {
    let keys = fleet.robot(&config.robot);
    let own_map = config.map.is_some();
    let inbox = Inbox {
        nav_inputs: ends.nav_inputs.clone(),
        counters: ends.counters.clone(),
        own_map,
        told: Arc::default(),
    };
    let (fixes, routes, maps) = (inbox.clone(), inbox.clone(), inbox.clone());
    let clock = clock.clone();
    let subscriptions = [
        bus.subscribe(&keys.fix(), move |incoming| fixes.fix(&clock, &incoming)).await?,
        bus.subscribe(&keys.route(), move |incoming| routes.route(&incoming)).await?,
        bus.subscribe(&fleet.map(), move |incoming| maps.map(&incoming)).await?,
    ];
    let (bus, key) = (bus.clone(), fleet.map());
    tokio::spawn(async move {
        // Nobody has to serve one; who does so later publishes it.
        if let Ok(answers) = bus.get(&key, ASK_WITHIN).await
            && let Some(answer) = answers.first()
        {
            inbox.map(answer);
        }
    });
    Ok(NavInputs { _subscriptions: subscriptions })
}
