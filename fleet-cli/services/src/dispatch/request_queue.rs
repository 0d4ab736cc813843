//! Where people and programs ask: questions come in bounded, answers leave when the dispatcher has them.

use super::{DispatcherCounters, List};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use xtb_bus::{Publisher, Question, Service};
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_dispatch::Ticket;
use xtb_dispatch::admission::refusal;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{
    DispatchCode, DispatchError, DispatchOutcome, DispatchReply, DispatchRequest, FleetHomes, TaskEvent,
    TaskList,
};
use xtb_protocol::wire::CodecError;
use xtb_protocol::{Name, Uuid};

/// Questions that wait to be read; the next is refused as `overloaded`.
const QUESTIONS: usize = 256;
/// Changes that wait to be published; the next is dropped and counted.
const EVENTS: usize = 4096;

/// What comes in.
pub(super) enum Input {
    /// A question about tasks.
    Question(Question),
    /// A question for the list, or for a page of it.
    List(Question),
    /// A question for the robots at docks and on the way there.
    Homes(Question),
}

/// A question that was read.
pub(super) struct Asked {
    pub(super) ticket: Ticket,
    pub(super) client: Name,
    pub(super) request: DispatchRequest,
}

/// Questions that wait for their answers, and what is told to everybody.
pub(super) struct RequestQueue {
    keys: FleetKeys,
    open: BTreeMap<Ticket, (Question, Name, Format)>,
    next: Ticket,
    overloaded: Arc<AtomicU64>,
    foreign_keys: Arc<AtomicU64>,
    events: mpsc::Sender<TaskEvent>,
    lists: Publisher<TaskList>,
    services: Vec<Service>,
    /// Answers on their way.
    answers: JoinSet<()>,
}

impl RequestQueue {
    /// Opens it: from now on questions are taken.
    pub(super) async fn open(client: &Client) -> Result<(Self, mpsc::Receiver<Input>)> {
        let (bus, keys) = (client.bus(), client.keys().clone());
        let events = bus.event_publisher::<TaskEvent>(&keys.dispatch_event(), Format::Postcard).await?;
        let (sender, mut waiting) = mpsc::channel::<TaskEvent>(EVENTS);
        tokio::spawn(async move {
            while let Some(event) = waiting.recv().await {
                if let Err(error) = events.put(&event).await {
                    tracing::debug!("{error}");
                }
            }
        });
        let lists = bus.publisher(&keys.dispatch_tasks(), &Channel::DispatchTasks, Format::Json).await?;
        let (inputs, queue) = mpsc::channel(QUESTIONS);
        let overloaded = Arc::<AtomicU64>::default();
        let (runtime, counter, cmd) = (tokio::runtime::Handle::current(), overloaded.clone(), inputs.clone());
        let own_keys = keys.clone();
        let (cmds, list) = (keys.dispatch_cmd(None), keys.dispatch_tasks());
        let answering = bus.serve(&cmds, move |question| {
            let Err(mpsc::error::TrySendError::Full(Input::Question(question))) =
                cmd.try_send(Input::Question(question))
            else {
                return;
            };
            counter.fetch_add(1, Ordering::Relaxed);
            runtime.spawn(turn_away(question, own_keys.clone()));
        });
        let counter = overloaded.clone();
        let (homes, homes_counter) = (inputs.clone(), counter.clone());
        let listing = bus.serve(&list, move |question| {
            if inputs.try_send(Input::List(question)).is_err() {
                counter.fetch_add(1, Ordering::Relaxed);
            }
        });
        let at_docks = keys.dispatch_homes();
        let docking = bus.serve(&at_docks, move |question| {
            if homes.try_send(Input::Homes(question)).is_err() {
                homes_counter.fetch_add(1, Ordering::Relaxed);
            }
        });
        let services = vec![answering.await?, listing.await?, docking.await?];
        let requests = Self {
            keys,
            open: BTreeMap::new(),
            next: 0,
            overloaded,
            foreign_keys: bus.foreign_keys_counter(),
            events: sender,
            lists,
            services,
            answers: JoinSet::new(),
        };
        Ok((requests, queue))
    }

