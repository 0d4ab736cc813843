//! Joint plans: what goes out as work, and what of the result still fits when it comes back.

use super::discretized_path::DiscretizedPath;
use super::job::{JointJob, JointResult, Member, Plan};
use super::order::{Order, ways_meet};
use super::outstanding::Outstanding;
use super::separation::{driven_separation_m, separation_m};
use super::task::Target;
use super::truck::{Route, Truck, place_of};
use super::{Coordinator, LISTEN_MS};
use std::collections::BTreeSet;
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_nav::Path;
use xtb_nav::geometry::rect::{LOOK_OUT_M, Rect, Stand};
use xtb_nav::navigator::START_WITHIN_M;
use xtb_protocol::messages::Track;

/// With so many arcs a truck goes to its release's end and begins anew there: 96 are left for what a search
/// adds before the path is too long to be sent; chosen, not measured.
const MANY_ARCS: usize = Track::MOST_ARCS - 96;
/// Between the end of one joint plan and the beginning of the next, in ms: three turns of the coordinator;
/// chosen, not measured.
const PAUSE_MS: u64 = 300;
/// Nodes that a joint plan may expand for orders of priorities; chosen, not measured.
const BUDGET: u32 = 30_000;
/// The same for groups for which no order works; chosen, not measured.
const GROUP_BUDGET: u32 = 8_000;
/// The same for serving one after the other; chosen, not measured.
const TURN_BUDGET: u32 = 24_000;
/// After a joint plan that did not lead everybody to its goal: orders of priorities for so long …
const IN_VAIN_MS: u64 = 10_000;
/// … only with so few nodes, and no groups; both chosen, not measured.
const IN_VAIN_BUDGET: u32 = 6_000;
/// Joint plans that are made at a time, each for its own region; chosen, not measured.
pub const MOST_JOBS: usize = 4;
/// So many trucks in a region are planned together, with all that a joint plan can do; of more only those that need
/// a way, while the others drive on. Chosen, not measured.
const TOGETHER: usize = 16;
/// So many of these at once, and nodes for them in all; chosen, not measured.
const MOST_AT_ONCE: usize = 8;
const EACH_BUDGET: u32 = 24_000;
/// So many that are led past one of these, or past its goal, may get other ways for it; chosen, not measured.
const MOST_NEIGHBOURS: usize = 12;
/// After so many tries one by one it is planned together with them in all ways …
const ALONE_TRIES: u32 = 4;
/// … if they come within so many m, with so many nodes each for orders and for serving one; all chosen, not measured.
const NEIGHBOUR_M: f64 = 1.5;
const THOROUGH_BUDGET: u32 = 8_000;
/// A way that begins anew begins at most so far from where the truck is when it gets it, in m; chosen, not
/// measured.
const START_M: f64 = 0.1;
// One that begins farther away the truck would not take up.
const _: () = assert!(START_M < START_WITHIN_M);

/// How ways are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Look {
    /// For all of a region.
    Together,
    /// For each that has none, around all others as they go.
    Each,
    /// For one that has none, and for some that are in its way.
    Thorough,
}

impl Coordinator {
    /// Work for another thread, if there is any: for each region at most one job is out at a time, and
    /// [`MOST_JOBS`] in all. To those for whom it looks for ways nothing is released until its result is back in
    /// [`Self::planned`].
    pub fn job(&mut self, now: Stamp) -> Option<JointJob> {
        let began = self.began?;
        if self.out.len() >= MOST_JOBS || now.since_ms(began) < LISTEN_MS {
            return None;
        }
        if !self.trucks.iter().any(|truck| is_due(truck, now)) {
            return None;
        }
        let busy: BTreeSet<u32> = self.out.iter().flat_map(Outstanding::ids).collect();
        let is_free = |truck: &Truck| !busy.contains(&truck.id) && truck.pause_until <= now;
        let regions = self.regions(now);
        let free = regions.iter().filter(|region| region.iter().all(|&index| is_free(&self.trucks[index])));
        let (members, look) = free.filter_map(|region| self.chosen(now, region)).next()?;
        Some(self.job_of(now, members, look))
    }

