//! `reset`: ends latched stops whose cause is gone. It never moves the robot.
//!
//! The robot answers yes or no; which latches it has ended shows in its state before and after.

use super::take_control;
use crate::cli::{LeaseArgs, ResetArgs};
use crate::client::Client;
use crate::context::Context;
use crate::describe;
use crate::error::{Exit, Failure, Kind, Result};
use crate::feed::Feed;
use crate::lease::Control;
use crate::output::{Output, Tone};
use serde::Serialize;
use std::time::{Duration, Instant};
use xtb_protocol::messages::{Body, Latch, LatchState, RejectCode, RobotState};
use xtb_protocol::{Name, Uuid};

/// A state that shows what the reset did comes within a few of these.
const STATE_EVERY: Duration = Duration::from_millis(50);

/// What came of it, as `--json` prints it.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Report<'a> {
    robot: &'a Name,
    /// Latches that are ended; `None` = the robot's state was not heard.
    cleared: Option<Vec<Latch>>,
    /// Latches that are still set; `None` = the robot's state was not heard.
    remaining: Option<Vec<LatchState>>,
    /// What the robot said if it would not.
    refused: Option<String>,
    taken_from: Option<&'a str>,
}

/// Resets one latch, or all.
///
/// # Errors
/// No router, no answer, or a refusal other than a cause that is still there: that is reported.
pub async fn run(ctx: &Context, args: &ResetArgs) -> Result<Exit> {
    let client = Client::open(ctx).await?;
    let control = take_control(ctx, &client, &args.robot, args.lease.take).await?;
    let outcome = reset(&client, &control, args).await;
    let taken_from = control.taken_from().map(str::to_owned);
    control.release().await;
    let report = Report { taken_from: taken_from.as_deref(), ..outcome? };
    ctx.out.result(&report, |report| text(report, args.latch, &ctx.out))?;
    if let Some(refused) = report.refused.as_ref().filter(|_| !ctx.out.json) {
        let hint = format!("`fleet-cli why {}` shows causes, and what to do about them", args.robot);
        ctx.out.failure(&Failure::new(Kind::Refused(RejectCode::CausePresent), refused).hint(hint));
    }
    client.close().await;
    Ok(if report.refused.is_none() { Exit::Done } else { Exit::Failed })
}

/// Resets all of a robot's latches with the control that is held; what came of it in words, and whether
/// it was refused.
pub(super) async fn in_words(client: &Client, control: &Control, robot: &Name) -> Result<(String, bool)> {
    let lease = LeaseArgs { take: false };
    let args = ResetArgs { robot: robot.clone(), latch: None, lease };
    let report = reset(client, control, &args).await?;
    let words = text(&report, None, &Output { json: false, colors: false });
    Ok((words, report.refused.is_some()))
}

pub(super) async fn reset<'a>(client: &Client, control: &Control, args: &'a ResetArgs) -> Result<Report<'a>> {
    let robot = &args.robot;
    let (feed, within) = (Feed::asked(client, robot, STATE_EVERY), client.patience());
    let before = next(&feed, robot, Instant::now(), within, |_| true).await;
    let answer = control.request(Uuid::new_v4(), Body::Reset { latch: args.latch }).await;
    let refused = match answer {
        Ok(_) => None,
        Err(Failure { kind: Kind::Refused(RejectCode::CausePresent), message, .. }) => Some(message),
        Err(failure) => return Err(failure),
    };
    let seq = before.as_ref().map(|state| state.seq);
    let after = settled(&feed, robot, within, seq, refused.is_some(), args.latch).await;
    let (cleared, remaining) = match (before, after) {
        (Some(before), Some(after)) => {
            let (cleared, remaining) = compare(&before, after);
            (Some(cleared), Some(remaining))
        }
        _ => (None, None),
    };
    Ok(Report { robot, cleared, remaining, refused, taken_from: None })
}

/// The first state that came in after `since` and is `so`.
async fn next(
    feed: &Feed,
    robot: &Name,
    since: Instant,
    within: Duration,
    so: impl Fn(&RobotState) -> bool,
) -> Option<RobotState> {
    let coming = async {
        loop {
            if let Some(seen) = feed.last(robot).filter(|seen| seen.at >= since && so(&seen.state)) {
                return seen.state;
            }
            feed.news().await;
        }
    };
    tokio::time::timeout(within, coming).await.ok()
}

