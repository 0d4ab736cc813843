//! Diagnostics.

use super::{Header, cdr_structs};

/// How bad it is, in rising order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Level {
    /// Nothing to do.
    Ok = 0,
    /// See to it.
    Warn = 1,
    /// It stands, or will.
    Error = 2,
    /// Not heard any more.
    Stale = 3,
}

cdr_structs! {
    /// A value with its name.
    KeyValue {
        /// The name.
        key: String,
        /// The value.
        value: String,
    }

    /// How one part is.
    DiagnosticStatus {
        /// See [`Level`].
        level: u8,
        /// Which part: `<who>: <part>`.
        name: String,
        /// In words.
        message: String,
        /// Whose.
        hardware_id: String,
        /// More of it.
        values: Vec<KeyValue>,
    }

    /// How several parts are.
    ["diagnostic_msgs/msg/DiagnosticArray", "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"]
    DiagnosticArray {
        /// When.
        header: Header,
        /// The parts.
        status: Vec<DiagnosticStatus>,
    }
}
