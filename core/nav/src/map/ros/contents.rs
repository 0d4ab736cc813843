//! Other zones and places in a map's YAML, whose other lines stay as people wrote them.

use super::{Description, RosError, WrittenPlace, WrittenZone};
use crate::map::{Zone, check_places};
use serde::Serialize;
use xtb_protocol::messages::MapPlace;

#[derive(Serialize)]
struct WrittenPlaces<'a> {
    places: Vec<WrittenPlace<'a>>,
}

#[derive(Serialize)]
struct WrittenZones<'a> {
    zones: Vec<WrittenZone<'a>>,
}

/// A YAML with these zones instead of those that it had, at its end; comments within its former list are lost.
///
/// # Errors
/// [`RosError`] if `yaml` is no map, or not laid out in lines.
pub fn with_zones(yaml: &str, zones: &[Zone]) -> Result<String, RosError> {
    let before = Description::from_yaml(yaml)?;
    let written = WrittenZones { zones: zones.iter().map(WrittenZone::from).collect() };
    let list = (!zones.is_empty()).then_some(&written);
    replaced(yaml, "zones", list, &Description { zones: zones.to_vec(), ..before })
}

/// A YAML with these places instead of those that it had, at its end; comments within its former list are lost.
///
/// # Errors
/// [`RosError::Map`] for impossible places; else [`RosError`] if `yaml` is no map, or not laid out in lines.
pub fn with_places(yaml: &str, places: &[MapPlace]) -> Result<String, RosError> {
    check_places(places)?;
    let before = Description::from_yaml(yaml)?;
    let written = WrittenPlaces { places: places.iter().map(WrittenPlace::from).collect() };
    let list = (!places.is_empty()).then_some(&written);
    replaced(yaml, "places", list, &Description { places: places.to_vec(), ..before })
}

/// The YAML with this list for a key, if it then says what it shall.
fn replaced(
    yaml: &str,
    key: &'static str,
    list: Option<&impl Serialize>,
    shall: &Description,
) -> Result<String, RosError> {
    let mut text = without(yaml, key);
    if let Some(list) = list {
        text.push_str(&serde_saphyr::to_string(list).map_err(|error| RosError::Yaml(error.to_string()))?);
    }
    let unusual =
        || RosError::Key { key, reason: "cannot be replaced in this layout; edit it by hand".into() };
    if Description::from_yaml(&text).as_ref() == Ok(shall) { Ok(text) } else { Err(unusual()) }
}

/// All lines but the key and its list.
fn without(yaml: &str, key: &str) -> String {
    let mut within = false;
    let kept = yaml.lines().filter(|line| {
        let is_key = line.starts_with(|c: char| !matches!(c, ' ' | '\t' | '-' | '#')) && !line.is_empty();
        if is_key {
            within = line.strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with(':'));
        }
        !within
    });
    kept.flat_map(|line| [line, "\n"]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "image: lab.pgm\nresolution: 0.05  # m\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n\
                       free_thresh: 0.196\n";
    const ZONES: &str = "zones:\n- name: chargers\n  kind: keep_out\n  points: [[0, 0], [1, 0], [1, 1]]\n";

    fn place(json: &str) -> MapPlace {
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn other_lines_stay_and_the_list_is_replaced() {
        let dock =
            place(r#"{"name":"dock-1","kind":"dock","x_m":1.5,"y_m":2,"yaw_rad":1.5,"tags":["north"]}"#);
        let hall = place(r#"{"name":"hall","x_m":0.5,"y_m":0.5,"points":[[0,0],[1,0],[1,1],[0,1]]}"#);
        let one = with_places(MAP, std::slice::from_ref(&dock)).unwrap();
        assert!(one.starts_with(MAP), "{one}");
        let between = one.replace("places:", "# where we charge\nplaces:") + ZONES;
        let two = with_places(&between, &[dock, hall.clone()]).unwrap();
        assert!(two.contains("# where we charge") && two.contains(ZONES), "{two}");
        assert_eq!(Description::from_yaml(&two).unwrap().places[1], hall);
        let none = with_places(&two, &[]).unwrap();
        assert_eq!(none, format!("{MAP}# where we charge\n{ZONES}"));
    }

    #[test]
    fn zones_are_replaced_beside_the_places() {
        use crate::map::ZoneKind;
        let dock = place(r#"{"name":"dock-1","x_m":1.5,"y_m":2}"#);
        let both = with_places(&format!("{MAP}{ZONES}"), std::slice::from_ref(&dock)).unwrap();
        let kind = ZoneKind::OneWay { heading_rad: 1.5 };
        let lane = Zone::new("west lane", kind, vec![[0.0, 0.0], [1.0, 0.0], [1.0, 2.5]]).unwrap();
        let changed = with_zones(&both, std::slice::from_ref(&lane)).unwrap();
        let read = Description::from_yaml(&changed).unwrap();
        assert_eq!((read.zones.as_slice(), read.places.as_slice()), (&[lane][..], &[dock][..]));
        assert!(changed.starts_with(MAP) && !changed.contains("chargers"), "{changed}");
        assert!(!with_zones(&changed, &[]).unwrap().contains("zones"));
    }

    #[test]
    fn impossible_places_and_unusual_layouts_are_refused() {
        let twice = [place(r#"{"name":"a","x_m":0,"y_m":0}"#), place(r#"{"name":"a","x_m":1,"y_m":0}"#)];
        assert!(with_places(MAP, &twice).unwrap_err().to_string().contains("two places have the name a"));
        let outside = place(r#"{"name":"a","x_m":9,"y_m":0,"points":[[0,0],[1,0],[1,1]]}"#);
        assert!(with_places(MAP, &[outside]).unwrap_err().to_string().contains("outside its area"));
        for name in ["2", "inf", "Dock", "-a", "all\n"] {
            let json = serde_json::json!({ "name": name, "x_m": 0, "y_m": 0 });
            let refused = match serde_json::from_value::<MapPlace>(json) {
                Ok(place) => with_places(MAP, &[place]).is_err(),
                Err(_) => true,
            };
            assert!(refused, "{name:?}");
        }
        let flow = format!(
            "{{{}, places: [{{name: b, x_m: 1, y_m: 1}}]}}",
            MAP.replace("  # m", "").trim().replace('\n', ", ")
        );
        assert!(with_places(&flow, &twice[..1]).unwrap_err().to_string().contains("edit it by hand"));
    }
}
