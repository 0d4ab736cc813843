//! `reset`: ends latched stops whose cause is gone. It never moves a robot.

use crate::args::{LeaseArgs, WhoArgs};
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use crate::robots;
use crate::values::latch;
use clap::Args;
use std::io::IsTerminal;
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_client::reset::{self, ResetCandidates, ResetReport, candidates, each};
use xtb_client::text::robot as describe;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{Latch, LatchState, RejectCode};

/// Arguments of `reset`.
#[derive(Debug, Clone, Args)]
pub struct ResetArgs {
    /// Which robots; with --all those that have anything latched, after a question.
    #[command(flatten)]
    pub who: WhoArgs,
    /// With --all: do not ask for confirmation.
    #[arg(long, requires = "all")]
    pub yes: bool,
    /// Only this latch [default: all].
    #[arg(long, value_name = "NAME", value_parser = latch())]
    pub latch: Option<Latch>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<ResetReport>];

/// Resets one latch, or all, of the robots named or of all that have any.
///
/// # Errors
/// No router; of one robot alone also: no answer, or a refusal other than a cause that is still there, which
/// is reported.
pub async fn run(ctx: &Context, args: &ResetArgs) -> Result<Exit> {
    if args.who.all && !args.yes && (ctx.out.json || !std::io::stdin().is_terminal()) {
        return Err(Error::new(
            ErrorKind::Invalid,
            "reset --all asks for confirmation, but there is no terminal",
        )
        .hint("--yes resets without asking"));
    }
    let client = Client::open(&ctx.settings).await?;
    let exit = if args.who.all { all(ctx, &client, args).await } else { named(ctx, &client, args).await };
    client.close().await;
    exit
}

async fn named(ctx: &Context, client: &Client, args: &ResetArgs) -> Result<Exit> {
    let robots = robots::meant(client, &args.who.robots).await.all()?;
    let mut ended = each(client, &robots, args.latch, args.lease.take).await;
    if let [(_, Err(_))] = &ended[..]
        && let Some((_, Err(failure))) = ended.pop()
    {
        return Err(failure);
    }
    say(ctx, args.latch, &ended)
}

async fn all(ctx: &Context, client: &Client, args: &ResetArgs) -> Result<Exit> {
    let ResetCandidates { latched, unknown, roster } = candidates(client, &args.who.expect).await?;
    if latched.is_empty() && unknown.is_empty() && !roster {
        return Err(client.nobody());
    }
    let complete = if unknown.is_empty() { Exit::Done } else { Exit::Unknown };
    for robot in &unknown {
        let message = format!("{robot} does not answer: its latches are unknown");
        ctx.out.failure(&Error::new(ErrorKind::NoRobot, message));
    }
    if !roster && !ctx.out.json {
        ctx.out.note("warning: without a roster it is unknown whether these are all robots");
    }
    if latched.is_empty() {
        if !ctx.out.json {
            ctx.out.text("nothing is latched")?;
        }
        return Ok(complete);
    }
    let mut newly = Vec::new();
    let mut robots: Vec<Name> = latched.iter().map(|(robot, _)| robot.clone()).collect();
    if !args.yes {
        if !confirmed(ctx, &latched).await? {
            ctx.out.note("nothing was reset");
            return Ok(Exit::Failed);
        }
        let now = candidates(client, &args.who.expect).await?.latched;
        (robots, newly) = as_shown(&latched, now);
    }
    for robot in &newly {
        let message = format!("{robot} was latched after the question: it is not reset");
        ctx.out.failure(&Error::new(ErrorKind::Failed, message).hint("`fleet-cli why` says why"));
    }
    let ended = each(client, &robots, args.latch, args.lease.take).await;
    match say(ctx, args.latch, &ended)? {
        Exit::Done if newly.is_empty() => Ok(complete),
        Exit::Done => Ok(Exit::Failed),
        exit => Ok(exit),
    }
}

/// Those who have the same latches as were shown, or fewer, and those who have been latched since.
fn as_shown(shown: &[(Name, Vec<LatchState>)], now: Vec<(Name, Vec<LatchState>)>) -> (Vec<Name>, Vec<Name>) {
    let was_shown = |robot: &Name, set: &LatchState| {
        let mut before = shown.iter().filter(|(other, _)| other == robot).flat_map(|(_, latches)| latches);
        before.any(|before| before.latch == set.latch && before.age_ms <= set.age_ms)
    };
    let (same, newly): (Vec<_>, Vec<_>) =
        now.into_iter().partition(|(robot, latches)| latches.iter().all(|set| was_shown(robot, set)));
    let names = |robots: Vec<(Name, Vec<LatchState>)>| robots.into_iter().map(|(robot, _)| robot).collect();
    (names(same), names(newly))
}

