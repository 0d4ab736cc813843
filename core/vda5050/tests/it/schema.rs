//! As much of JSON Schema as the official files use; a keyword beyond that is an error, so that nothing is skipped.

use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use xtb_vda5050::Protocol;

fn text(protocol: Protocol, name: &str) -> &'static str {
    match (protocol.is_v3(), name) {
        (false, "state") => include_str!("../data/v21-state.json"),
        (false, "connection") => include_str!("../data/v21-connection.json"),
        (false, "factsheet") => include_str!("../data/v21-factsheet.json"),
        (false, "order") => include_str!("../data/v21-order.json"),
        (false, "instantActions") => include_str!("../data/v21-instantActions.json"),
        (true, "state") => include_str!("../data/v3-state.json"),
        (true, "connection") => include_str!("../data/v3-connection.json"),
        (true, "factsheet") => include_str!("../data/v3-factsheet.json"),
        (true, "order") => include_str!("../data/v3-order.json"),
        (true, "instantActions") => include_str!("../data/v3-instantActions.json"),
        _ => panic!("no schema of {name}"),
    }
}

/// What is wrong with a message; empty = nothing.
pub(crate) fn faults(protocol: Protocol, name: &str, message: &Value) -> Vec<String> {
    static READ: Mutex<BTreeMap<(bool, String), Arc<Value>>> = Mutex::new(BTreeMap::new());
    let read = || Arc::new(serde_json::from_str(text(protocol, name)).unwrap());
    let root = READ.lock().unwrap().entry((protocol.is_v3(), name.to_owned())).or_insert_with(read).clone();
    let mut faults = Vec::new();
    check(&root, &root, message, name, &mut faults);
    faults
}

pub(crate) fn assert_valid(protocol: Protocol, name: &str, message: &Value) {
    let faults = faults(protocol, name, message);
    assert!(faults.is_empty(), "{faults:?} in {message:#}");
}

const SILENT: [&str; 9] =
    ["$schema", "title", "description", "examples", "unit", "subtopic", "definitions", "format", "default"];

fn check(root: &Value, schema: &Value, value: &Value, at: &str, faults: &mut Vec<String>) {
    for (keyword, rule) in schema.as_object().unwrap() {
        let number = |value: &Value| value.as_f64().unwrap_or(0.0);
        let broken = match keyword.as_str() {
            "$ref" => {
                let name = rule.as_str().unwrap().strip_prefix("#/definitions/").unwrap();
                check(root, &root["definitions"][name], value, at, faults);
                false
            }
            "type" => !types(rule).iter().any(|name| is_a(value, name)),
            "enum" => value.is_string() && !rule.as_array().unwrap().contains(value),
            "minimum" => value.is_number() && number(value) < number(rule),
            "maximum" => value.is_number() && number(value) > number(rule),
            "required" => {
                let missing =
                    |name: &&Value| value.is_object() && value.get(name.as_str().unwrap()).is_none();
                rule.as_array().unwrap().iter().any(|name| missing(&name))
            }
            "properties" => {
                for (name, schema) in rule.as_object().unwrap() {
                    if let Some(value) = value.get(name) {
                        check(root, schema, value, &format!("{at}.{name}"), faults);
                    }
                }
                false
            }
            "items" => {
                for (i, item) in value.as_array().into_iter().flatten().enumerate() {
                    check(root, rule, item, &format!("{at}[{i}]"), faults);
                }
                false
            }
            other => {
                assert!(SILENT.contains(&other), "keyword {other}");
                false
            }
        };
        if broken {
            faults.push(format!("{at}: {keyword} {rule}, got {value}"));
        }
    }
}

fn types(rule: &Value) -> Vec<&str> {
    rule.as_array().map_or_else(
        || vec![rule.as_str().unwrap()],
        |all| all.iter().map(|one| one.as_str().unwrap()).collect(),
    )
}

fn is_a(value: &Value, name: &str) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        other => panic!("type {other}"),
    }
}

#[test]
fn a_message_that_breaks_the_schema_is_noticed() {
    let connection = serde_json::json!({"headerId": "1", "connectionState": "SOMEWHERE"});
    let faults = faults(Protocol::V3_0, "connection", &connection);
    assert_eq!(faults.len(), 3, "{faults:?}");
}
