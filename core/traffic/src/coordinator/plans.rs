//! Joint plans: what goes out as work.

use super::discretized_path::DiscretizedPath;
use super::job::{JointJob, Member, Reserved};
use super::outstanding::Outstanding;
use super::task::Target;
use super::truck::{Truck, place_of};
use super::{Coordinator, LISTEN_MS};
use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_nav::geometry::rect::{LOOK_OUT_M, Stand};
use xtb_nav::{Car, MapPose, Path};
use xtb_protocol::messages::Track;

/// With so many arcs a truck goes to its release's end and begins anew there: 96 are left for what a search
/// adds before the path is too long to be sent; chosen, not measured.
const MANY_ARCS: usize = Track::MOST_ARCS - 96;
/// Nodes that a joint plan may expand for orders of priorities; chosen, not measured.
const BUDGET: u32 = 30_000;
/// The same for groups for which no order works; chosen, not measured.
const GROUP_BUDGET: u32 = 8_000;
/// The same for serving one after the other; chosen, not measured.
const TURN_BUDGET: u32 = 24_000;
/// After a joint plan that did not lead everybody to its goal: orders of priorities for so long …
pub(super) const IN_VAIN_MS: u64 = 10_000;
/// … only with so few nodes, and no groups; both chosen, not measured.
const IN_VAIN_BUDGET: u32 = 6_000;
/// Joint plans that are made at a time, each for its own region; chosen, not measured.
pub const MOST_JOBS: usize = 4;
/// So many trucks in a region are planned together, with all that a joint plan can do; of more only those that need
/// a way, while the others drive on. Chosen, not measured.
const TOGETHER: usize = 16;
/// So many of these at once, as far as the nodes last; both chosen, not measured.
const MOST_AT_ONCE: usize = 24;
const EACH_BUDGET: u32 = 12_000;
/// If no more than these are without a way, each has its turn soon: two jobs; chosen, not measured.
pub(super) const MOST_SOON: usize = 2 * MOST_AT_ONCE;
/// So many that are led past one of these, or past its goal, may get other ways for it; chosen, not measured.
const MOST_NEIGHBOURS: usize = 12;
/// The same for all of these; chosen, not measured.
const MOST_MOVED: usize = 144;
/// After so many tries in vain a truck is planned together with those near it in all ways …
const ALONE_TRIES: u32 = 4;
/// … if they come within so many m, with so many nodes each for orders and for serving one; all chosen, not measured.
const NEIGHBOUR_M: f64 = 1.5;
const THOROUGH_BUDGET: u32 = 8_000;
/// So many without a way are among them at most; chosen, not measured.
const MOST_WANTING: usize = 4;
/// Who has stood on its way for so long, in ms, is looked after again …
const SLOW_MS: u64 = 15_000;
/// … but not more often than this, in ms, and at most so many at once; all chosen, not measured.
const SLOW_AGAIN_MS: u64 = 10_000;
const MOST_SLOW: usize = 8;
/// Who has been delayed for so long among many, in ms, has its goal reserved …
const RESERVED_MS: u64 = 15_000;
/// … for so many at most; both chosen, not measured.
const MOST_RESERVED: usize = 12;
/// So many links of trucks that wait for each other's places are followed; chosen, not measured.
const MOST_LINKS: usize = 8;

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
        let mut free: Vec<&Vec<usize>> = regions
            .iter()
            .filter(|region| region.iter().all(|&index| is_free(&self.trucks[index])))
            .collect();
        // The one that was planned longest ago: those that find no way again and again leave the others their turns.
        free.sort_by_key(|region| region.iter().map(|&index| self.trucks[index].pause_until).max());
        let reserved = self.reserved(now);
        let (members, look) = free.into_iter().find_map(|region| self.chosen(now, region, &reserved))?;
        let reserved = if look == Look::Together { Vec::new() } else { reserved };
        Some(self.job_of(now, members, look, reserved))
    }

    /// Who is planned in a region, and how thoroughly; `None` = nobody now.
    fn chosen(&self, now: Stamp, region: &[usize], reserved: &[Reserved]) -> Option<(Vec<Member>, Look)> {
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
        let since = self.neglected_since();
        wanted.sort_by_key(|&index| (since[index], truck(index).id));
        let &first = wanted.first()?;
        let misses = truck(first).misses;
        let mut slow = Vec::new();
        let (wanted, moved, look): (Vec<usize>, BTreeSet<usize>, Look) = if misses < ALONE_TRIES {
            wanted.retain(|&index| truck(index).misses < ALONE_TRIES);
            wanted.truncate(MOST_AT_ONCE);
            slow = self.slow(now, &members);
            let has_reserved = |&&index: &&usize| reserved.iter().any(|goal| goal.id == truck(index).id);
            let reserving = slow.iter().filter(has_reserved);
            let moved = reserving.chain(&wanted).flat_map(|&index| self.passing(index, &members));
            let moved = moved.take(MOST_MOVED).collect();
            (wanted, moved, Look::Each)
        } else {
            let others = self.neighbours(first, &members, true).into_iter().take(MOST_WANTING - 1);
            let wanted = std::iter::once(first).chain(others).collect();
            (wanted, self.neighbours(first, &members, false).into_iter().collect(), Look::Thorough)
        };
        let mut part = Vec::with_capacity(members.len());
        for (index, member) in members {
            let place = |among: &[usize]| among.iter().position(|&other| other == index);
            let (rank, slow) = (place(&wanted), place(&slow));
            let fixed = !member.wanting && slow.is_none() && !moved.contains(&index);
            if !member.wanting || rank.is_some() {
                part.push(((rank, slow), Member { fixed, slow: slow.is_some(), ..member }));
            }
        }
        // What is left of the nodes goes to the most neglected first.
        part.sort_by_key(|(rank, _)| *rank);
        Some((part.into_iter().map(|(_, member)| member).collect(), look))
    }

    /// Those that have stood for longest with ways to their goals, and were not looked after lately; the first one longest.
    fn slow(&self, now: Stamp, members: &[(usize, Member)]) -> Vec<usize> {
        let truck = |index: usize| &self.trucks[index];
        let is_slow = |&index: &usize| {
            truck(index).stood_ms > SLOW_MS
                && now.since_ms(truck(index).looked_after) > SLOW_AGAIN_MS
                && truck(index).route.as_ref().is_some_and(|route| !route.evades)
        };
        let led = members.iter().filter(|(_, member)| !member.wanting).map(|(index, _)| *index);
        let mut slow: Vec<usize> = led.filter(is_slow).collect();
        slow.sort_by_key(|&index| Reverse(truck(index).stood_ms));
        slow.truncate(MOST_SLOW);
        slow
    }

    /// Since when each truck, or one that waits for it to leave a place, has not been looked after.
    fn neglected_since(&self) -> Vec<Stamp> {
        let mut since: Vec<Stamp> = self.trucks.iter().map(Truck::neglected_since).collect();
        for index in 0..since.len() {
            let (mut last, at) = (index, since[index]);
            for _ in 0..MOST_LINKS {
                let none = self.trucks[last].none.as_ref().filter(|_| !self.trucks[last].is_live());
                let by = none.and_then(|none| self.named(none.by.as_deref()?));
                let Some(next) = by.and_then(|truck| place_of(&self.trucks, truck.id)) else { break };
                since[next] = since[next].min(at);
                last = next;
            }
        }
        since
    }

    /// Those that are led past a truck or its goal, or that stand there without a way, nearest first.
    fn neighbours(&self, of: usize, members: &[(usize, Member)], wanting: bool) -> Vec<usize> {
        let Some((_, member)) = members.iter().find(|(index, _)| *index == of) else { return Vec::new() };
        let here = member.way.stands[member.held].body;
        let places_m = [[here.x_m, here.y_m], [member.target.x_m, member.target.y_m]];
        let apart_m = |stand: &Stand| {
            let to_m = |[x_m, y_m]: [f64; 2]| libm::hypot(stand.body.x_m - x_m, stand.body.y_m - y_m);
            places_m.into_iter().map(to_m).fold(f64::MAX, f64::min)
        };
        let others = members.iter().filter(|(index, other)| *index != of && other.wanting == wanting);
        let mut near: Vec<(f64, usize)> = Vec::new();
        for (index, other) in others {
            if places_m.into_iter().any(|place_m| other.way.may_pass(place_m, NEIGHBOUR_M)) {
                // Who has no way stands.
                let rest = other.way.stands[other.held..].iter().take(if wanting { 1 } else { usize::MAX });
                near.push((rest.map(apart_m).fold(f64::MAX, f64::min), *index));
            }
        }
        near.retain(|(near_m, _)| *near_m < NEIGHBOUR_M);
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.into_iter().take(MOST_NEIGHBOURS).map(|(_, index)| index).collect()
    }

    /// Those whose ways lead past the goal of a truck: they could be led around it.
    fn passing(&self, of: usize, members: &[(usize, Member)]) -> Vec<usize> {
        let Some((_, member)) = members.iter().find(|(index, _)| *index == of) else { return Vec::new() };
        let goal = &member.target;
        let passes = |other: &Member| {
            let reach_m = other.car.reach_m() + member.car.reach_m() + LOOK_OUT_M;
            let near =
                |stand: &Stand| libm::hypot(stand.body.x_m - goal.x_m, stand.body.y_m - goal.y_m) < reach_m;
            other.way.may_pass([goal.x_m, goal.y_m], reach_m)
                && other.way.stands[other.held..].iter().any(near)
        };
        let others = members.iter().filter(|(index, other)| *index != of && !other.wanting && passes(other));
        others.map(|(index, _)| *index).take(MOST_NEIGHBOURS).collect()
    }

    fn job_of(&mut self, now: Stamp, members: Vec<Member>, look: Look, reserved: Vec<Reserved>) -> JointJob {
        let ids: BTreeSet<u32> = members.iter().map(|member| member.id).collect();
        for member in members.iter().filter(|member| member.slow) {
            if let Some(index) = place_of(&self.trucks, member.id) {
                self.trucks[index].looked_after = now;
            }
        }
        let mut blocks = self.blocks();
        // A member that goes on from its release's end is no obstacle; what one that begins anew may
        // still use of its old way is.
        let goes_on = |truck: &&Truck| ids.contains(&truck.id) && truck.retained.is_empty() && !truck.stalled;
        let on: BTreeSet<u32> = self.trucks.iter().filter(goes_on).map(|truck| truck.id).collect();
        blocks.retain(|block| !on.contains(&block.id));
        let planned = self.trucks.iter().filter(|truck| ids.contains(&truck.id));
        blocks.extend(planned.filter_map(|truck| truck.own_block(now)));
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
            reserved,
            order,
            seed: self.seed.wrapping_add(self.jobs),
            budget,
            group_budget,
            turn_budget,
            each_for_itself: look == Look::Each,
        }
    }

    /// Goals that others are led past again and again, so that those who want to go there stand for long.
    fn reserved(&self, now: Stamp) -> Vec<Reserved> {
        let is_passed_over = |truck: &&Truck| {
            // One that drives only passes.
            let stays = |name: &str| !self.named(name).is_some_and(Truck::is_live);
            let in_vain = truck
                .none
                .as_ref()
                .is_some_and(|none| none.for_good || none.by.as_deref().is_some_and(stays));
            let is_missed = truck.is_live() || (truck.misses > 0 && !in_vain);
            is_missed && truck.delayed_ms(now) > RESERVED_MS && truck.can_be_led(now)
        };
        let mut passed_over: Vec<&Truck> = self.trucks.iter().filter(is_passed_over).collect();
        passed_over.sort_by_key(|truck| Reverse(truck.delayed_ms(now)));
        let reserved = |truck: &Truck| {
            let (_, goal) = truck.goal()?;
            let half_m = truck.car().reach_m();
            let any_heading = Car { front_m: half_m, rear_m: half_m, half_width_m: half_m, ..truck.car() };
            let pose = MapPose { x_m: goal.x_m, y_m: goal.y_m, yaw_rad: 0.0 };
            let (delayed_ms, stand) = (truck.delayed_ms(now), Stand::still(&any_heading, &pose));
            Some(Reserved { id: truck.id, delayed_ms, stand })
        };
        passed_over.into_iter().take(MOST_RESERVED).filter_map(reserved).collect()
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
            slow: false,
            waited_ms: truck.waited_ms(now),
            delayed_ms: truck.delayed_ms(now),
            misses: truck.misses,
            target: Target { x_m: goal.x_m, y_m: goal.y_m, yaw_rad: goal.yaw_rad },
        })
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