/// Asks the person at the terminal.
async fn confirmed(ctx: &Context, latched: &[(Name, Vec<LatchState>)]) -> Result<bool> {
    for (robot, latches) in latched {
        let latches: Vec<String> = latches.iter().map(describe::latch).collect();
        ctx.out.note(&format!("{robot}: {}", latches.join("; ")));
    }
    let robots = if latched.len() == 1 { "this robot" } else { "these robots" };
    ctx.out.note(&format!("Reset {robots}? They move again with a new command or task. y = yes, else no"));
    let answer = tokio::task::spawn_blocking(|| {
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).map(|_| answer)
    });
    let answer = answer.await.map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))??;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}

/// Says what came of each; the worst decides how the command ends.
fn say(
    ctx: &Context,
    latch: Option<Latch>,
    ended: &[(Name, xtb_client::Result<ResetReport>)],
) -> Result<Exit> {
    let mut exit = Exit::Done;
    for (robot, ended) in ended {
        match ended {
            Ok(report) => {
                if let Some(holder) = report.taken_from.as_ref().filter(|_| !ctx.out.json) {
                    ctx.out.note(&format!("took control of {robot} from {holder}"));
                }
                ctx.out.result(report, |report| text(report, latch, &ctx.out))?;
                if report.is_refused(latch) {
                    exit = exit.worse(Exit::Failed);
                }
                if let Some(refused) = &report.refused {
                    let hint = format!("`fleet-cli why {robot}` shows the causes and what to do");
                    let failure =
                        Error::new(ErrorKind::Refused(RejectCode::CausePresent), refused).hint(hint);
                    if !ctx.out.json {
                        ctx.out.failure(&failure);
                    }
                }
            }
            Err(error) => {
                exit = exit.worse(error.kind.into());
                ctx.out.failure_of(robot, error);
            }
        }
    }
    Ok(exit)
}

/// Resets all of a robot's latches with the control that is held; what came of it in words, and whether
/// it was refused.
pub(super) async fn in_words(client: &Client, control: &Control, robot: &Name) -> Result<(String, bool)> {
    let report = reset::reset(client, control, robot, None).await?;
    let words = text(&report, None, &Output { json: false, colors: false });
    Ok((words, report.is_refused(None)))
}

fn text(report: &ResetReport, asked: Option<Latch>, out: &Output) -> String {
    let robot = &report.robot;
    let (Some(cleared), Some(remaining)) = (&report.cleared, &report.remaining) else {
        let done = if report.refused.is_none() { "reset done" } else { "reset refused" };
        return format!(
            "{robot}: {done}; no state received since: `fleet-cli status {robot}` shows its latches"
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
        "no robot moves until a new command or a task of the dispatcher".to_owned()
    } else {
        "no robot moves until all latches are reset and a new command is given".to_owned()
    });
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use xtb_client::fake::{self, FakeRobot, name};

    async fn with_latches(latches: Vec<LatchState>, latch: Option<Latch>) -> (ResetReport, String) {
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
        assert!(report.refused.unwrap().contains("gyro_lost: gyro_silent is still present"));
        assert!(text.contains("xtb-1: estop reset\n"), "{text}");
        assert!(text.contains("still latched: gyro_lost by gyro_silent"), "{text}");
        assert!(text.contains("no robot moves until all latches are reset"), "{text}");
    }

    #[test]
    fn who_was_latched_after_the_question_is_not_reset() {
        let latch = |latch, age_ms| LatchState { age_ms, ..fake::latch(latch, "cli-1", false) };
        let gyro = |age_ms| latch(Latch::GyroLost, age_ms);
        let shown: Vec<_> = ["a", "b", "c", "d"].map(|robot| (name(robot), vec![gyro(500)])).into();
        let now = vec![
            (name("a"), vec![gyro(9_000)]),
            (name("b"), vec![gyro(9_000), latch(Latch::Estop, 2_000)]),
            (name("c"), vec![gyro(100)]),
            (name("e"), vec![gyro(9_000)]),
        ];
        assert_eq!(as_shown(&shown, now), (vec![name("a")], ["b", "c", "e"].map(name).into()));
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
            "xtb-1: nothing latched\nno robot moves until a new command or a task of the dispatcher"
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
        assert_eq!(found.latched[0].1[0].by, "cli-1");
        let both: Vec<Name> = found.latched.into_iter().map(|(robot, _)| robot).collect();
        let ended = each(&client, &both, None, false).await;
        assert!(ended.iter().all(|(_, ended)| ended.as_ref().is_ok_and(|report| !report.is_refused(None))));
        assert!(robots.iter().all(|robot| robot.lock().state.latches.is_empty()));
    }
}
