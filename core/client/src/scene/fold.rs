//! Event lists for people: all events of one goal, or of one task, are one line; the events themselves are its details.

use super::{SceneChange, SceneEvent};
use crate::text::{event, reasons};
use std::collections::BTreeMap;
use xtb_control::Mode;
use xtb_protocol::messages::{Event, EventKind, GoalStatus, TaskId};
use xtb_protocol::{Name, Uuid};

/// One line of an event list.
#[derive(Debug, Clone, PartialEq)]
pub struct EventEntry<'a> {
    /// What it is made of, oldest first; never empty.
    pub events: Vec<&'a SceneEvent>,
}

impl EventEntry<'_> {
    /// The event that says how it stands: the last one of its goal, else the last one.
    #[must_use]
    pub fn head(&self) -> Option<&SceneEvent> {
        let goal = self.events.iter().rev().find(|event| goal_of(&event.what).is_some());
        goal.or_else(|| self.events.last()).copied()
    }

    /// Whether it has details.
    #[must_use]
    pub fn is_folded(&self) -> bool {
        self.events.len() > 1
    }

    /// How a drive stands; `None` = it is none, or one event.
    #[must_use]
    pub fn drive(&self) -> Option<String> {
        let head = self.head().filter(|_| self.is_folded())?;
        let SceneChange::Robot(last) = &head.what else { return None };
        let (_, status, reason) = goal_of(&head.what)?;
        let goals: Vec<&Event> = self.events.iter().filter_map(|event| goal_event(&event.what)).collect();
        let took_s = match (goals.first(), status.is_final()) {
            (Some(first), true) => {
                format!(" after {:.0} s", last.tick_ms.saturating_sub(first.tick_ms) as f64 / 1000.0)
            }
            _ => String::new(),
        };
        let why = reason.map(|reason| format!(": {reason}")).unwrap_or_default();
        let blocked = match goals.iter().filter(|event| is_blocked(event)).count() {
            0 => String::new(),
            1 => ", blocked once".to_owned(),
            times => format!(", blocked {times} times"),
        };
        Some(format!("{} drive {}{took_s}{why}{blocked}", last.robot, reasons::name(&status)))
    }

    /// In words.
    #[must_use]
    pub fn text(&self) -> String {
        self.drive().unwrap_or_else(|| self.head().map(|head| words(&head.what)).unwrap_or_default())
    }
}

/// One event in words.
#[must_use]
pub fn words(what: &SceneChange) -> String {
    match what {
        SceneChange::Robot(robot) => event::robot(robot),
        SceneChange::Task(task) => event::task(task),
        SceneChange::Presence { robot, key, there } => {
            event::presence(&event::service(robot.as_ref(), key), *there)
        }
    }
}

fn is_blocked(event: &Event) -> bool {
    matches!(event.kind, EventKind::Goal { status: GoalStatus::Blocked, .. })
}

fn goal_event(what: &SceneChange) -> Option<&Event> {
    match what {
        SceneChange::Robot(event) if matches!(event.kind, EventKind::Goal { .. }) => Some(event),
        _ => None,
    }
}

fn goal_of(what: &SceneChange) -> Option<(Uuid, GoalStatus, Option<&str>)> {
    match &goal_event(what)?.kind {
        EventKind::Goal { id, status, reason } => Some((*id, *status, reason.as_deref())),
        _ => None,
    }
}

/// Where the events of each robot's present goal and of each task are.
#[derive(Default)]
struct Fold<'a> {
    entries: Vec<EventEntry<'a>>,
    drives: BTreeMap<&'a Name, (usize, Uuid, bool)>,
    /// What a robot's next goal begins with: its last line, if that is a change of mode or control.
    begins: BTreeMap<&'a Name, usize>,
    tasks: BTreeMap<TaskId, usize>,
}

impl<'a> Fold<'a> {
    fn new_entry(&mut self, event: &'a SceneEvent) -> usize {
        self.entries.push(EventEntry { events: vec![event] });
        self.entries.len() - 1
    }

    fn add(&mut self, at: Option<usize>, event: &'a SceneEvent) -> usize {
        match at {
            Some(at) => {
                self.entries[at].events.push(event);
                at
            }
            None => self.new_entry(event),
        }
    }

    fn take(&mut self, event: &'a SceneEvent) {
        match &event.what {
            SceneChange::Task(task) => {
                let at = self.add(self.tasks.get(&task.task).copied(), event);
                self.tasks.insert(task.task, at);
            }
            SceneChange::Robot(of) => self.robot(of, event),
            SceneChange::Presence { .. } => {
                self.new_entry(event);
            }
        }
    }

    fn robot(&mut self, of: &'a Event, event: &'a SceneEvent) {
        let drive = self.drives.get(&of.robot).copied();
        match &of.kind {
            EventKind::Goal { id, status, .. } => {
                let same = drive.filter(|(_, goal, _)| goal == id).map(|(at, ..)| at);
                let at = self.add(same.or_else(|| self.begins.get(&of.robot).copied()), event);
                self.begins.remove(&of.robot);
                self.drives.insert(&of.robot, (at, *id, !status.is_final()));
            }
            EventKind::Mode { .. } | EventKind::Lease { .. } => {
                let ends = matches!(
                    of.kind,
                    EventKind::Mode { to: Mode::Idle, .. } | EventKind::Lease { holder: None }
                );
                let at = drive.filter(|(.., open)| *open || ends).map(|(at, ..)| at);
                if at.is_some() {
                    self.add(at, event);
                } else {
                    let at = self.add(self.begins.get(&of.robot).copied(), event);
                    self.begins.insert(&of.robot, at);
                }
            }
            EventKind::Started { .. } | EventKind::Fault { .. } | EventKind::Latch { .. } => {
                self.begins.remove(&of.robot);
                self.new_entry(event);
            }
        }
    }
}

