//! A vehicle file: a car's settings, and under `[truth]` in what a simulated one is otherwise.
//!
//! ```toml
//! drivetrain = "front_axle"       # what a robot's config has under [vehicle], without that prefix
//! [geometry]
//! wheelbase_m = 0.31
//! [truth.drive]                   # a section of TruckParameters: lag, dead band, …
//! lag_s = 0.3
//! [truth.encoder]
//! scale_tolerance = 0.03
//! ```
//! A simulated truck is what the settings say ([`TruckParameters::of`]), with these changes on top. A real one has no
//! use for `[truth]`.

use crate::parameters::TruckParameters;
use thiserror::Error;
use toml::{Table, Value};
use xtb_control::VehicleConfig;
use xtb_control::config::ConfigError;

/// What a vehicle file says.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleFile {
    /// For the agent.
    pub vehicle: VehicleConfig,
    /// For the simulated truck.
    pub truth: TruckParameters,
}

/// Why a text is no vehicle file.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum VehicleFileError {
    /// It is not TOML of this layout: what the parser says.
    #[error("{0}")]
    Layout(String),
    /// The same of its `[truth]`.
    #[error("truth: {0}")]
    TruthLayout(String),
    /// A setting that is not allowed.
    #[error(transparent)]
    Vehicle(#[from] ConfigError),
    /// A true value that is not allowed.
    #[error("truth.{0}")]
    Truth(ConfigError),
}

impl From<VehicleConfig> for VehicleFile {
    /// A truck that is what the settings say.
    fn from(vehicle: VehicleConfig) -> Self {
        Self { truth: TruckParameters::of(&vehicle), vehicle }
    }
}

impl Default for VehicleFile {
    fn default() -> Self {
        VehicleConfig::default().into()
    }
}

impl VehicleFile {
    /// Reads and checks one; what it does not say is as on an XTB.
    ///
    /// # Errors
    /// No TOML of this layout, or a value that is not allowed, by its name.
    pub fn from_toml(text: &str) -> Result<Self, VehicleFileError> {
        let layout = |error: toml::de::Error| VehicleFileError::Layout(error.message().to_owned());
        let mut table: Table = toml::from_str(text).map_err(layout)?;
        let changes = table.remove("truth");
        let vehicle: VehicleConfig = Value::Table(table).try_into().map_err(layout)?;
        vehicle.validate()?;
        let mut file = Self::from(vehicle);
        if let Some(changes) = changes {
            file.truth = changed(&file.truth, changes)?;
        }
        file.truth.validate().map_err(VehicleFileError::Truth)?;
        Ok(file)
    }
}

/// The parameters with these changes.
fn changed(truth: &TruckParameters, changes: Value) -> Result<TruckParameters, VehicleFileError> {
    let layout = |message: &str| VehicleFileError::TruthLayout(message.to_owned());
    let Value::Table(changes) = changes else { return Err(layout("it must be a table")) };
    let mut all = Table::try_from(truth).map_err(|error| layout(&error.to_string()))?;
    for (section, change) in changes {
        match (all.get_mut(&section), change) {
            (Some(Value::Table(values)), Value::Table(change)) => values.extend(change),
            _ => return Err(layout(&format!("there is no section `{section}`"))),
        }
    }
    Value::Table(all).try_into().map_err(|error: toml::de::Error| layout(error.message()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::vehicle::Drivetrain;

    #[test]
    fn the_truck_is_what_the_settings_say_but_for_what_truth_says() {
        let text = "drivetrain = \"front_axle\"\n[geometry]\nwheelbase_m = 0.3\n[truth.drive]\nlag_s = 0.4\n\
                    [truth.body]\nwheelbase_m = 0.31\n[truth.receiver]\nfitted = false";
        let file = VehicleFile::from_toml(text).unwrap();
        assert_eq!(
            (file.vehicle.drivetrain, file.vehicle.geometry.wheelbase_m),
            (Drivetrain::FrontAxle, 0.3)
        );
        let truth = &file.truth;
        assert_eq!((truth.body.drivetrain, truth.body.wheelbase_m), (Drivetrain::FrontAxle, 0.31));
        assert!(truth.drive.lag_s == 0.4 && !truth.receiver.fitted && truth.body.length_m == 0.5);
        assert_eq!(VehicleFile::from_toml("").unwrap(), VehicleFile::default());
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, words) in [
            ("[truth.drive]\nlag = 0.4", "truth: unknown field `lag`"),
            ("[truth.engine]\nlag_s = 0.4", "truth: there is no section `engine`"),
            ("truth = 3", "truth: it must be a table"),
            ("[truth.drive]\nlag_s = 9.0", "truth.drive.lag_s = 9.0 is not allowed: 0.01..=5 s"),
            ("[geometry]\nwheels = 6", "unknown field `wheels`"),
            (
                "[geometry]\nwheelbase_m = 0.6",
                "geometry.wheelbase_m = 0.6 is not allowed: it must not be more than",
            ),
        ] {
            let error = VehicleFile::from_toml(text).unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
        }
    }
}
