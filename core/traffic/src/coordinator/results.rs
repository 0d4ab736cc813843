//! What of a joint plan's result still fits when it comes back.

use super::Coordinator;
use super::job::{JointResult, Plan};
use super::order::{Order, ways_meet};
use super::outstanding::Outstanding;
use super::plans::IN_VAIN_MS;
use super::separation::{driven_separation_m, separation_m};
use super::truck::{Route, Truck, place_of};
use std::collections::BTreeSet;
use xtb_control::Stamp;
use xtb_nav::navigator::START_WITHIN_M;
use xtb_protocol::messages::Track;

/// Between the end of one joint plan and the beginning of the next, in ms: three turns of the coordinator;
/// chosen, not measured.
const PAUSE_MS: u64 = 300;
/// A way that begins anew begins at most so far from where the truck is when it gets it, in m; chosen, not
/// measured.
const START_M: f64 = 0.1;
// One that begins farther away the truck would not take up.
const _: () = assert!(START_M < START_WITHIN_M);

impl Coordinator {
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
            let has_turn = none.by.as_deref().is_some_and(|by| self.has_its_turn(now, by));
            let truck = &mut self.trucks[index];
            if truck.revision == none.revision {
                truck.retry_ms = (truck.retry_ms * 2).clamp(1000, 10_000);
                truck.retry_at = now.plus_ms(truck.retry_ms);
                truck.none = Some(none);
                if out.is_part {
                    truck.missed(now, has_turn);
                }
            }
        }
        if result.plans.is_empty() {
            return;
        }
        self.moved = now;
        let given = self.give(now, &out, result.plans, &result.order);
        self.take_order(&out, &given, result.order);
        if out.is_part {
            self.wake(now, &given);
        }
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

    /// Whether this one waits for a way itself, and nobody is known to be in the way of it.
    fn has_its_turn(&self, now: Stamp, name: &str) -> bool {
        let waits = |truck: &Truck| {
            truck.can_be_led(now)
                && !truck.is_live()
                && truck.none.as_ref().is_none_or(|none| none.by.is_none())
        };
        self.named(name).is_some_and(waits)
    }

    /// Who waited for the place of one that leaves it now tries again.
    fn wake(&mut self, now: Stamp, given: &BTreeSet<u32>) {
        let names: BTreeSet<String> = given
            .iter()
            .filter_map(|&id| place_of(&self.trucks, id))
            .map(|index| self.trucks[index].view.name.clone())
            .collect();
        let waited = |truck: &&mut Truck| {
            truck.none.as_ref().is_some_and(|none| none.by.as_ref().is_some_and(|by| names.contains(by)))
        };
        for truck in self.trucks.iter_mut().filter(waited) {
            (truck.retry_at, truck.retry_ms) = (truck.retry_at.min(now), 0);
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

    /// One that is gone needs nothing of anybody, nor anybody of it.
    pub(super) fn drop_order_of(&mut self, gone: u32) {
        self.order.retain(|(one, other), _| *one != gone && *other != gone);
    }
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

#[cfg(test)]
mod tests {
    use super::super::ReportedRobot;
    use super::super::order::set_needs;
    use super::super::room::GridRoom;
    use super::*;
    use std::sync::Arc;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Car, MapPose};

    fn view(name: &str, x_m: f64) -> ReportedRobot {
        ReportedRobot {
            name: name.to_owned(),
            epoch: 1,
            car: Some(Car::of(&VehicleConfig::default())),
            pose: MapPose { x_m, y_m: 2.0, yaw_rad: 0.0 },
            sigma_m: 0.01,
            speed_mps: 0.0,
            goal: None,
            route: None,
            blocked_at_m: None,
            drives: true,
            age_ms: 0,
        }
    }

    #[test]
    fn nothing_of_the_passing_order_is_kept_of_a_robot_that_is_forgotten() {
        let mut coordinator = Coordinator::new(Arc::new(GridRoom::with(8.0, 4.0, &[])), 1);
        for (name, x_m) in [("a", 1.0), ("b", 4.0), ("c", 7.0)] {
            coordinator.robot(Stamp::from_ms(1000), view(name, x_m));
        }
        for pair in [(1, 2), (1, 3), (2, 1), (3, 2)] {
            set_needs(&mut coordinator.order, pair, &[0, 1]);
        }
        coordinator.forget("b");
        assert_eq!(coordinator.order.keys().copied().collect::<Vec<_>>(), [(1, 3)]);
    }
}
