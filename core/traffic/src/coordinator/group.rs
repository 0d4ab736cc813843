//! A few trucks for which no order of priorities works, planned at once: one of them may make room for
//! another that it passes before or after. Conflict-based search; the rest follows in an order.

use super::discretized_path::DiscretizedPath;
use super::expected::Expected;
use super::joint::{Solution, Solver};
use super::occupancy::{NEVER, Occupancy};
use super::separation::separation_m;
use super::task::Course;
use crate::conflicts::{self, Conflict};
use std::collections::BTreeSet;
use std::rc::Rc;

/// Most trucks of a group: the choices double with each meeting. Chosen, not measured.
const MOST: usize = 4;
/// Choices that are looked at; chosen, not measured.
const MOST_CHOICES: usize = 100;
/// Expansions for one truck in one choice: a fifth of what a way may cost otherwise; chosen, not measured.
const EXPANSIONS: u32 = 800;
/// Longest part of another one's way that is avoided at once, in ticks (10 s); chosen, not measured.
const MOST_AVOIDED: u32 = 40;
/// What a tick in each other's way counts against one of driving: ways that need few more constraints first.
/// Chosen, not measured.
const MEETING_COST: usize = 4;
/// So much longer than they meet it is avoided, in ticks (1 s); chosen, not measured.
const SPARE_TICKS: u32 = 4;

/// A way with the position on it at each tick.
struct Drive {
    way: DiscretizedPath,
    at_m: Vec<f64>,
    line: Occupancy,
}

/// Some of the members among all others.
struct Group<'g, 'a> {
    solver: &'g mut Solver<'a>,
    members: &'g [usize],
    expected: &'g Expected,
}

impl Solver<'_> {
    /// Plans a few of these at once, the others after them in the order given.
    pub(super) fn group(&mut self, free: &[usize], standing: &BTreeSet<usize>) -> Option<Solution> {
        let left = std::mem::replace(&mut self.left, self.group_left);
        let found = self.grouped(free, standing);
        self.group_left = std::mem::replace(&mut self.left, left);
        found
    }

    fn grouped(&mut self, free: &[usize], standing: &BTreeSet<usize>) -> Option<Solution> {
        if free.len() < 2 || self.spent() {
            return None;
        }
        let mut expected = self.expected(free, &[], standing)?;
        let members = self.chosen(free, &expected)?;
        let mut choices = 0;
        let mut group = Group { solver: self, members: &members, expected: &expected };
        let found = conflicts::resolve(&mut group, MOST_CHOICES, &mut choices);
        self.choices += choices;
        for (&index, drive) in members.iter().zip(found?) {
            expected.take(index, drive.way.clone(), &drive.at_m, drive.line.clone());
        }
        let rest: Vec<usize> = free.iter().copied().filter(|index| !members.contains(index)).collect();
        self.one_by_one(expected, &rest).ok()
    }

    /// All if they are few; else who failed most often, and those that it meets first on its way.
    fn chosen(&mut self, free: &[usize], expected: &Expected) -> Option<Vec<usize>> {
        if free.len() <= MOST {
            return Some(free.to_vec());
        }
        let failures = |index: usize| self.failures.get(&index).copied().unwrap_or(0);
        let worst = free.iter().copied().max_by_key(|&index| failures(index))?;
        let mut group = Group { solver: self, members: free, expected };
        let drives: Vec<Option<Rc<Drive>>> =
            (0..free.len()).map(|member| conflicts::Group::way(&mut group, member, &[])).collect();
        let own = drives[free.iter().position(|&index| index == worst)?].clone()?;
        let others = free.iter().zip(&drives).filter(|(index, _)| **index != worst);
        let mut met: Vec<(u32, usize)> = others
            .filter_map(|(&index, drive)| {
                let separation_m = self.separation_m(worst, index);
                let (from, _) = own.line.meets(&drive.as_ref()?.line, separation_m)?;
                Some((from, index))
            })
            .collect();
        met.sort_unstable();
        let members: Vec<usize> =
            std::iter::once(worst).chain(met.into_iter().map(|(_, index)| index)).take(MOST).collect();
        (members.len() > 1).then_some(members)
    }

    fn separation_m(&self, one: usize, other: usize) -> f64 {
        let held = |index: usize| self.job.members[index].held_stands();
        separation_m(held(one), held(other))
    }
}

impl conflicts::Group for Group<'_, '_> {
    type Way = Rc<Drive>;
    /// Who, and where that one is for a while.
    type Constraint = (usize, Rc<Occupancy>);

    fn size(&self) -> usize {
        self.members.len()
    }

