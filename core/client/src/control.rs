//! A lease for as long as a command needs it: acquired, or taken from its holder; retained in the
//! background; released.
//!
//! Retains are sent each 100 ms whether or not those before were answered: however long a round trip takes, the
//! robot hears one each 100 ms.

use crate::client::{Client, accepted};
use crate::error::{Error, ErrorKind, Result};
use crate::state_feed::StateFeed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::MissedTickBehavior;
use xtb_control::Stamp;
use xtb_protocol::messages::{Body, Done, ErrorBody, Lease, Outcome, RejectCode, Reply, Request};
use xtb_protocol::{Name, Uuid};
use xtb_robot::operator::{Operator, RETAIN_MS};

/// How exactly the 100 ms between two retains are kept.
const LOOK_EVERY: Duration = Duration::from_millis(RETAIN_MS / 5);
/// The answer to a retain is waited for so long, longer on a slow link.
const RETAIN_WITHIN: Duration = Duration::from_millis(5 * RETAIN_MS);
/// And at most.
const RETAIN_WITHIN_MOST: Duration = Duration::from_secs(4);
/// Retains on their way at most: those of the longest wait. One more is left out.
const RETAINS: usize = 48;

/// The client's standing with the robot.
#[derive(Debug, Default)]
struct Book {
    operator: Operator,
    lost: Option<Error>,
}

impl Book {
    fn replied(&mut self, now: Stamp, robot: &Name, reply: &Reply) {
        match &reply.result {
            Outcome::Error(error) if error.code == RejectCode::LeaseLost => {
                self.lost.get_or_insert_with(|| lost(robot, error));
            }
            Outcome::Ok(Done { lease: Some(_), .. }) => self.lost = None,
            _ => {}
        }
        self.operator.replied(now, reply);
    }
}

/// Control of one robot. Dropping it ends the retaining, and so, 900 ms later, the lease.
#[derive(Debug)]
pub struct Control {
    client: Client,
    robot: Name,
    book: Arc<Mutex<Book>>,
    taken_from: Option<String>,
    keeper: JoinHandle<()>,
}

impl Control {
    /// Acquires the lease and keeps it. With `take` it is taken from its holder, if it has one.
    ///
    /// # Errors
    /// The robot's refusal ([`RejectCode::LeaseHeld`] names the holder), or
    /// [`ErrorKind::OutcomeUnknown`].
    pub async fn acquire(client: &Client, robot: &Name, take: bool) -> Result<Self> {
        let mut book = Book::default();
        let mut reply = ask(client, robot, &book.operator, false).await?;
        let mut taken_from = None;
        if take && is_held(&reply) {
            taken_from = Some(holder(client, robot).await);
            reply = ask(client, robot, &book.operator, true).await?;
        }
        if accepted(robot, &reply)?.lease.is_none() {
            let message = format!("the reply for {robot} has no lease, so it is not from a robot");
            return Err(Error::new(ErrorKind::OutcomeUnknown, message)
                .hint("`fleet-cli doctor` finds programs that answer with a robot's name"));
        }
        book.replied(client.now(), robot, &reply);
        let book = Arc::new(Mutex::new(book));
        let keeper = Keeper { client: client.clone(), robot: robot.clone(), book: Arc::clone(&book) };
        let keeper = tokio::spawn(keeper.keep());
        Ok(Self { client: client.clone(), robot: robot.clone(), book, taken_from, keeper })
    }

    /// Which robot.
    #[must_use]
    pub fn robot(&self) -> &Name {
        &self.robot
    }

    /// Who controls: this client.
    #[must_use]
    pub fn client_name(&self) -> &Name {
        self.client.name()
    }

    /// From whom it was taken; `None` = nobody held it.
    #[must_use]
    pub fn taken_from(&self) -> Option<&str> {
        self.taken_from.as_deref()
    }

    /// The lease, while it is held.
    #[must_use]
    pub fn lease(&self) -> Option<Lease> {
        lock(&self.book).operator.lease()
    }

