//! Conflict-based search, as joint plans offline and live traffic control both use it.
//!
//! Each of a small group has a way that minds none of the others. Where two of them meet first, either
//! the one or the other must avoid that part of the other's way; each choice is planned, the cheapest is
//! looked at next. So it finds ways that no order of priorities has: one that goes first in the end may
//! have made room before.
//!
//! G. Sharon, R. Stern, A. Felner and N. Sturtevant, *Conflict-based search for optimal multi-agent
//! pathfinding*, AIJ 219 (2015).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Where two of a group meet: their numbers in the group, and what each would have to avoid.
pub(crate) struct Conflict<Constraint> {
    pub(crate) one: usize,
    pub(crate) avoids: Constraint,
    pub(crate) other: usize,
    pub(crate) avoids_too: Constraint,
}

/// Those for whom ways are looked for.
pub(crate) trait Group {
    /// Way of one in space and time.
    type Way: Clone;
    /// Part of another one's way that must be avoided.
    type Constraint: Clone;

    /// How many they are.
    fn size(&self) -> usize;
    /// The way of one that avoids all these; `None` = there is none, or it costs too much to find.
    fn way(&mut self, member: usize, constraints: &[Self::Constraint]) -> Option<Self::Way>;
    /// What all ways together cost: the cheapest choice is looked at next.
    fn cost(&self, ways: &[Self::Way]) -> usize;
    /// Where two of these meet first; `None` = nobody meets anybody.
    fn conflict(&mut self, ways: &[Self::Way]) -> Option<Conflict<Self::Constraint>>;
    /// Whether to look at one more choice.
    fn goes_on(&mut self) -> bool;
}

/// Ways on which nobody meets anybody; `None` if there are none among the `most_choices` cheapest
/// choices. Counts those that were looked at in `choices`.
pub(crate) fn resolve<G: Group>(
    group: &mut G,
    most_choices: usize,
    choices: &mut u32,
) -> Option<Vec<G::Way>> {
    let ways: Vec<G::Way> = (0..group.size()).map(|member| group.way(member, &[])).collect::<Option<_>>()?;
    let avoided: Vec<Vec<G::Constraint>> = vec![Vec::new(); ways.len()];
    let mut open = BinaryHeap::from([Reverse((group.cost(&ways), 0))]);
    let mut known = vec![(ways, avoided)];
    for _ in 0..most_choices {
        let Reverse((_, index)) = open.pop()?;
        if !group.goes_on() {
            return None;
        }
        *choices += 1;
        let (ways, avoided) = known[index].clone();
        let Some(conflict) = group.conflict(&ways) else { return Some(ways) };
        let Conflict { one, avoids, other, avoids_too } = conflict;
        for (member, constraint) in [(one, avoids), (other, avoids_too)] {
            let (mut ways, mut avoided) = (ways.clone(), avoided.clone());
            avoided[member].push(constraint);
            let Some(way) = group.way(member, &avoided[member]) else { continue };
            ways[member] = way;
            open.push(Reverse((group.cost(&ways), known.len())));
            known.push((ways, avoided));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two on a line of places with one bay: a way is a place each step. Each wants to the other's
    /// end; 9 is the bay beside place 2.
    struct Line {
        searches: u32,
    }

    const BAY: u8 = 9;

    /// Who must not be where when.
    type At = (usize, u8);

    impl Line {
        fn next(place: u8) -> Vec<u8> {
            match place {
                BAY => vec![BAY, 2],
                2 => vec![2, 1, 3, BAY],
                0 => vec![0, 1],
                4 => vec![4, 3],
                _ => vec![place, place - 1, place + 1],
            }
        }
    }

    impl Group for Line {
        type Way = Vec<u8>;
        type Constraint = At;

        fn size(&self) -> usize {
            2
        }

        /// Breadth first over (step, place).
        fn way(&mut self, member: usize, constraints: &[At]) -> Option<Vec<u8>> {
            self.searches += 1;
            let (start, goal) = if member == 0 { (0, 4) } else { (4, 0) };
            let mut ways = vec![vec![start]];
            for step in 1..14 {
                let mut longer: Vec<Vec<u8>> = Vec::new();
                for way in &ways {
                    for place in Self::next(*way.last()?) {
                        let banned = constraints.contains(&(step, place));
                        if !banned && !longer.iter().any(|other| other.last() == Some(&place)) {
                            longer.push([way.as_slice(), &[place]].concat());
                        }
                    }
                }
                let last = constraints.iter().map(|(step, _)| *step).max().unwrap_or(0);
                let there = |way: &&Vec<u8>| way.last() == Some(&goal) && step >= last;
                if let Some(way) = longer.iter().find(there) {
                    return Some(way.clone());
                }
                ways = longer;
            }
            None
        }

        fn cost(&self, ways: &[Vec<u8>]) -> usize {
            ways.iter().map(Vec::len).sum()
        }

        fn conflict(&mut self, ways: &[Vec<u8>]) -> Option<Conflict<At>> {
            let at = |member: usize, step: usize| ways[member][step.min(ways[member].len() - 1)];
            (1..ways[0].len().max(ways[1].len())).find_map(|step| {
                let same = at(0, step) == at(1, step);
                let swap = at(0, step) == at(1, step - 1) && at(1, step) == at(0, step - 1);
                (same || swap).then(|| Conflict {
                    one: 0,
                    avoids: (step, at(0, step)),
                    other: 1,
                    avoids_too: (step, at(1, step)),
                })
            })
        }

        fn goes_on(&mut self) -> bool {
            true
        }
    }

    #[test]
    fn two_that_are_as_far_from_the_only_bay_pass_each_other_there() {
        let (mut line, mut choices) = (Line { searches: 0 }, 0);
        let ways = resolve(&mut line, 200, &mut choices).unwrap();
        assert!(line.conflict(&ways).is_none());
        assert!(ways.iter().any(|way| way.contains(&BAY)), "{ways:?}");
        assert_eq!((ways[0].last(), ways[1].last()), (Some(&4), Some(&0)));
        assert!(line.searches <= 2 + 2 * choices);
    }

    #[test]
    fn it_ends_after_so_many_choices() {
        let (mut line, mut choices) = (Line { searches: 0 }, 0);
        assert_eq!(resolve(&mut line, 3, &mut choices), None);
        assert_eq!(choices, 3);
    }
}
