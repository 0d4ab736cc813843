//! Recordings as tables: a message becomes a row, its fields become columns. Pure.
//!
//! Columns come from the type's schema, so they are the same for every recording: `log_ns` and `topic`,
//! then the fields in alphabetical order, a field of a field behind a dot (`pose.x_m`), short rows of numbers
//! by their place (`ir_front.0`). Lists and what goes by names stand in one cell as JSON. Quoting is
//! RFC 4180's; null is an empty cell. A text that a spreadsheet would take for a formula has an apostrophe before it.

use crate::schema::Schema;
use serde_json::Value;
use std::collections::BTreeSet;

/// Longest row of numbers that gets columns of its own.
const MOST_PLACES: u64 = 16;

/// A table of one type of message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MessageTable {
    columns: Vec<String>,
}

impl MessageTable {
    /// The table of messages of this schema.
    #[must_use]
    pub fn of(schema: &Schema) -> Self {
        let mut columns = BTreeSet::new();
        if let Ok(schema) = serde_json::from_slice(&schema.text) {
            columns_of(&schema, "", &mut columns);
        }
        Self { columns: columns.into_iter().collect() }
    }

    /// Its first line.
    #[must_use]
    pub fn header(&self) -> String {
        let named = ["log_ns", "topic"].into_iter().chain(self.columns.iter().map(String::as_str));
        line(named.map(str::to_owned))
    }

    /// A message's line.
    #[must_use]
    pub fn row(&self, log_ns: u64, topic: &str, message: &Value) -> String {
        let cells = self.columns.iter().map(|column| cell(find(message, column)));
        line([log_ns.to_string(), text_cell(topic)].into_iter().chain(cells))
    }
}

fn line(cells: impl Iterator<Item = String>) -> String {
    let cells: Vec<String> = cells.map(|cell| quoted(&cell)).collect();
    format!("{}\r\n", cells.join(","))
}

/// As RFC 4180 has it.
fn quoted(cell: &str) -> String {
    if cell.contains(['"', ',', '\r', '\n']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

fn cell(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => text_cell(text),
        Some(other) => other.to_string(),
    }
}

/// Words of others, never a formula: a spreadsheet computes what begins so, and can fetch a page with what it finds.
fn text_cell(text: &str) -> String {
    if text.starts_with(['=', '+', '-', '@', '\t', '\r']) { format!("'{text}") } else { text.to_owned() }
}

/// What stands at a column's place; an object never does, its fields have columns.
fn find<'a>(message: &'a Value, column: &str) -> Option<&'a Value> {
    column.split('.').try_fold(message, |value, part| match value {
        Value::Array(places) => places.get(part.parse::<usize>().ok()?),
        value => value.get(part),
    })
}

/// Names of the columns that values of this schema need.
fn columns_of(schema: &Value, path: &str, columns: &mut BTreeSet<String>) {
    let list = |name: &str| schema.get(name).and_then(Value::as_array).into_iter().flatten();
    let mut inner = false;
    for part in list("anyOf").chain(list("oneOf")).chain(list("allOf")) {
        inner = true;
        columns_of(part, path, columns);
    }
    for (name, field) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
        inner = true;
        let field_path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        columns_of(field, &field_path, columns);
    }
    if let Some(places) = places(schema) {
        columns.extend((0..places).map(|place| format!("{path}.{place}")));
        return;
    }
    let is_null = schema.get("type").and_then(Value::as_str) == Some("null");
    if !inner && !is_null && !path.is_empty() {
        columns.insert(path.to_owned());
    }
}

