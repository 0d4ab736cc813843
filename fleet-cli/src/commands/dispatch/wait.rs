//! `--wait`: stays until tasks have ended, through restarts of the dispatcher.

use crate::commands::dispatcher;
use crate::context::Context;
use crate::exit::Exit;
use crate::output::ProgressLine;
use crate::text::task as task_text;
use std::collections::BTreeSet;
use std::pin::Pin;
use std::time::{Duration, Instant};
use xtb_client::DispatcherClient;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::{TaskChanges, worst};
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::messages::{DispatchBody, TaskId, TaskState, TaskView};

/// Looks this often even if no change was heard of.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// And after a change not sooner than this.
const SETTLE: Duration = Duration::from_millis(100);
/// A dispatcher that has not answered for this long may not come back.
const GIVE_UP_AFTER: Duration = Duration::from_secs(30);

/// Follows tasks to their end.
pub(super) async fn run(
    ctx: &Context,
    client: &Client,
    ids: &[TaskId],
    cancels: bool,
    mut stop: Pin<&mut impl Future<Output = ()>>,
) -> Result<Exit> {
    let mut progress = ProgressLine::new();
    progress.show(&format!("{} submitted", names(ids)));
    let followed = tokio::select! {
        followed = follow(ctx, client, ids, &mut progress) => followed,
        () = &mut stop => {
            progress.end();
            return left(ctx, client, ids, cancels).await;
        }
    };
    progress.end();
    followed
}

async fn follow(ctx: &Context, client: &Client, ids: &[TaskId], progress: &mut ProgressLine) -> Result<Exit> {
    let dispatching = dispatcher(client);
    let news = TaskChanges::open(client).await?;
    let mut open: BTreeSet<TaskId> = ids.iter().copied().collect();
    let mut all_done = true;
    let mut heard = Instant::now();
    while !open.is_empty() {
        match look(&dispatching, &open).await {
            Ok(views) => {
                heard = Instant::now();
                for view in views.iter().filter(|view| view.state.is_final()) {
                    open.remove(&view.id);
                    all_done &= view.state == TaskState::Done;
                    progress.end();
                    report(ctx, view, ids.len() == 1)?;
                }
                if !open.is_empty() {
                    progress.show(&line(&views, &open));
                }
            }
            Err(failure) if !matches!(failure.kind, ErrorKind::NoDispatcher | ErrorKind::OutcomeUnknown) => {
                return Err(failure);
            }
            Err(failure) if heard.elapsed() > GIVE_UP_AFTER => {
                let message = format!("{}; outcome of {} unknown", failure.message, some(&open));
                return Err(Error { kind: ErrorKind::OutcomeUnknown, message, ..failure });
            }
            Err(_) => {
                let seconds = heard.elapsed().as_secs();
                progress.show(&format!("{}: no answer from the dispatcher for {seconds} s", some(&open)));
            }
        }
        if !open.is_empty() {
            news.next(LOOK_EVERY).await;
            tokio::time::sleep(SETTLE).await;
        }
    }
    Ok(if all_done { Exit::Done } else { Exit::Failed })
}

/// How the tasks that are waited for stand. One alone comes with the reason why it waits.
async fn look(dispatching: &DispatcherClient<'_>, open: &BTreeSet<TaskId>) -> Result<Vec<TaskView>> {
    match open.first() {
        Some(only) if open.len() == 1 => Ok(vec![dispatching.show(*only).await?.task]),
        _ => {
            let list = dispatching.list().await?;
            Ok(list.tasks.into_iter().filter(|task| open.contains(&task.id)).collect())
        }
    }
}

fn line(views: &[TaskView], open: &BTreeSet<TaskId>) -> String {
    match views {
        [view] => task_text::line(view),
        views => format!("{} to go: {}", open.len(), task_text::count(views)),
    }
}

/// Says how one has ended.
fn report(ctx: &Context, view: &TaskView, alone: bool) -> Result<()> {
    if ctx.out.json {
        return ctx.out.line(view);
    }
    let took = task_text::since(view.since_ms, view.submitted_ms);
    let text = format!("{} after {took}", task_text::line(view));
    if view.state == TaskState::Done || !alone {
        return ctx.out.text(&text);
    }
    let over = view.spec.deadline_ms.is_some_and(|deadline_ms| deadline_ms <= view.since_ms);
    let hint = match over {
        true => {
            format!(
                "`fleet-cli task {}` shows its history; deadline passed: submit it as a new task",
                view.id
            )
        }
        false => {
            format!("`fleet-cli task {0}` shows its history, `fleet-cli retry {0}` tries again", view.id)
        }
    };
    ctx.out.failure(&Error::new(ErrorKind::Failed, text).hint(hint));
    Ok(())
}

/// After Ctrl-C: the tasks stay, or end.
async fn left(ctx: &Context, client: &Client, ids: &[TaskId], cancels: bool) -> Result<Exit> {
    let open: BTreeSet<TaskId> = ids.iter().copied().collect();
    if !cancels {
        let message = format!("interrupted: the dispatcher continues with {}", some(&open));
        let hint =
            format!("cancel with `fleet-cli cancel {}`; --cancel-on-interrupt cancels on Ctrl-C", names(ids));
        return Err(Error::new(ErrorKind::Interrupted, message).hint(hint));
    }
    let changes = dispatcher(client).change(DispatchBody::Cancel { tasks: ids.to_vec() }).await?;
    // What had ended by then is no reason to complain.
    let changes: Vec<_> =
        changes.tasks.into_iter().filter(|change| !change.state.is_some_and(TaskState::is_final)).collect();
    match worst(&changes) {
        Some(error) => Err(Error::from(error.clone())),
        None => {
            if !ctx.out.json {
                ctx.out.note(&format!("interrupted: {} ended", some(&open)));
            }
            Ok(Exit::Interrupted)
        }
    }
}

fn names(ids: &[TaskId]) -> String {
    match ids {
        [first, .., last] if ids.len() > 5 => format!("{first} … {last}"),
        ids => ids.iter().map(TaskId::to_string).collect::<Vec<_>>().join(" "),
    }
}

fn some(ids: &BTreeSet<TaskId>) -> String {
    names(&ids.iter().copied().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests;
