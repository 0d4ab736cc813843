//! The fleet's identities: names, roles, generations, expiry. A TOML file beside the CA; the router reads it.

use crate::{CommonName, Role};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::time::SystemTime;
use thiserror::Error;
use xtb_protocol::Name;

/// Names that stand in keys or begin the names of programs, and the role that may have one all the same.
const TAKEN: [(&str, Option<Role>); 10] = [
    ("all", None),
    ("sim", Some(Role::Simulator)),
    ("dispatch", Some(Role::Dispatcher)),
    ("traffic", Some(Role::Traffic)),
    ("map", Some(Role::Map)),
    ("web", None),
    ("cli", None),
    ("client", None),
    ("router", None),
    ("ros", None),
];
/// Longest name of a person, and of a service: `-3f9a1c` follows it in the name of a session.
const LONGEST_PERSON: usize = 20;
const LONGEST_SERVICE: usize = 25;
const VERSION: u32 = 1;

/// Something is wrong in it, or cannot be done with it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RegistryError {
    /// Not TOML, or not of this shape.
    #[error("{0}")]
    Malformed(String),
    /// Of a later version of this program.
    #[error("version {0} of the registry is not known to this program")]
    Version(u32),
    /// Two entries with one name.
    #[error("two identities have the name {0}")]
    Twice(Name),
    /// See [`Registry::add`].
    #[error("{longer} could be the name of a session of {name}")]
    Covers {
        /// Whose sessions begin so.
        name: Name,
        /// The other one.
        longer: Name,
    },
    /// See [`Registry::check_name`].
    #[error("{name} cannot be the name of a {role}: {reason}")]
    Name {
        /// Which.
        name: String,
        /// For what.
        role: Role,
        /// Why.
        reason: String,
    },
    /// Nobody of this name.
    #[error("no identity has the name {0}")]
    Unknown(Name),
}

/// The router's own certificate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Router {
    /// Host names and addresses that clients may reach it by.
    pub names: Vec<String>,
    /// Its port.
    pub port: u16,
    /// From 1.
    pub generation: u32,
    /// When its certificate ends.
    #[serde(with = "rfc3339")]
    pub expires: SystemTime,
}

/// One identity.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegistryEntry {
    /// Whose; no two have the same.
    pub name: Name,
    /// What it may do.
    pub role: Role,
    /// Its valid certificate; earlier ones are not admitted any more.
    pub generation: u32,
    /// When that certificate ends.
    #[serde(with = "rfc3339")]
    pub expires: SystemTime,
    /// Not admitted at all.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub revoked: bool,
    /// SHA-256 of the token with which this person signs in to the page, in hexadecimal digits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub token_sha256: Option<String>,
}

impl RegistryEntry {
    /// The common name of its valid certificate.
    #[must_use]
    pub fn common_name(&self) -> CommonName {
        CommonName { name: self.name.clone(), generation: self.generation }
    }

    /// Whether this is the token with which this person signs in.
    #[must_use]
    pub fn has_token(&self, token: &str) -> bool {
        // Of digests: how long it takes says nothing of the token.
        self.token_sha256.as_ref().is_some_and(|digest| *digest == token_digest(token))
    }
}

/// What the registry keeps of a token: its SHA-256 in hexadecimal digits.
#[must_use]
pub fn token_digest(token: &str) -> String {
    Sha256::digest(token).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// All identities of a fleet.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Registry {
    version: u32,
    /// Whose.
    pub fleet: Name,
    /// The router.
    pub router: Router,
    /// In the order of their making.
    #[serde(default, rename = "identity")]
    pub identities: Vec<RegistryEntry>,
}

impl Registry {
    /// Its file in the folder of the PKI.
    pub const FILE: &str = "identities.toml";

    /// One without identities.
    #[must_use]
    pub fn new(fleet: Name, router: Router) -> Self {
        Self { version: VERSION, fleet, router, identities: Vec::new() }
    }

