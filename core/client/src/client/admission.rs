//! Whether the router admits this client's identity. A router drops what it does not allow in silence; so it is asked
//! for the reason beside everything else when the session opens, at each return of the link, and once more when
//! nobody has answered.

use super::{Client, read};
use crate::error::{Error, ErrorKind};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_bus::Bus;
use xtb_identity::{Action, Identity, Role};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::IdentityStatus;

/// The router itself answers; longer on a slow link.
const ANSWERS_WITHIN: Duration = Duration::from_millis(500);

/// Asks beside everything else, until it is dropped.
#[derive(Debug)]
pub(super) struct Asking {
    refused: watch::Receiver<Option<Error>>,
    task: JoinHandle<()>,
}

impl Drop for Asking {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl Asking {
    pub(super) fn begin(bus: Bus, keys: FleetKeys, identity: Identity) -> Self {
        let (sender, refused) = watch::channel(None);
        let task = tokio::spawn(async move {
            let Ok(mut link) = bus.watch_link().await else { return };
            loop {
                if link.up.wait_for(|up| *up).await.is_err() {
                    return;
                }
                sender.send_replace(ask(&bus, &keys, &identity, ANSWERS_WITHIN).await);
                if link.up.wait_for(|up| !*up).await.is_err() {
                    return;
                }
            }
        });
        Self { refused, task }
    }
}

impl Client {
    /// Why the router does not admit this client's identity; `None` = it does, does not say, or has none to ask for.
    pub async fn not_admitted(&self) -> Option<Error> {
        let identity = &self.settings().identity.as_ref()?.identity;
        let known = self.shared.asking.as_ref().and_then(|asking| asking.refused.borrow().clone());
        match known {
            Some(error) => Some(error),
            None => ask(self.bus(), self.keys(), identity, self.round_trip().patience(ANSWERS_WITHIN)).await,
        }
    }

    /// Waits until the router says that it does not admit this client's identity: for those who only listen.
    pub async fn refused(&self) -> Error {
        if let Some(asking) = &self.shared.asking
            && let Ok(refused) = asking.refused.clone().wait_for(Option::is_some).await
            && let Some(error) = refused.clone()
        {
            return error;
        }
        std::future::pending().await
    }

    /// The reason why nobody has answered, if it is the router that does not admit this client; else `error`.
    pub async fn explained(&self, error: Error) -> Error {
        match error.kind {
            ErrorKind::NoRobot | ErrorKind::NoDispatcher | ErrorKind::NoMap | ErrorKind::OutcomeUnknown => {
                self.not_admitted().await.unwrap_or(error)
            }
            _ => error,
        }
    }

    /// Whether this client's role allows it. Asks nobody.
    ///
    /// # Errors
    /// [`ErrorKind::NotAllowed`], with who can.
    pub fn may(&self, action: Action) -> crate::Result<()> {
        self.settings().may(action)
    }
}

async fn ask(bus: &Bus, keys: &FleetKeys, identity: &Identity, within: Duration) -> Option<Error> {
    let answers = bus.get(&keys.identity(Some(&identity.name)), within).await;
    let answers = answers.inspect_err(|error| tracing::debug!("{error}")).ok()?;
    let status = answers.iter().find_map(read::<IdentityStatus>)?;
    verdict(identity, &status)
}

/// Why a router with this entry does not admit this identity.
fn verdict(own: &Identity, status: &IdentityStatus) -> Option<Error> {
    let (name, generation) = (&own.name, own.generation);
    let new_file = format!("enrol with the newest file that `fleet-cli pki` made for {name}");
    let (message, hint) = match status {
        IdentityStatus { name: other, .. } if other != name => return None,
        IdentityStatus { role: None, .. } => (
            format!("the router does not know {name}"),
            "add it where the CA is with `fleet-cli pki`; `fleet-cli pki list` shows who is known".to_owned(),
        ),
        IdentityStatus { revoked: true, .. } => (
            format!("{name} was revoked"),
            format!(
                "`fleet-cli pki renew {name} --readmit` where the CA is admits it again, with a new file"
            ),
        ),
        IdentityStatus { generation: admitted, .. } if *admitted > generation => {
            (format!("the router admits certificate {admitted} of {name}, this is {generation}"), new_file)
        }
        IdentityStatus { generation: admitted, .. } if *admitted < generation => (
            format!("the router admits certificate {admitted} of {name}, this is {generation}"),
            "the router has not read its registry since: `fleet-cli pki renew … --apply`, or restart it"
                .to_owned(),
        ),
        IdentityStatus { role: Some(role), .. } if role.parse() != Ok(own.role) => {
            let role = role.parse::<Role>().map_or_else(|_| role.clone(), |role| role.noun().to_owned());
            (
                format!("{name} is {role} to the router, and {} by its identity here", own.role.noun()),
                new_file,
            )
        }
        IdentityStatus { waiting: true, .. } => (
            format!("the router admits {name} when no robot is driven"),
            "--apply of `fleet-cli pki`, where the CA is, admits it at once".to_owned(),
        ),
        _ => return None,
    };
    Some(Error::new(ErrorKind::NotAdmitted, message).hint(hint))
}

#[cfg(test)]
mod tests;
