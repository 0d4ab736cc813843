//! Among many, each truck without a way looks for one around all others as they go.

use super::arrival_times::to_release;
use super::expected::Expected;
use super::joint::{Failed, Solution, Solver};
use super::occupancy::{NEVER, Occupancy, TICK_WAY_M};
use super::separation::{SEPARATIONS_M, separation_m};
use super::task::{Course, EXPANSIONS_EACH};
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use xtb_nav::MapPose;
use xtb_nav::geometry::rect::{LOOK_OUT_M, Stand};

/// Who would wait longer than this at its goal for others to pass is let there first, in ticks (10 s); chosen, not
/// measured.
const LATE_TICKS: usize = 40;
/// Who found no way among many looks for one that begins so much later, in ticks (30 s, 60 s); chosen, not measured.
const WAITS: [u32; 2] = [120, 240];
/// Expansions for one of several, in its first so many tries; later it may need more. Chosen, not measured.
const EXPANSIONS_QUICK: u32 = 1500;
const QUICK_TRIES: u32 = 2;
/// Another way, or other times on the same one, are taken only if they are so much shorter, in ticks (5 s); chosen, not
/// measured.
const SOONER_TICKS: u32 = 20;
/// Of those that would be led around for another one so many may keep their ways, since they find no other; chosen, not
/// measured.
const MOST_KEEP: usize = 2;
/// So many headings are looked at where any will do.
const HEADINGS: u32 = 16;

impl Expected {
    /// Whether this one is there clearly sooner than before.
    fn is_sooner(&self, index: usize, before: &Self) -> bool {
        before.lines[&index].end().saturating_sub(self.lines[&index].end()) > SOONER_TICKS
    }
}

