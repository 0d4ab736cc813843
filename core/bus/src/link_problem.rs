//! Why no link to a router can be opened. Zenoh says so in its log alone, so the causes are looked for once a link
//! has failed: a connection of our own, then a TLS handshake with the identity's files.

mod handshake;

use crate::enrolled::Enrolled;
use crate::session::{Opening, SessionRole};
use handshake::{Handshake, Party};
use std::time::{Duration, SystemTime};
use thiserror::Error;
use tokio::net::{TcpStream, lookup_host};
use tokio::time::timeout;
use xtb_identity::certificate::Certificate;
use xtb_identity::{Identity, IdentityError};
use xtb_protocol::Name;

/// Each of: finding the address, connecting, the handshake.
const STEP_WITHIN: Duration = Duration::from_secs(1);

/// Why no link to a router can be opened.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LinkProblem {
    /// Nothing listens there, or nothing that can be reached.
    #[error("no router at {endpoint}: {reason}")]
    NoRouter {
        /// What was tried.
        endpoint: String,
        /// What this computer says of it.
        reason: String,
    },
    /// Nobody knows the host.
    #[error("the host name {host} cannot be resolved: {reason}")]
    UnknownHost {
        /// Which.
        host: String,
        /// What this computer says of it.
        reason: String,
    },
    /// The own clock is outside the CA's life, or before the router's certificate.
    #[error("this computer's clock is wrong: it says {now}, but {valid}")]
    Clock {
        /// By this computer.
        now: String,
        /// What it contradicts.
        valid: String,
    },
    /// The own certificate is not valid now.
    #[error("{reason}; this computer's clock says {now}")]
    Certificate {
        /// In words.
        reason: IdentityError,
        /// By this computer.
        now: String,
    },
    /// A router with TLS, and no identity here.
    #[error("the router at {host} admits only those with a certificate, and no identity is used here")]
    NoCertificate {
        /// Which.
        host: String,
    },
    /// A router with TLS at a `tcp/` endpoint.
    #[error("the router at {host} uses TLS, and {endpoint} does not")]
    NeedsTls {
        /// Which.
        host: String,
        /// What was tried.
        endpoint: String,
    },
    /// A router without TLS at a `tls/` endpoint.
    #[error("the router at {host} does not use TLS: it lets in everybody")]
    PlainRouter {
        /// Which.
        host: String,
    },
    /// Something else listens there.
    #[error("what listens at {host} is no router with TLS: {reason}")]
    NotTls {
        /// Which.
        host: String,
        /// What it did.
        reason: String,
    },
    /// Not of this fleet.
    #[error("the router at {host} is not trusted: its certificate is not from the CA of fleet {fleet}")]
    NotTrusted {
        /// Which.
        host: String,
        /// Whose CA.
        fleet: Name,
    },
    /// Reached by a name that its certificate does not have.
    #[error("the certificate of the router is for {names}, not for {host}")]
    WrongName {
        /// By which it was reached.
        host: String,
        /// Those of the certificate.
        names: String,
    },
    /// Its certificate is too old.
    #[error("the certificate of the router at {host} expired on {since}; this computer's clock says {now}")]
    RouterExpired {
        /// Which.
        host: String,
        /// When.
        since: String,
        /// By this computer.
        now: String,
    },
    /// The router refuses the own certificate.
    #[error("the router at {host} refuses the certificate of {name}: {reason}")]
    Refused {
        /// Which.
        host: String,
        /// Whose.
        name: Name,
        /// What its answer means.
        reason: CertificateRefusal,
    },
    /// Nothing wrong was found.
    #[error("the router at {host} accepts the TLS connection, but opens no session")]
    NoSession {
        /// Which.
        host: String,
    },
}

/// What a router said of a certificate.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CertificateRefusal {
    /// Of another fleet.
    #[error("it is not from the router's CA")]
    OtherCa,
    /// By the router's clock.
    #[error("by the router's clock it is expired or not yet valid, by this computer's it is valid")]
    Time,
    /// By the router's list.
    #[error("it was revoked")]
    Revoked,
    /// Anything else.
    #[error("{0}")]
    Other(String),
}

