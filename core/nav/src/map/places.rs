//! The places of a map, checked: what the message's own limits cannot say.

use super::{MapError, polygon};
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