impl Solver<'_> {
    /// Ways for as many of these as find one: whoever has none yet stands where it stands. Who only waits for the
    /// place of another one is asked again after that one has got a way.
    pub(super) fn each(&mut self, wanting: &[usize]) -> Option<Solution> {
        let standing: BTreeSet<usize> = wanting.iter().copied().collect();
        let led: Vec<usize> = self.job.indices(|member| !member.wanting && !member.fixed).collect();
        let mut expected = self.expected(&[], &led, &standing)?;
        let slow: Vec<usize> = self.job.indices(|member| member.slow).collect();
        // Those with ways first, or others take each gap before them; with no more than their share of the nodes.
        let for_wanting = self.left / (slow.len() + wanting.len()).max(1) as u32 * wanting.len() as u32;
        self.left -= for_wanting;
        let mut steps = Vec::new();
        // What costs least for all of them first.
        for &index in &slow {
            expected = self.along(index, &expected).unwrap_or(expected);
            steps.push((index, expected.clone()));
        }
        for &index in &slow {
            expected = self.sooner(index, &led, expected);
            steps.push((index, expected.clone()));
        }
        self.left += for_wanting;
        let mut open = wanting.to_vec();
        loop {
            let (mut waiting, mut found_one) = (Vec::new(), false);
            for &index in &open {
                if let Some(name) = self.at_goal(index, &expected) {
                    self.behind.insert(index, name);
                    waiting.push(index);
                    continue;
                }
                self.behind.remove(&index);
                let found = self.one(index, &led, &expected);
                if found.is_none() && wanting[0] != index && self.spent() {
                    self.untried.insert(index);
                }
                if let Some(found) = found {
                    found_one = true;
                    expected = found;
                    steps.push((index, expected.clone()));
                }
            }
            if waiting.is_empty() || !found_one {
                break;
            }
            open = waiting;
        }
        self.up_to_a_ring(&steps)
    }

    /// All of these, one upon the other; if they would block each other, the first ones that do not. Whoever closes the
    /// ring gets nothing, and those after it are looked for again: what they were led around does not go there. Who found
    /// nothing has had its turn nevertheless, or the same ones would be the first ones again and again.
    fn up_to_a_ring(&mut self, steps: &[(usize, Expected)]) -> Option<Solution> {
        let (mut fits, mut blocks, mut look, mut best) = (0, steps.len() + 1, steps.len(), None);
        while blocks - fits > 1 {
            match self.ordered(steps[look - 1].1.clone()) {
                Some(found) => (fits, best) = (look, Some(found)),
                None => blocks = look,
            }
            look = usize::midpoint(fits, blocks);
        }
        self.untried.extend(steps.iter().skip(blocks).map(|(index, _)| *index));
        best
    }

    /// One that has stood on its way for long is led to its goal clearly sooner, if that can be, at other times on its way
    /// or on another one. Its goal is reserved: who would pass that later goes around, if it can.
    fn sooner(&mut self, index: usize, led: &[usize], mut expected: Expected) -> Expected {
        let job = self.job;
        let goal = job.reserved.iter().position(|reserved| reserved.id == job.members[index].id);
        let late = goal.map_or_else(Vec::new, |_| self.late(index, led, &expected));
        let leaves_free =
            |other: &usize| job.reserved_for(&job.members[*other]).any(|place| Some(place) == goal);
        for other in late.into_iter().filter(leaves_free) {
            expected =
                self.with(other, expected.clone(), Course::ToGoal, EXPANSIONS_QUICK).unwrap_or(expected);
        }
        let mut found = self.along(index, &expected);
        if found.is_none() && !expected.ways.contains_key(&index) {
            found = self.with(index, expected.clone(), Course::ToGoal, EXPANSIONS_QUICK);
            found = found.filter(|found| found.is_sooner(index, &expected));
        }
        found.unwrap_or(expected)
    }

    /// With this one on the way that it has, as early as all others let it, if that is clearly sooner.
    fn along(&mut self, index: usize, expected: &Expected) -> Option<Expected> {
        let member = &self.job.members[index];
        let way = expected.ways.get(&index).unwrap_or(&member.way);
        let rest = way.path.tail(way.at_m(member.held)).pieces;
        let found = self.with(index, expected.clone(), Course::Along(&rest), 0)?;
        found.is_sooner(index, expected).then_some(found)
    }

    /// A way for this one, if it has to be at another time or with other ways of those that may get some.
    fn one(&mut self, index: usize, led: &[usize], expected: &Expected) -> Option<Expected> {
        let again = self.job.members[index].misses >= QUICK_TRIES;
        let most = if again { EXPANSIONS_EACH } else { EXPANSIONS_QUICK };
        let late = self.late(index, led, expected);
        let moved = if late.is_empty() { None } else { self.before(index, late, expected, most) };
        let mut found = moved.or_else(|| self.with(index, expected.clone(), Course::ToGoal, most));
        // Later there is less traffic.
        for wait in WAITS.into_iter().filter(|_| again) {
            if found.is_none() {
                self.wait = wait;
                found = self.with(index, expected.clone(), Course::ToGoal, most);
            }
        }
        self.wait = 0;
        found
    }

    /// Who will stay where this one wants to go, in each heading that it may have there.
    fn at_goal(&self, index: usize, expected: &Expected) -> Option<String> {
        let (job, member) = (self.job, &self.job.members[index]);
        let (target, mine) = (member.target, member.held_stands());
        let yaws_rad: Vec<f64> = match target.yaw_rad {
            Some(yaw_rad) => vec![yaw_rad],
            None => (0..HEADINGS).map(|step| f64::from(step) * TAU / f64::from(HEADINGS)).collect(),
        };
        let stays = |stand: &Stand, line: &Occupancy, held: &[Stand]| {
            line.hits(stand, NEVER - 1, SEPARATIONS_M[0])
                && line.hits(stand, NEVER - 1, separation_m(mine, held))
        };
        let mut by = None;
        for yaw_rad in yaws_rad {
            let stand = Stand::still(&member.car, &MapPose { x_m: target.x_m, y_m: target.y_m, yaw_rad });
            let mut blocks = self.blocks.iter().zip(&job.blocks);
            let block = blocks
                .find(|(line, block)| block.concerns(member.id) && stays(&stand, line, &block.stands))
                .map(|(_, block)| &block.name);
            let mut lines = expected.lines.iter().filter(|(other, _)| **other != index);
            let other = || {
                lines
                    .find(|(other, line)| stays(&stand, line, job.members[**other].held_stands()))
                    .map(|(other, _)| &job.members[*other].name)
            };
            by = Some(block.or_else(other)?);
        }
        by.cloned()
    }

    /// Who of those that may be given other ways would lead past the goal of this one long after it could be there.
    fn late(&mut self, index: usize, led: &[usize], expected: &Expected) -> Vec<usize> {
        let member = &self.job.members[index];
        let start = member.way.stands[member.held].body;
        let goal_m = [member.target.x_m, member.target.y_m];
        let Some(way_m) = self.field(index).distance_m(start.x_m, start.y_m) else { return Vec::new() };
        let there = to_release(member).len() + (way_m / TICK_WAY_M) as usize + LATE_TICKS;
        let passes = |other: &usize| {
            let reach_m = member.car.reach_m() + self.job.members[*other].car.reach_m() + LOOK_OUT_M;
            expected.lines[other].is_near_after(there, goal_m, reach_m)
        };
        led.iter().copied().filter(passes).collect()
    }

    /// With a way of this one to its goal before these pass it, and other ways of them around it; up to [`MOST_KEEP`] that
    /// find none keep their own, and this one goes around them.
    fn before(
        &mut self,
        index: usize,
        mut late: Vec<usize>,
        expected: &Expected,
        most: u32,
    ) -> Option<Expected> {
        for _ in 0..=MOST_KEEP {
            match self.with_moved(index, &late, expected, most) {
                Ok(found) => return Some(found),
                Err(Failed(failed)) => late.retain(|&other| other != failed && failed != index),
            }
            if late.is_empty() {
                break;
            }
        }
        None
    }

    /// With a way of this one, as if these were not on theirs, and other ways of these around it; or who has none.
    fn with_moved(
        &mut self,
        index: usize,
        moved: &[usize],
        expected: &Expected,
        most: u32,
    ) -> Result<Expected, Failed> {
        let mut expected = expected.clone();
        moved.iter().for_each(|&other| expected.leave(other, &self.job.members[other]));
        let others = moved.iter().map(|&other| (other, most.min(EXPANSIONS_QUICK)));
        std::iter::once((index, most)).chain(others).try_fold(expected, |expected, (index, most)| {
            self.with(index, expected, Course::ToGoal, most).ok_or(Failed(index))
        })
    }

    /// With a way of this one around all others, if there is one.
    fn with(
        &mut self,
        index: usize,
        mut expected: Expected,
        course: Course<'_>,
        most: u32,
    ) -> Option<Expected> {
        let soft = expected.soft(&[index]);
        let (way, at_m) = self.single(index, &expected.others(index), &soft, course, most).ok()?;
        let line = self.job.members[index].driving(&way, &at_m);
        expected.take(index, way, &at_m, line);
        Some(expected)
    }
}

