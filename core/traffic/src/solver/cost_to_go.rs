//! How many steps it takes from anywhere to a goal when nothing moves: the search's heuristic.
//!
//! A breadth-first flood from the goal with the car's own moves, which can be driven both ways, but in one-way zones.
//! On a large floor it ends where no way of reasonable length leads. Poses stay as they are driven to; squares
//! and sectors only tell which were reached before.

use super::body::Body;
use super::lattice::Lattice;
use super::motion::{Drive, Spot};
use super::obstacle_index::{Keep, ObstacleIndex};
use super::problem::{FloorBounds, Problem};
use std::f64::consts::TAU;
use xtb_nav::Piece;

/// Not reached.
const NEVER: u16 = u16::MAX;
/// What a heading that the flood missed costs, in steps, beside another one of the same square; chosen, not
/// measured.
const MISSED: u16 = 4;

/// How finely poses are told apart.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grain {
    /// Side of a square, in parts of a step.
    pub(crate) side: f64,
    /// Of a turn.
    sectors: usize,
    /// Lengths of moves, in parts of a step.
    lengths: &'static [f64],
}

impl Grain {
    /// Enough nearly always. Two sectors are about one turning move at full lock of the public instances.
    pub(crate) const COARSE: Self = Self { side: 0.5, sectors: 18, lengths: &[1.0] };
    /// For cars that stand wedged in: halves and quarters of a move too.
    pub(crate) const SHORT: Self = Self { lengths: &[1.0, 0.5, 0.25], ..Self::COARSE };
    /// The last resort: chosen, not measured.
    pub(crate) const FINE: Self = Self { side: 0.2, sectors: 36, ..Self::SHORT };

    /// Straight, left and right, ahead and astern.
    pub(crate) fn moves(&self, step: f64, radius: f64) -> Vec<Piece> {
        let mut moves = Vec::with_capacity(6 * self.lengths.len());
        for length in self.lengths {
            for gear in [1.0, -1.0] {
                for turn in [0.0, 1.0, -1.0] {
                    moves.push(Piece { length_m: gear * length * step, curvature_per_m: turn / radius });
                }
            }
        }
        moves
    }
}

/// Floors of at most so many square steps are flooded as a whole: 50 steps a side; chosen, not measured.
const WHOLE: f64 = 2_500.0;
/// Steps beyond the straight line from start to goal within which a larger floor is flooded, …
const DETOUR: f64 = 24.0;
/// … as long as the way itself leaves so many of them for getting out of others' way; otherwise the whole
/// floor is. Both chosen, not measured.
const LEFT: f64 = 12.0;

/// Steps to one goal.
#[derive(Debug)]
pub(crate) struct CostToGo {
    lattice: Lattice,
    sectors: usize,
    /// The part of the floor that was looked at: first column and row, and how many.
    corner: (usize, usize),
    size: (usize, usize),
    /// `None`: that was the whole floor.
    limit: Option<Limit>,
    steps: Vec<u16>,
    /// Of the best heading in each square.
    least: Vec<u16>,
}

/// Where a flood ends: poses that no way from the start to the goal of so many steps leads through.
#[derive(Debug, Clone, Copy)]
struct Limit {
    start: [f64; 2],
    step: f64,
    most: f64,
}

impl Limit {
    #[inline]
    fn allows(&self, spot: &Spot, count: u16) -> bool {
        let left = (self.most - f64::from(count)) * self.step;
        let (dx, dy) = (spot.x - self.start[0], spot.y - self.start[1]);
        left >= 0.0 && dx * dx + dy * dy <= left * left
    }
}

impl CostToGo {
    /// Before anything was looked for.
    pub(crate) fn unknown(problem: &Problem) -> Self {
        Self::nowhere(problem, Grain::COARSE, ([0.0, 0.0], [-1.0, -1.0]))
    }

    /// Nothing reached; with room for poses between these corners.
    fn nowhere(problem: &Problem, grain: Grain, (low, high): ([f64; 2], [f64; 2])) -> Self {
        let lattice = Lattice::new(problem, grain.side);
        let (corner, size) = if low[0] > high[0] {
            ((0, 0), (0, 0))
        } else {
            let (first, last) = (lattice.cell(low[0], low[1]), lattice.cell(high[0], high[1]));
            (first, (last.0 + 1 - first.0, last.1 + 1 - first.1))
        };
        let squares = size.0 * size.1;
        let (steps, least) = (vec![NEVER; squares * grain.sectors], vec![NEVER; squares]);
        Self { lattice, sectors: grain.sectors, corner, size, limit: None, steps, least }
    }

    /// Floods from the goal, on large floors only as far as a way from the start may lead. `None` when it was
    /// told not to go on.
    pub(crate) fn flood(
        problem: &Problem,
        grain: Grain,
        obstacles: &ObstacleIndex,
        car: (&Body, &[Piece], &Keep),
        (start, goal): (&Spot, &Spot),
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let FloorBounds { west_m, south_m, east_m, north_m } = problem.bounds;
        let step = problem.step_m;
        if (east_m - west_m) * (north_m - south_m) > WHOLE * step * step {
            let apart = libm::hypot(goal.x - start.x, goal.y - start.y);
            let limit = Limit { start: [start.x, start.y], step, most: apart / step + DETOUR };
            let [low_x, high_x] = ellipse(start.x, goal.x, apart, limit.most * step);
            let [low_y, high_y] = ellipse(start.y, goal.y, apart, limit.most * step);
            let window = ([low_x.max(west_m), low_y.max(south_m)], [high_x.min(east_m), high_y.min(north_m)]);
            let mut part = Self { limit: Some(limit), ..Self::nowhere(problem, grain, window) };
            part.fill(obstacles, car, goal, keep_going)?;
            if part.serves(start) {
                return Some(part);
            }
        }
        let mut whole = Self::nowhere(problem, grain, ([west_m, south_m], [east_m, north_m]));
        whole.fill(obstacles, car, goal, keep_going)?;
        Some(whole)
    }

