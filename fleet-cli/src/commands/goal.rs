//! What `goto` and `wander` share: start a goal, and with `--wait` follow it to its end.

pub(super) mod cancel;
mod follow;
mod task;

pub(super) use task::{Aim, Task};

use super::take_control;
use crate::client::{Client, Seen};
use crate::context::Context;
use crate::describe;
use crate::error::{Exit, Failure, Kind, Result};
use crate::feed::{Events, Feed};
use crate::interrupt::interrupted;
use crate::lease::Control;
use crate::output::Progress;
use crate::words;
use cancel::Cancel;
use follow::{End, Follow};
use serde::Serialize;
use std::pin::pin;
use std::time::{Duration, Instant};
use xtb_protocol::messages::{GoalStatus, LinkLoss, RejectCode, RobotState, StopReason};
use xtb_protocol::{Name, Uuid};

/// How often progress is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// How often the robot is asked how it stands, if the link can.
const STATE_EVERY: Duration = Duration::from_millis(150);
/// A robot that was not heard for this long may be anywhere: waiting ends, outcome unknown.
const GIVE_UP_AFTER: Duration = Duration::from_secs(5);
/// Control that was lost shows within this, two retains.
const LOSS_SHOWS: Duration = Duration::from_millis(300);
/// Who has lost control waits this long to see what came of the goal.
const LOSS_SETTLES: Duration = Duration::from_secs(1);

#[derive(Debug, Serialize)]
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

/// Sends the goal and, if asked to, stays with it.
pub(super) async fn run(ctx: &Context, task: &Task) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let begun = async {
        let client = Client::open(ctx).await?;
        let control = take_control(ctx, &client, &task.robot, task.take).await?;
        Ok::<_, Failure>((client, control))
    };
    let (client, control) = tokio::select! {
        begun = begun => begun?,
        () = &mut stop => {
            let message = format!("interrupted: no goal was sent to {}", task.robot);
            return Err(Failure::new(Kind::Interrupted, message));
        }
    };
    let exit = if task.wait {
        drive(ctx, &client, &control, task, stop).await
    } else {
        send(ctx, &control, task, stop).await
    };
    control.release().await;
    client.close().await;
    exit
}

