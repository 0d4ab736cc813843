//! How many steps it takes from anywhere to a goal when nothing moves: the search's heuristic.
//!
//! A breadth-first flood from the goal with the car's own moves, which can be driven both ways, but in one-way zones.
//! Poses stay as they are driven to; squares and sectors only tell which were reached before.

use super::body::Body;
use super::lattice::Lattice;
use super::motion::Spot;
use super::obstacle_index::{Keep, ObstacleIndex};
use super::problem::Problem;
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

/// Steps to one goal.
#[derive(Debug)]
pub(crate) struct CostToGo {
    lattice: Lattice,
    sectors: usize,
    steps: Vec<u16>,
    /// Of the best heading in each square.
    least: Vec<u16>,
}

impl CostToGo {
    /// Nothing reached.
    fn nowhere(problem: &Problem, grain: Grain) -> Self {
        let lattice = Lattice::new(problem, grain.side);
        let steps = vec![NEVER; lattice.squares() * grain.sectors];
        Self { lattice, sectors: grain.sectors, steps, least: vec![NEVER; lattice.squares()] }
    }

    /// Before anything was looked for.
    pub(crate) fn unknown(problem: &Problem) -> Self {
        Self { steps: Vec::new(), least: Vec::new(), ..Self::nowhere(problem, Grain::COARSE) }
    }

    /// Floods from the goal. `None` when it was told not to go on.
    pub(crate) fn flood(
        problem: &Problem,
        grain: Grain,
        obstacles: &ObstacleIndex,
        (body, moves, keep): (&Body, &[Piece], &Keep),
        goal: Spot,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let mut flood = Self::nowhere(problem, grain);
        flood.reach(&goal, 0);
        let (mut edge, mut next) = (vec![goal], Vec::new());
        for count in 1..NEVER {
            if edge.is_empty() {
                break;
            }
            if !keep_going() {
                return None;
            }
            for spot in edge.drain(..) {
                for piece in moves {
                    let there = spot.after(piece, 1.0);
                    // Known ones first: that is cheaper than looking for obstacles.
                    if obstacles.inside(there.x, there.y)
                        && flood.steps[flood.state(&there)] == NEVER
                        && obstacles.clear(body, &spot, piece, keep)
                        && obstacles.allows(&there, &Piece { length_m: -piece.length_m, ..*piece })
                    {
                        flood.reach(&there, count);
                        next.push(there);
                    }
                }
            }
            std::mem::swap(&mut edge, &mut next);
        }
        Some(flood)
    }

    fn reach(&mut self, spot: &Spot, count: u16) {
        let (state, square) = (self.state(spot), self.lattice.square(spot.x, spot.y));
        self.steps[state] = count;
        self.least[square] = self.least[square].min(count);
    }

    /// What poses have in common that count as the same.
    #[inline]
    pub(crate) fn state(&self, spot: &Spot) -> usize {
        let turns = spot.yaw / TAU + 0.5 / self.sectors as f64;
        let sector = ((turns - libm::floor(turns)) * self.sectors as f64) as usize;
        self.lattice.square(spot.x, spot.y) * self.sectors + sector.min(self.sectors - 1)
    }

    /// Steps from a pose to the goal, by the flood's coarse measure; `None` where no way leads there.
    #[inline]
    pub(crate) fn steps(&self, spot: &Spot) -> Option<u16> {
        let steps = self.steps[self.state(spot)];
        if steps != NEVER {
            return Some(steps);
        }
        let least = self.least[self.lattice.square(spot.x, spot.y)];
        (least != NEVER).then(|| least.saturating_add(MISSED))
    }
}
