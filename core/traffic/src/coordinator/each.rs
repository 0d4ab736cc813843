//! Among many, each truck without a way looks for one around all others as they go.

use super::arrival_times::to_release;
use super::expected::Expected;
use super::joint::{Solution, Solver};
use super::occupancy::{NEVER, Occupancy, TICK_WAY_M};
use super::separation::{SEPARATIONS_M, separation_m};
use super::task::EXPANSIONS_EACH;
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
/// Another way is taken only if it is so much shorter, in ticks (5 s); chosen, not measured.
const SOONER_TICKS: u32 = 20;
/// So many headings are looked at where any will do.
const HEADINGS: u32 = 16;

impl Solver<'_> {
    /// Ways for as many of these as find one: whoever has none yet stands where it stands. Who only waits for the
    /// place of another one is asked again after that one has got a way.
    pub(super) fn each(&mut self, wanting: &[usize]) -> Option<Solution> {
        let standing: BTreeSet<usize> = wanting.iter().copied().collect();
        let led: Vec<usize> = self.job.indices(|member| !member.wanting && !member.fixed).collect();
        let mut expected = self.expected(&[], &led, &standing)?;
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
                if found.is_none() && self.left == 0 && wanting[0] != index {
                    self.untried.insert(index);
                }
                found_one |= found.is_some();
                expected = found.unwrap_or(expected);
            }
            if waiting.is_empty() || !found_one {
                break;
            }
            open = waiting;
        }
        for index in self.job.indices(|member| member.slow) {
            expected = self.sooner(index, &led, &expected).unwrap_or(expected);
        }
        self.ordered(expected)
    }

    /// Another way for one that has stood on its way for long, if that leads it to its goal clearly sooner.
    fn sooner(&mut self, index: usize, led: &[usize], expected: &Expected) -> Option<Expected> {
        let mut late = self.late(index, led, expected);
        late.retain(|&other| other != index);
        let moved = self.with_moved(index, &late, expected, EXPANSIONS_QUICK);
        let found = moved.or_else(|| self.with_moved(index, &[], expected, EXPANSIONS_QUICK))?;
        let gained = expected.lines[&index].end().saturating_sub(found.lines[&index].end());
        (gained > SOONER_TICKS).then_some(found)
    }

    /// A way for this one, if it has to be at another time or with other ways of those that may get some.
    fn one(&mut self, index: usize, led: &[usize], expected: &Expected) -> Option<Expected> {
        let again = self.job.members[index].misses >= QUICK_TRIES;
        let most = if again { EXPANSIONS_EACH } else { EXPANSIONS_QUICK };
        let late = self.late(index, led, expected);
        let moved = if late.is_empty() { None } else { self.with_moved(index, &late, expected, most) };
        let mut found = moved.or_else(|| self.with_moved(index, &[], expected, most));
        // Later there is less traffic.
        for wait in WAITS.into_iter().filter(|_| again) {
            if found.is_none() {
                self.wait = wait;
                found = self.with_moved(index, &[], expected, most);
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

    /// With a way of this one, as if these were not on theirs, and other ways of these around it.
    fn with_moved(
        &mut self,
        index: usize,
        moved: &[usize],
        expected: &Expected,
        most: u32,
    ) -> Option<Expected> {
        let mut expected = expected.clone();
        moved.iter().for_each(|&other| expected.leave(other, &self.job.members[other]));
        let others = moved.iter().map(|&other| (other, most.min(EXPANSIONS_QUICK)));
        for (index, most) in std::iter::once((index, most)).chain(others) {
            let soft = expected.soft(&[index]);
            let others = expected.others(index);
            let (way, at_m) = self.single(index, &others, &soft, None, most).ok()?;
            let line = self.job.members[index].driving(&way, &at_m);
            expected.take(index, way, &at_m, line);
        }
        Some(expected)
    }
}
