//! A file and single settings, the later ones over the earlier ones; a key that means nothing is refused.

use super::file::ConfigFile;
use super::problem::ConfigProblem;
use toml::{Table, Value};

/// Collects settings, the later ones over the earlier ones.
#[derive(Debug, Clone, Default)]
pub struct SettingLayers(Table);

impl SettingLayers {
    /// Puts a file's settings on top.
    ///
    /// # Errors
    /// [`ConfigProblem::Syntax`] or [`ConfigProblem::UnknownKey`].
    pub fn file(&mut self, origin: &str, text: &str) -> Result<(), ConfigProblem> {
        let table: Table = text.parse().map_err(|error: toml::de::Error| ConfigProblem::Syntax {
            origin: origin.to_owned(),
            reason: error.to_string().trim_end().to_owned(),
        })?;
        refuse_unknown(origin, "", &table, &known_keys()?)?;
        merge(&mut self.0, table);
        Ok(())
    }

    /// Puts one setting on top: a dotted key and its value.
    ///
    /// # Errors
    /// [`ConfigProblem::UnknownKey`].
    pub fn set(&mut self, origin: &str, key: &str, value: Value) -> Result<(), ConfigProblem> {
        let nested = key
            .rsplit('.')
            .fold(value, |inner, part| Value::Table(Table::from_iter([(part.to_owned(), inner)])));
        let Value::Table(table) = nested else { return Ok(()) };
        refuse_unknown(origin, "", &table, &known_keys()?)?;
        merge(&mut self.0, table);
        Ok(())
    }

    /// Puts one setting on top as a command line gives it: what is not a number, a switch or quoted is
    /// text, and a section of the vehicle needs no `vehicle.` in front.
    ///
    /// # Errors
    /// [`ConfigProblem::UnknownKey`].
    pub fn set_text(&mut self, origin: &str, key: &str, value: &str) -> Result<(), ConfigProblem> {
        let value = value.parse().unwrap_or_else(|_| Value::String(value.to_owned()));
        let first = key.split('.').next().unwrap_or_default();
        let known = known_keys()?;
        let of_vehicle = known.get("vehicle").is_some_and(|vehicle| vehicle.get(first).is_some());
        if known.contains_key(first) || !of_vehicle {
            return self.set(origin, key, value);
        }
        self.set(origin, &format!("vehicle.{key}"), value)
    }

    /// The settings in force, checked.
    ///
    /// # Errors
    /// Every other [`ConfigProblem`].
    pub fn finish(self) -> Result<ConfigFile, ConfigProblem> {
        let file: ConfigFile =
            Value::Table(self.0).try_into().map_err(|error: toml::de::Error| ConfigProblem::Type {
                origin: "configuration".into(),
                reason: error.to_string().trim_end().to_owned(),
            })?;
        file.validate()?;
        Ok(file)
    }
}
fn known_keys() -> Result<Table, ConfigProblem> {
    Table::try_from(ConfigFile::default())
        .map_err(|error| ConfigProblem::Type { origin: "defaults".into(), reason: error.to_string() })
}

fn refuse_unknown(origin: &str, prefix: &str, given: &Table, known: &Table) -> Result<(), ConfigProblem> {
    for (key, value) in given {
        match (value, known.get(key)) {
            (_, None) => {
                return Err(ConfigProblem::UnknownKey {
                    origin: origin.to_owned(),
                    key: format!("{prefix}{key}"),
                    nearest: nearest(key, known).map(|near| format!("{prefix}{near}")),
                });
            }
            (Value::Table(given), Some(Value::Table(known))) => {
                refuse_unknown(origin, &format!("{prefix}{key}."), given, known)?;
            }
            _ => {}
        }
    }
    Ok(())
}

fn nearest<'a>(key: &str, known: &'a Table) -> Option<&'a String> {
    let likeness = |candidate: &&String| (strsim::jaro_winkler(key, candidate) * 1000.0) as u32;
    known.keys().max_by_key(likeness).filter(|best| likeness(best) >= 700)
}

fn merge(under: &mut Table, over: Table) {
    for (key, value) in over {
        match (under.get_mut(&key), value) {
            (Some(Value::Table(under)), Value::Table(over)) => merge(under, over),
            (_, value) => {
                under.insert(key, value);
            }
        }
    }
}
