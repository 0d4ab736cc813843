//! Kinds of lines that verbs print with `--json`: each file of a verb names its own in a constant `JSON`, and `schema`
//! makes schemas of them.

use schemars::generate::SchemaGenerator;
use schemars::{JsonSchema, Schema};

/// A kind of line: how its schema is made.
pub(crate) type LineKind = fn(&mut SchemaGenerator) -> Schema;
/// Verbs with the kinds of lines that each prints.
pub(crate) type Verbs = &'static [(&'static str, &'static [LineKind])];

/// The lines that `T` is printed as.
pub(crate) fn line_of<T: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    generator.subschema_for::<T>()
}
