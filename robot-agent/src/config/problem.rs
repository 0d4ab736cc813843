//! What can be wrong with a configuration.

use thiserror::Error;
use xtb_control::config::ConfigError;
use xtb_protocol::keys::NameError;

/// A configuration that cannot be used.
#[derive(Debug, Error)]
pub enum ConfigProblem {
    /// The file cannot be read.
    #[error("cannot read {path}: {reason}")]
    Read {
        /// Its path.
        path: String,
        /// The system's words.
        reason: String,
    },
    /// Not TOML.
    #[error("{origin}: {reason}")]
    Syntax {
        /// File or flag.
        origin: String,
        /// The parser's words, with line and column.
        reason: String,
    },
    /// A key that means nothing.
    #[error("{origin}: unknown key {key}{}", suggestion(.nearest))]
    UnknownKey {
        /// File or flag.
        origin: String,
        /// With its sections.
        key: String,
        /// The nearest key that exists.
        nearest: Option<String>,
    },
    /// A value of the wrong type.
    #[error("{origin}: {reason}")]
    Type {
        /// File or flag.
        origin: String,
        /// What was expected.
        reason: String,
    },
    /// A value out of its range.
    #[error(transparent)]
    Value(#[from] ConfigError),
    /// Settings and identity do not go together, or it cannot be used.
    #[error("{message}")]
    Identity {
        /// Why not.
        message: String,
        /// What to do.
        hint: String,
    },
    /// A name that cannot stand in a key.
    #[error(transparent)]
    Name(#[from] NameError),
}

fn suggestion(nearest: &Option<String>) -> String {
    nearest.as_ref().map(|key| format!("; did you mean {key}?")).unwrap_or_default()
}
