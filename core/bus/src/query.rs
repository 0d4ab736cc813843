//! Questions and answers.

mod answers;

pub(crate) use answers::answers;

use crate::channel::{Incoming, congestion, priority};
use crate::session::{Bus, BusError, failed};
use answers::{ANSWERS, ANSWERS_BYTES};
use std::time::{Duration, Instant};
use xtb_protocol::codec::{self, Format};
use xtb_protocol::keys::{Channel, Key, Name, RobotKeys, received};
use xtb_protocol::messages::{Message, Reply, Request};
use xtb_protocol::wire::CodecError;
use zenoh::query::{ConsolidationMode, Query, QueryTarget, Reply as Answer};

/// Of those who answer in one robot's name no more are read.
const MOST_LINGERING: usize = 8;

/// A question that waits for its answer.
pub struct Question {
    query: Query,
    key: Key,
}

impl Question {
    /// The key that was asked, as it means to whoever serves it: concrete, also where every robot was asked.
    #[must_use]
    pub fn key(&self) -> &Key {
        &self.key
    }

    /// Who asks, where the key names its client.
    #[must_use]
    pub fn client(&self) -> Option<&Name> {
        self.key.channel.client()
    }

    /// The format asked for with `?format=json`, else postcard.
    #[must_use]
    pub fn wanted_format(&self) -> Format {
        let json = self.query.parameters().get("format").is_some_and(|format| format == "json");
        if json { Format::Json } else { Format::Postcard }
    }

    /// What the question's selector says of `name`: `tasks?after=t17`.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&str> {
        self.query.parameters().get(name)
    }

    /// Refuses it in words: for questions that have no message of their own.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn refuse(&self, why: &str) -> Result<(), BusError> {
        self.query
            .reply_err(why)
            .encoding("text/plain")
            .await
            .map_err(failed("refusal", self.query.key_expr().as_str()))
    }

    /// Reads the question's message, and the format that its answer should have.
    ///
    /// # Errors
    /// Every [`CodecError`]; a question without a payload is malformed.
    pub fn decode<M: Message>(&self) -> Result<(M, Format), CodecError> {
        let encoding = self.query.encoding().map(ToString::to_string).unwrap_or_default();
        let payload = self.query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
        codec::decode(&encoding, &payload)
    }

    /// The format that a refusal should have when the message, an `M`, could not be read.
    #[must_use]
    pub fn likely_format<M: Message>(&self) -> Format {
        let encoding = self.query.encoding().map(ToString::to_string).unwrap_or_default();
        let ours = codec::encoding::<M>(Format::Postcard);
        let kind = ours.split(';').next().unwrap_or_default();
        let likely = if encoding.starts_with(kind) { Format::Postcard } else { Format::Json };
        codec::format_of::<M>(&encoding).unwrap_or(likely)
    }

    /// Answers on `own_key`: always the robot's own, never the question's, where a wildcard would
    /// make robots overwrite each other.
    ///
    /// # Errors
    /// [`BusError::Encode`] or [`BusError::Operation`].
    pub async fn reply<M: Message>(
        &self,
        own_key: &str,
        message: &M,
        format: Format,
    ) -> Result<(), BusError> {
        let bytes = codec::encode(message, format)?;
        self.query
            .reply(own_key, bytes)
            .encoding(codec::encoding::<M>(format))
            .await
            .map_err(failed("reply", own_key))
    }
}

/// Answers questions until it is dropped.
pub struct Service {
    _inner: zenoh::query::Queryable<()>,
}

impl Service {
    pub(crate) fn holding(queryable: zenoh::query::Queryable<()>) -> Self {
        Self { _inner: queryable }
    }
}

