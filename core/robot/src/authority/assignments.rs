//! Which assignment of a dispatcher a robot goes by: lower is refused, equal acknowledged, higher replaces.
//!
//! The order is that of (`assign_seq`, leg) within one ledger. It outlives leases and other clients'
//! goals, not a restart of the robot: then the lease of the boot before fences what comes late.

use std::collections::VecDeque;
use xtb_protocol::messages::{Assignment, MAX_LEG, RejectCode};
use xtb_protocol::{Name, Uuid};

/// So many assignments that were withdrawn before they came are remembered. A dispatcher has one at a time on
/// a robot; chosen, not measured.
const MOST_AHEAD: usize = 64;

/// The newest assignment that was begun or withdrawn.
#[derive(Debug, Clone, Default)]
pub struct NewestAssignment {
    newest: Option<Newest>,
    /// Ledger and number of those that were withdrawn without the lease before they came, newest last.
    ahead: VecDeque<(u64, u64)>,
}

#[derive(Debug, Clone)]
struct Newest {
    client: Name,
    ledger: u64,
    /// Assignment and leg.
    order: (u64, u32),
}

/// What to do about a number that is used up.
pub(crate) const ASSIGN_AGAIN: &str = "assign it again, with a higher number";

/// What an assignment is to the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Known {
    /// Later than all before.
    New,
    /// The one that runs, or has ended and is still in the state: nothing is begun again.
    Already,
}

impl NewestAssignment {
    /// Whether this assignment may begin. `goals` are those that the state shows.
    ///
    /// # Errors
    /// [`RejectCode::UnknownGoal`] with words, for one that a later one or a withdrawal came before.
    pub fn check(
        &self,
        assignment: &Assignment,
        mut goals: impl Iterator<Item = Uuid>,
    ) -> Result<Known, (RejectCode, String, &'static str)> {
        if self.ahead.contains(&(assignment.ledger, assignment.assign_seq)) {
            let message = format!("assignment {} was withdrawn", assignment.assign_seq);
            return Err((RejectCode::UnknownGoal, message, ASSIGN_AGAIN));
        }
        let Some(newest) = self.newest.as_ref().filter(|newest| newest.ledger == assignment.ledger) else {
            return Ok(Known::New);
        };
        let order = (assignment.assign_seq, assignment.leg);
        if order > newest.order {
            return Ok(Known::New);
        }
        if order == newest.order && goals.any(|goal| goal == assignment.goal_id()) {
            return Ok(Known::Already);
        }
        let (seq, leg) = newest.order;
        let message = if leg > MAX_LEG {
            format!("assignment {} was withdrawn (with {seq})", assignment.assign_seq)
        } else {
            format!("assignment {} leg {} is older than {seq} leg {leg}", order.0, order.1)
        };
        Err((RejectCode::UnknownGoal, message, ASSIGN_AGAIN))
    }

    /// An assignment was begun.
    pub fn begun(&mut self, client: &Name, assignment: &Assignment) {
        let order = (assignment.assign_seq, assignment.leg);
        self.newest = Some(Newest { client: client.clone(), ledger: assignment.ledger, order });
        self.forget_past();
    }

    /// This assignment and those before it shall never begin, says who holds the lease. Another client's are
    /// left alone.
    pub fn withdraw(&mut self, client: &Name, ledger: u64, assign_seq: u64) {
        let order = (assign_seq, MAX_LEG + 1);
        let later = match &self.newest {
            None => true,
            Some(newest) if newest.client != *client => false,
            Some(newest) => newest.ledger != ledger || newest.order < order,
        };
        if later {
            self.newest = Some(Newest { client: client.clone(), ledger, order });
            self.forget_past();
        }
    }

    /// The same from somebody without the lease. That must not bar numbers that nobody has assigned yet: of
    /// those that have not come this one alone shall never begin, and of those that have, none up to this one.
    pub fn withdraw_without_lease(&mut self, client: &Name, ledger: u64, assign_seq: u64) {
        if self.newest.as_ref().is_some_and(|newest| newest.client != *client) {
            return;
        }
        let known = self.newest.as_mut().filter(|newest| newest.ledger == ledger);
        let newest_seq = known.as_ref().map(|newest| newest.order.0);
        if let Some(newest) = known.filter(|newest| newest.order.0 <= assign_seq) {
            newest.order.1 = MAX_LEG + 1;
        }
        let (one, came) = ((ledger, assign_seq), newest_seq.is_some_and(|seq| assign_seq <= seq));
        if came || self.ahead.contains(&one) {
            return;
        }
        if self.ahead.len() >= MOST_AHEAD {
            self.ahead.pop_front();
        }
        self.ahead.push_back(one);
    }

