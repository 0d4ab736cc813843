//! A client of one robot as a test needs it: acquires, retains, bears the lease, answers the state.

use crate::{ASK_WITHIN, eventually, name};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::task::JoinHandle;
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_control::Stamp;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys, RobotKeys};
use xtb_protocol::messages::{Body, Lease, Outcome, RejectCode, Request, RobotState, Setpoint};
use xtb_protocol::{Name, Uuid};
use xtb_robot::Operator;

const KEEP_EVERY: Duration = Duration::from_millis(5);
const RETAIN_WITHIN: Duration = Duration::from_millis(200);

/// See the module's documentation. Dropping it is a client's sudden death.
pub struct Pilot {
    bus: Bus,
    keys: RobotKeys,
    client: Name,
    began: Instant,
    operator: Arc<Mutex<Operator>>,
    keeper: JoinHandle<()>,
    _states: Subscription,
}

impl Drop for Pilot {
    fn drop(&mut self) {
        self.keeper.abort();
    }
}

fn lock(operator: &Mutex<Operator>) -> MutexGuard<'_, Operator> {
    operator.lock().unwrap_or_else(PoisonError::into_inner)
}

fn stamp(began: Instant) -> Stamp {
    Stamp::from_ns(began.elapsed().as_nanos() as u64)
}

impl Pilot {
    /// A client called `client` that listens to a robot; it holds no lease yet.
    ///
    /// # Panics
    /// If Zenoh fails.
    pub async fn new(bus: &Bus, fleet: &str, robot: &str, client: &str) -> Self {
        let keys = FleetKeys::new(name(fleet)).robot(&name(robot));
        let (operator, began, client) = (Arc::<Mutex<Operator>>::default(), Instant::now(), name(client));
        let heard = operator.clone();
        let hear = move |incoming: Incoming| {
            if let Ok(state) = incoming.decode::<RobotState>() {
                lock(&heard).saw(state.tick_ms);
            }
        };
        let states = bus.subscribe(&keys.state(), hear).await.unwrap_or_else(|error| panic!("{error}"));
        let keeper = tokio::spawn(keep(bus.clone(), keys.clone(), client.clone(), operator.clone(), began));
        Self { bus: bus.clone(), keys, client, began, operator, keeper, _states: states }
    }

    /// Asks with the lease until the robot answers; acquires it when that is what is missing.
    ///
    /// # Panics
    /// If nobody answers in time.
    pub async fn ask(&self, body: Body) -> Outcome {
        loop {
            let outcome = self.ask_once(body.clone()).await;
            match &outcome {
                Outcome::Error(error)
                    if matches!(error.code, RejectCode::LeaseRequired | RejectCode::LeaseLost) =>
                {
                    if let Outcome::Error(error) = self.ask_once(Body::Acquire { take: false }).await {
                        return Outcome::Error(error);
                    }
                }
                _ => return outcome,
            }
        }
    }

    /// Asks with what lease there is, until the robot answers.
    ///
    /// # Panics
    /// If nobody answers in time.
    pub async fn ask_once(&self, body: Body) -> Outcome {
        let lease = if matches!(body, Body::Acquire { .. }) { None } else { self.lease() };
        let request = Request { id: Uuid::new_v4(), lease, body };
        let reply = eventually("a reply", || async {
            let reply = self.bus.ask(&self.keys, &self.client, &request, ASK_WITHIN).await;
            reply.unwrap_or_else(|error| panic!("{error}"))
        })
        .await;
        lock(&self.operator).replied(stamp(self.began), &reply);
        reply.result
    }

    /// The lease that is held.
    #[must_use]
    pub fn lease(&self) -> Option<Lease> {
        lock(&self.operator).lease()
    }

    /// The next setpoint, once the lease is held and a state was seen.
    #[must_use]
    pub fn next_setpoint(&self, rpm: f64, steering: f64) -> Option<Setpoint> {
        lock(&self.operator).setpoint(rpm, steering)
    }

    /// Sends the next setpoint; acquires the lease first if need be.
    ///
    /// # Panics
    /// If Zenoh fails or the lease is refused.
    pub async fn setpoint(&self, rpm: f64, steering: f64) {
        if self.lease().is_none() {
            let granted = self.ask_once(Body::Acquire { take: false }).await;
            assert!(matches!(granted, Outcome::Ok(_)), "{granted:?}");
        }
        if let Some(setpoint) = self.next_setpoint(rpm, steering) {
            self.put(&setpoint).await;
        }
    }

    /// Sends a setpoint as it is.
    ///
    /// # Panics
    /// If Zenoh fails.
    pub async fn put(&self, setpoint: &Setpoint) {
        let (key, channel) = (self.keys.teleop(Some(&self.client)), Channel::Teleop(self.client.clone()));
        let sent = self.bus.put(&key, &channel, setpoint, Format::Postcard).await;
        sent.unwrap_or_else(|error| panic!("{error}"));
    }
}

/// Retains the lease whenever that is due.
async fn keep(bus: Bus, keys: RobotKeys, client: Name, operator: Arc<Mutex<Operator>>, began: Instant) {
    let mut look = tokio::time::interval(KEEP_EVERY);
    loop {
        look.tick().await;
        let due = {
            let mut operator = lock(&operator);
            operator.retain(stamp(began)).map(|body| (operator.lease(), body))
        };
        let Some((lease, body)) = due else { continue };
        let request = Request { id: Uuid::new_v4(), lease, body };
        if let Ok(Some(reply)) = bus.ask(&keys, &client, &request, RETAIN_WITHIN).await {
            lock(&operator).replied(stamp(began), &reply);
        }
    }
}
