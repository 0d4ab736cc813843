//! The dispatcher: inputs change what it knows, [`step`](Dispatcher::step) decides, effects come out.
//!
//! It never touches the [`TaskStore`] itself: it proposes records, and when their write is durable the store
//! takes them and what follows from them goes out. Whatever it wants of a robot follows from store and
//! robot anew at each step ([`task_progress`](crate::task_progress)).

mod allocation;
mod client_requests;
mod homes;
mod map_check;
mod pages;
mod robot_requests;
mod standby;
mod suspension;
mod task_updates;

use crate::admission::ledger_failed;
use crate::home::HomeRules;
use crate::settings::DispatcherSettings;
use crate::suspension::{FleetStop, KnownMap};
use crate::task_store::record::{LedgerEntry, Record};
use crate::task_store::{ReplayError, TaskStore};
use crate::tracked_robot::TrackedRobot;
use crate::travel_cost::TravelCost;
use crate::write_queue::{OnWritten, Write, WriteQueue};
use client_requests::OpenRequest;
use map_check::MapCheck;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use xtb_nav::Car;
use xtb_protocol::messages::{
    DispatchOutcome, DispatchReply, MapPlace, Request, RobotState, Roster, TaskEvent, TaskHistory, TaskId,
};
use xtb_protocol::{Name, Uuid};

/// Which question of the caller's an answer belongs to; chosen by the caller.
pub type Ticket = u64;

/// What the caller has to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Make these entries durable, all or none, then say [`Dispatcher::written`] or
    /// [`Dispatcher::not_written`]. There is never more than one write out.
    Write(Write),
    /// Ask this robot, as the client that the dispatcher was named; what it answers goes to
    /// [`Dispatcher::replied`]. No answer needs no report.
    Ask {
        /// Whom.
        robot: Name,
        /// What.
        request: Request,
    },
    /// The answer to a question.
    Reply {
        /// Which.
        ticket: Ticket,
        /// For whoever asked.
        reply: DispatchReply,
    },
    /// A task has changed, and it is in the ledger.
    Event(TaskEvent),
}

/// Who this dispatcher is, fixed at its start.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DispatcherIdentity {
    /// As which client it asks robots; the same at each start, so that it gets its leases back.
    pub me: Name,
    /// Number of the ledger, if it has to be opened: random, at most 48 bits.
    pub ledger: u64,
    /// Random at each start: ids of requests come from it.
    pub run: u64,
}

/// The dispatcher.
#[derive(Debug, Clone)]
pub struct Dispatcher {
    identity: DispatcherIdentity,
    settings: DispatcherSettings,
    store: TaskStore,
    writes: WriteQueue,
    robots: BTreeMap<Name, TrackedRobot>,
    has_roster: bool,
    /// Presence is told of: whoever's is not is not there.
    has_presence: bool,
    open_requests: VecDeque<OpenRequest>,
    effects: VecDeque<Effect>,
    /// Tasks that wait for a robot which is nearly done, as of the last round.
    reserved: BTreeMap<TaskId, Name>,
    /// An emergency stop of all robots that is not in the ledger yet. It holds at once all the same.
    unwritten_stop: Option<FleetStop>,
    /// The fleet's map, as somebody has said it in this run.
    map: Option<KnownMap>,
    /// Tasks whose points have to be looked up on the map.
    check: Option<MapCheck>,
    /// Where robots go by themselves; `None` = they do not.
    home_rules: Option<Arc<HomeRules>>,
    /// The places of the fleet's map, as somebody has said them in this run.
    places: Option<Vec<MapPlace>>,
    requests: u64,
    next_allocation_ms: u64,
    started_ms: u64,
}

