//! Who is there: liveliness tokens.

use crate::query::answers;
use crate::session::{Bus, BusError, failed};
use std::time::Duration;
use xtb_protocol::keys::{Channel, Key};
use zenoh::sample::SampleKind;

/// Says "alive" until it is dropped or its session ends.
pub struct Token {
    inner: zenoh::liveliness::LivelinessToken,
    key: String,
}

impl Token {
    /// Takes it back.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn withdraw(self) -> Result<(), BusError> {
        self.inner.undeclare().await.map_err(failed("withdrawing presence", &self.key))
    }
}

/// Watches others come and go until it is dropped.
pub struct Presence {
    _inner: zenoh::pubsub::Subscriber<()>,
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
    pub async fn declare_alive(&self, key: &str) -> Result<Token, BusError> {
        let inner = self
            .session
            .liveliness()
            .declare_token(key.to_owned())
            .await
            .map_err(failed("declaring presence", key))?;
        Ok(Token { inner, key: key.to_owned() })
    }

    /// The keys on `key_expr` that are alive now, as far as they are told within `within`.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn alive(&self, key_expr: &str, within: Duration) -> Result<Vec<String>, BusError> {
        let (inlet, mut replies) = answers(key_expr);
        self.session
            .liveliness()
            .get(key_expr)
            .timeout(within)
            .callback(inlet)
            .await
            .map_err(failed("asking for presence", key_expr))?;
        let mut keys = Vec::new();
        while let Some(reply) = replies.recv().await {
            let Ok(sample) = reply.result() else { continue };
            match sample.key_expr().as_str() {
                key if is_presence(key) => keys.push(key.to_owned()),
                other => self.foreign.dropped("presence", other),
            }
        }
        keys.sort();
        keys.dedup();
        Ok(keys)
    }

    /// Calls `each` with a key and whether it is alive: those present first, then each change.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn watch_alive(
        &self,
        key_expr: &str,
        each: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Presence, BusError> {
        let foreign = self.foreign.clone();
        let inner = self
            .session
            .liveliness()
            .declare_subscriber(key_expr.to_owned())
            .history(true)
            .callback(move |sample| match sample.key_expr().as_str() {
                key if is_presence(key) => each(key, sample.kind() == SampleKind::Put),
                other => foreign.dropped("presence", other),
            })
            .await
            .map_err(failed("watching presence", key_expr))?;
        Ok(Presence { _inner: inner })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::Role;
    use std::sync::mpsc;
    use xtb_protocol::keys::{FleetKeys, Name};

    const FLEET: usize = 300;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_large_fleet_is_counted_by_the_session_that_knows_it() {
        let role = Role::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
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
}
