//! What `goto` and `wander` share: start a goal, and with `--wait` follow it to its end.

mod several;
mod task;

pub(super) use task::Task;

use super::take_control;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::output::ProgressLine;
use futures_util::FutureExt;
use futures_util::future::Shared;
use schemars::JsonSchema;
use serde::Serialize;
use std::pin::{Pin, pin};
use std::time::{Duration, Instant};
use xtb_client::goal::{Cancelled, GoalOutcome, GoalStep, GoalTarget, GoalWatch, cancel, start, stop_hint};
use xtb_client::text::reasons;
use xtb_client::text::robot as describe;
use xtb_client::{Client, Control, LastState, StateFeed};
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::messages::texts::is_client_timeout;
use xtb_protocol::messages::{GoalStatus, LinkLoss, RejectCode, RobotState};
use xtb_protocol::{Name, Uuid};

/// Slower than this it stands: by more than what the encoder of a robot that stands may still say.
const STANDING_MPS: f64 = 0.02;

#[derive(Debug, Serialize, JsonSchema)]
struct Report<'a> {
    robot: &'a Name,
    goal: Uuid,
    status: GoalStatus,
    reason: Option<String>,
    distance_m: Option<f64>,
    elapsed_s: f64,
    /// From whom control was taken.
    taken_from: Option<&'a str>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Report<'_>>];

/// Ctrl-C, heard by all that run.
type Stop = Shared<Pin<Box<dyn Future<Output = ()>>>>;

/// Finds out with `find` what to send to whom, sends it and, if asked to, stays with it.
///
/// # Errors
/// No router, or what `find` says; of one robot also no answer or a refusal: of several each one's is said beside its
/// name.
pub(super) async fn run(ctx: &Context, find: impl AsyncFnOnce(&Client) -> Result<Vec<Task>>) -> Result<Exit> {
    let stop: Pin<Box<dyn Future<Output = ()>>> = Box::pin(interrupted());
    let stop = stop.shared();
    let begun = async {
        let client = Client::open(&ctx.settings).await?;
        let tasks = find(&client).await?;
        Ok::<_, Error>((client, tasks))
    };
    let (client, tasks) = tokio::select! {
        begun = begun => begun?,
        () = stop.clone() => return Err(Error::new(ErrorKind::Interrupted, "interrupted: no goal was sent")),
    };
    let exit = match &tasks[..] {
        [task] => one(ctx, &client, task, stop, ProgressLine::new()).await,
        tasks => Ok(several::each(ctx, &client, tasks, &stop).await),
    };
    client.close().await;
    exit
}

async fn one(
    ctx: &Context,
    client: &Client,
    task: &Task,
    stop: Stop,
    progress: ProgressLine,
) -> Result<Exit> {
    let mut stop = pin!(stop);
    let control = tokio::select! {
        control = take_control(ctx, client, &task.robot, task.take) => control?,
        () = &mut stop => {
            let message = format!("interrupted: no goal was sent to {}", task.robot);
            return Err(Error::new(ErrorKind::Interrupted, message));
        }
    };
    let exit = if task.wait {
        drive(ctx, client, &control, task, stop, progress).await
    } else {
        send(ctx, &control, task, stop).await
    };
    control.release().await;
    exit
}

/// The goal outlives this client, so it is bounded in time.
async fn send(ctx: &Context, control: &Control, task: &Task, stop: impl Future<Output = ()>) -> Result<Exit> {
    let (goal, robot, request) = (Uuid::new_v4(), &task.robot, task.request());
    tokio::select! {
        started = start(control, goal, &request) => started?,
        // It may have arrived nevertheless.
        () = stop => {
            let how = match cancel(control, goal).await? {
                Cancelled::Ended => "goal cancelled",
                Cancelled::NotRunning => "the goal is not running",
            };
            return Err(Error::new(ErrorKind::Interrupted, format!("interrupted; {robot}: {how}")));
        }
    }
    let report = Report {
        robot,
        goal,
        status: GoalStatus::Accepted,
        reason: None,
        distance_m: None,
        elapsed_s: 0.0,
        taken_from: control.taken_from(),
    };
    ctx.out
        .result(&report, |_| format!("{robot} accepted goal {goal}: {}\n{}", task.target, task.alone()))?;
    Ok(Exit::Done)
}

