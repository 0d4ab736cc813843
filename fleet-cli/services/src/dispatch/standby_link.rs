//! The dispatcher's end of a pair: answers its stand-by's questions with records of the ledger, and looks for a
//! dispatcher that has taken over. The rules are [`xtb_dispatch::replication`]'s.

mod questions;

use super::{CLIENT, Clock};
use crate::ledger::{CopyStanding, LedgerReader};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::{Semaphore, mpsc};
use xtb_bus::{Bus, Question, Service};
use xtb_client::client::Client;
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::Dispatcher;
use xtb_dispatch::replication::{Active, Follow, Times, term_of};
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{
    Assignment, CopiedRecord, RobotState, StandbyReply, StandbyRequest, StandbyView,
};
use xtb_protocol::{Name, Uuid};

/// Questions, and what was read for them, that wait at most: a stand-by asks one at a time.
const INPUTS: usize = 64;
/// Questions for which the ledger is read at a time; more are not answered, and counted as those without room.
const READS: usize = 8;
/// Somebody else with this ledger is looked for this often, once there was a stand-by.
const PROBE_EVERY_MS: u64 = 1_000;
const PROBE_WITHIN: Duration = Duration::from_millis(500);
/// A ledger with a stand-by does not go on before that was heard; a stand-by asks several times a second.
const CONSULT_WITHIN: Duration = Duration::from_secs(6);

/// What comes to this end.
pub(super) enum Input {
    /// A question.
    Asked(Box<Question>),
    /// What the ledger has for one.
    Read(Box<ReadFor>),
    /// How another dispatcher stands.
    Other(Box<StandbyReply>),
}

/// Which records a stand-by has.
#[derive(Debug, Clone, Copy)]
struct Holds {
    /// Which question says so, counted.
    number: u64,
    copied: bool,
    ledger: u64,
    term: u32,
    sum: u32,
    offset: u64,
    follow: Follow,
}

/// A stand-by's question, and what follows its records.
pub(super) struct ReadFor {
    question: Question,
    format: Format,
    holds: Holds,
    /// It was answered with nothing new yet: it is not heard again by that.
    parked: bool,
    found: std::result::Result<(CopyStanding, Vec<CopiedRecord>), String>,
}

/// A question that waits for news.
struct Parked {
    question: Question,
    format: Format,
    holds: Holds,
    until_ms: u64,
}

/// This end, until it is dropped.
pub(super) struct StandbyLink {
    pub(super) inputs: mpsc::Receiver<Input>,
    sender: mpsc::Sender<Input>,
    bus: Bus,
    keys: FleetKeys,
    me: Name,
    path: PathBuf,
    run: u64,
    times: Times,
    pair: Active,
    /// The last record on the own disk.
    own: u64,
    reader: Arc<Mutex<LedgerReader>>,
    reads: Arc<Semaphore>,
    parked: Vec<Parked>,
    /// The last copy that has left, and with which question: those before it do not count any more.
    left: Option<(u64, u64)>,
    /// The last record of the paired copy, if that has more than this ledger.
    ahead: Option<u64>,
    next_probe_ms: u64,
    /// Whether it was paired, and held, when that was told last.
    told: (bool, bool),
    questions: u64,
    overloaded: Arc<AtomicU64>,
    _service: Service,
}

