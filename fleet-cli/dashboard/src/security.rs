//! Who may ask the dashboard for what. Pure: a request's headers in, yes or a refusal out.
//!
//! * A page of somebody else's site can make a browser send requests here. It cannot forge `Origin`, so
//!   whatever could have an effect (the socket, anything but GET and HEAD) needs the page's own.
//! * It can name this machine by a name of its own (DNS rebinding) and then is its own origin; so `Host`
//!   must be an address or a name that is known.
//! * Other machines need a token: whoever gets in may drive robots.

use axum::http::{HeaderMap, HeaderValue, Method, Uri, header};
use std::hint::black_box;
use std::net::{IpAddr, SocketAddr};
use std::str::FromStr;
use xtb_client::{Error, ErrorKind};

/// Shortest token.
pub(super) const MIN_TOKEN: usize = 16;
/// The cookie that stands for the token.
const COOKIE: &str = "xtb_dashboard";

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
}

impl Refusal {
    /// What it is called in the metrics.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Origin => "origin",
            Self::Token => "token",
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
        }
    }
}

/// What a request may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Entry {
    /// Go on.
    In,
    /// The token stands in the address: set the cookie and lead to the page.
    SetCookie,
}

/// What the dashboard knows of who may come.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    listen: IpAddr,
    token: Option<String>,
    /// Stands for the token in the cookie, which other programs on other ports of this host get too.
    cookie: String,
    allowed: Vec<Origin>,
}

impl Guard {
    /// For a server at `listen`; `cookie` is random and of this process.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: other machines could get in without a token, or with a short one.
    pub(super) fn new(
        listen: SocketAddr,
        token: Option<String>,
        cookie: String,
        allowed: Vec<Origin>,
    ) -> Result<Self, Error> {
        let listen = listen.ip();
        match &token {
            None if !listen.is_loopback() => Err(Error::new(
                ErrorKind::Invalid,
                format!("a token is needed to listen on {listen}: anyone who reaches it could drive robots"),
            )
            .hint(
                "set XTB_DASHBOARD_TOKEN (or --token) to 16 or more random characters, such as from `openssl rand \
                 -hex 16`; or stay on 127.0.0.1 and use a proxy with TLS, with --allow-origin",
            )),
            Some(token) if token.len() < MIN_TOKEN || !token.bytes().all(|b| b.is_ascii_graphic()) => {
                Err(Error::new(
                    ErrorKind::Invalid,
                    format!("a token needs at least {MIN_TOKEN} characters, without spaces or accents"),
                )
                .hint("create one with `openssl rand -hex 16`"))
            }
            _ => Ok(Self { listen, token, cookie, allowed }),
        }
    }

    /// The cookie as it is set: scripts cannot read it, and no other site's request bears it.
    pub(super) fn set_cookie(&self) -> String {
        format!("{COOKIE}={}; HttpOnly; SameSite=Strict; Path=/", self.cookie)
    }

    /// Whether a request may go on.
    pub(super) fn admit(&self, method: &Method, uri: &Uri, headers: &HeaderMap) -> Result<Entry, Refusal> {
        let host = text(headers.get(header::HOST)).and_then(Host::parse).ok_or(Refusal::Host)?;
        if !self.knows(&host) {
            return Err(Refusal::Host);
        }
        let bearer = self.bearer(headers);
        let has_effect = !matches!(*method, Method::GET | Method::HEAD) || uri.path() == "/ws";
        match headers.get(header::ORIGIN) {
            Some(origin) if has_effect && !self.is_own(text(Some(origin)), &host) => {
                return Err(Refusal::Origin);
            }
            // Programs send none; browsers always do.
            None if has_effect && !bearer => return Err(Refusal::Origin),
            _ => {}
        }
        let Some(token) = &self.token else { return Ok(Entry::In) };
        // Whether the dashboard is up is no secret.
        if bearer || self.has_cookie(headers) || uri.path() == "/healthz" {
            return Ok(Entry::In);
        }
        let given = uri.query().into_iter().flat_map(|query| query.split('&'));
        let mut given = given.filter_map(|part| part.strip_prefix("token="));
        match given.next_back().is_some_and(|given| same(given, token)) && uri.path() == "/" {
            true => Ok(Entry::SetCookie),
            false => Err(Refusal::Token),
        }
    }

