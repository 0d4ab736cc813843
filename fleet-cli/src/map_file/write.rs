//! Other zones and places in a map's or a world's file: everything else in it stays, and it changes in one step.

use robot_agent::files;
use std::path::Path;
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, value};
use xtb_client::{Error, ErrorKind, Result};
use xtb_nav::map::ros;
use xtb_nav::{Zone, ZoneKind};
use xtb_protocol::messages::{MapPlace, PlaceKind};
use xtb_sim::World;

/// Writes these places into the file, and these zones if any are given.
///
/// # Errors
/// [`ErrorKind::Config`]: it cannot be read or has an unusual layout; [`ErrorKind::Failed`]: it cannot be written.
pub(crate) fn write(path: &Path, zones: Option<&[Zone]>, places: &[MapPlace]) -> Result<()> {
    let broken = |reason: String| Error::new(ErrorKind::Config, format!("{}: {reason}", path.display()));
    let text = files::text(path, files::MAX_TEXT).map_err(|error| broken(error.to_string()))?;
    let is_world = path.extension().is_some_and(|ending| ending == "toml");
    let changed = if is_world { world(&text, zones, places) } else { yaml(&text, zones, places) };
    let changed = changed.map_err(broken)?;
    if changed == text {
        return Ok(());
    }
    let (bytes, most) = (changed.len(), files::MAX_TEXT);
    if bytes > most {
        return Err(broken(format!("it would have {bytes} bytes, and no more than {most} are read")));
    }
    files::replace(path, changed.as_bytes()).map_err(|error| {
        Error::new(ErrorKind::Failed, format!("cannot write {}: {error}", path.display()))
            .hint("the file is as it was; its folder must be writable")
    })
}

/// A map's YAML with these. What is the same already is not written anew.
fn yaml(text: &str, zones: Option<&[Zone]>, places: &[MapPlace]) -> std::result::Result<String, String> {
    let before = ros::Description::from_yaml(text).map_err(|error| error.to_string())?;
    let mut text = text.to_owned();
    if let Some(zones) = zones.filter(|zones| *zones != before.zones()) {
        text = ros::with_zones(&text, zones).map_err(|error| error.to_string())?;
    }
    if places != before.places() {
        text = ros::with_places(&text, places).map_err(|error| error.to_string())?;
    }
    Ok(text)
}

/// A world's TOML with these.
fn world(text: &str, zones: Option<&[Zone]>, places: &[MapPlace]) -> std::result::Result<String, String> {
    let before = World::from_toml(text).map_err(|error| error.to_string())?;
    let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| error.to_string())?;
    if let Some(zones) = zones.filter(|zones| *zones != before.zones()) {
        put(&mut document, "zones", zones.iter().map(zone).collect());
    }
    if places != before.places() {
        put(&mut document, "places", places.iter().map(table).collect());
    }
    let changed = document.to_string();
    World::from_toml(&changed).map(|_| changed).map_err(|error| error.to_string())
}

fn put(document: &mut DocumentMut, key: &str, tables: ArrayOfTables) {
    if tables.is_empty() {
        document.remove(key);
    } else {
        document[key] = Item::ArrayOfTables(tables);
    }
}

fn corners(points: &[[f64; 2]]) -> Item {
    value(points.iter().map(|corner| corner.iter().copied().collect::<Array>()).collect::<Array>())
}

fn zone(zone: &Zone) -> Table {
    let mut table = Table::new();
    table["name"] = value(zone.name());
    match zone.kind() {
        ZoneKind::KeepOut => table["kind"] = value("keep_out"),
        ZoneKind::OneWay { heading_rad } => {
            table["kind"] = value("one_way");
            table["heading_rad"] = value(heading_rad);
        }
    }
    table["points"] = corners(zone.points());
    table
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
        table["points"] = corners(&place.points);
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
        let with = world(text, None, std::slice::from_ref(&dock)).unwrap();
        assert!(with.starts_with(text), "{with}");
        assert_eq!(World::from_toml(&with).unwrap().places(), std::slice::from_ref(&dock));
        let points = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.5]];
        let lane = Zone::new("west lane", ZoneKind::OneWay { heading_rad: 1.25 }, points.clone()).unwrap();
        let zones = [lane, Zone::new("crane", ZoneKind::KeepOut, points).unwrap()];
        let both = world(&with, Some(&zones), std::slice::from_ref(&dock)).unwrap();
        assert!(both.starts_with(text), "{both}");
        let read = World::from_toml(&both).unwrap();
        assert_eq!((read.zones(), read.places()), (&zones[..], std::slice::from_ref(&dock)));
        assert_eq!(
            world(&both, None, std::slice::from_ref(&dock)).unwrap(),
            both,
            "unchanged as it was written"
        );
        assert_eq!(world(&both, Some(&[]), &[]).unwrap(), text);
    }
}