impl Dispatcher {
    /// Goes on where these entries of a ledger end; none = a ledger that is to be opened.
    ///
    /// # Errors
    /// Entries that do not fit: nothing may be written to that ledger then.
    pub fn recover(
        now_ms: u64,
        identity: DispatcherIdentity,
        settings: DispatcherSettings,
        entries: impl IntoIterator<Item = LedgerEntry>,
    ) -> Result<Self, ReplayError> {
        let store = TaskStore::replay(settings.keep_ended, entries)?;
        let mut writes = WriteQueue::default();
        if store.ledger().is_none() {
            writes.push(now_ms, vec![Record::Opened { ledger: identity.ledger }], OnWritten::Nothing);
        }
        let robots =
            store.busy().map(|(name, _)| (name.clone(), TrackedRobot::new(name.clone(), now_ms))).collect();
        Ok(Self {
            identity,
            settings,
            store,
            writes,
            robots,
            has_roster: false,
            has_presence: false,
            open_requests: VecDeque::new(),
            effects: VecDeque::new(),
            reserved: BTreeMap::new(),
            unwritten_stop: None,
            map: None,
            check: None,
            home_rules: None,
            places: None,
            requests: 0,
            next_allocation_ms: 0,
            started_ms: now_ms,
        })
    }

    /// The ledger as it is in memory.
    #[must_use]
    pub fn store(&self) -> &TaskStore {
        &self.store
    }

    /// What is known of the robots.
    #[must_use]
    pub fn robots(&self) -> &BTreeMap<Name, TrackedRobot> {
        &self.robots
    }

    /// Has everything so far written as one snapshot, in the place of all entries before it; it is an entry
    /// with a number of its own. `false` = not now: something else is being written, or the ledger fails.
    pub fn compact(&mut self, now_ms: u64) -> bool {
        if self.store.ledger().is_none() || self.writes.len() > 0 || !self.writes.may_try(now_ms) {
            return false;
        }
        let record = Record::Snapshot(Box::new(self.store.clone()));
        self.writes.push(now_ms, vec![record], OnWritten::Nothing);
        self.write(now_ms);
        true
    }

    /// Why the ledger cannot be written now, if it cannot.
    #[must_use]
    pub fn ledger_failed(&self) -> Option<&str> {
        self.writes.failed()
    }

    /// One task with its history.
    #[must_use]
    pub fn history(&self, id: TaskId) -> Option<TaskHistory> {
        let task = self.store.task(id)?;
        Some(TaskHistory { task: self.view(task), ..task.history() })
    }

    /// Which robots there should be; from now on others are refused by name. One without any robot is none.
    pub fn roster(&mut self, now_ms: u64, roster: &Roster) {
        self.has_roster = !roster.robots.is_empty();
        self.robots.values_mut().for_each(|robot| robot.in_roster = false);
        for entry in &roster.robots {
            let robot = self.robot(now_ms, &entry.name);
            robot.in_roster = true;
            robot.tags = entry.tags.iter().map(|tag| tag.trim_start_matches('@').to_owned()).collect();
        }
    }

    /// A robot's presence was declared, or is gone.
    pub fn presence(&mut self, now_ms: u64, name: &Name, alive: bool) {
        self.has_presence = true;
        self.robot(now_ms, name).alive = alive;
    }

    /// A robot's factsheet says what it can do, and what car it is if that can be read.
    pub fn set_factsheet(&mut self, now_ms: u64, name: &Name, capabilities: &[String], car: Option<Car>) {
        let robot = self.robot(now_ms, name);
        (robot.capabilities, robot.car) = (Some(capabilities.iter().cloned().collect()), car);
    }

    /// A robot's state.
    pub fn state(&mut self, now_ms: u64, state: &RobotState) {
        let me = self.identity.me.clone();
        let settings = self.settings;
        self.robot(now_ms, &state.robot).observe(now_ms, state, &me, &settings);
    }

    fn robot(&mut self, now_ms: u64, name: &Name) -> &mut TrackedRobot {
        self.robots.entry(name.clone()).or_insert_with(|| TrackedRobot::new(name.clone(), now_ms))
    }