async fn drive(
    ctx: &Context,
    client: &Client,
    control: &Control,
    task: &Task,
    mut stop: Pin<&mut impl Future<Output = ()>>,
    mut progress: ProgressLine,
) -> Result<Exit> {
    let mut watch = GoalWatch::open(client, control).await?;
    let (goal, request) = (watch.goal(), task.request());
    tokio::select! {
        started = watch.start(&request) => started?,
        // It may have arrived nevertheless.
        () = &mut stop => return cancelled(ctx, control, &watch).await,
    }
    progress.show(&format!("{}: goal {goal}: {}", task.robot, task.target));
    loop {
        let step = tokio::select! {
            () = &mut stop => {
                progress.end();
                return cancelled(ctx, control, &watch).await;
            }
            step = watch.next() => step,
        };
        let seen = match step {
            GoalStep::Running(seen) => seen,
            GoalStep::Ended(end) => {
                progress.end();
                return match lost(control, watch.feed(), task) {
                    Some(failure) if end.status != GoalStatus::Reached => Err(with_end(failure, task, &end)),
                    _ => report(ctx, control, task, &watch, end),
                };
            }
            GoalStep::ControlLost => {
                progress.end();
                let failure = lost(control, watch.feed(), task).unwrap_or_else(|| unheard(&watch, task));
                let message = format!("{}; goal {} had not ended before", failure.message, task.target);
                return Err(Error { message, ..failure });
            }
            GoalStep::Unheard(_) => {
                progress.end();
                return Err(unheard(&watch, task));
            }
        };
        progress.show(&line(
            task,
            seen.as_deref().and_then(LastState::fresh),
            watch.silent(),
            control.is_lost(),
        ));
        if task.within.is_some_and(|within| watch.elapsed() > within) {
            let cancelled = cancel(control, goal).await;
            // If it has ended by itself just now, the next state says how.
            if cancelled != Ok(Cancelled::NotRunning) {
                progress.end();
                cancelled?;
                let end =
                    GoalOutcome { status: GoalStatus::Cancelled, reason: Some("time limit reached".into()) };
                return report(ctx, control, task, &watch, end);
            }
        }
    }
}

/// Ctrl-C: the goal ends, and the robot is watched until it stands.
async fn cancelled(ctx: &Context, control: &Control, watch: &GoalWatch<'_>) -> Result<Exit> {
    let (asked, robot) = (Instant::now(), control.robot());
    let how = match cancel(control, watch.goal()).await? {
        Cancelled::Ended => "goal cancelled",
        Cancelled::NotRunning => "the goal is not running",
    };
    let standing = async {
        while !watch.feed().last(robot).is_some_and(|seen| seen.at > asked && stands(&seen.state)) {
            watch.feed().news().await;
        }
    };
    let failure = match tokio::time::timeout(ctx.settings.timeout, standing).await {
        Ok(()) => Error::new(ErrorKind::Interrupted, format!("{robot} stopped: {how}")),
        Err(_) => {
            Error::new(ErrorKind::Interrupted, format!("{how}, but {robot} is not confirmed as stopped"))
                .hint(stop_hint(robot))
        }
    };
    ctx.out.failure(&failure);
    Ok(Exit::Interrupted)
}

fn stands(state: &RobotState) -> bool {
    state.reference_rpm == 0.0 && state.speed_mps.is_some_and(|speed| speed.abs() < STANDING_MPS)
}

fn unheard(watch: &GoalWatch<'_>, task: &Task) -> Error {
    let (age, goal) = (describe::age(watch.silent()), watch.goal());
    let message = format!("no message from {} for {age}: outcome of goal {goal} unknown", task.robot);
    Error::new(ErrorKind::OutcomeUnknown, message).hint(unheard_hint(task))
}

/// Who has control instead, if this client has lost it.
fn lost(control: &Control, feed: &StateFeed, task: &Task) -> Option<Error> {
    let failure = control.lost()?;
    Some(match control.taken_by(feed) {
        Some(message) => Error { kind: ErrorKind::Refused(RejectCode::LeaseLost), message, ..failure },
        // Nobody took it: it ran out while the robot did not hear this client.
        None => Error { hint: gap_hint(task), ..failure },
    })
}

fn with_end(failure: Error, task: &Task, end: &GoalOutcome) -> Error {
    let reason = end.reason.as_ref().map(|reason| format!(" ({reason})")).unwrap_or_default();
    let status = reasons::name(&end.status);
    Error { message: format!("{}; goal {} {status}{reason}", failure.message, task.target), ..failure }
}

fn line(task: &Task, state: Option<&RobotState>, age: Duration, lease_lost: bool) -> String {
    let Some(state) = state else {
        return format!("{}: STALE, last message {} ago", task.robot, describe::age(age));
    };
    let goal = state.goal.as_ref().map(describe::goal).unwrap_or_default();
    let mut text =
        format!("{}: {goal} · {} · {}", task.robot, describe::speed(state), reasons::name(&state.mode));
    if !state.stopped_because.is_empty() {
        text.push_str(&format!(" · stopped: {}", reasons::reasons(&state.stopped_because)));
    }
    if lease_lost {
        text.push_str(&format!(" · control lost, now {}", describe::lease(state)));
    }
    text
}

