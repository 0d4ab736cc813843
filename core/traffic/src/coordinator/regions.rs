//! Which trucks could get into each other's way: those are planned together, all others apart from them.
//!
//! A region is what is joined by cells through which the ways of its trucks lead, what they hold, and the boxes
//! around a place and a goal between which a way is still looked for. The way that is found may leave its box; so a
//! result is used only if it meets nobody else ([`super::Coordinator::planned`]).

use super::Coordinator;
use super::truck::Truck;
use xtb_control::Stamp;
use xtb_nav::geometry::rect::LOOK_OUT_M;

/// Side of a cell, in m; chosen for the time, not measured.
const CELL_M: f64 = 3.0;
/// What a way that is looked for may lead beside the box around its ends, in m; chosen, not measured.
const DETOUR_M: f64 = 2.0;
/// What a truck keeps from others beyond body and look-out, in m.
const KEEP_M: f64 = 0.5;
/// Places between two looks at a way: 0.5 m.
const EVERY: usize = 10;
/// Most cells along each side: a larger map has larger ones.
const MOST_CELLS: f64 = 100.0;

/// Cells, each with the first of the trucks that is in it, and who is joined to whom.
struct Cells {
    origin_m: [f64; 2],
    side_m: f64,
    count: [usize; 2],
    first: Vec<Option<usize>>,
    joined: Vec<usize>,
}

impl Cells {
    fn root(&mut self, mut one: usize) -> usize {
        while self.joined[one] != one {
            self.joined[one] = self.joined[self.joined[one]];
            one = self.joined[one];
        }
        one
    }

    fn take(&mut self, truck: usize, low_m: [f64; 2], high_m: [f64; 2]) {
        let place = |v: f64, axis: usize| {
            let cell = libm::floor((v - self.origin_m[axis]) / self.side_m).max(0.0) as usize;
            cell.min(self.count[axis] - 1)
        };
        let (columns, rows) =
            (place(low_m[0], 0)..=place(high_m[0], 0), place(low_m[1], 1)..=place(high_m[1], 1));
        for row in rows {
            for column in columns.clone() {
                let cell = row * self.count[0] + column;
                match self.first[cell] {
                    Some(other) => {
                        let (one, other) = (self.root(truck), self.root(other));
                        self.joined[one.max(other)] = one.min(other);
                    }
                    None => self.first[cell] = Some(truck),
                }
            }
        }
    }
}

impl Coordinator {
    /// Trucks that may be planned, by regions: their places in the list, ascending.
    pub(super) fn regions(&self, now: Stamp) -> Vec<Vec<usize>> {
        let [low_m, high_m] = self.room.corners_m();
        let long_m = (high_m[0] - low_m[0]).max(high_m[1] - low_m[1]);
        let side_m = CELL_M.max(long_m / MOST_CELLS);
        let count = [0, 1].map(|axis| ((high_m[axis] - low_m[axis]) / side_m) as usize + 1);
        let mut cells = Cells {
            origin_m: low_m,
            side_m,
            count,
            first: vec![None; count[0] * count[1]],
            joined: (0..self.trucks.len()).collect(),
        };
        let planned: Vec<usize> =
            (0..self.trucks.len()).filter(|&index| self.trucks[index].can_be_led(now)).collect();
        for &index in &planned {
            take(&mut cells, index, &self.trucks[index], [low_m, high_m]);
        }
        let mut regions: Vec<Vec<usize>> = vec![Vec::new(); self.trucks.len()];
        for index in planned {
            regions[cells.root(index)].push(index);
        }
        regions.retain(|region| !region.is_empty());
        regions
    }
}

fn take(cells: &mut Cells, index: usize, truck: &Truck, whole: [[f64; 2]; 2]) {
    let reach_m = truck.car().reach_m() + LOOK_OUT_M + KEEP_M;
    let mut around = |one: [f64; 2], other: [f64; 2], more_m: f64| {
        let low = [0, 1].map(|axis: usize| one[axis].min(other[axis]) - more_m);
        let high = [0, 1].map(|axis: usize| one[axis].max(other[axis]) + more_m);
        cells.take(index, low, high);
    };
    let here = [truck.view.pose.x_m, truck.view.pose.y_m];
    around(here, here, reach_m);
    if let Some(route) = &truck.route {
        let rest = &route.way.stands[truck.confirmed()..];
        let rest = if route.live { rest } else { truck.held() };
        for stand in rest.iter().step_by(EVERY).chain(rest.last()) {
            let at = [stand.body.x_m, stand.body.y_m];
            around(at, at, reach_m);
        }
    }
    if let Some((_, goal)) = truck.goal().filter(|_| !truck.is_live()) {
        around(here, [goal.x_m, goal.y_m], reach_m + DETOUR_M);
    }
    if truck.anywhere {
        around(whole[0], whole[1], 0.0);
    }
}
