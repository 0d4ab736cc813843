//! Priorities: who gives way to whom. Each car is planned alone first; where two touch, one of them has
//! to give way, and it and those below it are planned anew. Depth first, the better choice first.

use super::cars::{Cars, bits};
use super::plans::Plans;
use super::query::{ANY, Manner, Rank};
use super::table::Track;
use std::rc::Rc;

/// Choices that are looked at, for each car; chosen, not measured.
const CHOICES_PER_CAR: usize = 8;
/// Nodes of one search; chosen, not measured.
const NODES: u32 = 12_000;
/// Steps that a car would rather lose than be for one in the way of a car that need not give way to it;
/// chosen, not measured.
const CLASH_STEPS: u32 = 2;
/// How much the estimate is trusted, in percent: ways are found sooner and may cost up to twice as much;
/// chosen, not measured.
const HEURISTIC_WEIGHT: u32 = 200;

/// A choice: tracks, and who stands above whom.
#[derive(Debug, Clone)]
struct Choice {
    tracks: Vec<Rc<Track>>,
    /// For each car those above it, and those above these.
    above: Vec<Cars>,
    pairs: usize,
    flowtime: usize,
}

/// Looks for priorities under which all get through. The best choice stays in `plans`, whether it
/// solves everything or not.
pub(crate) fn run(plans: &mut Plans<'_>, keep_going: &mut dyn FnMut() -> bool) {
    let Some(root) = root(plans, keep_going) else { return };
    let mut best = root.clone();
    let mut stack = vec![root];
    for _ in 0..CHOICES_PER_CAR * plans.cars() {
        let Some(choice) = stack.pop() else { break };
        if !keep_going() {
            break;
        }
        choose(plans, &choice);
        if choice.pairs < best.pairs {
            best = choice.clone();
        }
        let Some((a, b)) = first_pair(plans) else { return };
        let mut children: Vec<Choice> = [(a, b), (b, a)]
            .into_iter()
            .filter_map(|(below, above)| child(plans, &choice, below, above, keep_going))
            .collect();
        // The last one is looked at next.
        children.sort_by_key(|child| std::cmp::Reverse((child.pairs, child.flowtime)));
        stack.extend(children);
    }
    choose(plans, &best);
}

fn root(plans: &mut Plans<'_>, keep_going: &mut dyn FnMut() -> bool) -> Option<Choice> {
    let mut order: Vec<usize> = (0..plans.cars()).collect();
    plans.shuffle(&mut order);
    for car in order {
        if !keep_going() {
            return None;
        }
        let ranks = vec![Rank::Soft; plans.cars()];
        let track = plans.search(car, &ranks, &[], MANNER)?;
        plans.put(car, track);
    }
    let tracks = (0..plans.cars()).map(|car| plans.table.track(car).cloned()).collect::<Option<_>>()?;
    let above = vec![0; plans.cars()];
    Some(Choice { tracks, above, pairs: plans.pairs(), flowtime: plans.flowtime() })
}

/// Of these.
const MANNER: Manner = Manner {
    clash_steps: CLASH_STEPS,
    heuristic_weight: HEURISTIC_WEIGHT,
    most_nodes: NODES,
    most_steps: ANY,
};

/// Puts the tracks of a choice in place.
fn choose(plans: &mut Plans<'_>, choice: &Choice) {
    for (car, track) in choice.tracks.iter().enumerate() {
        if !plans.table.track(car).is_some_and(|known| Rc::ptr_eq(known, track)) {
            plans.put(car, track.clone());
        }
    }
}

/// The pair that touches first.
fn first_pair(plans: &Plans<'_>) -> Option<(usize, usize)> {
    let pairs =
        (0..plans.cars()).flat_map(|a| bits(plans.clashes(a)).filter(move |&b| a < b).map(move |b| (a, b)));
    pairs.min_by_key(|&(a, b)| plans.first_clash(a, b))
}

/// The same with one car giving way to another: it, and all below it that are now in the way of one
/// above them, get new tracks. `None` if one of them finds none.
fn child(
    plans: &mut Plans<'_>,
    parent: &Choice,
    below: usize,
    above: usize,
    keep_going: &mut dyn FnMut() -> bool,
) -> Option<Choice> {
    if parent.above[above] >> below & 1 == 1 {
        return None;
    }
    choose(plans, parent);
    let mut order = parent.above.clone();
    let raised = order[above] | 1 << above;
    for (car, over) in order.iter_mut().enumerate() {
        if car == below || *over >> below & 1 == 1 {
            *over |= raised;
        }
    }
    // Those with fewer above them first: nobody is planned before one that stands above it.
    let mut affected: Vec<usize> =
        (0..plans.cars()).filter(|&car| car == below || order[car] >> below & 1 == 1).collect();
    affected.sort_by_key(|&car| (order[car].count_ones(), car));
    for car in affected {
        if plans.clashes(car) & order[car] == 0 {
            continue;
        }
        if !keep_going() {
            return None;
        }
        let rank = |other: usize| if order[car] >> other & 1 == 1 { Rank::Hard } else { Rank::Soft };
        let ranks: Vec<Rank> = (0..plans.cars()).map(rank).collect();
        let track = plans.search(car, &ranks, &[], MANNER)?;
        plans.put(car, track);
    }
    let tracks = (0..plans.cars()).map(|car| plans.table.track(car).cloned()).collect::<Option<_>>()?;
    Some(Choice { tracks, above: order, pairs: plans.pairs(), flowtime: plans.flowtime() })
}
