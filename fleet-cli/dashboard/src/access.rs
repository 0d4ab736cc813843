//! How people get in, and whose a request is.

use super::people::{People, Person};
use std::net::SocketAddr;
use xtb_client::{Error, ErrorKind};

/// Shortest token.
const MIN_TOKEN: usize = 16;

/// Whose request it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Visitor {
    /// Nobody is asked for a name here, or has to give one for this.
    Anybody,
    /// Somebody of the registry.
    Person(Person),
}

impl Visitor {
    /// Who it is, if that is known.
    pub(super) fn person(&self) -> Option<&Person> {
        match self {
            Self::Anybody => None,
            Self::Person(person) => Some(person),
        }
    }
}

/// How people get in.
#[derive(Debug, Clone)]
pub(super) enum Access {
    /// Who reaches it.
    Open,
    /// Who knows the one token.
    Token {
        token: String,
        /// Stands for it in the cookie, which other programs on other ports of this host get too.
        cookie: String,
    },
    /// Over TLS, people of the registry; the page's certificate is for these hosts.
    People { people: People, hosts: Vec<String> },
}

impl Access {
    /// Without TLS: for a server at `listen`; `cookie` is random and of this process.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: other machines could get in, or with a short token.
    pub(super) fn plain(
        listen: SocketAddr,
        token: Option<String>,
        cookie: String,
        insecure: bool,
    ) -> Result<Self, Error> {
        let (refused, invalid) = (!listen.ip().is_loopback(), |text| Error::new(ErrorKind::Invalid, text));
        if refused && !insecure {
            return Err(invalid(format!("whoever reaches {listen} could drive every robot")).hint(
                "`fleet-cli pki add-service dashboard --address HOST` and `fleet-cli enrol dashboard.xtbid` give the \
                 page a certificate, and people sign in with their own tokens; to go without TLS, with one token for \
                 all: --insecure",
            ));
        }
        match token {
            None if refused => {
                let why = "anyone who reaches it could drive robots";
                Err(invalid(format!("a token is needed to listen on {}: {why}", listen.ip())).hint(
                    "set XTB_DASHBOARD_TOKEN (or --token) to 16 or more random characters, such as from `openssl rand \
                     -hex 16`; or stay on 127.0.0.1 and use a proxy with TLS, with --allow-origin",
                ))
            }
            Some(token) if token.len() < MIN_TOKEN || !token.bytes().all(|b| b.is_ascii_graphic()) => {
                let text =
                    format!("a token needs at least {MIN_TOKEN} characters, without spaces or accents");
                Err(invalid(text).hint("create one with `openssl rand -hex 16`"))
            }
            None => Ok(Self::Open),
            Some(token) => Ok(Self::Token { token, cookie }),
        }
    }
}
