//! Where changes of alerts go beside the screens: a command of the lab's, and a web hook.
//!
//! Each change is one JSON object: the command gets it on its standard input, never in its arguments, and is started
//! without a shell; the web hook gets it as the body of a POST. Neither holds the dispatcher up: each has a queue of
//! its own, bounded and counted, a time limit, and its failures are logged.

mod command;
#[cfg(test)]
mod tests;
mod webhook;

pub use command::CommandOutlet;
pub use webhook::{Url, WebhookOutlet};

use schemars::JsonSchema;
use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use xtb_client::Result;
use xtb_dispatch::alerts::AlertChange;
use xtb_protocol::Name;
use xtb_protocol::messages::{Alert, AlertState};

/// Changes that wait for an outlet; the next is dropped and counted.
const QUEUE: usize = 64;

/// Which outlets there are.
#[derive(Debug, Clone, Default)]
pub struct OutletSettings {
    /// The program.
    pub command: Option<CommandOutlet>,
    /// The web hook.
    pub webhook: Option<WebhookOutlet>,
}

/// What came of the changes that were handed to an outlet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct OutletCounters {
    /// Taken: the command ended with 0, the web hook answered with 2xx.
    pub sent: u64,
    /// Refused, too slow or not reached.
    pub failed: u64,
    /// Changes that found the queue full.
    pub dropped: u64,
}

#[derive(Debug, Default)]
struct Shared {
    sent: AtomicU64,
    failed: AtomicU64,
    dropped: AtomicU64,
    complained: AtomicBool,
}

impl Shared {
    /// What came of one. Of failures in a row the first is a warning: a flood must not fill the log.
    fn count(&self, outlet: &str, result: &std::result::Result<(), String>) {
        match result {
            Ok(()) => {
                self.sent.fetch_add(1, Ordering::Relaxed);
                self.complained.store(false, Ordering::Relaxed);
            }
            Err(why) => {
                self.failed.fetch_add(1, Ordering::Relaxed);
                if self.complained.swap(true, Ordering::Relaxed) {
                    tracing::debug!("{outlet}: {why}");
                } else {
                    tracing::warn!("{outlet}: {why}");
                }
            }
        }
    }
}

/// What both get.
#[derive(Serialize)]
struct Body<'a> {
    fleet: &'a Name,
    event: &'static str,
    state: AlertState,
    alert: &'a Alert,
}

fn body(fleet: &Name, AlertChange { step, alert }: &AlertChange) -> String {
    let body = Body { fleet, event: step.as_str(), state: alert.state(), alert };
    // Names, numbers and texts: there is nothing that JSON could not hold.
    serde_json::to_string(&body).unwrap_or_default()
}

struct Outlet {
    send: Box<dyn Fn(String) -> bool + Send + Sync>,
    shared: Arc<Shared>,
}

impl Outlet {
    fn tell(&self, body: &str) {
        if !(self.send)(body.to_owned()) {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn counters(&self) -> OutletCounters {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let Shared { sent, failed, dropped, .. } = &*self.shared;
        OutletCounters { sent: count(sent), failed: count(failed), dropped: count(dropped) }
    }
}

/// The outlets of one dispatcher.
pub struct Outlets {
    fleet: Name,
    command: Option<Outlet>,
    webhook: Option<Outlet>,
}

impl Outlets {
    /// Starts them.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(fleet: Name, settings: OutletSettings) -> Result<Self> {
        let command = settings.command.map(command::start).transpose()?;
        Ok(Self { fleet, command, webhook: settings.webhook.map(webhook::start) })
    }

    /// Hands a change to each. Never waits.
    pub fn tell(&self, change: &AlertChange) {
        if self.command.is_none() && self.webhook.is_none() {
            return;
        }
        let body = body(&self.fleet, change);
        for outlet in [&self.command, &self.webhook].into_iter().flatten() {
            outlet.tell(&body);
        }
    }

    /// Of command and web hook; zero of one that there is not.
    #[must_use]
    pub fn counters(&self) -> [OutletCounters; 2] {
        [&self.command, &self.webhook].map(|outlet| outlet.as_ref().map(Outlet::counters).unwrap_or_default())
    }
}
