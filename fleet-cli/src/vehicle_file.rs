//! Vehicle settings in a file of their own: what a robot's config has under `[vehicle]`, without that prefix, and in
//! what a simulated truck is otherwise (`[truth]`).

use robot_agent::files;
use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};
use xtb_sim::VehicleFile;

/// Reads and checks one; what it does not say is as on an XTB.
///
/// # Errors
/// [`ErrorKind::Config`]: no such file, no such setting, or one that is impossible.
pub fn read(path: &Path) -> Result<VehicleFile> {
    let invalid = |reason: &dyn std::fmt::Display| {
        Error::new(ErrorKind::Config, format!("{}: {reason}", path.display())).hint(
            "the settings are listed under [vehicle] in `robot-agent --print-config`: [geometry], \
                   [steering], …",
        )
    };
    let text = files::text(path, files::MAX_TEXT).map_err(|error| invalid(&error))?;
    VehicleFile::from_toml(&text).map_err(|error| invalid(&error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vehicles_of_this_repository_can_be_driven() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/vehicles");
        let length_m = |name: &str| read(&folder.join(name)).unwrap().vehicle.geometry.body_length_m;
        assert_eq!(read(&folder.join("xtb.toml")).unwrap(), VehicleFile::default());
        assert_eq!(length_m("half-wheelbase.toml"), 0.5);
        assert_eq!(length_m("long.toml"), 0.75);
        assert_eq!((length_m("crawler.toml"), length_m("small.toml")), (0.43, 0.27));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 5, "each is named here");
    }

    #[test]
    fn a_file_that_is_no_vehicle_says_where() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("odd.toml");
        for (text, word) in [
            ("[geometry]\nwheelbase_m = 9.0\n", "geometry.wheelbase_m"),
            ("[geometry]\nwheels = 6\n", "wheels"),
            ("[vehicle.geometry]\n", "vehicle"),
        ] {
            std::fs::write(&path, text).unwrap();
            let failure = read(&path).unwrap_err();
            assert!(failure.kind == ErrorKind::Config && failure.message.contains(word), "{failure:?}");
        }
    }
}
