//! The loop: what has come in goes to the dispatcher, what it wants is done.

use super::flying::{Flying, Unacknowledged, Written, durable};
use super::map_watch::{self, Found, Ground, MapWatch, OwnMap, ground};
use super::observer::Observer;
use super::request_queue::{Asked, Input, RequestQueue};
use super::robot_client::{Fleet, News};
use super::standby_link::StandbyLink;
use super::usage::Usage;
use super::{CLIENT, Clock, DispatcherCounters, List, Standing, second};
use crate::ledger::{self, Ledger, LedgerFault, LedgerWriteError, LedgerWriter};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::MissedTickBehavior;
use xtb_bus::{Incoming, Subscription};
use xtb_client::client::Client;
use xtb_client::state_feed::{MOST_ROBOTS, StateFeed};
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::home::levels_of;
use xtb_dispatch::{Dispatcher, Effect, LedgerEntry, Record, Write};
use xtb_nav::Car;
use xtb_protocol::Name;
use xtb_protocol::keys::{Channel, Key};

/// It decides this often, and after each question.
const TICK: Duration = Duration::from_millis(50);
/// Every so many ticks it says how it stands, and publishes the list if that has changed.
const TELL_EVERY: u64 = 20;
/// A restart reads all that follows the last snapshot: with more than this a new one is due, as soon as
/// nothing is to be done.
const COMPACT_AT: u64 = 10_000;
/// And with this many whatever is to be done.
const COMPACT_BUSY_AT: u64 = 40_000;
/// A write that is out at the end is waited for this long.
const LAST_WRITE: Duration = Duration::from_secs(5);
/// And this long until the stand-by has it.
const LAST_COPY: Duration = Duration::from_secs(1);

/// Emergency stops that wait to be read.
const STOPS: usize = 16;

/// Whether a robot's state counts. What is learned of a robot is kept until the end, so beyond the largest fleet
/// only those count whose presence is declared: who invents names sends states only.
fn is_followed(robot: &Name, heard: &BTreeMap<Name, (u64, u64)>, alive: &BTreeSet<Name>) -> bool {
    heard.len() < MOST_ROBOTS || heard.contains_key(robot) || alive.contains(robot)
}

/// A ledger, how many entries follow its last snapshot, and who else gets them.
pub(super) struct Held {
    pub(super) ledger: Ledger<LedgerEntry>,
    pub(super) read: u64,
    pub(super) link: StandbyLink,
}

/// All that the loop holds.
pub(super) struct Work {
    clock: Clock,
    dispatcher: Dispatcher,
    ground: Ground,
    /// Before the writer: who reads beside it ends first.
    standby: StandbyLink,
    writer: LedgerWriter,
    flying: Option<Flying>,
    unacknowledged: Option<Unacknowledged>,
    since_snapshot: u64,
    feed: StateFeed,
    heard: BTreeMap<Name, (u64, u64)>,
    alive: BTreeSet<Name>,
    observer: Observer,
    requests: RequestQueue,
    questions: mpsc::Receiver<Input>,
    fleet: Fleet,
    news: mpsc::Receiver<News>,
    looking: MapWatch,
    /// Emergency stops of all robots: by whom.
    stops: mpsc::Receiver<Option<Name>>,
    _stops: Subscription,
    list: Option<List>,
    changed: bool,
    counters: DispatcherCounters,
    usage: Usage,
    told: watch::Sender<Standing>,
}

