//! `task`: one task and how it came to be so.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use crate::table::{Table, TableCell};
use crate::text::task::{legs, robot, since, tone, what, whose};
use clap::Args;
use std::time::{SystemTime, UNIX_EPOCH};
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::DispatcherClient;
use xtb_client::text::reasons;
use xtb_client::text::robot::fixed;
use xtb_protocol::messages::{OnTakeover, TaskHistory, TaskId, TaskView};

/// Arguments of `task`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example: fleet-cli task t17")]
pub struct TaskArgs {
    /// Task, such as t17.
    #[arg(value_name = "TASK")]
    pub task: TaskId,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<TaskHistory>];

/// Asks once and prints it.
///
/// # Errors
/// No router, no dispatcher, or no such task.
pub async fn run(ctx: &Context, args: &TaskArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let history = DispatcherClient::of(&client).show(args.task).await;
    client.close().await;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let now_ms = u64::try_from(now.as_millis()).unwrap_or(u64::MAX);
    ctx.out.result(&history?, |history| text(history, now_ms, &ctx.out))?;
    Ok(Exit::Done)
}

fn text(history: &TaskHistory, now_ms: u64, out: &Output) -> String {
    let TaskHistory { task, steps, left_out } = history;
    let state = out.paint(tone(task.state), &reasons::name(&task.state));
    let on = robot(task).map(|robot| format!(" on {robot}")).unwrap_or_default();
    let mut lines = vec![
        format!("{}  {}", out.paint(Tone::Strong, &task.id.to_string()), what(&task.spec.kind)),
        format!("state    {state}{on}, for {}", since(now_ms, task.since_ms)),
    ];
    if let Some(reason) = &task.reason {
        lines.push(format!("why      {reason}"));
    }
    lines.push(format!("legs     {} done", legs(task)));
    if task.failures > 0 {
        lines.push(format!("failures {} of at most {}", task.failures, task.spec.retries.saturating_add(1)));
    }
    lines.push(format!("terms    {}", terms(task, now_ms)));
    lines.push(format!("from     {}, {} ago", task.by, since(now_ms, task.submitted_ms)));
    lines.push(String::new());
    let mut table = Table::new(&["after", "state", "robot", "legs", "why"]);
    for (i, step) in steps.iter().enumerate() {
        table.row(vec![
            after(step.at_ms, task.submitted_ms).into(),
            TableCell::new(reasons::name(&step.state), tone(step.state)),
            step.robot.as_ref().map_or_else(String::new, ToString::to_string).into(),
            step.legs_done.to_string().into(),
            step.reason.clone().unwrap_or_default().into(),
        ]);
        if i == 0 && *left_out > 0 {
            table.row(vec![
                TableCell::new("…", Tone::Dim),
                TableCell::new(format!("{left_out} not shown"), Tone::Dim),
            ]);
        }
    }
    lines.push(table.render(out));
    lines.join("\n")
}

/// Time since the task was submitted: to a tenth where that says something.
fn after(at_ms: u64, submitted_ms: u64) -> String {
    match at_ms.saturating_sub(submitted_ms) {
        ms @ 0..60_000 => format!("{} s", fixed(ms as f64 / 1000.0, 1)),
        _ => since(at_ms, submitted_ms),
    }
}

fn terms(task: &TaskView, now_ms: u64) -> String {
    let spec = &task.spec;
    let mut all = vec![whose(&spec.who), format!("priority {}", spec.priority)];
    match spec.deadline_ms {
        Some(at_ms) if task.state.is_final() => {
            all.push(format!("deadline {} after submission", since(at_ms, task.submitted_ms)));
        }
        Some(at_ms) if at_ms > now_ms => all.push(format!("deadline in {}", since(at_ms, now_ms))),
        Some(_) => all.push("deadline passed".to_owned()),
        None => {}
    }
    match spec.on_takeover {
        OnTakeover::Requeue => {}
        other => all.push(format!("if another client takes the robot: {}", reasons::name(&other))),
    }
    all.join(", ")
}

#[cfg(test)]
mod tests;