    /// Reads a question; one that cannot be read is answered at once.
    pub(super) fn read(&mut self, question: Question, counters: &mut DispatcherCounters) -> Option<Asked> {
        let client = question.client().cloned()?;
        match question.decode::<DispatchRequest>() {
            Ok((request, format)) => {
                counters.questions += 1;
                self.next += 1;
                let ticket = self.next;
                self.open.insert(ticket, (question, client.clone(), format));
                Some(Asked { ticket, client, request })
            }
            Err(error) => {
                counters.unreadable += 1;
                let code = match error {
                    CodecError::OutOfRange(_) => DispatchCode::OutOfRange,
                    _ => DispatchCode::Malformed,
                };
                let error = refusal(code, error.to_string(), "docs/protocol.md has the messages");
                tokio::spawn(refuse(question, self.keys.clone(), error));
                None
            }
        }
    }

    /// The answer to a question. Nobody waits for it to arrive.
    pub(super) fn reply(&mut self, ticket: Ticket, reply: DispatchReply) {
        let Some((question, client, format)) = self.open.remove(&ticket) else { return };
        let key = self.keys.dispatch_cmd(Some(&client));
        while self.answers.try_join_next().is_some() {}
        self.answers.spawn(async move {
            if let Err(error) = question.reply(&key, &reply, format).await {
                tracing::debug!("cannot send an answer: {error}");
            }
        });
    }

    /// The list, for one who asked.
    pub(super) fn list(&self, question: Question, list: List) {
        let key = self.keys.dispatch_tasks();
        tokio::spawn(async move {
            let format = question.wanted_format();
            if let Err(error) = question.reply(&key, list.as_ref(), format).await {
                tracing::debug!("cannot send the list: {error}");
            }
        });
    }

    /// The robots at docks and on the way there, for one who asked.
    pub(super) fn homes(&self, question: Question, homes: FleetHomes) {
        let key = self.keys.dispatch_homes();
        tokio::spawn(async move {
            let format = question.wanted_format();
            if let Err(error) = question.reply(&key, &homes, format).await {
                tracing::debug!("cannot send who is at a dock: {error}");
            }
        });
    }

    /// A question for the list that makes no sense.
    pub(super) fn refuse_list(&self, question: Question, why: String) {
        tokio::spawn(async move {
            if let Err(error) = question.refuse(&why).await {
                tracing::debug!("cannot send a refusal: {error}");
            }
        });
    }

    /// A change, for everybody.
    pub(super) fn event(&self, event: TaskEvent, counters: &mut DispatcherCounters) {
        counters.events_dropped += u64::from(self.events.try_send(event).is_err());
    }

    /// Whether anybody listens for lists.
    pub(super) async fn has_listeners(&self) -> bool {
        self.lists.has_listeners().await
    }

    /// The list, for everybody.
    pub(super) async fn tell(&self, list: &TaskList) {
        if let Err(error) = self.lists.put(list).await {
            tracing::debug!("cannot publish the list: {error}");
        }
    }

    /// Questions that found no room.
    pub(super) fn overloaded(&self) -> u64 {
        self.overloaded.load(Ordering::Relaxed)
    }

    /// What came in on keys that are none of ours.
    pub(super) fn foreign_keys(&self) -> u64 {
        self.foreign_keys.load(Ordering::Relaxed)
    }

    /// Takes no more questions.
    pub(super) fn close(&mut self) {
        self.services.clear();
    }

    /// Waits until the answers that are on their way have left.
    pub(super) async fn last_answers(&mut self) {
        while self.answers.join_next().await.is_some() {}
    }
}

async fn turn_away(question: Question, keys: FleetKeys) {
    let message = format!("{QUESTIONS} requests are already waiting");
    let error = refusal(DispatchCode::Overloaded, message, "try again with the same id, less often");
    refuse(question, keys, error).await;
}

async fn refuse(question: Question, keys: FleetKeys, error: DispatchError) {
    let asked = question.decode::<DispatchRequest>();
    let id = asked.map_or(Uuid::nil(), |(request, _)| request.id);
    let result = DispatchOutcome::Error(error);
    let reply = DispatchReply { id, result, left_out: 0, suspended: Vec::new() };
    let Some(client) = question.client() else { return };
    let key = keys.dispatch_cmd(Some(client));
    if let Err(error) = question.reply(&key, &reply, question.likely_format::<DispatchRequest>()).await {
        tracing::debug!("cannot send a refusal: {error}");
    }
}