    /// Who is planned in a region, and how thoroughly; `None` = nobody now.
    fn chosen(&self, now: Stamp, region: &[usize]) -> Option<(Vec<Member>, Look)> {
        let of = |&index: &usize| self.member(now, &self.trucks[index]).map(|member| (index, member));
        let members: Vec<(usize, Member)> = region.iter().filter_map(of).collect();
        let truck = |index: usize| &self.trucks[index];
        let is_wanted = |(index, member): &(usize, Member)| member.wanting && is_due(truck(*index), now);
        if members.len() <= TOGETHER {
            let all = || members.iter().map(|(_, member)| member.clone()).collect();
            return members.iter().any(is_wanted).then(|| (all(), Look::Together));
        }
        let mut wanted: Vec<usize> = members.iter().filter(|one| is_wanted(one)).map(|one| one.0).collect();
        wanted.retain(|&index| !truck(index).backs_off(now));
        wanted.sort_by_key(|&index| (truck(index).neglected_since(), truck(index).id));
        let &first = wanted.first()?;
        let (wanted, moved, look) = if truck(first).misses > 0 {
            let near = self.neighbours(first, &members);
            let look = if truck(first).misses < ALONE_TRIES { Look::Each } else { Look::Thorough };
            (vec![first], near, look)
        } else {
            wanted.retain(|&index| truck(index).misses == 0);
            wanted.truncate(MOST_AT_ONCE);
            let moved = wanted.iter().flat_map(|&index| self.passing(index, &members)).collect();
            (wanted, moved, Look::Each)
        };
        let mut part = Vec::with_capacity(members.len());
        for (index, member) in members {
            let fixed = !member.wanting && !moved.contains(&index);
            if !member.wanting || wanted.contains(&index) {
                part.push(Member { fixed, ..member });
            }
        }
        Some((part, look))
    }

