//! How far each truck may go now, how fast, and for whom it waits.

use super::discretized_path::STEP_M;
use super::job::Block;
use super::obstacles::{Obstacle, block_separation_m};
use super::order::{Needs, Order, needs_of};
use super::truck::{Truck, place_of};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use xtb_nav::settings::{CRUISE_MPS, MEETING_MPS};

/// Released ahead of a truck at most, in m: short enough to be replanned soon, long enough to cruise. Chosen,
/// not measured.
const AHEAD_M: f64 = 1.2;
/// Nearer than this the ends of two released stretches count as head-on, in m; chosen, not measured.
const HEAD_ON_M: f64 = 1.2;
/// No cell is farther from the map's origin.
const FARTHEST: i32 = 1 << 20;

/// Lets the truck at `index` go on as far as the order and everything that is driven around allow.
/// True if it may go farther than before.
pub(super) fn grow(trucks: &mut [Truck], index: usize, order: &Order, obstacles: &[Obstacle<'_>]) -> bool {
    let truck = &trucks[index];
    let Some(route) = truck.route.as_ref().filter(|route| route.live) else { return false };
    let most = (truck.confirmed() + (AHEAD_M / STEP_M) as usize).min(route.way.last());
    let (mut release, mut waits_for) = (route.release, None);
    let way_m = most.saturating_sub(release) as f64 * STEP_M;
    let may_matter = |there: &&Obstacle<'_>| {
        there.block.id != truck.id && there.is_near(&route.way.stands[release], way_m)
    };
    let near: Vec<(&Block, f64)> = obstacles
        .iter()
        .filter(may_matter)
        .map(|there| (there.block, block_separation_m(truck, there.block)))
        .collect();
    let before = |(id, needs)| {
        let other = &trucks[place_of(trucks, id)?];
        other.is_live().then(|| (id, needs, other.confirmed()))
    };
    let needs: Vec<(u32, &Needs, usize)> = needs_of(order, truck.id).filter_map(before).collect();
    while release < most {
        let next = release + 1;
        let late = needs.iter().find(|(_, needs, reached)| needs.at(next) > *reached);
        let stand = &route.way.stands[next];
        let block = || {
            let met = |(block, separation_m): &&(&Block, f64)| {
                block.stands.iter().any(|there| stand.conflicts(there, *separation_m))
            };
            near.iter().find(met).map(|(block, _)| (block.id, false))
        };
        waits_for = late.map(|&(id, ..)| (id, true)).or_else(block);
        if waits_for.is_some() {
            break;
        }
        release = next;
    }
    let grown = release > route.release;
    let release_m = route.way.at_m(release).max(route.release_m);
    let truck = &mut trucks[index];
    truck.waits_for = waits_for;
    if let Some(route) = truck.route.as_mut() {
        (route.release, route.release_m) = (release, release_m);
    }
    grown
}

/// Where those go that move, by cells of [`HEAD_ON_M`].
pub(super) struct Heads {
    cells: BTreeMap<(i32, i32), Vec<usize>>,
}

impl Heads {
    pub(super) fn of(trucks: &[Truck]) -> Self {
        let mut cells: BTreeMap<(i32, i32), Vec<usize>> = BTreeMap::new();
        for (index, truck) in trucks.iter().enumerate().filter(|(_, truck)| !truck.stands()) {
            let (x_m, y_m, _) = end(truck).unwrap_or((truck.view.pose.x_m, truck.view.pose.y_m, 0.0));
            cells.entry(cell(x_m, y_m)).or_default().push(index);
        }
        Self { cells }
    }

    /// How fast the truck at `index` may go: slower where another moving one may come head-on.
    pub(super) fn cruise_mps(&self, trucks: &[Truck], index: usize) -> f64 {
        let Some(mine) = end(&trucks[index]) else { return CRUISE_MPS };
        let near = |x_m: f64, y_m: f64| libm::hypot(x_m - mine.0, y_m - mine.1) < HEAD_ON_M;
        let is_head_on = |other: &usize| match end(&trucks[*other]) {
            _ if *other == index => false,
            Some((x_m, y_m, way_rad)) => near(x_m, y_m) && libm::cos(way_rad - mine.2) < -0.5,
            None => near(trucks[*other].view.pose.x_m, trucks[*other].view.pose.y_m),
        };
        let (column, row) = cell(mine.0, mine.1);
        let around = (column - 1..=column + 1).flat_map(|x| (row - 1..=row + 1).map(move |y| (x, y)));
        let mut others = around.filter_map(|cell| self.cells.get(&cell)).flatten();
        if others.any(is_head_on) { MEETING_MPS } else { CRUISE_MPS }
    }
}

fn cell(x_m: f64, y_m: f64) -> (i32, i32) {
    let along = |v: f64| (libm::floor(v / HEAD_ON_M) as i32).clamp(-FARTHEST, FARTHEST);
    (along(x_m), along(y_m))
}

/// Where a truck's released stretch ends, and which way it goes there.
fn end(truck: &Truck) -> Option<(f64, f64, f64)> {
    let route = truck.route.as_ref()?;
    let stand = route.way.stands[route.release];
    let before = route.way.stands[route.release.saturating_sub(2)];
    let (dx, dy) = (stand.body.x_m - before.body.x_m, stand.body.y_m - before.body.y_m);
    let way_rad = if dx == 0.0 && dy == 0.0 { FRAC_PI_2 } else { libm::atan2(dy, dx) };
    Some((stand.body.x_m, stand.body.y_m, way_rad))
}
