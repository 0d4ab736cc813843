//! One table for every parameter: name, unit, allowed range, default and origin stand in one place.
//!
//! [`config_section!`](crate::config_section) turns a table into a plain serde struct whose `Default`, `validate()` and
//! commented TOML all come from the same lines. The vehicle's table is in [`crate::vehicle`]; the
//! agent's own sections are in `robot-agent/src/config/file.rs`.

use std::fmt;
use thiserror::Error;

/// Where a parameter's default comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DefaultOrigin {
    /// Printed in the memorandum, in the section named.
    Printed(&'static str),
    /// A component's data sheet.
    DataSheet(&'static str),
    /// Not known of the real truck: a plausible value, to be measured.
    Assumed,
    /// Added by this project to the published controller.
    Ours,
}

impl fmt::Display for DefaultOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Printed(section) => write!(f, "printed, {section}"),
            Self::DataSheet(part) => write!(f, "data sheet, {part}"),
            Self::Assumed => f.write_str("assumed"),
            Self::Ours => f.write_str("ours"),
        }
    }
}

/// What a parameter may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Allowed {
    /// A number within both bounds.
    Range(f64, f64),
    /// `true` or `false`.
    Switch,
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// Any text (checked where it is used).
    Text,
    /// A list, described so.
    List(&'static str),
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range(min, max) => write!(f, "{min}..={max}"),
            Self::Switch => f.write_str("true or false"),
            Self::OneOf(words) => f.write_str(&words.join(" or ")),
            Self::Text => f.write_str("text"),
            Self::List(words) => f.write_str(words),
        }
    }
}

/// One parameter with its present value, as the tables list it.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `section.field`.
    pub name: String,
    /// The value in TOML.
    pub value: String,
    /// Unit, empty for switches and words.
    pub unit: &'static str,
    /// What it may be.
    pub allowed: Allowed,
    /// Where the default comes from.
    pub origin: DefaultOrigin,
    /// One line on what it does.
    pub about: &'static str,
    /// Whether [`Parameter::value`] is allowed.
    pub valid: bool,
}

/// A value that the table does not allow.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ConfigError {
    /// One parameter is out of its own range.
    #[error("{name} = {value} is not allowed: {allowed}{unit}")]
    OutOfRange {
        /// `section.field`.
        name: String,
        /// What was given, in TOML.
        value: String,
        /// What would be allowed.
        allowed: String,
        /// The unit, with a leading space; empty for switches and words.
        unit: String,
    },
    /// Two parameters exclude each other.
    #[error("{name} = {value} is not allowed: {reason}")]
    Conflict {
        /// `section.field`.
        name: String,
        /// What was given.
        value: String,
        /// Why, and what would be allowed.
        reason: String,
    },
}

/// A type that may stand in a table.
pub trait Value {
    /// In TOML.
    fn to_toml(&self) -> String;
    /// Whether the value is one of `allowed`.
    fn is_allowed(&self, allowed: &Allowed) -> bool;
}

macro_rules! number_value {
    ($($ty:ty),*) => {$(
        impl Value for $ty {
            fn to_toml(&self) -> String {
                format!("{self:?}")
            }
            fn is_allowed(&self, allowed: &Allowed) -> bool {
                matches!(allowed, Allowed::Range(min, max) if (*min..=*max).contains(&f64::from(*self)))
            }
        }
    )*};
}
number_value!(f64, u16, u32);

impl Value for bool {
    fn to_toml(&self) -> String {
        self.to_string()
    }
    fn is_allowed(&self, allowed: &Allowed) -> bool {
        matches!(allowed, Allowed::Switch)
    }
}

/// As a basic string of TOML, whose escapes are not those of Rust.
fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_ascii_control() => quoted.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

impl Value for String {
    fn to_toml(&self) -> String {
        quoted(self)
    }
    fn is_allowed(&self, allowed: &Allowed) -> bool {
        match allowed {
            Allowed::Text => true,
            Allowed::OneOf(words) => words.contains(&self.as_str()),
            Allowed::Range(..) | Allowed::Switch | Allowed::List(_) => false,
        }
    }
}

impl Value for Vec<String> {
    fn to_toml(&self) -> String {
        let each: Vec<String> = self.iter().map(|text| quoted(text)).collect();
        format!("[{}]", each.join(", "))
    }
    fn is_allowed(&self, allowed: &Allowed) -> bool {
        matches!(allowed, Allowed::Text)
    }
}

/// The first parameter out of its range, if any.
///
/// # Errors
/// [`ConfigError::OutOfRange`] naming field, value and allowed range.
pub fn validate(parameters: &[Parameter]) -> Result<(), ConfigError> {
    match parameters.iter().find(|p| !p.valid) {
        None => Ok(()),
        Some(p) => Err(ConfigError::OutOfRange {
            name: p.name.clone(),
            value: p.value.clone(),
            allowed: p.allowed.to_string(),
            unit: if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) },
        }),
    }
}

/// Commented TOML of all `parameters`; `prefix` is put before each section's name (`"vehicle."`).
#[must_use]
pub fn render_toml(prefix: &str, parameters: &[Parameter]) -> String {
    let mut text = String::new();
    let mut open = "";
    for p in parameters {
        // What stands in no section of its own belongs to the prefix's.
        let (section, field) = p.name.rsplit_once('.').unwrap_or(("", &p.name));
        if section != open || text.is_empty() {
            text.push_str(&format!("\n[{}]\n", format!("{prefix}{section}").trim_end_matches('.')));
            open = section;
        }
        let unit = if p.unit.is_empty() { String::new() } else { format!(" [{}]", p.unit) };
        text.push_str(&format!("# {}{unit}; allowed: {}; {}\n", p.about, p.allowed, p.origin));
        text.push_str(&format!("{field} = {}\n", p.value));
    }
    text
}

/// Declares a configuration section; see the module's documentation.
#[macro_export]
macro_rules! config_section {
    ($(#[doc = $doc:literal])* $name:ident $section:literal {
        $($field:ident: $ty:ty = $default:expr, $unit:literal, $allowed:expr, $origin:expr, $about:literal;)*
    }) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, PartialEq, ::serde::Serialize, ::serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $(
                #[doc = $about]
                #[doc = concat!(" Unit: ", $unit, ".")]
                pub $field: $ty,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $name {
            /// Every parameter of the section with its present value.
            #[must_use]
            pub fn parameters(&self) -> Vec<$crate::config::Parameter> {
                use $crate::config::Value;
                vec![$({
                    let allowed = $allowed;
                    $crate::config::Parameter {
                        name: concat!($section, ".", stringify!($field)).to_owned(),
                        value: self.$field.to_toml(),
                        unit: $unit,
                        valid: self.$field.is_allowed(&allowed),
                        allowed,
                        origin: $origin,
                        about: $about,
                    }
                },)*]
            }
        }
    };
}