    /// An address cannot be rebound; a name must be one that was told.
    fn knows(&self, host: &Host) -> bool {
        let told = self.allowed.iter().filter_map(|origin| Host::parse(&origin.authority));
        let mut told = told.map(|told| told.name);
        match ip(&host.name) {
            Some(ip) if ip.is_loopback() || ip == self.listen || self.listen.is_unspecified() => true,
            None if host.name == "localhost" => true,
            _ => told.any(|told| told == host.name),
        }
    }

    fn is_own(&self, origin: Option<&str>, host: &Host) -> bool {
        let Some(Ok(origin)) = origin.map(str::parse::<Origin>) else { return false };
        let authority = match host.port {
            None | Some(80) => host.name.clone(),
            Some(port) => format!("{}:{port}", host.name),
        };
        self.allowed.contains(&origin) || (!origin.https && origin.authority == authority)
    }

    fn bearer(&self, headers: &HeaderMap) -> bool {
        let given = text(headers.get(header::AUTHORIZATION)).and_then(|value| value.strip_prefix("Bearer "));
        given.zip(self.token.as_deref()).is_some_and(|(given, token)| same(given, token))
    }

    fn has_cookie(&self, headers: &HeaderMap) -> bool {
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| text(Some(value)));
        let mut values = cookies.flat_map(|value| value.split(';')).filter_map(|pair| {
            let (name, value) = pair.trim().split_once('=')?;
            (name == COOKIE).then_some(value)
        });
        values.any(|value| same(value, &self.cookie))
    }
}

fn text(value: Option<&HeaderValue>) -> Option<&str> {
    value.and_then(|value| value.to_str().ok())
}

