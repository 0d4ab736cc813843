//! The places of a map, checked: what the message's own limits cannot say.

use super::{MapError, canonical, polygon};
use crc::{CRC_64_XZ, Crc};
use xtb_protocol::messages::{FleetPlaces, MapHash, MapPlace, Message};

/// Whether these can be the places of one map.
///
/// # Errors
/// [`MapError::Places`].
pub fn check_places(places: &[MapPlace]) -> Result<(), MapError> {
    let message = FleetPlaces { map: MapHash::new(0), places: places.to_vec() };
    message.validate().map_err(|error| MapError::Places(error.to_string()))?;
    places.iter().filter(|place| !place.points.is_empty()).try_for_each(check_area)
}

/// A hash of places, in their order: whoever edits them says by it what it has seen.
#[must_use]
pub fn places_hash(places: &[MapPlace]) -> MapHash {
    const CRC: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);
    let mut digest = CRC.digest();
    let mut feed = |bytes: &[u8]| {
        digest.update(&(bytes.len() as u64).to_le_bytes());
        digest.update(bytes);
    };
    feed(b"xtb places 1");
    for place in places {
        feed(place.name.as_str().as_bytes());
        feed(place.kind.as_str().as_bytes());
        place.tags.iter().for_each(|tag| feed(tag.as_str().as_bytes()));
        let yaw = place.yaw_rad.map_or([1; 8], canonical);
        let numbers = [place.x_m, place.y_m].into_iter().chain(place.points.iter().flatten().copied());
        feed(&numbers.flat_map(canonical).chain(yaw).collect::<Vec<u8>>());
    }
    MapHash::new(digest.finalize())
}

fn check_area(place: &MapPlace) -> Result<(), MapError> {
    let refused = |reason: String| Err(MapError::Places(format!("place {}: {reason}", place.name)));
    if let Some((first, second)) = polygon::crossing(&place.points) {
        let (first, second) = (first + 1, second + 1);
        return refused(format!(
            "the side from point {first} and the side from point {second} cross or touch; list the corners in \
             order, each once"
        ));
    }
    if !polygon::holds(&place.points, [place.x_m, place.y_m]) {
        return refused(format!(
            "({}, {}) m, where robots are sent, is outside its area",
            place.x_m, place.y_m
        ));
    }
    Ok(())
}
