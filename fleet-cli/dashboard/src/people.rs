//! People of the fleet's registry: who a token, a cookie or a certificate stands for, and for how long.
//!
//! The registry decides anew at each request, each command, and once a second for each socket: whoever is revoked,
//! has got a new token, certificate or role, is out at once.

use super::guesses::{Guesses, same};
use super::places::network;
use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};
use tokio::sync::watch;
use xtb_identity::certificate::Certificate;
use xtb_identity::{CommonName, Registry, RegistryEntry, Role, token_digest};
use xtb_protocol::{Name, Uuid};

/// A cookie that nobody has used for so long stands for nobody any more.
const IDLE: Duration = Duration::from_secs(12 * 3600);
/// Cookies that one person may have: each browser has its own. The one that was not used for longest makes room.
const MOST_EACH: usize = 16;

/// A person who has shown who it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Person {
    /// Who.
    pub(super) name: Name,
    /// What it may do.
    pub(super) role: Role,
    /// By what.
    pub(super) by: By,
}

/// What a person has shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum By {
    /// The token itself, of which this is the SHA-256.
    Token(String),
    /// The cookie that was set when it signed in.
    Cookie(String),
    /// A client certificate.
    Certificate(Shown),
}

/// What a connection's client certificate says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Shown {
    own: CommonName,
    not_after: SystemTime,
}

impl Shown {
    /// Of a certificate that the CA has signed; `None` = it is for none of ours.
    pub(super) fn read(der: &[u8]) -> Option<Self> {
        let certificate = Certificate::parse_der(der).ok()?;
        Some(Self { own: certificate.common_name().ok()?, not_after: certificate.not_after })
    }
}

/// A token that was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NotTaken {
    /// Nobody's.
    Wrong,
    /// There were too many wrong ones from that address: it was not looked at.
    TooMany,
}

#[derive(Debug)]
struct Cookie {
    name: Name,
    /// SHA-256 of the token with which it was got.
    token: String,
    used: Instant,
}

#[derive(Debug)]
struct Table {
    registry: Registry,
    cookies: BTreeMap<String, Cookie>,
    guesses: Guesses,
}

/// See the module. Clones share it.
#[derive(Debug, Clone)]
pub(super) struct People {
    table: Arc<Mutex<Table>>,
    changes: watch::Sender<()>,
}

impl People {
    /// Nobody has signed in.
    pub(super) fn new(registry: Registry) -> Self {
        let table = Table { registry, cookies: BTreeMap::new(), guesses: Guesses::default() };
        Self { table: Arc::new(Mutex::new(table)), changes: watch::channel(()).0 }
    }

    /// The registry is another one now.
    pub(super) fn update(&self, registry: Registry) {
        self.lock().registry = registry;
        self.changes.send_replace(());
    }

    /// Changes when somebody may be out.
    pub(super) fn changes(&self) -> watch::Receiver<()> {
        self.changes.subscribe()
    }

    /// Whose token this is.
    pub(super) fn by_token(&self, token: &str, from: IpAddr, now: Instant) -> Result<Person, NotTaken> {
        let from = network(from);
        let mut table = self.lock();
        if table.guesses.is_blocked(from, now) {
            return Err(NotTaken::TooMany);
        }
        let given = token_digest(token);
        // All of them: how long it takes tells nothing.
        let mut found = None;
        for entry in people(&table.registry) {
            if entry.token_sha256.as_deref().is_some_and(|token| same(&token.to_ascii_lowercase(), &given)) {
                found = Some((entry.name.clone(), entry.role));
            }
        }
        let Some((name, role)) = found else {
            table.guesses.wrong(from, now);
            return Err(NotTaken::Wrong);
        };
        Ok(Person { name, role, by: By::Token(given) })
    }

    /// Whose cookie this is.
    pub(super) fn by_cookie(&self, cookie: &str, now: Instant) -> Option<Person> {
        let mut table = self.lock();
        let Table { registry, cookies, .. } = &mut *table;
        let known = cookies.get_mut(cookie)?;
        let role = role_by_token(registry, &known.name, &known.token)?;
        if now.saturating_duration_since(known.used) > IDLE {
            return None;
        }
        known.used = now;
        Some(Person { name: known.name.clone(), role, by: By::Cookie(cookie.to_owned()) })
    }

    /// Whose certificate this is.
    pub(super) fn by_certificate(&self, shown: &Shown) -> Option<Person> {
        let table = self.lock();
        let entry = people(&table.registry).find(|entry| entry.common_name() == shown.own)?;
        let role = (SystemTime::now() <= shown.not_after).then_some(entry.role)?;
        Some(Person { name: entry.name.clone(), role, by: By::Certificate(shown.clone()) })
    }

    /// The same person now: out, or with another role perhaps.
    pub(super) fn again(&self, person: &Person, now: Instant) -> Option<Person> {
        match &person.by {
            By::Cookie(cookie) => self.by_cookie(cookie, now),
            By::Certificate(shown) => self.by_certificate(shown),
            By::Token(token) => {
                let role = role_by_token(&self.lock().registry, &person.name, token)?;
                Some(Person { role, ..person.clone() })
            }
        }
    }

    /// A cookie for who has shown a token.
    pub(super) fn sign_in(&self, person: &Person, now: Instant) -> Option<String> {
        let By::Token(token) = &person.by else { return None };
        // Twice 122 random bits.
        let cookie = format!("{}{}", Uuid::new_v4().simple(), Uuid::new_v4().simple());
        let mut table = self.lock();
        table.cookies.retain(|_, known| now.saturating_duration_since(known.used) <= IDLE);
        let mut own: Vec<_> = table.cookies.iter().filter(|(_, known)| known.name == person.name).collect();
        own.sort_by_key(|(_, known)| known.used);
        let over = (own.len() + 1).saturating_sub(MOST_EACH);
        let oldest: Vec<String> = own.iter().take(over).map(|(cookie, _)| (*cookie).clone()).collect();
        oldest.iter().for_each(|cookie| drop(table.cookies.remove(cookie)));
        let known = Cookie { name: person.name.clone(), token: token.clone(), used: now };
        table.cookies.insert(cookie.clone(), known);
        Some(cookie)
    }

    /// Its cookie stands for nobody any more.
    pub(super) fn sign_out(&self, person: &Person) {
        if let By::Cookie(cookie) = &person.by {
            self.lock().cookies.remove(cookie);
            self.changes.send_replace(());
        }
    }

    /// A panic elsewhere does not lock everybody out.
    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Robots and services do not sign in, and nobody when the certificate has ended: a token lives no longer.
fn people(registry: &Registry) -> impl Iterator<Item = &RegistryEntry> {
    let now = SystemTime::now();
    registry.admitted().filter(move |entry| entry.role.is_person() && now <= entry.expires)
}

fn role_by_token(registry: &Registry, name: &Name, token: &str) -> Option<Role> {
    let entry = people(registry).find(|entry| entry.name == *name)?;
    let own = entry.token_sha256.as_deref()?.to_ascii_lowercase();
    same(&own, token).then_some(entry.role)
}

#[cfg(test)]
mod tests;
