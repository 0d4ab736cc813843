//! Listening on any keys of ours, for `watch`, `record` and the screens: what is published, the
//! answers of those who only answer, and presence, all through one inlet. What is published comes in as it
//! is, on keys that are none of ours too: [`AnyMessage`](crate::messages::AnyMessage) tells them apart.

pub mod plan;

use crate::client::Client;
use crate::error::{Error, ErrorKind};
use plan::WatchPlan;
use std::sync::Arc;
use tokio::task::JoinSet;
use xtb_bus::{BusError, Incoming, PresenceWatch, Subscription};

/// Something that came in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Item {
    /// A message or an answer.
    Message(Incoming),
    /// A key that is now alive, or is not any more.
    Presence(String, bool),
}

/// Takes what comes in, on Zenoh's threads: it must not block.
pub type Inlet = Arc<dyn Fn(Item) + Send + Sync>;

/// What keeps the items coming, until it is dropped.
#[derive(Default)]
pub struct Subscriptions {
    subscriptions: Vec<Subscription>,
    presences: Vec<PresenceWatch>,
    questions: JoinSet<()>,
    by_channel: bool,
}

impl Subscriptions {
    /// Those of a recorder, which hears each message once: robots do not publish JSON for it.
    #[must_use]
    pub fn of_recorder() -> Self {
        Self { by_channel: true, ..Self::default() }
    }

    /// Listens on `key_expr` too. What only answers is asked once, and its answers come in like
    /// messages.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: no key expression, or one that names only commands; [`ErrorKind::Failed`]: Zenoh
    /// would not.
    pub async fn add(&mut self, client: &Client, key_expr: &str, inlet: &Inlet) -> crate::error::Result<()> {
        self.add_plan(client, key_expr, WatchPlan::of(key_expr)?, inlet).await.map_err(not_a_key_expr)
    }

    /// Listens on `key_expr` too, as planned; with an identity channel by channel, and on what none of the fleet's
    /// covers as it is: a router without rules for it may let it pass.
    ///
    /// # Errors
    /// Zenoh would not.
    pub async fn add_plan(
        &mut self,
        client: &Client,
        key_expr: &str,
        plan: WatchPlan,
        inlet: &Inlet,
    ) -> Result<(), BusError> {
        let fleet = client.settings().identity.as_ref().map(|_| client.fleet());
        let mut parts = match fleet.is_some() || self.by_channel {
            true => plan.clone().by_channel(key_expr, fleet),
            false => Vec::new(),
        };
        if parts.is_empty() {
            parts.push((key_expr.to_owned(), plan));
        }
        for (key_expr, plan) in parts {
            self.add_part(client, &key_expr, plan, inlet).await?;
        }
        Ok(())
    }

    async fn add_part(
        &mut self,
        client: &Client,
        key_expr: &str,
        plan: WatchPlan,
        inlet: &Inlet,
    ) -> Result<(), BusError> {
        match plan {
            WatchPlan::Presence => self.presences.push(presence(client, key_expr, inlet).await?),
            WatchPlan::Events => {
                let each = message_to(inlet);
                self.subscriptions.push(client.bus().subscribe_events_raw(key_expr, each).await?);
            }
            WatchPlan::Messages { ask, presence: there } => {
                self.subscriptions.push(client.bus().subscribe_raw(key_expr, message_to(inlet)).await?);
                for key_expr in there {
                    self.presences.push(presence(client, &key_expr, inlet).await?);
                }
                self.ask(client, ask, inlet);
            }
            WatchPlan::Answers(ask) => self.ask(client, ask, inlet),
        }
        Ok(())
    }

    /// Beside the stream: who answers slowly must not hold it up.
    fn ask(&mut self, client: &Client, key_exprs: Vec<String>, inlet: &Inlet) {
        for key_expr in key_exprs {
            self.questions.spawn(answers_to(client.clone(), key_expr, Arc::clone(inlet)));
        }
    }
}

async fn presence(client: &Client, key_expr: &str, inlet: &Inlet) -> Result<PresenceWatch, BusError> {
    let inlet = Arc::clone(inlet);
    let each = move |key: &str, there: bool| inlet(Item::Presence(key.to_owned(), there));
    client.bus().watch_alive(key_expr, each).await
}

fn message_to(inlet: &Inlet) -> impl Fn(Incoming) + Send + Sync + 'static {
    let inlet = Arc::clone(inlet);
    move |incoming| inlet(Item::Message(incoming))
}

async fn answers_to(client: Client, key_expr: String, inlet: Inlet) {
    match client.get(&key_expr).await {
        Ok(answers) => answers.into_iter().for_each(|answer| inlet(Item::Message(answer))),
        Err(error) => tracing::warn!("{error}"),
    }
}

/// What to say of an expression of which an identity sees a part at most; `None` = all of it can be seen.
#[must_use]
pub fn hidden(client: &Client, key_expr: &str, plan: &WatchPlan) -> Option<String> {
    client.settings().identity.as_ref()?;
    let fleet = client.fleet();
    let parts = plan.clone().by_channel(key_expr, Some(fleet));
    match parts.as_slice() {
        [] => Some(format!(
            "{key_expr} is no key of fleet {fleet} that can be watched with an identity: the router's rules hide it"
        )),
        [(part, _)] if part == key_expr => None,
        _ if parts.iter().any(|(part, plan)| part == key_expr && !matches!(plan, WatchPlan::Answers(_))) => {
            None
        }
        _ => Some(format!(
            "with an identity only what fleet {fleet} publishes is shown: the router's rules hide the rest of \
             {key_expr}"
        )),
    }
}

/// What to say of an expression that Zenoh refuses.
#[must_use]
pub fn not_a_key_expr(error: BusError) -> Error {
    match error {
        BusError::Operation { key, reason, .. } => {
            Error::new(ErrorKind::Invalid, format!("cannot subscribe to {key:?}: {reason}"))
                .hint("a key expression looks like xtb/lab/*/state or xtb/**")
        }
        other => other.into(),
    }
}
