//! Improvement: nobody is in anybody's way any more, and schedules get shorter, a few cars at a time; a
//! neighbourhood's new ways are kept unless the last arrival or the sum of arrivals grows (J. Li et al.,
//! *Anytime Multi-Agent Path Finding via Large Neighborhood Search*, IJCAI 2021).

use super::cars::{Cars, bits};
use super::plans::Plans;
use super::query::{ANY, Manner, Rank};
use super::repair;

/// Cars of a neighbourhood at least …
const FEWEST: usize = 2;
/// … and at most, at first; both chosen, not measured.
const MOST: usize = 8;
/// One search, nearly the shortest way; chosen, not measured.
const MANNER: Manner = Manner { clash_steps: 0, heuristic_weight: 105, most_nodes: 4_000, most_steps: ANY };
/// By so many steps the heuristic may say too much; chosen, not measured.
const TOO_MUCH: usize = 2;
/// Neighbourhoods in vain, for each car, after which they become larger; chosen, not measured.
const PATIENCE: usize = 4;

/// What is to become less: the last arrival, and the sum of arrivals, in steps.
type Cost = (usize, usize);

/// Works until it is told to stop, or neighbourhoods of all cars found nothing either; tells how often something got
/// better. After a round in vain neighbourhoods are twice as large, and their searches may take twice as long.
pub(crate) fn run(plans: &mut Plans<'_>, keep_going: &mut dyn FnMut() -> bool) -> usize {
    let (mut improved, mut fruitless, mut larger) = (0, 0, 1);
    while keep_going() {
        let group = neighbourhood(plans, MOST * larger);
        let better = replan(plans, &group, larger, keep_going);
        improved += usize::from(better);
        fruitless = if better { 0 } else { fruitless + 1 };
        if fruitless >= PATIENCE * plans.cars() {
            if MOST * larger >= plans.cars() {
                break;
            }
            (fruitless, larger) = (0, larger * 2);
        }
    }
    improved
}

fn cost(plans: &Plans<'_>) -> Cost {
    (plans.table.steps(), plans.flowtime())
}

/// A car that loses time, and others that may be why.
fn neighbourhood(plans: &mut Plans<'_>, most: usize) -> Vec<usize> {
    let seed = late(plans);
    let size = (FEWEST + plans.draw(most - FEWEST + 1)).min(plans.cars());
    let mut group: Cars = 1 << seed;
    if plans.draw(2) == 0 {
        repair::in_the_way(plans, seed, &mut group, size);
    }
    if plans.draw(4) > 0 {
        repair::nearby(plans, &mut group, size);
    }
    let mut group: Vec<usize> = bits(group).collect();
    plans.shuffle(&mut group);
    group
}

/// Now and then the one that arrives last, otherwise one by the steps that it loses to the others.
fn late(plans: &mut Plans<'_>) -> usize {
    let steps: Vec<usize> =
        (0..plans.cars()).map(|car| plans.table.track(car).map_or(0, |track| track.steps())).collect();
    if plans.draw(4) == 0 {
        return (0..steps.len()).max_by_key(|&car| steps[car]).unwrap_or(0);
    }
    let instance = plans.instance;
    let lost = |car: usize| steps[car].saturating_sub(instance.alone[car]) + 1;
    let all = (0..steps.len()).map(lost).sum();
    let mut pick = plans.draw(all);
    for car in 0..steps.len() {
        match pick.checked_sub(lost(car)) {
            Some(left) => pick = left,
            None => return car,
        }
    }
    0
}

/// New ways for these cars around all others; the old ones come back unless nothing grew. Tells whether
/// something became less.
fn replan(
    plans: &mut Plans<'_>,
    group: &[usize],
    larger: usize,
    keep_going: &mut dyn FnMut() -> bool,
) -> bool {
    let before = cost(plans);
    let old: Vec<_> = group.iter().map(|&car| plans.take(car)).collect();
    let ranks = vec![Rank::Hard; plans.cars()];
    let alone = |car: &usize| plans.instance.alone[*car];
    let mut spare = (before.1 - plans.flowtime()).saturating_sub(group.iter().map(alone).sum());
    let found = group.iter().all(|&car| {
        let alone = plans.instance.alone[car];
        let most = (alone + spare).min(before.0);
        let most_nodes = MANNER.most_nodes * larger as u32;
        let manner = Manner { most_steps: (most + TOO_MUCH) as u32, most_nodes, ..MANNER };
        let track = if keep_going() { plans.search(car, &ranks, &[], manner) } else { None };
        let Some(track) = track.filter(|track| track.steps() <= most) else { return false };
        spare = (alone + spare) - track.steps();
        plans.put(car, track);
        true
    });
    let after = cost(plans);
    if found && after.0 <= before.0 && after.1 <= before.1 {
        return after < before;
    }
    for (&car, track) in group.iter().zip(old) {
        plans.take(car);
        if let Some(track) = track {
            plans.put(car, track);
        }
    }
    false
}
