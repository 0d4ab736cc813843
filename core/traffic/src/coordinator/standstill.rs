//! Nobody waits without limit: who has to give its goal up, because plans do not lead anybody on.

use super::Coordinator;
use super::joint::PATIENCE_MS;
use super::outstanding::Outstanding;
use super::plans::is_looked_for_further;
use super::truck::{Truck, place_of};
use std::collections::BTreeSet;
use xtb_control::Stamp;

/// Nobody moved for so long though someone should, and no joint plan is being made: one of them gives its
/// goal up, in ms; chosen, not measured.
pub(super) const STANDSTILL_MS: u64 = 5000;
/// Some that wait for each other have stood for so long, while others move, without the time for which a joint plan
/// that looks for their ways was being made: one of them gives its goal up, in ms. Twice the time after which it is served first: its turn has come and was in vain.
const STUCK_MS: u64 = 2 * PATIENCE_MS;
/// Turns of [`Coordinator::tick`] farther apart than this count as so long, in ms: five of those that should
/// have come.
const LONGEST_TURN_MS: u64 = 500;

/// For how long the whole fleet has stood.
#[derive(Debug, Default)]
pub(super) struct Standstill {
    /// Without the time for which a joint plan was being made, in ms.
    stood_ms: u64,
    looked: Option<Stamp>,
    /// Who gives its goal up for that, and which: boot and id.
    pub(super) gives_up: Option<(u32, (u64, u128))>,
}

impl Coordinator {
    /// The last net: if nobody has moved for long, whatever the plans say, then of those that have no way or
    /// wait for another one whoever has waited longest is told that there is none; while others move, of those
    /// that are stuck. The time for which a joint plan is being made for them does not count: on a slow machine it
    /// takes longer.
    pub(super) fn end_standstill(&mut self, now: Stamp) {
        let Standstill { mut stood_ms, looked, mut gives_up } = std::mem::take(&mut self.standstill);
        let turn_ms = looked.map_or(0, |at| now.since_ms(at)).min(LONGEST_TURN_MS);
        let planned: BTreeSet<u32> = self.out.iter().flat_map(Outstanding::frozen).collect();
        for truck in &mut self.trucks {
            truck.count_standing(now, if planned.contains(&truck.id) { 0 } else { turn_ms });
        }
        let goal =
            |truck: &Truck| truck.goal().filter(|_| truck.can_be_led(now)).map(|(key, _)| (truck.id, key));
        let moves = self.trucks.iter().any(|truck| truck.is_fresh(now) && !truck.stands());
        let given_up = gives_up.and_then(|given| self.trucks.iter().find(|truck| goal(truck) == Some(given)));
        if moves || (gives_up.is_some() && given_up.is_none()) {
            stood_ms = 0;
            gives_up = gives_up.filter(|_| given_up.is_some_and(|truck| self.is_stuck(truck)));
        } else if self.out.is_empty() {
            stood_ms += turn_ms;
        }
        if gives_up.is_none() {
            let all = stood_ms > STANDSTILL_MS;
            let waits = |truck: &&Truck| match truck.waits_for {
                Some((_, is_led)) if truck.is_live() => is_led,
                _ => truck.none.is_some(),
            };
            let longest = self.trucks.iter().filter(waits).filter(|truck| goal(truck).is_some());
            let longest = longest.filter(|truck| all || self.is_stuck(truck));
            gives_up = longest.max_by_key(|truck| truck.waited_ms(now)).and_then(goal);
            self.counters.given_up += u64::from(gives_up.is_some());
        }
        self.standstill = Standstill { stood_ms, looked: Some(now), gives_up };
    }

    /// Whether it has stood for long behind one that has stood as long, and so on: around in a ring, or up to one
    /// that has no way for another reason. One that waits for somebody who moves, or whom nobody leads, is not, nor is
    /// one among many for which more can still be tried.
    fn is_stuck(&self, truck: &Truck) -> bool {
        let mut last = truck;
        // As many as there are: then one of them has come twice.
        for _ in &self.trucks {
            let waits_for = last.waits_for.filter(|_| last.is_live());
            let behind = match (waits_for, &last.none) {
                _ if last.stood_ms <= STUCK_MS || is_looked_for_further(last) => return false,
                (Some((id, _)), _) => place_of(&self.trucks, id).map(|index| &self.trucks[index]),
                (None, Some(none)) if !last.is_live() => none.by.as_deref().and_then(|name| self.named(name)),
                (None, _) => return false,
            };
            match behind {
                Some(next) => last = next,
                None => return true,
            }
        }
        true
    }
}
