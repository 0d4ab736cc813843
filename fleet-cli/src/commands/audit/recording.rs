//! Commands in a recording of the fleet or of a robot: what robots said of leases, goals, latches and teleoperation,
//! with the client that each names, emergency stops of all robots and, of a robot's own recording, changed settings.

use super::command::Command;
use crate::recording::playback_worker::not_readable;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::UNIX_EPOCH;
use xtb_client::Result;
use xtb_client::messages::AnyMessage;
use xtb_client::text::{reasons, robot as describe};
use xtb_control::Mode;
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{Event, EventKind, GoalKind, GoalState, Latch, ParamChange, RobotState};
use xtb_protocol::{Name, Uuid};
use xtb_recording::Error;
use xtb_recording::fleet::reader;
use xtb_recording::robot::events::{self, RecordedEvents};

/// Goals, and calls of an emergency stop, that are told apart in one recording.
const MOST: usize = 1 << 20;

/// All that it holds.
pub(super) fn commands(path: &Path, note: impl Fn(String)) -> Result<Vec<Command>> {
    let wrong = |error| not_readable(path, &error);
    let mut audit = Audit::default();
    let mut reader = match reader::begin(path) {
        Ok((reader, _)) => reader,
        Err(Error::NotOfAFleet) => {
            audit.told(&events::read(path).map_err(wrong)?);
            return Ok(audit.commands);
        }
        Err(error) => return Err(wrong(error)),
    };
    while let Some(message) = reader.next_message().map_err(wrong)? {
        if let Some(Ok((key, news))) = reader::read(&message) {
            audit.take(message.log_ns / 1_000_000, &key, &news);
        }
    }
    if let Some(why) = reader.cut_because() {
        note(format!("{} breaks off: {why}", path.display()));
    }
    Ok(audit.commands)
}

#[derive(Debug, Default)]
struct Audit {
    commands: Vec<Command>,
    /// Who has each robot's lease.
    holders: BTreeMap<Name, Name>,
    /// Where in `commands` each goal is.
    goals: BTreeMap<Uuid, usize>,
    stops: BTreeSet<Uuid>,
}

impl Audit {
    /// A robot's own recording. Its clock counts from boot; what the wall clock said stands at its beginning.
    fn told(&mut self, told: &RecordedEvents) {
        let started = humantime::parse_rfc3339_weak(&told.header.started).unwrap_or(UNIX_EPOCH);
        let started_ms = started.duration_since(UNIX_EPOCH).unwrap_or_default().as_millis() as u64;
        let at_ms = |at_ns: u64| started_ms.saturating_add(at_ns.saturating_sub(told.began_ns) / 1_000_000);
        for (at_ns, event) in &told.events {
            self.event(at_ms(*at_ns), event);
        }
        let robot = Name::new(&told.header.robot).ok();
        for (at_ns, ParamChange { by, name, from, to, .. }) in &told.params {
            self.push(at_ms(*at_ns), Some(by), robot.as_ref(), format!("set {name} from {from} to {to}"));
        }
    }

    fn take(&mut self, at_ms: u64, key: &Key, news: &AnyMessage) {
        match news {
            AnyMessage::Event(event) => self.event(at_ms, event),
            AnyMessage::State(state) => self.state(at_ms, state),
            AnyMessage::Estop(estop) => {
                if let Channel::EstopAll(client) = &key.channel
                    && self.stops.len() < MOST
                    && self.stops.insert(estop.id)
                {
                    self.push(at_ms, Some(client), None, "emergency stop of all robots".to_owned());
                }
            }
            _ => {}
        }
    }

    fn push(&mut self, at_ms: u64, by: Option<&Name>, robot: Option<&Name>, text: String) {
        let by = by.map(Name::to_string);
        self.commands.push(Command { at_ms, by, robot: robot.cloned(), text, result: None });
    }

    fn event(&mut self, at_ms: u64, event: &Event) {
        let robot = &event.robot;
        match &event.kind {
            EventKind::Lease { holder: Some(holder) } => {
                let before = self.holders.insert(robot.clone(), holder.clone());
                let from = before.filter(|before| before != holder);
                let from = from.map(|before| format!(" from {before}")).unwrap_or_default();
                self.push(at_ms, Some(holder), Some(robot), format!("take control{from}"));
            }
            EventKind::Lease { holder: None } => {
                if let Some(holder) = self.holders.remove(robot) {
                    self.push(at_ms, Some(&holder), Some(robot), "release control".to_owned());
                }
            }
            EventKind::Mode { to: Mode::Teleop, .. } => {
                let holder = self.holders.get(robot).cloned();
                self.push(at_ms, holder.as_ref(), Some(robot), "teleoperate".to_owned());
            }
            EventKind::Goal { id, status, reason } => {
                let goal = self.goal(at_ms, *id, robot);
                let status = reasons::name(status);
                let result =
                    reason.as_ref().map_or_else(|| status.clone(), |reason| format!("{status}: {reason}"));
                if let Some(command) = goal.and_then(|goal| self.commands.get_mut(goal)) {
                    command.result = Some(result);
                }
            }
            EventKind::Latch { latch: Latch::Estop, set: true, by } => {
                let who = Name::new(by).ok();
                self.push(at_ms, who.as_ref(), Some(robot), "emergency stop".to_owned());
                self.result("latched");
            }
            EventKind::Latch { latch, set: false, by } => {
                let who = Name::new(by).ok();
                self.push(at_ms, who.as_ref(), Some(robot), format!("reset {latch}"));
                self.result("ended");
            }
            EventKind::Latch { .. }
            | EventKind::Mode { .. }
            | EventKind::Started { .. }
            | EventKind::Fault { .. } => {}
        }
    }