/// Folds events that come oldest first; the line whose last event is the newest comes last.
#[must_use]
pub fn fold<'a>(events: impl IntoIterator<Item = &'a SceneEvent>) -> Vec<EventEntry<'a>> {
    let mut fold = Fold::default();
    for event in events {
        fold.take(event);
    }
    let mut entries = fold.entries;
    entries.sort_by_key(|entry| entry.events.last().map(|event| event.number));
    entries
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::name;

    fn events(kinds: impl IntoIterator<Item = (&'static str, u64, EventKind)>) -> Vec<SceneEvent> {
        let event = |(number, (robot, tick_ms, kind)): (u64, (&str, u64, EventKind))| {
            let what = SceneChange::Robot(Event { robot: name(robot), epoch: 1, seq: number, tick_ms, kind });
            SceneEvent { number, at_ms: tick_ms, what }
        };
        (1..).zip(kinds).map(event).collect()
    }

    fn goal(id: u128, status: GoalStatus, reason: Option<&str>) -> EventKind {
        EventKind::Goal { id: Uuid::from_u128(id), status, reason: reason.map(str::to_owned) }
    }

    fn mode(from: Mode, to: Mode) -> EventKind {
        EventKind::Mode { from, to }
    }

    fn lease(holder: Option<&str>) -> EventKind {
        EventKind::Lease { holder: holder.map(name) }
    }

    #[test]
    fn one_drive_is_one_line_with_its_events_as_details() {
        use GoalStatus::{Accepted, Blocked, Reached, Running};
        let all = events([
            ("xtb-1", 0, lease(Some("alice"))),
            ("xtb-1", 10, goal(1, Accepted, None)),
            ("xtb-2", 11, goal(2, Accepted, None)),
            ("xtb-1", 20, mode(Mode::Idle, Mode::Goto)),
            ("xtb-1", 30, goal(1, Running, None)),
            ("xtb-1", 3_000, goal(1, Blocked, Some("waiting for xtb-2"))),
            ("xtb-1", 5_000, goal(1, Running, None)),
            ("xtb-1", 12_010, goal(1, Reached, None)),
            ("xtb-1", 12_010, mode(Mode::Goto, Mode::Idle)),
            ("xtb-1", 12_020, lease(None)),
            ("xtb-1", 20_000, goal(3, Accepted, None)),
        ]);
        let lines = fold(&all);
        let texts: Vec<String> = lines.iter().map(EventEntry::text).collect();
        assert_eq!(
            texts,
            ["xtb-2 goal accepted", "xtb-1 drive reached after 12 s, blocked once", "xtb-1 goal accepted"]
        );
        assert_eq!(lines.iter().map(|line| line.events.len()).collect::<Vec<_>>(), [1, 9, 1]);
        let details: Vec<u64> = lines[1].events.iter().map(|event| event.number).collect();
        assert_eq!(details, [1, 2, 4, 5, 6, 7, 8, 9, 10], "in their order, and nothing is lost");
    }

    #[test]
    fn what_needs_a_look_keeps_a_line_of_its_own() {
        use xtb_protocol::messages::Latch;
        let latch = EventKind::Latch { latch: Latch::Estop, set: true, by: "carol".into() };
        let all = events([
            ("xtb-1", 0, goal(1, GoalStatus::Running, None)),
            ("xtb-1", 1_000, latch),
            ("xtb-1", 1_000, goal(1, GoalStatus::Failed, Some("emergency stop"))),
            ("xtb-1", 2_000, lease(Some("bob"))),
        ]);
        let texts: Vec<String> = fold(&all).iter().map(EventEntry::text).collect();
        assert_eq!(
            texts,
            [
                "xtb-1 LATCHED estop by carol",
                "xtb-1 drive failed after 1 s: emergency stop",
                "xtb-1 is controlled by bob"
            ]
        );
    }

    #[test]
    fn no_event_is_lost_or_shown_twice() {
        let kinds = (0..200_u64).map(|n| {
            let robot = ["xtb-1", "xtb-2", "xtb-3"][(n * 7 % 3) as usize];
            let kind = match n * 13 % 5 {
                0 => goal(u128::from(n / 20), GoalStatus::Running, None),
                1 => goal(u128::from(n / 20), GoalStatus::Reached, None),
                2 => mode(Mode::Idle, Mode::Goto),
                3 => mode(Mode::Goto, Mode::Idle),
                _ => lease((n % 2 == 0).then_some("alice")),
            };
            (robot, n, kind)
        });
        let all = events(kinds);
        let mut seen: Vec<u64> =
            fold(&all).iter().flat_map(|line| &line.events).map(|it| it.number).collect();
        seen.sort_unstable();
        assert_eq!(seen, (1..=200).collect::<Vec<_>>());
    }
}
