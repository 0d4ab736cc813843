//! How far each truck may go now, how fast, and for whom it waits.

use super::discretized_path::STEP_M;
use super::job::Block;
use super::order::Order;
use super::separation::{driven_separation_m, separation_m};
use super::truck::Truck;
use std::f64::consts::FRAC_PI_2;
use xtb_nav::geometry::rect::Stand;
use xtb_nav::settings::{CRUISE_MPS, MEETING_MPS};

/// Released ahead of a truck at most, in m: short enough to be replanned soon, long enough to cruise. Chosen,
/// not measured.
const AHEAD_M: f64 = 1.2;
/// Nearer than this the ends of two released stretches count as head-on, in m; chosen, not measured.
const HEAD_ON_M: f64 = 1.2;

/// Lets the truck at `index` go on as far as the order and everything that is driven around allow.
/// True if it may go farther than before.
pub(super) fn grow(trucks: &mut [Truck], index: usize, order: &Order, blocks: &[Block]) -> bool {
    let truck = &trucks[index];
    let Some(route) = truck.route.as_ref().filter(|route| route.live) else { return false };
    let most = (truck.confirmed() + (AHEAD_M / STEP_M) as usize).min(route.way.last());
    let (mut release, mut waits_for) = (route.release, None);
    let separations_m: Vec<f64> = blocks.iter().map(|block| block_separation_m(truck, block)).collect();
    while release < most {
        let next = release + 1;
        let late = trucks.iter().find(|other| {
            other.is_live()
                && order
                    .get(&(truck.id, other.id))
                    .is_some_and(|need| need[next] as usize > other.confirmed())
        });
        let stand = &route.way.stands[next];
        let block = || {
            let met = |(block, separation_m): &(&Block, &f64)| {
                block.id != truck.id
                    && block.stands.iter().any(|there| stand.conflicts(there, **separation_m))
            };
            blocks.iter().zip(&separations_m).find(met).map(|(block, _)| (block.id, false))
        };
        waits_for = late.map(|other| (other.id, true)).or_else(block);
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

/// Whether what is not released yet of a truck's way leads through something.
pub(super) fn meets(truck: &Truck, block: &Block) -> bool {
    let Some(route) = truck.route.as_ref().filter(|route| route.live) else { return false };
    let separation_m = block_separation_m(truck, block);
    let rest = &route.way.stands[route.release + 1..];
    rest.iter().any(|stand| block.stands.iter().any(|there| stand.conflicts(there, separation_m)))
}

fn block_separation_m(truck: &Truck, block: &Block) -> f64 {
    let end: &[Stand] = truck.held();
    driven_separation_m(separation_m(end, &block.stands))
}

/// How fast the truck at `index` may go: slower where another moving one may come head-on.
pub(super) fn cruise_mps(trucks: &[Truck], index: usize) -> f64 {
    let Some(mine) = end(&trucks[index]) else { return CRUISE_MPS };
    let head_on = trucks.iter().enumerate().any(|(other, truck)| {
        let near = |x_m: f64, y_m: f64| libm::hypot(x_m - mine.0, y_m - mine.1) < HEAD_ON_M;
        if other == index || truck.stands() {
            return false;
        }
        match end(truck) {
            Some((x_m, y_m, way_rad)) => near(x_m, y_m) && libm::cos(way_rad - mine.2) < -0.5,
            None => near(truck.view.pose.x_m, truck.view.pose.y_m),
        }
    });
    if head_on { MEETING_MPS } else { CRUISE_MPS }
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
