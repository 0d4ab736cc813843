//! `reset`: ends latched stops whose cause is gone. It never moves a robot.
//!
//! The robot answers yes or no; which latches it has ended shows in its state before and after.

use super::once_each;
use crate::cli::ResetArgs;
use crate::client::Client;
use crate::context::Context;
use crate::describe;
use crate::error::{Exit, Failure, Kind, Result};
use crate::feed::Feed;
use crate::lease::Control;
use crate::output::{Output, Tone};
use crate::view::FleetView;
use futures_util::future::join_all;
use serde::Serialize;
use std::io::IsTerminal;
use std::time::{Duration, Instant};
use xtb_protocol::messages::{Body, Latch, LatchState, RejectCode, RobotState};
use xtb_protocol::{Name, Uuid};

/// A state that shows what the reset did comes within a few of these.
pub(super) const STATE_EVERY: Duration = Duration::from_millis(50);

/// What came of it, as `--json` prints it.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Report {
    robot: Name,
    /// Latches that are ended; `None` = the robot's state was not heard.
    cleared: Option<Vec<Latch>>,
    /// Latches that are still set; `None` = the robot's state was not heard.
    remaining: Option<Vec<LatchState>>,
    /// What the robot said if it would not.
    refused: Option<String>,
    taken_from: Option<String>,
}

impl Report {
    /// Whether it would not reset what was asked for, or said yes and has not.
    pub(super) fn is_refused(&self, latch: Option<Latch>) -> bool {
        let asked = |set: &LatchState| latch.is_none_or(|latch| latch == set.latch);
        self.refused.is_some() || self.remaining.iter().flatten().any(asked)
    }
}

/// Robots that may have something to reset, of all that there should be.
pub(super) struct Candidates {
    /// With their latches in words.
    pub(super) latched: Vec<(Name, String)>,
    /// They should be there and are not, or their states are unknown.
    pub(super) unknown: Vec<Name>,
    /// Whether anybody knows which robots there should be.
    pub(super) roster: bool,
}

/// Resets one latch, or all, of the robots named or of all that have any.
///
/// # Errors
/// No router; of one robot alone also: no answer, or a refusal other than a cause that is still there, which
/// is reported.
pub async fn run(ctx: &Context, args: &ResetArgs) -> Result<Exit> {
    if args.who.all && !args.yes && (ctx.out.json || !std::io::stdin().is_terminal()) {
        return Err(Failure::new(Kind::Usage, "reset --all asks first, and nobody can answer here")
            .hint("--yes resets without asking"));
    }
    let client = Client::open(ctx).await?;
    let exit = if args.who.all { all(ctx, &client, args).await } else { named(ctx, &client, args).await };
    client.close().await;
    exit
}

async fn named(ctx: &Context, client: &Client, args: &ResetArgs) -> Result<Exit> {
    let robots = once_each(&args.who.robots);
    let mut ended = each(client, &robots, args.latch, args.lease.take).await;
    if let [(_, Err(_))] = &ended[..]
        && let Some((_, Err(failure))) = ended.pop()
    {
        return Err(failure);
    }
    say(ctx, args.latch, &ended)
}

async fn all(ctx: &Context, client: &Client, args: &ResetArgs) -> Result<Exit> {
    let Candidates { latched, unknown, roster } = candidates(client, &args.who.expect).await?;
    if latched.is_empty() && unknown.is_empty() && !roster {
        return Err(client.nobody());
    }
    let complete = if unknown.is_empty() { Exit::Done } else { Exit::Unknown };
    for robot in &unknown {
        let message = format!("{robot} does not answer: whether anything is latched is unknown");
        ctx.out.failure(&Failure::new(Kind::NoRobot, message));
    }
    if !roster && !ctx.out.json {
        ctx.out.note("warning: without a roster nobody can say whether these were all robots");
    }
    if latched.is_empty() {
        if !ctx.out.json {
            ctx.out.text("nothing is latched")?;
        }
        return Ok(complete);
    }
    if !args.yes && !confirmed(ctx, &latched).await? {
        ctx.out.note("nothing was reset");
        return Ok(Exit::Failed);
    }
    let robots: Vec<Name> = latched.into_iter().map(|(robot, _)| robot).collect();
    let ended = each(client, &robots, args.latch, args.lease.take).await;
    match say(ctx, args.latch, &ended)? {
        Exit::Done => Ok(complete),
        exit => Ok(exit),
    }
}