    /// What the order fences by itself needs no place.
    fn forget_past(&mut self) {
        let Self { newest: Some(newest), ahead } = self else { return };
        ahead.retain(|(ledger, seq)| *ledger != newest.ledger || *seq > newest.order.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::TaskId;

    fn assignment(assign_seq: u64, leg: u32) -> Assignment {
        Assignment { ledger: 7, task: TaskId::new(1), assign_seq, leg }
    }

    #[test]
    fn lower_is_refused_equal_acknowledged_higher_replaces() {
        let (mut assigned, me) = (NewestAssignment::default(), Name::new("dispatch").unwrap());
        let now = assignment(5, 1);
        assert_eq!(assigned.check(&now, std::iter::empty()), Ok(Known::New));
        assigned.begun(&me, &now);
        assert_eq!(assigned.check(&now, [now.goal_id()].into_iter()), Ok(Known::Already));
        assert!(assigned.check(&now, std::iter::empty()).is_err(), "its end is forgotten");
        for (seq, leg, may) in [(4, 9, false), (5, 0, false), (5, 2, true), (6, 0, true)] {
            let known = assigned.check(&assignment(seq, leg), [now.goal_id()].into_iter());
            assert_eq!(known.ok(), may.then_some(Known::New), "{seq} {leg}");
        }
    }

    #[test]
    fn what_is_withdrawn_never_begins_and_strangers_withdraw_nothing() {
        let (mut assigned, me) = (NewestAssignment::default(), Name::new("dispatch").unwrap());
        assigned.begun(&me, &assignment(5, 1));
        assigned.withdraw(&Name::new("cli-7").unwrap(), 7, 99);
        assert_eq!(assigned.check(&assignment(5, 2), std::iter::empty()), Ok(Known::New));
        assigned.withdraw(&me, 7, 6);
        for seq in [5, 6] {
            assert!(assigned.check(&assignment(seq, MAX_LEG), std::iter::empty()).is_err(), "{seq}");
        }
        assigned.withdraw(&me, 7, 3);
        assert!(assigned.check(&assignment(6, 0), std::iter::empty()).is_err(), "a late one undoes nothing");
        assert_eq!(assigned.check(&assignment(7, 0), std::iter::empty()), Ok(Known::New));
        let other = Assignment { ledger: 8, ..assignment(0, 0) };
        assert_eq!(assigned.check(&other, std::iter::empty()), Ok(Known::New), "another ledger");
    }

    #[test]
    fn without_the_lease_nothing_is_barred_that_was_never_assigned() {
        let (mut assigned, me) = (NewestAssignment::default(), Name::new("dispatch").unwrap());
        let may = |assigned: &NewestAssignment, seq, leg| {
            assigned.check(&assignment(seq, leg), std::iter::empty()) == Ok(Known::New)
        };
        assigned.withdraw_without_lease(&me, 7, 1 << 39);
        assert!(may(&assigned, 5, 0), "nothing was begun yet");
        assigned.begun(&me, &assignment(5, 1));
        assigned.withdraw_without_lease(&me, 7, 1 << 39);
        assert!(!may(&assigned, 5, 2), "what had come is over");
        assert!(may(&assigned, 6, 0) && !may(&assigned, 1 << 39, 0));
        assigned.withdraw_without_lease(&me, 8, 0);
        assert!(!may(&assigned, 5, 2), "another ledger's undoes nothing");
    }

    #[test]
    fn what_is_withdrawn_before_it_comes_never_begins() {
        let (mut assigned, me) = (NewestAssignment::default(), Name::new("dispatch").unwrap());
        assigned.withdraw_without_lease(&me, 7, 9);
        assert!(assigned.check(&assignment(9, 0), std::iter::empty()).is_err());
        assigned.begun(&me, &assignment(8, 0));
        assert!(assigned.check(&assignment(9, 0), std::iter::empty()).is_err());
        assert_eq!(assigned.check(&assignment(10, 0), std::iter::empty()), Ok(Known::New));
        assigned.begun(&me, &assignment(10, 0));
        assert!(assigned.check(&assignment(9, 0), std::iter::empty()).is_err());
        assert!(assigned.ahead.is_empty(), "the order fences it");
    }

    #[test]
    fn withdrawals_without_the_lease_fill_no_memory() {
        let (mut assigned, me) = (NewestAssignment::default(), Name::new("dispatch").unwrap());
        (0..1000).for_each(|seq| assigned.withdraw_without_lease(&me, 7, seq));
        assert_eq!(assigned.ahead.len(), MOST_AHEAD);
    }
}
