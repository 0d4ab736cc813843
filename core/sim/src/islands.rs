//! Which bodies can come near which before anybody has gone far, and so which trucks can go on by themselves.
//!
//! Each body gets a list of those that it could see or touch while none of the two moves farther than its
//! margin. Bodies that are linked by such lists, directly or by others, are an island: what happens on it for
//! as long depends on nothing beyond it.

use crate::geometry::{Bounds, OrientedBox};
use crate::grid::{Cells, MovingGrid};

const NONE: u32 = u32::MAX;

/// How far a body can go: in the steps that begin now, and in as many as lists shall hold for.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Ways {
    pub(crate) now_m: f64,
    pub(crate) later_m: f64,
}

/// The lists and the islands, as of where the bodies were when they were made.
#[derive(Debug, Clone)]
pub(crate) struct Islands {
    grid: MovingGrid,
    /// Within this distance of their centres two bodies could matter to each other.
    reach_m: f64,
    /// Where they were, and how far each may go from there.
    centres: Vec<(f64, f64)>,
    margins_m: Vec<f64>,
    /// `near[starts[n]..starts[n + 1]]` are those near body n.
    starts: Vec<u32>,
    near: Vec<u32>,
    /// The bodies, island after island, and the place of each among them.
    order: Vec<u32>,
    places: Vec<u32>,
    /// The first place of each island, and behind the last one how many bodies there are.
    firsts: Vec<u32>,
}

impl Islands {
    /// Lists that hold until a body has gone farther than its margin.
    pub(crate) fn new(cells: Cells, reach_m: f64, bodies: &[OrientedBox], ways: &[Ways]) -> Self {
        let mut islands = Self {
            grid: MovingGrid::new(cells),
            reach_m,
            centres: Vec::new(),
            margins_m: Vec::new(),
            starts: Vec::new(),
            near: Vec::new(),
            order: Vec::new(),
            places: Vec::new(),
            firsts: Vec::new(),
        };
        islands.make(bodies, ways);
        islands
    }

    /// From now on bodies could matter to each other within so much more.
    pub(crate) fn reach_farther(&mut self, more_m: f64) {
        self.reach_m += more_m;
        self.centres.clear();
    }

    /// The lists hold from now on while nobody goes farther than it can; they are made anew where they have to
    /// be. Whether they were. Allocates nothing once they have had their length.
    pub(crate) fn update(&mut self, bodies: &[OrientedBox], ways: &[Ways]) -> bool {
        let still = |n: usize| {
            let ((x_m, y_m), (then_x_m, then_y_m)) = (bodies[n].centre_m(), self.centres[n]);
            let (dx_m, dy_m, left_m) = (x_m - then_x_m, y_m - then_y_m, self.margins_m[n] - ways[n].now_m);
            left_m >= 0.0 && dx_m * dx_m + dy_m * dy_m <= left_m * left_m
        };
        let holds = bodies.len() == self.centres.len() && (0..bodies.len()).all(still);
        if !holds {
            self.make(bodies, ways);
        }
        !holds
    }

    fn make(&mut self, bodies: &[OrientedBox], ways: &[Ways]) {
        self.centres.clear();
        self.centres.extend(bodies.iter().map(OrientedBox::centre_m));
        self.margins_m.clear();
        self.margins_m.extend(ways.iter().map(|ways| ways.now_m.max(ways.later_m)));
        self.grid.rebuild(&self.centres);
        let most_m = self.margins_m.iter().copied().fold(0.0, f64::max);
        let Self { grid, centres, margins_m, starts, near, reach_m, .. } = self;
        near.clear();
        starts.clear();
        for (n, &(x_m, y_m)) in centres.iter().enumerate() {
            starts.push(near.len() as u32);
            // A hair more than the sum below, however that is rounded: both of a pair find each other.
            let side_m = 2.0 * (*reach_m + margins_m[n] + most_m + 1e-6);
            grid.near(Bounds::around(x_m, y_m, side_m, side_m), |other| {
                // The same sum for both of them.
                let far_m = *reach_m + (margins_m[n] + margins_m[other]);
                let (dx_m, dy_m) = (x_m - centres[other].0, y_m - centres[other].1);
                if other != n && dx_m * dx_m + dy_m * dy_m <= far_m * far_m {
                    near.push(other as u32);
                }
            });
        }
        starts.push(near.len() as u32);
        self.divide();
    }

    /// Follows the lists from body to body.
    fn divide(&mut self) {
        let count = self.centres.len();
        self.order.clear();
        self.firsts.clear();
        self.places.clear();
        self.places.resize(count, NONE);
        for n in 0..count {
            if self.places[n] != NONE {
                continue;
            }
            let mut next = self.order.len();
            self.firsts.push(next as u32);
            self.land(n);
            while let Some(&of) = self.order.get(next) {
                next += 1;
                for at in self.starts[of as usize]..self.starts[of as usize + 1] {
                    let other = self.near[at as usize] as usize;
                    if self.places[other] == NONE {
                        self.land(other);
                    }
                }
            }
        }
        self.firsts.push(count as u32);
    }

