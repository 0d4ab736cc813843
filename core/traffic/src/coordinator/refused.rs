//! Robots that are one too many: nobody leads them or drives around them, and they are told so.

use super::truck::STALE_MS;
use super::{Coordinator, Guide, MOST_TRUCKS, ReportedRobot};
use std::collections::BTreeMap;
use xtb_control::Stamp;
use xtb_nav::settings::CRUISE_MPS;

/// So many are told; chosen, not measured.
const MOST_REFUSED: usize = 512;

/// By name: when each was true what it said last, and for which goal it would be led.
#[derive(Debug, Default)]
pub(super) struct Refused {
    robots: BTreeMap<String, (Stamp, Option<(u64, u128)>)>,
}

impl Refused {
    pub(super) fn add(&mut self, seen: Stamp, view: &ReportedRobot) {
        if self.robots.len() < MOST_REFUSED || self.robots.contains_key(&view.name) {
            let goal = view.goal.map(|goal| (view.epoch, goal.id));
            self.robots.insert(view.name.clone(), (seen, goal));
        }
    }

    pub(super) fn remove(&mut self, name: &str) {
        self.robots.remove(name);
    }

    /// Who was not heard of lately is told nothing.
    pub(super) fn fade(&mut self, now: Stamp) {
        self.robots.retain(|_, (seen, _)| now.since_ms(*seen) < STALE_MS);
    }
}

impl Coordinator {
    /// What each robot is told that is not looked at, because there are [`MOST_TRUCKS`] already: that there is no
    /// path for it. At most 512 of them.
    #[must_use]
    pub fn refused(&self) -> BTreeMap<String, Guide> {
        let guide = |goal: Option<(u64, u128)>| Guide {
            goal,
            plan: 0,
            path: None,
            release_m: 0.0,
            cruise_mps: CRUISE_MPS,
            waits_for: None,
            reason: goal
                .map(|_| format!("traffic control already has {MOST_TRUCKS} robots, the most it takes")),
        };
        self.refused.robots.iter().map(|(name, (_, goal))| (name.clone(), guide(*goal))).collect()
    }
}
