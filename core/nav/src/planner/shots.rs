//! Reeds–Shepp curves straight from one pose to another, if nothing is in the way.

use super::costs::Costs;
use crate::reeds_shepp::{self, Way};
use crate::space::Space;
use crate::{MapPose, Piece};

/// Longer words than this many times the shortest are not tried.
const MOST_DETOUR: f64 = 1.5;
/// Words that are tried.
const MOST_WORDS: usize = 8;

/// Memory for the words.
#[derive(Debug, Default)]
pub(super) struct Shots {
    ways: Vec<Way>,
    order: Vec<(f64, usize)>,
}

impl Shots {
    /// The cheapest free one, with its cost but for what is near.
    pub(super) fn free(
        &mut self,
        space: &impl Space,
        costs: &Costs,
        from: &MapPose,
        to: &MapPose,
    ) -> Option<Way> {
        reeds_shepp::ways(from, to, space.car().radius_m, MOST_DETOUR, &mut self.ways);
        self.order.clear();
        self.order.extend(self.ways.iter().enumerate().map(|(index, way)| (costs.way(way), index)));
        self.order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let tried = self.order.iter().take(MOST_WORDS).map(|&(_, index)| &self.ways[index]);
        tried.into_iter().find(|way| drives(space, from, way.pieces())).copied()
    }
}

/// Whether all arcs can be driven, one after the other.
pub(super) fn drives(space: &impl Space, from: &MapPose, pieces: &[Piece]) -> bool {
    let mut pose = *from;
    pieces.iter().all(|piece| {
        let free = space.drives(&pose, piece);
        pose = piece.end(&pose);
        free
    })
}
