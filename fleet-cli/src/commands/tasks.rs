//! `tasks`: what the dispatcher has to do, does and has done.

mod watch;

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::or_interrupted;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use crate::text::task as task_text;
use clap::Args;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::DispatcherClient;
use xtb_protocol::Name;
use xtb_protocol::messages::{TaskList, TaskView, Who};

const TASKS_HELP: &str = "\
Exit code 0 means that the dispatcher has answered. With --json the list is one object, its tasks in `tasks`; \
with --watch each change is one line, on a pipe after the list.

Example: fleet-cli tasks --watch";

/// Arguments of `tasks`.
#[derive(Debug, Clone, Args)]
#[command(after_help = TASKS_HELP)]
pub struct TasksArgs {
    /// Update continuously; q or Ctrl-C quits.
    #[arg(long)]
    pub watch: bool,
    /// Show all ended tasks, not only the latest.
    #[arg(long)]
    pub all: bool,
    /// Only tasks of this robot: in progress, ended or waiting for it.
    #[arg(long, value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Option<Name>,
}

/// Tasks that have ended and are shown without `--all`.
const ENDED_SHOWN: usize = 5;

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<TaskList>, line_of::<TaskView>];

/// Prints them, or keeps showing them.
///
/// # Errors
/// No router, or no dispatcher.
pub async fn run(ctx: &Context, args: &TasksArgs) -> Result<Exit> {
    if args.watch {
        let client = Client::open(&ctx.settings).await?;
        let exit = watch::run(ctx, &client, args).await;
        client.close().await;
        return exit;
    }
    or_interrupted(once(ctx, args)).await
}

async fn once(ctx: &Context, args: &TasksArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let list = DispatcherClient::of(&client).list().await;
    client.close().await;
    let mut list = list?;
    list.tasks.retain(|task| concerns(task, args.robot.as_ref()));
    ctx.out.result(&list, |list| screen(list, args, &ctx.out).join("\n"))?;
    Ok(Exit::Done)
}

/// Whether a task is on that robot, ended there or waits for it.
fn concerns(task: &TaskView, robot: Option<&Name>) -> bool {
    let wishes = |robot: &Name| matches!(&task.spec.who, Who::Robot(wished) if wished == robot);
    robot.is_none_or(|robot| task_text::robot(task) == Some(robot) || wishes(robot))
}

/// The table, what is not in it, and what is wrong.
fn screen(list: &TaskList, args: &TasksArgs, out: &Output) -> Vec<String> {
    let wanted = |task: &&TaskView| concerns(task, args.robot.as_ref());
    let ended = list.tasks.iter().filter(wanted).filter(|task| task.state.is_final()).count();
    let mut hidden = if args.all { 0 } else { ended.saturating_sub(ENDED_SHOWN) };
    let all: Vec<TaskView> = list.tasks.iter().filter(wanted).cloned().collect();
    let count = task_text::count(&all);
    let left_out = hidden;
    let shown: Vec<&TaskView> = all
        .iter()
        .filter(|task| {
            let hide = hidden > 0 && task.state.is_final();
            hidden -= usize::from(hide);
            !hide
        })
        .collect();
    let mut lines = Vec::new();
    if let Some(why) = &list.ledger_failed {
        lines.push(out.paint(Tone::Bad, &format!("the ledger cannot be written: {why}")));
    }
    for suspended in task_text::suspended(&list.suspended, Some(list.at_ms), out) {
        lines.extend(suspended.lines().map(str::to_owned));
    }
    if !shown.is_empty() {
        lines.extend(task_text::table(shown.into_iter(), list.at_ms, out).lines().map(str::to_owned));
    }
    let more = if left_out > 0 { format!(" ({left_out} of them not shown: --all)") } else { String::new() };
    lines.push(out.paint(Tone::Dim, &format!("{count}{more}")));
    lines
}

#[cfg(test)]
mod tests;