#[cfg(test)]
mod tests {
    use super::super::job::NoWay;
    use super::super::room::GridRoom;
    use super::super::truck::Route;
    use super::super::{PlannedGoal, ReportedRobot};
    use super::*;
    use xtb_control::VehicleConfig;

    /// It wants to go 3 m to the east.
    fn view(name: &str, x_m: f64) -> ReportedRobot {
        let goal = PlannedGoal { id: 1, x_m: x_m + 3.0, y_m: 2.0, yaw_rad: None };
        ReportedRobot {
            name: name.to_owned(),
            epoch: 1,
            car: Some(Car::of(&VehicleConfig::default())),
            pose: MapPose { x_m, y_m: 2.0, yaw_rad: 0.0 },
            sigma_m: 0.01,
            speed_mps: 0.0,
            goal: Some(goal),
            route: None,
            blocked_at_m: None,
            drives: true,
            age_ms: 0,
        }
    }

    #[test]
    fn regions_in_which_no_way_is_found_take_turns() {
        // All goals are in walls.
        let walls = [[4.0, 1.0, 2.0, 2.0], [17.0, 1.0, 2.0, 2.0], [30.0, 1.0, 2.0, 2.0]];
        let mut coordinator = Coordinator::new(Arc::new(GridRoom::with(34.0, 4.0, &walls)), 1);
        let views = [("a", 2.0), ("b", 15.0), ("c", 28.0)].map(|(name, x_m)| view(name, x_m));
        let mut planned = Vec::new();
        for now in [1000, 3000, 5000, 7000].map(Stamp::from_ms) {
            views.iter().for_each(|view| coordinator.robot(now, view.clone()));
            coordinator.tick(now);
            if let Some(job) = coordinator.job(now) {
                planned.push(job.members.iter().map(|member| member.id).collect::<Vec<_>>());
                coordinator.planned(now, job.solve(&mut || true));
            }
        }
        assert_eq!(planned, [[1], [2], [3]]);
    }