/// Whether both are the same, in a time that tells only their lengths.
fn same(a: &str, b: &str) -> bool {
    let differing = a.bytes().zip(b.bytes()).fold(0, |differing, (a, b)| black_box(differing | (a ^ b)));
    a.len() == b.len() && differing == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "0123456789abcdef";

    fn guard(listen: &str, token: Option<&str>, allowed: &[&str]) -> Guard {
        let allowed = allowed.iter().map(|origin| origin.parse().unwrap()).collect();
        Guard::new(listen.parse().unwrap(), token.map(str::to_owned), "c00kie".into(), allowed).unwrap()
    }

    fn admit(guard: &Guard, method: Method, path: &str, headers: &[(&str, &str)]) -> Result<Entry, Refusal> {
        let headers = headers.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()));
        guard.admit(&method, &path.parse().unwrap(), &HeaderMap::from_iter(headers))
    }

    #[test]
    fn only_the_pages_own_origin_opens_the_socket_or_posts() {
        let guard = guard("127.0.0.1:8080", None, &[]);
        for (method, path) in [(Method::GET, "/ws"), (Method::POST, "/"), (Method::DELETE, "/x")] {
            let with = |origin| {
                let host = ("host", "localhost:8080");
                admit(&guard, method.clone(), path, &[host, ("origin", origin)])
            };
            assert_eq!(with("http://localhost:8080"), Ok(Entry::In));
            for foreign in [
                "http://evil.example",
                "http://localhost:8081",
                "https://localhost:8080",
                "http://127.0.0.1:8080",
                "http://localhost:8080.evil.example",
                "http://localhost:8080@evil.example",
                "null",
                "",
            ] {
                assert_eq!(with(foreign), Err(Refusal::Origin), "{foreign}");
            }
            let none = admit(&guard, method, path, &[("host", "localhost:8080")]);
            assert_eq!(none, Err(Refusal::Origin), "browsers send one");
        }
    }

    #[test]
    fn a_name_that_nobody_told_us_of_is_refused() {
        let local = guard("127.0.0.1:8080", None, &["https://fleet.example"]);
        let with = |guard: &Guard, host: &str| admit(guard, Method::GET, "/", &[("host", host)]);
        for good in ["127.0.0.1:8080", "localhost:9000", "LOCALHOST", "[::1]:8080", "fleet.example"] {
            assert_eq!(with(&local, good), Ok(Entry::In), "{good}");
        }
        for bad in
            ["evil.example:8080", "192.168.1.7:8080", "localhost.evil.example", "a b", "", "x:y", "[::1"]
        {
            assert_eq!(with(&local, bad), Err(Refusal::Host), "{bad}");
        }
        assert_eq!(admit(&local, Method::GET, "/", &[]), Err(Refusal::Host));
        let anywhere = guard("0.0.0.0:8080", Some(TOKEN), &[]);
        assert_eq!(with(&anywhere, "192.168.1.7:8080"), Err(Refusal::Token), "an address cannot be rebound");
        assert_eq!(with(&anywhere, "evil.example:8080"), Err(Refusal::Host));
    }

    #[test]
    fn an_allowed_origin_comes_through_its_proxy() {
        let guard = guard("127.0.0.1:8080", None, &["https://fleet.example/"]);
        for (host, origin, admitted) in [
            ("fleet.example", "https://fleet.example", true),
            ("127.0.0.1:8080", "https://fleet.example", true),
            ("fleet.example", "https://fleet.example:8443", false),
            ("127.0.0.1:8080", "https://other.example", false),
        ] {
            let headers = [("host", host), ("origin", origin)];
            assert_eq!(admit(&guard, Method::GET, "/ws", &headers).is_ok(), admitted, "{host} {origin}");
        }
    }

    #[test]
    fn the_token_is_asked_for_everywhere_but_for_health() {
        let guard = guard("0.0.0.0:8080", Some(TOKEN), &[]);
        let host = ("host", "192.168.1.7:8080");
        let with = |path: &str, more: (&str, &str)| admit(&guard, Method::GET, path, &[host, more]);
        let none = ("accept", "*/*");
        for path in [
            "/",
            "/assets/app.js",
            "/metrics",
            "/?token=",
            "/?token=0123456789abcdeX",
            "/metrics?token=0123456789abcdef",
        ] {
            assert_eq!(with(path, none), Err(Refusal::Token), "{path}");
        }
        assert_eq!(with("/healthz", none), Ok(Entry::In));
        assert_eq!(with("/?token=0123456789abcdef", none), Ok(Entry::SetCookie));
        assert_eq!(with("/", ("cookie", "a=b; xtb_dashboard=c00kie")), Ok(Entry::In));
        for wrong in ["xtb_dashboard=", "xtb_dashboard=c00kiX", "xtb_dashboard=c00kie0", "x=c00kie"] {
            assert_eq!(with("/", ("cookie", wrong)), Err(Refusal::Token), "{wrong}");
        }
        assert_eq!(with("/ws", ("authorization", "Bearer 0123456789abcdef")), Ok(Entry::In));
        assert_eq!(with("/metrics", ("authorization", "Bearer 0123456789")), Err(Refusal::Token));
        assert_eq!(with("/ws", ("cookie", "xtb_dashboard=c00kie")), Err(Refusal::Origin));
        let forged = [host, ("authorization", "Bearer 0123456789abcdef"), ("origin", "http://evil.example")];
        assert_eq!(admit(&guard, Method::GET, "/ws", &forged), Err(Refusal::Origin));
        assert!(guard.set_cookie().contains("HttpOnly; SameSite=Strict"));
        assert!(!guard.set_cookie().contains(TOKEN));
    }

    #[test]
    fn other_machines_need_a_token_that_cannot_be_guessed() {
        let new = |listen: &str, token: Option<&str>| {
            Guard::new(listen.parse().unwrap(), token.map(str::to_owned), String::new(), Vec::new())
        };
        for (listen, token) in
            [("0.0.0.0:1", None), ("192.168.1.7:1", None), ("[::]:1", None), ("127.0.0.1:1", Some("short"))]
        {
            let failure = new(listen, token).unwrap_err();
            assert_eq!(failure.kind, ErrorKind::Invalid);
            assert!(failure.hint.contains("openssl rand"), "{failure:?}");
        }
        assert!(new("127.0.0.1:1", None).is_ok() && new("[::1]:1", None).is_ok());
        assert!(new("0.0.0.0:1", Some(TOKEN)).is_ok());
    }

    #[test]
    fn scripts_and_frames_of_others_are_forbidden() {
        for rule in
            ["default-src 'none'", "script-src 'self'", "connect-src 'self'", "frame-ancestors 'none'"]
        {
            assert!(CSP.contains(rule), "{rule}");
        }
        assert!(!CSP.contains("unsafe") && !CSP.contains('*'));
        assert!(HEADERS.iter().all(|(name, _)| !name.starts_with("access-control")));
    }
}
