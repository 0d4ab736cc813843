//! `schema`: what the lines of `--json` hold, as JSON Schema, made from the types that are printed.
//!
//! Only what has a schema can be printed ([`Output::line`]). Each verb's file names its kinds of lines in a constant
//! `JSON`; a test holds what is printed against them.

use super::{
    alerts, audit, change, dashboard, demo, dispatch, doctor, enrol, events, export, fetch_log, goal, home,
    list, man, map, param, pki, place, plan, play, record, report, reset, router, set_pose, sim, status,
    stopped, task, tasks, teleop, traffic, vda5050, watch, why,
};
use crate::exit::Exit;
use crate::json::{LineKind, Verbs, line_of};
use crate::nearest::nearest;
use crate::output::{ErrorLine, Output, json_line};
use clap::Args;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde::Serialize;
use serde_json::{Map, Value};
use xtb_client::{Error, ErrorKind, Result};

const SCHEMA_HELP: &str = "\
Each line that a verb prints with --json, also that of an error, matches its schema. Later versions may add fields \
and, where a text is one of several, texts.

Examples:
  fleet-cli schema
  fleet-cli schema list
  fleet-cli schema dispatch status > status.schema.json";

/// Arguments of `schema`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SCHEMA_HELP)]
pub struct SchemaArgs {
    /// Verb, such as `list` or `dispatch status` [default: list all].
    #[arg(value_name = "VERB")]
    pub verb: Vec<String>,
}

/// Verbs without verbs of their own; those that print no JSON have none.
const SINGLE: Verbs = &[
    ("list", list::JSON),
    ("status", status::JSON),
    ("why", why::JSON),
    ("doctor", doctor::JSON),
    ("goto", goal::JSON),
    ("wander", goal::JSON),
    ("home", home::JSON),
    ("stop", stopped::JSON),
    ("estop", stopped::JSON),
    ("reset", reset::JSON),
    ("set-pose", set_pose::JSON),
    ("teleop", teleop::JSON),
    ("top", &[]),
    ("watch", watch::JSON),
    ("record", record::JSON),
    ("play", play::JSON),
    ("export", export::JSON),
    ("audit", audit::JSON),
    ("events", events::JSON),
    ("report", report::JSON),
    ("fetch-log", fetch_log::JSON),
    ("tasks", tasks::JSON),
    ("task", task::JSON),
    ("cancel", change::JSON),
    ("pause", change::JSON),
    ("resume", change::JSON),
    ("retry", change::JSON),
    ("extend", change::JSON),
    ("dashboard", dashboard::JSON),
    ("enrol", enrol::JSON),
    ("router", router::JSON),
    ("sim", sim::JSON),
    ("demo", demo::JSON),
    ("plan", plan::JSON),
    ("man", man::JSON),
    ("schema", &[line_of::<Listed<'_>>]),
    ("completions", &[]),
];

/// Those with verbs of their own.
const GROUPS: [Verbs; 8] = [
    alerts::JSON,
    param::JSON,
    map::JSON,
    place::JSON,
    traffic::JSON,
    dispatch::JSON,
    vda5050::JSON,
    pki::JSON,
];

/// What it prints with `--json` where no verb is named.
#[derive(Debug, Serialize, JsonSchema)]
struct Listed<'a> {
    verbs: Vec<&'a str>,
}

/// A verb's JSON Schema.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(rename = "$schema")]
    dialect: &'static str,
    title: String,
    description: &'static str,
    any_of: Vec<Schema>,
    #[serde(rename = "$defs")]
    definitions: Map<String, Value>,
}

fn all() -> impl Iterator<Item = &'static (&'static str, &'static [LineKind])> {
    std::iter::once(SINGLE).chain(GROUPS).flatten()
}

