//! Small groups for which no order of priorities works: conflict-based search. Where two of the group
//! touch, either the one or the other must avoid that one move; each choice is planned, the cheapest
//! looked at next. Everybody outside of the group is a wall.

use super::plans::{Manner, Plans};
use super::search::{Ghost, Rank};
use super::table::Track;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::rc::Rc;

/// Most cars of a group: the choices double with each move that is forbidden.
pub(crate) const MOST: usize = 3;
/// Choices that are looked at.
const MOST_CHOICES: usize = 60;
/// Nodes of one search.
const MANNER: Manner = Manner { clash_steps: 1, greed: 110, most_nodes: 4_000 };

/// Tracks of the group, and what each of its cars must avoid.
#[derive(Debug, Clone)]
struct Choice {
    tracks: Vec<Rc<Track>>,
    avoid: Vec<Vec<Ghost>>,
}

/// Plans the group anew around all others. If that fails everything stays as it was.
pub(crate) fn run(plans: &mut Plans<'_>, group: &[usize], keep_going: &mut dyn FnMut() -> bool) -> bool {
    let old: Vec<_> = group.iter().map(|&car| plans.take(car)).collect();
    let found = choices(plans, group, keep_going).is_some();
    if !found {
        for (&car, track) in group.iter().zip(old) {
            plans.take(car);
            if let Some(track) = track {
                plans.put(car, track);
            }
        }
    }
    found
}

/// Leaves the tracks in place that solve it.
fn choices(plans: &mut Plans<'_>, group: &[usize], keep_going: &mut dyn FnMut() -> bool) -> Option<()> {
    let mut tracks = Vec::with_capacity(group.len());
    for &car in group {
        tracks.push(search(plans, group, car, &[])?);
    }
    let mut known = vec![Choice { tracks, avoid: vec![Vec::new(); group.len()] }];
    let mut open = BinaryHeap::from([Reverse((known[0].steps(), 0))]);
    for _ in 0..MOST_CHOICES {
        let Reverse((_, index)) = open.pop()?;
        if !keep_going() {
            return None;
        }
        let choice = known[index].clone();
        for (&car, track) in group.iter().zip(&choice.tracks) {
            plans.put(car, track.clone());
        }
        let Some((first, second, step)) = clash(plans, group) else { return Some(()) };
        for (one, other) in [(first, second), (second, first)] {
            let mut child = choice.clone();
            child.avoid[one].push(plans.ghost(group[other], step)?);
            // The search must not see the one's own old track, and it never does.
            let Some(track) = search(plans, group, group[one], &child.avoid[one]) else { continue };
            child.tracks[one] = track;
            open.push(Reverse((child.steps(), known.len())));
            known.push(child);
        }
    }
    None
}

impl Choice {
    fn steps(&self) -> usize {
        self.tracks.iter().map(|track| track.steps()).sum()
    }
}

/// A track around everybody outside of the group.
fn search(plans: &mut Plans<'_>, group: &[usize], car: usize, avoid: &[Ghost]) -> Option<Rc<Track>> {
    let mut ranks = vec![Rank::Hard; plans.cars()];
    for &member in group {
        ranks[member] = Rank::Soft;
    }
    plans.search(car, &ranks, avoid, MANNER)
}

/// The first contact within the group: two places in it, and the step.
fn clash(plans: &Plans<'_>, group: &[usize]) -> Option<(usize, usize, usize)> {
    let pairs = (0..group.len()).flat_map(|a| (a + 1..group.len()).map(move |b| (a, b)));
    let clashes = pairs.filter_map(|(a, b)| Some((a, b, plans.first_clash(group[a], group[b])?)));
    clashes.min_by_key(|&(_, _, step)| step)
}
