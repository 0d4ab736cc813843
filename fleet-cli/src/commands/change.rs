//! `cancel`, `pause`, `resume` and `retry`: answered when robots have confirmed.

use crate::commands::dispatcher;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::text::task::tone;
use clap::{ArgGroup, Args};
use xtb_client::client::Client;
use xtb_client::dispatcher_client::{Changes, worst};
use xtb_client::text::reasons;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::messages::{DispatchBody, TaskChange, TaskId};

const CANCEL_HELP: &str = "\
The answer comes when the robot has confirmed that it has ended the task. If that takes more than 5 s, the \
command says so and ends with exit code 3; the dispatcher keeps trying.

Example: fleet-cli cancel t17 t18";

/// Arguments of `cancel`.
#[derive(Debug, Clone, Args)]
#[command(after_help = CANCEL_HELP, group = ArgGroup::new("which").args(["tasks", "all"]).required(true))]
pub struct CancelArgs {
    /// Tasks, such as t17.
    #[arg(value_name = "TASK")]
    pub tasks: Vec<TaskId>,
    /// All tasks that have not ended.
    #[arg(long)]
    pub all: bool,
}

/// Arguments of `pause`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "The robots stop and are free for other tasks. Example: fleet-cli pause t17")]
pub struct PauseArgs {
    /// Tasks, such as t17.
    #[arg(value_name = "TASK", required = true)]
    pub tasks: Vec<TaskId>,
}

/// Arguments of `resume`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "The tasks continue at their last point. Example: fleet-cli resume t17")]
pub struct ResumeArgs {
    /// Tasks, such as t17.
    #[arg(value_name = "TASK", required = true)]
    pub tasks: Vec<TaskId>,
}

/// Arguments of `retry`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "The tasks continue at their last point. Example: fleet-cli retry t17")]
pub struct RetryArgs {
    /// Failed or cancelled tasks, such as t17.
    #[arg(value_name = "TASK", required = true)]
    pub tasks: Vec<TaskId>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<TaskChange>];

/// Ends tasks.
///
/// # Errors
/// No router, no dispatcher, or it does not answer.
pub async fn cancel(ctx: &Context, args: CancelArgs) -> Result<Exit> {
    let body = match args.all {
        true => DispatchBody::CancelAll {},
        false => DispatchBody::Cancel { tasks: args.tasks },
    };
    change(ctx, body).await
}

/// Puts tasks aside.
///
/// # Errors
/// As [`cancel`].
pub async fn pause(ctx: &Context, args: PauseArgs) -> Result<Exit> {
    change(ctx, DispatchBody::Pause { tasks: args.tasks }).await
}

/// Lets tasks go on.
///
/// # Errors
/// As [`cancel`].
pub async fn resume(ctx: &Context, args: ResumeArgs) -> Result<Exit> {
    change(ctx, DispatchBody::Resume { tasks: args.tasks }).await
}

/// Queues tasks again.
///
/// # Errors
/// As [`cancel`].
pub async fn retry(ctx: &Context, args: RetryArgs) -> Result<Exit> {
    change(ctx, DispatchBody::Retry { tasks: args.tasks }).await
}

async fn change(ctx: &Context, body: DispatchBody) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let changes = dispatcher(&client).change(body).await;
    client.close().await;
    let Changes { tasks, left_out } = changes?;
    let exit = report(ctx, &tasks)?;
    if left_out > 0 {
        ctx.out.note(&format!("{left_out} more are not shown; `fleet-cli tasks --all` lists them"));
    }
    Ok(exit)
}

/// A line for each task: on standard output how it stands, on standard error why it is not as asked.
pub(super) fn report(ctx: &Context, changes: &[TaskChange]) -> Result<Exit> {
    if changes.is_empty() && !ctx.out.json {
        ctx.out.note("no task is open");
    }
    for change in changes {
        if ctx.out.json {
            ctx.out.line(change)?;
        } else if let Some(error) = &change.error {
            ctx.out.failure(&Error::from(error.clone()));
        } else if let Some(state) = change.state {
            let state = ctx.out.paint(tone(state), &reasons::name(&state));
            ctx.out.text(&format!("{} {state}", change.id))?;
        }
    }
    Ok(worst(changes).map_or(Exit::Done, |error| ErrorKind::NotDispatched(error.code).into()))
}

#[cfg(test)]
mod tests;
