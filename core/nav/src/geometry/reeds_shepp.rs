//! Reeds–Shepp curves: the shortest ways of a car that goes ahead and astern, where nothing is in the way.
//!
//! J. A. Reeds and L. A. Shepp, *Optimal paths for a car that goes both forwards and backwards*,
//! Pacific J. Math. 145 (1990): nine formulas (8.1 … 8.11) for words that begin with a left turn
//! ahead; all others are these mirrored (left ↔ right), flipped in time (ahead ↔ astern) or driven
//! from the other end. Here the radius is 1 and the start is the origin; lengths are angles.

use super::path::{Path, Piece, wrap_rad};
use crate::{Gears, MapPose};
use std::f64::consts::{FRAC_PI_2, PI};

/// Rounding that still counts as zero, in radii and rad: a few thousand times f64's.
const ZERO: f64 = 1e-12;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turn {
    Left,
    Straight,
    Right,
}

use Turn::{Left as L, Right as R, Straight as S};

/// A word: up to five turns with signed lengths.
#[derive(Debug, Clone, Copy)]
struct Word {
    turns: [Turn; 5],
    lengths: [f64; 5],
    count: usize,
}

/// Target with radius 1, seen from the start.
#[derive(Debug, Clone, Copy)]
struct Target {
    x: f64,
    y: f64,
    yaw: f64,
}

/// The shortest way from `from` to `to` without obstacles on circles of `radius_m`.
///
/// Between poses that differ by less than about 1e-6 rounding decides which word is found.
#[must_use]
pub fn shortest(from: &MapPose, to: &MapPose, radius_m: f64) -> Path {
    let mut best: Option<(f64, Word)> = None;
    each(target(from, to, radius_m), |length, word| {
        if best.is_none_or(|(shortest, _)| length < shortest) {
            best = Some((length, *word));
        }
    });
    best.map_or_else(|| Path::standing(*from), |(_, word)| word.path(from, radius_m))
}

/// Its length alone, in m.
#[must_use]
pub fn distance_m(from: &MapPose, to: &MapPose, radius_m: f64) -> f64 {
    let mut best = f64::INFINITY;
    each(target(from, to, radius_m), |length, _| best = best.min(length));
    best * radius_m
}

/// Every word that leads there, shortest first: what a planner tries when things are in the way.
#[must_use]
pub fn all(from: &MapPose, to: &MapPose, radius_m: f64) -> Vec<Path> {
    let mut found: Vec<(f64, Word)> = Vec::new();
    each(target(from, to, radius_m), |length, word| found.push((length, *word)));
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, word)| word.path(from, radius_m)).collect()
}

/// The shortest way in these gears, if there is a word of them; with both, [`shortest`].
#[must_use]
pub fn shortest_in(gears: Gears, from: &MapPose, to: &MapPose, radius_m: f64) -> Option<Path> {
    if gears.are_both() {
        return Some(shortest(from, to, radius_m));
    }
    let drives = |path: &Path| path.pieces.iter().all(|piece| gears.allow(piece.length_m));
    all(from, to, radius_m).into_iter().find(drives)
}

/// A curve: a word in m, without a start; it needs no memory of its own.
#[derive(Debug, Clone, Copy)]
pub struct Curve {
    length_m: f64,
    pieces: [Piece; 5],
    count: usize,
}

impl Curve {
    /// Its arcs.
    #[must_use]
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.count]
    }

    /// Whichever gear, in m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.length_m
    }
}

/// Like [`all`], into memory that is used again; only those up to `most` times as long as the shortest.
pub fn curves(from: &MapPose, to: &MapPose, radius_m: f64, most: f64, found: &mut Vec<Curve>) {
    found.clear();
    let mut shortest = f64::INFINITY;
    each(target(from, to, radius_m), |length, word| {
        shortest = shortest.min(length);
        if length <= most * shortest {
            found.push(word.curve(length, radius_m));
        }
    });
    found.retain(|curve| curve.length_m <= most * shortest * radius_m + ZERO);
    found.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
}

