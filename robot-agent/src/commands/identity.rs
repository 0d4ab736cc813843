//! The robot's identity, and what it excludes.

use super::Failure;
use crate::cli::Given;
use robot_agent::config::{ConfigFile, ConfigProblem};
use std::path::PathBuf;
use std::time::SystemTime;
use xtb_bus::{EnrolError, Enrolled};
use xtb_identity::IdentityError;

/// The identity that the settings name, or that this computer has; the settings are its own then.
pub(crate) fn of(file: &mut ConfigFile, given: Given<'_>) -> Result<Option<Enrolled>, Failure> {
    let folder = match file.zenoh.identity.as_str() {
        "none" => None,
        "" => Enrolled::default_folder(),
        folder => Some(PathBuf::from(folder)),
    };
    let Some(folder) = folder else { return without(file) };
    let enrolled = Enrolled::load(&folder).map_err(|error| {
        let hint = "`robot-agent enrol NAME.xtbid` makes its folder; --identity none goes without";
        let text = match &error {
            EnrolError::File { .. } => format!("cannot read the identity: {error}"),
            EnrolError::Identity { .. } => error.to_string(),
        };
        Failure::new(text, hint).code(2)
    })?;
    let identity = &enrolled.identity;
    // What a flag says is meant, also where it is the default.
    for (flag, given, own) in
        [("--name", given.name, identity.name.as_str()), ("--fleet", given.fleet, identity.fleet.as_str())]
    {
        if let Some(given) = given.filter(|given| *given != own) {
            let message =
                format!("{flag} {given} is not that of the identity in {}: {own}", folder.display());
            let hint = format!("leave {flag} out; --identity none goes without the identity");
            return Err(Failure::new(message, hint).code(2));
        }
    }
    let before = file.zenoh.connect.clone();
    file.identify(identity)?;
    if !given.connect.is_empty() && file.zenoh.connect != before {
        let message =
            format!("{} has no TLS: the identity of {} is not used there", before.join(", "), identity.name);
        let hint = format!(
            "connect to {} (the default without --connect); --identity none goes without the identity",
            identity.routers.join(", ")
        );
        return Err(Failure::new(message, hint).code(2));
    }
    Ok(Some(enrolled))
}

/// Without one, no router with TLS admits it.
fn without(file: &ConfigFile) -> Result<Option<Enrolled>, Failure> {
    match file.zenoh.connect.iter().find(|endpoint| endpoint.starts_with("tls/")) {
        Some(endpoint) => Err(ConfigProblem::Identity {
            message: format!("{endpoint} needs an identity, and there is none"),
            hint:
                "`robot-agent enrol NAME.xtbid` makes one from the file that `fleet-cli pki add-robot` wrote"
                    .into(),
        }
        .into()),
        None => Ok(None),
    }
}

/// Whether its certificate is valid. One that is not valid yet is no failure: the clock of a robot that has just been
/// switched on may be wrong until it hears a time server, and the router is tried until it stands.
pub(crate) fn check(enrolled: &Enrolled, now: SystemTime) -> Result<(), Failure> {
    match enrolled.identity.check_at(now) {
        Ok(()) => Ok(()),
        Err(error @ IdentityError::NotYet { .. }) => {
            let clock = humantime::format_rfc3339_seconds(now);
            tracing::warn!(
                "{error}; this computer's clock says {clock}: no router admits it until that is right"
            );
            Ok(())
        }
        Err(error) => {
            let name = &enrolled.identity.name;
            let hint = format!(
                "`fleet-cli pki renew {name}` makes the next one; then on the robot `robot-agent enrol {name}.xtbid`"
            );
            Err(Failure::new(error, hint).code(2))
        }
    }
}
