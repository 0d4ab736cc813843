//! Maps as messages.

use crate::any;
use proptest::prelude::*;
use xtb_nav::map::wire::WireError;
use xtb_nav::{Grid, Map};
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{FleetMap, MAX_COORDINATE_M, MAX_MAP_CELLS, MapCell, MapHash, Message};

proptest! {
    #[test]
    fn a_map_comes_back_from_either_encoding(map in any::map()) {
        let message = FleetMap::from(&map);
        for format in [Format::Postcard, Format::Json] {
            let bytes = encode(&message, format).unwrap();
            let (again, _) = decode::<FleetMap>(&encoding::<FleetMap>(format), &bytes).unwrap();
            prop_assert_eq!(&Map::try_from(&again).unwrap(), &map);
        }
    }

    #[test]
    fn damaged_messages_are_refused_without_a_panic(
        map in any::map(), at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<prop::sample::Index>(),
    ) {
        let mut bytes = encode(&FleetMap::from(&map), Format::Postcard).unwrap();
        let i = at.index(bytes.len());
        prop_assume!(bytes[i] != byte);
        bytes[i] = byte;
        let postcard = encoding::<FleetMap>(Format::Postcard);
        let read = decode::<FleetMap>(&postcard, &bytes).ok().and_then(|(message, _)| Map::try_from(&message).ok());
        // The name is all that the hash does not cover (and -0 is 0).
        let same = |read: Map| read.hash() == map.hash();
        prop_assert!(read.is_none_or(same));
        bytes.truncate(cut.index(bytes.len()));
        prop_assert!(decode::<FleetMap>(&postcard, &bytes).is_err());
    }

    #[test]
    fn a_map_that_is_not_what_its_hash_says_is_refused(map in any::map(), x_m in -1000.0..1000.0_f64) {
        let mut message = FleetMap::from(&map);
        message.origin_m[0] = x_m;
        let refused = matches!(Map::try_from(&message), Err(WireError::Hash { .. }));
        prop_assert!(refused);
    }
}

/// Runs that are too many for `validate` are harmless here too.
#[test]
fn a_message_that_was_never_validated_cannot_fill_the_memory() {
    let mut message =
        FleetMap::from(&Map::new("m", Grid::free(0.05, [0.0; 2], 2, 2).unwrap(), vec![]).unwrap());
    message.cells = vec![(MapCell::Free, u32::MAX); 1000];
    assert!(message.validate().is_err());
    assert!(matches!(Map::try_from(&message), Err(WireError::Grid(_))));
    message.cells = vec![(MapCell::Free, 5)];
    assert!(matches!(Map::try_from(&message), Err(WireError::Grid(_))));
}

#[test]
fn the_wire_takes_what_a_grid_may_be() {
    assert_eq!(MAX_MAP_CELLS, Grid::MOST_CELLS as u64);
    for resolution_m in [*Grid::RESOLUTION_M.start(), *Grid::RESOLUTION_M.end()] {
        for origin_m in [-MAX_COORDINATE_M, MAX_COORDINATE_M] {
            let grid = Grid::free(resolution_m, [origin_m; 2], 3, 2).unwrap();
            let message = FleetMap::from(&Map::new("m", grid, vec![]).unwrap());
            message.validate().unwrap();
            assert!(
                FleetMap { resolution_m: resolution_m * 1.0001, ..message.clone() }.validate().is_err()
                    == (resolution_m == 1.0)
            );
        }
    }
    let hash = MapHash::new(0xab);
    assert_eq!("00000000000000ab".parse(), Ok(hash));
    assert_eq!(hash.to_string(), "00000000000000ab");
    for bad in ["ab", "00000000000000AB", "+0000000000000ab", ""] {
        assert!(bad.parse::<MapHash>().is_err(), "{bad}");
    }
}