fn report(
    ctx: &Context,
    control: &Control,
    task: &Task,
    watch: &GoalWatch<'_>,
    end: GoalOutcome,
) -> Result<Exit> {
    let (robot, took) = (&task.robot, watch.elapsed());
    let report = Report {
        robot,
        goal: watch.goal(),
        status: end.status,
        reason: end.reason.clone(),
        distance_m: watch.distance_m(),
        elapsed_s: (took.as_secs_f64() * 100.0).round() / 100.0,
        taken_from: control.taken_from(),
    };
    let reached = end.status == GoalStatus::Reached;
    let seconds = format!("{:.1} s", took.as_secs_f64());
    if ctx.out.json {
        ctx.out.line(&report)?;
    } else if reached {
        let verb = match task.target {
            GoalTarget::Point { .. } => "reached",
            GoalTarget::Wander { .. } => "completed its",
        };
        ctx.out.text(&format!("{robot} {verb} {} after {seconds}", task.target))?;
    } else {
        let gap = end.reason.as_deref().is_some_and(is_client_timeout);
        let reason = end.reason.map(|reason| format!(" ({reason})")).unwrap_or_default();
        let status = reasons::name(&end.status);
        let message = format!("{robot}: goal {} {status}{reason} after {seconds}", task.target);
        let hint = if gap { gap_hint(task) } else { hint(robot, end.status) };
        ctx.out.failure(&Error::new(ErrorKind::Failed, message).hint(hint));
    }
    Ok(if reached { Exit::Done } else { Exit::Failed })
}

/// What to do about a gap in the network that ended a goal.
fn gap_hint(task: &Task) -> String {
    let robot = &task.robot;
    match task.request().on_link_loss {
        LinkLoss::Halt => format!(
            "with --wait, a network gap of more than 0.5 s ends the goal; with `--on-link-loss finish` \
             {robot} continues during the gap"
        ),
        LinkLoss::Finish => {
            format!("a network gap ended control, not the goal: `fleet-cli why {robot}` shows its state")
        }
    }
}

/// What to do about a robot that is out of reach while its goal runs.
fn unheard_hint(task: &Task) -> String {
    let back = format!("`fleet-cli why {}` shows when it is online again", task.robot);
    match task.request().on_link_loss {
        LinkLoss::Finish => format!("{}; {back}", task.alone()),
        LinkLoss::Halt => {
            format!("without a link, {}; with `--on-link-loss finish` it continues; {back}", task.alone())
        }
    }
}

fn hint(robot: &Name, status: GoalStatus) -> String {
    match status {
        GoalStatus::Interrupted => "the robot restarted; send the goal again".to_owned(),
        GoalStatus::Replaced => format!("`fleet-cli why {robot}` shows who sent the new goal"),
        GoalStatus::Cancelled => "the robot was stopped, or the goal took too long; send the goal \
                                  again"
            .to_owned(),
        _ => format!("`fleet-cli why {robot}` shows why it is stopped, and what to do"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::{FakeRobot, name};
    use xtb_protocol::messages::Body;

    fn task() -> Task {
        let target = GoalTarget::Point { x_m: 1.0, y_m: 2.0, yaw_rad: None, via: None };
        Task { robot: name("xtb-1"), target, within: None, wait: true, on_link_loss: None, take: false }
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_loses_control_while_waiting_is_told_to_whom() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let (task, ctx) = (task(), Context::of(&client));
        let control = Control::acquire(&client, &task.robot, false).await.unwrap();
        let stop = pin!(std::future::pending());
        let waiting = drive(&ctx, &client, &control, &task, stop, ProgressLine::new());
        let taking = async {
            fake.until(|fake| fake.state.goal.is_some()).await;
            fake.lock().grant(&name("cli-123456"));
        };
        let (ended, ()) = tokio::join!(waiting, taking);
        let failure = ended.unwrap_err();
        assert_eq!(Exit::from(failure.kind), Exit::Failed);
        assert!(failure.message.contains("xtb-1 is now controlled by cli-123456"), "{failure}");
        assert!(failure.hint.contains("--take"), "{}", failure.hint);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn an_interrupted_wait_cancels_its_goal_and_sees_the_robot_stand() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let (task, ctx) = (task(), Context::of(&client));
        let control = Control::acquire(&client, &task.robot, false).await.unwrap();
        let stop = pin!(fake.until(|fake| fake.state.goal.is_some()));
        let ended = drive(&ctx, &client, &control, &task, stop, ProgressLine::new()).await;
        assert_eq!(ended, Ok(Exit::Interrupted));
        let goal = fake.lock().state.goal.clone().unwrap();
        assert_eq!(goal.status, GoalStatus::Cancelled);
        assert!(fake.lock().asked.contains(&(name("me"), Body::Cancel { goal: goal.id })));
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_loses_control_by_a_gap_is_pointed_to_the_policy_and_not_to_taking_control() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let (task, ctx) = (task(), Context::of(&client));
        let control = Control::acquire(&client, &task.robot, false).await.unwrap();
        let stop = pin!(std::future::pending());
        let waiting = drive(&ctx, &client, &control, &task, stop, ProgressLine::new());
        let gap = async {
            fake.until(|fake| fake.state.goal.is_some()).await;
            let mut fake = fake.lock();
            (fake.lease, fake.state.lease) = (None, None);
            let goal = fake.state.goal.as_mut().unwrap();
            (goal.status, goal.reason) = (GoalStatus::Failed, Some("controlling client me timed out".into()));
        };
        let (ended, ()) = tokio::join!(waiting, gap);
        let failure = ended.unwrap_err();
        assert_eq!(Exit::from(failure.kind), Exit::Failed);
        assert!(failure.hint.contains("--on-link-loss finish"), "{}", failure.hint);
        assert!(!failure.hint.contains("--take"), "{}", failure.hint);
    }
}
