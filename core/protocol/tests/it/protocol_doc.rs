//! `docs/protocol.md` is what other languages are written from: it knows every name that we send.

use serde::{Serialize, de::DeserializeOwned};
use xtb_control::Mode;
use xtb_protocol::messages::{
    BatteryLevel, DispatchCode, Fault, GoalStatus, HomeStatus, Latch, LogCode, MapCell, MapEditCode,
    ParamCode, RejectCode, Rejected, StopReason, TaskState,
};

const DOC: &str = include_str!("../../../../docs/protocol.md");

/// What stands between one heading and the next.
fn section(heading: &str) -> &'static str {
    let (_, after) = DOC.split_once(&format!("\n{heading}\n")).unwrap_or_else(|| panic!("no {heading}"));
    after.split("\n#").next().unwrap()
}

fn has<'a>(heading: &str, names: impl IntoIterator<Item = &'a str>) {
    let text = section(heading);
    for name in names {
        assert!(text.contains(&format!("`{name}`")), "docs/protocol.md, {heading}, does not know {name}");
    }
}

/// Every name of an enum stands in this section.
fn knows<T: DeserializeOwned + Serialize>(heading: &str) {
    let known = (0_u8..128).map_while(|number| postcard::from_bytes::<T>(&[number]).ok());
    let names: Vec<_> = known.map(|value| serde_json::to_value(value).unwrap()).collect();
    assert!(names.len() > 2);
    has(heading, names.iter().map(|name| name.as_str().unwrap()));
}

#[test]
fn every_code_mode_status_reason_latch_and_fault_is_in_its_table() {
    knows::<RejectCode>("### Replies");
    knows::<Mode>("## State");
    knows::<GoalStatus>("## State");
    knows::<StopReason>("## State");
    knows::<BatteryLevel>("## State");
    knows::<Latch>("### Latches");
    knows::<Fault>("### Faults");
    knows::<TaskState>("## Dispatch");
    knows::<DispatchCode>("## Dispatch");
    knows::<HomeStatus>("## Dispatch");
    knows::<LogCode>("## Recordings");
    knows::<ParamCode>("## Settings");
    knows::<MapEditCode>("## Map edits");
}

#[test]
fn every_field_of_a_map_and_every_kind_of_cell_and_zone_is_in_its_table() {
    knows::<MapCell>("## Map");
    has("## Map", ["name", "hash", "resolution_m", "origin_m", "width", "height", "cells", "zones"]);
    has("## Map", ["kind", "points"]);
    assert!(
        section("## Map").contains(r#""keep_out""#)
            && section("## Map").contains(r#"{"one_way": {"heading_rad"}}"#)
    );
}

#[test]
fn every_counter_is_in_its_table() {
    let counters = serde_json::to_value(Rejected::default()).unwrap();
    has("## State", counters.as_object().unwrap().keys().map(String::as_str));
}
