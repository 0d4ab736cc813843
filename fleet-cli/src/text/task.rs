//! Tasks in words and columns for people.

use crate::context::Context;
use crate::output::{Output, Tone};
use crate::table::{Table, TableCell};
use xtb_client::text::reasons;
use xtb_client::text::robot::fixed;
use xtb_protocol::Name;
use xtb_protocol::messages::{Suspension, TaskKind, TaskList, TaskState, TaskView, Waypoint, Who};

const HEADINGS: [&str; 8] = ["task", "state", "for", "robot", "legs", "pri", "what", "why"];
/// Points of a route that are named; the others are counted.
const NAMED_POINTS: usize = 3;

/// How good a state is.
pub(crate) fn tone(state: TaskState) -> Tone {
    match state {
        TaskState::Queued | TaskState::Assigned | TaskState::Paused => Tone::Plain,
        TaskState::Running | TaskState::Done => Tone::Good,
        TaskState::Blocked | TaskState::Held | TaskState::Cancelling => Tone::Warning,
        TaskState::Failed => Tone::Bad,
        TaskState::Cancelled => Tone::Dim,
    }
}

fn point(point: &Waypoint) -> String {
    let yaw = point.yaw_rad.map(|yaw| format!(" {}°", fixed(yaw.to_degrees(), 0))).unwrap_or_default();
    format!("({}, {}){yaw}", fixed(point.x_m, 2), fixed(point.y_m, 2))
}

fn points(all: &[Waypoint]) -> String {
    let named = all.iter().take(NAMED_POINTS).map(point).collect::<Vec<_>>().join(" ");
    match all.len().saturating_sub(NAMED_POINTS) {
        0 => named,
        more => format!("{named} and {more} more"),
    }
}

/// What is to be done.
pub(crate) fn what(kind: &TaskKind) -> String {
    let dwell = |dwell_s: f64| match dwell_s {
        0.0 => String::new(),
        _ => format!(", {} s at each", short(dwell_s)),
    };
    match kind {
        TaskKind::Goto { to } => format!("goto {}", point(to)),
        TaskKind::Route { points: all, loops, dwell_s } => {
            let times = if *loops > 1 { format!(", {loops} times") } else { String::new() };
            format!("route {}{times}{}", points(all), dwell(*dwell_s))
        }
        TaskKind::Patrol { points: all, dwell_s, for_s } => {
            let lasting = for_s.map(|for_s| format!(" for {} s", short(for_s))).unwrap_or_default();
            format!("patrol {}{lasting}{}", points(all), dwell(*dwell_s))
        }
        TaskKind::Wander { for_s } => format!("wander for {} s", short(*for_s)),
    }
}

