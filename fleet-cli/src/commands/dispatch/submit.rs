//! `dispatch goto`, `route`, `patrol`, `wander` and `submit`: tasks for the dispatcher.

use super::{file as files, points, wait};
use crate::cli::{
    StayArgs, TaskGotoArgs, TaskPatrolArgs, TaskRouteArgs, TaskSubmitArgs, TaskWanderArgs, TermArgs,
};
use crate::commands::dispatcher;
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};
use crate::interrupt::interrupted;
use crate::text::task as task_text;
use serde::Serialize;
use std::pin::pin;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use xtb_client::client::Client;
use xtb_client::dispatcher_client::Taken;
use xtb_protocol::messages::{TaskId, TaskKind, TaskSpec, Waypoint, Who};

/// What `--json` prints for a task that was taken.
#[derive(Debug, Serialize)]
struct Submitted<'a> {
    id: TaskId,
    spec: &'a TaskSpec,
}

/// One drive to a point.
pub(super) async fn goto(ctx: &Context, args: &TaskGotoArgs) -> Result<Exit> {
    let to = Waypoint { x_m: args.x_m, y_m: args.y_m, yaw_rad: args.yaw.map(f64::to_radians) };
    one(ctx, TaskKind::Goto { to }, &args.terms, args.stay).await
}

/// Along points.
pub(super) async fn route(ctx: &Context, args: &TaskRouteArgs) -> Result<Exit> {
    let points = points::read(&args.points)?;
    let kind = TaskKind::Route { points, loops: args.loops, dwell_s: args.dwell_s };
    one(ctx, kind, &args.terms, args.stay).await
}

/// Along points again and again.
pub(super) async fn patrol(ctx: &Context, args: &TaskPatrolArgs) -> Result<Exit> {
    let points = points::read(&args.points)?;
    let for_s = args.lasting.map(|lasting| lasting.as_secs_f64());
    one(ctx, TaskKind::Patrol { points, dwell_s: args.dwell_s, for_s }, &args.terms, args.stay).await
}

/// Anywhere.
pub(super) async fn wander(ctx: &Context, args: &TaskWanderArgs) -> Result<Exit> {
    one(ctx, TaskKind::Wander { for_s: args.lasting.as_secs_f64() }, &args.terms, args.stay).await
}

/// Whatever a file says.
pub(super) async fn file(ctx: &Context, args: &TaskSubmitArgs) -> Result<Exit> {
    let specs = files::read(&args.file, now_ms())?;
    submit(ctx, specs, args.stay).await
}

fn now_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
    u64::try_from(since.as_millis()).unwrap_or(u64::MAX)
}

async fn one(ctx: &Context, kind: TaskKind, terms: &TermArgs, stay: StayArgs) -> Result<Exit> {
    submit(ctx, vec![spec(kind, terms, now_ms())], stay).await
}

/// The task of a command line at `now_ms`.
fn spec(kind: TaskKind, terms: &TermArgs, now_ms: u64) -> TaskSpec {
    let tag = terms.tag.as_ref().map(|tag| Who::Tag(tag.trim_start_matches('@').to_owned()));
    let able = terms.able.clone().map(Who::Able);
    let deadline_ms = |within: Duration| now_ms + u64::try_from(within.as_millis()).unwrap_or(u64::MAX / 2);
    let usual = TaskSpec::new(kind);
    TaskSpec {
        who: terms.robot.clone().map(Who::Robot).or(tag).or(able).unwrap_or_default(),
        priority: terms.priority,
        deadline_ms: terms.deadline.map(deadline_ms),
        retries: terms.retries,
        on_takeover: terms.on_takeover.into(),
        grace_s: terms.grace,
        on_link_loss: terms.on_link_loss.into(),
        finish_s: terms.finish.unwrap_or(usual.finish_s),
        ..usual
    }
}

async fn submit(ctx: &Context, specs: Vec<TaskSpec>, stay: StayArgs) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let submitted = async {
        let client = Client::open(&ctx.settings).await?;
        let taken = dispatcher(&client).submit(specs.clone()).await?;
        Ok::<_, Failure>((client, taken))
    };
    let (client, Taken { tasks: ids, suspended }) = tokio::select! {
        submitted = submitted => submitted?,
        () = &mut stop => {
            let message = "interrupted: submission not confirmed";
            return Err(Failure::new(Kind::Interrupted, message).hint("`fleet-cli tasks` shows the tasks"));
        }
    };
    // What is of another map does not keep the new ones waiting.
    if let Some(stop) = task_text::fleet_stop(&suspended) {
        ctx.out.note(&format!(
            "accepted, but not assigned yet: {}; {}",
            stop.cause.text(),
            stop.cause.remedy()
        ));
    }
    let exit = if stay.wait {
        wait::run(ctx, &client, &ids, stay.cancel_on_interrupt, stop).await
    } else {
        say(ctx, &ids, &specs)
    };
    client.close().await;
    exit
}

fn say(ctx: &Context, ids: &[TaskId], specs: &[TaskSpec]) -> Result<Exit> {
    for (id, spec) in ids.iter().zip(specs) {
        ctx.out.result(&Submitted { id: *id, spec }, |_| {
            format!("{id} submitted: {}, {}", task_text::what(&spec.kind), task_text::whose(&spec.who))
        })?;
    }
    if let ([id, ..], false) = (ids, ctx.out.json) {
        ctx.out.note(&format!(
            "`fleet-cli task {id}` shows its progress, `fleet-cli cancel {id}` cancels \
                               it"
        ));
    }
    Ok(Exit::Done)
}

#[cfg(test)]
mod tests;