/// Asks the person at the terminal.
async fn confirmed(ctx: &Context, latched: &[(Name, String)]) -> Result<bool> {
    for (robot, latches) in latched {
        ctx.out.note(&format!("{robot}: {latches}"));
    }
    let robots = if latched.len() == 1 { "this robot" } else { "these robots" };
    ctx.out.note(&format!("Reset {robots}? They move with a new command, or a task. y = yes, else no"));
    let answer = tokio::task::spawn_blocking(|| {
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).map(|_| answer)
    });
    let answer = answer.await.map_err(|error| Failure::new(Kind::Failed, error.to_string()))??;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}

/// Who has anything latched, of the roster and of whoever else is there.
///
/// # Errors
/// [`Kind::Failed`] if a question could not be sent.
pub(super) async fn candidates(client: &Client, expect: &[Name]) -> Result<Candidates> {
    let roster = client.roster(expect).await?;
    let wanted = roster.clone().unwrap_or_default();
    let view = FleetView::ask(client, client.fleet(), &wanted).await?;
    let mut found = Candidates { latched: Vec::new(), unknown: Vec::new(), roster: roster.is_some() };
    for row in view.robots {
        match row.state {
            Some(state) if row.alive && state.latches.is_empty() => {}
            Some(state) if row.alive => {
                let latches: Vec<String> = state.latches.iter().map(describe::latch).collect();
                found.latched.push((row.name, latches.join("; ")));
            }
            _ => found.unknown.push(row.name),
        }
    }
    Ok(found)
}

/// Resets several robots, each as if it were the only one.
pub(super) async fn each(
    client: &Client,
    robots: &[Name],
    latch: Option<Latch>,
    take: bool,
) -> Vec<(Name, Result<Report>)> {
    let each = robots.iter().map(|robot| async move {
        let reset = async {
            let control = Control::acquire(client, robot, take).await?;
            let outcome = reset(client, &control, robot, latch).await;
            let taken_from = control.taken_from().map(str::to_owned);
            control.release().await;
            Ok(Report { taken_from, ..outcome? })
        };
        (robot.clone(), reset.await)
    });
    join_all(each).await
}

/// Says what came of each; the worst decides how the command ends.
fn say(ctx: &Context, latch: Option<Latch>, ended: &[(Name, Result<Report>)]) -> Result<Exit> {
    let mut exit = Exit::Done;
    for (robot, ended) in ended {
        match ended {
            Ok(report) => {
                if let Some(holder) = report.taken_from.as_ref().filter(|_| !ctx.out.json) {
                    ctx.out.note(&format!("took control of {robot} from {holder}"));
                }
                ctx.out.result(report, |report| text(report, latch, &ctx.out))?;
                if report.is_refused(latch) {
                    exit = worse(exit, Exit::Failed);
                }
                if let Some(refused) = &report.refused {
                    let hint = format!("`fleet-cli why {robot}` shows causes, and what to do about them");
                    let failure = Failure::new(Kind::Refused(RejectCode::CausePresent), refused).hint(hint);
                    if !ctx.out.json {
                        ctx.out.failure(&failure);
                    }
                }
            }
            Err(failure) => {
                exit = worse(exit, failure.kind.exit());
                let is_named = failure.message.contains(robot.as_str());
                let whose = if is_named { String::new() } else { format!("{robot}: ") };
                let message = format!("{whose}{}", failure.message);
                ctx.out.failure(&Failure { message, ..failure.clone() });
            }
        }
    }
    Ok(exit)
}