    fn way(&mut self, member: usize, constraints: &[Self::Constraint]) -> Option<Rc<Drive>> {
        let index = self.members[member];
        let mut lines = self.expected.others(index);
        lines.extend(constraints.iter().map(|(other, line)| (*other, &**line)));
        let soft = self.expected.soft(self.members);
        let (way, at_m) = self.solver.single(index, &lines, &soft, Course::ToGoal, EXPANSIONS).ok()?;
        let job = self.solver.job;
        let line = job.members[index].driving(&way, &at_m);
        Some(Rc::new(Drive { way, at_m, line }))
    }

    /// Their times and the time for which they are in each other's way, in ticks.
    fn cost(&self, drives: &[Rc<Drive>]) -> usize {
        let meets = |(a, b): (usize, usize)| {
            let separation_m = self.solver.separation_m(self.members[a], self.members[b]);
            drives[a].line.contact_ticks(&drives[b].line, separation_m)
        };
        let met: usize = pairs(drives.len()).map(meets).sum();
        drives.iter().map(|drive| drive.at_m.len()).sum::<usize>() + MEETING_COST * met
    }

    fn conflict(&mut self, drives: &[Rc<Drive>]) -> Option<Conflict<Self::Constraint>> {
        let meetings = pairs(drives.len()).filter_map(|(a, b)| {
            let separation_m = self.solver.separation_m(self.members[a], self.members[b]);
            let (from, until) = drives[a].line.meets(&drives[b].line, separation_m)?;
            Some((from, until, a, b))
        });
        let (from, until, one, other) = meetings.min_by_key(|&(from, ..)| from)?;
        let until = until.saturating_add(SPARE_TICKS).min(from + MOST_AVOIDED);
        let ban = |of: usize| {
            // Who has arrived stays.
            let until = if drives[of].at_m.len() <= from as usize { NEVER } else { until };
            (self.members[of], Rc::new(drives[of].line.between(from, until)))
        };
        Some(Conflict { one, avoids: ban(other), other, avoids_too: ban(one) })
    }

    fn goes_on(&mut self) -> bool {
        !self.solver.spent()
    }
}

