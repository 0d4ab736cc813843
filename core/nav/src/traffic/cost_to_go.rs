//! How many steps it takes from anywhere to a goal when nothing moves: the search's compass.
//!
//! A breadth-first flood from the goal with the car's own moves, which can be driven both ways.
//! Poses stay as they are driven to; squares and sectors only tell which were reached before.

use super::body::Body;
use super::floor::Floor;
use super::motion::Spot;
use super::problem::{Bounds, Problem};
use crate::Piece;
use std::f64::consts::TAU;

/// Sectors of a turn. Two of them are about one turning move at full lock.
pub(crate) const SECTORS: usize = 18;
/// Side of a square, in parts of a step.
const SIDE: f64 = 0.5;
/// Most squares along a side of the map.
const MOST_ALONG: f64 = 400.0;
/// Not reached.
const NEVER: u16 = u16::MAX;
/// What a heading that the flood missed costs, in steps, beside another one of the same square.
const MISSED: u16 = 4;

/// Squares of the floor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lattice {
    west: f64,
    south: f64,
    pub(crate) side: f64,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
}

impl Lattice {
    pub(crate) fn new(problem: &Problem) -> Self {
        let Bounds { west_m, south_m, east_m, north_m } = problem.bounds;
        let (wide, deep) = (east_m - west_m, north_m - south_m);
        let side = (problem.step_m * SIDE).max(wide.max(deep) / MOST_ALONG);
        let along = |length: f64| libm::floor(length / side) as usize + 1;
        Self { west: west_m, south: south_m, side, columns: along(wide), rows: along(deep) }
    }

    pub(crate) fn squares(&self) -> usize {
        self.columns * self.rows
    }

    #[inline]
    pub(crate) fn square(&self, x: f64, y: f64) -> usize {
        let column = (((x - self.west) / self.side).max(0.0) as usize).min(self.columns - 1);
        let row = (((y - self.south) / self.side).max(0.0) as usize).min(self.rows - 1);
        row * self.columns + column
    }

    /// Middle of the square in this column and row.
    pub(crate) fn middle(&self, column: usize, row: usize) -> [f64; 2] {
        [self.west + (column as f64 + 0.5) * self.side, self.south + (row as f64 + 0.5) * self.side]
    }

    /// Column and row of a point, which may lie outside.
    pub(crate) fn place(&self, x: f64, y: f64) -> [f64; 2] {
        [(x - self.west) / self.side, (y - self.south) / self.side]
    }
}

/// The sector of a heading.
#[inline]
pub(crate) fn sector(yaw: f64) -> usize {
    let turns = yaw / TAU + 0.5 / SECTORS as f64;
    let part = turns - turns.floor();
    ((part * SECTORS as f64) as usize).min(SECTORS - 1)
}

/// Steps to one goal.
#[derive(Debug)]
pub(crate) struct CostToGo {
    steps: Vec<u16>,
    least: Vec<u16>,
}

impl CostToGo {
    /// Floods from the goal. `None` when it was told not to go on.
    pub(crate) fn flood(
        lattice: &Lattice,
        floor: &Floor,
        (body, moves, margin): (&Body, &[Piece; 6], f64),
        goal: Spot,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let mut steps = vec![NEVER; lattice.squares() * SECTORS];
        let mut least = vec![NEVER; lattice.squares()];
        let square = lattice.square(goal.x, goal.y);
        steps[square * SECTORS + sector(goal.yaw)] = 0;
        least[square] = 0;
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
                    if !floor.inside(there.x, there.y) {
                        continue;
                    }
                    let square = lattice.square(there.x, there.y);
                    let known = &mut steps[square * SECTORS + sector(there.yaw)];
                    if *known == NEVER && floor.clear(body, &spot, piece, margin) {
                        *known = count;
                        least[square] = least[square].min(count);
                        next.push(there);
                    }
                }
            }
            std::mem::swap(&mut edge, &mut next);
        }
        Some(Self { steps, least })
    }

    /// Steps from a pose to the goal, by the flood's coarse measure; `None` where no way leads there.
    #[inline]
    pub(crate) fn steps(&self, lattice: &Lattice, spot: &Spot) -> Option<u16> {
        let square = lattice.square(spot.x, spot.y);
        let steps = self.steps[square * SECTORS + sector(spot.yaw)];
        if steps != NEVER {
            return Some(steps);
        }
        let least = self.least[square];
        (least != NEVER).then(|| least.saturating_add(MISSED))
    }
}
