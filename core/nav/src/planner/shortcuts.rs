//! Makes a path cheaper by cutting across it with Reeds–Shepp curves.

use super::analytic_expansion::AnalyticExpansion;
use super::costs::Costs;
use super::curve_heuristic::CurveHeuristic;
use super::space::Space;
use crate::MapPose;
use crate::geometry::{Path, Piece};

/// Distance between the poses that are joined, in m, at least; chosen for the time, not measured.
const SPACING_M: f64 = 0.4;
/// Poses that are joined at most: the pairs grow with the square. Chosen, not measured.
const MOST_KNOTS: usize = 30;
/// Curves tried in one round at most; chosen for the time, not measured.
const MOST_TRIES: usize = 120;
/// What a cut has to gain to be tried, in m; chosen, not measured.
const WORTH_M: f64 = 0.05;
/// Costs that are summed in another order differ by less, in m.
const ROUNDING_M: f64 = 1e-9;

/// Memory that is used again.
#[derive(Debug, Default)]
pub(super) struct Shortcuts {
    knots: Vec<Knot>,
}

/// A pose of the path with the arcs that lead there.
#[derive(Debug)]
struct Knot {
    pose: MapPose,
    /// From the knot before.
    pieces: Vec<Piece>,
    /// Of the path so far, along itself.
    along: f64,
    /// Of the cheapest way found.
    best: f64,
    /// From which knot, and by which arcs if not along the path.
    from: usize,
    cut: Option<Vec<Piece>>,
}

impl Shortcuts {
    /// A cheaper path; `None` = not found.
    pub(super) fn path(
        &mut self,
        space: &impl Space,
        costs: &Costs,
        analytic: &mut AnalyticExpansion,
        curves: &mut CurveHeuristic,
        path: &Path,
    ) -> Option<Path> {
        self.divide(space, costs, path);
        let mut left = MOST_TRIES;
        for to in 1..self.knots.len() {
            let before = &self.knots[to - 1];
            let (along, here) = (before.best + self.knots[to].along - before.along, self.knots[to].pose);
            (self.knots[to].best, self.knots[to].from) = (along, to - 1);
            for from in 0..to.saturating_sub(1) {
                let start = &self.knots[from];
                let (best, least) =
                    (self.knots[to].best, start.best + 0.97 * curves.cost(&start.pose, &here));
                if left == 0 || least + WORTH_M > best {
                    continue;
                }
                left -= 1;
                // What is near only adds to the cost of a curve.
                let below = best - start.best - WORTH_M + ROUNDING_M;
                let Some(way) = analytic.free(space, costs, (&start.pose, &here), below) else { continue };
                let (cost, _) = costs.pieces(space, &start.pose, way.pieces());
                if start.best + cost + WORTH_M < best {
                    let best = start.best + cost;
                    let knot = &mut self.knots[to];
                    (knot.best, knot.from, knot.cut) = (best, from, Some(way.pieces().to_vec()));
                }
            }
        }
        let shorter = self.joined(path.start);
        (costs.path(space, &shorter) < costs.path(space, path)).then_some(shorter)
    }

    /// Cuts the path into knots: at the ends of its arcs and in between.
    fn divide(&mut self, space: &impl Space, costs: &Costs, path: &Path) {
        self.knots.clear();
        let knot = |pose, pieces, along| Knot { pose, pieces, along, best: 0.0, from: 0, cut: None };
        self.knots.push(knot(path.start, Vec::new(), 0.0));
        let spacing_m = SPACING_M.max(path.length_m() / MOST_KNOTS as f64);
        let (mut pose, mut along, mut pending) = (path.start, 0.0, Vec::new());
        let mut pending_m = 0.0;
        for (number, piece) in path.pieces.iter().enumerate() {
            let parts = libm::ceil(piece.length_m.abs() / spacing_m).max(1.0);
            for part in 1..=parts as usize {
                let part_piece = Piece { length_m: piece.length_m / parts, ..*piece };
                let (cost, end) = costs.pieces(space, &pose, &[part_piece]);
                let change = match (part, number) {
                    (1, 1..) => costs.change(&path.pieces[number - 1], piece),
                    _ => 0.0,
                };
                (along, pose) = (along + cost + change, end);
                pending.push(part_piece);
                pending_m += part_piece.length_m.abs();
                let last = part == parts as usize && number + 1 == path.pieces.len();
                if last || pending_m >= 0.5 * spacing_m {
                    self.knots.push(knot(pose, std::mem::take(&mut pending), along));
                    pending_m = 0.0;
                }
            }
        }
    }

    fn joined(&self, start: MapPose) -> Path {
        let mut parts: Vec<&[Piece]> = Vec::new();
        let mut at = self.knots.len().saturating_sub(1);
        while at > 0 {
            let knot = &self.knots[at];
            parts.push(knot.cut.as_deref().unwrap_or(&knot.pieces));
            at = knot.from;
        }
        let mut path = Path::standing(start);
        parts.iter().rev().flat_map(|part| part.iter()).for_each(|piece| path.push(*piece));
        path
    }
}
