//! All others, as a search in space and time asks for them.

use super::nearby::Nearby;
use super::occupancy::NEVER;
use super::task::Other;
use xtb_nav::geometry::rect::Stand;

/// So many others are asked one by one; more are found through a grid.
const FEW: usize = 16;

/// The others of one search.
pub(super) struct Crowd<'a> {
    others: &'a [Other<'a>],
    /// If there are more than [`FEW`].
    nearby: Option<Nearby>,
    /// Nobody moves any more from this tick on.
    pub(super) still: u32,
}

impl<'a> Crowd<'a> {
    /// For a truck whose look-out reaches so far from its middle, in m.
    pub(super) fn new(others: &'a [Other<'a>], reach_m: f64) -> Self {
        let still = others.iter().map(|other| other.line.end()).max().unwrap_or(0);
        let nearby = (others.len() > FEW).then(|| Nearby::new(others, reach_m));
        Self { others, nearby, still }
    }

    /// Whether nobody is in the way of the whole sweep. Who is at one departure is mostly there at the next one as
    /// well: the step at which it was met, from 0, is looked at first.
    pub(super) fn is_clear(&self, sweep: &[Stand], depart: u32, met: &mut usize) -> bool {
        if sweep.get(*met).is_some_and(|stand| self.is_hit(stand, depart + 1 + *met as u32)) {
            return false;
        }
        let hit = |(step, stand): (usize, &Stand)| self.is_hit(stand, depart + 1 + step as u32);
        match sweep.iter().enumerate().position(hit) {
            Some(step) => *met = step,
            None => return true,
        }
        false
    }

    fn is_hit(&self, stand: &Stand, tick: u32) -> bool {
        let hits = |other: &Other<'_>| other.line.hits(stand, tick, other.separation_m);
        match &self.nearby {
            Some(nearby) => nearby.any_at(stand, tick, |line| hits(&self.others[line])),
            None => self.others.iter().any(hits),
        }
    }

    /// The last tick up to which nobody comes to one that stands there from `tick` on.
    pub(super) fn safe_until(&self, stand: &Stand, tick: u32) -> u32 {
        let next_of = |other: &Other<'_>| other.line.next_hit(stand, tick, other.separation_m);
        let next = match &self.nearby {
            Some(nearby) => nearby.next_hit(self.others, stand, tick),
            None => self.others.iter().map(next_of).min().unwrap_or(NEVER),
        };
        if next == NEVER { NEVER } else { next - 1 }
    }

    /// From which tick on nobody comes there any more, where there are many; 0 where there are few.
    pub(super) fn free_from(&self, stand: &Stand) -> u32 {
        let last = |other: &Other<'_>| other.line.last_hit(stand, other.separation_m);
        let many = self.others.iter().filter(|_| self.nearby.is_some());
        many.map(last).filter(|tick| *tick != NEVER).max().map_or(0, |tick| tick + 1)
    }

    /// Whether nobody will ever stay there.
    pub(super) fn leaves_free(&self, stand: &Stand) -> bool {
        !self.others.iter().any(|other| other.line.hits(stand, NEVER - 1, other.separation_m))
    }
}