    /// Whether somebody else has taken over, or the robot has restarted.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        lock(&self.book).operator.has_lost()
    }

    /// What the robot said when the lease was lost; `None` while it is held.
    #[must_use]
    pub fn lost(&self) -> Option<Error> {
        lock(&self.book).lost.clone()
    }

    /// Who has control instead of this client, in words, if the robot's states show somebody.
    #[must_use]
    pub fn taken_by(&self, feed: &StateFeed) -> Option<String> {
        let seen = feed.last(&self.robot)?;
        let holder = &seen.fresh()?.lease.as_ref()?.holder;
        (holder != self.client_name()).then(|| format!("{} is now controlled by {holder}", self.robot))
    }

    /// Acquires a lost lease again, unless somebody else holds it now.
    ///
    /// # Errors
    /// As [`Control::acquire`].
    pub async fn regain(&self) -> Result<()> {
        let reply = ask(&self.client, &self.robot, &Operator::default(), false).await?;
        accepted(&self.robot, &reply)?;
        lock(&self.book).replied(self.client.now(), &self.robot, &reply);
        Ok(())
    }

    /// Asks the robot for something, with the lease; a goal's id is its request's.
    ///
    /// # Errors
    /// As [`Client::request`]; with a lease that is lost, how it was lost.
    pub async fn request(&self, id: Uuid, body: Body) -> Result<Done> {
        if let Some(failure) = self.lost() {
            return Err(failure);
        }
        let operator = lock(&self.book).operator.clone();
        let reply = self.client.carry_out(&self.robot, &operator, id, body).await?;
        lock(&self.book).replied(self.client.now(), &self.robot, &reply);
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

async fn ask(client: &Client, robot: &Name, operator: &Operator, take: bool) -> Result<Reply> {
    client.carry_out(robot, operator, Uuid::new_v4(), Body::Acquire { take }).await
}

fn is_held(reply: &Reply) -> bool {
    matches!(&reply.result, Outcome::Error(error) if error.code == RejectCode::LeaseHeld)
}

/// Who holds it, as far as the state tells.
async fn holder(client: &Client, robot: &Name) -> String {
    let states = client.states(&client.keys().robot(robot)).await.unwrap_or_default();
    let lease = states.get(robot).and_then(|seen| seen.state.lease.as_ref());
    lease.map_or_else(|| "another client".to_owned(), |lease| lease.holder.to_string())
}

fn lost(robot: &Name, error: &ErrorBody) -> Error {
    Error::new(ErrorKind::Refused(error.code), format!("control of {robot} lost: {}", error.message)).hint(
        format!(
            "`fleet-cli why {robot}` shows its controlling client and state; use --take to take \
                       control again"
        ),
    )
}

/// Retains a lease in time.
struct Keeper {
    client: Client,
    robot: Name,
    book: Arc<Mutex<Book>>,
}

impl Keeper {
    async fn keep(self) {
        let mut look = tokio::time::interval(LOOK_EVERY);
        look.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let mut asked = JoinSet::new();
        loop {
            tokio::select! {
                _ = look.tick() => {
                    if asked.len() < RETAINS && let Some((lease, body)) = self.due() {
                        let request = Request { id: Uuid::new_v4(), lease, body };
                        asked.spawn(retain(self.client.clone(), self.robot.clone(), request));
                    }
                }
                Some(answer) = asked.join_next() => {
                    if let Ok(Some((lease, reply))) = answer {
                        self.answered(lease, &reply);
                    }
                }
            }
        }
    }

    /// The retain that is due now.
    fn due(&self) -> Option<(Option<Lease>, Body)> {
        let operator = &mut lock(&self.book).operator;
        let body = operator.retain(self.client.now())?;
        Some((operator.lease(), body))
    }

    /// An answer about a lease that has been replaced meanwhile says nothing of the present one.
    fn answered(&self, lease: Option<Lease>, reply: &Reply) {
        let mut book = lock(&self.book);
        if book.operator.lease() == lease {
            book.replied(self.client.now(), &self.robot, reply);
        }
    }
}

/// One retain, and what came of it.
async fn retain(client: Client, robot: Name, request: Request) -> Option<(Option<Lease>, Reply)> {
    let keys = client.keys().robot(&robot);
    let within = client.round_trip().patience(RETAIN_WITHIN).min(RETAIN_WITHIN_MOST);
    let asked = Instant::now();
    match client.bus().ask(&keys, client.name(), &request, within).await {
        Ok(Some(reply)) => {
            client.measured(asked.elapsed());
            return Some((request.lease, reply));
        }
        Ok(None) => tracing::debug!("{robot} did not answer a retain"),
        Err(error) => tracing::debug!("retaining the lease of {robot}: {error}"),
    }
    None
}

/// A panic elsewhere does not make the book unreadable.
fn lock(book: &Mutex<Book>) -> MutexGuard<'_, Book> {
    book.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{FakeRobot, name};

    const PATIENT: Duration = Duration::from_secs(30);

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_held_lease_is_refused_with_its_holder_and_taken_when_told_to() {
        let client = Client::alone(PATIENT).await;
        let (robot, other) = (name("xtb-1"), name("cli-123456"));
        let fake = FakeRobot::start(&client, "xtb-1").await;
        fake.lock().grant(&other);
        let failure = Control::acquire(&client, &robot, false).await.unwrap_err();
        assert_eq!(failure.kind, ErrorKind::Refused(RejectCode::LeaseHeld));
        assert!(failure.message.contains("cli-123456"), "{failure}");
        let control = Control::acquire(&client, &robot, true).await.unwrap();
        assert_eq!(control.taken_from(), Some("cli-123456"));
        control.request(Uuid::new_v4(), Body::Reset { latch: None }).await.unwrap();
        control.release().await;
        assert_eq!(fake.lock().lease, None);
        assert_eq!(Control::acquire(&client, &robot, true).await.unwrap().taken_from(), None);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_lease_that_is_taken_away_is_noticed_and_nothing_more_is_asked_with_it() {
        let client = Client::alone(PATIENT).await;
        let robot = name("xtb-1");
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let control = Control::acquire(&client, &robot, false).await.unwrap();
        assert!(control.lost().is_none() && control.lease().is_some());
        fake.lock().grant(&name("other"));
        let mut look = tokio::time::interval(LOOK_EVERY);
        while control.lost().is_none() {
            look.tick().await;
        }
        let before = fake.lock().asked.len();
        let failure = control.request(Uuid::new_v4(), Body::Reset { latch: None }).await.unwrap_err();
        assert_eq!(failure.kind, ErrorKind::Refused(RejectCode::LeaseLost));
        assert_eq!(fake.lock().asked.len(), before);
        assert!(control.regain().await.is_err(), "somebody else holds it");
        fake.lock().lease = None;
        control.regain().await.unwrap();
        assert!(control.lost().is_none() && control.lease().is_some());
    }
}
