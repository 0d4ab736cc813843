//! A joint plan: one truck after the other around those before it, in several orders.
//!
//! First only those without a way look for one around the others' expected times; if no order works,
//! everybody with a goal gives up what is not released yet and looks anew; if that does not work
//! either, a few of them are planned at once, by conflict-based search; after that, whoever failed most
//! often only makes way for the rest; if it cannot, it stands.

use super::blocker_search::blocker;
use super::discretized_path::DiscretizedPath;
use super::expected::Expected;
use super::field::Field;
use super::job::{JointJob, JointResult, Member, NoWay, Plan};
use super::occupancy::Occupancy;
use super::order::Order;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Orders that are tried with some of the trucks, at most; chosen, not measured.
const TRIES: usize = 8;
/// Expansions to find out who is in whose way, in all: three ways; chosen, not measured.
const EXPANSIONS_BLOCKERS: u32 = 12_000;
/// Who has waited for longer than this is served before ways for all are looked for, in ms; chosen, not
/// measured.
pub(super) const PATIENCE_MS: u64 = 30_000;
/// Longest plan, in ticks (20 min), so that it ends; chosen, not measured.
pub(super) const MOST_TICKS: usize = 4800;

/// Ways and orders that fit together.
pub(super) struct Solution {
    pub(super) ways: BTreeMap<usize, Arc<DiscretizedPath>>,
    pub(super) order: Order,
}

/// The truck for which an order did not work.
pub(super) struct Failed(pub(super) usize);

pub(super) struct Solver<'a> {
    pub(super) job: &'a JointJob,
    pub(super) keep_going: &'a mut dyn FnMut() -> bool,
    pub(super) fields: BTreeMap<usize, Field>,
    pub(super) blocks: Vec<Occupancy>,
    pub(super) reserved: Vec<Occupancy>,
    /// Who keep their ways, and as what they are expected.
    pub(super) running: Option<(Vec<usize>, Option<Expected>)>,
    pub(super) left: u32,
    /// Ways that are looked for begin so much later, in ticks.
    pub(super) wait: u32,
    pub(super) group_left: u32,
    pub(super) turn_left: u32,
    random: u64,
    tries: u32,
    pub(super) choices: u32,
    pub(super) failures: BTreeMap<usize, u32>,
    /// Those that have no way to their goals and only make way.
    pub(super) evading: BTreeSet<usize>,
    /// One of these that cannot.
    stuck: Option<usize>,
    /// For whom the others make way.
    pub(super) served: Option<usize>,
    /// Where each looks for itself: at whose goals somebody stays, and who that is.
    pub(super) behind: BTreeMap<usize, String>,
    /// The same: for whom no nodes were left.
    pub(super) untried: BTreeSet<usize>,
}

impl JointJob {
    /// Looks for ways until all have one, nothing is left to try, or `keep_going` says no (asked
    /// before each truck's search).
    #[must_use]
    pub fn solve(&self, keep_going: &mut dyn FnMut() -> bool) -> JointResult {
        let mut solver = Solver::new(self, keep_going);
        let wanting: Vec<usize> = self.indices(|member| member.wanting).collect();
        if self.each_for_itself {
            let solution = solver.each(&wanting);
            return self.result(solver, solution, false);
        }
        let led: Vec<usize> = self.indices(|member| !member.wanting && !member.fixed).collect();
        // Whoever has waited for long is not passed over again.
        let in_turn = wanting.iter().any(|&index| self.members[index].waited_ms > PATIENCE_MS);
        let mut solution = if in_turn { solver.in_turn(&wanting, &led) } else { None };
        let mut grouped = false;
        if solution.is_none() {
            (solution, grouped) = solver.all_at_once();
        }
        if solution.is_none() && !in_turn {
            solution = solver.in_turn(&wanting, &led);
        }
        self.result(solver, solution, grouped)
    }

    /// What is told where [`solve`](Self::solve) has panicked: nobody has got a way yet.
    #[must_use]
    pub fn given_up(&self) -> JointResult {
        let none = self.indices(|member| member.wanting).map(|index| NoWay::yet(&self.members[index]));
        JointResult {
            id: self.id,
            plans: Vec::new(),
            order: Order::default(),
            none: none.collect(),
            expansions: 0,
            tries: 0,
            choices: 0,
            grouped: false,
            in_turn: false,
        }
    }