/// All pairs of so many.
fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |a| (a + 1..count).map(move |b| (a, b)))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::job::{JointJob, Member};
    use super::super::order::Order;
    use super::super::room::GridRoom;
    use super::super::task::Target;
    use super::*;
    use std::sync::Arc;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Car, MapPose, Path};

    const BUDGET: u32 = 8_000;

    pub(in super::super) fn job(
        room: GridRoom,
        ways: &[([f64; 3], [f64; 3])],
        group_budget: u32,
    ) -> JointJob {
        let car = Car::of(&VehicleConfig::default());
        let member = |(index, (from, to)): (usize, &([f64; 3], [f64; 3]))| Member {
            id: index as u32 + 1,
            name: format!("xtb-{}", index + 1),
            revision: 0,
            way: Arc::new(DiscretizedPath::new(
                Path::standing(MapPose { x_m: from[0], y_m: from[1], yaw_rad: from[2] }),
                &car,
            )),
            car,
            done_m: 0.0,
            held: 0,
            wanting: true,
            fixed: false,
            slow: false,
            waited_ms: 0,
            delayed_ms: 0,
            misses: 0,
            target: Target { x_m: to[0], y_m: to[1], yaw_rad: Some(to[2]) },
        };
        JointJob {
            id: 1,
            room: Arc::new(room),
            members: ways.iter().enumerate().map(member).collect(),
            blocks: Vec::new(),
            reserved: Vec::new(),
            order: Order::new(),
            seed: 1,
            budget: 30_000,
            group_budget,
            turn_budget: 0,
            each_for_itself: false,
        }
    }

    /// A lane of 0.9 m with dead ends and one bay in its middle, as far from either end.
    fn lane(length_m: f64, bay_m: f64, above_m: f64) -> GridRoom {
        let (west, east) = ((length_m - bay_m) / 2.0, (length_m + bay_m) / 2.0);
        let walls = [
            [0.0, 0.0, length_m, 1.5],
            [0.0, 2.4, west, 1.0],
            [east, 2.4, length_m - east, 1.0],
            [0.0, 3.4, length_m, 0.6],
        ];
        GridRoom::with(length_m, 4.0 + above_m, &walls)
    }

    const EAST: f64 = 0.0;
    const WEST: f64 = std::f64::consts::PI;

    fn swap(length_m: f64) -> Vec<([f64; 3], [f64; 3])> {
        let east = length_m - 0.8;
        vec![([0.8, 1.95, EAST], [east - 0.2, 1.95, EAST]), ([east, 1.95, WEST], [1.0, 1.95, WEST])]
    }

    fn paths(result: &super::super::JointResult) -> Vec<Path> {
        assert!(result.plans.iter().all(|plan| !plan.evades));
        result.plans.iter().map(|plan| plan.way.path.clone()).collect()
    }

    #[test]
    fn where_each_order_fails_because_the_first_one_would_have_to_make_room_a_group_finds_ways() {
        let orders = job(lane(8.0, 1.2, 0.0), &swap(8.0), 0).solve(&mut || true);
        assert_eq!((orders.counts(), orders.grouped, orders.choices), ((0, 2), false, 0));
        assert!(orders.tries >= 2, "each of the two has been first");
        let grouped = job(lane(8.0, 1.2, 0.0), &swap(8.0), BUDGET).solve(&mut || true);
        assert_eq!((grouped.counts(), grouped.grouped), ((2, 0), true));
        let there = |path: &Path, way: &([f64; 3], [f64; 3])| (path.end().x_m - way.1[0]).abs() < 0.01;
        assert!(paths(&grouped).iter().zip(&swap(8.0)).all(|(path, way)| there(path, way)));
        // One of them leaves the lane for the bay and comes back.
        let aside = |path: &Path| (0..200).any(|at| path.at(f64::from(at) * 0.05).0.y_m > 2.5);
        assert_eq!(paths(&grouped).iter().filter(|path| aside(path)).count(), 1);
        let again = job(lane(8.0, 1.2, 0.0), &swap(8.0), BUDGET).solve(&mut || true);
        assert_eq!(paths(&again), paths(&grouped));
    }

    #[test]
    fn of_two_behind_each_other_and_one_from_ahead_all_get_through() {
        let mut ways = swap(12.0);
        ways[0].1[0] = 9.8;
        ways.insert(0, ([2.0, 1.95, EAST], [11.0, 1.95, EAST]));
        let orders = job(lane(12.0, 1.2, 0.0), &ways, 0).solve(&mut || true);
        assert!(orders.counts().1 > 0 && !orders.grouped);
        let grouped = job(lane(12.0, 1.2, 0.0), &ways, BUDGET).solve(&mut || true);
        assert_eq!((grouped.counts(), grouped.grouped), ((3, 0), true));
    }

    #[test]
    fn of_many_only_those_that_meet_are_planned_at_once() {
        // Four more in a hall of their own.
        let mut ways = swap(8.0);
        for at in [0.8, 2.4, 4.0, 5.6] {
            ways.push(([at, 4.8, EAST], [at + 1.2, 7.2, EAST]));
        }
        let hall = || lane(8.0, 1.2, 4.0);
        assert_eq!(job(hall(), &ways, 0).solve(&mut || true).counts().1, 2);
        let grouped = job(hall(), &ways, BUDGET).solve(&mut || true);
        assert_eq!((grouped.counts(), grouped.grouped), ((6, 0), true));
    }

    #[test]
    fn where_nobody_can_pass_one_is_served_and_the_other_makes_room() {
        // The lane leads into a hall: one of the two has its goal there, the other one's is in the lane.
        let walls = [[0.0, 0.0, 6.0, 1.5], [0.0, 2.4, 6.0, 1.6]];
        let ways = [([1.0, 1.95, EAST], [9.0, 1.0, EAST]), ([3.0, 1.95, EAST], [0.8, 1.95, EAST])];
        let mut job = job(GridRoom::with(10.0, 4.0, &walls), &ways, 0);
        (job.budget, job.turn_budget) = (0, 24_000);
        let none = JointJob { turn_budget: 0, ..job.clone() }.solve(&mut || true);
        assert_eq!((none.counts().0, none.in_turn), (0, false));
        let result = job.solve(&mut || true);
        assert!(result.in_turn && result.counts().0 == 2, "{:?}", result.counts());
        assert!(result.expansions <= 24_000, "{}", result.expansions);
        // Whoever has waited longer comes first, if there is a way for it.
        job.members[1].waited_ms = 9_000;
        let other = job.solve(&mut || true);
        assert!(other.in_turn, "{:?}", other.counts());
    }

    #[test]
    fn where_there_is_no_bay_it_ends_within_its_budget() {
        let walls = [[0.0, 0.0, 8.0, 1.5], [0.0, 2.4, 8.0, 1.6]];
        let result = job(GridRoom::with(8.0, 4.0, &walls), &swap(8.0), BUDGET).solve(&mut || true);
        assert_eq!((result.counts(), result.grouped), ((0, 2), false));
        assert!(result.choices > 0 && result.choices <= 2 * MOST_CHOICES as u32);
        assert!(result.expansions <= 30_000 + BUDGET);
    }
}
