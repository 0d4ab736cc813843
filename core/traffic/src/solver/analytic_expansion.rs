//! The last stretch: Reeds–Shepp words to the goal, cut into steps.

use super::driver::Driver;
use super::motion::Spot;
use xtb_nav::geometry::reeds_shepp;
use xtb_nav::{Path, Piece};

/// Words that are looked at, those with the fewest steps first; chosen, not measured.
const WORDS: usize = 4;
/// Pieces shorter than this part of a step are rounding: far more than f64's.
const NOTHING: f64 = 1e-6;

/// The ways to the goal with at most `most` steps that keep off obstacles' rough reach; fewest first.
pub(crate) fn words(driver: &Driver, from: &Spot, step: f64, most: usize) -> Vec<Path> {
    let mut paths = reeds_shepp::all(&from.pose(), &driver.goal, driver.radius);
    let drives = |path: &Path| path.pieces.iter().all(|piece| driver.gears.allow(piece.length_m));
    paths.retain(|path| steps(path, step) <= most && drives(path));
    paths.sort_by_key(|path| steps(path, step));
    paths.truncate(WORDS);
    paths
}

/// Steps that a path takes when each piece is cut evenly.
pub(crate) fn steps(path: &Path, step: f64) -> usize {
    path.pieces.iter().map(|piece| parts(piece, step)).sum()
}

fn parts(piece: &Piece, step: f64) -> usize {
    let steps = piece.length_m.abs() / step;
    if steps < NOTHING { 0 } else { libm::ceil(steps - NOTHING) as usize }
}

/// One piece for each step.
pub(crate) fn cut(path: &Path, step: f64) -> Vec<Piece> {
    let mut pieces = Vec::with_capacity(steps(path, step));
    for piece in &path.pieces {
        let count = parts(piece, step);
        let part = Piece { length_m: piece.length_m / count.max(1) as f64, ..*piece };
        pieces.extend(std::iter::repeat_n(part, count));
    }
    pieces
}
