//! Repair: all cars have a way, some are in each other's way; a few at a time get new ways, and what
//! comes out is kept unless more pairs touch than before.
//!
//! A neighbourhood is chosen around a car that is in somebody's way: those it touches and those they
//! touch, those that stand in its best way, or those that are near it somewhere.

use super::cars::{Cars, bits};
use super::groups;
use super::motion::Spot;
use super::plans::Plans;
use super::query::{ANY, Manner, Rank};
use super::table::Track;
use std::rc::Rc;

/// Cars of a neighbourhood at least …
const FEWEST: usize = 2;
/// … and at most; both chosen, not measured.
const MOST: usize = 8;
/// Nodes of one search, …
const NODES: u32 = 4_000;
/// … and how they grow while nothing gets better: doubled …
const MOST_NODES: u32 = 64_000;
/// … after so many rounds in vain. All chosen, not measured.
const PATIENCE: usize = 20;
/// How patient a car is: steps that it would rather lose than be in another's way for one; and the more it
/// may have to wait, the more it must trust its heuristic, or it looks at every way of passing the time.
/// Chosen, not measured.
const TEMPERS: [(u32, u32); 3] = [(8, 130), (20, 200), (60, 400)];
/// For a way without the others: as the least patient trusts it.
const HEURISTIC_WEIGHT: u32 = TEMPERS[0].1;

/// Works until nobody is in anybody's way, the rounds are used up, or it is told to stop.
pub(crate) fn run(plans: &mut Plans<'_>, most_rounds: usize, keep_going: &mut dyn FnMut() -> bool) {
    complete(plans, keep_going);
    let mut fruitless = 0;
    for _ in 0..most_rounds {
        if plans.solved() || !keep_going() {
            return;
        }
        let before = plans.pairs() + plans.missing().len();
        let nodes = (NODES << (fruitless / PATIENCE).min(8)).min(MOST_NODES);
        round(plans, nodes, keep_going);
        fruitless = if plans.pairs() + plans.missing().len() < before { 0 } else { fruitless + 1 };
    }
}

/// Gives every car without one a track, whoever is in its way.
fn complete(plans: &mut Plans<'_>, keep_going: &mut dyn FnMut() -> bool) {
    let mut missing = plans.missing();
    plans.shuffle(&mut missing);
    for car in missing {
        if !keep_going() {
            return;
        }
        if let Some(track) = soft(plans, car, TEMPERS[0], NODES).or_else(|| alone(plans, car)) {
            plans.put(car, track);
        }
    }
}

fn soft(
    plans: &mut Plans<'_>,
    car: usize,
    (clash_steps, heuristic_weight): (u32, u32),
    most_nodes: u32,
) -> Option<Rc<Track>> {
    let ranks = vec![Rank::Soft; plans.cars()];
    plans.search(car, &ranks, &[], Manner { clash_steps, heuristic_weight, most_nodes, most_steps: ANY })
}

/// The way that a car would take without all others.
pub(crate) fn alone(plans: &mut Plans<'_>, car: usize) -> Option<Rc<Track>> {
    let ranks = vec![Rank::Ignored; plans.cars()];
    plans.search(
        car,
        &ranks,
        &[],
        Manner {
            clash_steps: 0,
            heuristic_weight: HEURISTIC_WEIGHT,
            most_nodes: MOST_NODES,
            most_steps: ANY,
        },
    )
}

/// New ways for one neighbourhood; the old ones come back if they were better.
fn round(plans: &mut Plans<'_>, nodes: u32, keep_going: &mut dyn FnMut() -> bool) {
    let mut group = neighbourhood(plans);
    plans.shuffle(&mut group);
    if group.len() <= groups::MOST && nodes > NODES && plans.draw(2) == 0 {
        // Orders were tried often enough: perhaps there is none.
        groups::run(plans, &group, keep_going);
        return;
    }
    let before = plans.pairs();
    let old: Vec<_> = group.iter().map(|&car| plans.take(car)).collect();
    let temper = TEMPERS[plans.draw(TEMPERS.len())];
    let mut complete = true;
    for &car in &group {
        let track = if keep_going() { soft(plans, car, temper, nodes) } else { None };
        let Some(track) = track else {
            complete = false;
            break;
        };
        plans.put(car, track);
        if plans.pairs() > before {
            complete = false;
            break;
        }
    }
    if !complete {
        for (&car, track) in group.iter().zip(old) {
            plans.take(car);
            if let Some(track) = track {
                plans.put(car, track);
            }
        }
    }
}

