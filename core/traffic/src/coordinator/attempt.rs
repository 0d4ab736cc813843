//! One order of priorities, or a group planned at once and the rest in an order: one truck's way after
//! the other, and who passes first where.

use super::arrival_times::{Around, arrival_times, go_on};
use super::discretized_path::DiscretizedPath;
use super::expected::Expected;
use super::field::Field;
use super::job::Member;
use super::joint::{Failed, MOST_TICKS, Solution, Solver};
use super::occupancy::Occupancy;
use super::order::{Runner, Timed, pair, run_ahead, set_needs};
use super::separation::{driven_separation_m, separation_m};
use super::task::{Course, EXPANSIONS_EACH, Other, Stuck};
use std::collections::BTreeSet;
use std::rc::Rc;
use xtb_nav::geometry::rect::Rect;

impl Solver<'_> {
    /// Before anybody of `free` has a way. `None` if those who have one block each other.
    pub(super) fn expected(
        &mut self,
        free: &[usize],
        led: &[usize],
        standing: &BTreeSet<usize>,
    ) -> Option<Expected> {
        let mut expected = self.running(led)?;
        let job = self.job;
        for &index in standing {
            let line = Occupancy::standing(job.members[index].held_stands());
            expected.lines.insert(index, Rc::new(line));
        }
        for &index in free.iter().chain(&self.evading) {
            expected.leave(index, &job.members[index]);
        }
        Some(expected)
    }

    /// Those who keep their ways, as they go by the order: the same for each order of the others.
    fn running(&mut self, led: &[usize]) -> Option<Expected> {
        if let Some((_, known)) = self.running.as_ref().filter(|(of, _)| of == led) {
            return known.clone();
        }
        let job = self.job;
        let all: Vec<usize> = led.iter().copied().chain(job.indices(|member| member.fixed)).collect();
        let runners: Vec<Runner<'_>> = all.iter().map(|&index| runner(&job.members[index], None)).collect();
        let expected = run_ahead(&runners, &job.order, MOST_TICKS).map(|ways| {
            let mut expected = Expected::default();
            for (&index, at_m) in all.iter().zip(ways) {
                let member = &job.members[index];
                expected.lines.insert(index, Rc::new(member.driving(&member.way, &at_m)));
                expected.times.insert(index, Rc::new(arrival_times(&member.way, &at_m)));
            }
            expected
        });
        self.running = Some((led.to_vec(), expected.clone()));
        expected
    }

    /// One order.
    pub(super) fn attempt(
        &mut self,
        free: &[usize],
        led: &[usize],
        standing: &BTreeSet<usize>,
    ) -> Result<Solution, Failed> {
        let fallback = || Failed(free.last().copied().unwrap_or(0));
        let expected = self.expected(free, led, standing).ok_or_else(fallback)?;
        self.one_by_one(expected, free)
    }

    /// Ways for these in this order, then for those that make way.
    pub(super) fn one_by_one(&mut self, mut expected: Expected, free: &[usize]) -> Result<Solution, Failed> {
        let evading: Vec<usize> = self.evading.iter().copied().collect();
        for &index in free.iter().chain(&evading) {
            let soft = expected.soft(&[index]);
            let aside = self.evading.contains(&index).then(|| self.aside(index, &expected));
            let course = aside.as_ref().map_or(Course::ToGoal, Course::Aside);
            let found = self.single(index, &expected.others(index), &soft, course, EXPANSIONS_EACH);
            let (way, at_m) = found.map_err(|_| Failed(index))?;
            let line = self.job.members[index].driving(&way, &at_m);
            expected.take(index, way, &at_m, line);
        }
        let last = free.last().or(evading.last()).copied().unwrap_or(0);
        self.ordered(expected).ok_or(Failed(last))
    }

    /// How far it is from anywhere to where this one is off all ways that are known by now.
    pub(super) fn aside(&self, index: usize, expected: &Expected) -> Field {
        let (job, member) = (self.job, &self.job.members[index]);
        let standing: Vec<Rect> = job.bodies_around(member).collect();
        let taken: Vec<Rect> = expected.taken(index).collect();
        Field::aside(&*job.room, member.car.half_width_m, &standing, &taken)
    }

    /// How far it is from anywhere to the goal of this one.
    pub(super) fn field(&mut self, index: usize) -> &Field {
        let (job, member) = (self.job, &self.job.members[index]);
        self.fields.entry(index).or_insert_with(|| {
            let (standing, target): (Vec<Rect>, _) = (job.bodies_around(member).collect(), member.target);
            Field::new(&*job.room, member.car.half_width_m, &standing, [target.x_m, target.y_m])
        })
    }

    /// The way of one truck around all these, with its position on it at each tick. At most so many nodes are expanded.
    pub(super) fn single(
        &mut self,
        index: usize,
        lines: &[(usize, &Occupancy)],
        soft: &[Rect],
        course: Course<'_>,
        most: u32,
    ) -> Result<(DiscretizedPath, Vec<f64>), Stuck> {
        if self.spent() {
            return Err(Stuck::Budget);
        }
        let (job, member) = (self.job, &self.job.members[index]);
        let (aside, rest) = match course {
            Course::ToGoal => (None, None),
            Course::Aside(field) => (Some(field), None),
            Course::Along(rest) => (None, Some(rest)),
        };
        if aside.is_none() {
            self.field(index);
        }
        let Some(field) = aside.or_else(|| self.fields.get(&index)) else { return Err(Stuck::Nowhere) };
        let mine = member.held_stands();
        let others: Vec<Other<'_>> = lines
            .iter()
            .map(|&(other, line)| Other {
                line,
                separation_m: separation_m(mine, job.members[other].held_stands()),
                is_thing: false,
            })
            .chain(self.blocks.iter().zip(&job.blocks).filter(|(_, block)| block.concerns(member.id)).map(
                |(line, block)| Other {
                    line,
                    separation_m: separation_m(mine, &block.stands),
                    is_thing: block.only.is_some(),
                },
            ))
            // Who only makes way may go anywhere.
            .chain(job.reserved_for(member).filter(|_| aside.is_none()).map(|place| Other {
                line: &self.reserved[place],
                separation_m: separation_m(mine, &[job.reserved[place].stand]),
                is_thing: false,
            }))
            .collect();
        let target = aside.is_none().then_some(member.target);
        go_on(
            job,
            member,
            &Around { target, field, others: &others, soft, wait: self.wait, rest },
            most,
            &mut self.left,
        )
    }

    /// Who passes first where; `None` if they would block each other.
    pub(super) fn ordered(&self, expected: Expected) -> Option<Solution> {
        let (job, Expected { ways, times, .. }) = (self.job, expected);
        let way = |index: usize| &**ways.get(&index).unwrap_or(&job.members[index].way);
        let keeps = |index: &usize| !ways.contains_key(index);
        let timed = |index: usize| {
            let member = &job.members[index];
            let at = way(index).place(member.done_m).min(member.held);
            Timed { way: way(index), at, held: member.held, ticks: &times[&index] }
        };
        let mut order = job.order.clone();
        let moving: Vec<usize> = times.keys().copied().collect();
        for (place, &a) in moving.iter().enumerate() {
            for &b in &moving[place + 1..] {
                if keeps(&a) && keeps(&b) {
                    continue;
                }
                let (one, other) = (&job.members[a], &job.members[b]);
                if !way(a).may_meet(way(b)) {
                    order.remove(&(one.id, other.id));
                    order.remove(&(other.id, one.id));
                    continue;
                }
                let separation_m = driven_separation_m(separation_m(one.held_stands(), other.held_stands()));
                let (a_needs, b_needs) = pair(&timed(a), &timed(b), separation_m);
                set_needs(&mut order, (one.id, other.id), &a_needs);
                set_needs(&mut order, (other.id, one.id), &b_needs);
            }
        }
        let runners: Vec<Runner<'_>> =
            moving.iter().map(|&index| runner(&job.members[index], Some(way(index)))).collect();
        run_ahead(&runners, &order, MOST_TICKS)?;
        Some(Solution { ways, order })
    }
}

fn runner<'a>(member: &'a Member, way: Option<&'a DiscretizedPath>) -> Runner<'a> {
    Runner { id: member.id, way: way.unwrap_or(&member.way), done_m: member.done_m }
}
