//! The identity that a command uses, and what it excludes.

use super::Uses;
use crate::args::{GlobalArgs, IdentityArg};
use std::time::SystemTime;
use xtb_bus::{EnrolError, Enrolled};
use xtb_client::{Error, ErrorKind, Result, unique_name};
use xtb_identity::{Identity, IdentityError, Role};
use xtb_protocol::Name;
use xtb_services::dispatch;

/// Begins the endpoints that an identity can be used with.
const TLS: &str = "tls/";
const WITHOUT: &str = "`--identity none` goes without the identity";

/// The identity that is meant, if any.
///
/// # Errors
/// [`ErrorKind::Config`]: it cannot be read, or its certificate is not valid now.
pub(super) fn find(global: &GlobalArgs, uses: Uses) -> Result<Option<Enrolled>> {
    let to_tls = global.connect_given && global.connect.iter().any(|endpoint| endpoint.starts_with(TLS));
    let asked = global.identity_given || to_tls;
    if uses == Uses::Nothing || (uses == Uses::IfAsked && !asked) {
        return Ok(None);
    }
    let folder = match &global.identity {
        Some(IdentityArg::None) => None,
        Some(IdentityArg::Folder(folder)) => Some(folder.clone()),
        None => Enrolled::default_folder(),
    };
    let Some(folder) = folder else { return Ok(None) };
    let enrolled = Enrolled::load(&folder).map_err(unreadable)?;
    if uses != Uses::Unchecked {
        check_time(&enrolled.identity, SystemTime::now())?;
    }
    Ok(Some(enrolled))
}

fn unreadable(error: EnrolError) -> Error {
    let hint = match &error {
        EnrolError::File { reason, .. } if reason.kind() == std::io::ErrorKind::NotFound => {
            "`fleet-cli enrol NAME.xtbid` makes an identity's folder; `--identity none` goes without"
        }
        _ => "enrol its .xtbid file again; `--identity none` goes without",
    };
    let text = match &error {
        EnrolError::File { .. } => format!("cannot read the identity: {error}"),
        EnrolError::Identity { .. } => error.to_string(),
    };
    Error::new(ErrorKind::Config, text).hint(hint)
}

/// Whether its certificate is valid at this moment.
///
/// # Errors
/// [`ErrorKind::Config`].
pub(super) fn check_time(identity: &Identity, now: SystemTime) -> Result<()> {
    identity.check_at(now).map_err(|error| {
        let hint = match &error {
            IdentityError::Expired { name, .. } => {
                format!(
                    "`fleet-cli pki renew {name}` makes the next one; then `fleet-cli enrol {name}.xtbid`"
                )
            }
            IdentityError::NotYet { .. } => format!(
                "this computer's clock says {}: set it if it is wrong",
                humantime::format_rfc3339_seconds(now)
            ),
            _ => "enrol its .xtbid file again".into(),
        };
        Error::new(ErrorKind::Config, error.to_string()).hint(hint)
    })
}

/// An identity protects nothing on an endpoint without TLS, and nothing is reached over TLS without one.
pub(super) fn check_endpoints(connect: &[String], identity: Option<&Identity>) -> Result<()> {
    match identity {
        Some(identity) => match connect.iter().find(|endpoint| !endpoint.starts_with(TLS)) {
            Some(endpoint) => {
                let message =
                    format!("{endpoint} has no TLS: the identity of {} is not used there", identity.name);
                let instead = identity.routers.first().map_or("tls/HOST:7447", String::as_str);
                Err(Error::new(ErrorKind::Invalid, message)
                    .hint(format!("connect to {instead} (the default without --connect); {WITHOUT}")))
            }
            None => Ok(()),
        },
        None => match connect.iter().find(|endpoint| endpoint.starts_with(TLS)) {
            Some(endpoint) => Err(Error::new(
                ErrorKind::Invalid,
                format!("{endpoint} needs an identity, and there is none"),
            )
            .hint(
                "`fleet-cli enrol NAME.xtbid` makes one from the file that `fleet-cli pki add-person` \
                         wrote; --identity DIR names its folder",
            )),
            None => Ok(()),
        },
    }
}

