//! Names that stand in keys.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;
use thiserror::Error;

/// Names that no robot may have: they are other things' places in the key space.
pub const RESERVED: [&str; 6] = ["all", "sim", "dispatch", "traffic", "map", "identity"];
/// Longest name in characters.
pub const MAX_NAME: usize = 32;

/// A name that cannot stand in a key.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NameError {
    /// Wrong length or characters.
    #[error("{0:?} is not a name: 1 to {MAX_NAME} of a-z, 0-9 and -")]
    Malformed(String),
    /// A robot's name on a command line would be taken for an option.
    #[error("{0:?} cannot be a robot's name: it begins with -")]
    LeadingDash(String),
    /// See [`RESERVED`].
    #[error("{0:?} is reserved and cannot be a robot's name")]
    Reserved(String),
}

/// The name of a fleet, a robot or a client: 1–32 of `a-z 0-9 -`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(try_from = "String", into = "String")]
pub struct Name(
    // Clones share it: states, tasks and histories name the same few robots over and over.
    Arc<str>,
);

impl Name {
    /// # Errors
    /// [`NameError::Malformed`].
    pub fn new(text: &str) -> Result<Self, NameError> {
        let allowed = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        if (1..=MAX_NAME).contains(&text.len()) && text.bytes().all(allowed) {
            Ok(Self(text.into()))
        } else {
            Err(NameError::Malformed(text.chars().take(2 * MAX_NAME).collect()))
        }
    }

    /// A name that a robot may have.
    ///
    /// # Errors
    /// Every [`NameError`].
    pub fn robot(text: &str) -> Result<Self, NameError> {
        let name = Self::new(text)?;
        if text.starts_with('-') {
            return Err(NameError::LeadingDash(text.to_owned()));
        }
        if RESERVED.contains(&text) { Err(NameError::Reserved(text.to_owned())) } else { Ok(name) }
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl TryFrom<String> for Name {
    type Error = NameError;

    fn try_from(text: String) -> Result<Self, NameError> {
        Self::new(&text)
    }
}

impl From<Name> for String {
    fn from(name: Name) -> String {
        name.as_str().to_owned()
    }
}

impl std::str::FromStr for Name {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        Self::new(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_checked() {
        for bad in ["", "Xtb", "a b", "a/b", "*", &"x".repeat(33)] {
            assert!(Name::new(bad).is_err(), "{bad}");
        }
        for other in RESERVED {
            assert_eq!(Name::robot(other), Err(NameError::Reserved(other.into())));
        }
        for option in ["-", "--all", "-xtb-1"] {
            assert_eq!(Name::robot(option), Err(NameError::LeadingDash(option.into())));
        }
        assert!(["xtb-1", "xtb-", "7"].iter().all(|name| Name::robot(name).is_ok()));
    }
}