/// Prints a verb's schema, or the verbs; needs neither config nor router.
///
/// # Errors
/// No such verb.
pub fn run(out: Output, args: &SchemaArgs) -> Result<Exit> {
    if args.verb.is_empty() {
        let verbs = all().map(|(verb, _)| *verb).collect();
        out.result(&Listed { verbs }, |listed| listed.verbs.join("\n"))?;
        return Ok(Exit::Done);
    }
    let verb = args.verb.join(" ");
    let (_, lines) = all().find(|(known, _)| *known == verb).ok_or_else(|| unknown(&verb))?;
    let document = document(&verb, lines);
    out.text(&match out.json {
        true => json_line(&document)?,
        false => serde_json::to_string_pretty(&document)
            .map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))?,
    })?;
    Ok(Exit::Done)
}

fn unknown(verb: &str) -> Error {
    let own: Vec<&str> =
        all().map(|(known, _)| *known).filter(|known| known.split(' ').next() == Some(verb)).collect();
    let near = || nearest(verb, all().map(|(known, _)| *known));
    let hint = match own.as_slice() {
        [] => near().map_or_else(
            || "`fleet-cli schema` lists the verbs".to_owned(),
            |known| format!("did you mean {known}?"),
        ),
        own => format!("it has verbs of its own: {}", own.join(", ")),
    };
    Error::new(ErrorKind::Invalid, format!("no schema of {verb:?}")).hint(hint)
}

fn document(verb: &str, lines: &[LineKind]) -> Document {
    let mut generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let mut any_of: Vec<Schema> = lines.iter().map(|line| line(&mut generator)).collect();
    any_of.push(line_of::<ErrorLine<'_>>(&mut generator));
    let mut definitions = generator.take_definitions(true);
    definitions.values_mut().for_each(allow_more);
    Document {
        dialect: "https://json-schema.org/draft/2020-12/schema",
        title: format!("fleet-cli --json {verb}"),
        description: "A line of its output.",
        any_of,
        definitions,
    }
}

/// A later version may have more fields.
fn allow_more(schema: &mut Value) {
    match schema {
        Value::Array(parts) => parts.iter_mut().for_each(allow_more),
        Value::Object(schema) => {
            for closed in ["additionalProperties", "unevaluatedProperties"] {
                if schema.get(closed) == Some(&Value::Bool(false)) {
                    schema.remove(closed);
                }
            }
            schema.values_mut().for_each(allow_more);
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cli;
    use clap::{Command, CommandFactory};
    use std::collections::BTreeSet;

    fn verbs(command: &Command, path: &str, found: &mut BTreeSet<String>) {
        for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set()) {
            let name = format!("{path}{}", verb.get_name());
            verbs(verb, &format!("{name} "), found);
            if !verb.is_subcommand_required_set() {
                found.insert(name);
            }
        }
    }

    #[test]
    fn every_verb_has_a_schema() {
        let mut grammar = BTreeSet::new();
        verbs(&Cli::command(), "", &mut grammar);
        let described: BTreeSet<String> = all().map(|(verb, _)| (*verb).to_owned()).collect();
        assert_eq!(grammar, described);
    }

    #[test]
    fn every_line_is_an_object() {
        for (verb, lines) in all() {
            let document = document(verb, lines);
            assert_eq!(document.any_of.len(), lines.len() + 1, "{verb}");
            for (name, schema) in &document.definitions {
                assert!(!schema.to_string().contains("\"additionalProperties\":false"), "{verb}: {name}");
            }
            for line in document.any_of {
                let name = line.get("$ref").and_then(Value::as_str).unwrap().rsplit('/').next().unwrap();
                let schema = &document.definitions[name];
                assert_eq!(schema["type"], "object", "{verb}: {schema}");
            }
        }
    }

    #[test]
    fn a_group_and_a_misspelt_verb_are_told_what_there_is() {
        assert!(unknown("traffic").hint.contains("traffic serve, traffic status"));
        assert_eq!(unknown("lst").hint, "did you mean list?");
    }
}
