//! A lease for as long as a command needs it: acquired, retained in the background, released.

use crate::client::{Client, accepted};
use crate::error::Result;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::task::JoinHandle;
use xtb_authority::operator::{Operator, RETAIN_MS};
use xtb_protocol::messages::{Body, Done, Lease, Request};
use xtb_protocol::{Name, Uuid};

/// How exactly the 100 ms between two retains are kept.
const LOOK_EVERY: Duration = Duration::from_millis(RETAIN_MS / 5);
/// A retain that takes longer is given up for the next one; 900 ms of silence free the lease.
const RETAIN_WITHIN: Duration = Duration::from_millis(2 * RETAIN_MS);

/// Control of one robot. Dropping it ends the retaining, and so, 900 ms later, the lease.
#[derive(Debug)]
pub struct Control {
    client: Client,
    robot: Name,
    operator: Arc<Mutex<Operator>>,
    keeper: JoinHandle<()>,
}

impl Control {
    /// Acquires the lease and keeps it.
    ///
    /// # Errors
    /// The robot's refusal, or [`Kind::OutcomeUnknown`](crate::Kind::OutcomeUnknown).
    pub async fn acquire(client: &Client, robot: &Name) -> Result<Self> {
        let mut operator = Operator::default();
        let body = Body::Acquire { take: false };
        let reply = client.carry_out(robot, &operator, Uuid::new_v4(), body).await?;
        accepted(robot, &reply)?;
        operator.replied(client.now(), &reply);
        let operator = Arc::new(Mutex::new(operator));
        let keeper = tokio::spawn(keep(client.clone(), robot.clone(), Arc::clone(&operator)));
        Ok(Self { client: client.clone(), robot: robot.clone(), operator, keeper })
    }

    /// The lease, while it is held.
    #[must_use]
    pub fn lease(&self) -> Option<Lease> {
        lock(&self.operator).lease()
    }

    /// Whether somebody else has taken over, or the robot has restarted.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        lock(&self.operator).has_lost()
    }

    /// Asks the robot for something, with the lease; a goal's id is its request's.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub async fn request(&self, id: Uuid, body: Body) -> Result<Done> {
        let operator = lock(&self.operator).clone();
        let reply = self.client.carry_out(&self.robot, &operator, id, body).await?;
        lock(&self.operator).replied(self.client.now(), &reply);
        accepted(&self.robot, &reply)
    }

    /// Gives the lease back. If that is not answered, it runs out by itself.
    pub async fn release(self) {
        self.keeper.abort();
        if self.lease().is_some()
            && let Err(failure) = self.request(Uuid::new_v4(), Body::Release {}).await
        {
            tracing::debug!("releasing the lease: {failure}");
        }
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        self.keeper.abort();
    }
}

async fn keep(client: Client, robot: Name, operator: Arc<Mutex<Operator>>) {
    let keys = client.keys().robot(&robot);
    let mut look = tokio::time::interval(LOOK_EVERY);
    loop {
        look.tick().await;
        let due = {
            let mut operator = lock(&operator);
            operator.retain(client.now()).map(|body| (operator.lease(), body))
        };
        let Some((lease, body)) = due else { continue };
        let request = Request { id: Uuid::new_v4(), lease, body };
        match client.bus().ask(&keys, client.name(), &request, RETAIN_WITHIN).await {
            Ok(Some(reply)) => lock(&operator).replied(client.now(), &reply),
            Ok(None) => tracing::debug!("{robot} did not answer a retain"),
            Err(error) => tracing::debug!("retaining the lease of {robot}: {error}"),
        }
    }
}

/// A panic elsewhere does not make the book unreadable.
fn lock(operator: &Mutex<Operator>) -> MutexGuard<'_, Operator> {
    operator.lock().unwrap_or_else(PoisonError::into_inner)
}