    /// Whether it is known around all ways from this start to the goal.
    pub(crate) fn serves(&self, start: &Spot) -> bool {
        let Some(Limit { start: [x, y], step, most }) = self.limit else { return true };
        let off = libm::hypot(start.x - x, start.y - y) / step;
        self.steps(start).is_some_and(|steps| f64::from(steps) + off + LEFT <= most)
    }

    fn fill(
        &mut self,
        obstacles: &ObstacleIndex,
        (body, moves, keep): (&Body, &[Piece], &Keep),
        goal: &Spot,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Option<()> {
        let limit = self.limit;
        let moves: Vec<(Drive, &Piece)> = moves.iter().map(|piece| (Drive::new(piece, 1.0), piece)).collect();
        self.reach(goal, 0);
        let (mut edge, mut next) = (vec![*goal], Vec::new());
        for count in 1..NEVER {
            if edge.is_empty() {
                break;
            }
            if !keep_going() {
                return None;
            }
            for spot in edge.drain(..) {
                for (drive, piece) in &moves {
                    let there = drive.end(&spot);
                    // Known ones first: that is cheaper than looking for obstacles.
                    if obstacles.inside(there.x, there.y)
                        && limit.is_none_or(|limit| limit.allows(&there, count))
                        && self.slot(&there).is_some_and(|slot| self.steps[slot] == NEVER)
                        && obstacles.clear(body, &spot, piece, keep)
                        && obstacles.allows(&there, &Piece { length_m: -piece.length_m, ..**piece })
                    {
                        self.reach(&there, count);
                        next.push(there);
                    }
                }
            }
            std::mem::swap(&mut edge, &mut next);
        }
        Some(())
    }

    fn reach(&mut self, spot: &Spot, count: u16) {
        let Some(square) = self.square(spot) else { return };
        let slot = square * self.sectors + self.sector(spot);
        self.steps[slot] = count;
        self.least[square] = self.least[square].min(count);
    }

    /// What poses have in common that count as the same.
    #[inline]
    pub(crate) fn state(&self, spot: &Spot) -> usize {
        self.lattice.square(spot.x, spot.y) * self.sectors + self.sector(spot)
    }

    #[inline]
    fn sector(&self, spot: &Spot) -> usize {
        let turns = spot.yaw / TAU + 0.5 / self.sectors as f64;
        let part = turns - turns as i64 as f64;
        let sector = (if part < 0.0 { part + 1.0 } else { part } * self.sectors as f64) as usize;
        sector.min(self.sectors - 1)
    }

    /// A pose's square, in the table.
    #[inline]
    fn square(&self, spot: &Spot) -> Option<usize> {
        self.square_at(spot.x, spot.y)
    }

    #[inline]
    fn square_at(&self, x: f64, y: f64) -> Option<usize> {
        let (column, row) = self.lattice.cell(x, y);
        let (column, row) = (column.wrapping_sub(self.corner.0), row.wrapping_sub(self.corner.1));
        (column < self.size.0 && row < self.size.1).then(|| row * self.size.0 + column)
    }

    #[inline]
    fn slot(&self, spot: &Spot) -> Option<usize> {
        self.square(spot).map(|square| square * self.sectors + self.sector(spot))
    }

    /// Side of a square.
    pub(crate) fn side_m(&self) -> f64 {
        self.lattice.side
    }

    /// Steps from the square that a point lies in, with the best heading; `u16::MAX` where no way leads to the goal.
    pub(crate) fn least(&self, x: f64, y: f64) -> u16 {
        self.square_at(x, y).map_or(NEVER, |square| self.least[square])
    }

    /// Steps from a pose to the goal, by the flood's coarse measure; `None` where no way leads there.
    #[inline]
    pub(crate) fn steps(&self, spot: &Spot) -> Option<u16> {
        let square = self.square(spot)?;
        let steps = self.steps[square * self.sectors + self.sector(spot)];
        if steps != NEVER {
            return Some(steps);
        }
        let least = self.least[square];
        (least != NEVER).then(|| least.saturating_add(MISSED))
    }
}

/// Least and greatest coordinate of the points from which two places, `apart` from each other, are `sum`
/// away together; `a` and `b` are the places' coordinates.
fn ellipse(a: f64, b: f64, apart: f64, sum: f64) -> [f64; 2] {
    // Half of the long axis, of the focal distance, and the share of it along this coordinate.
    let (long, focal, along) = (sum / 2.0, apart / 2.0, (b - a) / 2.0);
    let half = (long * long - focal * focal + along * along).max(0.0).sqrt();
    [(a + b) / 2.0 - half, (a + b) / 2.0 + half]
}
