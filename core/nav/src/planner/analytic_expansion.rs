//! Reeds–Shepp curves straight from one pose to another, if nothing is in the way.

use super::costs::Costs;
use super::curve_heuristic::MOST_DETOUR;
use super::space::Space;
use crate::MapPose;
use crate::geometry::reeds_shepp;
use crate::geometry::reeds_shepp::Curve;

/// Words that are tried, the cheapest first; chosen, not measured.
const MOST_WORDS: usize = 8;

/// Memory for the words.
#[derive(Debug, Default)]
pub(super) struct AnalyticExpansion {
    curves: Vec<Curve>,
    order: Vec<(f64, usize)>,
}

impl AnalyticExpansion {
    /// The cheapest free one that costs, but for what is near, less than `below`.
    pub(super) fn free(
        &mut self,
        space: &impl Space,
        costs: &Costs,
        (from, to): (&MapPose, &MapPose),
        below: f64,
    ) -> Option<Curve> {
        reeds_shepp::curves(from, to, space.car().radius_m, MOST_DETOUR, &mut self.curves);
        self.order.clear();
        self.order.extend(self.curves.iter().enumerate().map(|(index, curve)| (costs.curve(curve), index)));
        self.order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let tried = self.order.iter().take(MOST_WORDS).take_while(|(cost, _)| *cost < below);
        let mut tried = tried.map(|&(_, index)| &self.curves[index]);
        let free = |curve: &Curve| {
            space.may_drive_all(from, curve.pieces()) && space.drives_all(from, curve.pieces())
        };
        tried.find(|curve| free(curve)).copied()
    }
}
