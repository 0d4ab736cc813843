//! JSON Schemas of what recordings hold, made from the types themselves.
//!
//! Foxglove reads `properties` whose type is one word, and refuses a channel for any other. So what may
//! be null, or is one of several, stands below `allOf`, where validators look and Foxglove does not: the
//! schema stays whole, and Foxglove shows such fields all the same.

use schemars::generate::{SchemaGenerator, SchemaSettings};
use serde_json::{Map, Value, json};

/// A schema under its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// `xtb.RobotState`, or Foxglove's name of it.
    pub name: String,
    /// JSON Schema.
    pub text: Vec<u8>,
}

/// Makes schemas of types as they are written.
pub(crate) fn generator() -> SchemaGenerator {
    let settings = SchemaSettings::draft2020_12().for_serialize().with(|it| it.inline_subschemas = true);
    settings.into_generator()
}

/// A schema as it was generated in the form that the module's words describe.
pub(crate) fn text(mut schema: Value) -> Vec<u8> {
    simplify(&mut schema);
    // A message that is one of several objects is an object all the same.
    if let Value::Object(schema) = &mut schema {
        schema.entry("type").or_insert_with(|| "object".into());
        schema.entry("properties").or_insert_with(|| json!({}));
    }
    schema.to_string().into_bytes()
}

/// Brings a schema into the form that the module's words describe, from the inside out.
fn simplify(schema: &mut Value) {
    match schema {
        Value::Array(parts) => parts.iter_mut().for_each(simplify),
        Value::Object(schema) => {
            schema.values_mut().for_each(simplify);
            // A recording outlives the program: a later one may have more fields.
            if schema.get("additionalProperties").is_some_and(Value::is_boolean) {
                schema.remove("additionalProperties");
            }
            name_variants(schema);
            set_apart(schema);
        }
        _ => {}
    }
}

/// An enum of names only is a text, one of these.
fn name_variants(schema: &mut Map<String, Value>) {
    let Some(Value::Array(variants)) = schema.get("oneOf") else { return };
    let names = |variant: &Value| match (variant.get("const"), variant.get("enum")) {
        (Some(name @ Value::String(_)), _) => Some(vec![name.clone()]),
        (None, Some(Value::Array(names))) => Some(names.clone()),
        _ => None,
    };
    let Some(names) = variants.iter().map(names).collect::<Option<Vec<_>>>() else { return };
    schema.remove("oneOf");
    schema.insert("type".into(), "string".into());
    schema.insert("enum".into(), Value::Array(names.concat()));
}

/// Moves what has not one plain type below `allOf`.
fn set_apart(schema: &mut Map<String, Value>) {
    if schema.get("type") != Some(&Value::from("object")) {
        return;
    }
    let Some(Value::Object(properties)) = schema.remove("properties") else { return };
    let (plain, apart): (Map<_, _>, Map<_, _>) = properties.into_iter().partition(|(_, it)| is_plain(it));
    schema.insert("properties".into(), Value::Object(plain));
    if !apart.is_empty() {
        schema.insert("allOf".into(), json!([{ "properties": apart }]));
    }
}

fn is_plain(schema: &Value) -> bool {
    match schema.get("type").and_then(Value::as_str) {
        Some("boolean" | "string" | "number" | "integer") => true,
        Some("object") => schema.get("properties").is_some(),
        Some("array") => schema.get("items").is_some_and(is_plain),
        _ => false,
    }
}

#[cfg(test)]
pub(crate) mod check;
