//! Publishing and subscribing.

use crate::foreign::ForeignKeys;
use crate::session::{Bus, BusError, failed};
use std::marker::PhantomData;
use std::time::Duration;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::keys::{Channel, Congestion, Key, Priority, received};
use xtb_protocol::messages::Message;
use xtb_protocol::wire::CodecError;
use zenoh::pubsub::PublisherBuilder;
use zenoh::qos::{CongestionControl, Priority as ZenohPriority};
use zenoh::sample::Locality;
use zenoh_ext::{
    AdvancedPublisher, AdvancedPublisherBuilderExt, AdvancedSubscriberBuilderExt, CacheConfig, HistoryConfig,
    MissDetectionConfig, RecoveryConfig,
};

/// Events kept for those who join late or missed some.
const EVENT_CACHE: usize = 64;
const EVENT_HEARTBEAT: Duration = Duration::from_secs(1);

/// A message as it came in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Incoming {
    /// On which key: a concrete one of ours, unless it was asked for as it is.
    pub key: String,
    /// How it is written.
    pub encoding: String,
    /// Its bytes.
    pub payload: Vec<u8>,
}

impl Incoming {
    /// Reads it.
    ///
    /// # Errors
    /// Every [`CodecError`]; a message in which one robot speaks on the key of another is malformed.
    pub fn decode<M: Message>(&self) -> Result<M, CodecError> {
        let (message, _) = codec::decode::<M>(&self.encoding, &self.payload)?;
        let owner = Key::parse(&self.key).and_then(|key| key.robot);
        match (message.speaker(), owner) {
            (Some(speaker), Some(owner)) if *speaker != owner => {
                let reason = format!("{speaker} publishes on a key of {owner}");
                Err(CodecError::Malformed { name: M::NAME, reason })
            }
            _ => Ok(message),
        }
    }

    pub(crate) fn of(sample: &zenoh::sample::Sample) -> Self {
        Self {
            key: sample.key_expr().as_str().to_owned(),
            encoding: sample.encoding().to_string(),
            payload: sample.payload().to_bytes().into_owned(),
        }
    }
}

pub(crate) fn congestion(channel: &Channel) -> CongestionControl {
    match channel.qos().congestion {
        Congestion::Drop => CongestionControl::Drop,
        Congestion::Block => CongestionControl::Block,
    }
}

pub(crate) fn priority(channel: &Channel) -> ZenohPriority {
    match channel.qos().priority {
        Priority::RealTime => ZenohPriority::RealTime,
        Priority::InteractiveHigh => ZenohPriority::InteractiveHigh,
        Priority::InteractiveLow => ZenohPriority::InteractiveLow,
        Priority::DataHigh => ZenohPriority::DataHigh,
        Priority::Data => ZenohPriority::Data,
        Priority::DataLow => ZenohPriority::DataLow,
        Priority::Background => ZenohPriority::Background,
    }
}

/// Publishes one type on one key.
#[derive(Debug)]
pub struct Publisher<M> {
    inner: zenoh::pubsub::Publisher<'static>,
    key: String,
    format: Format,
    message: PhantomData<fn(&M)>,
}

impl<M: Message> Publisher<M> {
    /// Sends a message.
    ///
    /// # Errors
    /// [`BusError::Encode`] or [`BusError::Operation`].
    pub async fn put(&self, message: &M) -> Result<(), BusError> {
        let bytes = codec::encode(message, self.format)?;
        self.inner.put(bytes).await.map_err(failed("put", &self.key))
    }

    /// Whether anybody listens.
    pub async fn has_listeners(&self) -> bool {
        self.inner.matching_status().await.is_ok_and(|status| status.matching())
    }
}

/// Publishes events: late joiners get the last ones, and lost ones are sent again.
pub struct EventPublisher<M> {
    inner: AdvancedPublisher<'static>,
    key: String,
    format: Format,
    message: PhantomData<fn(&M)>,
}

impl<M: Message> EventPublisher<M> {
    /// Sends an event.
    ///
    /// # Errors
    /// [`BusError::Encode`] or [`BusError::Operation`].
    pub async fn put(&self, message: &M) -> Result<(), BusError> {
        let bytes = codec::encode(message, self.format)?;
        self.inner.put(bytes).await.map_err(failed("put", &self.key))
    }
}

/// Delivers messages to a callback until it is dropped.
pub struct Subscription {
    _inner: Box<dyn std::any::Any + Send + Sync>,
}

impl Subscription {
    pub(crate) fn holding(declaration: impl std::any::Any + Send + Sync) -> Self {
        Self { _inner: Box::new(declaration) }
    }
}

/// Passes on what came in on a key of ours, under the key that it means to `declared`.
fn ours(
    foreign: ForeignKeys,
    declared: String,
    each: impl Fn(Incoming) + Send + Sync + 'static,
) -> impl Fn(Incoming) + Send + Sync + 'static {
    move |incoming: Incoming| match received::put(&declared, &incoming.key) {
        Some(key) => each(Incoming { key, ..incoming }),
        None => foreign.dropped("a message", &incoming.key),
    }
}