/// How long a row of numbers is at most.
fn places(schema: &Value) -> Option<u64> {
    let places = schema.get("maxItems").and_then(Value::as_u64)?;
    let mut items: Vec<&Value> = schema.get("items").filter(|it| it.is_object()).into_iter().collect();
    items.extend(schema.get("prefixItems").and_then(Value::as_array).into_iter().flatten());
    let number = |item: &&Value| {
        let kinds = item.get("type").map(ToString::to_string).unwrap_or_default();
        kinds.contains("number") || kinds.contains("integer")
    };
    (places <= MOST_PLACES && !items.is_empty() && items.iter().all(number)).then_some(places)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fleet::schemas;
    use serde_json::json;

    fn table(name: &str) -> MessageTable {
        MessageTable::of(schemas::of(name).unwrap())
    }

    fn value_of(table: &MessageTable, row: &str, column: &str) -> String {
        let header = table.header();
        let place = header.trim_end().split(',').position(|name| name == column);
        let place = place.unwrap_or_else(|| panic!("no {column} in {header}"));
        row.trim_end().split(',').nth(place).unwrap().to_owned()
    }

    #[test]
    fn a_state_has_a_column_for_each_field_whatever_is_null_in_it() {
        let table = table("xtb.RobotState");
        let state = serde_json::to_value(xtb_client::fake::state("xtb-1")).unwrap();
        let row = table.row(17, "xtb/lab/xtb-1/state", &state);
        for (column, value) in [
            ("log_ns", "17"),
            ("topic", "xtb/lab/xtb-1/state"),
            ("robot", "xtb-1"),
            ("pose.source", "odometry"),
            ("battery_v", "7.4"),
            ("obstacle.front", "false"),
            ("goal.x_m", ""),
            ("goal.status", ""),
            ("lease.holder", ""),
            ("nav.route.release_m", ""),
            ("nav.route.blocked_at_m.1", ""),
            ("rejected.stale", "0"),
        ] {
            assert_eq!(value_of(&table, &row, column), value, "{column}");
        }
        assert!(!table.header().contains(",goal,"), "{}", table.header());
    }

    #[test]
    fn rows_of_numbers_have_a_column_for_each_place() {
        let table = table("xtb.Sensors");
        let row = table.row(
            0,
            "t",
            &json!({"ir_front_cm": [null, 12.5, null, 30, 1, 2], "tilt": [5, 6], "rpm": -3.5}),
        );
        let places = [0, 1, 5, 7].map(|n| value_of(&table, &row, &format!("ir_front_cm.{n}")));
        assert_eq!(places, ["", "12.5", "2", ""]);
        assert_eq!(value_of(&table, &row, "tilt.1"), "6");
        assert_eq!(value_of(&table, &row, "rpm"), "-3.5");
    }

    #[test]
    fn an_event_has_the_columns_of_every_kind() {
        let table = table("xtb.Event");
        let row = table.row(0, "t", &json!({"kind": {"goal": {"status": "reached", "reason": null}}}));
        assert_eq!(value_of(&table, &row, "kind.goal.status"), "reached");
        assert_eq!(value_of(&table, &row, "kind.fault.present"), "");
    }

    #[test]
    fn a_text_that_begins_like_a_formula_is_kept_a_text() {
        for formula in ["=1+2", "+1", "-1", "@sum", "\t=1", "\r=1"] {
            assert_eq!(cell(Some(&json!(formula))), format!("'{formula}"));
        }
        for plain in ["xtb-1", "a=b", "'=1", ""] {
            assert_eq!(cell(Some(&json!(plain))), plain);
        }
        assert_eq!(cell(Some(&json!(-3.5))), "-3.5", "a number");
        let table = table("xtb.RobotState");
        let mut state = serde_json::to_value(xtb_client::fake::state("xtb-1")).unwrap();
        state["robot"] = json!("=1+2");
        let row = table.row(17, "=topic", &state);
        assert_eq!(value_of(&table, &row, "robot"), "'=1+2");
        assert_eq!(value_of(&table, &row, "topic"), "'=topic");
    }

    #[test]
    fn quoting_is_that_of_rfc_4180() {
        assert_eq!(quoted("plain text"), "plain text");
        assert_eq!(quoted("a,b"), "\"a,b\"");
        assert_eq!(quoted("say \"no\"\r\n"), "\"say \"\"no\"\"\r\n\"");
        assert_eq!(cell(Some(&json!(["no_command"]))), "[\"no_command\"]");
    }
}
