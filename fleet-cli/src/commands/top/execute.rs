//! Carrying out what the cockpit asks of robots, with the code of the verbs.

use crate::commands::reset;
use crate::context::Context;
use crate::output::Tone;
use crate::tui::top::{Command, Outcome};
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_client::dispatcher_client::{DispatcherClient, worst};
use xtb_client::estop::estop;
use xtb_client::goal::{Cancelled, GoalRequest, GoalTarget, cancel, start};
use xtb_client::multi_robot::{MissingInfo, StopOutcome, StopReport, Targets};
use xtb_client::reset::{ResetReport, each};
use xtb_client::stop::stop;
use xtb_client::text::reasons;
use xtb_client::{Action, Error, ErrorKind, Result};
use xtb_protocol::messages::{AckBody, AckRequest, Body, DispatchBody, LinkLoss, RejectCode, Suspension};
use xtb_protocol::{Name, Uuid};

/// Asks, and says what came of it. It ends by itself, at the latest a few `--timeout`s later; an emergency
/// stop waits for a lost link to come back. `known` are the robots that the screen has seen.
pub(super) async fn execute(ctx: &Context, client: &Client, known: &[Name], command: &Command) -> Outcome {
    match attempt(ctx, client, known, command).await {
        Ok((tone, text)) => Outcome { tone, text, held: false },
        Err(failure) => Outcome { tone: Tone::Bad, text: failure.to_string(), held: is_held(&failure) },
    }
}

/// A stop was called before it was answered.
pub(super) fn overtaken() -> Outcome {
    let text = "interrupted by a stop: not or only partly executed".to_owned();
    Outcome { tone: Tone::Warning, text, held: false }
}

/// Whether a robot refused because somebody else has control.
pub(super) fn is_held(failure: &Error) -> bool {
    failure.kind == ErrorKind::Refused(RejectCode::LeaseHeld)
}

async fn attempt(
    ctx: &Context,
    client: &Client,
    known: &[Name],
    command: &Command,
) -> Result<(Tone, String)> {
    match command {
        Command::Estop(whom) => {
            client.may(Action::EmergencyStop)?;
            let targets = Targets::one_or_all(whom.robot(), known);
            Ok(stopped(estop(client, &targets, ctx.settings.timeout).await, "latched"))
        }
        Command::Stop(whom) => {
            client.may(Action::Drive)?;
            Ok(stopped(stop(client, &Targets::one_or_all(whom.robot(), known)).await, "stopped"))
        }
        Command::Goto { robot, x_m, y_m, yaw_rad, take } => {
            let target = GoalTarget::Point { x_m: *x_m, y_m: *y_m, yaw_rad: *yaw_rad, via: None };
            let request = GoalRequest { target, within: None, on_link_loss: LinkLoss::Finish };
            let control = Control::acquire(client, robot, *take).await?;
            let started = start(&control, Uuid::new_v4(), &request).await;
            let text = format!("accepted{}", from(&control));
            control.release().await;
            Ok(started.map(|()| (Tone::Good, text))?)
        }
        Command::SetPose { robot, x_m, y_m, yaw_rad, take } => {
            let control = Control::acquire(client, robot, *take).await?;
            let body = Body::SetPose { x_m: *x_m, y_m: *y_m, yaw_rad: *yaw_rad };
            let set = control.request(Uuid::new_v4(), body).await;
            let text = format!("set{}", from(&control));
            control.release().await;
            Ok(set.map(|_| (Tone::Good, text))?)
        }
        Command::Reset { robot, take } => {
            let control = Control::acquire(client, robot, *take).await?;
            let done = reset::in_words(client, &control, robot).await;
            let from = from(&control);
            control.release().await;
            let (text, refused) = done?;
            let tone = if refused { Tone::Bad } else { Tone::Good };
            Ok((tone, format!("{}{from}", text.replace('\n', "; "))))
        }
        Command::ResetAll { robots } => Ok(reset_all(each(client, robots, None, false).await)),
        Command::Activate => {
            let (_, suspended) = DispatcherClient::of(client).activate().await?;
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
        Command::Acknowledge { ids } => {
            let request = AckRequest { body: AckBody::Alerts { ids: ids.clone() }, person: ctx.person() };
            let reply = DispatcherClient::of(client).acknowledge(&request).await?;
            Ok((Tone::Good, format!("{} acknowledged", reply.acknowledged.len())))
        }
        Command::Cancel { robot, goal, take } => {
            let control = Control::acquire(client, robot, *take).await?;
            let asked = cancel(&control, *goal).await;
            let from = from(&control);
            control.release().await;
            let text = match asked? {
                Cancelled::Ended => "cancelled",
                Cancelled::NotRunning => "no longer running",
            };
            Ok((Tone::Good, format!("{text}{from}")))
        }
        Command::CancelTask { task, .. } => {
            let changes =
                DispatcherClient::of(client).change(DispatchBody::Cancel { tasks: vec![*task] }).await?;
            if let Some(error) = worst(&changes.tasks) {
                return Err(error.clone().into());
            }
            let state = changes.tasks.first().and_then(|change| change.state);
            let text = state.map_or_else(|| "answered".to_owned(), |state| reasons::name(&state));
            Ok((Tone::Good, text))
        }
    }
}

/// Who is not reset is said by name.
fn reset_all(ended: Vec<(Name, xtb_client::Result<ResetReport>)>) -> (Tone, String) {
    let all = ended.len();
    let wrong = ended.into_iter().filter_map(|(robot, ended)| match ended {
        Ok(report) if !report.is_refused(None) => None,
        Ok(_) => Some(format!("{robot}: still latched")),
        Err(failure) => Some(failure.to_string()),
    });
    let wrong: Vec<String> = wrong.collect();
    let text = format!("{} of {all} reset", all - wrong.len());
    match wrong.is_empty() {
        true => (Tone::Good, text),
        false => (Tone::Bad, format!("{text}; {}", wrong.join("; "))),
    }
}

fn from(control: &Control) -> String {
    control.taken_from().map(|holder| format!("; control taken from {holder}")).unwrap_or_default()
}

/// Whose standstill is not known is said by name.
fn stopped((report, missing): (StopReport, MissingInfo), word: &str) -> (Tone, String) {
    let names = |wanted: StopOutcome| {
        let found = report.robots.iter().filter(|(_, outcome)| **outcome == wanted);
        found.map(|(robot, _)| robot.to_string()).collect::<Vec<_>>()
    };
    let (unknown, refused) = (names(StopOutcome::Unknown), names(StopOutcome::Refused));
    let doubtful =
        [StopOutcome::Unconfirmed, StopOutcome::Absent, StopOutcome::Ambiguous].map(names).concat();
    let (done, all) = (names(StopOutcome::Stopped).len(), report.robots.len());
    if all == 0 {
        return (Tone::Bad, "NO ANSWER: robots may be driving".to_owned());
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
    if !missing.none() {
        text.push_str("; without a roster, others may be missing");
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
