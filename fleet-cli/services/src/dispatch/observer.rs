//! What the dispatcher tells people beside its tasks: alerts, and the fleet's history.
//!
//! Rules and list are [`xtb_dispatch::alerts`]'s, the file is [`crate::history`]'s; here they meet the clock and Zenoh.
//! A history that cannot be opened is said, and done without.

use super::Clock;
use crate::alert_outlets::{OutletCounters, OutletSettings, Outlets};
use crate::history::samples::Samples;
use crate::history::{self, History, HistoryRow, Retention};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::sync::mpsc;
use xtb_bus::{Incoming, Publisher, Question, Service, Subscription};
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_dispatch::Dispatcher;
use xtb_dispatch::alerts::{AlertBook, RobotPresence, Rules};
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{
    AckRequest, Event, FleetAlerts, HistoryReply, HistoryRequest, Message, RobotState, TaskEvent,
};

/// Questions and events that wait; the next is dropped and counted.
const INPUTS: usize = 2048;
/// What robots did goes to the history this often: a kill loses no more.
const SAMPLE_EVERY_MS: u64 = 10_000;
/// The list of alerts is published again this often, for whoever missed it.
const PUBLISH_EVERY_MS: u64 = 30_000;
/// The rules are looked at this often: suspensions are counted over all open tasks.
const LOOK_EVERY_MS: u64 = 250;

/// What a lab wants to be told, and how.
#[derive(Debug, Clone, Default)]
pub struct ObserverSettings {
    /// When there is an alert.
    pub rules: Rules,
    /// Who is told beside the screens.
    pub outlets: OutletSettings,
    /// How much history is kept.
    pub history: Retention,
}

/// What was told, and what was not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ObserverCounters {
    /// Questions and events that found the queue full.
    pub dropped: u64,
    /// Questions that could not be read.
    pub unreadable: u64,
    /// The history's own.
    pub history: history::HistoryCounters,
    /// Of the alert command.
    pub command: OutletCounters,
    /// Of the web hook.
    pub webhook: OutletCounters,
}

/// What comes in.
pub(super) enum Input {
    /// A question for the alerts.
    Alerts(Question),
    /// A person has seen alerts.
    Ack(Question),
    /// A question to the history.
    History(Question),
    /// What happened to a robot.
    Event(Box<Event>),
}

/// Alerts and history of one dispatcher.
pub(super) struct Observer {
    pub(super) inputs: mpsc::Receiver<Input>,
    keys: FleetKeys,
    book: AlertBook,
    samples: Samples,
    history: Option<History>,
    outlets: Outlets,
    alerts: Publisher<FleetAlerts>,
    /// The list has changed since it was published.
    changed: bool,
    published_ms: u64,
    looked_ms: u64,
    sampled_ms: u64,
    /// Each robot's clock, when its last state came: its boot, its time, and ours.
    clocks: BTreeMap<Name, (u64, u64, u64)>,
    unreadable: u64,
    dropped: Arc<AtomicU64>,
    _services: Vec<Service>,
    _events: Subscription,
}

