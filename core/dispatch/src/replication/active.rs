//! The dispatcher's side of a pair: what is acknowledged, when it is alone, when it is held.

use super::{Times, majority};
use std::collections::BTreeSet;
use xtb_protocol::Name;
use xtb_protocol::messages::{StandbyView, Witnesses};

/// What a stand-by has said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Follow {
    /// Number of its copy.
    pub copy: u64,
    /// The last record on its disk.
    pub last: u64,
    /// Which witnesses it knows.
    pub witnesses: u32,
}

/// The last copy whose records were found to be ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Known {
    copy: u64,
    last: u64,
    heard_ms: u64,
}

/// A dispatcher that may have a stand-by.
#[derive(Debug, Clone)]
pub struct Active {
    times: Times,
    term: u32,
    paired: Option<u64>,
    known: Option<Known>,
    /// The last record on the own disk.
    own: u64,
    /// The last record that counted as acknowledged: a stand-by that lacks it is not paired yet.
    given: u64,
    /// Time that this process ran since it heard the paired stand-by.
    quiet_ms: u64,
    stepped_ms: u64,
    /// The witnesses that the stand-by is known to have, and those that it is sent; their version 0 = none yet.
    agreed: Option<Witnesses>,
    proposed: Witnesses,
    /// Why the stand-by may have taken over, if it may, since it was heard last.
    doubt: Option<String>,
    superseded: Option<u32>,
}

impl Active {
    /// One whose ledger ends with this record, term and pair.
    #[must_use]
    pub fn new(times: Times, now_ms: u64, own: u64, term: u32, paired: Option<u64>) -> Self {
        Self {
            times,
            term,
            paired,
            known: None,
            own,
            given: own,
            quiet_ms: 0,
            stepped_ms: now_ms,
            agreed: None,
            proposed: Witnesses { version: 0, robots: Vec::new() },
            doubt: None,
            superseded: None,
        }
    }

    /// A stand-by whose last record is one of ours has asked.
    pub fn follows(&mut self, now_ms: u64, follow: Follow) {
        let Follow { copy, last, witnesses } = follow;
        let is_paired = self.paired == Some(copy);
        if self.paired.is_some() && !is_paired {
            return; // One stand-by at a time counts.
        }
        self.known = Some(Known { copy, last, heard_ms: now_ms });
        (self.quiet_ms, self.doubt) = (0, None);
        let has_read = witnesses != 0 && witnesses == self.proposed.version;
        if has_read {
            self.agreed = Some(self.proposed.clone());
        }
        // Not before it has read an answer: one that ends before that, as it cannot read or write them, would be
        // waited for without end.
        if !is_paired && has_read && last + self.times.caught_up >= self.own {
            self.paired = Some(copy);
        }
        self.note_given();
    }

    fn note_given(&mut self) {
        self.given = self.given.max(self.acknowledged());
    }

    /// A stand-by ends and does not take over: nobody has to be waited for.
    pub fn left(&mut self, copy: u64) {
        if self.paired == Some(copy) {
            self.paired = None;
        }
        self.known = self.known.filter(|known| known.copy != copy);
        self.note_given();
    }

    /// The own disk has the records up to this one.
    pub fn wrote(&mut self, last: u64) {
        self.own = last;
        self.note_given();
    }

    /// Somebody has, or knows of, this term of the same ledger.
    pub fn saw_term(&mut self, term: u32) {
        if term > self.term {
            self.superseded = Some(self.superseded.unwrap_or(0).max(term));
        }
    }

    /// The term of the next assignment; it grows by itself only when all numbers of a term are used up.
    pub fn in_term(&mut self, term: u32) {
        self.term = self.term.max(term);
    }

    /// Looks at the clock, and at the robots whose states come in.
    pub fn step(&mut self, now_ms: u64, visible: &BTreeSet<Name>) {
        let ran_ms = now_ms.saturating_sub(self.stepped_ms).min(self.times.step_ms);
        self.stepped_ms = now_ms;
        self.quiet_ms = self.quiet_ms.saturating_add(ran_ms);
        self.propose(now_ms, visible);
        if self.paired.is_none() {
            self.doubt = None;
            return;
        }
        // The stand-by may have taken over at any moment at which this side did not see most robots: those that
        // come back later prove nothing.
        if self.quiet_ms >= self.times.doubt_ms && self.doubt.is_none() {
            self.doubt = self.lacks(visible);
        }
        if self.quiet_ms >= self.times.alone_ms && self.doubt.is_none() {
            self.paired = None;
            self.note_given();
        }
    }

    /// The witnesses change only when the stand-by has the last ones: it decides by those or by these.
    fn propose(&mut self, now_ms: u64, visible: &BTreeSet<Name>) {
        let is_first = self.proposed.version == 0 && self.is_known();
        let has_last = self.agreed.as_ref().is_some_and(|agreed| agreed.version == self.proposed.version);
        if is_first || (has_last && !self.proposed.robots.iter().eq(visible.iter())) {
            // Not a number of an earlier run: the stand-by names that one until it is answered by this run.
            let next = if is_first { now_ms as u32 } else { self.proposed.version.wrapping_add(1) };
            self.proposed = Witnesses { version: next.max(1), robots: visible.iter().cloned().collect() };
        }
    }

    /// Why this side may not go on without its stand-by, if it may not.
    fn lacks(&self, visible: &BTreeSet<Name>) -> Option<String> {
        let Some(agreed) = &self.agreed else {
            return Some("its stand-by does not answer, and may have taken over".to_owned());
        };
        // Where no robot was online nobody takes over.
        let minority =
            |witnesses: &&Witnesses| !witnesses.robots.is_empty() && !majority(witnesses, visible).1;
        let witnesses = [agreed, &self.proposed].into_iter().find(minority)?;
        let (seen, of) = (majority(witnesses, visible).0, witnesses.robots.len());
        let why = "its stand-by does not answer, and may have taken over:";
        Some(format!("{why} only {seen} of {of} robots were visible here"))
    }

    /// The last record that may be acknowledged.
    #[must_use]
    pub fn acknowledged(&self) -> u64 {
        match self.paired {
            None => self.own,
            Some(copy) => {
                let known = self.known.filter(|known| known.copy == copy);
                known.map_or(0, |known| known.last.min(self.own))
            }
        }
    }

    /// The copy that has to have what is acknowledged.
    #[must_use]
    pub fn paired(&self) -> Option<u64> {
        self.paired
    }

    /// Whether there is, or has to be, a stand-by.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.known.is_some() || self.paired.is_some()
    }

    /// Why nothing may be done.
    #[must_use]
    pub fn held(&self) -> Option<&str> {
        let is_over = self.paired.is_some() && self.quiet_ms >= self.times.alone_ms;
        self.doubt.as_deref().filter(|_| is_over)
    }

    /// The higher term that somebody else has: this dispatcher has to end.
    #[must_use]
    pub fn superseded(&self) -> Option<u32> {
        self.superseded
    }

    /// The witnesses, for a stand-by that knows others.
    #[must_use]
    pub fn witnesses_for(&self, known: u32) -> Option<Witnesses> {
        (known != self.proposed.version && self.proposed.version != 0).then(|| self.proposed.clone())
    }

    /// The stand-by, and whether it may take over: it has witnesses, and everything that was ever acknowledged.
    #[must_use]
    pub fn view(&self, now_ms: u64) -> Option<StandbyView> {
        self.known.map(|Known { copy, last, heard_ms }| StandbyView {
            copy,
            paired: self.paired == Some(copy) && last >= self.given && self.agreed.is_some(),
            last,
            age_ms: now_ms.saturating_sub(heard_ms),
        })
    }
}
