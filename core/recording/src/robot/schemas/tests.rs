//! What a robot writes fits what is said of it, and that is what Foxglove reads.

use super::*;
use crate::robot::{outputs_message, sample_message};
use crate::schema::check::{foxglove_reads, wrong};
use xtb_control::{Controller, VehicleConfig};
use xtb_protocol::trace::{TraceReader, kind};
use xtb_robot::step_log::Step;

/// At least one line of each kind, in the order of their times.
const LINES: [&str; 10] = [
    r#"{"t_ns":1,"gyro":{"roll":-1,"pitch":2,"yaw":-32768}}"#,
    r#"{"t_ns":2,"encoder":{"pulses":23}}"#,
    r#"{"t_ns":3,"adc":{"ir_front":[0,1,2,3,4,1023],"ir_rear":[0,0,0,0,0,0],"tilt":[512.5,3],"pistons":[1,2,3,4]}}"#,
    r#"{"t_ns":4,"remote":{"speed":938,"steering":null,"selector":58275}}"#,
    r#"{"t_ns":5,"command":{"idle":{}}}"#,
    r#"{"t_ns":6,"command":{"teleop":{"rpm":-13.3,"steering":0.7}}}"#,
    r#"{"t_ns":7,"command":{"follow":{"rpm":40.5,"steering":-0.2}}}"#,
    r#"{"t_ns":8,"command":{"goto":{"x_m":0.1,"y_m":-2}}}"#,
    r#"{"t_ns":9,"gyro":{"roll":0,"pitch":0,"yaw":0}}"#,
    r#"{"t_ns":10,"obstacle":{"threshold_cm":40}}"#,
];

/// Each step's kind, the message of its sample, and that of its decision.
fn messages() -> Vec<(&'static str, Value, Value)> {
    let (mut reader, mut controller) = (TraceReader::default(), Controller::new(VehicleConfig::default()));
    let step = |(number, line): (u64, &&str)| {
        let (t, sample) = reader.line(line).unwrap();
        let step = Step { number, t, sample, outputs: controller.step(t, &sample) };
        let message = sample_message(&step);
        let outputs = outputs_message(&step, &message);
        let json = |text: &str| -> Value { serde_json::from_str(text).unwrap() };
        (kind(&sample), json(&message), json(&outputs))
    };
    (0..).zip(&LINES).map(step).collect()
}

fn of_kind(kind: &str) -> Value {
    let (_, title) = KINDS.into_iter().find(|(name, _)| *name == kind).unwrap();
    value(&sample(kind, title))
}

fn value(schema: &Schema) -> Value {
    serde_json::from_slice(&schema.text).unwrap()
}

#[test]
fn every_schema_is_one_that_foxglove_reads_and_says_what_it_is() {
    let kinds = KINDS.map(|(kind, title)| (sample(kind, title), title));
    let others = [(config(), "Who recorded what"), (outputs(), "What one step decided")];
    for (schema, title) in kinds.into_iter().chain(others) {
        let value = value(&schema);
        foxglove_reads(&value, &schema.name);
        assert_eq!(value["title"], title, "{}", schema.name);
    }
}

#[test]
fn what_is_written_fits_its_schema() {
    let decided = value(&outputs());
    let mut seen = Vec::new();
    for (kind, sample, outputs) in messages() {
        seen.push(kind);
        assert_eq!(wrong(&of_kind(kind), &sample, kind), Vec::<String>::new());
        assert_eq!(wrong(&decided, &outputs, OUTPUTS), Vec::<String>::new());
    }
    assert!(KINDS.iter().all(|(kind, _)| seen.contains(kind)), "{seen:?}");
    let header = Header {
        version: "0".into(),
        fleet: "lab".into(),
        robot: "xtb-1".into(),
        epoch: 1,
        started: String::new(),
        vehicle_toml: String::new(),
    };
    let header = serde_json::to_value(header).unwrap();
    assert_eq!(wrong(&value(&config()), &header, CONFIG), Vec::<String>::new());
}

#[test]
fn what_is_not_written_does_not_fit() {
    let all = messages();
    let (kind, gyro, outputs) = &all[0];
    for (field, broken) in [("n", json!("0")), ("t_ns", json!(null)), ("gyro", json!({ "roll": 1 }))] {
        let mut message = gyro.clone();
        message[field] = broken;
        assert!(!wrong(&of_kind(kind), &message, kind).is_empty(), "{field}");
    }
    let mut another = gyro.clone();
    another.as_object_mut().unwrap().remove("gyro");
    assert_eq!(wrong(&of_kind(kind), &another, kind), ["gyro: no \"gyro\""]);
    for (field, broken) in [("sample_crc", json!(-0.5)), ("mode", json!("flying")), ("pwm", json!({}))] {
        let mut message = outputs.clone();
        message[field] = broken;
        assert!(!wrong(&value(&super::outputs()), &message, OUTPUTS).is_empty(), "{field}");
    }
}