    /// Reads a file's text.
    ///
    /// # Errors
    /// [`RegistryError`], with the line for what is not TOML.
    pub fn parse(text: &str) -> Result<Self, RegistryError> {
        let malformed =
            |error: toml::de::Error| RegistryError::Malformed(error.to_string().trim_end().to_owned());
        let registry: Self = toml::from_str(text).map_err(malformed)?;
        if registry.version != VERSION {
            return Err(RegistryError::Version(registry.version));
        }
        for (i, entry) in registry.identities.iter().enumerate() {
            Self::check_name(&entry.name, entry.role)?;
            apart(&registry.identities[..i], entry)?;
        }
        Ok(registry)
    }

    /// A file's text.
    ///
    /// # Errors
    /// [`RegistryError::Malformed`]: a time that no file can hold.
    pub fn to_text(&self) -> Result<String, RegistryError> {
        toml::to_string(self).map_err(|error| RegistryError::Malformed(error.to_string()))
    }

    /// Whether an identity may have this name. A person's has no `-`: each session of `alice` is `alice-…`, and the
    /// rules admit these.
    ///
    /// # Errors
    /// [`RegistryError::Name`].
    pub fn check_name(name: &Name, role: Role) -> Result<(), RegistryError> {
        let no = |reason: String| Err(RegistryError::Name { name: name.to_string(), role, reason });
        if name.as_str().starts_with('-') {
            return no("it begins with -".into());
        }
        if role.is_person() && name.as_str().contains('-') {
            return no("a person's name has no -".into());
        }
        let (who, longest) = match role {
            Role::Robot | Role::Router => ("", usize::MAX),
            role if role.is_person() => ("person", LONGEST_PERSON),
            _ => ("service", LONGEST_SERVICE),
        };
        if name.as_str().len() > longest {
            return no(format!("a {who}'s name has at most {longest} characters"));
        }
        let taken = TAKEN.iter().find(|(taken, _)| *taken == name.as_str());
        match taken.filter(|(_, by)| *by != Some(role)) {
            Some(_) => no("it is reserved".into()),
            None => Ok(()),
        }
    }

    /// Whose entry.
    #[must_use]
    pub fn get(&self, name: &Name) -> Option<&RegistryEntry> {
        self.identities.iter().find(|entry| entry.name == *name)
    }

    /// The same, to be changed.
    ///
    /// # Errors
    /// [`RegistryError::Unknown`].
    pub fn get_mut(&mut self, name: &Name) -> Result<&mut RegistryEntry, RegistryError> {
        let found = self.identities.iter_mut().find(|entry| entry.name == *name);
        found.ok_or_else(|| RegistryError::Unknown(name.clone()))
    }

    /// Takes a new one in, if no session of it could pass for another's, or the other way round.
    ///
    /// # Errors
    /// [`RegistryError::Twice`], [`RegistryError::Covers`] or [`RegistryError::Name`].
    pub fn add(&mut self, entry: RegistryEntry) -> Result<(), RegistryError> {
        Self::check_name(&entry.name, entry.role)?;
        apart(&self.identities, &entry)?;
        self.identities.push(entry);
        Ok(())
    }

    /// Who is admitted: not revoked. (Expiry is the link's: it is closed then.)
    pub fn admitted(&self) -> impl Iterator<Item = &RegistryEntry> {
        self.identities.iter().filter(|entry| !entry.revoked)
    }
}

/// Whether an entry goes with those before it. Robots and routers have no sessions under other names.
fn apart(before: &[RegistryEntry], entry: &RegistryEntry) -> Result<(), RegistryError> {
    let has_sessions = |entry: &RegistryEntry| !matches!(entry.role, Role::Robot | Role::Router);
    let covers = |short: &RegistryEntry, long: &RegistryEntry| {
        let rest = long.name.as_str().strip_prefix(short.name.as_str());
        has_sessions(short) && has_sessions(long) && rest.is_some_and(|rest| rest.starts_with('-'))
    };
    for other in before {
        if other.name == entry.name {
            return Err(RegistryError::Twice(entry.name.clone()));
        }
        for (short, long) in [(other, entry), (entry, other)] {
            if covers(short, long) {
                return Err(RegistryError::Covers { name: short.name.clone(), longer: long.name.clone() });
            }
        }
    }
    Ok(())
}

