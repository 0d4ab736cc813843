//! Where no joint plan leads everybody to its goal: whoever has waited longest goes to its own, all others
//! make room first, and then go on to theirs if they can.
//!
//! Of a joint plan only the passing order is kept. So the one that is served may begin late in the plan's
//! clock: there is time then for the others to get out of its way, one behind the other and as far as they
//! have to, and it still drives as soon as the way is free.

use super::attempt::Expected;
use super::field::Field;
use super::joint::{EXPANSIONS_EACH, Failed, PATIENCE_MS, Solution, Solver};
use super::rect::Rect;
use super::timeline::Timeline;
use super::times::to_release;
use super::way::Way;
use std::cmp::Reverse;
use std::collections::BTreeSet;

/// The one that is served begins so late, in ticks: at once, or when others may have driven 10 m.
const LATE_TICKS: [usize; 2] = [0, 144];
/// Expansions for the one that is served.
const EXPANSIONS_SERVED: u32 = 12_000;
/// Expansions for one truck that makes room.
const EXPANSIONS_ASIDE: u32 = 2500;
/// Expansions for one truck that may go on to its goal as well.
const EXPANSIONS_FURTHER: u32 = 3000;

/// How many are shut out: those that have arrived leave them no way. And how many arrive.
type Worth = (Reverse<usize>, usize);

/// The one that is served, and how.
#[derive(Clone)]
struct Served {
    index: usize,
    way: Way,
    at_m: Vec<f64>,
}

