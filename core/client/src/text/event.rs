//! What happened, in words: one line for each event, for the cockpit and the fleet's history.

use super::reasons;
use xtb_protocol::Name;
use xtb_protocol::messages::{Event, EventKind, TaskEvent};

/// A robot's event.
#[must_use]
pub fn robot(event: &Event) -> String {
    let name = &event.robot;
    match &event.kind {
        EventKind::Started { version } => format!("{name} has started, version {version}"),
        EventKind::Mode { from, to } => format!("{name} {} > {}", reasons::name(from), reasons::name(to)),
        EventKind::Goal { status, reason, .. } => {
            let why = reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
            format!("{name} goal {}{why}", reasons::name(status))
        }
        EventKind::Lease { holder: Some(holder) } => format!("{name} is controlled by {holder}"),
        EventKind::Lease { holder: None } => format!("{name}: control released"),
        EventKind::Fault { fault, present: true, detail } => {
            let detail = detail.as_ref().map(|words| format!(" ({words})")).unwrap_or_default();
            format!("{name} FAULT {fault}{detail}")
        }
        EventKind::Fault { fault, .. } => format!("{name} {fault} cleared"),
        EventKind::Latch { latch, set: true, by } => format!("{name} LATCHED {latch} by {by}"),
        EventKind::Latch { latch, by, .. } => format!("{name} {latch} reset by {by}"),
    }
}

/// A task's change.
#[must_use]
pub fn task(TaskEvent { task, step, .. }: &TaskEvent) -> String {
    let on = step.robot.as_ref().map(|robot| format!(" on {robot}")).unwrap_or_default();
    let why = step.reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
    format!("{task} {}{on}{why}", reasons::name(&step.state))
}

/// Who has come, or is not there any more; a robot's name, or what service it is.
#[must_use]
pub fn presence(who: &str, there: bool) -> String {
    if there { format!("{who} is online") } else { format!("{who} is missing") }
}

/// The dispatcher or traffic control, by the key of its presence.
#[must_use]
pub fn service(robot: Option<&Name>, key: &str) -> String {
    match robot {
        Some(robot) => robot.to_string(),
        None if key.rsplit('/').nth(1) == Some("traffic") => "traffic control".to_owned(),
        None => "the dispatcher".to_owned(),
    }
}