/// What is not known is worse than what has failed.
fn worse(one: Exit, other: Exit) -> Exit {
    if other.code() > one.code() { other } else { one }
}

/// Resets all of a robot's latches with the control that is held; what came of it in words, and whether
/// it was refused.
pub(super) async fn in_words(client: &Client, control: &Control, robot: &Name) -> Result<(String, bool)> {
    let report = reset(client, control, robot, None).await?;
    let words = text(&report, None, &Output { json: false, colors: false });
    Ok((words, report.is_refused(None)))
}

pub(super) async fn reset(
    client: &Client,
    control: &Control,
    robot: &Name,
    latch: Option<Latch>,
) -> Result<Report> {
    let (feed, within) = (Feed::asked(client, robot, STATE_EVERY), client.patience());
    let before = next(&feed, robot, Instant::now(), within, |_| true).await;
    let answer = control.request(Uuid::new_v4(), Body::Reset { latch }).await;
    let refused = match answer {
        Ok(_) => None,
        Err(Failure { kind: Kind::Refused(RejectCode::CausePresent), message, .. }) => Some(message),
        Err(failure) => return Err(failure),
    };
    let seq = before.as_ref().map(|state| state.seq);
    let after = settled(&feed, robot, within, seq, refused.is_some(), latch).await;
    let (cleared, remaining) = match (before, after) {
        (Some(before), Some(after)) => {
            let (cleared, remaining) = compare(&before, after);
            (Some(cleared), Some(remaining))
        }
        _ => (None, None),
    };
    Ok(Report { robot: robot.clone(), cleared, remaining, refused, taken_from: None })
}

/// The first state that came in after `since` and is `so`.
pub(super) async fn next(
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

fn text(report: &Report, asked: Option<Latch>, out: &Output) -> String {
    let robot = &report.robot;
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

    async fn with_latches(latches: Vec<LatchState>, latch: Option<Latch>) -> (Report, String) {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        robot.lock().state.latches = latches;
        let mut ended = each(&client, &[name("xtb-1")], latch, false).await;
        let report = ended.remove(0).1.unwrap();
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

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn all_that_have_a_latch_are_reset_and_the_others_left_alone() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let mut robots = Vec::new();
        for (robot, latched) in [("xtb-1", true), ("xtb-2", false), ("xtb-3", true)] {
            let robot = FakeRobot::start(&client, robot).await;
            let estop = fake::latch(Latch::Estop, "cli-1", false);
            robot.lock().state.latches = latched.then_some(estop).into_iter().collect();
            robots.push(robot);
        }
        let found = candidates(&client, &["xtb-1", "xtb-2", "xtb-3", "xtb-4"].map(name)).await.unwrap();
        let names: Vec<_> = found.latched.iter().map(|(robot, _)| robot.as_str()).collect();
        assert_eq!((names, found.unknown, found.roster), (vec!["xtb-1", "xtb-3"], vec![name("xtb-4")], true));
        assert!(found.latched[0].1.contains("estop by cli-1"), "{}", found.latched[0].1);
        let both: Vec<Name> = found.latched.into_iter().map(|(robot, _)| robot).collect();
        let ended = each(&client, &both, None, false).await;
        assert!(ended.iter().all(|(_, ended)| ended.as_ref().is_ok_and(|report| !report.is_refused(None))));
        assert!(robots.iter().all(|robot| robot.lock().state.latches.is_empty()));
    }

    #[test]
    fn the_worst_of_several_decides_how_the_command_ends() {
        assert_eq!(worse(Exit::Done, Exit::Failed), Exit::Failed);
        assert_eq!(worse(Exit::Unknown, Exit::Failed), Exit::Unknown);
        assert_eq!(worse(Exit::Done, Exit::Done), Exit::Done);
    }
}