impl Solver<'_> {
    /// Serves one of `wanting`, whoever has waited longest if that works; or what has been found before, if
    /// that is as good.
    pub(super) fn in_turn(
        &mut self,
        wanting: &[usize],
        led: &[usize],
        before: Option<Solution>,
    ) -> Option<Solution> {
        let left = std::mem::replace(&mut self.left, self.turn_left);
        let found = self.best(wanting, led, before);
        self.turn_left = std::mem::replace(&mut self.left, left);
        found
    }

    /// The solution that shuts out the fewest, and of those the one that leads most to their goals. If one has
    /// waited for long, the first one in which that one is served.
    fn best(&mut self, wanting: &[usize], led: &[usize], before: Option<Solution>) -> Option<Solution> {
        let waited_ms = |&index: &usize| Reverse(self.job.members[index].waited_ms);
        let mut queue = wanting.to_vec();
        queue.sort_by_key(waited_ms);
        let in_a_hurry = self.job.members[*queue.first()?].waited_ms > PATIENCE_MS;
        let mut best: Option<(Worth, Solution)> =
            before.map(|found| (self.worth(&found, &queue, led), found));
        for (place, &first) in queue.iter().enumerate() {
            // A share for each: whoever comes last in the queue is tried too.
            let most = EXPANSIONS_SERVED.min(self.left / (queue.len() - place) as u32);
            self.evading = queue.iter().copied().filter(|&index| index != first).collect();
            let Some(served) = self.serve(first, most, led, &BTreeSet::new()) else { continue };
            for late_ticks in LATE_TICKS {
                let good = |(Reverse(shut_out), _): &Worth| in_a_hurry || *shut_out == 0;
                if best.as_ref().is_some_and(|(worth, _)| good(worth)) || self.spent() {
                    return best.map(|(_, found)| found);
                }
                let Some(expected) = self.others_make_room(&served, late_ticks, &queue, led) else {
                    continue;
                };
                for found in self.with_further(expected, first, &queue, led) {
                    let found = Solution { served: Some(first), ..found };
                    let worth = self.worth(&found, &queue, led);
                    if best.as_ref().is_none_or(|(most, _)| worth > *most) {
                        best = Some((worth, found));
                    }
                }
            }
        }
        best.map(|(_, found)| found)
    }

    /// How good a solution is.
    fn worth(&self, found: &Solution, wanting: &[usize], led: &[usize]) -> Worth {
        let (arriving, behind): (Vec<usize>, Vec<usize>) =
            wanting.iter().partition(|&&index| found.arrives(index));
        let job = self.job;
        let end = |index: usize| match found.ways.get(&index) {
            Some(way) => way.stands[way.last()].body,
            None if led.contains(&index) => job.members[index].way.stands[job.members[index].way.last()].body,
            None => job.members[index].way.stands[job.members[index].held].body,
        };
        let parked: Vec<Rect> = arriving.iter().chain(led).map(|&index| end(index)).collect();
        let is_shut_out = |&&index: &&usize| {
            let (target, from) = (job.members[index].target, end(index));
            let field = Field::strict(&*job.room, job.car.half_width_m, &parked, [target.x_m, target.y_m]);
            field.distance_m(from.x_m, from.y_m).is_none()
        };
        (Reverse(behind.iter().filter(is_shut_out).count()), arriving.len())
    }

    /// The way of the one that is served, and ways for the others out of it. Who finds none is asked before the
    /// others, and if that does not help either it stands.
    fn others_make_room(
        &mut self,
        served: &Served,
        late_ticks: usize,
        wanting: &[usize],
        led: &[usize],
    ) -> Option<Expected> {
        let place = |index: usize| {
            let member = &self.job.members[index];
            member.way.stands[member.held].body
        };
        let far_m = |index: usize| {
            let (one, other) = (place(served.index), place(index));
            libm::hypot(one.x_m - other.x_m, one.y_m - other.y_m)
        };
        let mut others: Vec<usize> = wanting.iter().copied().filter(|&index| index != served.index).collect();
        others.sort_by(|&a, &b| far_m(a).total_cmp(&far_m(b)));
        let (mut standing, mut raised) = (BTreeSet::new(), BTreeSet::new());
        let mut served = served.clone();
        loop {
            self.evading = others.iter().copied().collect();
            let expected = self.expected(&[served.index], led, &standing)?;
            let late = self.late(&served, late_ticks);
            loop {
                let Failed(stuck) = match self.make_room(expected.clone(), &late, &others) {
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
            self.evading = others.iter().copied().collect();
            served = self.serve(served.index, EXPANSIONS_EACH, led, &standing)?;
        }
    }

    /// The way of the one that is served, as if all others but these got out of it.
    fn serve(
        &mut self,
        index: usize,
        most: u32,
        led: &[usize],
        standing: &BTreeSet<usize>,
    ) -> Option<Served> {
        let expected = self.expected(&[index], led, standing)?;
        let (way, at_m) = self.beside(index, &expected, None, most)?;
        Some(Served { index, way, at_m })
    }

    /// The same, begun later.
    fn late(&self, served: &Served, late_ticks: usize) -> Served {
        let mut late = served.clone();
        let released = to_release(&self.job.members[served.index]).len();
        let wait_m = late.at_m[released - 1];
        late.at_m.splice(released..released, std::iter::repeat_n(wait_m, late_ticks));
        late
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
            let (way, at_m) =
                self.beside(index, &expected, Some(&aside), EXPANSIONS_ASIDE).ok_or(Failed(index))?;
            self.take(&mut expected, index, way, &at_m);
        }
        Ok(expected)
    }

    /// Those that make room stay there; or go on to their goals, if they find a way there beside all others.
    fn with_further(
        &mut self,
        expected: Expected,
        first: usize,
        queue: &[usize],
        led: &[usize],
    ) -> Vec<Solution> {
        let mut found: Vec<Solution> = self.ordered(expected.clone(), led).into_iter().collect();
        let mut further = expected;
        for &index in queue.iter().filter(|&&index| index != first) {
            if self.evading.contains(&index)
                && let Some((way, at_m)) = self.beside(index, &further, None, EXPANSIONS_FURTHER)
            {
                self.take(&mut further, index, way, &at_m);
                self.evading.remove(&index);
                found.extend(self.ordered(further.clone(), led));
            }
        }
        found
    }

    fn beside(
        &mut self,
        index: usize,
        expected: &Expected,
        aside: Option<&Field>,
        most: u32,
    ) -> Option<(Way, Vec<f64>)> {
        let soft = expected.soft(&[index]);
        self.single(index, &expected.others(index), &soft, aside, most).ok()
    }

    fn take(&self, expected: &mut Expected, index: usize, way: Way, at_m: &[f64]) {
        let line = Timeline::driving(&way, &self.job.car, at_m, self.job.members[index].held);
        expected.take(index, way, at_m, line);
    }
}
