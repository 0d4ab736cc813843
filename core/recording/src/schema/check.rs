//! What a schema takes, and what Foxglove reads of it, for tests.

use serde_json::Value;

/// What of a value its schema forbids: as much of JSON Schema as ours use.
pub(crate) fn wrong(schema: &Value, value: &Value, place: &str) -> Vec<String> {
    let list = |name: &str| schema.get(name).and_then(Value::as_array);
    let mut found = Vec::new();
    let kinds = match schema.get("type") {
        Some(Value::Array(kinds)) => kinds.iter().filter_map(Value::as_str).collect(),
        Some(Value::String(kind)) => vec![kind.as_str()],
        _ => Vec::new(),
    };
    let is = |kind: &&str| match *kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "integer" => value.is_u64() || value.is_i64(),
        "number" => value.is_number(),
        other => panic!("{place}: {other}"),
    };
    if !kinds.is_empty() && !kinds.iter().any(is) {
        found.push(format!("{place}: {value} is not {kinds:?}"));
    }
    if list("enum").is_some_and(|all| !all.contains(value))
        || schema.get("const").is_some_and(|it| it != value)
    {
        found.push(format!("{place}: {value} is not one of those allowed"));
    }
    for (name, must) in [("anyOf", None), ("oneOf", Some(1))] {
        let Some(parts) = list(name) else { continue };
        let fitting = parts.iter().filter(|part| wrong(part, value, place).is_empty()).count();
        if fitting == 0 || must.is_some_and(|must| fitting != must) {
            found.push(format!("{place}: {fitting} of {name} fit {value}"));
        }
    }
    found.extend(list("allOf").into_iter().flatten().flat_map(|part| wrong(part, value, place)));
    if let Value::Object(fields) = value {
        let missing = |name: &&Value| !fields.contains_key(name.as_str().unwrap());
        let required = list("required").into_iter().flatten();
        found.extend(required.filter(missing).map(|name| format!("{place}: no {name}")));
        for (name, field) in fields {
            if let Some(schema) = schema.get("properties").and_then(|all| all.get(name)) {
                found.extend(wrong(schema, field, &format!("{place}.{name}")));
            }
        }
    }
    if let (Value::Array(items), Some(schema)) = (value, schema.get("items")) {
        found.extend(items.iter().flat_map(|item| wrong(schema, item, &format!("{place}[]"))));
    }
    found
}

/// What Foxglove's reader of schemas takes.
pub(crate) fn foxglove_reads(schema: &Value, place: &str) {
    assert_eq!(schema["type"], "object", "{place}");
    for (name, field) in schema["properties"].as_object().unwrap_or_else(|| panic!("{place}")) {
        let place = format!("{place}.{name}");
        assert!(field.get("oneOf").is_none() && field.get("$ref").is_none(), "{place}: {field}");
        let mut item = field;
        while item["type"] == "array" {
            item = &item["items"];
        }
        match item["type"].as_str().unwrap_or_else(|| panic!("{place}: {item}")) {
            "object" => foxglove_reads(item, &place),
            "boolean" | "string" | "number" | "integer" => {}
            other => panic!("{place}: {other}"),
        }
    }
}