    /// Decides. To be called some 20 times a second, and after anything that should not wait.
    pub fn step(&mut self, now_ms: u64, travel_cost: &dyn TravelCost) {
        self.check_fleet_stop(now_ms);
        if self.writes.is_held() {
            return self.answer(now_ms);
        }
        self.send_requests(now_ms);
        self.answer(now_ms);
        if self.writes.may_try(now_ms) {
            self.write_suspension(now_ms);
            self.check_deadlines(now_ms);
            self.check_robots(now_ms);
            if now_ms >= self.next_allocation_ms {
                self.next_allocation_ms = now_ms + self.settings.allocation_period_ms;
                self.check_points(now_ms, travel_cost);
                self.check_homes(now_ms, travel_cost);
                self.allocate(now_ms, travel_cost);
            }
        }
        self.write(now_ms);
    }

    fn write(&mut self, now_ms: u64) {
        if self.writes.may_try(now_ms)
            && let Some(write) = self.writes.next(&self.store)
        {
            self.effects.push_back(Effect::Write(write));
        }
    }

    /// The next thing to do.
    pub fn next_effect(&mut self) -> Option<Effect> {
        self.effects.pop_front()
    }

    /// A write is durable: the store takes it, and what follows from it goes out.
    ///
    /// # Errors
    /// Never, unless the entries were not those of [`Effect::Write`]: then this process must end.
    pub fn written(&mut self, now_ms: u64, id: u64) -> Result<(), ReplayError> {
        let Some((entries, jobs)) = self.writes.written(id) else { return Ok(()) };
        for entry in &entries {
            self.store.apply(entry)?;
            self.announce(entry);
        }
        for job in jobs {
            if let OnWritten::Answer { ticket, request, outcome } = job.on_written {
                self.reply(ticket, request, outcome);
            }
        }
        self.write(now_ms);
        Ok(())
    }

    /// A write has failed, and nothing of it is in the ledger: whoever waited is told why; everything else
    /// is seen again.
    pub fn not_written(&mut self, now_ms: u64, id: u64, why: &str) {
        let again_ms = now_ms + self.settings.ledger_retry_ms;
        for job in self.writes.lost(id, why.to_owned(), again_ms).unwrap_or_default() {
            if let OnWritten::Answer { ticket, request, .. } = job.on_written {
                let error = ledger_failed(why);
                self.reply(ticket, request, DispatchOutcome::Error(error));
            }
            if job.records.iter().any(|record| matches!(record, Record::Opened { .. })) {
                self.writes.push(job.at_ms, job.records, OnWritten::Nothing);
            }
        }
    }

    fn announce(&mut self, entry: &LedgerEntry) {
        let task = match &entry.record {
            Record::Submitted { task, .. }
            | Record::Assigned { task, .. }
            | Record::Reached { task, .. }
            | Record::Extended { task, .. }
            | Record::Became { task, .. } => *task,
            Record::Suspended { .. } => {
                self.unwritten_stop = None;
                return;
            }
            Record::Adopted { .. } => {
                self.check = Some(MapCheck::Points);
                return;
            }
            Record::Opened { .. }
            | Record::Activated { .. }
            | Record::Map { .. }
            | Record::Term { .. }
            | Record::Pair { .. }
            | Record::Snapshot(_) => return,
        };
        self.update_robots(entry, task);
        let step = self.store.task(task).and_then(|task| task.steps.back().cloned());
        if let (Some(ledger), Some(step)) = (self.store.ledger(), step) {
            self.effects.push_back(Effect::Event(TaskEvent { ledger, entry: entry.n, task, step }));
        }
    }

    fn reply(&mut self, ticket: Ticket, id: Uuid, result: DispatchOutcome) {
        let (result, left_out) = match result {
            DispatchOutcome::Changed(changes) => {
                let (changes, left_out) = pages::fitting(changes);
                (DispatchOutcome::Changed(changes), left_out)
            }
            result => (result, 0),
        };
        let reply = DispatchReply { id, result, left_out, suspended: self.suspensions() };
        self.effects.push_back(Effect::Reply { ticket, reply });
    }

    fn new_id(&mut self) -> Uuid {
        self.requests += 1;
        Uuid::from_u64_pair(self.identity.run, self.requests)
    }
}