/// Without places where there is nothing in them.
fn short(value: f64) -> String {
    let text = fixed(value, 1);
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

/// Who may do it.
pub(crate) fn who(who: &Who) -> String {
    match who {
        Who::Any => "any".to_owned(),
        Who::Robot(name) => name.to_string(),
        Who::Tag(tag) => format!("@{tag}"),
        Who::Able(able) => format!("able: {able}"),
    }
}

/// The same in a sentence.
pub(crate) fn whose(wish: &Who) -> String {
    match wish {
        Who::Any => "for any robot".to_owned(),
        Who::Robot(name) => format!("for {name}"),
        Who::Tag(tag) => format!("for robots tagged {tag}"),
        Who::Able(able) => format!("for robots with {able}"),
    }
}

/// Which robot has it, or had it when it ended.
pub(crate) fn robot(task: &TaskView) -> Option<&Name> {
    if task.state.is_final() { task.robot.as_ref() } else { task.on() }
}

/// What is suspended, a line each; `now_ms`, ms since 1970, for its age.
pub(crate) fn suspended(all: &[Suspension], now_ms: Option<u64>, out: &Output) -> Vec<String> {
    let line = |suspension: &Suspension| {
        let age =
            now_ms.map(|now_ms| format!(", for {}", since(now_ms, suspension.since_ms))).unwrap_or_default();
        let what = out.paint(Tone::Bad, &format!("{}{age}", suspension.text()));
        format!("{what}\n{}", out.paint(Tone::Dim, &format!("  → {}", suspension.cause.remedy())))
    };
    all.iter().map(line).collect()
}

/// What a dispatcher found when it began: said beside the line that it is ready.
pub(crate) fn found(ctx: &Context, all: &[Suspension], set_aside: Option<&str>) {
    if let Some(old) = set_aside {
        ctx.out.note(&format!("the previous ledger is kept as {old}"));
    }
    for suspension in all {
        ctx.out.note(&format!("{}; {}", suspension.text(), suspension.cause.remedy()));
    }
}

/// How far it is.
pub(crate) fn legs(task: &TaskView) -> String {
    match task.legs {
        Some(legs) => format!("{}/{legs}", task.legs_done),
        None => task.legs_done.to_string(),
    }
}

/// Time between two clocks' readings, in ms since 1970; never below 0.
pub(crate) fn since(now_ms: u64, then_ms: u64) -> String {
    let ms = now_ms.saturating_sub(then_ms);
    match ms {
        0..60_000 => format!("{} s", ms / 1000),
        3_600_000.. => format!("{} h {:02} min", ms / 3_600_000, ms / 60_000 % 60),
        _ => format!("{} min {:02} s", ms / 60_000, ms / 1000 % 60),
    }
}

/// A table of tasks as of `now_ms`.
pub(crate) fn table<'a>(tasks: impl Iterator<Item = &'a TaskView>, now_ms: u64, out: &Output) -> String {
    let mut table = Table::new(&HEADINGS);
    for task in tasks {
        let robot = match robot(task) {
            Some(robot) => robot.as_str().into(),
            None => TableCell::new(who(&task.spec.who), Tone::Dim),
        };
        table.row(vec![
            TableCell::new(task.id.to_string(), Tone::Strong),
            TableCell::new(reasons::name(&task.state), tone(task.state)),
            since(now_ms, task.since_ms).into(),
            robot,
            legs(task).into(),
            task.spec.priority.to_string().into(),
            what(&task.spec.kind).into(),
            task.reason.clone().unwrap_or_default().into(),
        ]);
    }
    table.render(out)
}

/// How many stand how, such as `2 running, 1 queued; 3 done`.
pub(crate) fn count(tasks: &[TaskView]) -> String {
    const OPEN: [TaskState; 7] = [
        TaskState::Running,
        TaskState::Blocked,
        TaskState::Assigned,
        TaskState::Queued,
        TaskState::Held,
        TaskState::Paused,
        TaskState::Cancelling,
    ];
    const ENDED: [TaskState; 3] = [TaskState::Done, TaskState::Failed, TaskState::Cancelled];
    let line = |states: &[TaskState]| {
        let counted = states.iter().filter_map(|state| {
            let n = tasks.iter().filter(|task| task.state == *state).count();
            (n > 0).then(|| format!("{n} {}", reasons::name(state)))
        });
        counted.collect::<Vec<_>>().join(", ")
    };
    match (line(&OPEN), line(&ENDED)) {
        (open, ended) if open.is_empty() && ended.is_empty() => "no tasks".to_owned(),
        (open, ended) if open.is_empty() => format!("all ended: {ended}"),
        (open, ended) if ended.is_empty() => open,
        (open, ended) => format!("{open}; {ended}"),
    }
}

/// How many of a list are in which state, and how many it leaves out.
pub(crate) fn count_list(list: &TaskList) -> String {
    match (count(&list.tasks), list.left_out) {
        (count, 0) => count,
        (count, left_out) => format!("{count}; {left_out} more not listed"),
    }
}

/// A task in one line.
pub(crate) fn line(task: &TaskView) -> String {
    let on = robot(task).map(|robot| format!(" on {robot}")).unwrap_or_default();
    let legs = match task.legs {
        Some(1) => String::new(),
        _ => format!(" · {}", legs(task)),
    };
    let why = task.reason.as_ref().map(|reason| format!(" · {reason}")).unwrap_or_default();
    format!("{} {}{on}: {}{legs}{why}", task.id, reasons::name(&task.state), what(&task.spec.kind))
}

#[cfg(test)]
mod tests;