impl Bus {
    /// A publisher of `M` on `key`, with the quality of service of its channel.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn publisher<M: Message>(
        &self,
        key: &str,
        channel: &Channel,
        format: Format,
    ) -> Result<Publisher<M>, BusError> {
        let inner = self
            .publisher_builder::<M>(key, channel, format)
            .await
            .map_err(failed("declaring a publisher", key))?;
        Ok(Publisher { inner, key: key.to_owned(), format, message: PhantomData })
    }

    /// A publisher of events on `key`. (A cache alone fails in client mode: late joiners find it
    /// through the publisher's detection.)
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn event_publisher<M: Message>(
        &self,
        key: &str,
        format: Format,
    ) -> Result<EventPublisher<M>, BusError> {
        let inner = self
            .publisher_builder::<M>(key, &Channel::Event, format)
            .cache(CacheConfig::default().max_samples(EVENT_CACHE))
            .sample_miss_detection(MissDetectionConfig::default().heartbeat(EVENT_HEARTBEAT))
            .publisher_detection()
            .await
            .map_err(failed("declaring an event publisher", key))?;
        Ok(EventPublisher { inner, key: key.to_owned(), format, message: PhantomData })
    }

    fn publisher_builder<M: Message>(
        &self,
        key: &str,
        channel: &Channel,
        format: Format,
    ) -> PublisherBuilder<'_, 'static> {
        self.session
            .declare_publisher(key.to_owned())
            .encoding(codec::encoding::<M>(format))
            .congestion_control(congestion(channel))
            .priority(priority(channel))
            .express(channel.qos().express)
    }

    /// Calls `each` for each message on `key_expr` whose key is one of ours.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn subscribe(
        &self,
        key_expr: &str,
        each: impl Fn(Incoming) + Send + Sync + 'static,
    ) -> Result<Subscription, BusError> {
        self.subscribe_raw(key_expr, ours(self.foreign.clone(), key_expr.to_owned(), each)).await
    }

    /// The same, but for what this very session publishes.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn subscribe_remote(
        &self,
        key_expr: &str,
        each: impl Fn(Incoming) + Send + Sync + 'static,
    ) -> Result<Subscription, BusError> {
        let each = ours(self.foreign.clone(), key_expr.to_owned(), each);
        let inner = self
            .session
            .declare_subscriber(key_expr.to_owned())
            .allowed_origin(Locality::Remote)
            .callback(move |sample| each(Incoming::of(&sample)))
            .await
            .map_err(failed("subscribing", key_expr))?;
        Ok(Subscription::holding(inner))
    }

    /// The same for events: the last ones first, lost ones recovered.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn subscribe_events(
        &self,
        key_expr: &str,
        each: impl Fn(Incoming) + Send + Sync + 'static,
    ) -> Result<Subscription, BusError> {
        self.subscribe_events_raw(key_expr, ours(self.foreign.clone(), key_expr.to_owned(), each)).await
    }

    /// Calls `each` for each message on `key_expr`, whatever its key: for tools that show what there is.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn subscribe_raw(
        &self,
        key_expr: &str,
        each: impl Fn(Incoming) + Send + Sync + 'static,
    ) -> Result<Subscription, BusError> {
        let inner = self
            .session
            .declare_subscriber(key_expr.to_owned())
            .callback(move |sample| each(Incoming::of(&sample)))
            .await
            .map_err(failed("subscribing", key_expr))?;
        Ok(Subscription::holding(inner))
    }

    /// The same for events: the last ones first, lost ones recovered.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn subscribe_events_raw(
        &self,
        key_expr: &str,
        each: impl Fn(Incoming) + Send + Sync + 'static,
    ) -> Result<Subscription, BusError> {
        let inner = self
            .session
            .declare_subscriber(key_expr.to_owned())
            .callback(move |sample| each(Incoming::of(&sample)))
            .history(HistoryConfig::default().detect_late_publishers().max_samples(EVENT_CACHE))
            .recovery(RecoveryConfig::default().heartbeat())
            .await
            .map_err(failed("subscribing to events", key_expr))?;
        Ok(Subscription::holding(inner))
    }

    /// Sends one message.
    ///
    /// # Errors
    /// [`BusError::Encode`] or [`BusError::Operation`].
    pub async fn put<M: Message>(
        &self,
        key: &str,
        channel: &Channel,
        message: &M,
        format: Format,
    ) -> Result<(), BusError> {
        let bytes = codec::encode(message, format)?;
        self.put_raw(key, channel, &codec::encoding::<M>(format), bytes).await
    }

    /// Sends bytes as they are: for tools and tests that must be able to send wrong ones.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn put_raw(
        &self,
        key: &str,
        channel: &Channel,
        encoding: &str,
        bytes: Vec<u8>,
    ) -> Result<(), BusError> {
        self.session
            .put(key.to_owned(), bytes)
            .encoding(encoding)
            .congestion_control(congestion(channel))
            .priority(priority(channel))
            .express(channel.qos().express)
            .await
            .map_err(failed("put", key))
    }
}