    fn land(&mut self, n: usize) {
        self.places[n] = self.order.len() as u32;
        self.order.push(n as u32);
    }

    /// Those that body n could see or touch.
    pub(crate) fn near(&self, n: usize) -> impl Iterator<Item = usize> + '_ {
        let range = self.starts[n] as usize..self.starts[n + 1] as usize;
        self.near[range].iter().map(|&other| other as usize)
    }

    /// The place of body n among all, island after island.
    pub(crate) fn place(&self, n: usize) -> usize {
        self.places[n] as usize
    }

    /// The bodies, island after island.
    pub(crate) fn order(&self) -> impl Iterator<Item = usize> + '_ {
        self.order.iter().map(|&n| n as usize)
    }

    /// How many bodies each island has, in their order.
    pub(crate) fn sizes(&self) -> impl Iterator<Item = usize> + '_ {
        self.firsts.windows(2).map(|ends| (ends[1] - ends[0]) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    fn square(x_m: f64, y_m: f64) -> OrientedBox {
        OrientedBox::new(x_m, y_m, 0.0, 0.4, 0.4)
    }

    fn islands(reach_m: f64, margin_m: f64, bodies: &[OrientedBox]) -> Islands {
        let cells = Cells::covering(Bounds::around(0.0, 0.0, 20.0, 20.0));
        Islands::new(cells, reach_m, bodies, &ways(bodies, margin_m, margin_m))
    }

    fn ways(bodies: &[OrientedBox], now_m: f64, later_m: f64) -> Vec<Ways> {
        vec![Ways { now_m, later_m }; bodies.len()]
    }

    #[test]
    fn lists_name_all_within_reach_and_islands_have_no_link_between_them() {
        let mut noise = Rng::new(5, 0);
        // Some beyond the grid's edge.
        let bodies: Vec<_> =
            (0..200).map(|_| square(noise.uniform(-14.0, 14.0), noise.uniform(-14.0, 14.0))).collect();
        let islands = islands(1.0, 0.1, &bodies);
        let centres: Vec<_> = bodies.iter().map(OrientedBox::centre_m).collect();
        for (n, &(x_m, y_m)) in centres.iter().enumerate() {
            let near = |(other, &(ox_m, oy_m)): (usize, &(f64, f64))| {
                (other != n && libm::hypot(x_m - ox_m, y_m - oy_m) <= 1.2).then_some(other)
            };
            let expected: Vec<_> = centres.iter().enumerate().filter_map(near).collect();
            let mut found: Vec<_> = islands.near(n).collect();
            found.sort_unstable();
            assert_eq!(found, expected);
        }
        let order: Vec<_> = islands.order().collect();
        let mut island_of = vec![0; bodies.len()];
        let mut first = 0;
        for (island, size) in islands.sizes().enumerate() {
            order[first..first + size].iter().for_each(|&n| island_of[n] = island);
            first += size;
        }
        assert_eq!(first, bodies.len());
        assert!(islands.sizes().count() > 20 && islands.sizes().any(|size| size > 2));
        for n in 0..bodies.len() {
            assert_eq!(order[islands.place(n)], n);
            assert!(islands.near(n).all(|other| island_of[other] == island_of[n]));
        }
    }

    #[test]
    fn lists_are_made_anew_when_somebody_has_gone_too_far_or_somebody_comes() {
        let mut bodies = vec![square(0.0, 0.0), square(3.0, 0.0)];
        let mut islands = islands(1.0, 0.2, &bodies);
        assert!(!islands.update(&bodies, &ways(&bodies, 0.2, 0.2)));
        bodies[1] = square(2.9, 0.0);
        assert!(!islands.update(&bodies, &ways(&bodies, 0.05, 0.2)));
        assert!(islands.update(&bodies, &ways(&bodies, 0.15, 0.2)), "only 0.05 m are left");
        assert!(!islands.update(&bodies, &ways(&bodies, 0.15, 0.2)));
        bodies.push(square(3.5, 0.0));
        assert!(islands.update(&bodies, &ways(&bodies, 0.0, 0.2)));
        assert_eq!(islands.sizes().collect::<Vec<_>>(), [1, 2]);
        assert_eq!(islands.near(1).collect::<Vec<_>>(), [2]);
        islands.reach_farther(2.0);
        assert!(islands.update(&bodies, &ways(&bodies, 0.0, 0.2)));
        assert_eq!(islands.sizes().collect::<Vec<_>>(), [3]);
    }
}
