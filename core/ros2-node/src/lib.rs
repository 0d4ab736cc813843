//! A node of ROS 2 on a Zenoh session of ours: it publishes, hears and answers as rmw_zenoh does, and sees who else
//! is there. Names, bytes and rules are `xtb-ros2`'s; this opens what they need.
//!
//! What comes in without a proper attachment, is too long, or is no message of its type, is dropped and counted: a question of
//! that kind gets no answer, as rmw_zenoh knows none that means "no".

use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};
use thiserror::Error;
use xtb_bus::{
    Attached, AttachedPublisher, AttachedQuestion, Bus, BusError, Service as Queryable, Subscription,
};
use xtb_ros2::cdr::{Cdr, from_bytes, to_bytes};
use xtb_ros2::names::NotARosName;
use xtb_ros2::offer::Channel;
use xtb_ros2::types::{Message, Service};
use xtb_ros2::{Attachment, Gid, Key, RosName, token};

/// Longest message that is taken in, in bytes: the longest that is heard here, a pose with its covariance, has 400
/// and two names.
const MOST_BYTES: usize = 16 * 1024;

/// Why a node, or a part of it, cannot be.
#[derive(Debug, Error)]
pub enum NodeError {
    /// Zenoh would not.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A name does not follow ROS's rules.
    #[error(transparent)]
    Name(#[from] NotARosName),
}

/// Says that somebody is there; taken back before what it stands for.
type Token = xtb_bus::PresenceToken;

/// The time now, in ns since 1970: what attachments and stamps bear.
#[must_use]
pub fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// A node. It leaves when it is dropped with everything that it has declared.
pub struct Node {
    _token: Token,
    bus: Bus,
    node: token::Node,
    malformed: Arc<AtomicU64>,
}

impl Node {
    /// A node of this name and namespace, in this `ROS_DOMAIN_ID`.
    ///
    /// # Errors
    /// [`NodeError::Bus`].
    pub async fn open(bus: &Bus, domain: u32, namespace: RosName, name: &str) -> Result<Self, NodeError> {
        let node =
            token::Node { domain, zid: bus.zid(), nid: bus.next_number(), namespace, name: name.into() };
        let token = bus.declare_alive(&node.clone().token().to_string()).await?;
        Ok(Self { _token: token, bus: bus.clone(), node, malformed: Arc::default() })
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> &token::Node {
        &self.node
    }

    /// Messages and questions that could not be read.
    #[must_use]
    pub fn malformed(&self) -> u64 {
        self.malformed.load(Ordering::Relaxed)
    }

    /// One of its endpoints: its key, and its token as text.
    fn endpoint(&self, channel: &Channel) -> Result<(String, String), NodeError> {
        let name = self.node.namespace.resolve(channel.name)?;
        let key = Key::new(self.node.domain, name.clone(), channel.ros_type).to_string();
        let id = self.bus.next_number();
        Ok((key, self.node.endpoint(id, channel.kind, name, channel.ros_type, channel.qos).to_string()))
    }

    /// Publishes a topic.
    ///
    /// # Errors
    /// [`NodeError`].
    pub async fn publisher(&self, channel: &Channel) -> Result<Publisher, NodeError> {
        let (key, token) = self.endpoint(channel)?;
        let kept = channel.qos.latched.then(|| channel.qos.depth.unwrap_or(1) as usize);
        let inner = self.bus.attached_publisher(&key, kept).await?;
        let gid = Gid::of_token(&token);
        let token = self.bus.declare_alive(&token).await?;
        Ok(Publisher { _token: token, inner, gid, sequence: AtomicI64::new(1) })
    }

    /// Hears a topic.
    ///
    /// # Errors
    /// [`NodeError`].
    pub async fn subscribe<M: Message>(
        &self,
        channel: &Channel,
        each: impl Fn(Heard<M>) + Send + Sync + 'static,
    ) -> Result<Subscriber, NodeError> {
        let (key, token) = self.endpoint(channel)?;
        let malformed = self.malformed.clone();
        let take = move |attached: Option<Attached>| match read::<M>(attached.as_ref()) {
            Some((message, attachment)) => {
                each(Heard { message, attachment });
            }
            None => drop_malformed(&malformed, M::TYPE.name),
        };
        let inner = self.bus.subscribe_attached(&key, MOST_BYTES, take).await?;
        Ok(Subscriber { _token: self.bus.declare_alive(&token).await?, _inner: inner })
    }

    /// Answers a service.
    ///
    /// # Errors
    /// [`NodeError`].
    pub async fn serve<S: Service>(
        &self,
        channel: &Channel,
        each: impl Fn(Call<S>) + Send + Sync + 'static,
    ) -> Result<Server, NodeError> {
        let (key, token) = self.endpoint(channel)?;
        let malformed = self.malformed.clone();
        let take = move |question: AttachedQuestion| match read::<S::Request>(question.asked.as_ref()) {
            Some((request, attachment)) => {
                each(Call { request, attachment, question, service: PhantomData });
            }
            None => drop_malformed(&malformed, S::TYPE.name),
        };
        let inner = self.bus.serve_attached(&key, MOST_BYTES, take).await?;
        Ok(Server { _token: self.bus.declare_alive(&token).await?, _inner: inner })
    }

    /// Calls `each` with the token of each endpoint of a name in this node's namespace, and whether it is there.
    ///
    /// # Errors
    /// [`NodeError::Bus`].
    pub async fn watch(
        &self,
        each: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Subscription, NodeError> {
        let key_expr = token::watch_namespace(self.node.domain, &self.node.namespace);
        Ok(self.bus.watch_tokens(&key_expr, each).await?)
    }
}

fn read<T: Cdr>(attached: Option<&Attached>) -> Option<(T, Attachment)> {
    let attached = attached?;
    let attachment = Attachment::from_bytes(&attached.attachment).ok()?;
    Some((from_bytes(&attached.payload).ok()?, attachment))
}

fn drop_malformed(counter: &AtomicU64, what: &str) {
    if counter.fetch_add(1, Ordering::Relaxed) == 0 {
        tracing::warn!("dropped something that is no {what}; further ones are only counted");
    }
}

/// Publishes a topic until it is dropped.
pub struct Publisher {
    _token: Token,
    inner: AttachedPublisher,
    gid: Gid,
    sequence: AtomicI64,
}

impl Publisher {
    /// Sends a message of the topic's type. One that cannot be sent is only logged: the next one follows.
    pub async fn put<M: Message>(&self, message: &M) {
        self.put_bytes(to_bytes(message)).await;
    }

    /// The same for messages that differ between releases of ROS.
    pub async fn put_bytes(&self, message: Vec<u8>) {
        let sequence = self.sequence.fetch_add(1, Ordering::Relaxed);
        let attachment = Attachment { sequence, source_ns: now_ns(), gid: self.gid };
        if let Err(error) = self.inner.put(message, &attachment.to_bytes()).await {
            tracing::debug!("{error}");
        }
    }

    /// Whether anybody listens.
    #[must_use]
    pub fn is_heard(&self) -> bool {
        self.inner.is_heard()
    }
}

/// Hears a topic until it is dropped.
pub struct Subscriber {
    _token: Token,
    _inner: Subscription,
}

/// Answers a service until it is dropped.
pub struct Server {
    _token: Token,
    _inner: Queryable,
}

/// A message as it came in.
#[derive(Debug, Clone, PartialEq)]
pub struct Heard<M> {
    /// What.
    pub message: M,
    /// Whose, its number, and when it was made, by its sender's clock.
    pub attachment: Attachment,
}

/// A question to a service, to be answered once.
pub struct Call<S: Service> {
    /// What is asked.
    pub request: S::Request,
    attachment: Attachment,
    question: AttachedQuestion,
    service: PhantomData<fn(S)>,
}

impl<S: Service> Call<S> {
    /// Who asks.
    #[must_use]
    pub fn client(&self) -> Gid {
        self.attachment.gid
    }

    /// Answers it. One that cannot be sent is only logged: who asked is gone.
    pub async fn reply(&self, response: &S::Response) {
        let attachment = self.attachment.of_reply(now_ns()).to_bytes();
        if let Err(error) = self.question.reply(to_bytes(response), &attachment).await {
            tracing::debug!("{error}");
        }
    }
}
