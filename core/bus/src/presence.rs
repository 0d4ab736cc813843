//! Who is there: liveliness tokens.

use crate::query::answers;
use crate::session::{Bus, BusError, failed};
use crate::watched::lock;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use xtb_protocol::keys::{Channel, Key};
use zenoh::sample::SampleKind;

/// Says "alive" until it is dropped or its session ends.
pub struct PresenceToken {
    inner: zenoh::liveliness::LivelinessToken,
    key: String,
}

impl PresenceToken {
    /// Takes it back.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn withdraw(self) -> Result<(), BusError> {
        self.inner.undeclare().await.map_err(failed("withdrawing presence", &self.key))
    }
}

/// Watches others come and go until it is dropped.
pub struct PresenceWatch {
    _inner: zenoh::pubsub::Subscriber<()>,
    /// Kept for the session's [`Watched`](crate::watched::Watched).
    _there: Arc<Mutex<BTreeSet<String>>>,
}

/// Whether a key stands for somebody's presence. A token can stand on an expression with wildcards too:
/// that is nobody.
fn is_presence(key: &str) -> bool {
    let channel = Key::parse(key).map(|key| key.channel);
    matches!(channel, Some(Channel::Alive | Channel::TrafficAlive | Channel::DispatchAlive))
}

impl Bus {
    /// Declares presence on `key`.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn declare_alive(&self, key: &str) -> Result<PresenceToken, BusError> {
        let inner = self
            .session
            .liveliness()
            .declare_token(key.to_owned())
            .await
            .map_err(failed("declaring presence", key))?;
        Ok(PresenceToken { inner, key: key.to_owned() })
    }

    /// The keys on `key_expr` that are alive now, as far as they are told within `within`.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn alive(&self, key_expr: &str, within: Duration) -> Result<Vec<String>, BusError> {
        let (keys, _) = self.ask_alive(key_expr, within).await?;
        Ok(keys.into_iter().collect())
    }

    /// Whether this key is alive now.
    ///
    /// # Errors
    /// [`BusError::Operation`], also if nobody says so within `within`.
    pub async fn is_alive(&self, key: &str, within: Duration) -> Result<bool, BusError> {
        let (keys, all_told) = self.ask_alive(key, within).await?;
        if keys.is_empty() && !all_told {
            let reason = format!("no answer within {} ms", within.as_millis());
            return Err(BusError::Operation { what: "asking for presence", key: key.to_owned(), reason });
        }
        Ok(!keys.is_empty())
    }

    /// The keys that are alive, and whether these are all.
    async fn ask_alive(
        &self,
        key_expr: &str,
        within: Duration,
    ) -> Result<(BTreeSet<String>, bool), BusError> {
        let (inlet, mut replies) = answers(key_expr);
        self.session
            .liveliness()
            .get(key_expr)
            .timeout(within)
            .callback(inlet)
            .await
            .map_err(failed("asking for presence", key_expr))?;
        let (mut keys, mut all_told) = (BTreeSet::new(), true);
        while let Some(reply) = replies.recv().await {
            let Ok(sample) = reply.result() else {
                all_told = false; // Time is up.
                continue;
            };
            match sample.key_expr().as_str() {
                key if is_presence(key) => _ = keys.insert(key.to_owned()),
                other => self.foreign.dropped("presence", other),
            }
        }
        keys.extend(self.watched.on(key_expr));
        Ok((keys, all_told))
    }

    /// Calls `each` with a key and whether it is alive: those present first, then each change.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn watch_alive(
        &self,
        key_expr: &str,
        each: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<PresenceWatch, BusError> {
        let (foreign, there) = (self.foreign.clone(), self.watched.begin());
        let told = Arc::downgrade(&there);
        let inner = self
            .session
            .liveliness()
            .declare_subscriber(key_expr.to_owned())
            .history(true)
            .callback(move |sample| match sample.key_expr().as_str() {
                key if is_presence(key) => {
                    // A token that came too late for a question is told once more.
                    let is_there = sample.kind() == SampleKind::Put;
                    let change = |there: Arc<Mutex<BTreeSet<String>>>| {
                        let mut there = lock(&there);
                        if is_there { there.insert(key.to_owned()) } else { there.remove(key) }
                    };
                    if told.upgrade().is_some_and(change) {
                        each(key, is_there);
                    }
                }
                other => foreign.dropped("presence", other),
            })
            .await
            .map_err(failed("watching presence", key_expr))?;
        Ok(PresenceWatch { _inner: inner, _there: there })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::SessionRole;
    use std::sync::mpsc;
    use xtb_protocol::keys::{FleetKeys, Name};

    const FLEET: usize = 300;
    const QUESTIONS: usize = 1000;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_large_fleet_is_counted_by_the_session_that_knows_it() {
        let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
        let bus = crate::open(&role).await.unwrap();
        let mut tokens = Vec::new();
        let keys = FleetKeys::new(Name::new("lab").unwrap());
        for robot in 0..FLEET {
            let robot = Name::new(&format!("xtb-{robot}")).unwrap();
            tokens.push(bus.declare_alive(&keys.robot(&robot).alive()).await.unwrap());
        }
        let anybody = keys.any_robot().alive();
        // On a thread of its own: what does not return would hold up the test too.
        let (sender, found) = mpsc::channel();
        let (asking, runtime) = (bus.clone(), tokio::runtime::Handle::current());
        std::thread::spawn(move || {
            let alive = runtime.block_on(asking.alive(&anybody, Duration::from_secs(10)));
            let _ = sender.send(alive.map(|keys| keys.len()));
        });
        let found = tokio::task::spawn_blocking(move || found.recv_timeout(Duration::from_secs(20)));
        assert_eq!(found.await.unwrap().expect("asking does not return").unwrap(), FLEET);
    }

    /// Zenoh itself leaves tokens out here, several in a hundred times on a busy computer.
    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_watches_presence_and_asks_for_it_too_is_told_of_everybody_each_time() {
        let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
        let router = crate::open(&role).await.unwrap();
        let role = SessionRole::Client { connect: router.locators().await };
        let (robots, asker) = (crate::open(&role).await.unwrap(), crate::open(&role).await.unwrap());
        let keys = FleetKeys::new(Name::new("lab").unwrap());
        let each = ["xtb-1", "xtb-2", "xtb-3"].map(|robot| keys.robot(&Name::new(robot).unwrap()).alive());
        let mut tokens = Vec::new();
        for key in &each {
            tokens.push(robots.declare_alive(key).await.unwrap());
        }
        let anybody = keys.any_robot().alive();
        let (sender, mut changes) = tokio::sync::mpsc::unbounded_channel();
        let watch = move |key: &str, there| sender.send((key.to_owned(), there)).unwrap_or_default();
        let _presence = asker.watch_alive(&anybody, watch).await.unwrap();
        for _ in 0..each.len() {
            assert!(changes.recv().await.unwrap().1);
        }
        let within = Duration::from_secs(30);
        for round in 0..QUESTIONS {
            let (all, one, two, three) = tokio::join!(
                asker.alive(&anybody, within),
                asker.alive(&each[0], within),
                asker.alive(&each[1], within),
                asker.alive(&each[2], within),
            );
            assert_eq!(all.unwrap(), each, "round {round}");
            assert_eq!([one, two, three].map(|keys| keys.unwrap().concat()), each, "round {round}");
        }
        tokens.pop().unwrap().withdraw().await.unwrap();
        assert_eq!(changes.recv().await.unwrap(), (each[2].clone(), false));
        assert_eq!(asker.alive(&anybody, within).await.unwrap(), each[..2]);
        assert_eq!(asker.alive(&each[2], within).await.unwrap(), Vec::<String>::new());
        router.close().await;
        let mut gone = [changes.recv().await.unwrap(), changes.recv().await.unwrap()];
        gone.sort();
        assert_eq!(gone, [(each[0].clone(), false), (each[1].clone(), false)]);
        assert_eq!(asker.alive(&anybody, within).await.unwrap(), Vec::<String>::new(), "without a link");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_is_there_is_not_absent_because_nobody_says_so_in_time() {
        let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
        let router = crate::open(&role).await.unwrap();
        let key = FleetKeys::new(Name::new("lab").unwrap()).robot(&Name::new("xtb-1").unwrap()).alive();
        let _token = router.declare_alive(&key).await.unwrap();
        let asker = crate::open(&SessionRole::Client { connect: router.locators().await }).await.unwrap();
        let patience = Duration::from_secs(30);
        assert!(asker.is_alive(&key, patience).await.unwrap());
        for within in [Duration::ZERO, Duration::from_micros(100), patience] {
            let told = asker.is_alive(&key, within).await;
            assert!(!matches!(told, Ok(false)), "asked for {within:?}");
        }
        let nobody = FleetKeys::new(Name::new("lab").unwrap()).robot(&Name::new("xtb-2").unwrap()).alive();
        assert!(!asker.is_alive(&nobody, patience).await.unwrap());
    }
}
