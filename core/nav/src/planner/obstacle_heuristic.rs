//! How far it is to a point on the floor around everything, for a car that could turn on the spot.
//!
//! Never less room than the real car has, so what cannot be reached here cannot be reached at all.
//! Grows only as far as somebody asks, towards the other end first, and is kept for the next question:
//! A* without a last square, whose costs are exact for each square that it has looked at (D. Silver,
//! *Cooperative pathfinding* (2005), "reverse resumable A*").

use super::space::Space;
use crate::geometry::apart_m;

/// Steps to the side and across cost 5 and 7: √2 rounded down to 7/5.
const SIDE: u32 = 5;
const ACROSS: u32 = 7;
/// Sums of cost and estimate in use at once differ by less than this: a step costs 7 at most, and as much is
/// the most by which the estimate grows with it.
const BUCKETS: usize = 16;

/// Not seen yet.
const FAR: u32 = u32::MAX;
/// Not seen yet either, but the car fits there.
const FITS: u32 = u32::MAX - 1;
/// The car does not fit there. What is below is a cost.
const BLOCKED: u32 = u32::MAX - 2;

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
    /// Column and row towards which it grows first.
    towards: [usize; 2],
    /// All squares of a lower cost and estimate are final.
    reached: u32,
    /// Squares that wait in the buckets.
    waiting: usize,
    settled: usize,
}

impl ObstacleHeuristic {
    /// Begins anew at a point; most will be asked about what lies between it and another one.
    pub(super) fn begin(&mut self, space: &impl Space, side_m: f64, at_m: [f64; 2], towards_m: [f64; 2]) {
        let bounds = space.bounds();
        let extent = [0, 1].map(|axis| (bounds.high_m[axis] - bounds.low_m[axis]).max(0.0));
        self.side_m = side_m.max(libm::sqrt(extent[0] * extent[1] / MOST_SQUARES));
        self.low_m = bounds.low_m; // middle of the first square: a corner of the first cell
        self.columns = libm::ceil(extent[0] / self.side_m) as usize + 1;
        self.rows = libm::ceil(extent[1] / self.side_m) as usize + 1;
        self.costs.clear();
        self.costs.resize(self.columns * self.rows, FAR);
        self.begin_at(at_m, towards_m);
    }

    /// The other way round on the same floor: begins anew, but for which squares the car fits into.
    pub(super) fn begin_opposite(&mut self, other: &Self, at_m: [f64; 2], towards_m: [f64; 2]) {
        (self.low_m, self.side_m, self.columns, self.rows) =
            (other.low_m, other.side_m, other.columns, other.rows);
        self.costs.clear();
        self.costs.extend(other.costs.iter().map(|&cost| if cost < BLOCKED { FITS } else { cost }));
        // The other one begins at its first square whether the car fits there or not.
        if let Some(first) = self.square(towards_m[0], towards_m[1]) {
            self.costs[first] = FAR;
        }
        self.begin_at(at_m, towards_m);
    }

    fn begin_at(&mut self, at_m: [f64; 2], towards_m: [f64; 2]) {
        self.buckets.iter_mut().for_each(Vec::clear);
        (self.reached, self.waiting, self.settled) = (0, 0, 0);
        let Some(square) = self.square(at_m[0], at_m[1]) else { return };
        let towards = self.square(towards_m[0], towards_m[1]).unwrap_or(square);
        self.towards = [towards % self.columns, towards / self.columns];
        self.costs[square] = 0;
        self.reached = self.estimate(square % self.columns, square / self.columns);
        self.buckets[self.reached as usize % BUCKETS].push(square as u32);
        self.waiting = 1;
    }

