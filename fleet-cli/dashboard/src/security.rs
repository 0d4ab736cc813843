//! Who may ask the dashboard for what. Pure: a request's headers in, yes or a refusal out.
//!
//! * A page of somebody else's site can make a browser send requests here. It cannot forge `Origin`, so
//!   whatever could have an effect (the socket, anything but GET and HEAD) needs the page's own.
//! * It can name this machine by a name of its own (DNS rebinding) and then is its own origin; so `Host`
//!   must be an address or a name that is known.
//! * Other machines are let in by TLS and the fleet's registry of people, or, where the user insists, by one token for
//!   all: whoever gets in may drive robots.

use super::access::{Access, Visitor};
use super::guesses::same;
use super::listener::Peer;
use super::people::{NotTaken, People};
use axum::http::{HeaderMap, HeaderValue, Method, Uri, header};
use std::net::IpAddr;
use std::str::FromStr;
use std::time::Instant;

/// The cookie that stands for the token.
const COOKIE: &str = "xtb_dashboard";
/// The cookie of a person; browsers take one of such a name over TLS only, and for the whole host.
const PERSONS_COOKIE: &str = "__Host-xtb_dashboard";
/// What leads to signing in: there is nothing about the fleet in it.
const OPEN_PATHS: [&str; 7] = [
    "/healthz",
    "/who",
    super::assets::SIGN_IN,
    "/assets/sign_in.js",
    "/assets/theme.js",
    "/assets/style.css",
    "/assets/icon.svg",
];

/// The page may load and reach nothing but its own files and socket, and stand in no frame.
const CSP: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
     connect-src 'self'; font-src 'self'; manifest-src 'self'; frame-ancestors 'none'; base-uri 'none'; \
     form-action 'none'";

/// On every answer.
pub(super) const HEADERS: [(&str, &str); 7] = [
    ("content-security-policy", CSP),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("permissions-policy", "camera=(), microphone=(), geolocation=(), payment=(), usb=(), serial=()"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("x-frame-options", "DENY"),
];

/// On every answer over TLS: browsers come back over TLS only, for 30 days. The port does not count, so a name is
/// bound for all of its web pages; an address never is.
pub(super) const TLS_ONLY: (&str, &str) = ("strict-transport-security", "max-age=2592000");

/// Where a page comes from: `https://fleet.example:8443`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    https: bool,
    /// Lower case, with a port where it is not the scheme's own.
    authority: String,
}

impl FromStr for Origin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "{text:?} is not an origin: expected http://HOST[:PORT] or \
                                https://HOST[:PORT]"
            )
        };
        let (scheme, rest) = text.split_once("://").ok_or_else(wrong)?;
        let https = match scheme {
            "http" => false,
            "https" => true,
            _ => return Err(wrong()),
        };
        let authority = rest.strip_suffix('/').unwrap_or(rest).to_ascii_lowercase();
        let host = Host::parse(&authority).ok_or_else(wrong)?;
        let own_port = if https { 443 } else { 80 };
        let authority = match host.port {
            Some(port) if port == own_port => host.name,
            _ => authority,
        };
        Ok(Self { https, authority })
    }
}

/// A `Host` header, or the authority of an origin.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Host {
    /// Lower case; an IPv6 address with its brackets.
    name: String,
    port: Option<u16>,
}

impl Host {
    fn parse(text: &str) -> Option<Self> {
        let text = text.to_ascii_lowercase();
        let (name, port) = match text.rfind(':') {
            Some(colon) if !text.ends_with(']') => {
                (text[..colon].to_owned(), Some(text[colon + 1..].parse().ok()?))
            }
            _ => (text, None),
        };
        let plain = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'.' | b'_');
        let is_name = !name.is_empty() && name.bytes().all(plain);
        let is_v6 = name.starts_with('[') && name.ends_with(']') && ip(&name).is_some();
        (is_name || is_v6).then_some(Self { name, port })
    }
}

