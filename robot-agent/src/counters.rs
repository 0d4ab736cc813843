//! What was refused or dropped before it reached the control loop, counted by cause.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use xtb_protocol::messages::{RejectCode, Rejected};
use xtb_protocol::wire::CodecError;

/// What was refused or dropped outside the loop.
#[derive(Debug, Default)]
pub(crate) struct Counters {
    malformed: AtomicU64,
    oversized: AtomicU64,
    wrong_version: AtomicU64,
    out_of_range: AtomicU64,
    overloaded: AtomicU64,
    /// Setpoints that a newer one displaced before a turn saw them.
    pub(crate) setpoints_overwritten: AtomicU64,
    fenced: AtomicU64,
    /// The session's counter of what came in on keys that are none of ours.
    foreign_keys: OnceLock<Arc<AtomicU64>>,
    /// Events that found the queue to the uplink full.
    pub(crate) events_dropped: AtomicU64,
}

impl Counters {
    /// Counts a message that could not be read.
    pub(crate) fn rejected(&self, error: &CodecError) {
        let counter = match error.code() {
            RejectCode::Oversized => &self.oversized,
            RejectCode::WrongVersion => &self.wrong_version,
            RejectCode::OutOfRange => &self.out_of_range,
            _ => &self.malformed,
        };
        counter.fetch_add(1, Ordering::Relaxed);
    }

    /// From now on what the session drops because of its key is malformed too.
    pub(crate) fn follow_foreign_keys(&self, counter: Arc<AtomicU64>) {
        // There is one session in an agent's life.
        let _ = self.foreign_keys.set(counter);
    }

    /// Counts a state of another robot that cannot be true.
    pub(crate) fn impossible(&self) {
        self.out_of_range.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a request or reply that found its queue full.
    pub(crate) fn overloaded(&self) {
        self.overloaded.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a setpoint that did not bear the present lease.
    pub(crate) fn fenced(&self) {
        self.fenced.fetch_add(1, Ordering::Relaxed);
    }

    /// For the state.
    #[must_use]
    pub(crate) fn rejected_so_far(&self) -> Rejected {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Rejected {
            malformed: read(&self.malformed) + self.foreign_keys.get().map_or(0, |keys| read(keys)),
            oversized: read(&self.oversized),
            wrong_version: read(&self.wrong_version),
            out_of_range: read(&self.out_of_range),
            overloaded: read(&self.overloaded),
            setpoints_overwritten: read(&self.setpoints_overwritten),
            fenced: read(&self.fenced),
            events_dropped: read(&self.events_dropped),
            ..Rejected::default()
        }
    }
}