    /// Way to the point, in m; infinite when there is none.
    pub(super) fn way_m(&mut self, space: &impl Space, x_m: f64, y_m: f64) -> f64 {
        let Some(square) = self.square(x_m, y_m) else { return f64::INFINITY };
        let estimate = self.estimate(square % self.columns, square / self.columns);
        while self.waiting > 0 && self.costs[square].saturating_add(estimate) >= self.reached {
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
        let points = squares.map(|(square, _)| self.middle_m(square % self.columns, square / self.columns));
        points.min_by(|a, b| apart_m(*a, to_m).total_cmp(&apart_m(*b, to_m)))
    }

    fn square(&self, x_m: f64, y_m: f64) -> Option<usize> {
        let (u, v) = ((x_m - self.low_m[0]) / self.side_m + 0.5, (y_m - self.low_m[1]) / self.side_m + 0.5);
        let inside = u >= 0.0 && v >= 0.0 && u < self.columns as f64 && v < self.rows as f64;
        inside.then(|| v as usize * self.columns + u as usize)
    }

    fn middle_m(&self, column: usize, row: usize) -> [f64; 2] {
        [self.low_m[0] + column as f64 * self.side_m, self.low_m[1] + row as f64 * self.side_m]
    }

    /// The least that a way from there to where it grows to first costs.
    fn estimate(&self, column: usize, row: usize) -> u32 {
        let (along, up) = (column.abs_diff(self.towards[0]), row.abs_diff(self.towards[1]));
        SIDE * along.max(up) as u32 + (ACROSS - SIDE) * along.min(up) as u32
    }

    /// Makes the squares of the lowest cost and estimate final.
    fn advance(&mut self, space: &impl Space) {
        let bucket = self.reached as usize % BUCKETS;
        while let Some(square) = self.buckets[bucket].pop() {
            self.waiting -= 1;
            let columns = self.columns as u32;
            let (column, row) = ((square % columns) as usize, (square / columns) as usize);
            let cost = self.costs[square as usize];
            if cost + self.estimate(column, row) == self.reached {
                self.settled += 1;
                self.spread(space, (column, row), cost);
            }
        }
        self.reached += 1;
    }

    fn spread(&mut self, space: &impl Space, (column, row): (usize, usize), so_far: u32) {
        let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
        for to_row in row.saturating_sub(1)..(row + 2).min(self.rows) {
            for to_column in columns.clone() {
                let next = to_row * self.columns + to_column;
                let cost = so_far + if to_row == row || to_column == column { SIDE } else { ACROSS };
                let known = self.costs[next];
                if known <= cost || known == BLOCKED {
                    continue;
                }
                if known == FAR && !self.fits(space, (to_column, to_row)) {
                    self.costs[next] = BLOCKED;
                    continue;
                }
                self.costs[next] = cost;
                let bucket = (cost + self.estimate(to_column, to_row)) as usize % BUCKETS;
                self.buckets[bucket].push(next as u32);
                self.waiting += 1;
            }
        }
    }

    /// Whether the reference point may be somewhere in the square.
    fn fits(&self, space: &impl Space, (column, row): (usize, usize)) -> bool {
        let [x_m, y_m] = self.middle_m(column, row);
        space.most_clearance_m(x_m, y_m, self.side_m * std::f64::consts::FRAC_1_SQRT_2)
            >= space.car().core_m()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::space::{GridLayers, GridSpace, LookOut};
    use crate::rooms::{Draw, RoomKind};

    const CAR: crate::Car = crate::Car {
        front_m: 0.25,
        rear_m: 0.25,
        half_width_m: 0.2,
        radius_m: 0.393,
        gears: crate::Gears::BOTH,
    };
    const SIDE_M: f64 = 0.05;

    fn space(room: RoomKind, seed: u64) -> GridSpace {
        GridSpace::new(&GridLayers::map(&room.grid(seed)), CAR, LookOut::OFF).unwrap()
    }

    /// Ways from a point to all of these, measured from there outwards in all directions.
    fn outwards(space: &GridSpace, from_m: [f64; 2], to_m: &[[f64; 2]]) -> Vec<f64> {
        let mut all = ObstacleHeuristic::default();
        all.begin(space, SIDE_M, from_m, from_m);
        all.finish(space);
        to_m.iter().map(|[x_m, y_m]| all.way_m(space, *x_m, *y_m)).collect()
    }

    #[test]
    fn whichever_way_it_grows_first_the_ways_are_the_same() {
        for (room, seed) in RoomKind::ALL.into_iter().flat_map(|room| (1..4).map(move |seed| (room, seed))) {
            let (space, mut draw) = (space(room, seed), Draw::new(seed));
            let mut place = || draw.free_pose(&space).map(|pose| [pose.x_m, pose.y_m]).unwrap();
            let (goal, start) = (place(), place());
            let points: Vec<[f64; 2]> = (0..200).map(|_| place()).collect();
            let ask = |ways: &mut ObstacleHeuristic| -> Vec<f64> {
                points.iter().map(|[x_m, y_m]| ways.way_m(&space, *x_m, *y_m)).collect()
            };
            let [mut ahead, mut back] = [ObstacleHeuristic::default(), ObstacleHeuristic::default()];
            ahead.begin(&space, SIDE_M, goal, start);
            ahead.way_m(&space, start[0], start[1]);
            back.begin_opposite(&ahead, start, goal);
            assert_eq!(ask(&mut back), outwards(&space, start, &points), "{room:?} {seed}");
            assert_eq!(ask(&mut ahead), outwards(&space, goal, &points), "{room:?} {seed}");
            assert_eq!(back.finish(&space), {
                back.begin(&space, SIDE_M, start, start);
                back.finish(&space)
            });
        }
    }

    #[test]
    fn a_way_to_the_other_end_does_not_look_at_the_whole_floor() {
        let space = GridSpace::new(
            &GridLayers::map(&crate::Grid::free(SIDE_M, [0.0, 0.0], 200, 200).unwrap()),
            CAR,
            LookOut::OFF,
        )
        .unwrap();
        let mut ways = ObstacleHeuristic::default();
        ways.begin(&space, SIDE_M, [2.0, 5.0], [8.0, 5.5]);
        assert!((ways.way_m(&space, 8.0, 5.5) - (6.0 + 0.4 * 0.5)).abs() < 1e-9);
        assert!(ways.settled < 5_000, "{} squares of 40,000", ways.settled);
    }
}
