//! What `goto` and `wander` share: start a goal, and with `--wait` follow it to its end.

mod follow;

use crate::client::Client;
use crate::context::Context;
use crate::describe;
use crate::error::{Exit, Failure, Kind, Result};
use crate::feed::{Events, Feed};
use crate::interrupt::interrupted;
use crate::lease::Control;
use crate::output::Progress;
use crate::words;
use follow::{End, Follow};
use serde::Serialize;
use std::pin::pin;
use std::time::{Duration, Instant};
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, RejectCode, RobotState};
use xtb_protocol::{Name, Uuid};

/// A goal that outlives this client may take this long (the robot's own default too).
const FINISH_WITHIN: Duration = Duration::from_secs(300);
/// How often progress is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Slower than one encoder pulse a window.
const STANDING_MPS: f64 = 0.02;
/// A robot that was not heard for this long may be anywhere: waiting ends, outcome unknown.
const GIVE_UP_AFTER: Duration = Duration::from_secs(5);

/// What a goal is for.
pub(super) enum Aim {
    /// Drive to a point of the map.
    Point {
        /// East.
        x_m: f64,
        /// North.
        y_m: f64,
    },
    /// Wander.
    Wander {
        /// `None` = until it is stopped.
        lasting: Option<Duration>,
    },
}

/// What to drive, and how to speak of it.
pub(super) struct Task {
    /// Which robot.
    pub(super) robot: Name,
    /// What for.
    pub(super) aim: Aim,
    /// How long it may take.
    pub(super) within: Option<Duration>,
    /// Follow it to its end.
    pub(super) wait: bool,
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    robot: &'a Name,
    goal: Uuid,
    status: GoalStatus,
    reason: Option<String>,
    distance_m: Option<f64>,
    elapsed_s: f64,
}

/// What came of a `cancel`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cancel {
    /// The goal ran and was ended.
    Ended,
    /// It did not run: it had ended by itself, or never began.
    NotRunning,
}

impl Task {
    /// A goal that has a limit, or that outlives this client, is bounded by the robot's own clock too.
    fn on_link_loss(&self) -> LinkLoss {
        if self.wait && self.within.is_none() { LinkLoss::Halt } else { LinkLoss::Finish }
    }

    fn body(&self) -> Body {
        let on_link_loss = self.on_link_loss();
        let finish_s = self.within.unwrap_or(FINISH_WITHIN).as_secs_f64();
        match self.aim {
            Aim::Point { x_m, y_m } => Body::Goto { x_m, y_m, yaw_rad: None, on_link_loss, finish_s },
            Aim::Wander { lasting } => {
                let for_s = lasting.map(|lasting| lasting.as_secs_f64());
                // The shorter of the two ends it.
                Body::Wander { for_s, on_link_loss, finish_s: for_s.map_or(finish_s, |s| s.max(finish_s)) }
            }
        }
    }

    fn words(&self) -> String {
        match self.aim {
            Aim::Point { x_m, y_m } => {
                format!("({}, {})", describe::fixed(x_m, 2), describe::fixed(y_m, 2))
            }
            Aim::Wander { .. } => "wander".to_owned(),
        }
    }
}

/// Sends the goal and, if asked to, stays with it.
pub(super) async fn run(ctx: &Context, task: &Task) -> Result<Exit> {
    let client = Client::open(ctx).await?;
    let control = Control::acquire(&client, &task.robot).await?;
    let exit =
        if task.wait { drive(ctx, &client, &control, task).await } else { send(ctx, &control, task).await };
    control.release().await;
    client.close().await;
    exit
}

/// The goal outlives this client, so it is bounded in time.
async fn send(ctx: &Context, control: &Control, task: &Task) -> Result<Exit> {
    let goal = Uuid::new_v4();
    start(control, task, goal).await?;
    let report = Report {
        robot: &task.robot,
        goal,
        status: GoalStatus::Accepted,
        reason: None,
        distance_m: None,
        elapsed_s: 0.0,
    };
    ctx.out.result(&report, |_| format!("{} accepted goal {goal}: {}", task.robot, task.words()))?;
    Ok(Exit::Done)
}

/// Sends the goal. Whether the robot has taken it may stay unknown: then it is told to forget it.
async fn start(control: &Control, task: &Task, goal: Uuid) -> Result<()> {
    match control.request(goal, task.body()).await {
        Ok(_) => Ok(()),
        Err(failure) if failure.kind == Kind::OutcomeUnknown => {
            let cancelled = ask_to_cancel(control, &task.robot, goal).await;
            Err(unconfirmed(&task.robot, goal, &failure, &cancelled))
        }
        Err(failure) => Err(failure),
    }
}

