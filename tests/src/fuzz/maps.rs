//! Maps: as a message to the fleet, and as the files of ROS's map_server.

use super::messages::message;
use xtb_nav::Map;
use xtb_nav::map::ros::{Description, Files, RosError};
use xtb_nav::map::wire::WireError;
use xtb_protocol::messages::{FleetMap, MAX_MAP_CELLS, Message};

/// Between the YAML and its image, in one input.
pub(super) const IMAGE: &[u8] = b"\n%image\n";
/// A refusal is for a person: part of what is refused, not all of it.
const MAX_REFUSAL: usize = 1024;

/// The fleet's map. What is read as a message is a map, or is not and says why; with the hash of what it
/// holds it would be one.
#[must_use]
pub fn fleet_map(bytes: &[u8]) -> bool {
    message(bytes, |sent: &FleetMap| {
        match Map::try_from(sent) {
            Ok(map) => goes_over_the_wire(&map),
            Err(WireError::Hash { found, .. }) => {
                let map = Map::try_from(&FleetMap { hash: found, ..sent.clone() });
                goes_over_the_wire(&map.unwrap_or_else(|error| panic!("{error}")));
            }
            Err(error) => is_said(&error.to_string()),
        }
        u64::from(sent.width) * u64::from(sent.height) <= MAX_MAP_CELLS
    })
}

fn goes_over_the_wire(map: &Map) {
    let message = FleetMap::from(map);
    assert!(message.validate().is_ok(), "{:?}", message.validate());
    let again = Map::try_from(&message).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((again.hash(), again.name()), (map.hash(), map.name()));
}

/// A YAML text and its image: a map that is written again as the same one, or the part that is wrong.
#[must_use]
pub fn ros_map(bytes: &[u8]) -> bool {
    let at = bytes.windows(IMAGE.len()).position(|window| window == IMAGE);
    let (yaml, image) = at.map_or((bytes, &[][..]), |at| (&bytes[..at], &bytes[at + IMAGE.len()..]));
    let Ok(yaml) = std::str::from_utf8(yaml) else { return false };
    let map = match read(yaml, image) {
        Ok(map) => map,
        Err(error) => {
            is_said(&error.to_string());
            return false;
        }
    };
    let files = Files::of(&map, "map.pgm").unwrap_or_else(|error| panic!("{error}"));
    let again = read(&files.yaml, &files.image).unwrap_or_else(|error| panic!("{error}:\n{}", files.yaml));
    assert_eq!(again, map, "{}", files.yaml);
    goes_over_the_wire(&map);
    true
}

fn read(yaml: &str, image: &[u8]) -> Result<Map, RosError> {
    Description::from_yaml(yaml)?.map("file", image)
}

fn is_said(words: &str) {
    assert!(!words.is_empty() && words.len() <= MAX_REFUSAL, "{} bytes: {words}", words.len());
}