/// The goal outlives this client, so it is bounded in time.
async fn send(ctx: &Context, control: &Control, task: &Task, stop: impl Future<Output = ()>) -> Result<Exit> {
    let (goal, robot) = (Uuid::new_v4(), &task.robot);
    tokio::select! {
        started = start(control, task, goal) => started?,
        // It may have arrived nevertheless.
        () = stop => {
            let how = match cancel::ask(control, robot, goal).await? {
                Cancel::Ended => "its goal was cancelled",
                Cancel::NotRunning => "the goal does not run",
            };
            return Err(Failure::new(Kind::Interrupted, format!("{robot} was told to stop: {how}")));
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
        .result(&report, |_| format!("{robot} accepted goal {goal}: {}\n{}", task.words(), task.alone()))?;
    Ok(Exit::Done)
}

/// Sends the goal. Whether the robot has taken it may stay unknown: then it is told to forget it.
pub(super) async fn start(control: &Control, task: &Task, goal: Uuid) -> Result<()> {
    match control.request(goal, task.body()).await {
        Ok(_) => Ok(()),
        Err(failure) if failure.kind == Kind::OutcomeUnknown => {
            let cancelled = cancel::ask(control, &task.robot, goal).await;
            Err(cancel::unconfirmed(&task.robot, goal, &failure, &cancelled))
        }
        Err(failure) => Err(failure),
    }
}

fn stop_hint(robot: &Name) -> String {
    format!("`fleet-cli stop {robot}` stops it, `fleet-cli why {robot}` shows what it does")
}

async fn drive(
    ctx: &Context,
    client: &Client,
    control: &Control,
    task: &Task,
    mut stop: std::pin::Pin<&mut impl Future<Output = ()>>,
) -> Result<Exit> {
    let keys = client.keys().robot(&task.robot);
    // Both before the goal: nothing of it can be missed.
    let feed = Feed::asked(client, &task.robot, STATE_EVERY);
    let mut events = Events::open(client, &keys).await?;
    let goal = Uuid::new_v4();
    let mut follow = Follow::new(goal, control.lease().map(|lease| lease.epoch));
    tokio::select! {
        started = start(control, task, goal) => started?,
        // It may have arrived nevertheless.
        () = &mut stop => return cancel::interrupted(ctx, control, &feed, task, goal).await,
    }
    // Not before: while the request was on its way, states showed what was before it.
    let mut wait = Wait::new(Instant::now());
    let began = wait.began;
    let mut progress = Progress::new();
    progress.show(&format!("{}: goal {goal}: {}", task.robot, task.words()));
    let mut look = tokio::time::interval(LOOK_EVERY);
    loop {
        tokio::select! {
            () = &mut stop => {
                progress.end();
                return cancel::interrupted(ctx, control, &feed, task, goal).await;
            }
            event = events.next() => follow.event(&event),
            _ = look.tick() => {
                let seen = feed.last(&task.robot).filter(|seen| seen.at >= began);
                if let Some(seen) = &seen {
                    follow.state(began.elapsed(), &seen.state);
                }
                wait.look(control, seen.as_ref());
                let fresh = seen.as_ref().and_then(Seen::fresh);
                progress.show(&line(task, fresh, wait.heard.elapsed(), control.is_lost()));
            }
        }
        if let Some(end) = follow.ended(began.elapsed()) {
            progress.end();
            if end.status != GoalStatus::Reached {
                loss_shows(client, control, &feed, task).await;
            }
            return match lost(ctx, control, &feed, task) {
                Some(failure) if end.status != GoalStatus::Reached => Err(with_end(failure, task, &end)),
                _ => report(ctx, (control, &feed), task, &follow, end, began.elapsed()),
            };
        }
        if wait.is_over() {
            progress.end();
            return Err(wait.verdict(lost(ctx, control, &feed, task), task, goal));
        }
        if task.within.is_some_and(|within| began.elapsed() > within) {
            match cancel::ask(control, &task.robot, goal).await {
                Ok(Cancel::Ended) => progress.end(),
                // It has ended by itself just now: the next state says how.
                Ok(Cancel::NotRunning) => continue,
                Err(failure) => {
                    progress.end();
                    return Err(failure);
                }
            }
            let end = End { status: GoalStatus::Cancelled, reason: Some("its time was up".into()) };
            return report(ctx, (control, &feed), task, &follow, end, began.elapsed());
        }
    }
}

/// How long it makes sense to go on waiting.
struct Wait {
    began: Instant,
    /// When the robot was last heard.
    heard: Instant,
    /// Since when somebody else holds the lease.
    taken: Option<Instant>,
}

impl Wait {
    fn new(began: Instant) -> Self {
        Self { began, heard: began, taken: None }
    }

    fn look(&mut self, control: &Control, seen: Option<&Seen>) {
        let Some(seen) = seen else { return };
        self.heard = seen.at;
        let held = seen.state.lease.as_ref().is_some_and(|lease| lease.holder != *control.client_name());
        if control.is_lost() && held {
            self.taken.get_or_insert_with(Instant::now);
        }
    }

    fn is_over(&self) -> bool {
        self.heard.elapsed() > GIVE_UP_AFTER || self.taken.is_some_and(|at| at.elapsed() > LOSS_SETTLES)
    }

    fn verdict(&self, lost: Option<Failure>, task: &Task, goal: Uuid) -> Failure {
        match lost.filter(|_| self.taken.is_some()) {
            Some(failure) => {
                let message = format!("{}; goal {} had not ended by then", failure.message, task.words());
                Failure { message, ..failure }
            }
            None => {
                let age = describe::age(self.heard.elapsed());
                let message =
                    format!("{} was not heard for {age}: outcome of goal {goal} unknown", task.robot);
                Failure::new(Kind::OutcomeUnknown, message).hint(unheard_hint(task))
            }
        }
    }
}

/// Waits until it shows whether control was lost with the goal: a retain is due each 100 ms, the goal's
/// end is told at once.
async fn loss_shows(client: &Client, control: &Control, feed: &Feed, task: &Task) {
    let (began, within) = (Instant::now(), LOSS_SHOWS + client.round_trip().bound());
    let ours = || {
        // One from before may show the holder from before.
        let seen = feed.last(&task.robot).filter(|seen| seen.at > began);
        let lease = seen.as_ref().and_then(|seen| seen.state.lease.as_ref());
        lease.is_some_and(|lease| lease.holder == *control.client_name())
    };
    let mut look = tokio::time::interval(LOOK_EVERY / 5);
    while !control.is_lost() && !ours() && began.elapsed() < within {
        look.tick().await;
    }
}

/// Who has control instead, if this client has lost it.
fn lost(ctx: &Context, control: &Control, feed: &Feed, task: &Task) -> Option<Failure> {
    let failure = control.lost()?;
    let seen = feed.last(&task.robot);
    let lease = seen.as_ref().and_then(|seen| seen.fresh()?.lease.as_ref());
    // Nobody took it: it ran out while the robot did not hear this client.
    let Some(lease) = lease.filter(|lease| lease.holder != ctx.client) else {
        return Some(Failure { hint: gap_hint(task), ..failure });
    };
    let message = format!("{} is now controlled by {}", task.robot, lease.holder);
    Some(Failure { kind: Kind::Refused(RejectCode::LeaseLost), message, ..failure })
}

fn with_end(failure: Failure, task: &Task, end: &End) -> Failure {
    let reason = end.reason.as_ref().map(|reason| format!(" ({reason})")).unwrap_or_default();
    let status = words::name(&end.status);
    Failure { message: format!("{}; goal {} {status}{reason}", failure.message, task.words()), ..failure }
}

fn line(task: &Task, state: Option<&RobotState>, age: Duration, lease_lost: bool) -> String {
    let Some(state) = state else {
        return format!("{}: STALE, last heard {} ago", task.robot, describe::age(age));
    };
    let goal = state.goal.as_ref().map(describe::goal).unwrap_or_default();
    let mut text =
        format!("{}: {goal} · {} · {}", task.robot, describe::speed(state), words::name(&state.mode));
    if !state.stopped_because.is_empty() {
        text.push_str(&format!(" · stands: {}", words::reasons(&state.stopped_because)));
    }
    if lease_lost {
        text.push_str(&format!(" · lease lost, now {}", describe::lease(state)));
    }
    text
}

fn report(
    ctx: &Context,
    (control, feed): (&Control, &Feed),
    task: &Task,
    follow: &Follow,
    end: End,
    took: Duration,
) -> Result<Exit> {
    let robot = &task.robot;
    let report = Report {
        robot,
        goal: follow.goal(),
        status: end.status,
        reason: end.reason.clone(),
        distance_m: follow.distance_m(),
        elapsed_s: (took.as_secs_f64() * 100.0).round() / 100.0,
        taken_from: control.taken_from(),
    };
    let reached = end.status == GoalStatus::Reached;
    let seconds = format!("{:.1} s", took.as_secs_f64());
    if ctx.out.json {
        ctx.out.line(&report)?;
    } else if reached {
        let verb = match task.aim {
            Aim::Point { .. } => "reached",
            Aim::Wander { .. } => "completed its",
        };
        ctx.out.text(&format!("{robot} {verb} {} after {seconds}", task.words()))?;
    } else {
        let reason = end.reason.map(|reason| format!(" ({reason})")).unwrap_or_default();
        let status = words::name(&end.status);
        let message = format!("{robot}: goal {} {status}{reason} after {seconds}", task.words());
        let hint =
            if fell_silent(feed, robot, follow.goal()) { gap_hint(task) } else { hint(robot, end.status) };
        ctx.out.failure(&Failure::new(Kind::Failed, message).hint(hint));
    }
    Ok(if reached { Exit::Done } else { Exit::Failed })
}

/// Whether the robot stands because it did not hear this client any more.
fn fell_silent(feed: &Feed, robot: &Name, goal: Uuid) -> bool {
    feed.last(robot).is_some_and(|Seen { state, .. }| {
        state.goal.as_ref().is_some_and(|present| present.id == goal)
            && state.stopped_because.contains(&StopReason::LeaseExpired)
    })
}

/// What to do about a gap in the network that ended a goal.
fn gap_hint(task: &Task) -> String {
    let robot = &task.robot;
    match task.on_link_loss() {
        LinkLoss::Halt => format!(
            "a gap in the network of more than 0.5 s ends a goal that is waited for; with \
             `--on-link-loss finish` {robot} drives on through it"
        ),
        LinkLoss::Finish => {
            format!(
                "a gap in the network ended control, not the goal: `fleet-cli why {robot}` shows how it stands"
            )
        }
    }
}

/// What to do about a robot that is out of reach while its goal runs.
fn unheard_hint(task: &Task) -> String {
    let back = format!("`fleet-cli why {}` shows when it is back", task.robot);
    match task.on_link_loss() {
        LinkLoss::Finish => format!("{}; {back}", task.alone()),
        LinkLoss::Halt => format!(
            "if its link is lost, {}; with `--on-link-loss finish` it drives on; {back}",
            task.alone()
        ),
    }
}

fn hint(robot: &Name, status: GoalStatus) -> String {
    match status {
        GoalStatus::Interrupted => "the robot restarted; send the goal again".to_owned(),
        GoalStatus::Replaced => format!("`fleet-cli why {robot}` shows who sent it elsewhere"),
        GoalStatus::Cancelled => "somebody stopped it, or it took too long; send the goal again".to_owned(),
        _ => format!("`fleet-cli why {robot}` shows why it stands, and what to do"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{FakeRobot, name};
    use xtb_protocol::messages::Body;

    fn task() -> Task {
        let aim = Aim::Point { x_m: 1.0, y_m: 2.0, yaw_rad: None, via: None };
        Task { robot: name("xtb-1"), aim, within: None, wait: true, on_link_loss: None, take: false }
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_loses_control_while_waiting_is_told_to_whom() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let (task, ctx) = (task(), client.context().clone());
        let control = Control::acquire(&client, &task.robot, false).await.unwrap();
        let stop = pin!(std::future::pending());
        let waiting = drive(&ctx, &client, &control, &task, stop);
        let taking = async {
            fake.until(|fake| fake.state.goal.is_some()).await;
            fake.lock().grant(&name("cli-123456"));
        };
        let (ended, ()) = tokio::join!(waiting, taking);
        let failure = ended.unwrap_err();
        assert_eq!(failure.kind.exit(), Exit::Failed);
        assert!(failure.message.contains("xtb-1 is now controlled by cli-123456"), "{failure}");
        assert!(failure.hint.contains("--take"), "{}", failure.hint);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn an_interrupted_wait_cancels_its_goal_and_sees_the_robot_stand() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let (task, ctx) = (task(), client.context().clone());
        let control = Control::acquire(&client, &task.robot, false).await.unwrap();
        let stop = pin!(fake.until(|fake| fake.state.goal.is_some()));
        assert_eq!(drive(&ctx, &client, &control, &task, stop).await, Ok(Exit::Interrupted));
        let goal = fake.lock().state.goal.clone().unwrap();
        assert_eq!(goal.status, GoalStatus::Cancelled);
        assert!(fake.lock().asked.contains(&(name("me"), Body::Cancel { goal: goal.id })));
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_loses_control_by_a_gap_is_pointed_to_the_policy_and_not_to_taking_control() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let (task, ctx) = (task(), client.context().clone());
        let control = Control::acquire(&client, &task.robot, false).await.unwrap();
        let stop = pin!(std::future::pending());
        let waiting = drive(&ctx, &client, &control, &task, stop);
        let gap = async {
            fake.until(|fake| fake.state.goal.is_some()).await;
            let mut fake = fake.lock();
            (fake.lease, fake.state.lease) = (None, None);
            let goal = fake.state.goal.as_mut().unwrap();
            (goal.status, goal.reason) = (GoalStatus::Failed, Some("its client me fell silent".into()));
            fake.state.stopped_because = vec![StopReason::LeaseExpired];
        };
        let (ended, ()) = tokio::join!(waiting, gap);
        let failure = ended.unwrap_err();
        assert_eq!(failure.kind.exit(), Exit::Failed);
        assert!(failure.hint.contains("--on-link-loss finish"), "{}", failure.hint);
        assert!(!failure.hint.contains("--take"), "{}", failure.hint);
    }
}