    fn result(&mut self, words: &str) {
        if let Some(command) = self.commands.last_mut() {
            command.result = Some(words.to_owned());
        }
    }

    /// Where its command is; it is told of when it is heard of for the first time.
    fn goal(&mut self, at_ms: u64, id: Uuid, robot: &Name) -> Option<usize> {
        if let Some(found) = self.goals.get(&id) {
            return Some(*found);
        }
        if self.goals.len() == MOST {
            return None;
        }
        // Until a state names its client: only who has control can have sent it.
        let holder = self.holders.get(robot).cloned();
        self.push(at_ms, holder.as_ref(), Some(robot), "goal".to_owned());
        self.goals.insert(id, self.commands.len() - 1);
        Some(self.commands.len() - 1)
    }

    fn state(&mut self, at_ms: u64, state: &RobotState) {
        if let Some(lease) = &state.lease {
            // The recording began when it was held already: nobody took it here.
            self.holders.entry(state.robot.clone()).or_insert_with(|| lease.holder.clone());
        }
        let Some(goal) = &state.goal else { return };
        let index = self.goal(at_ms, goal.id, &state.robot);
        if let Some(command) = index.and_then(|index| self.commands.get_mut(index)) {
            command.by = Some(goal.by.to_string());
            command.text = what(goal);
            command.result.get_or_insert_with(|| reasons::name(&goal.status));
        }
    }
}

fn what(goal: &GoalState) -> String {
    match goal.kind {
        GoalKind::Goto => format!("goto ({})", describe::goal_point(goal)),
        GoalKind::Wander => "wander".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::{self, name};
    use xtb_protocol::messages::{Estop, GoalStatus};

    fn told(audit: &Audit) -> Vec<(Option<&str>, &str, Option<&str>)> {
        let each = audit.commands.iter();
        each.map(|command| (command.by.as_deref(), command.text.as_str(), command.result.as_deref()))
            .collect()
    }

    #[test]
    fn a_recording_tells_who_took_control_drove_stopped_and_reset() {
        let mut audit = Audit::default();
        let key = Key::parse("xtb/lab/xtb-1/event").unwrap();
        let mut seq = 0;
        let mut event = |audit: &mut Audit, kind: EventKind| {
            seq += 1;
            let event = Event { robot: name("xtb-1"), epoch: 7, seq, tick_ms: seq, kind };
            audit.take(seq, &key, &AnyMessage::from(event));
        };
        let id = Uuid::from_u128(1);
        event(&mut audit, EventKind::Lease { holder: Some(name("alice-1")) });
        event(&mut audit, EventKind::Goal { id, status: GoalStatus::Accepted, reason: None });
        let goal = Some(GoalState { by: name("alice-1"), ..fake::goal(id, GoalStatus::Running) });
        let state = RobotState { goal, ..fake::state("xtb-1") };
        audit.take(3, &Key::parse("xtb/lab/xtb-1/state").unwrap(), &AnyMessage::from(state));
        event(&mut audit, EventKind::Lease { holder: Some(name("bob-1")) });
        let reason = Some("control lost".to_owned());
        event(&mut audit, EventKind::Goal { id, status: GoalStatus::Cancelled, reason });
        event(&mut audit, EventKind::Latch { latch: Latch::Estop, set: true, by: "carol-2".into() });
        event(&mut audit, EventKind::Latch { latch: Latch::Estop, set: false, by: "bob-1".into() });
        event(&mut audit, EventKind::Lease { holder: None });
        for _ in 0..2 {
            let all = Key::parse("xtb/lab/all/estop/dave-3").unwrap();
            audit.take(9, &all, &AnyMessage::from(Estop { id }));
        }
        assert_eq!(
            told(&audit),
            [
                (Some("alice-1"), "take control", None),
                (Some("alice-1"), "goto (1.00, 2.00)", Some("cancelled: control lost")),
                (Some("bob-1"), "take control from alice-1", None),
                (Some("carol-2"), "emergency stop", Some("latched")),
                (Some("bob-1"), "reset estop", Some("ended")),
                (Some("bob-1"), "release control", None),
                (Some("dave-3"), "emergency stop of all robots", None),
            ]
        );
    }
}
