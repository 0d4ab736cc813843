//! Two dispatchers with one ledger: when a write counts, and which of the two drives.
//!
//! ```text
//!   stand-by ── "I have n on my disk" ──► dispatcher      every question acknowledges what came before
//!   stand-by ◄── records n+1 …, paired ── dispatcher      answered at once, or after 0.2 s without news
//!
//!   dispatcher:  alone ──(the copy has caught up)──► paired ──(silent for 5 s, most robots seen)──► alone
//!                                                      ▲ └──(silent for 5 s, else)──► held
//!                                                      └────────(it answers)───────────┘
//!   stand-by:    follows ──(no answer for 1.5 s, robots agree, at most 4 s)──► takes over
//! ```
//!
//! * **Paired**: nothing is acknowledged before both disks have it. The dispatcher goes on **alone** when its
//!   stand-by was silent for [`Times::alone_ms`], or has left. A copy that lacks what was acknowledged alone is
//!   not told that it is paired.
//! * **The promise.** An answer to a question proves that the dispatcher had that question when it said "paired".
//!   So it is not alone earlier than `alone_ms` after the question was *sent*. The stand-by takes over only
//!   within [`Times::take_over_ms`] of that moment, which is less: what it does not have was acknowledged to
//!   nobody. Both measure with their own monotonic clock; no clocks are compared.
//! * **Robots decide** between the two halves of a split network: each side has to see more than half of the
//!   robots that were online when both agreed last ([`Witnesses`]), before it goes on without the other: the
//!   stand-by at one moment, the dispatcher all the time since [`Times::doubt_ms`].
//! * **Term**: a take-over raises it. It stands in the high bits of `assign_seq`, so that robots refuse what a
//!   dispatcher of an earlier term sends late: its numbers are lower than those that they have.
//! * A process that was held up counts only the time in which it ran: before it concludes anything from
//!   silence, it listens.

mod active;
mod follower;

pub use active::{Active, Follow};
pub use follower::{Follower, Observed, StandbyDecision};

use std::collections::BTreeSet;
use xtb_protocol::Name;
use xtb_protocol::messages::{TERM_BITS, Witnesses};

/// Times of a pair, in ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// A question is answered after this long if there is nothing new.
    pub answer_ms: u64,
    /// The stand-by takes nobody for dead who was silent for less: seven answers, and longer than a dispatcher
    /// needs to start again.
    pub silent_ms: u64,
    /// It takes over within this after its last answered question, or not by itself: a computer that has died is
    /// taken for present for 2 s.
    pub take_over_ms: u64,
    /// The dispatcher goes on alone after this: `take_over_ms`, half a second for the record of the new term to
    /// reach the disk, and another one for clocks that do not run equally fast.
    pub alone_ms: u64,
    /// From this silence on the dispatcher has to see most robots all the time: its stand-by may take over.
    pub doubt_ms: u64,
    /// Time between two steps that counts at most.
    pub step_ms: u64,
    /// A robot that heard the dispatcher within this says that it is alive.
    pub heard_ms: u64,
    /// A copy that lacks at most this many records has caught up: the pair begins.
    pub caught_up: u64,
}

impl Default for Times {
    fn default() -> Self {
        Self {
            answer_ms: 200,
            silent_ms: 1_500,
            take_over_ms: 4_000,
            alone_ms: 5_000,
            doubt_ms: 500,
            step_ms: 100,
            heard_ms: 1_000,
            caught_up: 64,
        }
    }
}

/// The term of an assignment's number.
#[must_use]
pub fn term_of(assign_seq: u64) -> u32 {
    u32::try_from(assign_seq >> TERM_BITS).unwrap_or(u32::MAX)
}

/// The first number of a term.
#[must_use]
pub fn first_seq(term: u32) -> u64 {
    u64::from(term) << TERM_BITS
}

/// How many of the witnesses are seen, and whether that is more than half.
fn majority(witnesses: &Witnesses, visible: &BTreeSet<Name>) -> (usize, bool) {
    let seen = witnesses.robots.iter().filter(|robot| visible.contains(*robot)).count();
    (seen, 2 * seen > witnesses.robots.len())
}
