//! What a search of one car is asked.

use super::motion::Spot;
use xtb_nav::Piece;

/// What another car is to the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rank {
    /// Not there.
    Ignored,
    /// Each step of contact costs something.
    Soft,
    /// A wall.
    Hard,
}

/// A move of another car that must not be met, whatever that car's rank.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constraint {
    pub(crate) car: usize,
    pub(crate) step: usize,
    pub(crate) spot: Spot,
    pub(crate) piece: Piece,
    /// It stands there for good.
    pub(crate) stays: bool,
}

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Query<'q> {
    pub(crate) me: usize,
    /// Of each car.
    pub(crate) ranks: &'q [Rank],
    pub(crate) constraints: &'q [Constraint],
    pub(crate) manner: Manner,
}

/// No limit on how long a way takes.
pub(crate) const ANY: u32 = u32::MAX;

/// How a car is to be planned.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Manner {
    /// Steps that it would rather lose than be in the way of a soft car for one.
    pub(crate) clash_steps: u32,
    /// How much the heuristic is trusted, in percent; 100 finds the shortest way, unless others hold it up.
    pub(crate) heuristic_weight: u32,
    /// Nodes after which it gives up.
    pub(crate) most_nodes: u32,
    /// Ways that take longer, by the heuristic, are not looked at; in steps.
    pub(crate) most_steps: u32,
}
