//! What is driven around: found by the cells of a way, so that no way is held against all of it.

use super::discretized_path::{CELL_M, DiscretizedPath, STEP_M, cell_of};
use super::job::Block;
use super::occupancy::circle;
use super::separation::{driven_separation_m, separation_m};
use super::truck::Truck;
use std::collections::{BTreeMap, BTreeSet};
use xtb_nav::geometry::rect::{LOOK_OUT_M, Stand};

/// What an obstacle is looked at from farther away than bodies and look-out reach, in m: twice what two trucks keep
/// from each other at most.
const SLACK_M: f64 = 0.5;

/// Something that is driven around, and a circle around all of it.
pub(super) struct Obstacle<'a> {
    pub(super) block: &'a Block,
    circle: [f64; 3],
}

impl<'a> Obstacle<'a> {
    fn new(block: &'a Block) -> Self {
        Self { block, circle: circle(block.stands.iter()) }
    }

    /// Whether it can matter within so much way of this place, in m.
    pub(super) fn is_near(&self, stand: &Stand, way_m: f64) -> bool {
        let [x_m, y_m, radius_m] = self.circle;
        let reach_m = stand.body.reach_m() + LOOK_OUT_M + radius_m + SLACK_M;
        libm::hypot(stand.body.x_m - x_m, stand.body.y_m - y_m) < reach_m + way_m
    }
}

/// All that is driven around.
pub(super) struct Obstacles<'a> {
    pub(super) all: Vec<Obstacle<'a>>,
    /// By the cells of ways that may come near them: their places in `all`.
    cells: BTreeMap<(i32, i32), Vec<usize>>,
    /// Larger than the cells tell: looked at for each way.
    large: Vec<usize>,
}

impl<'a> Obstacles<'a> {
    /// For trucks of which none reaches farther from its middle, in m.
    pub(super) fn of(blocks: &'a [Block], reach_m: f64) -> Self {
        let all: Vec<Obstacle<'a>> = blocks.iter().map(Obstacle::new).collect();
        let (mut cells, mut large) = (BTreeMap::<(i32, i32), Vec<usize>>::new(), Vec::new());
        for (index, Obstacle { circle: [x_m, y_m, radius_m], .. }) in all.iter().enumerate() {
            if reach_m + LOOK_OUT_M + radius_m + SLACK_M > CELL_M {
                large.push(index);
                continue;
            }
            let (column, row) = cell_of(*x_m, *y_m);
            for cell in (column - 1..=column + 1).flat_map(|x| (row - 1..=row + 1).map(move |y| (x, y))) {
                cells.entry(cell).or_default().push(index);
            }
        }
        Self { all, cells, large }
    }

    /// Those that may be near a way.
    fn along(&self, way: &DiscretizedPath) -> impl Iterator<Item = &Obstacle<'a>> {
        let near = way.cells().iter().filter_map(|cell| self.cells.get(cell)).flatten();
        let indices: BTreeSet<usize> = near.chain(&self.large).copied().collect();
        indices.into_iter().map(|index| &self.all[index])
    }

    /// Whether what is not released yet of a truck's way leads through another one, within so many m of way; `None` =
    /// through this one it may.
    pub(super) fn meet(&self, truck: &Truck, within_m: impl Fn(u32) -> Option<f64>) -> bool {
        let Some(route) = truck.route.as_ref().filter(|route| route.live) else { return false };
        let mut others = self.along(&route.way).filter(|there| there.block.id != truck.id);
        others.any(|there| within_m(there.block.id).is_some_and(|within_m| meets(truck, there, within_m)))
    }
}

/// Whether what is not released yet of a truck's way leads through something, within so many m.
fn meets(truck: &Truck, there: &Obstacle<'_>, within_m: f64) -> bool {
    let Some(route) = truck.route.as_ref().filter(|route| route.live) else { return false };
    let most = (within_m / STEP_M) as usize;
    let rest = route.way.stands[route.release + 1..].iter().take(most);
    let mut rest = rest.filter(|stand| there.is_near(stand, 0.0));
    let Some(first) = rest.next() else { return false };
    let separation_m = block_separation_m(truck, there.block);
    let meets = |stand: &Stand| there.block.stands.iter().any(|there| stand.conflicts(there, separation_m));
    meets(first) || rest.any(meets)
}

pub(super) fn block_separation_m(truck: &Truck, block: &Block) -> f64 {
    let end: &[Stand] = truck.held();
    driven_separation_m(separation_m(end, &block.stands))
}