    #[test]
    fn the_goal_of_who_is_passed_over_for_long_is_reserved_unless_somebody_stays_in_the_way() {
        let mut coordinator = Coordinator::new(Arc::new(GridRoom::with(34.0, 4.0, &[])), 1);
        let (early, late) = (Stamp::from_ms(1000), Stamp::from_ms(2000));
        for (name, x_m, at) in [("a", 2.0, late), ("b", 8.0, early), ("c", 14.0, early), ("d", 20.0, early)] {
            coordinator.robot(at, view(name, x_m));
        }
        let (id, by) = (coordinator.trucks[2].id, Some("a".to_owned()));
        let behind = NoWay { id, revision: 0, by, reason: String::new(), for_good: false };
        coordinator.trucks[2].none = Some(behind);
        // The last one has just got its goal, as far as a way was looked for.
        for (truck, misses) in coordinator.trucks.iter_mut().zip([1, 1, 1, 0]) {
            truck.misses = misses;
        }
        let reserved = |coordinator: &mut Coordinator, at_ms: u64| {
            let now = Stamp::from_ms(at_ms);
            coordinator.trucks.iter_mut().for_each(|truck| truck.seen = now);
            coordinator.reserved(now).iter().map(|reserved| reserved.id).collect::<Vec<_>>()
        };
        assert!(reserved(&mut coordinator, 1000 + RESERVED_MS).is_empty());
        assert_eq!(reserved(&mut coordinator, 2001 + RESERVED_MS), [2, 1]);
        // The one that was in the way drives now.
        coordinator.trucks[0].route = Some(route(&coordinator.trucks[0]));
        assert_eq!(reserved(&mut coordinator, 2001 + RESERVED_MS), [2, 3]);
    }

