//! What each truck is told: its way, how far it may go, for whom it waits, and why there is none.

use super::discretized_path::STEP_M;
use super::release::Heads;
use super::truck::{Truck, place_of};
use super::{Coordinator, Guide};
use xtb_control::Stamp;
use xtb_nav::geometry::rect::Rect;

/// So far ahead of a truck, in m, whoever comes into its released way makes it stand: it stops within 0.16 m from
/// 0.35 m/s (`follower.stop_s`), and drives 0.1 m until it hears of it; the rest is chosen, not measured.
const NEAR_AHEAD_M: f64 = 0.6;
/// Both bodies are grown by this, in m: about what a pose is off (2.6 cm p95 with fixes at 2 Hz, docs/navigation.md).
const APART_M: f64 = 0.02;

impl Coordinator {
    /// Who stands in the way for good behind this one: somebody, or something, that nobody leads.
    fn for_good(&self, now: Stamp, name: &str) -> Option<String> {
        let mut name = name;
        for _ in &self.trucks {
            let Some(truck) = self.named(name).filter(|truck| truck.can_be_led(now)) else { break };
            // That one goes somewhere: it is a matter of time.
            name = truck.none.as_ref().filter(|_| !truck.is_live())?.by.as_deref()?;
        }
        let is_led = self.named(name).is_some_and(|truck| truck.can_be_led(now));
        (!is_led).then(|| name.to_owned())
    }

    /// The truck of this name, if there is one.
    pub(super) fn named(&self, name: &str) -> Option<&Truck> {
        let index = place_of(&self.trucks, *self.ids_by_name.get(name)?)?;
        Some(&self.trucks[index])
    }

    /// Who has come to where this one is released to, near ahead of it: not led there, but wandering, driven by hand, or
    /// still there with a goal that it got since. What is released stays so: it has to stand until that one has gone, or
    /// until it counts as stalled and is led from where it stands.
    fn stands_on_way(&self, truck: &Truck) -> Option<&Truck> {
        let route = truck.route.as_ref()?;
        let from = route.way.place(route.done_m).min(route.release);
        let to = (from + (NEAR_AHEAD_M / STEP_M) as usize).min(route.release);
        let ahead = &route.way.stands[from..=to];
        let here = ahead.first()?.body;
        let comes = |other: &&Truck| {
            let body = Rect::body(&other.car(), &other.view.pose);
            let coming = if other.is_live() { body } else { other.stopping_body() };
            let reach_m = NEAR_AHEAD_M + here.reach_m() + coming.reach_m();
            let is_near = libm::hypot(body.x_m - here.x_m, body.y_m - here.y_m) < reach_m;
            // Who is as near already is passed as it is.
            is_near
                && !here.overlaps(&body, APART_M)
                && ahead.iter().any(|stand| stand.body.overlaps(&coming, APART_M))
        };
        self.trucks.iter().filter(|other| other.id != truck.id).find(comes)
    }

    pub(super) fn guide(&self, now: Stamp, index: usize, heads: &Heads) -> Guide {
        let truck = &self.trucks[index];
        let name = |id: u32| place_of(&self.trucks, id).map(|other| self.trucks[other].view.name.clone());
        let waits = truck.waits_for.filter(|_| truck.is_live());
        let blocked = truck.none.as_ref();
        let waits_for =
            waits.and_then(|(id, _)| name(id)).or_else(|| blocked.and_then(|none| none.by.clone()));
        let gives_up = self.standstill.gives_up.is_some_and(|(id, _)| id == truck.id);
        let reason = match &waits_for {
            _ if truck.view.goal.is_none() => None,
            _ if truck.view.car.is_none() => Some("its factsheet does not say what vehicle it is".to_owned()),
            Some(name) if gives_up => Some(format!("blocked by {name}")),
            Some(name) if waits.is_none_or(|(_, is_led)| !is_led) => {
                self.for_good(now, name).map(|name| format!("blocked by {name}"))
            }
            Some(_) => None,
            None => blocked.filter(|none| gives_up || none.for_good).map(|none| none.reason.clone()),
        };
        let route = truck.route.as_ref();
        let on_way = self.stands_on_way(truck);
        let waits_for = on_way.map(|other| other.view.name.clone()).or(waits_for);
        Guide {
            goal: truck.goal().map(|(key, _)| key),
            plan: route.map_or(0, |route| route.plan),
            path: route.map(|route| route.way.path.clone()),
            release_m: route.map_or(0.0, |route| route.release_m),
            cruise_mps: if on_way.is_some() { 0.0 } else { heads.cruise_mps(&self.trucks, index) },
            waits_for,
            reason,
        }
    }
}
