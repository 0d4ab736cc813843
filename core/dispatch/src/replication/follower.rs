//! The stand-by's side of a pair: when it takes over, and why it does not.

use super::{Times, majority};
use std::collections::BTreeSet;
use xtb_protocol::Name;
use xtb_protocol::messages::Witnesses;

/// What the stand-by sees besides the dispatcher's answers.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Observed {
    /// A dispatcher's presence is declared.
    pub present: bool,
    /// Robots whose states come in.
    pub robots: BTreeSet<Name>,
    /// One of them that has just heard the dispatcher.
    pub hears: Option<Name>,
}

/// What a stand-by does now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StandbyDecision {
    /// It follows, and would take over.
    Paired,
    /// It follows, and has not been told that it is needed: it lacks records, or another one is paired.
    CatchingUp,
    /// The dispatcher is silent; it does not take over yet.
    Waits(String),
    /// It does not take over by itself any more: it may lack what the dispatcher acknowledged alone.
    Stale,
    /// It takes over, in a higher term.
    TakeOver,
}

/// The last answer that said "paired".
#[derive(Debug, Clone)]
struct Pairing {
    /// When the question that it answers was sent.
    asked_ms: u64,
    witnesses: Witnesses,
}

/// A stand-by.
#[derive(Debug, Clone)]
pub struct Follower {
    times: Times,
    pairing: Option<Pairing>,
    /// The run of the dispatcher that the witnesses are of.
    run: Option<u64>,
    witnesses: Option<Witnesses>,
    /// Time that this process ran since the last answer.
    silent_ms: u64,
    stepped_ms: u64,
}

impl Follower {
    /// One that was not answered yet.
    #[must_use]
    pub fn new(times: Times, now_ms: u64) -> Self {
        Self { times, pairing: None, run: None, witnesses: None, silent_ms: 0, stepped_ms: now_ms }
    }

    /// An answer to the question that was sent at `asked_ms`. `paired`: the dispatcher, in this run, acknowledges
    /// nothing that this copy lacks.
    pub fn answered(&mut self, asked_ms: u64, run: u64, paired: bool, witnesses: Option<Witnesses>) {
        if self.run != Some(run) {
            (self.run, self.witnesses) = (Some(run), None);
        }
        if witnesses.is_some() {
            self.witnesses = witnesses;
        }
        self.silent_ms = 0;
        self.pairing = match (&self.witnesses, paired) {
            (Some(witnesses), true) => Some(Pairing { asked_ms, witnesses: witnesses.clone() }),
            _ => None,
        };
    }

    /// Which witnesses it knows of the dispatcher that it follows; 0 = none.
    #[must_use]
    pub fn knows(&self) -> u32 {
        self.witnesses.as_ref().map_or(0, |witnesses| witnesses.version)
    }

    /// Looks at the clock and around.
    pub fn step(&mut self, now_ms: u64, seen: &Observed) -> StandbyDecision {
        let ran_ms = now_ms.saturating_sub(self.stepped_ms).min(self.times.step_ms);
        self.stepped_ms = now_ms;
        self.silent_ms = self.silent_ms.saturating_add(ran_ms);
        let is_silent = self.silent_ms >= self.times.silent_ms;
        let Some(pairing) = &self.pairing else {
            return if is_silent { StandbyDecision::Stale } else { StandbyDecision::CatchingUp };
        };
        if now_ms.saturating_sub(pairing.asked_ms) > self.times.take_over_ms {
            return StandbyDecision::Stale;
        }
        if !is_silent {
            return StandbyDecision::Paired;
        }
        match self.lacks(pairing, seen) {
            Some(why) => StandbyDecision::Waits(why),
            None => StandbyDecision::TakeOver,
        }
    }

    fn lacks(&self, pairing: &Pairing, seen: &Observed) -> Option<String> {
        if seen.present {
            return Some("the dispatcher is silent, but still present".to_owned());
        }
        if let Some(robot) = &seen.hears {
            return Some(format!("the dispatcher is silent, but {robot} hears it"));
        }
        let (visible, is_majority) = majority(&pairing.witnesses, &seen.robots);
        let of = pairing.witnesses.robots.len();
        (!is_majority)
            .then(|| format!("the dispatcher is silent, but only {visible} of {of} robots are visible here"))
    }

    /// Whether the dispatcher cannot have gone on alone yet: asked again when the record of the new term is on
    /// the disk.
    #[must_use]
    pub fn is_in_time(&self, now_ms: u64) -> bool {
        let since = |pairing: &Pairing| now_ms.saturating_sub(pairing.asked_ms);
        let latest_ms = self.times.take_over_ms.midpoint(self.times.alone_ms);
        self.pairing.as_ref().is_some_and(|pairing| since(pairing) < latest_ms)
    }
}