impl Observer {
    /// Opens the history beside the ledger, and takes questions from now on.
    pub(super) async fn open(
        client: &Client,
        clock: Clock,
        ledger: &Path,
        settings: ObserverSettings,
    ) -> Result<Self> {
        let (bus, keys) = (client.bus(), client.keys().clone());
        let opened = History::open(&history::path_beside(ledger), settings.history);
        let opened = opened.inspect_err(|error| tracing::warn!("{error}; going on without a history"));
        let (history, kept) = opened.map_or((None, Vec::new()), |(history, kept)| (Some(history), kept));
        let (sender, inputs) = mpsc::channel(INPUTS);
        let dropped = Arc::<AtomicU64>::default();
        let inlet = |wrap: fn(Question) -> Input| {
            let (sender, dropped) = (sender.clone(), Arc::clone(&dropped));
            move |question| {
                if sender.try_send(wrap(question)).is_err() {
                    dropped.fetch_add(1, Ordering::Relaxed);
                }
            }
        };
        let services = vec![
            bus.serve(&keys.dispatch_alerts(), inlet(Input::Alerts)).await?,
            bus.serve(&keys.dispatch_ack(None), inlet(Input::Ack)).await?,
            bus.serve(&keys.dispatch_history(), inlet(Input::History)).await?,
        ];
        let (events, drops) = (sender.clone(), Arc::clone(&dropped));
        let each = move |incoming: Incoming| match incoming.decode::<Event>() {
            Ok(event) => {
                if events.try_send(Input::Event(Box::new(event))).is_err() {
                    drops.fetch_add(1, Ordering::Relaxed);
                }
            }
            // The dispatcher's own are on such a key too.
            Err(error) => tracing::debug!("on {}: {error}", incoming.key),
        };
        let now_ms = clock.ms();
        Ok(Self {
            inputs,
            book: AlertBook::new(now_ms, settings.rules, kept),
            samples: Samples::default(),
            history,
            outlets: Outlets::start(client.fleet().clone(), settings.outlets)?,
            alerts: bus.publisher(&keys.dispatch_alerts(), &Channel::DispatchAlerts, Format::Json).await?,
            changed: true,
            published_ms: now_ms,
            looked_ms: now_ms,
            sampled_ms: now_ms,
            clocks: BTreeMap::new(),
            unreadable: 0,
            dropped,
            _events: bus.subscribe_events(&keys.any_robot().event(), each).await?,
            _services: services,
            keys,
        })
    }

    /// A robot's state, and whether it has a task.
    pub(super) fn state(&mut self, now_ms: u64, state: &RobotState, has_task: bool) {
        self.clocks.insert(state.robot.clone(), (state.epoch, state.tick_ms, now_ms));
        self.book.state(state);
        self.samples.look(state, has_task);
    }

    /// A robot has come or gone.
    pub(super) fn presence(&self, now_ms: u64, robot: &Name, there: bool) {
        self.write(HistoryRow::presence(now_ms, robot, there));
    }

    /// A task has changed.
    pub(super) fn task(&mut self, now_ms: u64, event: &TaskEvent) {
        self.write(HistoryRow::task(event));
        self.samples.task(&event.step);
        self.book.task(now_ms, event);
    }

    /// Looks after the rules, and after what is due.
    pub(super) fn step(&mut self, now_ms: u64, dispatcher: &Dispatcher) {
        if now_ms.saturating_sub(self.looked_ms) >= LOOK_EVERY_MS {
            self.looked_ms = now_ms;
            let robots = dispatcher.robots().iter().map(|(name, robot)| (name, RobotPresence::from(robot)));
            self.book.step(now_ms, robots, &dispatcher.suspensions());
        }
        if now_ms.saturating_sub(self.sampled_ms) >= SAMPLE_EVERY_MS {
            self.sample(now_ms);
        }
        self.tell_changes(now_ms);
    }

    /// What has come in.
    pub(super) fn take(&mut self, now_ms: u64, input: Input) {
        match input {
            Input::Event(event) => {
                let at_ms = self.happened_ms(now_ms, &event);
                self.write(HistoryRow::robot(at_ms, &event));
            }
            Input::Alerts(question) => {
                let format = question.wanted_format();
                answer(question, self.keys.dispatch_alerts(), self.book.list(now_ms), format);
            }
            Input::Ack(question) => self.acknowledge(now_ms, question),
            Input::History(question) => self.ask_history(now_ms, question),
        }
    }

    /// When an event happened: those from before our start come late.
    fn happened_ms(&self, now_ms: u64, event: &Event) -> u64 {
        match self.clocks.get(&event.robot) {
            Some((epoch, tick_ms, came_ms)) if *epoch == event.epoch => {
                now_ms.min(came_ms.saturating_sub(tick_ms.saturating_sub(event.tick_ms)))
            }
            _ => now_ms,
        }
    }