impl LinkProblem {
    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> String {
        let fixed = match self {
            Self::NoRouter { .. } => {
                "check that the router runs, and that no firewall is between: `fleet-cli router`"
            }
            Self::UnknownHost { .. } => {
                "check the name in --connect; an address such as tls/10.0.0.1:7447 also works"
            }
            Self::Clock { .. } => "set this computer's clock: `timedatectl` shows it",
            Self::Certificate { reason: IdentityError::Expired { name, .. }, .. } => {
                return renew(name);
            }
            Self::Certificate { .. } => "check this computer's clock: `timedatectl` shows it",
            Self::NoCertificate { .. } | Self::NeedsTls { .. } => {
                "enrol with `fleet-cli enrol NAME.xtbid` (`fleet-cli pki add-person NAME` makes that file); or give \
                 --identity DIR"
            }
            Self::PlainRouter { .. } => {
                "start it with `fleet-cli router --listen tls/…`; or do without the identity: --identity none and a \
                 tcp/ endpoint"
            }
            Self::NotTls { .. } => "check host and port of the router",
            Self::NotTrusted { .. } => {
                "check host and port; if the fleet has a new CA, enrol with a file that was made with it"
            }
            Self::WrongName { .. } => {
                "connect to one of these names; `fleet-cli pki renew --router --router-name HOST` adds further ones"
            }
            Self::RouterExpired { .. } => "renew it where the CA is: `fleet-cli pki renew --router`",
            Self::Refused { reason: CertificateRefusal::Time, .. } => {
                "compare the clocks of both computers: `timedatectl`"
            }
            Self::Refused { name, reason: CertificateRefusal::Revoked, .. } => return renew(name),
            Self::Refused { .. } => {
                "enrol with a file of this fleet's CA: `fleet-cli pki add-person` or `renew` makes one"
            }
            Self::NoSession { .. } => "the router's log says why; too many sessions, or an older release",
        };
        fixed.to_owned()
    }

    /// Whether trying again will not help before somebody does something about it.
    #[must_use]
    pub fn lasts(&self) -> bool {
        !matches!(
            self,
            Self::NoRouter { .. } | Self::UnknownHost { .. } | Self::NoSession { .. } | Self::NotTls { .. }
        )
    }

    /// Whether the router refuses this side, rather than this side the router.
    #[must_use]
    pub fn is_refusal(&self) -> bool {
        matches!(
            self,
            Self::Certificate { .. }
                | Self::NoCertificate { .. }
                | Self::NeedsTls { .. }
                | Self::Refused { .. }
        )
    }
}

fn renew(name: &Name) -> String {
    format!("`fleet-cli pki renew {name}` makes a new certificate; enrol with its file")
}

/// Looks for the reason why none of these endpoints can be linked to. Of several the one that says most.
pub async fn find(endpoints: &[String], identity: Option<&Enrolled>, now: SystemTime) -> Option<LinkProblem> {
    // Renewed meanwhile: Zenoh reads the files at each attempt too.
    let identity = identity.map(|enrolled| {
        let again = Enrolled::load(&enrolled.folder).map(|enrolled| enrolled.identity);
        again.unwrap_or_else(|_| enrolled.identity.clone())
    });
    if let Some(problem) = identity.as_ref().and_then(|identity| own(identity, now)) {
        return Some(problem);
    }
    let looking = endpoints.iter().map(|endpoint| {
        let (endpoint, identity) = (endpoint.clone(), identity.clone());
        tokio::spawn(async move { look(&endpoint, identity.as_ref(), now).await })
    });
    let mut found = Vec::new();
    for looking in looking.collect::<Vec<_>>() {
        found.extend(looking.await.ok().flatten());
    }
    let telling = found.iter().position(LinkProblem::lasts).unwrap_or(0);
    (telling < found.len()).then(|| found.swap_remove(telling))
}

/// What is wrong on this side, whatever the router.
fn own(identity: &Identity, now: SystemTime) -> Option<LinkProblem> {
    let says = moment(now);
    if let Ok(Certificate { not_before, not_after, .. }) = Certificate::parse(&identity.ca)
        && !(not_before..=not_after).contains(&now)
    {
        let (from, to) = (moment(not_before), moment(not_after));
        let valid = format!("the CA of fleet {} is valid from {from} to {to}", identity.fleet);
        return Some(LinkProblem::Clock { now: says, valid });
    }
    identity.check_at(now).err().map(|reason| LinkProblem::Certificate { reason, now: says })
}

/// `None`: an endpoint of another kind.
async fn look(endpoint: &str, identity: Option<&Identity>, now: SystemTime) -> Option<LinkProblem> {
    let (is_tls, address, bare) = parts(endpoint)?;
    let stream = match connect(endpoint, address, bare).await {
        Ok(stream) => stream,
        Err(problem) => return Some(problem),
    };
    let host = address.to_owned();
    let party = identity.map_or(Party::Stranger, Party::Identity);
    let shaken = handshake::with(stream, bare, party, now, STEP_WITHIN).await;
    match (is_tls, identity, shaken) {
        (false, _, Handshake::Stranger | Handshake::Refused(_)) => {
            Some(LinkProblem::NeedsTls { host, endpoint: endpoint.to_owned() })
        }
        (false, ..) => None,
        (true, None, Handshake::Stranger | Handshake::Refused(_)) => {
            Some(LinkProblem::NoCertificate { host })
        }
        (true, _, Handshake::NotTls(reason)) => Some(match speaks_plainly(address).await {
            true => LinkProblem::PlainRouter { host },
            false => LinkProblem::NotTls { host, reason },
        }),
        (true, Some(identity), shaken) => Some(of(shaken, host, bare, identity, now)),
        (true, None, _) => Some(LinkProblem::NoSession { host }),
    }
}