mod rfc3339 {
    use serde::{Deserialize, Deserializer, Serializer, de};
    use std::time::SystemTime;

    pub(super) fn serialize<S: Serializer>(time: &SystemTime, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&humantime::format_rfc3339_seconds(*time))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<SystemTime, D::Error> {
        let text = String::deserialize(from)?;
        humantime::parse_rfc3339(&text).map_err(|error| de::Error::custom(format!("{text:?}: {error}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, UNIX_EPOCH};

    fn at(seconds: u64) -> SystemTime {
        UNIX_EPOCH + Duration::from_secs(seconds)
    }

    fn entry(name: &str, role: Role) -> RegistryEntry {
        let name = Name::new(name).unwrap();
        RegistryEntry {
            name,
            role,
            generation: 1,
            expires: at(1_800_000_000),
            revoked: false,
            token_sha256: None,
        }
    }

    fn registry() -> Registry {
        let router =
            Router { names: vec!["10.0.0.1".into()], port: 7447, generation: 1, expires: at(1_800_000_000) };
        Registry::new(Name::new("lab").unwrap(), router)
    }

    #[test]
    fn a_registry_reads_back_as_itself() {
        let mut registry = registry();
        registry.add(entry("xtb-1", Role::Robot)).unwrap();
        registry.add(entry("alice", Role::Operator)).unwrap();
        registry.get_mut(&Name::new("alice").unwrap()).unwrap().revoked = true;
        let text = registry.to_text().unwrap();
        assert_eq!(Registry::parse(&text), Ok(registry.clone()), "{text}");
        assert!(text.contains("expires = \"2027-01-15T08:00:00Z\""), "{text}");
        assert_eq!(registry.admitted().count(), 1);
    }

    #[test]
    fn a_token_is_known_by_its_digest() {
        let mut alice = entry("alice", Role::Operator);
        assert!(!alice.has_token(""));
        alice.token_sha256 = Some(token_digest("abc"));
        assert!(alice.token_sha256.as_ref().unwrap().starts_with("ba7816bf8f01cfea"));
        assert!(alice.has_token("abc") && !alice.has_token("abd") && !alice.has_token(""));
    }

    #[test]
    fn names_that_would_cover_others_are_refused() {
        let mut registry = registry();
        for (name, role) in [
            ("al-ice", Role::Operator),
            ("dispatch", Role::Viewer),
            ("web", Role::Operator),
            ("all", Role::Robot),
            ("-x", Role::Robot),
            ("a234567890123456789012", Role::Viewer),
            ("a2345678901234567890123456", Role::Recorder),
            ("traffic", Role::Map),
        ] {
            assert!(registry.add(entry(name, role)).is_err(), "{name}");
        }
        registry.add(entry("alice", Role::Viewer)).unwrap();
        registry.add(entry("traffic", Role::Traffic)).unwrap();
        registry.add(entry("alice-2", Role::Robot)).unwrap();
        let covered = registry.add(entry("alice-3", Role::Recorder)).unwrap_err();
        assert_eq!(covered.to_string(), "alice-3 could be the name of a session of alice");
        let twice = registry.add(entry("alice", Role::Robot)).unwrap_err();
        assert_eq!(twice.to_string(), "two identities have the name alice");
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        assert_eq!(
            Registry::parse(&registry().to_text().unwrap().replace("version = 1", "version = 7")),
            Err(RegistryError::Version(7))
        );
        let error = Registry::parse("version = 1\nfleet = \"Lab\"").unwrap_err().to_string();
        assert!(error.contains("\"Lab\" is not a name"), "{error}");
    }
}
