//! Ctrl-C, `kill` and a closed window: all three are a wish to end, to be carried out cleanly.

use crate::exit::Exit;
use tokio::signal::unix::{SignalKind, signal};
use xtb_client::{Error, ErrorKind, Result};

/// Resolves once any of the three has come. Keep one future for as long as a command runs: what
/// arrives between two of them is missed.
pub async fn interrupted() {
    tokio::select! {
        () = hear(SignalKind::interrupt()) => {}
        () = hear(SignalKind::terminate()) => {}
        () = hear(SignalKind::hangup()) => {}
    }
}

async fn hear(kind: SignalKind) {
    match signal(kind) {
        Ok(mut stream) => drop(stream.recv().await),
        Err(error) => {
            tracing::warn!("cannot receive a signal: {error}");
            std::future::pending().await
        }
    }
}

/// A command that may simply be dropped when it is interrupted.
///
/// # Errors
/// The command's.
pub async fn or_interrupted(command: impl Future<Output = Result<Exit>>) -> Result<Exit> {
    tokio::select! {
        ended = command => ended,
        () = interrupted() => Ok(Exit::Interrupted),
    }
}

/// A command that has effects: who interrupts it is told what is not known then, and what shows it.
///
/// # Errors
/// The command's, or [`ErrorKind::Interrupted`].
pub async fn or_interrupted_saying(
    command: impl Future<Output = Result<Exit>>,
    unknown: &str,
    hint: &str,
) -> Result<Exit> {
    tokio::select! {
        ended = command => ended,
        () = interrupted() => {
            Err(Error::new(ErrorKind::Interrupted, format!("interrupted: {unknown}")).hint(hint))
        }
    }
}