/// Whether it has TLS, its address, and the host alone.
fn parts(endpoint: &str) -> Option<(bool, &str, &str)> {
    let (kind, rest) = endpoint.split_once('/')?;
    let address = rest.split(['?', '#']).next()?;
    let (host, _) = address.rsplit_once(':')?;
    let is_tls = match kind {
        "tls" => true,
        "tcp" => false,
        _ => return None,
    };
    Some((is_tls, address, host.trim_start_matches('[').trim_end_matches(']')))
}

/// What a router with TLS says of itself, and whom it lets in who has no certificate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Admits {
    /// Its certificate.
    pub certificate: Certificate,
    /// A TLS connection without a certificate.
    pub anonymous: bool,
    /// A session without TLS.
    pub plain: bool,
}

/// Tries whom a router lets in; `None` = it has no TLS, or does not let this identity in.
pub async fn admits(endpoint: &str, identity: &Identity, now: SystemTime) -> Option<Admits> {
    let (true, address, host) = parts(endpoint)? else { return None };
    let shake = async |party: Party<'_>| {
        let stream = connect(endpoint, address, host).await.ok()?;
        Some(handshake::with(stream, host, party, now, STEP_WITHIN).await)
    };
    let Handshake::Accepted(certificate) = shake(Party::Identity(identity)).await? else { return None };
    let certificate = Certificate::parse_der(&certificate).ok()?;
    let anonymous = matches!(shake(Party::Anonymous(identity)).await?, Handshake::Accepted(_));
    Some(Admits { certificate, anonymous, plain: speaks_plainly(address).await })
}

fn of(shaken: Handshake, host: String, bare: &str, identity: &Identity, now: SystemTime) -> LinkProblem {
    match shaken {
        Handshake::Stranger => LinkProblem::NotTrusted { host, fleet: identity.fleet.clone() },
        Handshake::OtherNames(names) => {
            LinkProblem::WrongName { host: bare.to_owned(), names: names.join(", ") }
        }
        Handshake::Expired(since) => {
            LinkProblem::RouterExpired { host, since: moment(since), now: moment(now) }
        }
        // It begins an hour before it is made: only a clock that is behind sees it too early.
        Handshake::NotYet(from) => {
            let valid = format!("the certificate of the router at {host} is valid from {}", moment(from));
            LinkProblem::Clock { now: moment(now), valid }
        }
        Handshake::Refused(reason) => LinkProblem::Refused { host, name: identity.name.clone(), reason },
        Handshake::NotTls(reason) => LinkProblem::NotTls { host, reason },
        Handshake::Accepted(_) => LinkProblem::NoSession { host },
    }
}

async fn connect(endpoint: &str, address: &str, host: &str) -> Result<TcpStream, LinkProblem> {
    let unknown = |reason: String| LinkProblem::UnknownHost { host: host.to_owned(), reason };
    let found = match timeout(STEP_WITHIN, lookup_host(address)).await {
        Ok(found) => found.map_err(|error| unknown(error.to_string()))?.collect::<Vec<_>>(),
        Err(_) => return Err(unknown("no answer from the name service".to_owned())),
    };
    let reason = match timeout(STEP_WITHIN, TcpStream::connect(found.as_slice())).await {
        Ok(Ok(stream)) => return Ok(stream),
        Ok(Err(error)) => words(&error),
        Err(_) => "no answer".to_owned(),
    };
    Err(LinkProblem::NoRouter { endpoint: endpoint.to_owned(), reason })
}

/// Whether Zenoh opens a session there without TLS.
async fn speaks_plainly(address: &str) -> bool {
    let opening = Opening::of(SessionRole::Client { connect: vec![format!("tcp/{address}")] });
    match timeout(STEP_WITHIN, opening.once()).await {
        Ok(Ok(bus)) => {
            bus.close().await;
            true
        }
        _ => false,
    }
}

/// What the system says, without its number.
fn words(error: &std::io::Error) -> String {
    let text = error.to_string();
    text.split(" (os error").next().unwrap_or(&text).to_lowercase()
}

/// A moment as people read it.
fn moment(time: SystemTime) -> String {
    humantime::format_rfc3339_seconds(time).to_string()
}
