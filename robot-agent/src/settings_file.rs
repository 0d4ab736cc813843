//! The robot's own settings file, changed: comments, order and everything else stay.
//!
//! The new text is checked as a whole before the file is touched, and takes its place in one step: a
//! power cut leaves the old file or the new one.

use crate::config::{ConfigProblem, SettingLayers};
use crate::files;
use std::fmt;
use std::io;
use std::path::Path;
use thiserror::Error;
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

/// What a file that is new begins with.
pub const HEAD: &str = "# Settings of robot-agent; robot-agent --print-config shows all of them.\n";

/// Why nothing was written.
#[derive(Debug, Error)]
pub enum SettingsFileError {
    /// The file cannot be read or replaced.
    #[error("cannot write {path}: {error}")]
    File {
        /// The file.
        path: String,
        /// Why.
        error: io::Error,
    },
    /// What is in it is no settings file.
    #[error("{path}: {reason}")]
    Syntax {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
    /// With the changes it would not be valid.
    #[error("{0}")]
    Invalid(#[from] ConfigProblem),
}

/// A number that is to stand in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingChange {
    /// Sections and key.
    path: Vec<String>,
    value: f64,
}

impl SettingChange {
    /// Of a setting such as `navigation.drive.limit_mps`.
    #[must_use]
    pub fn new(name: &str, value: f64) -> Self {
        Self { path: name.split('.').map(str::to_owned).collect(), value }
    }
}

/// As a person would write it.
impl fmt::Display for SettingChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {:?}", self.path.join("."), self.value)
    }
}

/// Writes the changes into the file, which is made if it is missing.
///
/// # Errors
/// See [`SettingsFileError`]; the file is as it was then.
pub fn write(path: &Path, changes: &[SettingChange]) -> Result<(), SettingsFileError> {
    let name = path.display().to_string();
    let failed = |error: io::Error| SettingsFileError::File { path: name.clone(), error };
    let old = match files::text(path, files::MAX_TEXT) {
        Ok(text) => text,
        Err(error) if error.is_missing() => HEAD.to_owned(),
        Err(error) => return Err(failed(error.into())),
    };
    let new =
        changed(&old, changes).map_err(|reason| SettingsFileError::Syntax { path: name.clone(), reason })?;
    let mut layers = SettingLayers::default();
    layers.file(&name, &new)?;
    layers.finish()?;
    files::replace(path, new.as_bytes()).map_err(failed)
}

/// The text with the changes in it.
fn changed(text: &str, changes: &[SettingChange]) -> Result<String, String> {
    let mut document: DocumentMut =
        text.parse().map_err(|error: toml_edit::TomlError| error.to_string().trim_end().to_owned())?;
    // Comments of a file that holds nothing else belong above what comes in.
    let comments = document.is_empty().then(|| document.trailing().as_str().unwrap_or_default().to_owned());
    for SettingChange { path, value } in changes {
        let Some((key, sections)) = path.split_last() else { continue };
        let mut section: &mut dyn TableLike = document.as_table_mut();
        for (depth, name) in sections.iter().enumerate() {
            section = table_in(section, name, depth + 1 < sections.len())?;
        }
        match section.get_mut(key).and_then(Item::as_value_mut) {
            Some(old) => {
                let decor = old.decor().clone();
                *old = Value::from(*value);
                *old.decor_mut() = decor;
            }
            None => {
                section.insert(key, toml_edit::value(*value));
            }
        }
    }
    let Some(comments) = comments else { return Ok(document.to_string()) };
    document.set_trailing("");
    Ok(format!("{comments}{document}"))
}

/// The table of this name, made if it is missing; without a heading of its own if it only holds others.
fn table_in<'a>(
    parent: &'a mut dyn TableLike,
    name: &str,
    only_holds_others: bool,
) -> Result<&'a mut dyn TableLike, String> {
    if parent.get(name).is_none() {
        let mut table = Table::new();
        table.set_implicit(only_holds_others);
        parent.insert(name, Item::Table(table));
    }
    let table = parent.get_mut(name).and_then(Item::as_table_like_mut);
    table.ok_or_else(|| format!("{name} is not a section"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn slope(value: f64) -> Vec<SettingChange> {
        vec![
            SettingChange::new("vehicle.calibration.bumper_front_slope", value),
            SettingChange::new("vehicle.calibration.bumper_front_intercept", -135.25),
        ]
    }

    #[test]
    fn comments_order_and_everything_else_stay() {
        let old = "\
# My truck.
[vehicle.calibration]
bumper_rear_slope = 0.036
bumper_front_slope = 0.036 # guessed

[agent]
name = \"red\"

[vehicle.goto]
reference_rpm = 10.0
";
        let new = changed(old, &slope(0.0355)).unwrap();
        let expected = old.replace(
            "bumper_front_slope = 0.036 # guessed\n",
            "bumper_front_slope = 0.0355 # guessed\nbumper_front_intercept = -135.25\n",
        );
        assert_eq!(new, expected);
    }

    #[test]
    fn sections_are_made_where_they_are_missing_in_whatever_form_the_file_has() {
        let made = changed(HEAD, &slope(0.0355)).unwrap();
        assert_eq!(made, format!("{HEAD}\n[vehicle.calibration]\nbumper_front_slope = 0.0355\nbumper_front_intercept = -135.25\n").replace("\n\n", "\n"), "{made}");
        for old in [
            "vehicle = { goto = { reference_rpm = 10.0 } }\n",
            "vehicle.goto.reference_rpm = 10.0\n",
            "[vehicle]\nplatform = \"off\"\n",
            "[vehicle.goto]\nreference_rpm = 10.0\n[agent]\nname = \"red\"\n",
            "",
        ] {
            let new = changed(old, &slope(0.0355)).unwrap();
            let read: toml::Table = new.parse().unwrap();
            let value = read["vehicle"]["calibration"]["bumper_front_slope"].as_float();
            assert_eq!(value, Some(0.0355), "{new}");
            assert!(
                new.starts_with(old.lines().next().unwrap_or_default().split('{').next().unwrap()),
                "{new}"
            );
        }
        assert!(changed("vehicle = 3\n", &slope(1.0)).unwrap_err().contains("vehicle is not a section"));
        assert!(changed("vehicle = \n", &slope(1.0)).is_err());
    }

    #[test]
    fn a_file_is_replaced_whole_or_not_at_all() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.toml");
        write(&path, &slope(0.0355)).unwrap();
        let first = fs::read_to_string(&path).unwrap();
        assert!(first.starts_with(HEAD), "{first}");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        let link = folder.path().join("link.toml");
        std::os::unix::fs::symlink(&path, &link).unwrap();

        let error = write(&link, &slope(5.0)).unwrap_err().to_string();
        assert!(error.contains("calibration.bumper_front_slope = 5.0"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), first, "an invalid file is never written");

        write(&link, &slope(0.037)).unwrap();
        assert!(fs::read_to_string(&path).unwrap().contains("bumper_front_slope = 0.037\n"));
        assert!(link.is_symlink(), "the link stays");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "nothing is left over");
        assert!(write(&folder.path().join("missing/robot.toml"), &slope(0.036)).is_err());
    }
}