fn ip(name: &str) -> Option<IpAddr> {
    name.trim_start_matches('[').trim_end_matches(']').parse().ok()
}

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Refusal {
    /// `Host` is missing, or a name that nobody told the dashboard of.
    Host,
    /// `Origin` is another site's, or missing where it is needed.
    Origin,
    /// The token is missing or wrong.
    Token,
    /// Nobody has signed in.
    SignIn,
    /// Too many wrong tokens came from there.
    Guesses,
}

impl Refusal {
    /// What it is called in the metrics.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Origin => "origin",
            Self::Token => "token",
            Self::SignIn => "sign_in",
            Self::Guesses => "guesses",
        }
    }

    /// For people.
    pub(super) fn text(self) -> &'static str {
        match self {
            Self::Host => {
                "refused: unknown host name. Open the dashboard by its address, or start it with \
                 --allow-origin URL.\n"
            }
            Self::Origin => {
                "refused: only the dashboard's own page is allowed to do that. Behind a proxy, start the \
                 dashboard with --allow-origin URL.\n"
            }
            Self::Token => {
                "refused: a token is needed. Open the address that the dashboard printed when it started \
                 (it ends in ?token=…), or send Authorization: Bearer TOKEN.\n"
            }
            Self::SignIn => {
                "refused: sign in first, at /sign-in; programs send Authorization: Bearer TOKEN, with the token of \
                 `fleet-cli pki token NAME`, or a client certificate of the fleet.\n"
            }
            Self::Guesses => "refused: too many wrong tokens from this address. Wait a minute.\n",
        }
    }
}

/// What a request may do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Entry {
    /// Go on.
    In(Visitor),
    /// The token stands in the address: set the cookie and lead to the page.
    SetCookie,
}

/// What the dashboard knows of who may come.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    listen: IpAddr,
    access: Access,
    allowed: Vec<Origin>,
}

impl Guard {
    /// For a server at this address.
    pub(super) fn new(listen: IpAddr, access: Access, allowed: Vec<Origin>) -> Self {
        Self { listen, access, allowed }
    }

    /// The cookie as it is set: scripts cannot read it, and no other site's request bears it.
    pub(super) fn set_cookie(&self) -> String {
        let cookie = match &self.access {
            Access::Token { cookie, .. } => cookie,
            Access::Open | Access::People { .. } => "",
        };
        format!("{COOKIE}={cookie}; HttpOnly; SameSite=Strict; Path=/")
    }

    /// The people who may sign in, if that is how one gets in.
    pub(super) fn people(&self) -> Option<&People> {
        match &self.access {
            Access::People { people, .. } => Some(people),
            Access::Open | Access::Token { .. } => None,
        }
    }

    /// Whether a request may go on.
    pub(super) fn admit(
        &self,
        method: &Method,
        uri: &Uri,
        headers: &HeaderMap,
        peer: &Peer,
    ) -> Result<Entry, Refusal> {
        let host = text(headers.get(header::HOST)).and_then(Host::parse).ok_or(Refusal::Host)?;
        if !self.knows(&host) {
            return Err(Refusal::Host);
        }
        let given = text(headers.get(header::AUTHORIZATION)).and_then(|value| value.strip_prefix("Bearer "));
        let bearer = given.map(|token| self.bearer(token, peer)).transpose()?.flatten();
        let has_effect = !matches!(*method, Method::GET | Method::HEAD) || uri.path() == "/ws";
        match headers.get(header::ORIGIN) {
            Some(origin) if has_effect && !self.is_own(text(Some(origin)), &host) => {
                return Err(Refusal::Origin);
            }
            // Programs send none; browsers always do.
            None if has_effect && bearer.is_none() => return Err(Refusal::Origin),
            _ => {}
        }
        if let Some(visitor) = bearer {
            return Ok(Entry::In(visitor));
        }
        match &self.access {
            Access::Open => Ok(Entry::In(Visitor::Anybody)),
            Access::Token { token, cookie } => {
                // Whether the dashboard is up is no secret.
                let known = cookies(headers, COOKIE).any(|value| same(value, cookie));
                if known || uri.path() == "/healthz" {
                    return Ok(Entry::In(Visitor::Anybody));
                }
                let given = uri.query().into_iter().flat_map(|query| query.split('&'));
                let mut given = given.filter_map(|part| part.strip_prefix("token="));
                match given.next_back().is_some_and(|given| same(given, token)) && uri.path() == "/" {
                    true => Ok(Entry::SetCookie),
                    false => Err(Refusal::Token),
                }
            }
            Access::People { people, .. } => {
                let now = Instant::now();
                let by_cookie =
                    cookies(headers, PERSONS_COOKIE).find_map(|value| people.by_cookie(value, now));
                let by_certificate = || people.by_certificate(peer.certificate.as_ref()?);
                match by_cookie.or_else(by_certificate) {
                    Some(person) => Ok(Entry::In(Visitor::Person(person))),
                    None if OPEN_PATHS.contains(&uri.path()) => Ok(Entry::In(Visitor::Anybody)),
                    None => Err(Refusal::SignIn),
                }
            }
        }
    }