/// Its fleet, if no other is asked for.
pub(super) fn check_fleet(identity: &Identity, named: Option<&Name>) -> Result<Name> {
    match named.filter(|named| **named != identity.fleet) {
        Some(named) => {
            let Identity { name, fleet, .. } = identity;
            let message =
                format!("fleet {named} is asked for, but the identity of {name} is of fleet {fleet}");
            Err(Error::new(ErrorKind::Invalid, message).hint(format!(
                "leave --fleet (XTB_FLEET, the fleet config) out, or name its identity; {WITHOUT}"
            )))
        }
        None => Ok(identity.fleet.clone()),
    }
}

/// A name for a session: one of its own, but a dispatcher drives robots under the name that it always has.
///
/// # Errors
/// It is too long.
pub(crate) fn session_name(identity: Option<&Identity>) -> Result<Name> {
    let name = match identity {
        Some(Identity { role: Role::Dispatcher, .. }) => Name::new(dispatch::CLIENT),
        identity => unique_name(stem(identity)),
    };
    name.map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))
}

/// What the names of its sessions begin with.
fn stem(identity: Option<&Identity>) -> &str {
    match identity {
        None => "cli",
        Some(Identity { role: Role::Dashboard, .. }) => "web",
        Some(Identity { role: Role::Dispatcher, .. }) => dispatch::CLIENT,
        Some(identity) => identity.name.as_str(),
    }
}

/// The router admits names that follow from the identity only.
pub(super) fn check_client(identity: &Identity, client: Name) -> Result<Name> {
    let stem = stem(Some(identity));
    let rest = client.as_str().strip_prefix(stem);
    if rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('-')) {
        return Ok(client);
    }
    let message = format!("--client {client} is not a name of {}", identity.name);
    Err(Error::new(ErrorKind::Invalid, message).hint(format!("it is {stem}, or begins with {stem}-")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alice() -> Identity {
        let own = "alice.1".parse().unwrap();
        let routers = vec!["tls/10.0.0.1:7447".to_owned()];
        let (ca, certificate, key) = Default::default();
        Identity::new(Name::new("lab").unwrap(), own, Role::Operator, routers, ca, certificate, key)
    }

    fn refusal(result: Result<impl Sized>) -> (ErrorKind, String, String) {
        let Err(Error { kind, message, hint }) = result.map(drop) else { panic!("it is allowed") };
        (kind, message, hint)
    }

    #[test]
    fn an_identity_goes_with_tls_only_and_tls_with_an_identity_only() {
        let (tcp, tls) = (["tcp/10.0.0.1:7447".to_owned()], ["tls/10.0.0.1:7447".to_owned()]);
        check_endpoints(&tcp, None).unwrap();
        check_endpoints(&tls, Some(&alice())).unwrap();
        let (kind, message, hint) = refusal(check_endpoints(&tcp, Some(&alice())));
        assert_eq!(kind, ErrorKind::Invalid);
        assert_eq!(message, "tcp/10.0.0.1:7447 has no TLS: the identity of alice is not used there");
        assert!(hint.contains("tls/10.0.0.1:7447") && hint.contains("--identity none"), "{hint}");
        let (_, message, _) = refusal(check_endpoints(&tls, None));
        assert_eq!(message, "tls/10.0.0.1:7447 needs an identity, and there is none");
    }

    #[test]
    fn fleet_and_client_follow_from_an_identity() {
        let name = |text| Name::new(text).unwrap();
        assert_eq!(check_fleet(&alice(), None).unwrap().as_str(), "lab");
        assert_eq!(check_fleet(&alice(), Some(&name("lab"))).unwrap().as_str(), "lab");
        let (_, message, _) = refusal(check_fleet(&alice(), Some(&name("hall"))));
        assert_eq!(message, "fleet hall is asked for, but the identity of alice is of fleet lab");
        for good in ["alice", "alice-desk"] {
            check_client(&alice(), name(good)).unwrap();
        }
        let (_, message, hint) = refusal(check_client(&alice(), name("alicex")));
        assert_eq!(
            (message.as_str(), hint.as_str()),
            ("--client alicex is not a name of alice", "it is alice, or begins with alice-")
        );
    }
}
