//! Orders to go home: a task that a person has submitted for one robot, with the highest priority, to one of its docks
//! or to a parking place. The robot goes there next: what it does at present waits, and it gets nothing else.

use super::{Round, robot_of};
use crate::dispatcher::Dispatcher;
use crate::home::{is_dock_of, is_same};
use crate::task::Task;
use std::collections::BTreeSet;
use xtb_protocol::Name;
use xtb_protocol::messages::{MAX_PRIORITY, MapPlace, PlaceKind, TaskKind, TaskState};

impl Dispatcher {
    /// The place to which this task orders a robot, and which robot; `None` = it is no such order.
    pub(in crate::dispatcher) fn home_order<'a>(
        &'a self,
        task: &'a Task,
    ) -> Option<(&'a Name, &'a MapPlace)> {
        let (rules, places) = (self.home_rules.as_deref()?, self.places.as_deref()?);
        let robot = robot_of(task).filter(|_| task.spec.priority == MAX_PRIORITY && !self.is_own(task))?;
        let waits = matches!(task.state, TaskState::Paused | TaskState::Held | TaskState::Cancelling);
        let TaskKind::Goto { to } = &task.spec.kind else { return None };
        if waits || task.state.is_final() || self.suspension_state().cause(task).is_some() {
            return None;
        }
        let is_home = |place: &&MapPlace| {
            let rests = matches!(place.kind, PlaceKind::Parking | PlaceKind::Waiting);
            is_same(place, to) && (rests || is_dock_of(rules, place, robot))
        };
        places.iter().find(is_home).map(|place| (robot, place))
    }
}

impl<'a> Round<'a> {
    /// Who has such an order.
    pub(super) fn obey(&mut self) -> BTreeSet<&'a Name> {
        let of = self.of;
        let mut ordered = BTreeSet::new();
        for task in of.store.open() {
            let Some((name, place)) = of.home_order(task) else { continue };
            let Some(robot) = of.robots.get(name).filter(|_| ordered.insert(name)) else { continue };
            self.stay(robot, format!("{} sends it to {}", task.by, place.name));
            if let Some(at) = self.places.iter().position(|known| known.name == place.name) {
                self.takers[at].insert(name.clone());
            }
            if let Some(own) = self.own.get(name).copied() {
                self.cancel(own, format!("{} sends {name} to {} instead", task.by, place.name));
            }
            let busy = of.store.on(name).filter(|busy| busy.id != task.id && !of.is_own(busy));
            if self.can_drive(robot) {
                self.release(robot, busy, format!("{} sends {name} to {}", task.by, place.name));
            }
        }
        ordered
    }
}
