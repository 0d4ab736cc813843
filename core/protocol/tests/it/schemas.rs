//! The JSON Schemas from which the types of the Python package are made: those that it has are those of the messages.

#![cfg(feature = "schema")]
use schemars::generate::{SchemaGenerator, SchemaSettings};
use serde_json::{Map, Value};
use std::path::Path;
use xtb_protocol::messages::{
    About, DispatchReply, DispatchRequest, Estop, Estopped, Event, IdentityStatus, Reply, Request,
    RobotState, Roster, Setpoint, TaskList,
};

/// The definitions that `generator` has met, without what only forbids fields that a later release may have.
fn definitions(mut generator: SchemaGenerator) -> Map<String, Value> {
    let mut definitions = generator.take_definitions(true);
    definitions.values_mut().for_each(allow_more);
    definitions
}

fn allow_more(schema: &mut Value) {
    match schema {
        Value::Array(parts) => parts.iter_mut().for_each(allow_more),
        Value::Object(schema) => {
            if schema.get("additionalProperties").is_some_and(Value::is_boolean) {
                schema.remove("additionalProperties");
            }
            schema.values_mut().for_each(allow_more);
        }
        _ => {}
    }
}

/// What a client receives: fields with a default are always there.
fn received() -> Map<String, Value> {
    let mut generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    generator.subschema_for::<About>();
    generator.subschema_for::<DispatchReply>();
    generator.subschema_for::<Estopped>();
    generator.subschema_for::<Event>();
    generator.subschema_for::<IdentityStatus>();
    generator.subschema_for::<Reply>();
    generator.subschema_for::<RobotState>();
    generator.subschema_for::<Roster>();
    generator.subschema_for::<TaskList>();
    definitions(generator)
}

/// What a client sends: fields with a default may be left out.
fn sent() -> Map<String, Value> {
    let mut generator = SchemaSettings::draft2020_12().for_deserialize().into_generator();
    generator.subschema_for::<DispatchRequest>();
    generator.subschema_for::<Estop>();
    generator.subschema_for::<Request>();
    generator.subschema_for::<Setpoint>();
    definitions(generator)
}

/// One definition a line, so that a change shows which.
fn lines(definitions: &Map<String, Value>) -> String {
    let lines = definitions.iter().map(|(name, schema)| format!("\"{name}\": {schema}"));
    lines.collect::<Vec<_>>().join(",\n")
}

#[test]
fn the_python_package_has_the_schemas_of_the_messages() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fleet-cli/python");
    let file = folder.join("src/xtb_fleet/schemas.json");
    let committed = std::fs::read_to_string(&file).unwrap_or_default();
    let made =
        format!("{{\"received\": {{\n{}\n}}, \"sent\": {{\n{}\n}}}}\n", lines(&received()), lines(&sent()));
    if committed != made {
        let new = Path::new(env!("CARGO_TARGET_TMPDIR")).join("schemas.json");
        std::fs::write(&new, made).unwrap();
        panic!(
            "{} does not hold the schemas of the messages: copy {} there, and run generate_types.py in {}",
            file.display(),
            new.display(),
            folder.display()
        );
    }
}