impl Bus {
    /// Calls `each` for each question on `key_expr` whose key is one of ours; the answer may come later from
    /// elsewhere. The others are not answered.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn serve(
        &self,
        key_expr: &str,
        each: impl Fn(Question) + Send + Sync + 'static,
    ) -> Result<Service, BusError> {
        let (declared, foreign) = (key_expr.to_owned(), self.foreign.clone());
        let inner = self
            .session
            .declare_queryable(key_expr.to_owned())
            .complete(true)
            .callback(move |query| match received::question(&declared, query.key_expr().as_str()) {
                Some(key) => each(Question { query, key }),
                None if received::is_to_each_robot(query.key_expr().as_str()) => {}
                None => foreign.dropped("a question", query.key_expr().as_str()),
            })
            .await
            .map_err(failed("declaring a queryable", key_expr))?;
        Ok(Service::holding(inner))
    }

    /// Asks everybody on `selector` and collects the answers that come, until everybody has answered, nothing has
    /// come for `quiet`, or `within` is over. It ends too at 2,048 answers or 16 MiB: somebody floods it.
    ///
    /// # Errors
    /// [`BusError::Operation`] if the question could not be sent. No answer is no error.
    pub async fn gather(
        &self,
        selector: &str,
        quiet: Duration,
        within: Duration,
    ) -> Result<Vec<Incoming>, BusError> {
        let answers = self.gather_timed(selector, quiet, within).await?;
        Ok(answers.into_iter().map(|(_, answer)| answer).collect())
    }

    /// The same, each with when it came: the first may have waited long for the last.
    ///
    /// # Errors
    /// As [`Bus::gather`].
    pub async fn gather_timed(
        &self,
        selector: &str,
        quiet: Duration,
        within: Duration,
    ) -> Result<Vec<(Instant, Incoming)>, BusError> {
        let (inlet, mut replies) = answers(selector);
        self.session
            .get(selector)
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .timeout(within)
            .callback(inlet)
            .await
            .map_err(failed("get", selector))?;
        let (mut answers, mut bytes) = (Vec::new(), 0);
        while let Ok(Some(reply)) = tokio::time::timeout(quiet, replies.recv()).await {
            let Some(answer) = self.answer(selector, &reply) else { continue };
            bytes += answer.payload.len();
            if answers.len() == ANSWERS || bytes > ANSWERS_BYTES {
                tracing::warn!("too many answers on {selector}: only the first {} are taken", answers.len());
                break;
            }
            answers.push((Instant::now(), answer));
        }
        Ok(answers)
    }

    /// Asks everybody on `selector` and collects the answers that come within `within`.
    ///
    /// # Errors
    /// As [`Bus::gather`].
    pub async fn get(&self, selector: &str, within: Duration) -> Result<Vec<Incoming>, BusError> {
        self.gather(selector, within, within).await
    }

    /// What came back, if it came on a key of one who was asked.
    fn answer(&self, asked: &str, reply: &Answer) -> Option<Incoming> {
        let incoming = Incoming::of(reply.result().ok()?);
        if received::answer(asked, &incoming.key).is_none() {
            self.foreign.dropped("an answer", &incoming.key);
            return None;
        }
        Some(incoming)
    }

    /// Asks everybody on `key_expr` with a message, as its channel is to be treated, and hands each
    /// answer on as it comes, until all have answered or `within` is over. Answers are sent as the question was, and
    /// those of many robots would fill a queue of messages that wait for no other: a question to each robot is none.
    ///
    /// # Errors
    /// [`BusError::Encode`], or [`BusError::Operation`] if the question could not be sent. No answer is
    /// no error.
    pub async fn ask_each<M: Message>(
        &self,
        key_expr: &str,
        channel: &Channel,
        message: &M,
        within: Duration,
        mut each: impl FnMut(Incoming),
    ) -> Result<(), BusError> {
        let (inlet, mut replies) = answers(key_expr);
        self.session
            .get(key_expr)
            .payload(codec::encode(message, Format::Postcard)?)
            .encoding(codec::encoding::<M>(Format::Postcard))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .congestion_control(congestion(channel))
            .priority(priority(channel))
            .express(channel.qos().express && !received::is_to_each_robot(key_expr))
            .timeout(within)
            .callback(inlet)
            .await
            .map_err(failed("request", key_expr))?;
        while let Some(reply) = replies.recv().await {
            self.answer(key_expr, &reply).into_iter().for_each(&mut each);
        }
        Ok(())
    }

    /// Asks with bytes as they are: for tools and tests that must be able to send wrong ones. The first answer.
    ///
    /// # Errors
    /// [`BusError::Operation`] if the question could not be sent.
    pub async fn ask_raw(
        &self,
        key: &str,
        encoding: &str,
        bytes: Vec<u8>,
        within: Duration,
    ) -> Result<Option<Incoming>, BusError> {
        let answers = self.ask_lingering(key, (encoding, bytes), None, within, Duration::ZERO).await?;
        Ok(answers.into_iter().next())
    }

    /// All answers that come within `linger` of the first one; question and answers as the channel is to be treated,
    /// or as Zenoh does by default.
    async fn ask_lingering(
        &self,
        key: &str,
        (encoding, bytes): (&str, Vec<u8>),
        channel: Option<&Channel>,
        within: Duration,
        linger: Duration,
    ) -> Result<Vec<Incoming>, BusError> {
        let (inlet, mut replies) = answers(key);
        let question = self
            .session
            .get(key)
            .payload(bytes)
            .encoding(encoding)
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None);
        let question = match channel {
            Some(channel) => question
                .congestion_control(congestion(channel))
                .priority(priority(channel))
                .express(channel.qos().express),
            None => question,
        };
        question.timeout(within).callback(inlet).await.map_err(failed("request", key))?;
        let mut answers = Vec::new();
        let mut until = tokio::time::Instant::now() + within;
        while let Ok(Some(reply)) = tokio::time::timeout_at(until, replies.recv()).await {
            let Some(answer) = self.answer(key, &reply) else { continue };
            if answers.is_empty() {
                until = until.min(tokio::time::Instant::now() + linger);
            }
            answers.push(answer);
            if linger.is_zero() || answers.len() >= MOST_LINGERING {
                break;
            }
        }
        Ok(answers)
    }

    /// Sends one request to one robot. `None` = no answer: the outcome is unknown and the same
    /// request may be asked again.
    ///
    /// # Errors
    /// [`BusError`], and [`BusError::Encode`] too if the answer is not a reply of ours.
    pub async fn ask(
        &self,
        robot: &RobotKeys,
        client: &Name,
        request: &Request,
        within: Duration,
    ) -> Result<Option<Reply>, BusError> {
        Ok(self.ask_all(robot, client, request, within, Duration::ZERO).await?.into_iter().next())
    }

    /// The same, with every answer that comes within `linger` of the first: a robot gives one, so more than one
    /// means that somebody else answers in its name.
    ///
    /// # Errors
    /// As [`Bus::ask`].
    pub async fn ask_all(
        &self,
        robot: &RobotKeys,
        client: &Name,
        request: &Request,
        within: Duration,
        linger: Duration,
    ) -> Result<Vec<Reply>, BusError> {
        let key = robot.cmd(Some(client));
        let bytes = codec::encode(request, Format::Postcard)?;
        let encoding = codec::encoding::<Request>(Format::Postcard);
        let channel = Channel::Cmd(client.clone());
        let answers = self.ask_lingering(&key, (&encoding, bytes), Some(&channel), within, linger).await?;
        answers.iter().map(|answer| Ok(answer.decode()?)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::SessionRole;
    use xtb_protocol::keys::FleetKeys;
    use xtb_protocol::wire;

    const WITHIN: Duration = Duration::from_secs(60);

    fn keys() -> FleetKeys {
        FleetKeys::new(Name::new("lab").unwrap())
    }

    /// What is gathered on `key` from somebody who answers each question with all of these.
    async fn gathered(
        key: &str,
        payloads: impl Fn() -> Vec<Vec<u8>> + Send + Sync + 'static,
    ) -> Vec<Incoming> {
        let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
        let bus = crate::open(&role).await.unwrap();
        let (runtime, own_key) = (tokio::runtime::Handle::current(), key.to_owned());
        let each = move |question: Question| {
            let (own_key, payloads) = (own_key.clone(), payloads());
            runtime.spawn(async move {
                for payload in payloads {
                    // Whoever has asked may be gone by now.
                    if question.query.reply(own_key.as_str(), payload).await.is_err() {
                        return;
                    }
                }
            });
        };
        let _service = bus.serve(key, each).await.unwrap();
        bus.gather(key, WITHIN, WITHIN).await.unwrap()
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn of_ten_thousand_answers_to_one_question_2048_are_taken() {
        let answers = gathered(&keys().sim_stats(), || vec![vec![b' ']; 10_000]).await;
        assert_eq!(answers.len(), 2048);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn of_long_answers_to_one_question_16_mib_are_taken() {
        let answers = gathered(&keys().map(), || vec![vec![b' '; 1 << 20]; 40]).await;
        assert_eq!(answers.len(), 16);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn an_answer_that_is_longer_than_its_message_may_be_is_not_taken() {
        let lengths = [wire::MAX_BYTES + 1, wire::MAX_BYTES, wire::MAX_BYTES + 1];
        let answers =
            gathered(&keys().sim_stats(), move || lengths.map(|length| vec![b' '; length]).to_vec()).await;
        let lengths: Vec<usize> = answers.iter().map(|answer| answer.payload.len()).collect();
        assert_eq!(lengths, [wire::MAX_BYTES]);
    }
}
