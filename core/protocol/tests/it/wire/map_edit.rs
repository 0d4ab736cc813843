//! The bytes of an edit of the map, its answer and the map's history in version 1. This file is never edited to pass:
//! bytes that change need a new version of their type, and a file of their own.

use super::pinned;
use xtb_protocol::codec::{Format, encoding};
use xtb_protocol::messages::{
    MAX_MAP_VERSIONS, MAX_WHY, MapContent, MapEdit, MapEditCode, MapEditReply, MapHash, MapHistory, MapPlace,
    MapVersion, MapZone, MapZoneKind, Message, PlaceKind,
};
use xtb_protocol::{Name, Uuid};

fn content() -> MapContent {
    MapContent { map: MapHash::new(0x17ac_03f8_7e07_7be9), places: MapHash::new(2) }
}

fn version() -> MapVersion {
    let (by, why) = (Name::new("alice").unwrap(), "a crane".to_owned());
    MapVersion { number: 3, at_ms: 300, by, why, content: content() }
}

fn edit() -> MapEdit {
    let points = vec![[0.5, 0.0], [1.0, 0.0], [1.0, 0.5]];
    let zone = MapZone { name: "crane".to_owned(), kind: MapZoneKind::KeepOut, points };
    let place = MapPlace {
        name: Name::new("dock-1").unwrap(),
        kind: PlaceKind::Dock,
        x_m: 1.5,
        y_m: -2.0,
        yaw_rad: Some(0.25),
        tags: Vec::new(),
        points: Vec::new(),
    };
    let id = Uuid::from_u128(0x0011_2233_4455_6677_8899_aabb_ccdd_eeff);
    MapEdit { id, base: content(), why: "a crane".to_owned(), zones: vec![zone], places: vec![place] }
}

#[test]
fn the_versions() {
    assert_eq!(encoding::<MapEdit>(Format::Postcard), "application/x-postcard;xtb.MapEdit.v1");
    assert_eq!(encoding::<MapEditReply>(Format::Postcard), "application/x-postcard;xtb.MapEditReply.v1");
    assert_eq!(encoding::<MapHistory>(Format::Postcard), "application/x-postcard;xtb.MapHistory.v1");
}

#[test]
fn an_edit() {
    pinned(
        &edit(),
        concat!(
            "1000112233445566778899aabbccddeeff1031376163303366383765303737626539103030303030",
            "30303030303030303030320761206372616e6501056372616e650003000000000000e03f00000000",
            "00000000000000000000f03f0000000000000000000000000000f03f000000000000e03f0106646f",
            "636b2d3101000000000000f83f00000000000000c001000000000000d03f0000"
        ),
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","base":{"map":"17ac03f87e077be9","#,
            r#""places":"0000000000000002"},"why":"a crane","zones":[{"name":"crane","kind":"keep_out","#,
            r#""points":[[0.5,0.0],[1.0,0.0],[1.0,0.5]]}],"places":[{"name":"dock-1","kind":"dock","x_m":1.5,"#,
            r#""y_m":-2.0,"yaw_rad":0.25,"tags":[],"points":[]}]}"#
        ),
    );
}

#[test]
fn answers_and_history() {
    pinned(
        &MapEditReply::Saved { version: version(), stored: true },
        concat!(
            "0003ac0205616c6963650761206372616e6510313761633033663837653037376265391030303030",
            "30303030303030303030303201"
        ),
        concat!(
            r#"{"saved":{"version":{"number":3,"at_ms":300,"by":"alice","why":"a crane","content":"#,
            r#"{"map":"17ac03f87e077be9","places":"0000000000000002"}},"stored":true}}"#
        ),
    );
    let (code, message, hint) = (MapEditCode::Conflict, "no".to_owned(), "again".to_owned());
    pinned(
        &MapEditReply::Refused { code, message, hint },
        "0102026e6f05616761696e",
        r#"{"refused":{"code":"conflict","message":"no","hint":"again"}}"#,
    );
    pinned(
        &MapHistory { name: "lab".to_owned(), stored: false, versions: vec![version()] },
        concat!(
            "036c6162000103ac0205616c6963650761206372616e651031376163303366383765303737626539",
            "1030303030303030303030303030303032"
        ),
        concat!(
            r#"{"name":"lab","stored":false,"versions":[{"number":3,"at_ms":300,"by":"alice","why":"a crane","#,
            r#""content":{"map":"17ac03f87e077be9","places":"0000000000000002"}}]}"#
        ),
    );
}

#[test]
fn what_no_map_can_be_told_is_refused() {
    edit().validate().unwrap();
    let refused = |what: &str, change: &dyn Fn(&mut MapEdit)| {
        let mut changed = edit();
        change(&mut changed);
        assert!(changed.validate().is_err(), "{what}");
    };
    for why in ["", " ", " a", "a\n", "\u{1b}[2J", "x".repeat(MAX_WHY + 1).as_str()] {
        refused(why, &|edit| edit.why = why.to_owned());
    }
    refused("zone", &|edit| edit.zones[0].points.truncate(2));
    refused("zones", &|edit| edit.zones = vec![edit.zones[0].clone(); 201]);
    refused("corner", &|edit| edit.zones[0].points[0][0] = f64::NAN);
    refused("two places of one name", &|edit| edit.places.push(edit.places[0].clone()));
    let versions = vec![version(); MAX_MAP_VERSIONS + 1];
    assert!(MapHistory { name: "lab".to_owned(), stored: true, versions }.validate().is_err());
}
