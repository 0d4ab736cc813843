//! Commands in a dispatcher's ledger: submissions, changes of tasks, suspension and activation.

use super::command::Command;
use crate::text::task as task_text;
use std::collections::BTreeMap;
use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::task_store::record::{LedgerEntry, Record};
use xtb_dispatch::transition::{TaskEnding, TaskUpdate};
use xtb_protocol::messages::TaskId;
use xtb_services::ledger;

/// What begins the reasons of changes that a client asked for; the client follows.
const ASKED: [&str; 4] = ["cancelled by ", "paused by ", "resumed by ", "retried by "];

/// All that it holds; what was replaced by a snapshot is not there any more, and `note` hears so.
pub(super) fn commands(path: &Path, note: impl Fn(String)) -> Result<Vec<Command>> {
    if !path.exists() {
        return Err(Error::new(ErrorKind::Config, format!("no ledger at {}", path.display()))
            .hint("name a recording, or the ledger with --ledger"));
    }
    let reading = ledger::read(path)?;
    for damage in &reading.damage {
        note(format!("{}: damage: {damage}", path.display()));
    }
    let mut audit = Audit::default();
    for row in reading.rows.into_iter().filter(|row| row.intact) {
        if row.snapshot {
            note(format!("{} begins with a snapshot: commands before it are not kept", path.display()));
        }
        match LedgerEntry::from_json(&row.body) {
            Ok(entry) => audit.take(&entry),
            Err(error) => note(format!("{}: record {}: {error}", path.display(), row.seq)),
        }
    }
    Ok(audit.commands)
}

#[derive(Debug, Default)]
struct Audit {
    commands: Vec<Command>,
    /// Where in `commands` a task's submission is.
    tasks: BTreeMap<TaskId, usize>,
}

impl Audit {
    fn take(&mut self, entry: &LedgerEntry) {
        let at_ms = entry.at_ms;
        let mut push = |by: Option<&str>, text: String| {
            let by = by.map(str::to_owned);
            self.commands.push(Command { at_ms, by, robot: None, text, result: None });
        };
        match &entry.record {
            Record::Submitted { task, by, spec, .. } => {
                push(Some(by.as_str()), format!("submit {task}: {}", task_text::what(&spec.kind)));
                self.tasks.insert(*task, self.commands.len() - 1);
            }
            Record::Assigned { task, robot, .. } => {
                if let Some(command) = self.of(*task) {
                    command.robot = Some(robot.clone());
                }
            }
            Record::Became { task, change, why } => {
                let asked = why.as_deref().and_then(asked);
                if let Some((what, who)) = asked {
                    push(Some(who), format!("{what} {task}"));
                    let robot = self.of(*task).and_then(|command| command.robot.clone());
                    if let Some(command) = self.commands.last_mut() {
                        command.robot = robot;
                    }
                }
                let result = ended(change).map(|result| match why.as_ref().filter(|_| asked.is_none()) {
                    Some(why) => format!("{result}: {why}"),
                    None => result.to_owned(),
                });
                if let (Some(result), Some(command)) = (result, self.of(*task)) {
                    command.result = Some(result);
                }
            }
            Record::Extended { task, points, by, .. } => {
                push(Some(by.as_str()), format!("extend {task}: {} more points", points.len()));
            }
            Record::Suspended { by } => {
                push(by.as_ref().map(xtb_protocol::Name::as_str), "emergency stop of all robots".to_owned());
            }
            Record::Activated { by } => push(Some(by.as_str()), "activate the dispatcher".to_owned()),
            Record::Adopted { map, by } => push(Some(by.as_str()), format!("adopt tasks for map {map}")),
            Record::Opened { .. }
            | Record::Reached { .. }
            | Record::Map { .. }
            | Record::Term { .. }
            | Record::Pair { .. }
            | Record::Snapshot(_) => {}
        }
    }

    fn of(&mut self, task: TaskId) -> Option<&mut Command> {
        self.commands.get_mut(*self.tasks.get(&task)?)
    }
}

/// `cancelled by alice-1`: what to do, and who asked for it.
fn asked(why: &str) -> Option<(&'static str, &str)> {
    let verbs = ["cancel", "pause", "resume", "retry"];
    ASKED.iter().zip(verbs).find_map(|(start, verb)| Some((verb, why.strip_prefix(start)?)))
}

fn ended(change: &TaskUpdate) -> Option<&'static str> {
    let (TaskUpdate::Ended { ending } | TaskUpdate::Cancelling { then: ending }) = change else {
        return None;
    };
    Some(match ending {
        TaskEnding::Cancelled => "cancelled",
        TaskEnding::Failed => "failed",
        TaskEnding::Done => "done",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;
    use xtb_protocol::Uuid;
    use xtb_protocol::messages::{TaskKind, TaskSpec};

    #[test]
    fn a_ledger_tells_who_submitted_cancelled_and_activated() {
        let task = TaskId::new(1);
        let spec = Box::new(TaskSpec::new(TaskKind::Wander { for_s: 60.0 }));
        let by = |text: &str| name(text);
        let change = TaskUpdate::Ended { ending: TaskEnding::Cancelled };
        let records = [
            Record::Submitted { task, by: by("alice-1"), key: Uuid::nil(), spec },
            Record::Assigned { task, robot: name("xtb-1"), seq: 1 },
            Record::Extended { task, after: 1, points: Vec::new(), by: by("dave") },
            Record::Became { task, change, why: Some("cancelled by bob".to_owned()) },
            Record::Suspended { by: Some(by("carol-2")) },
            Record::Activated { by: by("alice-1") },
        ];
        let mut audit = Audit::default();
        for (at_ms, record) in (1000..).zip(records) {
            audit.take(&LedgerEntry { v: 2, n: at_ms, at_ms, record });
        }
        let told: Vec<_> = audit
            .commands
            .iter()
            .map(|command| {
                let Command { by, robot, text, result, .. } = command;
                (
                    by.as_deref().unwrap(),
                    robot.as_ref().map(|robot| robot.as_str()),
                    text.as_str(),
                    result.as_deref(),
                )
            })
            .collect();
        assert_eq!(told[0].0, "alice-1");
        assert!(told[0].2.starts_with("submit t1: wander"), "{told:?}");
        assert_eq!((told[0].1, told[0].3), (Some("xtb-1"), Some("cancelled")));
        assert_eq!(told[1], ("dave", None, "extend t1: 0 more points", None));
        assert_eq!(told[2], ("bob", Some("xtb-1"), "cancel t1", None));
        assert_eq!(told[3], ("carol-2", None, "emergency stop of all robots", None));
        assert_eq!(told[4], ("alice-1", None, "activate the dispatcher", None));
    }
}