fn target(from: &MapPose, to: &MapPose, radius_m: f64) -> Target {
    let (sin, cos) = libm::sincos(from.yaw_rad);
    let (dx, dy) = ((to.x_m - from.x_m) / radius_m, (to.y_m - from.y_m) / radius_m);
    Target { x: dx * cos + dy * sin, y: dy * cos - dx * sin, yaw: wrap_rad(to.yaw_rad - from.yaw_rad) }
}

impl Word {
    fn path(&self, from: &MapPose, radius_m: f64) -> Path {
        let mut path = Path::standing(*from);
        self.curve(0.0, radius_m).pieces().iter().for_each(|piece| path.push(*piece));
        path
    }

    fn curve(&self, length: f64, radius_m: f64) -> Curve {
        let mut curve = Curve {
            length_m: length * radius_m,
            pieces: [Piece { length_m: 0.0, curvature_per_m: 0.0 }; 5],
            count: 0,
        };
        for (turn, length) in self.turns.iter().zip(self.lengths).take(self.count) {
            let curvature = match turn {
                L => 1.0,
                S => 0.0,
                R => -1.0,
            };
            if length.abs() > ZERO {
                curve.pieces[curve.count] =
                    Piece { length_m: length * radius_m, curvature_per_m: curvature / radius_m };
                curve.count += 1;
            }
        }
        curve
    }
}

/// A target as the formulas see it: with what several of them need.
#[derive(Debug, Clone, Copy)]
struct View {
    yaw: f64,
    /// x − sin yaw, y − 1 + cos yaw: between the middles of two left turns.
    same: [f64; 2],
    /// x + sin yaw, y − 1 − cos yaw: between the middles of a left and a right turn.
    other: [f64; 2],
    same_apart: f64,
    other_apart: f64,
}

impl View {
    fn of(x: f64, y: f64, yaw: f64, (sin, cos): (f64, f64)) -> Self {
        let (same, other) = ([x - sin, y - 1.0 + cos], [x + sin, y - 1.0 - cos]);
        let (same_apart, other_apart) = (libm::hypot(same[0], same[1]), libm::hypot(other[0], other[1]));
        Self { yaw, same, other, same_apart, other_apart }
    }

    fn same_rad(&self) -> f64 {
        libm::atan2(self.same[1], self.same[0])
    }
}

/// Flipped in time, mirrored left to right.
const SYMMETRIES: [(bool, bool); 4] = [(false, false), (true, false), (false, true), (true, true)];

/// Calls `found` with every word that leads to the target.
fn each(to: Target, mut found: impl FnMut(f64, &Word)) {
    let (sin, cos) = libm::sincos(to.yaw);
    let views = |x: f64, y: f64| {
        SYMMETRIES.map(|(flip, mirror)| {
            let (x, y) = (if flip { -x } else { x }, if mirror { -y } else { y });
            let (yaw, sin) = if flip == mirror { (to.yaw, sin) } else { (-to.yaw, -sin) };
            View::of(x, y, yaw, (sin, cos))
        })
    };
    let mut symmetric = |views: &[View; 4], reversed: bool, formula: Formula| {
        for (view, (flip, mirror)) in views.iter().zip(SYMMETRIES) {
            let Some((turns, lengths)) = formula(view) else { continue };
            let count = lengths.iter().rposition(|&length| length != 0.0).map_or(0, |last| last + 1).max(3);
            let mut word = Word { turns, lengths, count };
            for (turn, length) in word.turns.iter_mut().zip(&mut word.lengths).take(count) {
                if flip {
                    *length = -*length;
                }
                if mirror {
                    *turn = match *turn {
                        L => R,
                        S => S,
                        R => L,
                    };
                }
            }
            if reversed {
                word.turns[..count].reverse();
                word.lengths[..count].reverse();
            }
            found(word.lengths.iter().map(|length| length.abs()).sum(), &word);
        }
    };
    let there = views(to.x, to.y);
    for formula in [lsl, lsr, lrl, lrlr_inner, lrlr_outer, lrsl, lrsr, lrslr] {
        symmetric(&there, false, formula);
    }
    // From the other end: the formulas that are not their own mirror image in time.
    let back = views(to.x * cos + to.y * sin, to.x * sin - to.y * cos);
    for formula in [lrl, lrsl, lrsr] {
        symmetric(&back, true, formula);
    }
}