impl StandbyLink {
    /// Opens it: from now on a stand-by is answered, as soon as somebody takes the inputs.
    pub(super) async fn open(
        client: &Client,
        clock: Clock,
        path: &Path,
        dispatcher: &Dispatcher,
    ) -> Result<Self> {
        let (bus, keys) = (client.bus().clone(), client.keys().clone());
        let me = Name::new(CLIENT).map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))?;
        let (sender, inputs) = mpsc::channel(INPUTS);
        let overloaded = Arc::<AtomicU64>::default();
        let (asked, counter) = (sender.clone(), overloaded.clone());
        let each = move |question| {
            if asked.try_send(Input::Asked(Box::new(question))).is_err() {
                counter.fetch_add(1, Ordering::Relaxed);
            }
        };
        let _service = bus.serve(&keys.dispatch_standby(None), each).await?;
        let (store, times) = (dispatcher.store(), Times::default());
        let own = store.next_n() - 1;
        let pair = Active::new(times, clock.ms(), own, store.term(), store.pair());
        let reader = Arc::new(Mutex::new(LedgerReader::open(path)?));
        let run = (Uuid::new_v4().as_u128() >> 80) as u64;
        Ok(Self {
            inputs,
            sender,
            bus,
            keys,
            me,
            path: path.to_owned(),
            run,
            times,
            pair,
            own,
            reader,
            reads: Arc::new(Semaphore::new(READS)),
            parked: Vec::new(),
            left: None,
            ahead: None,
            next_probe_ms: 0,
            told: (store.pair().is_some(), false),
            questions: 0,
            overloaded,
            _service,
        })
    }

    /// Whoever had a stand-by hears it first: it may have taken over. And it gets what the own ledger has more, of
    /// which nobody knows whether it was acknowledged.
    ///
    /// # Errors
    /// It has, or it does not answer.
    pub(super) async fn consult(&mut self, clock: Clock, dispatcher: &Dispatcher) -> Result<()> {
        let Some(copy) = dispatcher.store().pair() else { return Ok(()) };
        tracing::info!("waiting for the stand-by of this ledger");
        let until = tokio::time::Instant::now() + CONSULT_WITHIN;
        let has_all = |view: StandbyView, own: u64| view.copy == copy && view.last >= own;
        while !self.pair.view(clock.ms()).is_some_and(|view| has_all(view, self.own)) {
            match tokio::time::timeout_at(until, self.inputs.recv()).await {
                Ok(Some(input)) => self.take(clock.ms(), input, dispatcher),
                Ok(None) | Err(_) => return Err(self.unheard()),
            }
            if let Some(last) = self.ahead {
                return Err(self.outdated(last));
            }
            self.end_if_superseded()?;
        }
        Ok(())
    }

    /// Something has come.
    pub(super) fn take(&mut self, now_ms: u64, input: Input, dispatcher: &Dispatcher) {
        match input {
            Input::Asked(question) => self.asked(now_ms, *question, dispatcher),
            Input::Read(read) => self.read(now_ms, *read, dispatcher),
            Input::Other(other) => {
                if Some(other.ledger) == dispatcher.store().ledger() {
                    self.pair.saw_term(other.term);
                }
            }
        }
    }

    /// The own disk has the records up to this one; a stand-by that waits gets them.
    pub(super) fn wrote(&mut self, last: u64) {
        self.own = last;
        self.pair.wrote(last);
        for Parked { question, format, holds, .. } in std::mem::take(&mut self.parked) {
            self.look_up(question, format, holds, true);
        }
    }

    /// The last record that may be acknowledged.
    pub(super) fn acknowledged(&self) -> u64 {
        self.pair.acknowledged()
    }

    /// A robot's state: a goal of a later term is another dispatcher's.
    pub(super) fn look(&mut self, state: &RobotState, dispatcher: &Dispatcher) {
        if let (Some(ledger), Some(goal)) = (dispatcher.store().ledger(), &state.goal)
            && self.has_had_standby(dispatcher)
            && let Some((assign_seq, _)) = Assignment::of_goal(ledger, goal.id)
        {
            self.pair.saw_term(term_of(assign_seq));
        }
    }

    fn has_had_standby(&self, dispatcher: &Dispatcher) -> bool {
        self.pair.is_known() || dispatcher.store().term() > 0
    }

    /// Looks at the clock.
    ///
    /// # Errors
    /// Another dispatcher has taken over.
    pub(super) fn step(&mut self, now_ms: u64, dispatcher: &mut Dispatcher) -> Result<()> {
        let is_known = self.pair.is_known();
        let visible = if is_known { dispatcher.online(now_ms) } else { BTreeSet::new() };
        self.pair.in_term(dispatcher.store().term());
        self.pair.step(now_ms, &visible);
        self.end_if_superseded()?;
        dispatcher.hold(self.pair.held().map(str::to_owned));
        dispatcher.pair(now_ms, self.pair.paired());
        self.tell();
        self.release(now_ms, dispatcher);
        if now_ms >= self.next_probe_ms && self.has_had_standby(dispatcher) {
            self.next_probe_ms = now_ms + PROBE_EVERY_MS;
            self.probe();
        }
        Ok(())
    }

    fn tell(&mut self) {
        let (was_paired, was_held) = self.told;
        let held = self.pair.held();
        self.told = (self.pair.paired().is_some(), held.is_some());
        match self.told.0 {
            true if !was_paired => {
                tracing::info!("nothing is acknowledged any more before the stand-by has it")
            }
            false if was_paired => tracing::warn!("the dispatcher continues without its stand-by"),
            _ => {}
        }
        match held {
            Some(why) if !was_held => tracing::warn!("nothing is assigned: {why}"),
            None if was_held => tracing::warn!("tasks are assigned again"),
            _ => {}
        }
    }

    /// Asks whether somebody else has this ledger.
    fn probe(&self) {
        let (bus, sender, run) = (self.bus.clone(), self.sender.clone(), self.run);
        let (key, channel) =
            (self.keys.dispatch_standby(Some(&self.me)), Channel::DispatchStandby(self.me.clone()));
        tokio::spawn(async move {
            let each = |answer: xtb_bus::Incoming| {
                if let Ok(reply) = answer.decode::<StandbyReply>()
                    && reply.run != run
                {
                    // No room: it is asked again.
                    let _ = sender.try_send(Input::Other(Box::new(reply)));
                }
            };
            if let Err(error) =
                bus.ask_each(&key, &channel, &StandbyRequest::Status {}, PROBE_WITHIN, each).await
            {
                tracing::debug!("cannot look for another dispatcher: {error}");
            }
        });
    }

    /// Questions that were read.
    pub(super) fn questions(&self) -> u64 {
        self.questions
    }

    /// Questions that found no room.
    pub(super) fn overloaded(&self) -> u64 {
        self.overloaded.load(Ordering::Relaxed)
    }

    fn end_if_superseded(&self) -> Result<()> {
        let Some(term) = self.pair.superseded() else { return Ok(()) };
        let message = format!("another dispatcher has taken over this ledger, in term {term}");
        Err(Error::new(ErrorKind::Failed, message).hint(
            "start this one with --standby: it follows the other one, and keeps records that only it has in a \
             file beside its ledger",
        ))
    }

    fn outdated(&self, last: u64) -> Error {
        let message = format!(
            "ledger {} ends with record {}, the copy of its stand-by with record {last}: this file is older",
            self.path.display(),
            self.own
        );
        Error::new(ErrorKind::Failed, message).hint(
            "continue with the stand-by's ledger: `dispatch serve --promote` there; then start this one with \
             --standby",
        )
    }

    fn unheard(&self) -> Error {
        let message = format!(
            "ledger {} has a stand-by, which does not answer: it may have taken over",
            self.path.display()
        );
        Error::new(ErrorKind::Failed, message).hint(
            "start the stand-by too, or this one with --standby if the other one has taken over; if the other \
             one is lost, --promote continues with this ledger",
        )
    }
}
