//! What the robots really drove, from their own events; and what the ledger says about it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use xtb_bus::{Bus, Subscription};
use xtb_dispatch::{LedgerEntry, Record};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Assignment, Event, EventKind, GoalStatus, TaskId};
use xtb_protocol::{Name, Uuid};
use xtb_services::ledger;

use crate::name;

/// A goal that a robot reported as reached.
#[derive(Debug, Clone)]
pub struct Reached {
    /// Which robot.
    pub robot: Name,
    /// When that was heard.
    pub at: Instant,
    /// Which goal.
    pub goal: Uuid,
}

/// Which events came, and the goals that they tell of.
type Heard = (BTreeSet<(Name, u64, u64)>, Vec<Reached>);

/// Hears all robots' events.
#[derive(Clone, Default)]
pub struct Witness {
    heard: Arc<Mutex<Heard>>,
    _subscription: Option<Arc<Subscription>>,
}

impl Witness {
    /// Listens from now on.
    ///
    /// # Panics
    /// If Zenoh fails.
    pub async fn listen(bus: &Bus) -> Self {
        let witness = Self::default();
        let hears = witness.clone();
        let key = FleetKeys::new(name("lab")).any_robot().event();
        let subscription = bus.subscribe_events(&key, move |incoming| {
            if let Ok(event) = incoming.decode() {
                hears.take(event);
            }
        });
        let subscription = subscription.await.unwrap_or_else(|error| panic!("{error}"));
        Self { _subscription: Some(Arc::new(subscription)), ..witness }
    }

    /// An event came, perhaps again: each counts once.
    pub fn take(&self, Event { robot, epoch, seq, kind, .. }: Event) {
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        if heard.0.insert((robot.clone(), epoch, seq))
            && let EventKind::Goal { id, status: GoalStatus::Reached, .. } = kind
        {
            heard.1.push(Reached { robot, at: Instant::now(), goal: id });
        }
    }

    /// All goals that were reached, as they were heard.
    #[must_use]
    pub fn reached(&self) -> Vec<Reached> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).1.clone()
    }

    /// The same by task and leg, for the goals of this ledger.
    #[must_use]
    pub fn drives(&self, book: &Written) -> BTreeMap<(TaskId, u32), Vec<Reached>> {
        let mut drives = BTreeMap::<_, Vec<Reached>>::new();
        for reached in self.reached() {
            let Some((seq, leg)) = Assignment::of_goal(book.ledger, reached.goal) else { continue };
            let task =
                book.assigned.get(&seq).unwrap_or_else(|| panic!("assignment {seq} is not in the ledger"));
            drives.entry((*task, leg)).or_default().push(reached);
        }
        drives
    }
}

/// What the ledger's file holds.
#[derive(Debug, Clone, Default)]
pub struct Written {
    /// Its number.
    pub ledger: u64,
    /// Which task each assignment is of.
    pub assigned: BTreeMap<u64, TaskId>,
    /// Which legs of which task were taken down as done, each as often as it was.
    pub legs: BTreeMap<(TaskId, u32), u32>,
    /// Tasks that were taken.
    pub submitted: BTreeSet<TaskId>,
    /// Records.
    pub records: usize,
}

impl Written {
    /// Reads it, beside a running dispatcher too.
    ///
    /// # Panics
    /// If it is damaged, or was compacted.
    #[must_use]
    pub fn read(path: &Path) -> Self {
        let reading = ledger::read(path).unwrap_or_else(|error| panic!("{error}"));
        assert!(reading.damage.is_empty(), "{:?}", reading.damage);
        let mut written = Self { records: reading.rows.len(), ..Self::default() };
        for row in reading.rows {
            let entry = LedgerEntry::from_json(&row.body).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(entry.n, row.seq, "an entry out of its place");
            match entry.record {
                Record::Opened { ledger } => written.ledger = ledger,
                Record::Submitted { task, .. } => {
                    assert!(written.submitted.insert(task), "{task} was taken twice");
                }
                Record::Assigned { task, seq, .. } => drop(written.assigned.insert(seq, task)),
                Record::Reached { task, leg, .. } => *written.legs.entry((task, leg)).or_default() += 1,
                Record::Became { .. }
                | Record::Extended { .. }
                | Record::Suspended { .. }
                | Record::Activated { .. }
                | Record::Map { .. }
                | Record::Term { .. }
                | Record::Pair { .. }
                | Record::Adopted { .. } => {}
                Record::Snapshot(_) => panic!("it was compacted, and who did what is not in it any more"),
            }
        }
        written
    }
}
