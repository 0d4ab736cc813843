//! `dispatch goto`, `route`, `patrol`, `wander` and `submit`: tasks for the dispatcher.

use super::{file as files, points, wait};
use crate::args::LinkLossArg;
use crate::commands::dispatcher;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::point::PointArgs;
use crate::text::task as task_text;
use crate::values::{degrees, part_of_a_day, seconds};
use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;
use std::pin::pin;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use xtb_client::client::Client;
use xtb_client::dispatcher_client::Taken;
use xtb_client::dispatcher_client::fleet_stop;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{MAX_PRIORITY, OnTakeover, TaskId, TaskKind, TaskSpec, TaskView, Waypoint, Who};

const GOTO_EXAMPLE: &str = "\
Examples:
  fleet-cli dispatch goto 4 2 --yaw 90 --tag red --wait
  fleet-cli dispatch goto dock-2";

const ROUTE_HELP: &str = "\
A point is X,Y or X,Y,YAW (m, degrees), or a place. A file has one point per line, with commas or spaces; # starts a \
comment.

Examples:
  fleet-cli dispatch route 1,0 2,0 2,2,90 --loops 2
  fleet-cli dispatch route corridor.txt --robot xtb-1";

const PATROL_HELP: &str = "\
A point is X,Y or X,Y,YAW (m, degrees), or a place. A file has one point per line, with commas or spaces; # starts a \
comment.

Example: fleet-cli dispatch patrol -1,0 -1,4 3,4 --dwell 5 --for 600";

const WANDER_EXAMPLE: &str = "\
Example: fleet-cli dispatch wander --for 60 --robot xtb-3";

const SUBMIT_HELP: &str = "\
The file is checked as a whole, here and by the dispatcher: all of its tasks are accepted, or none.

  [[task]]
  goto = [4.0, 2.0, 90]              # x and y in m, optionally yaw in degrees; or \"dock-2\"
  robot = \"xtb-1\"                    # or tag = \"red\", or able = \"wander\"

  [[task]]
  patrol = [[0, 0], [0, 3]]          # or route, with loops
  dwell_s = 5
  for_s = 600                        # default: until it is cancelled
  priority = 7                       # also deadline_s, retries, grace_s,
                                     # on_takeover, on_link_loss, finish_s

  [[task]]
  wander_for_s = 60

Example: fleet-cli dispatch submit tasks.toml --wait";

const WAIT_HELP: &str = "Waiting for tasks";

/// Arguments of `dispatch goto`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true, after_help = GOTO_EXAMPLE)]
pub struct TaskGotoArgs {
    /// Where to.
    #[command(flatten)]
    pub to: PointArgs,
    /// Yaw on arrival, in degrees counter-clockwise from east [default: the place's, else any].
    #[arg(long, value_name = "DEGREES", value_parser = degrees)]
    pub yaw: Option<f64>,
    /// Who, when, how.
    #[command(flatten)]
    pub terms: TermArgs,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Arguments of `dispatch route`.
#[derive(Debug, Clone, Args)]
#[command(after_help = ROUTE_HELP)]
pub struct TaskRouteArgs {
    /// Points in order, or a file of points.
    #[arg(value_name = "FILE|POINTS", required = true)]
    pub points: Vec<String>,
    /// Number of loops.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub loops: u32,
    /// Waiting time at each point.
    #[arg(long = "dwell", value_name = "SECONDS", default_value = "0", value_parser = part_of_a_day)]
    pub dwell_s: f64,
    /// Who, when, how.
    #[command(flatten)]
    pub terms: TermArgs,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Arguments of `dispatch patrol`.
#[derive(Debug, Clone, Args)]
#[command(after_help = PATROL_HELP)]
pub struct TaskPatrolArgs {
    /// Points in order, or a file of points; after the last point the first one follows again.
    #[arg(value_name = "FILE|POINTS", required = true)]
    pub points: Vec<String>,
    /// Total duration [default: until it is cancelled].
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Option<Duration>,
    /// Waiting time at each point.
    #[arg(long = "dwell", value_name = "SECONDS", default_value = "0", value_parser = part_of_a_day)]
    pub dwell_s: f64,
    /// Who, when, how.
    #[command(flatten)]
    pub terms: TermArgs,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Arguments of `dispatch wander`.
#[derive(Debug, Clone, Args)]
#[command(after_help = WANDER_EXAMPLE)]
pub struct TaskWanderArgs {
    /// Duration.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Duration,
    /// Who, when, how.
    #[command(flatten)]
    pub terms: TermArgs,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Arguments of `dispatch submit`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SUBMIT_HELP)]
pub struct TaskSubmitArgs {
    /// Tasks (TOML).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Staying with them.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Who does a task, when, and what becomes of it when something is in its way.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Task options")]
pub struct TermArgs {
    /// Only this robot [default: a free robot nearby].
    #[arg(long, value_name = "ROBOT", value_parser = Name::robot, group = "who")]
    pub robot: Option<Name>,
    /// Only robots with this tag in the roster (red or @red).
    #[arg(long, value_name = "TAG", group = "who")]
    pub tag: Option<String>,
    /// Only robots with this capability in their factsheet.
    #[arg(long, value_name = "CAPABILITY", group = "who")]
    pub able: Option<String>,
    /// Priority, from 0 (last) to 9 (first).
    #[arg(long, value_name = "0..9", default_value_t = 5,
        value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_PRIORITY)))]
    pub priority: u8,
    /// The task fails unless it is done within this time from now [default: none].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub deadline: Option<Duration>,
    /// Number of retries after a robot has failed.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=100))]
    pub retries: u32,
    /// What happens to the task when another client takes control of its robot or stops it.
    #[arg(long, value_name = "WHAT", value_enum, default_value = "requeue")]
    pub on_takeover: TakeoverArg,
    /// How long the task waits for a robot that is offline or under another client's control.
    #[arg(long, value_name = "SECONDS", default_value = "30", value_parser = part_of_a_day)]
    pub grace: f64,
    /// What the robot does without a connection to the dispatcher.
    #[arg(long, value_name = "WHAT", value_enum, default_value = "halt")]
    pub on_link_loss: LinkLossArg,
    /// With --on-link-loss finish: time limit of one drive [default: 300].
    #[arg(long, value_name = "SECONDS", value_parser = part_of_a_day, requires = "on_link_loss")]
    pub finish: Option<f64>,
}

