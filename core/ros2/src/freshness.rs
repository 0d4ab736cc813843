//! Which velocity commands of a ROS publisher are fresh, without clocks that agree.
//!
//! Each sample says when it was made, by its own clock; what is known here is when it came. The smallest difference
//! of the last minute is the publisher's *offset*: clocks and the shortest way. A sample's *lateness* is how much more
//! its own difference is.
//!
//! ```text
//!            made before the last one ───────────────────────────► Old       ┐
//! sample ─►  more than 300 ms late ──────────────────────────────► Late      ├ dropped, and the publisher
//!            > 150 ms from its distance at the source ───────────► Uneven    ┘ is on trial again
//!            on trial: not yet on time for 200 ms ───────────────► OnTrial   ─ dropped
//!            else ───────────────────────────────────────────────► Fresh
//! ```
//! The trial is what makes a burst harmless that was held up: its last samples are young again, but they all come at
//! once. A publisher that is new is on trial too, as its first offset may be that of a sample that was held up; so is
//! one whose offset falls by more than 150 ms, which shows that all before it were late. If a publisher's clock is set
//! back, its samples are late until the old offset is a minute old.

use crate::gid::Gid;
use std::collections::BTreeMap;

/// Samples that are later than this do not count.
pub const LATE_MS: i64 = 300;
/// Nor do those that come at another distance than they were made, by more than this.
pub const UNEVEN_MS: i64 = 150;
/// For so long a publisher has to be on time before it counts; chosen, not measured: a setpoint's life.
pub const TRIAL_MS: i64 = 200;
/// Most publishers that are remembered. A new one takes the place of the one that has been silent longest, which is
/// then new itself.
pub const MOST: usize = 64;
/// How far back the offset reaches, in seconds.
const SECONDS: usize = 60;

const NS_PER_MS: i64 = 1_000_000;
const NS_PER_S: i64 = 1_000_000_000;

/// What a sample is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Freshness {
    /// It counts.
    Fresh,
    /// Its publisher has not been on time for long enough.
    OnTrial,
    /// It was held up by this.
    Late {
        /// Above the smallest, in ms.
        ms: i64,
    },
    /// It came at another distance from the sample before it than it was made.
    Uneven {
        /// The difference, in ms; negative = it came too soon after that.
        ms: i64,
    },
    /// It was made before a sample that has come already, or at the same time.
    Old,
}

/// How many samples were which.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// See [`Freshness`].
    pub fresh: u64,
    /// See [`Freshness`].
    pub on_trial: u64,
    /// See [`Freshness`].
    pub late: u64,
    /// See [`Freshness`].
    pub uneven: u64,
    /// See [`Freshness`].
    pub old: u64,
    /// Publishers that were forgotten for others.
    pub forgotten: u64,
}

/// The publishers of velocity commands of one robot.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    sources: BTreeMap<Gid, Source>,
    counts: Counts,
}

impl Sources {
    /// A sample of this publisher that came at `arrival_ns` (of a monotonic clock here) and was made at `source_ns`
    /// (of its own clock).
    pub fn judge(&mut self, gid: Gid, arrival_ns: i64, source_ns: i64) -> Freshness {
        if !self.sources.contains_key(&gid) && self.sources.len() >= MOST {
            let silent = self.sources.iter().min_by_key(|(_, source)| source.last.0).map(|(gid, _)| *gid);
            silent.map(|gid| self.sources.remove(&gid));
            self.counts.forgotten += 1;
        }
        let source = self.sources.entry(gid).or_insert_with(|| Source::new(arrival_ns, source_ns));
        let freshness = source.judge(arrival_ns, source_ns);
        *match freshness {
            Freshness::Fresh => &mut self.counts.fresh,
            Freshness::OnTrial => &mut self.counts.on_trial,
            Freshness::Late { .. } => &mut self.counts.late,
            Freshness::Uneven { .. } => &mut self.counts.uneven,
            Freshness::Old => &mut self.counts.old,
        } += 1;
        freshness
    }

    /// This publisher is gone.
    pub fn forget(&mut self, gid: &Gid) {
        self.sources.remove(gid);
    }

    /// What was counted.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }
}

#[derive(Debug, Clone)]
struct Source {
    /// When the last sample came and was made; `None` for the latter before the first.
    last: (i64, Option<i64>),
    /// Since when it has been on time.
    on_time_since_ns: i64,
    /// The offset that it has been on time with.
    trusted_ns: i64,
    /// The smallest difference of each of the last 60 s, and which second that was.
    offsets: [Option<(i64, i64)>; SECONDS],
}

impl Source {
    fn new(arrival_ns: i64, source_ns: i64) -> Self {
        Self {
            last: (arrival_ns, None),
            on_time_since_ns: arrival_ns,
            trusted_ns: arrival_ns.saturating_sub(source_ns),
            offsets: [None; SECONDS],
        }
    }

    fn judge(&mut self, arrival_ns: i64, source_ns: i64) -> Freshness {
        let difference_ns = arrival_ns.saturating_sub(source_ns);
        let offset_ns = self.offset(arrival_ns.div_euclid(NS_PER_S), difference_ns);
        let (last_arrival_ns, last_source_ns) =
            std::mem::replace(&mut self.last, (arrival_ns, Some(source_ns)));
        let late_ms = difference_ns.saturating_sub(offset_ns) / NS_PER_MS;
        let uneven_ms = last_source_ns.map_or(0, |last_ns| {
            let here_ns = arrival_ns.saturating_sub(last_arrival_ns);
            here_ns.saturating_sub(source_ns.saturating_sub(last_ns)) / NS_PER_MS
        });
        let dropped = if last_source_ns.is_some_and(|last_ns| source_ns <= last_ns) {
            Freshness::Old
        } else if late_ms > LATE_MS {
            Freshness::Late { ms: late_ms }
        } else if uneven_ms.saturating_abs() > UNEVEN_MS {
            Freshness::Uneven { ms: uneven_ms }
        } else if self.trusted_ns.saturating_sub(offset_ns) / NS_PER_MS > UNEVEN_MS {
            Freshness::OnTrial
        } else {
            // An offset that rises, as an old one is forgotten, is no reason to doubt.
            self.trusted_ns = self.trusted_ns.max(offset_ns);
            let on_time_ms = arrival_ns.saturating_sub(self.on_time_since_ns) / NS_PER_MS;
            return if on_time_ms < TRIAL_MS { Freshness::OnTrial } else { Freshness::Fresh };
        };
        (self.on_time_since_ns, self.trusted_ns) = (arrival_ns, offset_ns);
        dropped
    }

    /// The smallest difference of the last minute, this one included.
    fn offset(&mut self, second: i64, difference_ns: i64) -> i64 {
        if let Some(slot) = self.offsets.get_mut(second.rem_euclid(SECONDS as i64) as usize) {
            let same = slot.filter(|(of, _)| *of == second);
            *slot = Some((second, same.map_or(difference_ns, |(_, smallest)| smallest.min(difference_ns))));
        }
        let recent = self.offsets.iter().flatten();
        let recent = recent.filter(|(of, _)| second.saturating_sub(*of) < SECONDS as i64);
        recent.map(|(_, smallest)| *smallest).min().unwrap_or(difference_ns)
    }
}

#[cfg(test)]
mod tests;
