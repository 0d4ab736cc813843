//! Puts a calibration into a configuration file: comments, order and everything else stay.
//!
//! The new text is checked as a whole before the file is touched, and takes its place in one step: a
//! power cut leaves the old file or the new one.

use robot_agent::config::{ConfigProblem, Layers};
use robot_agent::files;
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use thiserror::Error;
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};
use xtb_control::calibration::{Actuator, Fit, Kind};

/// Digits that are written: more than any protractor gives.
const DIGITS: i32 = 7;
/// What a file that is new begins with.
const HEAD: &str = "# Settings of robot-agent; robot-agent --print-config shows all of them.\n";

/// Why nothing was written.
#[derive(Debug, Error)]
pub(crate) enum WriteError {
    #[error("cannot write {path}: {error}")]
    File { path: String, error: io::Error },
    #[error("{path}: {reason}")]
    Syntax { path: String, reason: String },
    #[error("{0}")]
    Invalid(#[from] ConfigProblem),
}

/// A setting of the vehicle: section, key and value.
pub(crate) type Change = (&'static str, String, f64);

/// What a fit changes, rounded as it will be written. A steering's centre goes with its line.
pub(crate) fn changes(what: Actuator, fit: &Fit) -> Vec<Change> {
    let key = what.name().replace('-', "_");
    let mut changes = vec![
        ("calibration", format!("{key}_slope"), rounded(fit.line.slope)),
        ("calibration", format!("{key}_intercept"), rounded(fit.line.intercept)),
    ];
    if let Kind::Steering(axle) = what.kind() {
        let key = ["front_centre", "rear_centre"][axle].to_owned();
        changes.push(("steering", key, (fit.zero_count * 10.0).round() / 10.0));
    }
    changes
}

/// To seven significant digits.
fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let places = DIGITS - 1 - value.abs().log10().floor() as i32;
    // By way of the decimal text, which is what will stand in the file.
    format!("{value:.*}", places.clamp(0, 15) as usize).parse().unwrap_or(value)
}

/// Writes the changes into the file, which is made if it is missing.
pub(crate) fn write(path: &Path, changes: &[Change]) -> Result<(), WriteError> {
    let name = path.display().to_string();
    let failed = |error: io::Error| WriteError::File { path: name.clone(), error };
    let old = match files::text(path, files::MAX_TEXT) {
        Ok(text) => text,
        Err(error) if error.is_missing() => HEAD.to_owned(),
        Err(error) => return Err(failed(error.into())),
    };
    let new = changed(&old, changes).map_err(|reason| WriteError::Syntax { path: name.clone(), reason })?;
    let mut layers = Layers::default();
    layers.file(&name, &new)?;
    layers.finish()?;
    replace(path, &new).map_err(failed)
}

/// The text with the changes in it.
fn changed(text: &str, changes: &[Change]) -> Result<String, String> {
    let mut document: DocumentMut =
        text.parse().map_err(|error: toml_edit::TomlError| error.to_string().trim_end().to_owned())?;
    // Comments of a file that holds nothing else belong above what comes in.
    let comments = document.is_empty().then(|| document.trailing().as_str().unwrap_or_default().to_owned());
    for (section, key, value) in changes {
        let vehicle = table_in(document.as_table_mut(), "vehicle", true)?;
        let section = table_in(vehicle, section, false)?;
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

/// Writes beside the file, then takes its name; a link stays one, and the file's rights stay.
pub(crate) fn replace(path: &Path, text: &str) -> io::Result<()> {
    let path = match path.canonicalize() {
        Ok(real) => real,
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_owned(),
        Err(error) => return Err(error),
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let rights = fs::metadata(&path).map(|file| file.permissions()).ok();
    let mut file = tempfile::Builder::new().prefix(".calibration-").tempfile_in(folder)?;
    file.write_all(text.as_bytes())?;
    match rights {
        Some(rights) => file.as_file().set_permissions(rights)?,
        None => file.as_file().set_permissions(readable())?,
    }
    file.as_file().sync_all()?;
    file.persist(&path).map(drop).map_err(|error| error.error)
}

/// Everybody may read it, its owner may write it.
fn readable() -> fs::Permissions {
    use std::os::unix::fs::PermissionsExt;
    fs::Permissions::from_mode(0o644)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slope(value: f64) -> Vec<Change> {
        vec![
            ("calibration", "bumper_front_slope".to_owned(), value),
            ("calibration", "bumper_front_intercept".to_owned(), -135.25),
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

    #[test]
    fn values_are_rounded_to_what_is_known() {
        assert_eq!(rounded(-0.020512820512), -0.02051282);
        assert_eq!(rounded(76.102564102564), 76.10256);
        assert_eq!(rounded(5.0123456789e-5), 5.012346e-5);
        assert_eq!((rounded(0.0), rounded(123_456_789.4)), (0.0, 123_456_789.0));
    }
}