type Formula = fn(&View) -> Option<([Turn; 5], [f64; 5])>;

/// (8.1) L⁺ S⁺ L⁺
fn lsl(to: &View) -> Option<([Turn; 5], [f64; 5])> {
    let (u, t) = (to.same_apart, to.same_rad());
    let v = wrap_rad(to.yaw - t);
    (t >= -ZERO && v >= -ZERO).then_some(([L, S, L, S, S], [t, u, v, 0.0, 0.0]))
}

/// (8.2) L⁺ S⁺ R⁺
fn lsr(to: &View) -> Option<([Turn; 5], [f64; 5])> {
    let ([xi, eta], u1) = (to.other, to.other_apart);
    if u1 < 2.0 {
        return None;
    }
    let u = libm::sqrt(u1 * u1 - 4.0);
    let t = wrap_rad(libm::atan2(eta, xi) + libm::atan2(2.0, u));
    let v = wrap_rad(t - to.yaw);
    (t >= -ZERO && v >= -ZERO).then_some(([L, S, R, S, S], [t, u, v, 0.0, 0.0]))
}

/// (8.3, 8.4) L⁺ R⁻ L±
fn lrl(to: &View) -> Option<([Turn; 5], [f64; 5])> {
    let u1 = to.same_apart;
    if u1 > 4.0 {
        return None;
    }
    let u = -2.0 * libm::asin(0.25 * u1);
    let t = wrap_rad(to.same_rad() + 0.5 * u + PI);
    let v = wrap_rad(to.yaw - t + u);
    (t >= -ZERO && u <= ZERO).then_some(([L, R, L, S, S], [t, u, v, 0.0, 0.0]))
}

fn tau_omega(u: f64, v: f64, xi: f64, eta: f64, yaw: f64) -> (f64, f64) {
    let delta = wrap_rad(u - v);
    let (sin_u, cos_u) = libm::sincos(u);
    let (sin_delta, cos_delta) = libm::sincos(delta);
    let (a, b) = (sin_u - sin_delta, cos_u - cos_delta - 1.0);
    let t1 = libm::atan2(eta * a - xi * b, xi * a + eta * b);
    let t2 = 2.0 * (cos_delta - libm::cos(v) - cos_u) + 3.0;
    let tau = wrap_rad(if t2 < 0.0 { t1 + PI } else { t1 });
    (tau, wrap_rad(tau - u + v - yaw))
}

/// (8.7) L⁺ Rᵤ⁺ Lᵤ⁻ R⁻
fn lrlr_inner(to: &View) -> Option<([Turn; 5], [f64; 5])> {
    let [xi, eta] = to.other;
    let rho = 0.25 * (2.0 + to.other_apart);
    if rho > 1.0 {
        return None;
    }
    let u = libm::acos(rho);
    let (t, v) = tau_omega(u, -u, xi, eta, to.yaw);
    (t >= -ZERO && v <= ZERO).then_some(([L, R, L, R, S], [t, u, -u, v, 0.0]))
}

/// (8.8) L⁺ Rᵤ⁻ Lᵤ⁻ R⁺
fn lrlr_outer(to: &View) -> Option<([Turn; 5], [f64; 5])> {
    let [xi, eta] = to.other;
    let rho = (20.0 - xi * xi - eta * eta) / 16.0;
    if !(0.0..=1.0).contains(&rho) {
        return None;
    }
    let u = -libm::acos(rho);
    let (t, v) = tau_omega(u, u, xi, eta, to.yaw);
    (t >= -ZERO && v >= -ZERO).then_some(([L, R, L, R, S], [t, u, u, v, 0.0]))
}

