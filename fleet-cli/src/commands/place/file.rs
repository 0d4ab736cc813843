//! Other places in a map's or a world's file: everything else in it stays, and it changes in one step.

use robot_agent::files;
use std::path::Path;
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, value};
use xtb_client::{Error, ErrorKind, Result};
use xtb_nav::map::ros;
use xtb_protocol::messages::{MapPlace, PlaceKind};
use xtb_sim::World;

/// Writes these places into the file.
///
/// # Errors
/// [`ErrorKind::Config`]: it cannot be read or has an unusual layout; [`ErrorKind::Failed`]: it cannot be written.
pub(super) fn write(path: &Path, places: &[MapPlace]) -> Result<()> {
    let broken = |reason: String| Error::new(ErrorKind::Config, format!("{}: {reason}", path.display()));
    let text = files::text(path, files::MAX_TEXT).map_err(|error| broken(error.to_string()))?;
    let is_world = path.extension().is_some_and(|ending| ending == "toml");
    let changed = if is_world {
        world(&text, places)
    } else {
        ros::with_places(&text, places).map_err(|e| e.to_string())
    };
    let changed = changed.map_err(broken)?;
    files::replace(path, changed.as_bytes()).map_err(|error| {
        Error::new(ErrorKind::Failed, format!("cannot write {}: {error}", path.display()))
            .hint("the file is as it was; its folder must be writable")
    })
}

/// A world's TOML with these places.
fn world(text: &str, places: &[MapPlace]) -> std::result::Result<String, String> {
    let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| error.to_string())?;
    if places.is_empty() {
        document.remove("places");
    } else {
        document["places"] = Item::ArrayOfTables(places.iter().map(table).collect::<ArrayOfTables>());
    }
    let changed = document.to_string();
    World::from_toml(&changed).map(|_| changed).map_err(|error| error.to_string())
}

fn table(place: &MapPlace) -> Table {
    let mut table = Table::new();
    table["name"] = value(place.name.as_str());
    if place.kind != PlaceKind::Place {
        table["kind"] = value(place.kind.as_str());
    }
    table["x_m"] = value(place.x_m);
    table["y_m"] = value(place.y_m);
    if let Some(yaw_rad) = place.yaw_rad {
        table["yaw_rad"] = value(yaw_rad);
    }
    if !place.tags.is_empty() {
        table["tags"] = value(place.tags.iter().map(|tag| tag.as_str()).collect::<Array>());
    }
    if !place.points.is_empty() {
        let corner = |corner: &[f64; 2]| corner.iter().copied().collect::<Array>();
        table["points"] = value(place.points.iter().map(corner).collect::<Array>());
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_world_keeps_its_comments_and_gets_the_places() {
        let text = "# the lab\n[room]\nwidth_m = 10.0 # along x\ndepth_m = 8.0\n\n[[starts]]\nx_m = 0.0\ny_m = 0.0\n\
                    yaw_rad = 0.0\n";
        let json = r#"{"name":"dock-1","kind":"dock","x_m":1.5,"y_m":2,"yaw_rad":1.5,"tags":["a"],"points":[[1,1],[3,1],[3,3],[1,3]]}"#;
        let dock: MapPlace = serde_json::from_str(json).unwrap();
        let with = world(text, std::slice::from_ref(&dock)).unwrap();
        assert!(with.starts_with(text), "{with}");
        assert_eq!(World::from_toml(&with).unwrap().places(), [dock]);
        assert_eq!(world(&with, &[]).unwrap(), text);
    }
}
