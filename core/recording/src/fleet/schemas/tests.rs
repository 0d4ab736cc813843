//! What a schema takes, what Foxglove reads of it, and what is drawn.

use super::*;
use crate::fleet::drawing;
use crate::schema::check::{foxglove_reads, wrong};
use serde_json::{Value, json};
use xtb_protocol::keys::Key;

fn schema(name: &str) -> Value {
    serde_json::from_slice(&of(name).unwrap_or_else(|| panic!("no schema for {name}")).text).unwrap()
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