impl Work {
    /// Looks around once, then takes questions.
    pub(super) async fn new(
        client: &Client,
        clock: Clock,
        mut dispatcher: Dispatcher,
        Held { ledger, read, link }: Held,
        own: Option<OwnMap>,
        observer: Observer,
        told: watch::Sender<Standing>,
    ) -> Result<Self> {
        let me = Name::new(CLIENT).map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))?;
        let feed = StateFeed::open(client, &client.keys().any_robot()).await?;
        // Before any task can be given to anybody.
        let (stops, _stops) = hear_stops(client).await?;
        let found = map_watch::first_look(client, own).await;
        if let Some(roster) = &found.roster {
            dispatcher.roster(clock.ms(), roster);
        }
        let ground = ground(found.map.as_ref());
        if let Some(map) = &found.map {
            dispatcher.map(clock.ms(), map.name(), map.hash());
        }
        if let Some(places) = &found.places {
            dispatcher.set_places(places);
        }
        told.send_replace(Standing::of(
            &dispatcher,
            clock.ms(),
            DispatcherCounters::default(),
            Usage::default(),
        ));
        let writer = LedgerWriter::start(ledger, ledger::QUEUE)?;
        let (fleet, news) = Fleet::new(client, me);
        let (requests, questions) = RequestQueue::open(client).await?;
        let looking = map_watch::keep_looking(client, found, Duration::from_secs(2));
        Ok(Self {
            clock,
            dispatcher,
            ground,
            standby: link,
            writer,
            flying: None,
            unacknowledged: None,
            since_snapshot: read,
            feed,
            heard: BTreeMap::new(),
            alive: BTreeSet::new(),
            observer,
            requests,
            questions,
            fleet,
            news,
            looking,
            stops,
            _stops,
            list: None,
            changed: true,
            counters: DispatcherCounters::default(),
            usage: Usage::default(),
            told,
        })
    }

    /// Works until it is stopped.
    pub(super) async fn run(mut self, mut stopped: oneshot::Receiver<()>) -> Result<()> {
        let mut tick = tokio::time::interval(TICK);
        tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let mut ticks = 0_u64;
        loop {
            tokio::select! {
                _ = &mut stopped => break,
                Some(by) = self.stops.recv() => self.fleet_stop(by.as_ref()),
                written = durable(&mut self.flying) => self.settle(written)?,
                Some(input) = self.questions.recv() => self.take(input),
                Some(news) = self.news.recv() => self.hear(news),
                Some(input) = self.observer.inputs.recv() => self.observer.take(self.clock.ms(), input),
                Some(found) = self.looking.news.recv() => self.found(found)?,
                Some(input) = self.standby.inputs.recv() => {
                    self.standby.take(self.clock.ms(), input, &self.dispatcher);
                }
                _ = tick.tick() => {
                    ticks += 1;
                    self.look();
                    if ticks.is_multiple_of(TELL_EVERY) {
                        self.tell().await;
                    }
                    let now_ms = self.clock.ms();
                    if self.observer.has_news(now_ms) {
                        self.observer.publish(now_ms).await;
                    }
                }
            }
            self.standby.step(self.clock.ms(), &mut self.dispatcher)?;
            self.acknowledge()?;
            self.dispatcher.step(self.clock.ms(), self.ground.as_ref());
            self.carry_out();
            self.observer.step(self.clock.ms(), &self.dispatcher);
        }
        self.end().await
    }

    /// States and presence since the last time.
    fn look(&mut self) {
        let now_ms = self.clock.ms();
        let alive = self.feed.alive();
        for robot in alive.difference(&self.alive) {
            self.dispatcher.presence(now_ms, robot, true);
            self.observer.presence(now_ms, robot, true);
            self.fleet.meet(robot.clone());
        }
        for robot in self.alive.difference(&alive) {
            self.dispatcher.presence(now_ms, robot, false);
            self.observer.presence(now_ms, robot, false);
        }
        self.alive = alive;
        for (name, seen) in self.feed.shared_states() {
            if !is_followed(&name, &self.heard, &self.alive) {
                continue;
            }
            let number = (seen.state.epoch, seen.state.seq);
            if self.heard.insert(name.clone(), number) == Some(number) {
                continue;
            }
            self.standby.look(&seen.state, &self.dispatcher);
            self.dispatcher.state(now_ms, &seen.state);
            let has_task = self.dispatcher.store().on(&name).is_some();
            self.usage.look(&seen.state, has_task);
            self.observer.state(now_ms, &seen.state, has_task);
        }
        let busy = self.dispatcher.store().open_count() > 0;
        let due = if busy { COMPACT_BUSY_AT } else { COMPACT_AT };
        if self.since_snapshot >= due && self.dispatcher.compact(now_ms) {
            self.since_snapshot = 0;
        }
    }

    fn take(&mut self, input: Input) {
        match input {
            Input::Question(question) => {
                if let Some(Asked { ticket, client, request }) =
                    self.requests.read(question, &mut self.counters)
                {
                    let now_ms = self.clock.ms();
                    self.dispatcher.request(now_ms, ticket, &client, &request, self.ground.as_ref());
                }
            }
            Input::List(question) => match question.parameter("after").map(str::parse) {
                None => {
                    let list = self.list();
                    self.requests.list(question, list);
                }
                Some(Ok(after)) => {
                    let page = self.dispatcher.page(self.clock.ms(), after);
                    self.requests.list(question, Arc::new(page));
                }
                Some(Err(error)) => self.requests.refuse_list(question, format!("after={error}")),
            },
            Input::Homes(question) => self.requests.homes(question, self.dispatcher.homes(self.clock.ms())),
        }
    }

    fn hear(&mut self, news: News) {
        let now_ms = self.clock.ms();
        match news {
            News::Replied(robot, reply) => self.dispatcher.replied(now_ms, &robot, &reply),
            News::Met(robot, about) => {
                let car = Car::of_about(&about).inspect_err(|error| {
                    tracing::warn!("the factsheet of {robot} has no valid vehicle data: {error}");
                });
                self.dispatcher.set_factsheet(now_ms, &robot, &about.capabilities, car.ok());
                self.dispatcher.set_battery_levels(now_ms, &robot, levels_of(&about));
            }
        }
    }

    fn found(&mut self, found: Found) -> Result<()> {
        if found.second {
            return Err(second());
        }
        if let Some(roster) = &found.roster {
            self.dispatcher.roster(self.clock.ms(), roster);
        }
        if let Some(places) = &found.places {
            self.dispatcher.set_places(places);
        }
        if let Some(map) = &found.map {
            self.ground = found.ground.unwrap_or_else(|| ground(Some(map)));
            let now_ms = self.clock.ms();
            self.dispatcher.map(now_ms, map.name(), map.hash());
            self.changed = true;
            for suspension in self.dispatcher.suspensions() {
                tracing::warn!("{}; {}", suspension.text(), suspension.cause.remedy());
            }
        }
        Ok(())
    }

    fn fleet_stop(&mut self, by: Option<&Name>) {
        let was = self.dispatcher.suspensions();
        self.dispatcher.fleet_stop(self.clock.ms(), by);
        self.changed = true;
        if let Some(new) =
            self.dispatcher.suspensions().into_iter().find(|suspension| !was.contains(suspension))
        {
            tracing::warn!("{}; {}", new.text(), new.cause.remedy());
        }
    }

    /// Does what the dispatcher wants.
    fn carry_out(&mut self) {
        while let Some(effect) = self.dispatcher.next_effect() {
            match effect {
                Effect::Write(write) => self.write(write),
                Effect::Ask { robot, request } => self.fleet.ask(robot, request, &mut self.counters),
                Effect::Reply { ticket, reply } => self.requests.reply(ticket, reply),
                Effect::Event(event) => {
                    self.changed = true;
                    self.usage.step(&event.step);
                    self.observer.task(self.clock.ms(), &event);
                    self.requests.event(event, &mut self.counters);
                }
            }
        }
    }

    fn write(&mut self, write: Write) {
        let Write { id, entries } = write;
        let last_n = entries.last().map_or(0, |entry| entry.n);
        let snapshot = matches!(entries.as_slice(), [LedgerEntry { record: Record::Snapshot(_), .. }]);
        let submitted = match entries.as_slice() {
            [entry] if snapshot => self.writer.compact(entry),
            entries => self.writer.submit(entries),
        };
        match submitted {
            Ok(ticket) => self.flying = Some(Flying { id, last_n, snapshot, ticket }),
            Err(refused) => self.dispatcher.not_written(self.clock.ms(), id, &refused.to_string()),
        }
    }

    /// The write that was out is on the disk, or is not.
    fn settle(&mut self, (flying, written): (Flying, Written)) -> Result<()> {
        let Flying { id, last_n, snapshot, .. } = flying;
        match written {
            Ok(Ok(n)) if n == last_n => {
                self.standby.wrote(last_n);
                self.unacknowledged = Some(Unacknowledged { id, last_n, snapshot });
                self.acknowledge()
            }
            Ok(Ok(n)) => Err(lost(&format!("entry {last_n} became record {n}"))),
            Ok(Err(error)) => self.failed(self.clock.ms(), id, &error),
            Err(_) => Err(lost("its thread has ended; the last write is unconfirmed")),
        }
    }

    /// What is on the own disk takes effect when the stand-by has it too, if there is one.
    fn acknowledge(&mut self) -> Result<()> {
        let acknowledged = self.standby.acknowledged();
        let write = self.unacknowledged.take_if(|write| write.last_n <= acknowledged);
        let Some(Unacknowledged { id, snapshot, .. }) = write else { return Ok(()) };
        let entries = self.dispatcher.store().next_n();
        let written = self.dispatcher.written(self.clock.ms(), id);
        written.map_err(|error| lost(&format!("the written entry is inconsistent: {error}")))?;
        self.since_snapshot += self.dispatcher.store().next_n() - entries;
        self.counters.snapshots += u64::from(snapshot);
        self.changed = true;
        Ok(())
    }

    fn failed(&mut self, now_ms: u64, id: u64, error: &LedgerWriteError) -> Result<()> {
        tracing::warn!("{error}");
        if matches!(error.error.fault, LedgerFault::Overtaken { .. }) {
            return Err(Error::from(error.error.as_ref()));
        }
        // There is never more than one write out, so its queue has room.
        self.writer.resume(error).map_err(|refused| lost(&refused.to_string()))?;
        self.dispatcher.not_written(now_ms, id, &error.to_string());
        Ok(())
    }

    /// The list for those who ask; made anew only when something has changed.
    fn list(&mut self) -> List {
        let now_ms = self.clock.ms();
        match &self.list {
            Some(list) if !self.changed && now_ms.saturating_sub(list.at_ms) < 500 => list.clone(),
            _ => {
                let list = Arc::new(self.dispatcher.list(now_ms));
                self.changed = false;
                self.list = Some(list.clone());
                list
            }
        }
    }

    async fn tell(&mut self) {
        self.counters.overloaded = self.requests.overloaded();
        self.counters.foreign_keys = self.requests.foreign_keys();
        self.counters.ledger = self.writer.counters();
        self.counters.observer = self.observer.counters();
        self.counters.standby_questions = self.standby.questions();
        self.counters.standby_overloaded = self.standby.overloaded();
        let (counters, usage) = (self.counters.clone(), self.usage.clone());
        self.told.send_replace(Standing::of(&self.dispatcher, self.clock.ms(), counters, usage));
        if self.requests.has_listeners().await {
            self.requests.tell(&self.dispatcher.published(self.clock.ms())).await;
        }
    }

    /// Takes nothing more, and waits for what is being written and for its answers.
    async fn end(mut self) -> Result<()> {
        self.requests.close();
        if self.flying.is_some() {
            match tokio::time::timeout(LAST_WRITE, durable(&mut self.flying)).await {
                Ok(written) => self.settle(written)?,
                Err(_) => return Err(lost("the disk does not respond; the last write is unconfirmed")),
            }
        }
        if self.unacknowledged.is_some() {
            let until = tokio::time::Instant::now() + LAST_COPY;
            while self.unacknowledged.is_some()
                && let Ok(Some(input)) = tokio::time::timeout_at(until, self.standby.inputs.recv()).await
            {
                self.standby.take(self.clock.ms(), input, &self.dispatcher);
                self.acknowledge()?;
            }
        }
        while let Some(effect) = self.dispatcher.next_effect() {
            if let Effect::Reply { ticket, reply } = effect {
                self.requests.reply(ticket, reply);
            }
        }
        self.requests.last_answers().await;
        self.observer.end(self.clock.ms());
        self.tell().await;
        Ok(())
    }
}