/// The state once it shows what the reset did. After a yes that is one without the latches that were
/// asked for; after a no, one that the robot made after its answer.
async fn settled(
    feed: &Feed,
    robot: &Name,
    within: Duration,
    before: Option<u64>,
    refused: bool,
    latch: Option<Latch>,
) -> Option<RobotState> {
    let answered = Instant::now();
    let asked = |set: &LatchState| latch.is_none_or(|latch| latch == set.latch);
    let later = |state: &RobotState| before.is_none_or(|seq| state.seq > seq + 1);
    let so = |state: &RobotState| later(state) && (refused || !state.latches.iter().any(asked));
    let since = if refused { answered + STATE_EVERY } else { answered };
    match next(feed, robot, since, within, so).await {
        // One was set anew meanwhile: what is set now counts.
        None => feed.last(robot).filter(|seen| seen.at > answered).map(|seen| seen.state),
        found => found,
    }
}

fn compare(before: &RobotState, after: RobotState) -> (Vec<Latch>, Vec<LatchState>) {
    let is_set = |latch: Latch| after.latches.iter().any(|set| set.latch == latch);
    let cleared = before.latches.iter().map(|set| set.latch).filter(|latch| !is_set(*latch));
    (cleared.collect(), after.latches)
}

fn text(report: &Report<'_>, asked: Option<Latch>, out: &Output) -> String {
    let robot = report.robot;
    let (Some(cleared), Some(remaining)) = (&report.cleared, &report.remaining) else {
        let done = if report.refused.is_none() { "the reset is done" } else { "the reset was refused" };
        return format!(
            "{robot}: {done}; its state was not heard: `fleet-cli status {robot}` shows what is latched"
        );
    };
    let mut lines: Vec<String> = Vec::new();
    lines.extend(cleared.iter().map(|latch| format!("{robot}: {latch} {}", out.paint(Tone::Good, "reset"))));
    if cleared.is_empty() && report.refused.is_none() {
        let what = asked.map_or_else(|| "nothing".to_owned(), |latch| format!("{latch} is not"));
        lines.push(format!("{robot}: {what} latched"));
    }
    for latch in remaining {
        lines.push(format!("{robot}: {}: {}", out.paint(Tone::Bad, "still latched"), describe::latch(latch)));
    }
    lines.push(if remaining.is_empty() {
        "nothing moves until a new command, or a task of the dispatcher's".to_owned()
    } else {
        "nothing moves until all latches are reset, and a new command is given".to_owned()
    });
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{self, FakeRobot, name};

    fn args(latch: Option<Latch>) -> ResetArgs {
        ResetArgs { robot: name("xtb-1"), latch, lease: LeaseArgs { take: false } }
    }

    async fn with_latches(latches: Vec<LatchState>, latch: Option<Latch>) -> (Report<'static>, String) {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        robot.lock().state.latches = latches;
        let args = Box::leak(Box::new(args(latch)));
        let control = Control::acquire(&client, &args.robot, false).await.unwrap();
        let report = reset(&client, &control, args).await.unwrap();
        let text = text(&report, latch, &Output { json: false, colors: false });
        (report, text)
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn what_is_cleared_and_what_remains_is_said_with_its_reason() {
        let estop = fake::latch(Latch::Estop, "cli-1", false);
        let gyro = fake::latch(Latch::GyroLost, "gyro_silent", true);
        let (report, text) = with_latches(vec![estop, gyro.clone()], None).await;
        assert_eq!(report.cleared, Some(vec![Latch::Estop]));
        assert_eq!(report.remaining, Some(vec![gyro]));
        assert!(report.refused.unwrap().contains("gyro_lost: gyro_silent is still so"));
        assert!(text.contains("xtb-1: estop reset\n"), "{text}");
        assert!(text.contains("still latched: gyro_lost by gyro_silent"), "{text}");
        assert!(text.contains("nothing moves until all latches are reset"), "{text}");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn one_latch_is_reset_by_name_and_the_others_stay() {
        let estop = fake::latch(Latch::Estop, "cli-1", false);
        let takeover = fake::latch(Latch::RemoteTakeover, "transmitter", false);
        let (report, text) = with_latches(vec![estop, takeover.clone()], Some(Latch::Estop)).await;
        assert_eq!((report.cleared, report.refused), (Some(vec![Latch::Estop]), None));
        assert_eq!(report.remaining, Some(vec![takeover]));
        assert!(text.contains("still latched: remote_takeover"), "{text}");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_reset_of_nothing_is_no_error() {
        let (report, text) = with_latches(Vec::new(), None).await;
        assert_eq!((report.cleared, report.refused), (Some(Vec::new()), None));
        assert_eq!(
            text,
            "xtb-1: nothing latched\nnothing moves until a new command, or a task of the dispatcher's"
        );
    }
}
