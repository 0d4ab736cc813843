//! What is said when no session could be opened.

use crate::error::{Error, ErrorKind};
use crate::settings::Settings;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::time::sleep;
use xtb_bus::{LinkProblem, link_problem};

/// Between two looks for a cause while a session is opened.
const LOOK_AGAIN: Duration = Duration::from_millis(500);

/// Looks for the cause while a session is opened.
#[derive(Default)]
pub(super) struct Cause {
    /// The last one that was found; it may go away by itself.
    last: Mutex<Option<LinkProblem>>,
}

impl Cause {
    /// The first one that will not go away by itself.
    pub(super) async fn lasting(&self, settings: &Settings) -> Error {
        loop {
            let found = find(settings).await;
            if let Some(problem) = found.as_ref().filter(|problem| problem.lasts()) {
                return of(problem);
            }
            *self.last.lock().unwrap_or_else(PoisonError::into_inner) = found;
            // A router without TLS takes a handshake for a message that does not come: once is enough.
            if !settings.connect.iter().any(|endpoint| endpoint.starts_with("tls/")) {
                return std::future::pending().await;
            }
            sleep(LOOK_AGAIN).await;
        }
    }

    /// What to say after so long.
    pub(super) fn error(&self, settings: &Settings, tried: Duration) -> Error {
        match &*self.last.lock().unwrap_or_else(PoisonError::into_inner) {
            // Of several endpoints each may have its reason: one line for all.
            None | Some(LinkProblem::NoRouter { .. }) => no_router(settings, tried),
            Some(problem) => of(problem),
        }
    }
}

async fn find(settings: &Settings) -> Option<LinkProblem> {
    link_problem::find(&settings.connect, settings.identity.as_ref(), SystemTime::now()).await
}

fn of(problem: &LinkProblem) -> Error {
    let kind = if problem.is_refusal() { ErrorKind::NotAdmitted } else { ErrorKind::NoRouter };
    let text = problem.to_string();
    let mut letters = text.chars();
    // A sentence by itself.
    let text = letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or(text);
    Error::new(kind, text).hint(problem.hint())
}

fn no_router(settings: &Settings, tried: Duration) -> Error {
    let (endpoints, seconds) = (settings.connect.join(", "), (tried.as_secs_f64() * 10.0).round() / 10.0);
    Error::new(ErrorKind::NoRouter, format!("No router answers at {endpoints} (tried for {seconds} s)")).hint(
        "start `fleet-cli sim` or `fleet-cli router`, \
         or give a router with --connect or XTB_CONNECT",
    )
}