/// (8.9) L⁺ R⁻(π/2) S⁻ L⁻
fn lrsl(to: &View) -> Option<([Turn; 5], [f64; 5])> {
    let rho = to.same_apart;
    if rho < 2.0 {
        return None;
    }
    let r = libm::sqrt(rho * rho - 4.0);
    let u = 2.0 - r;
    if u > ZERO {
        return None;
    }
    let t = wrap_rad(to.same_rad() + libm::atan2(r, -2.0));
    let v = wrap_rad(to.yaw - FRAC_PI_2 - t);
    (t >= -ZERO && v <= ZERO).then_some(([L, R, S, L, S], [t, -FRAC_PI_2, u, v, 0.0]))
}

/// (8.10) L⁺ R⁻(π/2) S⁻ R⁻
fn lrsr(to: &View) -> Option<([Turn; 5], [f64; 5])> {
    let ([xi, eta], rho) = (to.other, to.other_apart);
    if rho < 2.0 {
        return None;
    }
    let (t, u) = (libm::atan2(xi, -eta), 2.0 - rho);
    let v = wrap_rad(t + FRAC_PI_2 - to.yaw);
    (t >= -ZERO && u <= ZERO && v <= ZERO).then_some(([L, R, S, R, S], [t, -FRAC_PI_2, u, v, 0.0]))
}

/// (8.11) L⁺ R⁻(π/2) S⁻ L⁻(π/2) R⁺
fn lrslr(to: &View) -> Option<([Turn; 5], [f64; 5])> {
    let ([xi, eta], rho) = (to.other, to.other_apart);
    if rho < 2.0 {
        return None;
    }
    let u = 4.0 - libm::sqrt(rho * rho - 4.0);
    if u > ZERO {
        return None;
    }
    let t = wrap_rad(libm::atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta));
    let v = wrap_rad(t - to.yaw);
    (t >= -ZERO && v >= -ZERO).then_some(([L, R, S, L, R], [t, -FRAC_PI_2, u, -FRAC_PI_2, v]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poses on a lattice around the origin, in all directions.
    fn poses() -> impl Iterator<Item = MapPose> {
        (-4..=4).flat_map(|x| (-4..=4).flat_map(move |y| (-6..6).map(move |yaw| (x, y, yaw)))).map(
            |(x, y, yaw)| MapPose {
                x_m: f64::from(x) * 0.37 + 0.01,
                y_m: f64::from(y) * 0.41 - 0.02,
                yaw_rad: f64::from(yaw) * 0.52 + 0.03,
            },
        )
    }

    #[test]
    fn every_word_ends_at_the_target() {
        let from = MapPose { x_m: 0.4, y_m: -1.0, yaw_rad: 0.7 };
        for to in poses() {
            let ways = all(&from, &to, 0.4);
            assert!(!ways.is_empty(), "no way to {to:?}");
            for way in ways {
                let end = way.end();
                let off = libm::hypot(end.x_m - to.x_m, end.y_m - to.y_m)
                    + wrap_rad(end.yaw_rad - to.yaw_rad).abs();
                assert!(off < 1e-6, "{way:?} ends {off} beside {to:?}");
            }
        }
    }

    #[test]
    fn the_way_back_is_as_long() {
        let from = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        for to in poses() {
            let (there, back) = (distance_m(&from, &to, 0.4), distance_m(&to, &from, 0.4));
            assert!((there - back).abs() < 1e-9, "{there} there, {back} back to {to:?}");
            assert!(there + 1e-9 >= libm::hypot(to.x_m, to.y_m));
            assert!((shortest(&from, &to, 0.4).length_m() - there).abs() < 1e-9);
        }
    }

    #[test]
    fn ahead_is_straight_and_to_the_side_needs_a_change_of_gear() {
        let from = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        let ahead = shortest(&from, &MapPose { x_m: 2.0, ..from }, 0.4);
        assert_eq!((ahead.pieces.len(), ahead.cusps()), (1, 0));
        let beside = shortest(&from, &MapPose { y_m: 0.3, ..from }, 0.4);
        assert!(beside.cusps() >= 1);
    }
}
