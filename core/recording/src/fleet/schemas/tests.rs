//! What a schema takes, what Foxglove reads of it, and what is drawn.

use super::*;
use crate::recording::drawing;
use xtb_protocol::keys::Key;

/// What of a value its schema forbids: as much of JSON Schema as ours use.
fn wrong(schema: &Value, value: &Value, place: &str) -> Vec<String> {
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

fn schema(name: &str) -> Value {
    serde_json::from_slice(&of(name).unwrap_or_else(|| panic!("no schema for {name}")).text).unwrap()
}

/// What Foxglove's reader of schemas takes.
fn foxglove_reads(schema: &Value, place: &str) {
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

#[test]
fn every_schema_of_ours_is_one_that_foxglove_reads() {
    for it in all().iter().filter(|it| !is_derived(&it.name)) {
        foxglove_reads(&schema(&it.name), &it.name);
    }
}

#[test]
fn every_type_of_message_has_a_schema() {
    let state = AnyMessage::from(xtb_client::fake::state("xtb-1"));
    assert_eq!(name_of(&state), "xtb.RobotState");
    assert!(of(&name_of(&AnyMessage::Alive(true))).is_some());
    // The others are in `AnyMessage::read`: each reads its own bytes, and `tests/` records one of each.
    let mut names: Vec<&str> = all().iter().map(|schema| schema.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all().len());
}

#[test]
fn a_state_fits_its_schema_and_a_broken_one_does_not() {
    let schema = schema("xtb.RobotState");
    let mut state = serde_json::to_value(xtb_client::fake::state("xtb-1")).unwrap();
    assert_eq!(wrong(&schema, &state, "state"), Vec::<String>::new());
    for (field, broken) in [
        ("pose", json!(null)),
        ("speed_mps", json!("fast")),
        ("mode", json!("flying")),
        ("goal", json!({"id": 1})),
        ("stopped_because", json!(["whim"])),
        ("seq", json!(-0.5)),
    ] {
        let good = std::mem::replace(&mut state[field], broken);
        assert!(!wrong(&schema, &state, "state").is_empty(), "{field}");
        state[field] = good;
    }
    state.as_object_mut().unwrap().remove("lease");
    assert_eq!(wrong(&schema, &state, "state"), ["state: no \"lease\""]);
}

#[test]
fn what_is_drawn_fits_foxgloves_schemas() {
    let key = Key::parse("xtb/lab/xtb-1/state").unwrap();
    let state = xtb_client::fake::state("xtb-1");
    let pose = serde_json::to_value(drawing::pose(5, &state)).unwrap();
    assert_eq!(wrong(&schema("foxglove.PoseInFrame"), &pose, "pose"), Vec::<String>::new());
    let update = drawing::Painter::default().draw(5, &key, &state.into()).unwrap();
    let update = serde_json::to_value(update).unwrap();
    assert_eq!(wrong(&schema("foxglove.SceneUpdate"), &update, "scene"), Vec::<String>::new());
    assert_eq!(update["entities"][0]["cubes"].as_array().unwrap().len(), 1);
    let line = serde_json::to_value(drawing::log(5, &key, &AnyMessage::Alive(true)).unwrap()).unwrap();
    assert_eq!(wrong(&schema("foxglove.Log"), &line, "log"), Vec::<String>::new());
}
