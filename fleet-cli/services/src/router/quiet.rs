//! Whether no robot is driven. Listened to only while somebody waits for it: a thousand robots say it 20 times a
//! second.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use xtb_bus::{Bus, BusError, Incoming, Subscription};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::RobotState;

/// Nobody has driven for so long: it is quiet.
const QUIET: Duration = Duration::from_secs(3);

/// Listens to the robots until it is dropped.
pub(super) struct Listening {
    /// When a robot was driven last, or listening began.
    driven: Arc<Mutex<Instant>>,
    _states: Subscription,
}

impl Listening {
    pub(super) async fn open(bus: &Bus, keys: &FleetKeys) -> Result<Self, BusError> {
        let driven = Arc::new(Mutex::new(Instant::now()));
        let seen = Arc::clone(&driven);
        let each = move |incoming: Incoming| {
            if incoming.decode::<RobotState>().is_ok_and(|state| is_driven(&state)) {
                *seen.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
            }
        };
        let _states = bus.subscribe(&keys.any_robot().state(), each).await?;
        Ok(Self { driven, _states })
    }

    pub(super) fn is_quiet(&self) -> bool {
        self.driven.lock().unwrap_or_else(PoisonError::into_inner).elapsed() >= QUIET
    }
}

/// Somebody has control of it, or it has a goal: what a lost link could end.
fn is_driven(state: &RobotState) -> bool {
    state.lease.is_some() || state.goal.is_some()
}