/// Emergency stops of all robots, whatever they carry. They come again and again: what finds no room is the same.
async fn hear_stops(client: &Client) -> Result<(mpsc::Receiver<Option<Name>>, Subscription)> {
    let (sender, stops) = mpsc::channel(STOPS);
    let each = move |incoming: Incoming| match Key::parse(&incoming.key).map(|key| key.channel) {
        Some(Channel::EstopAll(by)) => drop(sender.try_send(Some(by))),
        _ => tracing::warn!("emergency stop on an unknown key: {}", incoming.key),
    };
    let subscription = client.bus().subscribe(&client.keys().estop_all(None), each).await?;
    Ok((stops, subscription))
}

fn lost(what: &str) -> Error {
    Error::new(ErrorKind::Failed, format!("the ledger: {what}"))
        .hint("start again: it continues from the ledger")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(name: &str) -> Name {
        Name::new(name).unwrap()
    }

    #[test]
    fn beyond_the_largest_fleet_only_a_robot_that_is_there_is_followed() {
        let mut heard = BTreeMap::new();
        let alive = BTreeSet::from([robot("xtb-1")]);
        for ghost in 0..MOST_ROBOTS {
            assert!(is_followed(&robot("new"), &heard, &alive));
            heard.insert(robot(&format!("ghost-{ghost}")), (1, 1));
        }
        assert!(!is_followed(&robot("new"), &heard, &alive));
        assert!(is_followed(&robot("xtb-1"), &heard, &alive));
        assert!(is_followed(&robot("ghost-0"), &heard, &alive));
    }
}