fn neighbourhood(plans: &mut Plans<'_>) -> Vec<usize> {
    let mut troubled = plans.clashing();
    troubled.extend(plans.missing());
    let pick = plans.draw(troubled.len());
    let Some(&seed) = troubled.get(pick) else { return Vec::new() };
    let size = (FEWEST + plans.draw(MOST - FEWEST + 1)).min(plans.cars());
    let mut group: Cars = 1 << seed;
    match plans.draw(3) {
        0 => touching(plans, &mut group, size),
        1 => in_the_way(plans, seed, &mut group, size),
        _ => {}
    }
    nearby(plans, &mut group, size);
    bits(group).collect()
}

/// Those in the way of the group, and those in their way.
fn touching(plans: &mut Plans<'_>, group: &mut Cars, size: usize) {
    while (group.count_ones() as usize) < size {
        let next: Vec<usize> =
            bits(bits(*group).fold(0, |cars, car| cars | plans.clashes(car)) & !*group).collect();
        if next.is_empty() {
            return;
        }
        *group |= 1 << next[plans.draw(next.len())];
    }
}

/// Those that the car would meet on its best way.
pub(super) fn in_the_way(plans: &mut Plans<'_>, car: usize, group: &mut Cars, size: usize) {
    let Some(track) = alone(plans, car) else { return };
    let mut met: Vec<usize> = bits(plans.met_by(car, &track)).collect();
    plans.shuffle(&mut met);
    for other in met.into_iter().take(size.saturating_sub(1)) {
        *group |= 1 << other;
    }
}

/// Fills up with those that come near one of the group somewhere, and with anybody in the end.
pub(super) fn nearby(plans: &mut Plans<'_>, group: &mut Cars, size: usize) {
    /// Then it takes anybody; chosen, not measured.
    const TRIES: usize = 20;
    /// Ways that two cars drive in two steps each; chosen, not measured.
    const NEAR_STEPS: f64 = 4.0;
    let near = plans.instance.step * NEAR_STEPS + 2.0 * plans.instance.reach;
    for _ in 0..TRIES {
        if group.count_ones() as usize >= size {
            return;
        }
        let members: Vec<usize> = bits(*group).collect();
        let member = members[plans.draw(members.len())];
        let Some(track) = plans.table.track(member).cloned() else { continue };
        let step = plans.draw(track.steps() + 1);
        let here = *track.at(step).0;
        let close = |there: &Spot| libm::hypot(there.x - here.x, there.y - here.y) < near;
        let others = (0..plans.cars()).filter(|&car| *group >> car & 1 == 0);
        let there = |car: &usize| plans.table.track(*car).is_some_and(|track| close(track.at(step).0));
        let found: Vec<usize> = others.filter(there).collect();
        if !found.is_empty() {
            *group |= 1 << found[plans.draw(found.len())];
        }
    }
    while (group.count_ones() as usize) < size {
        *group |= 1 << plans.draw(plans.cars());
    }
}

/// Shortens ways where the others leave room, once around.
pub(crate) fn polish(plans: &mut Plans<'_>, keep_going: &mut dyn FnMut() -> bool) {
    let mut order: Vec<usize> = (0..plans.cars()).collect();
    plans.shuffle(&mut order);
    let ranks = vec![Rank::Hard; plans.cars()];
    for car in order {
        if !keep_going() {
            return;
        }
        let manner = Manner { clash_steps: 0, heuristic_weight: 100, most_nodes: NODES, most_steps: ANY };
        let Some(track) = plans.search(car, &ranks, &[], manner) else { continue };
        if plans.table.track(car).is_some_and(|old| track.steps() < old.steps()) {
            plans.put(car, track);
        }
    }
}