/// Nobody knows whether the goal was taken, only what came of the attempt to take it back.
fn unconfirmed(robot: &Name, goal: Uuid, failure: &Failure, cancelled: &Result<Cancel>) -> Failure {
    let end = match cancelled {
        Ok(Cancel::Ended) => format!("goal {goal} had begun and was cancelled"),
        Ok(Cancel::NotRunning) => format!("goal {goal} does not run"),
        Err(_) => format!("goal {goal} could not be cancelled either: {robot} may drive"),
    };
    Failure::new(Kind::OutcomeUnknown, format!("{failure}; {end}")).hint(stop_hint(robot))
}

fn stop_hint(robot: &Name) -> String {
    format!("`fleet-cli stop {robot}` stops it, `fleet-cli status {robot}` shows what it does")
}

async fn ask_to_cancel(control: &Control, robot: &Name, goal: Uuid) -> Result<Cancel> {
    let asked = control.request(Uuid::new_v4(), Body::Cancel { goal }).await;
    cancelled(robot, goal, asked.map(drop))
}

/// Reads the answer to a `cancel`: only "no such goal runs" is as good as yes.
fn cancelled(robot: &Name, goal: Uuid, asked: Result<()>) -> Result<Cancel> {
    match asked {
        Ok(()) => Ok(Cancel::Ended),
        Err(Failure { kind: Kind::Refused(RejectCode::UnknownGoal), .. }) => Ok(Cancel::NotRunning),
        Err(failure) => {
            let message = format!("goal {goal} was not cancelled, {robot} may still drive: {failure}");
            Err(Failure::new(failure.kind, message).hint(stop_hint(robot)))
        }
    }
}

async fn drive(ctx: &Context, client: &Client, control: &Control, task: &Task) -> Result<Exit> {
    let keys = client.keys().robot(&task.robot);
    // Both before the goal: nothing of it can be missed.
    let feed = Feed::open(client, &keys).await?;
    let mut events = Events::open(client, &keys).await?;
    let goal = Uuid::new_v4();
    let mut stop = pin!(interrupted());
    let mut follow = Follow::new(goal, control.lease().map(|lease| lease.epoch));
    tokio::select! {
        started = start(control, task, goal) => started?,
        // It may have arrived nevertheless.
        () = &mut stop => return cancel(ctx, control, &feed, task, goal).await,
    }
    // Not before: while the request was on its way, states showed what was before it.
    let began = Instant::now();
    let mut progress = Progress::new();
    progress.show(&format!("{}: goal {goal}: {}", task.robot, task.words()));
    let mut look = tokio::time::interval(LOOK_EVERY);
    let mut heard = began;
    loop {
        tokio::select! {
            () = &mut stop => {
                progress.end();
                return cancel(ctx, control, &feed, task, goal).await;
            }
            event = events.next() => follow.event(&event),
            _ = look.tick() => {
                let seen = feed.last(&task.robot).filter(|seen| seen.at >= began);
                if let Some(seen) = &seen {
                    heard = seen.at;
                    follow.state(began.elapsed(), &seen.state);
                }
                let fresh = seen.as_ref().and_then(|seen| seen.fresh());
                progress.show(&line(task, fresh, heard.elapsed(), control.is_lost()));
            }
        }
        if let Some(end) = follow.ended(began.elapsed()) {
            progress.end();
            return report(ctx, task, &follow, end, began.elapsed());
        }
        if heard.elapsed() > GIVE_UP_AFTER {
            progress.end();
            let age = describe::age(heard.elapsed());
            let message = format!("{} was not heard for {age}: outcome of goal {goal} unknown", task.robot);
            return Err(Failure::new(Kind::OutcomeUnknown, message).hint(unheard_hint(task)));
        }
        if task.within.is_some_and(|within| began.elapsed() > within) {
            match ask_to_cancel(control, &task.robot, goal).await {
                Ok(Cancel::Ended) => progress.end(),
                // It has ended by itself just now: the next state says how.
                Ok(Cancel::NotRunning) => continue,
                Err(failure) => {
                    progress.end();
                    return Err(failure);
                }
            }
            let end = End { status: GoalStatus::Cancelled, reason: Some("its time was up".into()) };
            return report(ctx, task, &follow, end, began.elapsed());
        }
    }
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

fn report(ctx: &Context, task: &Task, follow: &Follow, end: End, took: Duration) -> Result<Exit> {
    let robot = &task.robot;
    let report = Report {
        robot,
        goal: follow.goal(),
        status: end.status,
        reason: end.reason.clone(),
        distance_m: follow.distance_m(),
        elapsed_s: (took.as_secs_f64() * 100.0).round() / 100.0,
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
        ctx.out.failure(&Failure::new(Kind::Failed, message).hint(hint(end.status)));
    }
    Ok(if reached { Exit::Done } else { Exit::Failed })
}

/// What to do about a robot that is out of reach while its goal runs.
fn unheard_hint(task: &Task) -> String {
    let back = format!("`fleet-cli status {}` shows when it is back", task.robot);
    match task.within {
        Some(within) => {
            let seconds = within.as_secs_f64();
            format!("the robot ends the goal by itself {seconds} s after it began; {back}")
        }
        None => {
            format!("this release does not stop a goal whose client is gone: stop the robot by hand; {back}")
        }
    }
}

fn hint(status: GoalStatus) -> &'static str {
    match status {
        GoalStatus::Interrupted => "the robot restarted; send the goal again",
        GoalStatus::Replaced => {
            "another client sent it elsewhere; `fleet-cli status` shows who holds the lease"
        }
        GoalStatus::Cancelled => "somebody stopped it, or it took too long; send the goal again",
        _ => "`fleet-cli status` shows why it stands",
    }
}