    /// Whose token this is: with none to know, it is not looked at.
    fn bearer(&self, given: &str, peer: &Peer) -> Result<Option<Visitor>, Refusal> {
        match &self.access {
            Access::Open => Ok(None),
            Access::Token { token, .. } => Ok(same(given, token).then_some(Visitor::Anybody)),
            Access::People { people, .. } => match people.by_token(given, peer.from, Instant::now()) {
                Ok(person) => Ok(Some(Visitor::Person(person))),
                Err(NotTaken::Wrong) => Err(Refusal::SignIn),
                Err(NotTaken::TooMany) => Err(Refusal::Guesses),
            },
        }
    }

    /// An address cannot be rebound; a name must be one that was told.
    fn knows(&self, host: &Host) -> bool {
        let told = self.allowed.iter().filter_map(|origin| Host::parse(&origin.authority));
        let hosts: &[String] = match &self.access {
            Access::People { hosts, .. } => hosts,
            Access::Open | Access::Token { .. } => &[],
        };
        let certified = hosts.iter().map(|name| name.to_ascii_lowercase());
        let mut told = told.map(|told| told.name).chain(certified);
        match ip(&host.name) {
            Some(ip) if ip.is_loopback() || ip == self.listen || self.listen.is_unspecified() => true,
            None if host.name == "localhost" => true,
            _ => told.any(|told| told == host.name),
        }
    }

    fn is_own(&self, origin: Option<&str>, host: &Host) -> bool {
        let Some(Ok(origin)) = origin.map(str::parse::<Origin>) else { return false };
        let https = matches!(self.access, Access::People { .. });
        let own_port = if https { 443 } else { 80 };
        let authority = match host.port {
            Some(port) if port != own_port => format!("{}:{port}", host.name),
            _ => host.name.clone(),
        };
        self.allowed.contains(&origin) || origin == Origin { https, authority }
    }
}

/// The cookie of a person who has signed in, or of nobody any more.
pub(super) fn persons_cookie(value: Option<&str>) -> String {
    let (value, end) = value.map_or(("", "; Max-Age=0"), |value| (value, ""));
    format!("{PERSONS_COOKIE}={value}; Secure; HttpOnly; SameSite=Strict; Path=/{end}")
}

/// The values of the cookies of this name.
fn cookies<'a>(headers: &'a HeaderMap, name: &'a str) -> impl Iterator<Item = &'a str> {
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| text(Some(value)));
    cookies.flat_map(|value| value.split(';')).filter_map(move |pair| {
        let (own, value) = pair.trim().split_once('=')?;
        (own == name).then_some(value)
    })
}

fn text(value: Option<&HeaderValue>) -> Option<&str> {
    value.and_then(|value| value.to_str().ok())
}

#[cfg(test)]
mod tests;
