//! Which robots are at a place or on the way to one, for everybody to see.

use super::round::{charging_words, low_words, nearest_at, resting, robot_of};
use crate::dispatcher::Dispatcher;
use crate::home::{HomeRules, Need, is_same};
use crate::task::Task;
use crate::tracked_robot::TrackedRobot;
use std::collections::BTreeMap;
use xtb_protocol::Name;
use xtb_protocol::messages::{FleetHomes, HomeStatus, MapPlace, PlaceKind, RobotHome};

impl Dispatcher {
    /// The robots that are at a dock or parking place, or have to go to one.
    #[must_use]
    pub fn homes(&self, now_ms: u64) -> FleetHomes {
        let Some(rules) = self.home_rules.as_deref() else {
            return FleetHomes { active: false, robots: Vec::new() };
        };
        let own = self.store.open().filter(|task| self.leads_home(task));
        let own: BTreeMap<_, _> = own.filter_map(|task| Some((robot_of(task)?, task))).collect();
        let resting = resting(self, now_ms);
        let there = self.robots.values().filter(|robot| robot.is_online(now_ms, &self.settings));
        let robots = there.filter_map(|robot| {
            let task = own.get(&robot.name).copied();
            let rests = resting.contains(&robot.name);
            let (status, place, why) = self.home_of(rules, robot, task, rests)?;
            let task = task.map(|task| task.id);
            let (robot, battery_v) = (robot.name.clone(), robot.charge.volts);
            Some(RobotHome { robot, status, place, task, battery_v, why })
        });
        FleetHomes { active: true, robots: robots.collect() }
    }

    fn home_of(
        &self,
        rules: &HomeRules,
        robot: &TrackedRobot,
        own: Option<&Task>,
        rests: bool,
    ) -> Option<(HomeStatus, Option<Name>, String)> {
        let places = self.places.as_deref().unwrap_or_default();
        let charge = &robot.charge;
        if let Some(task) = own {
            let point = task.point(task.legs_done)?;
            let place = places.iter().find(|place| is_same(place, point)).map(|place| place.name.clone());
            return Some((HomeStatus::OnTheWay, place, self.view(task).reason.unwrap_or_default()));
        }
        if let Some(visit) = &charge.visit {
            let place = Some(visit.place.clone());
            return Some(match visit.charging {
                _ if charge.is_enough(rules) => (HomeStatus::Charged, place, String::new()),
                Some(false) => {
                    let why = "its voltage does not rise: check the contacts of dock and robot".to_owned();
                    (HomeStatus::NotCharging, place, why)
                }
                _ => (HomeStatus::Charging, place, charging_words(robot, rules)),
            });
        }
        let observed = robot.observed.as_ref()?;
        if let Some(need) = charge.need {
            let works = self.store.on(&robot.name).map(|task| task.id);
            return Some(match (&observed.unavailable, need, works, &robot.stays_for) {
                (Some(unavailable), ..) => (
                    HomeStatus::NeedsHelp,
                    None,
                    format!("{}, and it cannot drive: {unavailable}", low_words(robot)),
                ),
                (None, ..) if rests => {
                    let why = "its last drive to a dock failed or was cancelled";
                    (HomeStatus::NeedsHelp, None, format!("{}: {why}", low_words(robot)))
                }
                (None, Need::AfterTask, Some(task), _) => {
                    (HomeStatus::AfterTask, None, format!("{}: to a dock after {task}", low_words(robot)))
                }
                (None, _, _, Some(why)) => (HomeStatus::WaitsForDock, None, why.clone()),
                (None, ..) => {
                    (HomeStatus::WaitsForDock, None, format!("{}: no dock is free", low_words(robot)))
                }
            });
        }
        let rests = |place: &&MapPlace| matches!(place.kind, PlaceKind::Parking | PlaceKind::Waiting);
        let at = nearest_at(places.iter().filter(rests), &observed.pose);
        let at = at.filter(|_| observed.running().is_none())?;
        Some((HomeStatus::Parked, Some(at.name.clone()), String::new()))
    }
}
