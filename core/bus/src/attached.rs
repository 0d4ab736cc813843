//! Bytes with attachments, on keys that are not ours: how other middleware speaks over Zenoh, such as ROS 2. What
//! the bytes mean is `xtb-ros2`'s part.

use crate::channel::Subscription;
use crate::query::Service;
use crate::session::{Bus, BusError, failed};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use zenoh::bytes::ZBytes;
use zenoh::matching::{MatchingListener, MatchingStatus};
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;
use zenoh::query::Query;
use zenoh::sample::SampleKind;
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

/// How the bytes are said to be written. Nobody asks; the same as others say.
const ENCODING: &str = "application/cdr";
/// Who has missed the last sample of a latched publisher learns of it within this.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// Bytes as they came in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attached {
    /// The message.
    pub payload: Vec<u8>,
    /// What was attached; empty = nothing.
    pub attachment: Vec<u8>,
}

impl Attached {
    /// `None` = more than so many bytes; they are not copied then.
    fn of(payload: Option<&ZBytes>, attachment: Option<&ZBytes>, most_bytes: usize) -> Option<Self> {
        let bytes = |bytes: Option<&ZBytes>| bytes.map(|it| it.to_bytes().into_owned()).unwrap_or_default();
        let length = [payload, attachment].into_iter().flatten().map(ZBytes::len).sum::<usize>();
        (length <= most_bytes).then(|| Self { payload: bytes(payload), attachment: bytes(attachment) })
    }
}

enum Kind {
    Plain(Publisher<'static>),
    Latched(AdvancedPublisher<'static>),
}

/// Publishes bytes on one key.
pub struct AttachedPublisher {
    // Before the publisher that it listens to.
    _matching: MatchingListener<()>,
    kind: Kind,
    key: String,
    heard: Arc<AtomicBool>,
}

impl AttachedPublisher {
    /// Sends a message.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn put(&self, payload: Vec<u8>, attachment: &[u8]) -> Result<(), BusError> {
        match &self.kind {
            Kind::Plain(publisher) => publisher.put(payload).attachment(attachment).await,
            Kind::Latched(publisher) => publisher.put(payload).attachment(attachment).await,
        }
        .map_err(failed("put", &self.key))
    }

    /// Whether anybody listens now: told by Zenoh at each change, so it costs nothing to ask.
    #[must_use]
    pub fn is_heard(&self) -> bool {
        self.heard.load(Ordering::Relaxed)
    }
}

/// A question that waits for its answer.
pub struct AttachedQuestion {
    query: Query,
    /// What was asked; `None` = more bytes than are read.
    pub asked: Option<Attached>,
}

impl AttachedQuestion {
    /// Answers on the question's own key.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn reply(&self, payload: Vec<u8>, attachment: &[u8]) -> Result<(), BusError> {
        let key = self.query.key_expr().clone();
        let failed = failed("reply", self.query.key_expr().as_str());
        self.query.reply(key, payload).encoding(ENCODING).attachment(attachment).await.map_err(failed)
    }
}

impl Bus {
    /// The session's id, as Zenoh prints it.
    #[must_use]
    pub fn zid(&self) -> String {
        self.session.zid().to_string()
    }

    /// A number that nobody else gets of this session, from 0.
    #[must_use]
    pub fn next_number(&self) -> u64 {
        self.numbers.fetch_add(1, Ordering::Relaxed)
    }

    /// A publisher of bytes. `latched`: who comes late gets the last so many, as with ROS's "transient local".
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn attached_publisher(
        &self,
        key: &str,
        latched: Option<usize>,
    ) -> Result<AttachedPublisher, BusError> {
        let failed = |error| failed("declaring a publisher", key)(error);
        let builder = self
            .session
            .declare_publisher(key.to_owned())
            .encoding(ENCODING)
            .congestion_control(CongestionControl::Drop);
        let heard = Arc::new(AtomicBool::new(false));
        let follow = {
            let heard = heard.clone();
            move |status: MatchingStatus| heard.store(status.matching(), Ordering::Relaxed)
        };
        let (kind, matching) = if let Some(samples) = latched {
            let publisher = builder
                .cache(CacheConfig::default().max_samples(samples))
                .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT))
                .publisher_detection()
                .await
                .map_err(failed)?;
            let matching = publisher.matching_listener().callback(follow).await.map_err(failed)?;
            (Kind::Latched(publisher), matching)
        } else {
            let publisher = builder.await.map_err(failed)?;
            let matching = publisher.matching_listener().callback(follow).await.map_err(failed)?;
            (Kind::Plain(publisher), matching)
        };
        Ok(AttachedPublisher { _matching: matching, kind, key: key.to_owned(), heard })
    }

    /// Calls `each` for each message on `key`; `None` = one of more than this many bytes.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn subscribe_attached(
        &self,
        key: &str,
        most_bytes: usize,
        each: impl Fn(Option<Attached>) + Send + Sync + 'static,
    ) -> Result<Subscription, BusError> {
        let inner = self
            .session
            .declare_subscriber(key.to_owned())
            .callback(move |sample| {
                if sample.kind() == SampleKind::Put {
                    each(Attached::of(Some(sample.payload()), sample.attachment(), most_bytes));
                }
            })
            .await
            .map_err(failed("subscribing", key))?;
        Ok(Subscription::holding(inner))
    }

    /// Calls `each` for each question on `key`; of one with more than this many bytes nothing is read.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn serve_attached(
        &self,
        key: &str,
        most_bytes: usize,
        each: impl Fn(AttachedQuestion) + Send + Sync + 'static,
    ) -> Result<Service, BusError> {
        let inner = self
            .session
            .declare_queryable(key.to_owned())
            .complete(true)
            .callback(move |query| {
                let asked = Attached::of(query.payload(), query.attachment(), most_bytes);
                each(AttachedQuestion { query, asked });
            })
            .await
            .map_err(failed("declaring a queryable", key))?;
        Ok(Service::holding(inner))
    }

    /// Calls `each` with a liveliness token of others and whether it is there: those that are first, then each
    /// change.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn watch_tokens(
        &self,
        key_expr: &str,
        each: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Subscription, BusError> {
        let inner = self
            .session
            .liveliness()
            .declare_subscriber(key_expr.to_owned())
            .history(true)
            .callback(move |sample| each(sample.key_expr().as_str(), sample.kind() == SampleKind::Put))
            .await
            .map_err(failed("watching tokens", key_expr))?;
        Ok(Subscription::holding(inner))
    }
}