/// Ctrl-C: the goal ends, and the robot is watched until it stands.
async fn cancel(ctx: &Context, control: &Control, feed: &Feed, task: &Task, goal: Uuid) -> Result<Exit> {
    let asked = Instant::now();
    let how = match ask_to_cancel(control, &task.robot, goal).await? {
        Cancel::Ended => "goal cancelled",
        Cancel::NotRunning => "the goal does not run",
    };
    let standing = async {
        while !feed.last(&task.robot).is_some_and(|seen| seen.at > asked && stands(&seen.state)) {
            feed.news().await;
        }
    };
    let robot = &task.robot;
    let failure = match tokio::time::timeout(ctx.timeout, standing).await {
        Ok(()) => Failure::new(Kind::Interrupted, format!("{how}, {robot} stands")),
        Err(_) => Failure::new(Kind::Interrupted, format!("{how}, but {robot} was not seen standing"))
            .hint(stop_hint(robot)),
    };
    ctx.out.failure(&failure);
    Ok(Exit::Interrupted)
}

fn stands(state: &RobotState) -> bool {
    state.reference_rpm == 0.0 && state.speed_mps.is_some_and(|speed| speed.abs() < STANDING_MPS)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOAL: Uuid = Uuid::from_u128(1);

    fn robot() -> Name {
        Name::new("xtb-1").unwrap()
    }

    fn task(wait: bool, within_s: Option<u64>) -> Task {
        let aim = Aim::Point { x_m: 1.0, y_m: 2.0 };
        Task { robot: robot(), aim, within: within_s.map(Duration::from_secs), wait }
    }

    #[test]
    fn a_goal_is_bounded_by_the_robot_unless_its_client_waits_without_a_limit() {
        for (wait, within, policy, seconds) in [
            (false, None, LinkLoss::Finish, 300.0),
            (false, Some(7), LinkLoss::Finish, 7.0),
            (true, Some(7), LinkLoss::Finish, 7.0),
            (true, None, LinkLoss::Halt, 300.0),
        ] {
            let Body::Goto { on_link_loss, finish_s, .. } = task(wait, within).body() else { panic!() };
            assert_eq!((on_link_loss, finish_s), (policy, seconds), "wait {wait}, within {within:?}");
        }
    }

    #[test]
    fn only_an_unknown_goal_counts_as_ended_by_itself() {
        let answer = |kind| cancelled(&robot(), GOAL, Err(Failure::new(kind, "no")));
        assert_eq!(cancelled(&robot(), GOAL, Ok(())), Ok(Cancel::Ended));
        assert_eq!(answer(Kind::Refused(RejectCode::UnknownGoal)), Ok(Cancel::NotRunning));
        for kind in [Kind::Refused(RejectCode::LeaseHeld), Kind::OutcomeUnknown, Kind::Failed] {
            let failure = answer(kind).unwrap_err();
            assert_eq!(failure.kind, kind);
            assert!(failure.message.contains("may still drive"), "{failure}");
            assert!(failure.hint.contains("fleet-cli stop xtb-1"), "{}", failure.hint);
        }
    }

    #[test]
    fn an_unconfirmed_goal_stays_unknown_whatever_came_of_its_cancel() {
        let unknown = Failure::new(Kind::OutcomeUnknown, "xtb-1 does not answer");
        for (cancelled, said) in [
            (Ok(Cancel::Ended), "was cancelled"),
            (Ok(Cancel::NotRunning), "does not run"),
            (Err(unknown.clone()), "may drive"),
        ] {
            let failure = unconfirmed(&robot(), GOAL, &unknown, &cancelled);
            assert_eq!(failure.kind, Kind::OutcomeUnknown);
            assert!(failure.message.contains(said), "{failure}");
            assert!(failure.hint.contains("fleet-cli stop xtb-1"), "{}", failure.hint);
        }
    }
}