    fn acknowledge(&mut self, now_ms: u64, question: Question) {
        let Some(by) = question.client().cloned() else { return };
        let Some((request, format)) = self.read::<AckRequest>(&question) else {
            return refuse(question, "this is no AckRequest: docs/protocol.md has the messages");
        };
        let reply = self.book.acknowledge(now_ms, &by, &request);
        answer(question, self.keys.dispatch_ack(Some(&by)), reply, format);
        self.tell_changes(now_ms);
    }

    fn ask_history(&mut self, now_ms: u64, question: Question) {
        let Some((request, format)) = self.read::<HistoryRequest>(&question) else {
            return refuse(question, "this is no HistoryRequest: docs/protocol.md has the messages");
        };
        if matches!(request, HistoryRequest::Report { .. }) {
            self.sample(now_ms);
        }
        let key = self.keys.dispatch_history();
        let Some(history) = &self.history else {
            let message = "this dispatcher has no history: its log says why".to_owned();
            return answer(question, key, HistoryReply::Failed { message }, format);
        };
        let asked = history.ask(request, now_ms);
        tokio::spawn(async move {
            if let Ok(reply) = asked.await {
                answer(question, key, reply, format);
            }
        });
    }

    fn read<M: Message>(&mut self, question: &Question) -> Option<(M, Format)> {
        let read = question.decode::<M>();
        self.unreadable += u64::from(read.is_err());
        read.inspect_err(|error| tracing::debug!("{error}")).ok()
    }

    fn write(&self, row: HistoryRow) {
        if let Some(history) = &self.history {
            history.event(row);
        }
    }

    fn sample(&mut self, now_ms: u64) {
        self.sampled_ms = now_ms;
        let samples = self.samples.take();
        if let Some(history) = &self.history {
            history.samples(now_ms, samples);
        }
    }

    fn tell_changes(&mut self, now_ms: u64) {
        while let Some(change) = self.book.next_change() {
            self.changed = true;
            self.write(HistoryRow::alert(now_ms, &change));
            self.outlets.tell(&change);
            if let Some(history) = &self.history {
                history.alert(change.alert);
            }
        }
    }

    /// Whether the list has changed since it was published, or that was long ago.
    pub(super) fn has_news(&self, now_ms: u64) -> bool {
        self.changed || now_ms.saturating_sub(self.published_ms) >= PUBLISH_EVERY_MS
    }

    /// The list, for everybody who listens; whoever comes first gets it at once.
    pub(super) async fn publish(&mut self, now_ms: u64) {
        if !self.alerts.has_listeners().await {
            return;
        }
        (self.changed, self.published_ms) = (false, now_ms);
        if let Err(error) = self.alerts.put(&self.book.list(now_ms)).await {
            tracing::debug!("cannot publish the alerts: {error}");
        }
    }

    /// What was told, and what was not.
    pub(super) fn counters(&self) -> ObserverCounters {
        let [command, webhook] = self.outlets.counters();
        ObserverCounters {
            dropped: self.dropped.load(Ordering::Relaxed),
            unreadable: self.unreadable,
            history: self.history.as_ref().map(History::counters).unwrap_or_default(),
            command,
            webhook,
        }
    }

    /// Writes what is left.
    pub(super) fn end(&mut self, now_ms: u64) {
        self.tell_changes(now_ms);
        self.sample(now_ms);
    }
}

fn answer<M: Message + Send + Sync + 'static>(question: Question, key: String, message: M, format: Format) {
    tokio::spawn(async move {
        if let Err(error) = question.reply(&key, &message, format).await {
            tracing::debug!("cannot send {}: {error}", M::NAME);
        }
    });
}

fn refuse(question: Question, why: &'static str) {
    tokio::spawn(async move {
        if let Err(error) = question.refuse(why).await {
            tracing::debug!("cannot send a refusal: {error}");
        }
    });
}
