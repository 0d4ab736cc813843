//! Reeds–Shepp curves straight from one pose to another, if nothing is in the way.

use super::costs::Costs;
use super::curve_heuristic::MOST_DETOUR;
use super::space::Space;
use crate::MapPose;
use crate::geometry::Car;
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
        let Car { radius_m, gears, .. } = *space.car();
        // In one gear the way there may be much longer than the shortest.
        let most_detour = if gears.are_both() { MOST_DETOUR } else { f64::INFINITY };
        reeds_shepp::curves(from, to, radius_m, most_detour, &mut self.curves);
        let drives = |curve: &Curve| curve.pieces().iter().all(|piece| gears.allow(piece.length_m));
        self.order.clear();
        let all = self.curves.iter().enumerate().filter(|(_, curve)| drives(curve));
        self.order.extend(all.map(|(index, curve)| (costs.curve(curve), index)));
        self.order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let tried = self.order.iter().take(MOST_WORDS).take_while(|(cost, _)| *cost < below);
        let mut tried = tried.map(|&(_, index)| &self.curves[index]);
        let free = |curve: &Curve| {
            space.may_drive_all(from, curve.pieces()) && space.drives_all(from, curve.pieces())
        };
        tried.find(|curve| free(curve)).copied()
    }
}
