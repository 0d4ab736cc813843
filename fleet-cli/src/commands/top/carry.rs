//! Carrying out what the cockpit asks of robots, with the code of the verbs.

use crate::cli::WhoArgs;
use crate::client::Client;
use crate::commands::goal::{self, Aim, Task, cancel};
use crate::commands::muster::{Gaps, Outcome as Stopped, Report};
use crate::commands::{estop, reset, stop};
use crate::context::Context;
use crate::dispatching::{Dispatching, worst};
use crate::error::{Failure, Kind, Result};
use crate::lease::Control;
use crate::output::Tone;
use crate::tui::top::{Deed, Outcome, Whom};
use crate::words;
use xtb_protocol::messages::{DispatchBody, RejectCode, Suspension};
use xtb_protocol::{Name, Uuid};

/// Asks, and says what came of it. It ends by itself, at the latest a few `--timeout`s later; an emergency
/// stop waits for a lost link to come back. `known` are the robots that the screen has seen.
pub(super) async fn carry(ctx: &Context, client: &Client, known: &[Name], deed: &Deed) -> Outcome {
    match attempt(ctx, client, known, deed).await {
        Ok((tone, text)) => Outcome { tone, text, held: false },
        Err(failure) => Outcome { tone: Tone::Bad, text: failure.to_string(), held: is_held(&failure) },
    }
}

/// A stop was called before it was answered.
pub(super) fn overtaken() -> Outcome {
    let text = "a stop came first: it was not begun, or only in part".to_owned();
    Outcome { tone: Tone::Warning, text, held: false }
}

/// Whether a robot refused because somebody else has control.
pub(super) fn is_held(failure: &Failure) -> bool {
    failure.kind == Kind::Refused(RejectCode::LeaseHeld)
}

async fn attempt(ctx: &Context, client: &Client, known: &[Name], deed: &Deed) -> Result<(Tone, String)> {
    match deed {
        Deed::Estop(whom) => {
            Ok(stopped(estop::call(client, ctx.timeout, &who(whom, known)).await, "latched"))
        }
        Deed::Stop(whom) => Ok(stopped(stop::call(client, &who(whom, known)).await, "stopped")),
        Deed::Goto { robot, x_m, y_m, yaw_rad, take } => {
            let aim = Aim::Point { x_m: *x_m, y_m: *y_m, yaw_rad: *yaw_rad, via: None };
            let task = Task {
                robot: robot.clone(),
                aim,
                within: None,
                wait: false,
                on_link_loss: None,
                take: *take,
            };
            let control = Control::acquire(client, robot, *take).await?;
            let started = goal::start(&control, &task, Uuid::new_v4()).await;
            let text = format!("accepted{}", from(&control));
            control.release().await;
            started.map(|()| (Tone::Good, text))
        }
        Deed::Reset { robot, take } => {
            let control = Control::acquire(client, robot, *take).await?;
            let done = reset::in_words(client, &control, robot).await;
            let from = from(&control);
            control.release().await;
            let (text, refused) = done?;
            let tone = if refused { Tone::Bad } else { Tone::Good };
            Ok((tone, format!("{}{from}", text.replace('\n', "; "))))
        }
        Deed::ResetAll { robots } => Ok(reset_all(reset::each(client, robots, None, false).await)),
        Deed::Activate => {
            let (_, suspended) = Dispatching::of(client).activate().await?;
            let more: Vec<String> = suspended.iter().map(Suspension::text).collect();
            Ok((
                Tone::Good,
                ["the dispatcher is active".to_owned()]
                    .into_iter()
                    .chain(more)
                    .collect::<Vec<_>>()
                    .join("; "),
            ))
        }
        Deed::Cancel { robot, goal, take } => {
            let control = Control::acquire(client, robot, *take).await?;
            let asked = cancel::ask(&control, robot, *goal).await;
            let from = from(&control);
            control.release().await;
            let text = match asked? {
                cancel::Cancel::Ended => "cancelled",
                cancel::Cancel::NotRunning => "it does not run any more",
            };
            Ok((Tone::Good, format!("{text}{from}")))
        }
        Deed::CancelTask { task, .. } => {
            let changes = Dispatching::of(client).change(DispatchBody::Cancel { tasks: vec![*task] }).await?;
            if let Some(error) = worst(&changes.tasks) {
                return Err(error.clone().into());
            }
            let state = changes.tasks.first().and_then(|change| change.state);
            let text = state.map_or_else(|| "answered".to_owned(), |state| words::name(&state));
            Ok((Tone::Good, text))
        }
    }
}

/// Who is not reset is said by name.
fn reset_all(ended: Vec<(Name, Result<reset::Report>)>) -> (Tone, String) {
    let all = ended.len();
    let wrong = ended.into_iter().filter_map(|(robot, ended)| match ended {
        Ok(report) if !report.is_refused(None) => None,
        Ok(_) => Some(format!("{robot}: it is still latched")),
        Err(failure) => Some(failure.to_string()),
    });
    let wrong: Vec<String> = wrong.collect();
    let text = format!("{} of {all} reset", all - wrong.len());
    match wrong.is_empty() {
        true => (Tone::Good, text),
        false => (Tone::Bad, format!("{text}; {}", wrong.join("; "))),
    }
}

fn who(whom: &Whom, known: &[Name]) -> WhoArgs {
    let robots: Vec<Name> = match whom {
        Whom::One(robot) => vec![robot.clone()],
        Whom::All => Vec::new(),
    };
    WhoArgs { all: robots.is_empty(), robots, expect: Vec::new(), known: known.to_vec() }
}

fn from(control: &Control) -> String {
    control.taken_from().map(|holder| format!("; control was taken from {holder}")).unwrap_or_default()
}

/// Whose standstill is not known is said by name.
fn stopped((report, gaps): (Report, Gaps), word: &str) -> (Tone, String) {
    let names = |wanted: Stopped| {
        let found = report.robots.iter().filter(|(_, outcome)| **outcome == wanted);
        found.map(|(robot, _)| robot.to_string()).collect::<Vec<_>>()
    };
    let (unknown, refused) = (names(Stopped::Unknown), names(Stopped::Refused));
    let doubtful = [Stopped::Unconfirmed, Stopped::Absent, Stopped::Ambiguous].map(names).concat();
    let (done, all) = (names(Stopped::Stopped).len(), report.robots.len());
    if all == 0 {
        return (Tone::Bad, "NOBODY ANSWERED: robots may be driving".to_owned());
    }
    let mut text = if all == 1 && done == 1 { word.to_owned() } else { format!("{done} of {all} {word}") };
    if !unknown.is_empty() {
        text.push_str(&format!("; NO ANSWER, may be driving: {}", unknown.join(", ")));
    }
    if !doubtful.is_empty() {
        text.push_str(&format!("; NOT CONFIRMED by its own state: {}", doubtful.join(", ")));
    }
    if !refused.is_empty() {
        text.push_str(&format!("; REFUSED: {}", refused.join(", ")));
    }
    if !gaps.none() {
        text.push_str("; without a roster nobody knows whether these were all");
    }
    let tone = match report.complete {
        true => Tone::Good,
        false if done == all => Tone::Warning,
        false => Tone::Bad,
    };
    (tone, text)
}

#[cfg(test)]
mod tests;