#[cfg(test)]
mod tests {
    use super::super::discretized_path::DiscretizedPath;
    use super::super::group::tests::job;
    use super::super::job::{JointJob, JointResult, Reserved};
    use super::super::order::{Timed, pair, set_needs};
    use super::super::room::GridRoom;
    use super::*;
    use std::sync::Arc;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Car, Path, Piece};

    const EAST: f64 = 0.0;
    const WEST: f64 = std::f64::consts::PI;
    const SOUTH: f64 = -std::f64::consts::FRAC_PI_2;

    fn stand(x_m: f64, y_m: f64) -> Stand {
        Stand::still(&Car::of(&VehicleConfig::default()), &MapPose { x_m, y_m, yaw_rad: EAST })
    }

    fn solved(mut job: JointJob) -> JointResult {
        job.each_for_itself = true;
        job.solve(&mut || true)
    }

    /// A truck that has stood and wants to go so far to the east, and one that comes from the north and passes first
    /// wherever they meet.
    fn behind_one_that_comes_late(length_m: f64) -> JointJob {
        let ways = [([2.0, 4.0, EAST], [2.0 + length_m, 4.0, EAST]), ([6.0, 18.0, SOUTH], [6.0, 1.0, SOUTH])];
        let mut job = job(GridRoom::with(12.0, 20.0, &[]), &ways, 0);
        for (member, length_m) in job.members.iter_mut().zip([length_m, 17.0]) {
            let mut path = member.way.path.clone();
            path.push(Piece { length_m, curvature_per_m: 0.0 });
            member.way = Arc::new(DiscretizedPath::new(path, &member.car));
            member.wanting = false;
        }
        job.members[0].slow = true;
        let (waits, passes) = (&job.members[0].way, &job.members[1].way);
        let (late, early) = (vec![1000.0; waits.stands.len()], vec![500.0; passes.stands.len()]);
        let (waits, passes) = (
            Timed { way: waits, at: 0, held: 0, ticks: &late },
            Timed { way: passes, at: 0, held: 0, ticks: &early },
        );
        let (needs, _) = pair(&waits, &passes, 0.06);
        set_needs(&mut job.order, (1, 2), &needs);
        job
    }

    #[test]
    fn who_has_stood_goes_before_one_that_comes_late_on_the_same_way() {
        let job = behind_one_that_comes_late(8.0);
        assert!(job.order.contains_key(&(1, 2)));
        let path = &job.members[0].way.path;
        let result = solved(job.clone());
        assert_eq!(result.plans.iter().map(|plan| plan.id).collect::<Vec<_>>(), [1]);
        let Path { start, ref pieces } = result.plans[0].way.path;
        assert_eq!((start, pieces.len()), (path.start, 1));
        assert!((pieces[0].length_m - 8.0).abs() < 1e-9);
        assert_eq!(result.order.keys().copied().collect::<Vec<_>>(), [(2, 1)]);
    }

    #[test]
    fn who_would_pass_the_goal_of_one_that_has_stood_goes_around_it() {
        let mut job = behind_one_that_comes_late(4.0);
        let goal = stand(6.0, 4.0);
        let passes = |way: &DiscretizedPath| way.stands.iter().any(|stand| stand.touches(&goal, 0.0));
        assert!(passes(&job.members[1].way));
        assert_eq!(solved(job.clone()).counts(), (0, 0));
        job.reserved = vec![Reserved { id: 1, delayed_ms: 20_000, stand: goal }];
        job.members[0].delayed_ms = 20_000;
        // Who has waited longer itself keeps its way.
        for (delayed_ms, both) in [(10_000, true), (30_000, false)] {
            job.members[1].delayed_ms = delayed_ms;
            let result = solved(job.clone());
            assert_eq!(result.counts(), (2 * usize::from(both), 0));
            assert!(!both || !passes(&result.plans[1].way));
            assert_eq!(result.order.contains_key(&(1, 2)), !both);
        }
    }

    #[test]
    fn of_those_that_would_pass_later_one_that_finds_no_other_way_keeps_its_own() {
        let ways = [
            ([2.0, 4.0, EAST], [6.0, 4.0, EAST]),
            ([6.0, 18.0, SOUTH], [6.0, 1.0, SOUTH]),
            // Its goal is in the wall: nothing would be found for it.
            ([9.5, 18.0, SOUTH], [9.5, -1.0, SOUTH]),
        ];
        let mut job = job(GridRoom::with(12.0, 20.0, &[]), &ways, 0);
        for member in &mut job.members[1..] {
            let mut path = member.way.path.clone();
            path.push(Piece { length_m: 17.0, curvature_per_m: 0.0 });
            member.way = Arc::new(DiscretizedPath::new(path, &member.car));
            member.wanting = false;
        }
        let mut always = || true;
        let mut solver = Solver::new(&job, &mut always);
        let expected = solver.expected(&[], &[1, 2], &BTreeSet::from([0])).unwrap();
        let failed = solver.with_moved(0, &[1, 2], &expected, EXPANSIONS_QUICK).err().unwrap();
        assert_eq!(failed.0, 2);
        let found = solver.before(0, vec![1, 2], &expected, EXPANSIONS_QUICK).unwrap();
        assert_eq!(found.ways.keys().copied().collect::<Vec<_>>(), [0, 1]);
        // Who finds no way itself is not looked for again.
        let left = solver.left;
        assert!(solver.before(2, vec![0, 1], &expected, EXPANSIONS_QUICK).is_none());
        assert_eq!(solver.left, left);
    }

    #[test]
    fn where_two_would_block_each_other_those_before_them_go_and_those_after_are_looked_for_again() {
        let ways = [
            ([2.0, 4.0, EAST], [8.0, 4.0, EAST]),
            ([8.0, 4.0, WEST], [2.0, 4.0, WEST]),
            ([2.0, 8.0, EAST], [8.0, 8.0, EAST]),
        ];
        let (job, mut always) = (job(GridRoom::with(12.0, 12.0, &[]), &ways, 0), || true);
        let (mut solver, mut expected, mut steps) =
            (Solver::new(&job, &mut always), Expected::default(), Vec::new());
        for (index, member) in job.members.iter().enumerate() {
            let mut path = member.way.path.clone();
            path.push(Piece { length_m: 6.0, curvature_per_m: 0.0 });
            let way = DiscretizedPath::new(path, &member.car);
            let at_m: Vec<f64> = (0..=86_u32).map(|tick| (f64::from(tick) * TICK_WAY_M).min(6.0)).collect();
            let line = member.driving(&way, &at_m);
            expected.take(index, way, &at_m, line);
            steps.push((index, expected.clone()));
        }
        let found = solver.up_to_a_ring(&steps).unwrap();
        assert_eq!(found.ways.keys().copied().collect::<Vec<_>>(), [0]);
        assert_eq!(solver.untried, BTreeSet::from([2]));
        steps.remove(1);
        assert!(solver.up_to_a_ring(&steps[..1]).is_some());
        assert!(solver.up_to_a_ring(&[]).is_none());
    }

    #[test]
    fn whoever_has_had_no_time_is_not_told_that_there_is_no_way() {
        let ways = [([2.0, 4.0, EAST], [8.0, 4.0, EAST]), ([2.0, 8.0, EAST], [8.0, 8.0, EAST])];
        let mut job = job(GridRoom::with(12.0, 12.0, &[]), &ways, 0);
        job.each_for_itself = true;
        assert_eq!(job.solve(&mut || true).counts(), (2, 0));
        // The first one is told: it has had its turn.
        assert_eq!(job.solve(&mut || false).counts(), (0, 1));
        assert_eq!(job.given_up().counts(), (0, 2));
    }

    #[test]
    fn nobody_is_led_through_the_goal_of_one_that_has_waited_longer() {
        let goal = stand(6.0, 4.0);
        let across = ([1.0, 4.0, 0.0], [11.0, 4.0, 0.0]);
        let there = ([6.0, 1.0, 0.0], [6.0, 4.0, 0.0]);
        let away = ([6.1, 4.1, 0.0], [11.0, 7.0, 0.0]);
        let passes = |way: ([f64; 3], [f64; 3]), reserved: &[u32], delayed_ms: u64| {
            let mut job = job(GridRoom::with(12.0, 8.0, &[]), &[way], 0);
            job.reserved =
                reserved.iter().map(|&id| Reserved { id, delayed_ms: 20_000, stand: goal }).collect();
            job.members[0].delayed_ms = delayed_ms;
            let result = solved(job);
            assert_eq!(result.counts(), (1, 0));
            result.plans[0].way.stands.iter().any(|stand| stand.touches(&goal, 0.0))
        };
        assert!(passes(across, &[], 0));
        assert!(!passes(across, &[7], 0));
        // It may have waited longest itself; of two that have waited for as long the same one goes first each time.
        assert!(passes(across, &[7], 30_000));
        assert!(passes(across, &[7], 20_000) && !passes(across, &[0], 20_000));
        // Whose goal it is goes there, and who stands there goes away.
        assert!(passes(there, &[1], 20_000));
        assert!(passes(away, &[7], 0));
    }
}
