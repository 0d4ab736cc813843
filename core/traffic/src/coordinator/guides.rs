//! What each truck is told: its way, how far it may go, for whom it waits, and why there is none.

use super::release::Heads;
use super::truck::{Truck, place_of};
use super::{Coordinator, Guide};
use xtb_control::Stamp;

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
        Guide {
            goal: truck.goal().map(|(key, _)| key),
            plan: route.map_or(0, |route| route.plan),
            path: route.map(|route| route.way.path.clone()),
            release_m: route.map_or(0.0, |route| route.release_m),
            cruise_mps: heads.cruise_mps(&self.trucks, index),
            waits_for,
            reason,
        }
    }
}