    /// What is told of it.
    fn result(&self, solver: Solver<'_>, solution: Option<Solution>, grouped: bool) -> JointResult {
        let planned = |index: usize| {
            !solver.evading.contains(&index)
                && solution.as_ref().is_some_and(|found| found.ways.contains_key(&index))
        };
        let is_told = |index: &usize| !planned(*index) && !solver.untried.contains(index);
        let without: Vec<usize> = self.indices(|member| member.wanting).filter(is_told).collect();
        // A share each: who is asked last gets an answer too.
        let share = EXPANSIONS_BLOCKERS / without.len().max(1) as u32;
        let mut none = Vec::with_capacity(without.len());
        let mut left = 0;
        for index in without {
            left += share;
            let member = &self.members[index];
            none.push(match solver.served {
                Some(served) => NoWay::behind(member, &self.members[served].name),
                None if self.each_for_itself => match solver.behind.get(&index) {
                    Some(name) => NoWay::behind(member, name),
                    None => NoWay::yet(member),
                },
                None => blocker(self, member, &mut left),
            });
        }
        let spent = |most: u32, left: u32| most - left;
        let expansions = spent(self.budget, solver.left)
            + spent(self.group_budget, solver.group_left)
            + spent(self.turn_budget, solver.turn_left);
        let (tries, choices) = (solver.tries, solver.choices);
        let (ways, order) = solution.map_or_else(Default::default, |found| (found.ways, found.order));
        let plan = |(index, way): (usize, Arc<DiscretizedPath>)| {
            let member: &Member = &self.members[index];
            let evades = solver.evading.contains(&index);
            let moves = way.length_m > member.way.at_m(member.held) + 0.01;
            (moves || !evades).then_some(Plan { id: member.id, revision: member.revision, way, evades })
        };
        JointResult {
            id: self.id,
            plans: ways.into_iter().filter_map(plan).collect(),
            order,
            none,
            expansions,
            tries,
            choices,
            grouped,
            in_turn: solver.served.is_some(),
        }
    }
}

impl<'a> Solver<'a> {
    pub(super) fn new(job: &'a JointJob, keep_going: &'a mut dyn FnMut() -> bool) -> Self {
        Self {
            job,
            keep_going,
            fields: BTreeMap::new(),
            blocks: job.blocks.iter().map(|block| Occupancy::standing(&block.stands)).collect(),
            reserved: job.reserved.iter().map(|goal| Occupancy::standing(&[goal.stand])).collect(),
            running: None,
            left: job.budget,
            wait: 0,
            group_left: job.group_budget,
            turn_left: job.turn_budget,
            random: job.seed,
            tries: 0,
            choices: 0,
            failures: BTreeMap::new(),
            evading: BTreeSet::new(),
            stuck: None,
            served: None,
            behind: BTreeMap::new(),
            untried: BTreeSet::new(),
        }
    }

    /// Ways for all to their goals, as far as there are any; and whether a group was planned at once.
    fn all_at_once(&mut self) -> (Option<Solution>, bool) {
        let mut standing = BTreeSet::new();
        loop {
            let rest = |index: &usize| !standing.contains(index) && !self.evading.contains(index);
            let wanting: Vec<usize> = self.job.indices(|member| member.wanting).filter(rest).collect();
            if wanting.is_empty() || self.spent() {
                self.evading.clear();
                return (None, false);
            }
            let led: Vec<usize> = self.job.indices(|member| !member.wanting && !member.fixed).collect();
            if let Some(found) = self.orders(&wanting, &led, &standing) {
                return (Some(found), false);
            }
            let all: Vec<usize> = led.iter().chain(&wanting).copied().collect();
            if !led.is_empty()
                && let Some(found) = self.orders(&all, &[], &standing)
            {
                return (Some(found), false);
            }
            if self.stuck.is_none()
                && let Some(found) = self.group(&all, &standing)
            {
                return (Some(found), true);
            }
            if let Some(stuck) = self.stuck.take() {
                self.evading.remove(&stuck);
                standing.insert(stuck);
                continue;
            }
            let worst = wanting.iter().max_by_key(|&&index| self.failures.get(&index).copied().unwrap_or(0));
            self.evading.extend(worst.copied());
        }
    }

    pub(super) fn spent(&mut self) -> bool {
        self.left == 0 || !(self.keep_going)()
    }

    /// Tries orders of `free`: whoever failed goes first in the next one, then by chance.
    fn orders(&mut self, free: &[usize], led: &[usize], standing: &BTreeSet<usize>) -> Option<Solution> {
        let mut order = free.to_vec();
        let mut seen = BTreeSet::new();
        for round in 1..=TRIES {
            if self.spent() {
                return None;
            }
            self.tries += 1;
            seen.insert(order.clone());
            match self.attempt(&order, led, standing) {
                Ok(found) => return Some(found),
                Err(Failed(index)) if self.evading.contains(&index) => {
                    self.stuck = Some(index);
                    return None;
                }
                Err(Failed(index)) => {
                    *self.failures.entry(index).or_default() += 1;
                    if order.first() == Some(&index) {
                        // Not even as the first one.
                        *self.failures.entry(index).or_default() += 1000;
                        return None;
                    }
                    order.retain(|&other| other != index);
                    order.insert(0, index);
                }
            }
            if round % 3 == 0 {
                self.shuffle(&mut order);
            }
            for _ in 0..20 {
                if !seen.contains(&order) {
                    break;
                }
                self.shuffle(&mut order);
            }
            if seen.contains(&order) {
                return None;
            }
        }
        None
    }

    fn shuffle(&mut self, order: &mut [usize]) {
        for last in (1..order.len()).rev() {
            order.swap(last, (self.draw() % (last as u64 + 1)) as usize);
        }
    }

    /// SplitMix64 (G. Steele, D. Lea and C. Flood, 2014).
    fn draw(&mut self) -> u64 {
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.random;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }
}