    /// Of one that is led.
    fn route(truck: &Truck) -> Route {
        let way = Arc::new(DiscretizedPath::new(Path::standing(truck.view.pose), &truck.car()));
        let (plan, base, live, evades) = (1, 1, true, false);
        Route { plan, base, way, done_m: 0.0, release: 0, release_m: 0.0, live, evades }
    }

    #[test]
    fn of_those_with_paths_to_their_goals_the_one_that_has_stood_longest_is_first_however_long_others_drove()
    {
        let mut coordinator = Coordinator::new(Arc::new(GridRoom::with(34.0, 4.0, &[])), 1);
        for (name, x_m) in [("a", 2.0), ("b", 8.0), ("c", 14.0), ("d", 20.0)] {
            let at = Stamp::from_ms(if name == "a" { 1000 } else { 200_000 });
            coordinator.robot(at, view(name, x_m));
        }
        let now = Stamp::from_ms(300_000);
        for (truck, stood_ms) in coordinator.trucks.iter_mut().zip([20_000, 40_000, 60_000, 10_000]) {
            (truck.seen, truck.stood_ms, truck.route) = (now, stood_ms, Some(route(truck)));
        }
        // What leads only aside is no path to a goal.
        coordinator.trucks[2].route.as_mut().unwrap().evades = true;
        let members: Vec<(usize, Member)> = (0..4)
            .map(|index| (index, coordinator.member(now, &coordinator.trucks[index]).unwrap()))
            .collect();
        assert_eq!(coordinator.slow(now, &members), [1, 0]);
        let reserved = coordinator.reserved(now);
        assert_eq!(reserved.iter().map(|goal| goal.delayed_ms).collect::<Vec<_>>(), [60_000, 40_000, 20_000]);
    }
}
