//! Opening a session: as a client of a router, as a router, or as a peer.

use crate::acl::AccessControl;
use crate::foreign::ForeignKeys;
use crate::tls::Tls;
use crate::watched::Watched;
use std::collections::HashSet;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use thiserror::Error;
use tokio::sync::watch;
use zenoh::Wait;
use zenoh::sample::SampleKind;

/// How long a link may be silent before the other side takes it for lost, unless told otherwise; four
/// keep-alives in it. (Zenoh's own default is 10 s: too long for a fleet.)
pub const LINK_LEASE: Duration = Duration::from_millis(2000);
/// Sessions that a router takes: a thousand robots, those who look at them, and as many again that are about to be
/// found dead. Zenoh's own limit is 1,000.
const MOST_SESSIONS: usize = 2048;
/// What the system keeps of a link in each direction, in bytes (Linux: twice that, with its own overhead). What does not
/// fit waits in Zenoh's queues, where stops and commands overtake states; by default the system keeps megabytes, in
/// their order. Chosen: 10 Mbit/s with round trips of 50 ms.
const SOCKET_BUFFER: u32 = 64 * 1024;
/// Longest message that is taken in, in bytes: twice the longest of ours. Of a longer one the rest is thrown
/// away as it comes, and the link stays. (Zenoh's own limit is 1 GiB.)
const MAX_MESSAGE: usize = 8 * 1024 * 1024;
/// Between two attempts to reach the router.
const RETRY_FIRST_MS: u32 = 200;
const RETRY_MOST_MS: u32 = 1000;
/// Closing may take 10 s when a link is lost; nobody waits for that.
const CLOSE_WITHIN: Duration = Duration::from_secs(2);

/// What a session is on the network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SessionRole {
    /// Connects to one of these routers.
    Client {
        /// Such as `tcp/127.0.0.1:7447`.
        connect: Vec<String>,
    },
    /// Accepts connections.
    Router {
        /// Where. Port 0 takes a free one; see [`Bus::locators`].
        listen: Vec<String>,
        /// Other routers, which together route as one; those that are not there are tried again and again.
        connect: Vec<String>,
    },
    /// Finds others by multicast, without a router.
    Peer {
        /// Also connects here.
        connect: Vec<String>,
    },
}

/// Zenoh would not.
#[derive(Debug, Error)]
pub enum BusError {
    /// An endpoint or another setting is not valid.
    #[error("Zenoh rejects the setting {name} = {value}: {reason}")]
    Setting {
        /// Zenoh's name for it.
        name: &'static str,
        /// What was given.
        value: String,
        /// Zenoh's words.
        reason: String,
    },
    /// The session could not be opened.
    #[error("cannot open a Zenoh session {role}: {reason}")]
    Open {
        /// What was tried.
        role: String,
        /// Zenoh's words.
        reason: String,
    },
    /// An identity shall be used with an endpoint that has no TLS.
    #[error("{endpoint} has no TLS, so an identity would protect nothing there")]
    NotSecure {
        /// Which.
        endpoint: String,
    },
    /// A declaration, put or get failed.
    #[error("{what} on {key}: {reason}")]
    Operation {
        /// What was tried.
        what: &'static str,
        /// On which key expression.
        key: String,
        /// Zenoh's words.
        reason: String,
    },
    /// A message could not be written.
    #[error("cannot encode a message: {0}")]
    Encode(#[from] xtb_protocol::wire::CodecError),
}

pub(crate) fn failed<'a>(what: &'static str, key: &'a str) -> impl FnOnce(zenoh::Error) -> BusError + 'a {
    move |error| BusError::Operation { what, key: key.to_owned(), reason: words(&error) }
}

/// What Zenoh says, without the places in its source where it says it.
fn words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    // A broken setting comes as `… msg: "what is wrong at /its/source.rs:1 …`.
    let words = text.split_once("msg: \"").map_or(text.as_str(), |(_, inner)| inner);
    words.split(" at /").next().unwrap_or(words).trim_end_matches('.').to_owned()
}

impl SessionRole {
    fn describe(&self) -> String {
        match self {
            Self::Client { connect } => format!("to {}", connect.join(", ")),
            Self::Router { listen, .. } => format!("as a router on {}", listen.join(", ")),
            Self::Peer { .. } => "as a peer".into(),
        }
    }

    fn endpoints(&self) -> impl Iterator<Item = &String> {
        let (listen, connect) = match self {
            Self::Client { connect } | Self::Peer { connect } => (&[][..], connect),
            Self::Router { listen, connect } => (&listen[..], connect),
        };
        listen.iter().chain(connect)
    }

