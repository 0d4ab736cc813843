//! `tasks --watch`: repainted on a terminal; elsewhere as it is now, then a line for each change.

use super::{concerns, screen};
use crate::commands::tasks::TasksArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::output::Tone;
use crate::terminal::Terminal;
use crate::text::task as task_text;
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::pin::pin;
use std::time::Duration;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::{DispatcherClient, TaskChanges};
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{TaskId, TaskList, TaskState, TaskView};

/// Looks this often even if no change was heard of.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// And after a change not sooner than this.
const SETTLE: Duration = Duration::from_millis(200);

/// Shows tasks until the operator leaves.
pub(super) async fn run(ctx: &Context, client: &Client, args: &TasksArgs) -> Result<Exit> {
    let news = TaskChanges::open(client).await?;
    // Nobody shall stare at an empty screen to learn that nothing runs.
    let first = tokio::select! {
        first = async { DispatcherClient::of(client).list().await } => first?,
        () = interrupted() => return Ok(Exit::Done),
    };
    if ctx.out.json || !std::io::stdout().is_terminal() || !std::io::stdin().is_terminal() {
        return follow(ctx, client, args, &news, first).await;
    }
    repaint(ctx, client, args, &news, first).await
}

async fn next(client: &Client, news: &TaskChanges) -> Result<TaskList> {
    news.next(LOOK_EVERY).await;
    tokio::time::sleep(SETTLE).await;
    DispatcherClient::of(client).list().await
}

/// A dispatcher that is away may come back.
fn only_silent(failure: &Error) -> bool {
    matches!(failure.kind, ErrorKind::NoDispatcher | ErrorKind::OutcomeUnknown)
}

async fn repaint(
    ctx: &Context,
    client: &Client,
    args: &TasksArgs,
    news: &TaskChanges,
    mut list: TaskList,
) -> Result<Exit> {
    let mut terminal = Terminal::open()?;
    let mut stop = pin!(interrupted());
    let mut trouble: Option<String> = None;
    loop {
        terminal.paint(&lines(ctx, args, &list, trouble.as_deref()))?;
        let came = tokio::select! {
            () = &mut stop => return Ok(Exit::Done),
            () = terminal.left() => return Ok(Exit::Done),
            came = next(client, news) => came,
        };
        match came {
            Ok(newer) => (list, trouble) = (newer, None),
            Err(failure) if only_silent(&failure) => trouble = Some(failure.message),
            Err(failure) => return Err(failure),
        }
    }
}

fn lines(ctx: &Context, args: &TasksArgs, list: &TaskList, trouble: Option<&str>) -> Vec<String> {
    let title = format!("tasks of fleet {} · q quits", ctx.settings.fleet);
    let mut lines = vec![ctx.out.paint(Tone::Dim, &title), String::new()];
    if let Some(trouble) = trouble {
        lines.push(ctx.out.paint(Tone::Bad, &format!("STALE: {trouble}")));
    }
    lines.extend(screen(list, args, &ctx.out));
    lines
}

/// What has to differ for a task to get a new line.
type Gist = (TaskState, Option<Name>, u32, Option<String>);

fn gist(task: &TaskView) -> Gist {
    (task.state, task.robot.clone(), task.legs_done, task.reason.clone())
}

/// The tasks that differ from what was shown before, which they are from now on.
fn changed<'a>(shown: &mut BTreeMap<TaskId, Gist>, list: &'a TaskList) -> Vec<&'a TaskView> {
    let differs = |task: &&TaskView| {
        let gist = gist(task);
        shown.insert(task.id, gist.clone()) != Some(gist)
    };
    list.tasks.iter().filter(differs).collect()
}

async fn follow(
    ctx: &Context,
    client: &Client,
    args: &TasksArgs,
    news: &TaskChanges,
    first: TaskList,
) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let mut shown = BTreeMap::new();
    // What has ended before is old, unless it was asked for.
    let old = |task: &&TaskView| task.state.is_final() && !args.all;
    shown.extend(first.tasks.iter().filter(old).map(|task| (task.id, gist(task))));
    if !ctx.out.json {
        ctx.out.text(&screen(&first, args, &ctx.out).join("\n"))?;
        shown.extend(first.tasks.iter().map(|task| (task.id, gist(task))));
    }
    let (mut list, mut silent) = (first, false);
    loop {
        for task in changed(&mut shown, &list) {
            if concerns(task, args.robot.as_ref()) {
                ctx.out.result(task, task_text::line)?;
            }
        }
        let came = tokio::select! {
            () = &mut stop => return Ok(Exit::Done),
            came = next(client, news) => came,
        };
        match came {
            Ok(newer) => (list, silent) = (newer, false),
            Err(failure) if only_silent(&failure) => {
                if !silent {
                    ctx.out.note(&failure.message);
                }
                silent = true;
            }
            Err(failure) => return Err(failure),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::task;

    #[test]
    fn only_what_has_changed_gets_a_line() {
        let list = |tasks| TaskList {
            ledger: 1,
            at_ms: 0,
            ledger_failed: None,
            tasks,
            left_out: 0,
            suspended: Vec::new(),
        };
        let mut shown = BTreeMap::new();
        let ids = |tasks: Vec<&TaskView>| tasks.iter().map(|task| task.id.number()).collect::<Vec<_>>();
        let first = list(vec![task(1, TaskState::Queued), task(2, TaskState::Running)]);
        assert_eq!(ids(changed(&mut shown, &first)), [1, 2]);
        assert_eq!(ids(changed(&mut shown, &first)), [0_u64; 0]);
        let second = list(vec![task(1, TaskState::Assigned), task(2, TaskState::Running)]);
        assert_eq!(ids(changed(&mut shown, &second)), [1]);
    }
}
