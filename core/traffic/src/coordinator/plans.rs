//! Joint plans: what goes out as work, and what of the result still fits when it comes back.

use super::discretized_path::DiscretizedPath;
use super::job::{JointJob, JointResult, Member, Plan};
use super::task::Target;
use super::truck::{Route, Truck};
use super::{Coordinator, LISTEN_MS};
use std::collections::BTreeSet;
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_nav::Path;
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
/// A way that begins anew begins at most so far from where the truck is when it gets it, in m; chosen, not
/// measured.
const START_M: f64 = 0.1;
// One that begins farther away the truck would not take up.
const _: () = assert!(START_M < START_WITHIN_M);

impl Coordinator {
    /// Work for another thread, if there is any: at most one job is out at a time, and nothing is
    /// released until its result is back in [`Self::planned`].
    pub fn job(&mut self, now: Stamp) -> Option<JointJob> {
        let began = self.began?;
        if self.job.is_some() || now < self.next_job || now.since_ms(began) < LISTEN_MS {
            return None;
        }
        let members: Vec<Member> = self.trucks.iter().filter_map(|truck| self.member(now, truck)).collect();
        let due = |truck: &Truck| !truck.is_live() && truck.retry_at <= now;
        let is_due = |member: &Member| self.trucks.iter().any(|truck| truck.id == member.id && due(truck));
        if !members.iter().any(|member| member.wanting && is_due(member)) {
            return None;
        }
        let ids: BTreeSet<u32> = members.iter().map(|member| member.id).collect();
        let mut blocks = self.blocks();
        // A member that goes on from its release's end is no obstacle; what one that begins anew may
        // still use of its old way is.
        let goes_on = |truck: &&Truck| ids.contains(&truck.id) && truck.retained.is_empty() && !truck.stalled;
        let on: BTreeSet<u32> = self.trucks.iter().filter(goes_on).map(|truck| truck.id).collect();
        blocks.retain(|block| !on.contains(&block.id));
        self.jobs += 1;
        self.job = Some((self.jobs, now));
        let (order, room) = (self.order.clone(), Arc::clone(&self.room));
        let seed = self.seed.wrapping_add(self.jobs);
        let in_vain = self.in_vain.is_some_and(|at| now.since_ms(at) < IN_VAIN_MS);
        Some(JointJob {
            id: self.jobs,
            room,
            members,
            blocks,
            order,
            seed,
            budget: if in_vain { IN_VAIN_BUDGET } else { BUDGET },
            group_budget: if in_vain { 0 } else { GROUP_BUDGET },
            turn_budget: TURN_BUDGET,
        })
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
            Some(route) => (route.way.clone(), route.done_m, route.release),
            None if truck.stands() => {
                (DiscretizedPath::new(Path::standing(truck.view.pose), &truck.car()), 0.0, 0)
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
            waited_ms: truck.waited_ms(now),
            target: Target { x_m: goal.x_m, y_m: goal.y_m, yaw_rad: goal.yaw_rad },
        })
    }

    /// The result of a job. What does not fit any more is left out: such a truck is not led now.
    pub fn planned(&mut self, now: Stamp, result: JointResult) {
        if self.job.is_none_or(|(id, _)| id != result.id) {
            return;
        }
        self.job = None;
        self.next_job = Stamp::from_ns(now.ns() + PAUSE_MS * 1_000_000);
        self.counters.without_way += u64::from(!result.none.is_empty());
        self.counters.plans += u64::from(!result.plans.is_empty());
        self.counters.grouped += u64::from(result.grouped);
        self.counters.in_turn += u64::from(result.in_turn);
        if self.in_vain.is_none_or(|at| now.since_ms(at) >= IN_VAIN_MS) {
            self.in_vain = (!result.none.is_empty()).then_some(now);
        }
        for none in result.none {
            let fits = |truck: &&mut Truck| truck.id == none.id && truck.revision == none.revision;
            if let Some(truck) = self.trucks.iter_mut().find(fits) {
                truck.retry_ms = (truck.retry_ms * 2).clamp(1000, 10_000);
                truck.retry_at = Stamp::from_ns(now.ns() + truck.retry_ms * 1_000_000);
                truck.none = Some(none);
            }
        }
        let any = !result.plans.is_empty();
        for plan in result.plans {
            let fits = |truck: &&mut Truck| truck.id == plan.id && truck.revision == plan.revision;
            if let Some(truck) = self.trucks.iter_mut().find(fits)
                && plan.way.path.pieces.len() <= Track::MOST_ARCS
            {
                self.plan += 1;
                lead(truck, now, self.plan, plan);
            }
        }
        if any {
            self.order = result.order;
            self.moved = now;
            if !self.is_acyclic() {
                self.counters.cyclic += 1;
                self.trucks.iter_mut().filter(|truck| !truck.is_complete()).for_each(|truck| truck.halt(now));
            }
        }
    }
}

/// Gives a truck its new way.
fn lead(truck: &mut Truck, now: Stamp, plan: u64, found: Plan) {
    let Plan { way, evades, .. } = found;
    let goes_on = |route: &Route| route.way.path.start == way.path.start && !truck.stalled;
    if !truck.route.as_ref().is_some_and(goes_on) {
        let (start, here) = (way.path.start, truck.view.pose);
        if !truck.stands() || libm::hypot(start.x_m - here.x_m, start.y_m - here.y_m) > START_M {
            return;
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
}