    /// Zenoh's settings and their values in JSON.
    fn settings(&self, link_lease: Duration) -> Vec<(&'static str, String)> {
        let (mode, listen, connect, multicast) = match self {
            Self::Client { connect } => ("client", &[][..], connect, false),
            Self::Router { listen, connect } => ("router", &listen[..], connect, false),
            Self::Peer { connect } => ("peer", &[][..], connect, true),
        };
        // A client is opened again and again; a router is open at once, and tries its neighbours by itself.
        let timeout_ms = if matches!(self, Self::Router { .. }) { "-1" } else { "0" };
        let retry = format!("{{\"period_init_ms\":{RETRY_FIRST_MS},\"period_max_ms\":{RETRY_MOST_MS}}}");
        let mut settings = vec![
            ("mode", format!("{mode:?}")),
            ("connect/endpoints", format!("{connect:?}")),
            ("connect/timeout_ms", timeout_ms.into()),
            ("connect/retry", retry),
            ("scouting/multicast/enabled", multicast.to_string()),
            // Other programs' peers, such as those of ROS 2, find each other through the router alone.
            ("scouting/gossip/enabled", (mode != "client").to_string()),
            ("transport/link/tx/lease", link_lease.as_millis().to_string()),
            ("transport/link/tx/keep_alive", "4".into()),
            ("transport/link/rx/max_message_size", MAX_MESSAGE.to_string()),
            ("transport/unicast/max_sessions", MOST_SESSIONS.to_string()),
            ("transport/link/tcp/so_sndbuf", SOCKET_BUFFER.to_string()),
            ("transport/link/tcp/so_rcvbuf", SOCKET_BUFFER.to_string()),
            ("transport/link/tls/so_sndbuf", SOCKET_BUFFER.to_string()),
            ("transport/link/tls/so_rcvbuf", SOCKET_BUFFER.to_string()),
        ];
        if !matches!(self, Self::Peer { .. }) {
            settings.push(("listen/endpoints", format!("{listen:?}")));
        }
        settings
    }
}

/// One open session. Clones share it.
#[derive(Debug, Clone)]
pub struct Bus {
    pub(crate) session: zenoh::Session,
    pub(crate) foreign: ForeignKeys,
    pub(crate) watched: Watched,
    pub(crate) numbers: Arc<AtomicU64>,
}

/// How to open a session.
#[derive(Debug, Clone)]
pub struct Opening {
    role: SessionRole,
    link_lease: Duration,
    tls: Option<Tls>,
    access: Option<AccessControl>,
}

impl Opening {
    /// As this role, without an identity, with links of [`LINK_LEASE`].
    #[must_use]
    pub fn of(role: SessionRole) -> Self {
        Self { role, link_lease: LINK_LEASE, tls: None, access: None }
    }

    /// The others take this session's links for lost after so much silence.
    #[must_use]
    pub fn link_lease(self, link_lease: Duration) -> Self {
        Self { link_lease, ..self }
    }

    /// With an identity: TLS 1.3 with certificates on both sides, names checked; no other kind of endpoint, no
    /// peers.
    #[must_use]
    pub fn tls(self, tls: Option<Tls>) -> Self {
        Self { tls, ..self }
    }

    /// A router that lets in whom these rules name.
    #[must_use]
    pub fn access(self, access: Option<AccessControl>) -> Self {
        Self { access, ..self }
    }

    /// Zenoh's settings and their values in JSON.
    fn settings(&self) -> Result<Vec<(&'static str, String)>, BusError> {
        let mut settings = self.role.settings(self.link_lease);
        if let Some(tls) = &self.tls {
            self.closed()?;
            settings.extend(tls.settings(matches!(self.role, SessionRole::Router { .. })));
        }
        if let Some(AccessControl(rules)) = &self.access {
            settings.push(("access_control", rules.to_string()));
        }
        Ok(settings)
    }

    /// The same as one JSON object: the configuration of a zenohd that does what this session would.
    ///
    /// # Errors
    /// [`BusError::Setting`] or [`BusError::NotSecure`].
    pub fn to_json(&self) -> Result<serde_json::Value, BusError> {
        let mut whole = serde_json::Value::Object(serde_json::Map::new());
        for (name, value) in self.settings()? {
            let value = serde_json::from_str(&value).map_err(|error| BusError::Setting {
                name,
                value: value.clone(),
                reason: error.to_string(),
            })?;
            let place = name.split('/').fold(&mut whole, |place, part| &mut place[part]);
            *place = value;
        }
        Ok(whole)
    }

    fn config(&self) -> Result<zenoh::Config, BusError> {
        let mut config = zenoh::Config::default();
        for (name, value) in self.settings()? {
            if let Err(error) = config.insert_json5(name, &value) {
                return Err(BusError::Setting { name, value, reason: words(&error) });
            }
        }
        Ok(config)
    }

    /// An identity is of no use on a session that others can enter, or look into, without one.
    fn closed(&self) -> Result<(), BusError> {
        if let SessionRole::Peer { .. } = self.role {
            return Err(BusError::Open {
                role: self.role.describe(),
                reason: "peers have no identity".into(),
            });
        }
        match self.role.endpoints().find(|endpoint| !endpoint.starts_with("tls/")) {
            Some(endpoint) => Err(BusError::NotSecure { endpoint: endpoint.clone() }),
            None => Ok(()),
        }
    }

