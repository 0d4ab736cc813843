//! How far it is to a point on the floor around everything, for a car that could turn on the spot.
//!
//! Never less room than the real car has, so what cannot be reached here cannot be reached at all.
//! Grows outwards only as far as somebody asks, and is kept for the next question.

use super::space::Space;
use crate::geometry::apart_m;

/// Steps to the side and across cost 5 and 7: √2 rounded down to 7/5.
const SIDE: u32 = 5;
const ACROSS: u32 = 7;
/// Costs in use at once differ by less than this: a step costs 7 at most.
const BUCKETS: usize = 8;

/// Not seen yet.
const FAR: u32 = u32::MAX;
/// The car does not fit there.
const BLOCKED: u32 = u32::MAX - 1;

/// Squares of the floor, 16 MB for each end; more are not kept, the squares grow instead.
const MOST_SQUARES: f64 = 4e6;

#[derive(Debug, Default)]
pub(super) struct ObstacleHeuristic {
    low_m: [f64; 2],
    side_m: f64,
    columns: usize,
    rows: usize,
    costs: Vec<u32>,
    buckets: [Vec<u32>; BUCKETS],
    /// All squares of a lower cost are final.
    reached: u32,
    /// Squares that wait in the buckets.
    waiting: usize,
    settled: usize,
}

impl ObstacleHeuristic {
    /// Begins anew at a point.
    pub(super) fn begin(&mut self, space: &impl Space, side_m: f64, at_m: [f64; 2]) {
        let bounds = space.bounds();
        let extent = [0, 1].map(|axis| (bounds.high_m[axis] - bounds.low_m[axis]).max(0.0));
        self.side_m = side_m.max(libm::sqrt(extent[0] * extent[1] / MOST_SQUARES));
        self.low_m = bounds.low_m; // middle of the first square: a corner of the first cell
        self.columns = libm::ceil(extent[0] / self.side_m) as usize + 1;
        self.rows = libm::ceil(extent[1] / self.side_m) as usize + 1;
        self.costs.clear();
        self.costs.resize(self.columns * self.rows, FAR);
        self.buckets.iter_mut().for_each(Vec::clear);
        (self.reached, self.waiting, self.settled) = (0, 0, 0);
        if let Some(square) = self.square(at_m[0], at_m[1]) {
            self.costs[square] = 0;
            self.buckets[0].push(square as u32);
            self.waiting = 1;
        }
    }

    /// Way to the point, in m; infinite when there is none.
    pub(super) fn way_m(&mut self, space: &impl Space, x_m: f64, y_m: f64) -> f64 {
        let Some(square) = self.square(x_m, y_m) else { return f64::INFINITY };
        while self.costs[square] >= self.reached && self.waiting > 0 {
            if self.costs[square] == BLOCKED {
                break;
            }
            self.advance(space);
        }
        let cost = self.costs[square];
        if cost >= BLOCKED { f64::INFINITY } else { f64::from(cost) / f64::from(SIDE) * self.side_m }
    }

    /// Grows until nothing is left; how many squares can be reached.
    pub(super) fn finish(&mut self, space: &impl Space) -> usize {
        while self.waiting > 0 {
            self.advance(space);
        }
        self.settled
    }

    /// Of all that was reached, the point that is nearest to this one as the crow flies, in m.
    pub(super) fn nearest_m(&self, to_m: [f64; 2]) -> Option<[f64; 2]> {
        let squares = self.costs.iter().enumerate().filter(|(_, cost)| **cost < BLOCKED);
        let points = squares.map(|(square, _)| self.middle_m(square));
        points.min_by(|a, b| apart_m(*a, to_m).total_cmp(&apart_m(*b, to_m)))
    }

    fn square(&self, x_m: f64, y_m: f64) -> Option<usize> {
        let (u, v) = ((x_m - self.low_m[0]) / self.side_m + 0.5, (y_m - self.low_m[1]) / self.side_m + 0.5);
        let inside = u >= 0.0 && v >= 0.0 && u < self.columns as f64 && v < self.rows as f64;
        inside.then(|| v as usize * self.columns + u as usize)
    }

    fn middle_m(&self, square: usize) -> [f64; 2] {
        [
            self.low_m[0] + (square % self.columns) as f64 * self.side_m,
            self.low_m[1] + (square / self.columns) as f64 * self.side_m,
        ]
    }

    /// Makes the squares of the lowest cost final.
    fn advance(&mut self, space: &impl Space) {
        let bucket = self.reached as usize % BUCKETS;
        while let Some(square) = self.buckets[bucket].pop() {
            self.waiting -= 1;
            if self.costs[square as usize] == self.reached {
                self.settled += 1;
                self.spread(space, square as usize);
            }
        }
        self.reached += 1;
    }

    fn spread(&mut self, space: &impl Space, square: usize) {
        let (column, row) = (square % self.columns, square / self.columns);
        for (down, left) in [(1, 0), (1, 1), (1, 2), (0, 1), (2, 1), (0, 0), (0, 2), (2, 0), (2, 2)] {
            let (Some(row), Some(column)) = ((row + down).checked_sub(1), (column + left).checked_sub(1))
            else {
                continue;
            };
            if row >= self.rows || column >= self.columns {
                continue;
            }
            let next = row * self.columns + column;
            let cost = self.reached + if down == 1 || left == 1 { SIDE } else { ACROSS };
            if self.costs[next] == FAR && !self.fits(space, next) {
                self.costs[next] = BLOCKED;
            }
            if self.costs[next] != BLOCKED && self.costs[next] > cost {
                self.costs[next] = cost;
                self.buckets[cost as usize % BUCKETS].push(next as u32);
                self.waiting += 1;
            }
        }
    }

    /// Whether the reference point may be somewhere in the square.
    fn fits(&self, space: &impl Space, square: usize) -> bool {
        let [x_m, y_m] = self.middle_m(square);
        space.most_clearance_m(x_m, y_m, self.side_m * std::f64::consts::FRAC_1_SQRT_2)
            >= space.car().core_m()
    }
}
