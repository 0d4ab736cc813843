//! One command, as it is told.

use schemars::JsonSchema;
use serde::Serialize;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use xtb_protocol::Name;

/// Who commanded what and when.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub(super) struct Command {
    /// In ms since 1970, by the clock of whoever wrote it down.
    pub(super) at_ms: u64,
    /// The client; `None` = what is kept does not say.
    pub(super) by: Option<String>,
    /// Which robot; `None` = the fleet, or not one yet.
    pub(super) robot: Option<Name>,
    /// In words.
    pub(super) text: String,
    /// What came of it, as far as it is kept.
    pub(super) result: Option<String>,
}

impl Command {
    pub(super) fn at(&self) -> SystemTime {
        UNIX_EPOCH + Duration::from_millis(self.at_ms)
    }

    /// As people read it.
    pub(super) fn time(&self) -> String {
        humantime::format_rfc3339_seconds(self.at()).to_string()
    }
}
