//! Where no joint plan leads everybody to its goal: whoever has waited longest goes to its own, all others
//! make room first, and then go on to theirs if they can.
//!
//! Of a joint plan only the passing order is kept. So the one that is served may begin late in the plan's
//! clock: there is time then for the others to get out of its way, one behind the other and as far as they
//! have to, and it still drives as soon as the way is free.

use super::arrival_times::to_release;
use super::discretized_path::DiscretizedPath;
use super::expected::Expected;
use super::joint::{Failed, PATIENCE_MS, Solution, Solver};
use super::task::{Course, EXPANSIONS_EACH};
use std::collections::BTreeSet;

/// The one that is served begins so late, in ticks: at once, or when others may have driven 10 m (36 s);
/// chosen, not measured.
const LATE_TICKS: [usize; 2] = [0, 144];
/// Expansions for one truck that makes room; chosen, not measured.
const EXPANSIONS_ASIDE: u32 = 2500;
/// Expansions for one truck that may go on to its goal as well; chosen, not measured.
const EXPANSIONS_FURTHER: u32 = 1500;

/// The one that is served, and how.
struct Served {
    index: usize,
    way: DiscretizedPath,
    at_m: Vec<f64>,
}

impl Solver<'_> {
    /// Serves one of `wanting`, whoever has waited longest if that works. Those that only make room are in
    /// `evading` then.
    pub(super) fn in_turn(&mut self, wanting: &[usize], led: &[usize]) -> Option<Solution> {
        let left = std::mem::replace(&mut self.left, self.turn_left);
        let found = self.best(wanting, led);
        self.turn_left = std::mem::replace(&mut self.left, left);
        if found.is_none() {
            self.evading.clear();
        }
        found
    }

    /// The solution that leads most of them to their goals. If one has waited for long, the first one in which
    /// that one is served.
    fn best(&mut self, wanting: &[usize], led: &[usize]) -> Option<Solution> {
        let waited_ms = |&index: &usize| std::cmp::Reverse(self.job.members[index].waited_ms);
        let mut queue = wanting.to_vec();
        queue.sort_by_key(waited_ms);
        let in_a_hurry = self.job.members[*queue.first()?].waited_ms > PATIENCE_MS;
        let mut best: Option<(usize, BTreeSet<usize>, usize, Solution)> = None;
        for (first, late_ticks) in queue.iter().flat_map(|&first| LATE_TICKS.map(|late| (first, late))) {
            if self.spent() || in_a_hurry && best.is_some() {
                break;
            }
            let Some(expected) = self.others_make_room(first, late_ticks, &queue, led) else { continue };
            let Some(found) = self.with_further(expected, first, &queue) else { continue };
            let arriving =
                queue.iter().filter(|index| found.ways.contains_key(index)).count() - self.evading.len();
            if best.as_ref().is_none_or(|(most, ..)| arriving > *most) {
                best = Some((arriving, self.evading.clone(), first, found));
            }
            if arriving == queue.len() {
                break;
            }
        }
        let (_, evading, first, found) = best?;
        (self.evading, self.served) = (evading, Some(first));
        Some(found)
    }

    /// Ways for `first` to its goal and for the others out of its way. Who finds none is asked before the
    /// others, and if that does not help either it stands.
    fn others_make_room(
        &mut self,
        first: usize,
        late_ticks: usize,
        wanting: &[usize],
        led: &[usize],
    ) -> Option<Expected> {
        let far_m = |index: usize| {
            let place = |index: usize| {
                let member = &self.job.members[index];
                member.way.stands[member.held].body
            };
            let (one, other) = (place(first), place(index));
            libm::hypot(one.x_m - other.x_m, one.y_m - other.y_m)
        };
        let mut others: Vec<usize> = wanting.iter().copied().filter(|&index| index != first).collect();
        others.sort_by(|&a, &b| far_m(a).total_cmp(&far_m(b)));
        let (mut standing, mut raised) = (BTreeSet::new(), BTreeSet::new());
        loop {
            self.evading = others.iter().copied().collect();
            let (expected, served) = self.serve(first, late_ticks, led, &standing)?;
            loop {
                let Failed(stuck) = match self.make_room(expected.clone(), &served, &others) {
                    Ok(expected) => return Some(expected),
                    Err(failed) => failed,
                };
                if self.spent() {
                    return None;
                }
                others.retain(|&index| index != stuck);
                if !raised.insert(stuck) {
                    standing.insert(stuck);
                    break;
                }
                others.insert(0, stuck);
            }
        }
    }

    /// The way of the one that is served, as if all others got out of it.
    fn serve(
        &mut self,
        first: usize,
        late_ticks: usize,
        led: &[usize],
        standing: &BTreeSet<usize>,
    ) -> Option<(Expected, Served)> {
        let expected = self.expected(&[first], led, standing)?;
        let soft = expected.soft(&[first]);
        let (way, mut at_m) =
            self.single(first, &expected.others(first), &soft, Course::ToGoal, EXPANSIONS_EACH).ok()?;
        let released = to_release(&self.job.members[first]).len();
        let wait_m = at_m[released - 1];
        at_m.splice(released..released, std::iter::repeat_n(wait_m, late_ticks));
        Some((expected, Served { index: first, way, at_m }))
    }

    fn make_room(
        &mut self,
        mut expected: Expected,
        served: &Served,
        others: &[usize],
    ) -> Result<Expected, Failed> {
        self.take(&mut expected, served.index, served.way.clone(), &served.at_m);
        for &index in others {
            let aside = self.aside(index, &expected);
            let (way, at_m) = self
                .beside(index, &expected, Course::Aside(&aside), EXPANSIONS_ASIDE)
                .ok_or(Failed(index))?;
            self.take(&mut expected, index, way, &at_m);
        }
        Ok(expected)
    }

    /// Those that make room go on to their goals, if they find a way there beside all others.
    fn with_further(&mut self, expected: Expected, first: usize, queue: &[usize]) -> Option<Solution> {
        let (mut further, mut arriving) = (expected.clone(), BTreeSet::new());
        for &index in queue.iter().filter(|&&index| index != first) {
            if !self.evading.contains(&index) {
                continue;
            }
            if let Some((way, at_m)) = self.beside(index, &further, Course::ToGoal, EXPANSIONS_FURTHER) {
                self.take(&mut further, index, way, &at_m);
                arriving.insert(index);
            }
        }
        if !arriving.is_empty()
            && let Some(found) = self.ordered(further)
        {
            self.evading.retain(|index| !arriving.contains(index));
            return Some(found);
        }
        self.ordered(expected)
    }

    fn beside(
        &mut self,
        index: usize,
        expected: &Expected,
        course: Course<'_>,
        most: u32,
    ) -> Option<(DiscretizedPath, Vec<f64>)> {
        let soft = expected.soft(&[index]);
        self.single(index, &expected.others(index), &soft, course, most).ok()
    }

    fn take(&self, expected: &mut Expected, index: usize, way: DiscretizedPath, at_m: &[f64]) {
        let line = self.job.members[index].driving(&way, at_m);
        expected.take(index, way, at_m, line);
    }
}