    /// Those that are led past a truck or its goal, nearest first.
    fn neighbours(&self, of: usize, members: &[(usize, Member)]) -> Vec<usize> {
        let Some((_, member)) = members.iter().find(|(index, _)| *index == of) else { return Vec::new() };
        let here = member.way.stands[member.held].body;
        let apart_m = |body: &Rect, [x_m, y_m]: [f64; 2]| libm::hypot(body.x_m - x_m, body.y_m - y_m);
        let goal_m = [member.target.x_m, member.target.y_m];
        let mut near: Vec<(f64, usize)> = Vec::new();
        for (index, other) in members.iter().filter(|(_, other)| !other.wanting) {
            let rest = &other.way.stands[other.held..];
            let from_m =
                |stand: &Stand| apart_m(&stand.body, [here.x_m, here.y_m]).min(apart_m(&stand.body, goal_m));
            let near_m = rest.iter().map(from_m).fold(f64::MAX, f64::min);
            if near_m < NEIGHBOUR_M {
                near.push((near_m, *index));
            }
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.into_iter().take(MOST_NEIGHBOURS).map(|(_, index)| index).collect()
    }

    /// Those whose ways lead past the goal of a truck: they could be led around it.
    fn passing(&self, of: usize, members: &[(usize, Member)]) -> Vec<usize> {
        let Some((_, member)) = members.iter().find(|(index, _)| *index == of) else { return Vec::new() };
        let goal = &member.target;
        let passes = |other: &Member| {
            let reach_m = other.car.reach_m() + member.car.reach_m() + LOOK_OUT_M;
            let rest = &other.way.stands[other.held..];
            let near =
                |stand: &Stand| libm::hypot(stand.body.x_m - goal.x_m, stand.body.y_m - goal.y_m) < reach_m;
            rest.iter().any(near)
        };
        let others = members.iter().filter(|(_, other)| !other.wanting && passes(other));
        others.map(|(index, _)| *index).take(MOST_NEIGHBOURS).collect()
    }

    fn job_of(&mut self, now: Stamp, members: Vec<Member>, look: Look) -> JointJob {
        let ids: BTreeSet<u32> = members.iter().map(|member| member.id).collect();
        let mut blocks = self.blocks();
        // A member that goes on from its release's end is no obstacle; what one that begins anew may
        // still use of its old way is.
        let goes_on = |truck: &&Truck| ids.contains(&truck.id) && truck.retained.is_empty() && !truck.stalled;
        let on: BTreeSet<u32> = self.trucks.iter().filter(goes_on).map(|truck| truck.id).collect();
        blocks.retain(|block| !on.contains(&block.id));
        self.jobs += 1;
        self.out.push(Outstanding::new(self.jobs, now, look != Look::Together, &members));
        let is_member = |id: &u32| ids.contains(id);
        let order = self.order.iter().filter(|((one, other), _)| is_member(one) && is_member(other));
        let order = order.map(|(pair, needs)| (*pair, Arc::clone(needs))).collect();
        let in_vain = self.trucks.iter().any(|truck| {
            ids.contains(&truck.id) && truck.in_vain.is_some_and(|at| now.since_ms(at) < IN_VAIN_MS)
        });
        let (budget, group_budget, turn_budget) = match look {
            Look::Together if in_vain => (IN_VAIN_BUDGET, 0, TURN_BUDGET),
            Look::Together => (BUDGET, GROUP_BUDGET, TURN_BUDGET),
            Look::Each => (EACH_BUDGET, 0, 0),
            Look::Thorough => (THOROUGH_BUDGET, 0, THOROUGH_BUDGET),
        };
        JointJob {
            id: self.jobs,
            room: Arc::clone(&self.room),
            members,
            blocks,
            order,
            seed: self.seed.wrapping_add(self.jobs),
            budget,
            group_budget,
            turn_budget,
            each_for_itself: look == Look::Each,
        }
    }

    /// A truck as a joint plan sees it; `None` = it is driven around.
    fn member(&self, now: Stamp, truck: &Truck) -> Option<Member> {
        let (_, goal) = truck.goal()?;
        let wanting = !truck.is_live();
        if !truck.can_be_led(now) {
            return None;
        }
        let goes_on =
            truck.route.as_ref().filter(|route| !truck.stalled && route.way.path.pieces.len() < MANY_ARCS);
        let (way, done_m, held) = match goes_on.or(truck.route.as_ref().filter(|_| !wanting)) {
            Some(route) => (Arc::clone(&route.way), route.done_m, route.release),
            None if truck.stands() => {
                (Arc::new(DiscretizedPath::new(Path::standing(truck.view.pose), &truck.car())), 0.0, 0)
            }
            None => return None,
        };
        Some(Member {
            id: truck.id,
            name: truck.view.name.clone(),
            revision: truck.revision,
            car: truck.car(),
            way,
            done_m,
            held,
            wanting,
            fixed: false,
            waited_ms: truck.waited_ms(now),
            target: Target { x_m: goal.x_m, y_m: goal.y_m, yaw_rad: goal.yaw_rad },
        })
    }

    /// The result of a job. What does not fit any more is left out: such a truck is not led now.
    pub fn planned(&mut self, now: Stamp, result: JointResult) {
        let Some(at) = self.out.iter().position(|job| job.id == result.id) else { return };
        let out = self.out.remove(at);
        self.counters.without_way += u64::from(!result.none.is_empty());
        self.counters.plans += u64::from(!result.plans.is_empty());
        self.counters.grouped += u64::from(result.grouped);
        self.counters.in_turn += u64::from(result.in_turn);
        for id in out.ids() {
            let Some(index) = place_of(&self.trucks, id) else { continue };
            let truck = &mut self.trucks[index];
            truck.pause_until = now.plus_ms(PAUSE_MS);
            if !out.is_part && truck.in_vain.is_none_or(|at| now.since_ms(at) >= IN_VAIN_MS) {
                truck.in_vain = (!result.none.is_empty()).then_some(now);
            }
        }
        for none in result.none {
            let Some(index) = place_of(&self.trucks, none.id) else { continue };
            let truck = &mut self.trucks[index];
            if truck.revision == none.revision {
                truck.retry_ms = (truck.retry_ms * 2).clamp(1000, 10_000);
                truck.retry_at = now.plus_ms(truck.retry_ms);
                truck.none = Some(none);
                if out.is_part {
                    truck.missed(now);
                }
            }
        }
        if result.plans.is_empty() {
            return;
        }
        self.moved = now;
        let given = self.give(now, &out, result.plans, &result.order);
        self.take_order(&out, &given, result.order);
        if !self.is_acyclic() {
            self.counters.cyclic += 1;
            let mixed = |id: &u32| given.contains(id) || !out.is_part;
            for id in out.ids().filter(mixed) {
                if let Some(index) = place_of(&self.trucks, id)
                    && !self.trucks[index].is_complete()
                {
                    self.trucks[index].halt(now);
                }
            }
        }
    }

    /// Gives those their new ways that can have them; who they are.
    fn give(&mut self, now: Stamp, out: &Outstanding, plans: Vec<Plan>, order: &Order) -> BTreeSet<u32> {
        let mut given = BTreeSet::new();
        for plan in plans {
            let Some(index) = place_of(&self.trucks, plan.id) else { continue };
            if self.trucks[index].revision != plan.revision {
                continue;
            }
            let id = plan.id;
            let mut fits = plan.way.path.pieces.len() <= Track::MOST_ARCS;
            if fits && let Some(anywhere) = self.conflict(index, &plan, out, &given, order) {
                fits = false;
                self.counters.outdated += 1;
                let truck = &mut self.trucks[index];
                truck.anywhere |= anywhere;
                truck.retry_at = now;
            }
            if fits {
                self.plan += 1;
            }
            let number = self.plan;
            let truck = &mut self.trucks[index];
            if fits && lead(truck, now, number, plan) {
                given.insert(id);
            } else {
                // What the others were told of it holds no more: who has an older way keeps what it holds of it.
                truck.halt(now);
            }
        }
        given
    }

    /// Whether somebody who was not planned with this one, or has gone on meanwhile, may be in the way of its new
    /// way: and whether it was one that the job knew nothing of.
    fn conflict(
        &self,
        index: usize,
        plan: &Plan,
        out: &Outstanding,
        given: &BTreeSet<u32>,
        order: &Order,
    ) -> Option<bool> {
        let truck = &self.trucks[index];
        let goes_on = truck.route.as_ref().is_some_and(|route| continues(route, truck, plan));
        let reached = if goes_on { truck.confirmed() } else { 0 };
        let others = self.trucks.iter().filter(|other| other.id != plan.id && !given.contains(&other.id));
        for other in others {
            let Some(route) = other.route.as_ref().filter(|route| route.live) else { continue };
            match out.told(other.id).filter(|told| told.revision == other.revision) {
                Some(told) if told.fixed => {
                    let Some(needs) = order.get(&(other.id, plan.id)) else { continue };
                    if (told.held + 1..=route.release).any(|place| needs.at(place) > reached) {
                        return Some(false);
                    }
                }
                Some(_) => {}
                None => {
                    let separation_m = driven_separation_m(separation_m(truck.held(), other.held()));
                    let rest = (&*route.way, other.confirmed());
                    if ways_meet((&*plan.way, reached), rest, separation_m) {
                        return Some(true);
                    }
                }
            }
        }
        None
    }

    /// The order of those who have new ways among each other and with all who were planned with them.
    fn take_order(&mut self, out: &Outstanding, given: &BTreeSet<u32>, order: Order) {
        let is_given = |pair: &(u32, u32)| given.contains(&pair.0) || given.contains(&pair.1);
        self.order.retain(|pair, _| !is_given(pair));
        let is_as_told = |id: u32| {
            let truck = place_of(&self.trucks, id).map(|index| &self.trucks[index]);
            given.contains(&id)
                || out.told(id).zip(truck).is_some_and(|(told, truck)| told.revision == truck.revision)
        };
        let new: Order = order
            .into_iter()
            .filter(|(pair, _)| is_given(pair) && is_as_told(pair.0) && is_as_told(pair.1))
            .collect();
        self.order.extend(new);
    }
}

/// Whether a truck is waiting for a way and its next try is due.
fn is_due(truck: &Truck, now: Stamp) -> bool {
    !truck.is_live() && truck.retry_at <= now && truck.can_be_led(now)
}

/// Whether it has no way among many, and the next look for one is a more thorough one.
pub(super) fn is_looked_for_further(truck: &Truck) -> bool {
    !truck.is_live() && (1..=ALONE_TRIES).contains(&truck.misses)
}

/// Whether a plan goes on from what is released of a route.
fn continues(route: &Route, truck: &Truck, plan: &Plan) -> bool {
    route.way.path.start == plan.way.path.start && !truck.stalled
}

/// Gives a truck its new way. False if it is not where that begins.
fn lead(truck: &mut Truck, now: Stamp, plan: u64, found: Plan) -> bool {
    let goes_on = truck.route.as_ref().is_some_and(|route| continues(route, truck, &found));
    let Plan { way, evades, .. } = found;
    if !goes_on {
        let (start, here) = (way.path.start, truck.view.pose);
        if !truck.stands() || libm::hypot(start.x_m - here.x_m, start.y_m - here.y_m) > START_M {
            return false;
        }
        truck.retain_held();
        truck.route = None;
    }
    truck.revision += 1;
    truck.none = truck.none.take().filter(|_| evades);
    truck.busy = now;
    truck.stalled = false;
    if !evades {
        truck.is_served(now);
    }
    let continued = truck.route.take();
    truck.route = Some(match continued {
        Some(before) => Route { plan, way, live: true, evades, ..before },
        None => Route { plan, base: plan, way, done_m: 0.0, release: 0, release_m: 0.0, live: true, evades },
    });
    true
}
