//! Several robots that are asked at the same time: the more there are, the later one of them is asked again by
//! itself, and whoever asks the whole fleet looks at all of them at once. Else the questions for hundreds of robots
//! keep a router from passing on the answers.

use crate::client::Client;
use crate::error::Result;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::{Notify, watch};
use tokio::task::JoinSet;
use tokio::time::Instant;
use xtb_protocol::Name;
use xtb_protocol::messages::RobotState;

/// Up to twice as many robots at the same time are each asked again as soon as one alone would be.
const UNHURRIED: usize = 50;
/// The most times that a pause gets as long: that of a thousand robots, so that names which somebody has invented delay
/// nobody further.
const SLOWEST: usize = 20;

/// Before a look at all robots, where for few it would be this; a look may take four times as long, a later one
/// [`LOOKS_LONGER`] times that.
const LOOK_EVERY: Duration = Duration::from_millis(25);
const LOOKS_LONGER: u32 = 4;

/// All who are being asked at the same time; each has a copy while it is.
#[derive(Debug, Clone, Default)]
pub struct Crowd(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// One question goes to all beside those to each.
    together: AtomicBool,
    /// Somebody waits for a look.
    wanted: Notify,
    looks: watch::Sender<Option<Arc<Look>>>,
}

/// The answers of all robots to one question each.
#[derive(Debug)]
pub(crate) struct Look {
    asked: Instant,
    /// Who is there.
    pub(crate) alive: Result<BTreeSet<Name>>,
    states: BTreeMap<Name, Vec<RobotState>>,
}

impl Crowd {
    /// Before one of them is asked again, where for few `pause` is right.
    pub(crate) fn pause(&self, pause: Duration) -> Duration {
        let robots = Arc::strong_count(&self.0);
        pause * (robots / UNHURRIED).clamp(1, SLOWEST) as u32
    }

    fn are_many(&self) -> bool {
        Arc::strong_count(&self.0) >= 2 * UNHURRIED
    }

    /// How long an answer to the question to all is waited for before one of many robots is asked by itself.
    pub(crate) fn head_start(&self, pause: Duration) -> Duration {
        let together = self.0.together.load(Ordering::Relaxed);
        if together && self.are_many() { self.pause(pause) } else { Duration::ZERO }
    }

    /// From now on all are asked at once too, for as long as what is returned is held.
    pub(crate) fn together(&self, client: &Client) -> JoinSet<()> {
        self.0.together.store(true, Ordering::Relaxed);
        let mut looking = JoinSet::new();
        looking.spawn(self.clone().look(client.clone()));
        looking
    }

    async fn look(self, client: Client) {
        let mut longer = 1;
        loop {
            self.0.wanted.notified().await;
            if self.are_many() {
                // Commands and their answers go first.
                tokio::time::sleep(self.pause(LOOK_EVERY)).await;
                let look = Look::take(&client, self.pause(4 * LOOK_EVERY) * longer).await;
                self.0.looks.send_replace(Some(Arc::new(look)));
                longer = (longer * 2).min(LOOKS_LONGER);
            }
        }
    }

    /// Looks at all that begin from now on, if anybody takes them.
    pub(crate) fn looks(&self) -> Looks<'_> {
        Looks { crowd: self, looks: self.0.looks.subscribe(), since: Instant::now() }
    }
}

impl Look {
    async fn take(client: &Client, within: Duration) -> Self {
        let asked = Instant::now();
        let key_expr = client.keys().any_robot().state();
        let within = client.round_trip().patience(within);
        let (alive, answers) = tokio::join!(client.alive(), client.bus().get(&key_expr, within));
        let answers = answers.inspect_err(|error| tracing::debug!("{error}")).unwrap_or_default();
        let mut states = BTreeMap::<Name, Vec<RobotState>>::new();
        for state in answers.iter().filter_map(|answer| answer.decode::<RobotState>().ok()) {
            states.entry(state.robot.clone()).or_default().push(state);
        }
        Self { asked, alive, states }
    }

    /// What is said to be the state of this one.
    pub(crate) fn states(&self, robot: &Name) -> &[RobotState] {
        self.states.get(robot).map_or(&[], Vec::as_slice)
    }
}

/// One after the other.
pub(crate) struct Looks<'a> {
    crowd: &'a Crowd,
    looks: watch::Receiver<Option<Arc<Look>>>,
    since: Instant,
}

impl Looks<'_> {
    pub(crate) async fn next(&mut self) -> Arc<Look> {
        loop {
            self.crowd.0.wanted.notify_one();
            // The sender lives as long as the crowd.
            self.looks.changed().await.unwrap_or_default();
            match &*self.looks.borrow_and_update() {
                Some(look) if look.asked >= self.since => return Arc::clone(look),
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{self, FakeRobot, name};
    use xtb_bus::Question;
    use xtb_protocol::codec::Format;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_look_shows_who_is_there_and_nobody_speaks_for_another_robot() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let _robot = FakeRobot::start(&client, "xtb-1").await;
        let (key, runtime) = (client.keys().robot(&name("xtb-2")).state(), tokio::runtime::Handle::current());
        let own_key = key.clone();
        let another = move |question: Question| {
            let own_key = own_key.clone();
            runtime.spawn(async move {
                question.reply(&own_key, &fake::state("xtb-1"), Format::Postcard).await.unwrap();
            });
        };
        let _another = client.bus().serve(&key, another).await.unwrap();
        let crowd = Crowd::default();
        let _many = vec![crowd.clone(); 100];
        let _looking = crowd.together(&client);
        let mut looks = crowd.looks();
        let (first, second) = (looks.next().await, looks.next().await);
        assert!(first.asked >= looks.since && second.asked > first.asked);
        for look in [first, second] {
            assert_eq!(look.alive.as_ref().unwrap(), &BTreeSet::from([name("xtb-1")]));
            assert_eq!(look.states(&name("xtb-1")).len(), 1);
            assert!(look.states(&name("xtb-2")).is_empty());
        }
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn only_one_of_many_who_are_asked_together_is_asked_by_itself_later() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let (crowd, pause) = (Crowd::default(), Duration::from_millis(50));
        let mut asked = vec![crowd.clone(); 499];
        assert_eq!(crowd.head_start(pause), Duration::ZERO);
        let looking = crowd.together(&client);
        assert_eq!(crowd.head_start(pause), 10 * pause);
        asked.truncate(50);
        assert_eq!(crowd.head_start(pause), Duration::ZERO);
        drop(looking);
    }

    #[test]
    fn the_more_are_asked_the_later_each_is_asked_again() {
        let (crowd, pause) = (Crowd::default(), Duration::from_millis(50));
        let mut asked = vec![crowd.clone(); 98];
        assert_eq!(crowd.pause(pause), pause);
        asked.resize(499, crowd.clone());
        assert_eq!(crowd.pause(pause), 10 * pause);
        asked.resize(99_999, crowd.clone());
        assert_eq!(crowd.pause(pause), 20 * pause);
        asked.clear();
        assert_eq!(crowd.pause(pause), pause);
    }
}