/// What becomes of a task whose robot somebody else took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TakeoverArg {
    /// After --grace the task is queued again, for any robot.
    Requeue,
    /// The task waits for this robot.
    Resume,
    /// The task fails.
    Fail,
}

impl From<TakeoverArg> for OnTakeover {
    fn from(arg: TakeoverArg) -> Self {
        match arg {
            TakeoverArg::Requeue => Self::Requeue,
            TakeoverArg::Resume => Self::Resume,
            TakeoverArg::Fail => Self::Fail,
        }
    }
}

/// Whether to stay until a task has ended.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = WAIT_HELP)]
pub struct StayArgs {
    /// Wait and show progress until the task has ended: exit code 0 = done, 1 = failed or cancelled. Ctrl-C
    /// ends only this command; the dispatcher keeps the task.
    #[arg(long)]
    pub wait: bool,
    /// Ctrl-C cancels the task.
    #[arg(long, requires = "wait")]
    pub cancel_on_interrupt: bool,
}

/// What `--json` prints for a task that was taken.
#[derive(Debug, Serialize, JsonSchema)]
struct Submitted<'a> {
    id: TaskId,
    spec: &'a TaskSpec,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Submitted<'_>>, line_of::<TaskView>];

/// One drive to a point.
pub(super) async fn goto(ctx: &Context, args: &TaskGotoArgs) -> Result<Exit> {
    let to = args.to.resolve(ctx).await?;
    let to = Waypoint { yaw_rad: args.yaw.map(f64::to_radians).or(to.yaw_rad), ..to };
    one(ctx, TaskKind::Goto { to }, &args.terms, args.stay).await
}

/// Along points.
pub(super) async fn route(ctx: &Context, args: &TaskRouteArgs) -> Result<Exit> {
    let points = points::read(ctx, &args.points).await?;
    let kind = TaskKind::Route { points, loops: args.loops, dwell_s: args.dwell_s };
    one(ctx, kind, &args.terms, args.stay).await
}

/// Along points again and again.
pub(super) async fn patrol(ctx: &Context, args: &TaskPatrolArgs) -> Result<Exit> {
    let points = points::read(ctx, &args.points).await?;
    let for_s = args.lasting.map(|lasting| lasting.as_secs_f64());
    one(ctx, TaskKind::Patrol { points, dwell_s: args.dwell_s, for_s }, &args.terms, args.stay).await
}

/// Anywhere.
pub(super) async fn wander(ctx: &Context, args: &TaskWanderArgs) -> Result<Exit> {
    one(ctx, TaskKind::Wander { for_s: args.lasting.as_secs_f64() }, &args.terms, args.stay).await
}

/// Whatever a file says.
pub(super) async fn file(ctx: &Context, args: &TaskSubmitArgs) -> Result<Exit> {
    let specs = files::read(ctx, &args.file, now_ms()).await?;
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
    submit_saying(ctx, specs.clone(), stay, |ids| say(ctx, ids, &specs)).await
}

/// The same, and says by itself which tasks they have become.
///
/// # Errors
/// No dispatcher, or its refusal.
pub(in crate::commands) async fn submit_saying(
    ctx: &Context,
    specs: Vec<TaskSpec>,
    stay: StayArgs,
    say: impl FnOnce(&[TaskId]) -> Result<Exit>,
) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let submitted = async {
        let client = Client::open(&ctx.settings).await?;
        let taken = dispatcher(&client).submit(specs).await?;
        Ok::<_, Error>((client, taken))
    };
    let (client, Taken { tasks: ids, suspended }) = tokio::select! {
        submitted = submitted => submitted?,
        () = &mut stop => {
            let message = "interrupted: submission not confirmed";
            return Err(Error::new(ErrorKind::Interrupted, message).hint("`fleet-cli tasks` shows the tasks"));
        }
    };
    // What is of another map does not keep the new ones waiting.
    if let Some(stop) = fleet_stop(&suspended) {
        ctx.out.note(&format!(
            "accepted, but not assigned yet: {}; {}",
            stop.cause.text(),
            stop.cause.remedy()
        ));
    }
    let exit = if stay.wait {
        wait::run(ctx, &client, &ids, stay.cancel_on_interrupt, stop).await
    } else {
        say(&ids)
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
