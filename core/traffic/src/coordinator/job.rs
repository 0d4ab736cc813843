//! What a joint plan is asked, and what it answers.

use super::discretized_path::DiscretizedPath;
use super::occupancy::Occupancy;
use super::order::Order;
use super::room::RoomGeometry;
use super::task::Target;
use std::cmp::Reverse;
use std::sync::Arc;
use xtb_nav::Car;
use xtb_nav::geometry::rect::{Rect, Stand};

/// A truck with a goal.
#[derive(Debug, Clone)]
pub(super) struct Member {
    pub(super) id: u32,
    pub(super) name: String,
    /// Changes when the truck's situation does.
    pub(super) revision: u64,
    pub(super) car: Car,
    /// Its way so far; only the released part counts if it wants another one.
    pub(super) way: Arc<DiscretizedPath>,
    pub(super) done_m: f64,
    /// Place up to which its way is released.
    pub(super) held: usize,
    /// Whether it needs a way.
    pub(super) wanting: bool,
    /// It keeps its way, and goes on along it while the plan is made.
    pub(super) fixed: bool,
    /// It has stood on its way for long: it gets another one, or other times on that, if that leads it to its goal clearly
    /// sooner.
    pub(super) slow: bool,
    /// For so long it has had a goal and has not been led to it, in ms.
    pub(super) waited_ms: u64,
    /// For so long it has been delayed, in ms; the time in which it drove does not count.
    pub(super) delayed_ms: u64,
    /// So often in a row no way was found among many.
    pub(super) misses: u32,
    pub(super) target: Target,
}

impl Member {
    pub(super) fn held_stands(&self) -> &[Stand] {
        let at = self.way.place(self.done_m).min(self.held);
        &self.way.stands[at..=self.held]
    }

    /// Where it is, tick by tick, on a way on which it has these positions.
    pub(super) fn driving(&self, way: &DiscretizedPath, at_m: &[f64]) -> Occupancy {
        Occupancy::driving(way, &self.car, at_m, self.held)
    }
}

/// Something that is driven around, by name.
#[derive(Debug, Clone)]
pub(super) struct Block {
    /// The truck that it is; it does not block itself.
    pub(super) id: u32,
    /// The only truck that drives around it; `None` = all do.
    pub(super) only: Option<u32>,
    pub(super) name: String,
    pub(super) stands: Vec<Stand>,
}

impl Block {
    /// Whether this truck drives around it.
    pub(super) fn concerns(&self, truck: u32) -> bool {
        self.id != truck && self.only.is_none_or(|only| only == truck)
    }
}

/// The goal of one among many that has waited for long: nobody that has waited less is led through it any more.
#[derive(Debug, Clone)]
pub(super) struct Reserved {
    pub(super) id: u32,
    /// As in [`Member`].
    pub(super) delayed_ms: u64,
    pub(super) stand: Stand,
}

/// Work for another thread: everything that a joint plan needs.
#[derive(Debug, Clone)]
pub struct JointJob {
    pub(super) id: u64,
    pub(super) room: Arc<dyn RoomGeometry>,
    pub(super) members: Vec<Member>,
    pub(super) blocks: Vec<Block>,
    pub(super) reserved: Vec<Reserved>,
    pub(super) order: Order,
    pub(super) seed: u64,
    /// Nodes that may be expanded for orders of priorities.
    pub(super) budget: u32,
    /// The same for groups, when no order works; 0 = no groups.
    pub(super) group_budget: u32,
    /// The same for serving one after the other, when that does not work either; 0 = not at all.
    pub(super) turn_budget: u32,
    /// Each of those without a way looks for one around all others as they are: who finds none stays.
    pub(super) each_for_itself: bool,
}

impl JointJob {
    /// What is driven around by this one.
    pub(super) fn others<'a>(&'a self, member: &'a Member) -> impl Iterator<Item = &'a Block> {
        self.blocks.iter().filter(|block| block.concerns(member.id))
    }

    /// Bodies of all that is driven around by this one.
    pub(super) fn bodies_around<'a>(&'a self, member: &'a Member) -> impl Iterator<Item = Rect> {
        self.others(member).flat_map(|block| block.stands.iter().map(|stand| stand.body))
    }

    /// Places in [`Self::reserved`] of the goals that this one has to leave free: not its own, nor those of others that
    /// have waited less, nor one on which it stands.
    pub(super) fn reserved_for<'a>(&'a self, member: &'a Member) -> impl Iterator<Item = usize> {
        let is_before = |reserved: &Reserved| {
            (Reverse(reserved.delayed_ms), reserved.id) < (Reverse(member.delayed_ms), member.id)
        };
        let stands_there =
            |reserved: &Reserved| member.held_stands().iter().any(|held| held.touches(&reserved.stand, 0.0));
        let reserved = self.reserved.iter().enumerate();
        reserved.filter(move |(_, one)| is_before(one) && !stands_there(one)).map(|(place, _)| place)
    }

    pub(super) fn indices(&self, which: impl Fn(&Member) -> bool) -> impl Iterator<Item = usize> {
        self.members.iter().enumerate().filter(move |(_, member)| which(member)).map(|(index, _)| index)
    }
}

/// A way for one truck.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) id: u32,
    pub(super) revision: u64,
    pub(super) way: Arc<DiscretizedPath>,
    /// It ends out of the others' way, not at the goal.
    pub(super) evades: bool,
}

/// Why one truck has none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NoWay {
    pub(super) id: u32,
    pub(super) revision: u64,
    /// Who is in the way.
    pub(super) by: Option<String>,
    pub(super) reason: String,
    /// The map leaves none: it will be the same later.
    pub(super) for_good: bool,
}

/// What came out.
#[derive(Debug, Clone)]
pub struct JointResult {
    pub(super) id: u64,
    pub(super) plans: Vec<Plan>,
    pub(super) order: Order,
    pub(super) none: Vec<NoWay>,
    /// Nodes that were expanded.
    pub expansions: u32,
    /// Orders that were tried.
    pub tries: u32,
    /// Choices of conflict-based search that were looked at.
    pub choices: u32,
    /// No order worked, but these choices did.
    pub grouped: bool,
    /// Neither did, but one can be served while the others make room.
    pub in_turn: bool,
}

impl JointResult {
    /// How many trucks got a way, and how many did not.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        (self.plans.len(), self.none.len())
    }
}

impl NoWay {
    /// None was found among many; the next try is a thorough one.
    pub(super) fn yet(member: &Member) -> Self {
        let reason = "no path found in time".to_owned();
        Self { id: member.id, revision: member.revision, by: None, reason, for_good: false }
    }

    /// Somebody else is served before.
    pub(super) fn behind(member: &Member, name: &str) -> Self {
        let (by, reason) = (Some(name.to_owned()), format!("blocked by {name}"));
        Self { id: member.id, revision: member.revision, by, reason, for_good: false }
    }
}