    /// One attempt, without blocking the runtime.
    ///
    /// # Errors
    /// [`BusError::Setting`], [`BusError::NotSecure`] or [`BusError::Open`].
    pub async fn once(&self) -> Result<Bus, BusError> {
        let config = self.config()?;
        let failed = |reason: String| BusError::Open { role: self.role.describe(), reason };
        // `zenoh::open` blocks its thread while it tries.
        match tokio::task::spawn_blocking(move || zenoh::open(config).wait()).await {
            Ok(Ok(session)) => Ok(Bus {
                session,
                foreign: ForeignKeys::default(),
                watched: Watched::default(),
                numbers: Arc::default(),
            }),
            Ok(Err(error)) => Err(failed(words(&error))),
            Err(error) => Err(failed(error.to_string())),
        }
    }

    /// Again and again with growing pauses until it stands. `failing` hears of each failure. Dropping the future
    /// ends the attempts.
    ///
    /// # Errors
    /// [`BusError::Setting`] and [`BusError::NotSecure`] only: these would never get better.
    pub async fn patiently(&self, mut failing: impl FnMut(&BusError)) -> Result<Bus, BusError> {
        let mut pause = Duration::from_millis(RETRY_FIRST_MS.into());
        loop {
            match self.once().await {
                Err(error @ BusError::Open { .. }) => failing(&error),
                other => return other,
            }
            tokio::time::sleep(pause).await;
            pause = (pause * 2).min(Duration::from_millis(RETRY_MOST_MS.into()));
        }
    }
}

/// Opens a session without an identity: one attempt; see [`Opening::once`].
///
/// # Errors
/// [`BusError::Setting`] or [`BusError::Open`].
pub async fn open(role: &SessionRole) -> Result<Bus, BusError> {
    Opening::of(role.clone()).once().await
}

impl Bus {
    /// The same session with a counter of its own, for one of several robots that share it.
    #[must_use]
    pub fn part(&self) -> Self {
        Self { foreign: ForeignKeys::default(), ..self.clone() }
    }

    /// Where a router listens.
    pub async fn locators(&self) -> Vec<String> {
        self.session.info().locators().await.iter().map(ToString::to_string).collect()
    }

    /// How many messages, questions and answers were dropped because their keys are none of ours, or have a
    /// wildcard where none may be; see [`received`](xtb_protocol::keys::received).
    #[must_use]
    pub fn foreign_keys(&self) -> u64 {
        self.foreign.count()
    }

    /// The counter behind [`Self::foreign_keys`], for those who publish it.
    #[must_use]
    pub fn foreign_keys_counter(&self) -> Arc<AtomicU64> {
        self.foreign.counter()
    }

    /// Whether a link to any other session stands.
    pub async fn is_linked(&self) -> bool {
        self.session.info().transports().await.next().is_some()
    }

    /// How many routers a link stands to: of a router, its neighbours in the mesh.
    pub async fn linked_routers(&self) -> usize {
        self.session.info().routers_zid().await.count()
    }

    /// Tells whether a link stands, now and at each change.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn watch_link(&self) -> Result<LinkWatch, BusError> {
        let (sender, receiver) = watch::channel(false);
        let others = Mutex::new(HashSet::new());
        let session = &self.session;
        let listener = session
            .info()
            .transport_events_listener()
            .history(true)
            .callback(move |event| {
                let zid = *event.transport().zid();
                let mut others = others.lock().unwrap_or_else(PoisonError::into_inner);
                match event.kind() {
                    SampleKind::Put => others.insert(zid),
                    SampleKind::Delete => others.remove(&zid),
                };
                sender.send_replace(!others.is_empty());
            })
            .await
            .map_err(failed("listening for link changes", "(session)"))?;
        Ok(LinkWatch { up: receiver, _listener: Box::new(listener) })
    }

    /// Closes the session; gives up after 2 s, since a lost link can hold it for longer.
    pub async fn close(self) {
        if tokio::time::timeout(CLOSE_WITHIN, self.session.close()).await.is_err() {
            tracing::debug!("the Zenoh session did not close in time");
        }
    }
}

/// Follows the link; see [`Bus::watch_link`].
pub struct LinkWatch {
    /// Whether it stands.
    pub up: watch::Receiver<bool>,
    _listener: Box<dyn std::any::Any + Send + Sync>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_endpoint_is_told_in_plain_words() {
        let role = SessionRole::Client { connect: vec!["bogus".into()] };
        let said = Opening::of(role).config().map(drop).unwrap_err().to_string();
        assert!(said.ends_with("[?<metadata>][#<config>]: bogus"), "{said}");
    }
}
