//! Who is there: liveliness tokens.

use crate::session::{Bus, BusError, failed};
use std::time::Duration;
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
        let replies = self
            .session
            .liveliness()
            .get(key_expr)
            .timeout(within)
            .await
            .map_err(failed("asking for presence", key_expr))?;
        let mut keys = Vec::new();
        while let Ok(reply) = replies.recv_async().await {
            if let Ok(sample) = reply.result() {
                keys.push(sample.key_expr().as_str().to_owned());
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
        let inner = self
            .session
            .liveliness()
            .declare_subscriber(key_expr.to_owned())
            .history(true)
            .callback(move |sample| each(sample.key_expr().as_str(), sample.kind() == SampleKind::Put))
            .await
            .map_err(failed("watching presence", key_expr))?;
        Ok(Presence { _inner: inner })
    }
}
