//! The bytes of wire version 1. This file is never edited to pass: bytes that change need a new
//! version of their type, and a file of their own.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_control::PwmCount;
use xtb_control::controller::{GyroSample, PwmOutputs};
use xtb_protocol::board::FrameWriter;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::gyro_3dmg::EulerFrame;
use xtb_protocol::messages::{
    Done, Estop, Estopped, Event, EventKind, FleetMap, FleetPlaces, GoalStatus, MapCell, MapHash, MapPlace,
    MapZone, MapZoneKind, Message, PlaceKind, RejectCode, Reply, Setpoint,
};
use xtb_protocol::{Name, Uuid};

fn id() -> Uuid {
    Uuid::from_u128(0x0011_2233_4455_6677_8899_aabb_ccdd_eeff)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Both encodings of a message are as pinned, and read back as the message.
fn pinned<M: Message + PartialEq + std::fmt::Debug>(message: &M, postcard: &str, json: &str) {
    let bytes = encode(message, Format::Postcard).unwrap();
    let text = encode(message, Format::Json).unwrap();
    assert_eq!((hex(&bytes).as_str(), std::str::from_utf8(&text).unwrap()), (postcard, json));
    for (format, bytes) in [(Format::Postcard, &bytes), (Format::Json, &text)] {
        assert_eq!(decode::<M>(&encoding::<M>(format), bytes).unwrap(), (decode_own(message), format));
    }
}

fn decode_own<M: Message>(message: &M) -> M {
    let bytes = encode(message, Format::Postcard).unwrap();
    decode(&encoding::<M>(Format::Postcard), &bytes).unwrap().0
}

#[test]
fn a_reply() {
    pinned(
        &Reply::done(id(), Done { lease: None, goal: Some(id()) }),
        "1000112233445566778899aabbccddeeff0000011000112233445566778899aabbccddeeff",
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"ok":{"lease":null,"#,
            r#""goal":"00112233-4455-6677-8899-aabbccddeeff"}}}"#
        ),
    );
    pinned(
        &Reply::refused(id(), RejectCode::LeaseHeld, "m", "h"),
        "1000112233445566778899aabbccddeeff0104016d0168",
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","#,
            r#""result":{"error":{"code":"lease_held","message":"m","hint":"h"}}}"#
        ),
    );
}

#[test]
fn a_setpoint() {
    let setpoint = Setpoint { lease: None, seq: 7, echo_tick_ms: Some(128), rpm: 13.0, steering: -0.5 };
    pinned(
        &setpoint,
        "00070180010000000000002a40000000000000e0bf",
        r#"{"lease":null,"seq":7,"echo_tick_ms":128,"rpm":13.0,"steering":-0.5}"#,
    );
}

#[test]
fn an_event() {
    let kind = EventKind::Goal { id: id(), status: GoalStatus::Reached, reason: None };
    let event = Event { robot: Name::new("xtb-1").unwrap(), epoch: 5, seq: 1, tick_ms: 1000, kind };
    pinned(
        &event,
        "057874622d310501e807021000112233445566778899aabbccddeeff0300",
        concat!(
            r#"{"robot":"xtb-1","epoch":5,"seq":1,"tick_ms":1000,"#,
            r#""kind":{"goal":{"id":"00112233-4455-6677-8899-aabbccddeeff","status":"reached","reason":null}}}"#
        ),
    );
}

#[test]
fn the_encodings() {
    assert_eq!(encoding::<Reply>(Format::Postcard), "application/x-postcard;xtb.Reply.v1");
    assert_eq!(encoding::<Reply>(Format::Json), "application/json");
}

#[test]
fn the_agents_pwm_frame() {
    let n = PwmCount::NEUTRAL;
    let pwm = PwmOutputs {
        motor: PwmCount::MAX,
        steer_front: PwmCount::try_from(3710).unwrap(),
        steer_rear: PwmCount::try_from(4179).unwrap(),
        bumper_front: n,
        bumper_rear: n,
        pistons: [n; 4],
        spare: n,
    };
    let frame = FrameWriter::default().pwm(&pwm);
    assert_eq!(hex(frame.as_bytes()), "02101998147e0e5310a60ea60ea60ea60ea60ea60ea60ec5a2930d00");
}

#[test]
fn the_gyros_frame() {
    let frame = EulerFrame { angles: GyroSample { roll: 1, pitch: -2, yaw: 256 }, ticks: 513 };
    assert_eq!(hex(&frame.encode()), "0e0001fffe01000201030e");
}

#[test]
fn an_emergency_stop_and_its_acknowledgement() {
    pinned(
        &Estop { id: id() },
        "1000112233445566778899aabbccddeeff",
        r#"{"id":"00112233-4455-6677-8899-aabbccddeeff"}"#,
    );
    pinned(
        &Estopped { robot: Name::new("xtb-1").unwrap(), latched: true },
        "057874622d3101",
        r#"{"robot":"xtb-1","latched":true}"#,
    );
}

/// A name put in between, or taken away, would change the meaning of all that follow.
#[test]
fn the_numbers_of_the_codes() {
    let code = |number: u8| postcard::from_bytes::<RejectCode>(&[number]).ok();
    let names: Vec<_> = (0..128).map_while(code).map(|code| serde_json::to_value(code).unwrap()).collect();
    let names: Vec<_> = names.iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!(
        names.join(" "),
        concat!(
            "malformed oversized wrong_version out_of_range lease_held lease_lost busy unknown_goal ",
            "not_ready unsupported overloaded overtaken lease_required latched cause_present ",
            "battery_low no_map keep_out goal_blocked"
        )
    );
}

#[test]
fn the_fleets_map() {
    let points = vec![[0.5, 0.0], [1.0, 0.0], [1.0, 0.5]];
    let zone = |name: &str, kind| MapZone { name: name.to_owned(), kind, points: points.clone() };
    let map = FleetMap {
        name: "lab".to_owned(),
        hash: MapHash::new(0x17ac_03f8_7e07_7be9),
        resolution_m: 0.5,
        origin_m: [-1.5, 2.0],
        width: 100,
        height: 3,
        cells: vec![(MapCell::Free, 200), (MapCell::Occupied, 1), (MapCell::Unknown, 99)],
        zones: vec![
            zone("charger", MapZoneKind::KeepOut),
            zone("lane", MapZoneKind::OneWay { heading_rad: 0.25 }),
        ],
    };
    pinned(
        &map,
        concat!(
            "036c61621031376163303366383765303737626539000000000000e03f000000000000f8bf000000",
            "000000004064030300c801010102630207636861726765720003000000000000e03f000000000000",
            "0000000000000000f03f0000000000000000000000000000f03f000000000000e03f046c616e6501",
            "000000000000d03f03000000000000e03f0000000000000000000000000000f03f00000000000000",
            "00000000000000f03f000000000000e03f"
        ),
        concat!(
            r#"{"name":"lab","hash":"17ac03f87e077be9","resolution_m":0.5,"origin_m":[-1.5,2.0],"#,
            r#""width":100,"height":3,"cells":[["free",200],["occupied",1],["unknown",99]],"#,
            r#""zones":[{"name":"charger","kind":"keep_out","points":[[0.5,0.0],[1.0,0.0],[1.0,0.5]]},"#,
            r#"{"name":"lane","kind":{"one_way":{"heading_rad":0.25}},"#,
            r#""points":[[0.5,0.0],[1.0,0.0],[1.0,0.5]]}]}"#
        ),
    );
}

fn places() -> FleetPlaces {
    let tag = |text: &str| Name::new(text).unwrap();
    let dock = MapPlace {
        name: tag("dock-1"),
        kind: PlaceKind::Dock,
        x_m: 1.5,
        y_m: -2.0,
        yaw_rad: Some(0.25),
        tags: vec![tag("north")],
        points: Vec::new(),
    };
    let points = vec![[0.5, 0.0], [1.0, 0.0], [1.0, 0.5]];
    let (name, kind) = (tag("hall"), PlaceKind::Place);
    let hall = MapPlace { name, kind, x_m: 0.9, y_m: 0.1, yaw_rad: None, tags: Vec::new(), points };
    FleetPlaces { map: MapHash::new(0x17ac_03f8_7e07_7be9), places: vec![dock, hall] }
}

#[test]
fn the_maps_places() {
    pinned(
        &places(),
        concat!(
            "10313761633033663837653037376265390206646f636b2d3101000000000000f83f000000000000",
            "00c001000000000000d03f01056e6f727468000468616c6c00cdccccccccccec3f9a9999999999b9",
            "3f000003000000000000e03f0000000000000000000000000000f03f000000000000000000000000",
            "0000f03f000000000000e03f"
        ),
        concat!(
            r#"{"map":"17ac03f87e077be9","places":[{"name":"dock-1","kind":"dock","x_m":1.5,"y_m":-2.0,"#,
            r#""yaw_rad":0.25,"tags":["north"],"points":[]},{"name":"hall","kind":"place","x_m":0.9,"#,
            r#""y_m":0.1,"yaw_rad":null,"tags":[],"points":[[0.5,0.0],[1.0,0.0],[1.0,0.5]]}]}"#
        ),
    );
}

#[test]
fn places_that_cannot_be_are_refused() {
    places().validate().unwrap();
    let refused = |what: &str, change: &dyn Fn(&mut FleetPlaces)| {
        let mut changed = places();
        change(&mut changed);
        assert!(changed.validate().is_err(), "{what}");
    };
    refused("two of one name", &|all| all.places[1].name = all.places[0].name.clone());
    for name in ["2", "-a", "inf", "nan"] {
        refused(name, &|all| all.places[0].name = Name::new(name).unwrap());
    }
    refused("x", &|all| all.places[0].x_m = f64::NAN);
    refused("far", &|all| all.places[0].y_m = 1000.5);
    refused("yaw", &|all| all.places[0].yaw_rad = Some(7.5));
    refused("tags", &|all| all.places[0].tags = vec![Name::new("a").unwrap(); 9]);
    refused("two corners", &|all| all.places[1].points.truncate(2));
    refused("corner", &|all| all.places[1].points[0][1] = f64::INFINITY);
    refused("many", &|all| all.places = vec![all.places[0].clone(); 501]);
}

#[test]
fn a_map_that_cannot_be_is_refused() {
    let good = FleetMap {
        name: "lab".to_owned(),
        hash: MapHash::new(0),
        resolution_m: 0.05,
        origin_m: [0.0, 0.0],
        width: 2,
        height: 2,
        cells: vec![(MapCell::Free, 4)],
        zones: Vec::new(),
    };
    good.validate().unwrap();
    let zone = |points: Vec<[f64; 2]>, heading_rad| MapZone {
        name: "z".to_owned(),
        kind: MapZoneKind::OneWay { heading_rad },
        points,
    };
    let corners = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]];
    let refused = |what: &str, change: &dyn Fn(&mut FleetMap)| {
        let mut map = good.clone();
        change(&mut map);
        assert!(map.validate().is_err(), "{what}");
    };
    refused("name", &|map| map.name = " lab".to_owned());
    refused("long name", &|map| map.name = "x".repeat(65));
    refused("resolution", &|map| map.resolution_m = f64::NAN);
    refused("origin", &|map| map.origin_m[1] = f64::INFINITY);
    refused("far origin", &|map| map.origin_m[0] = 1000.5);
    refused("no cells", &|map| (map.width, map.cells) = (0, Vec::new()));
    refused("too many cells", &|map| {
        (map.width, map.height, map.cells) = (4001, 4000, vec![(MapCell::Free, 4001 * 4000)]);
    });
    refused("runs too short", &|map| map.cells = vec![(MapCell::Free, 3)]);
    refused("runs too long", &|map| map.cells.push((MapCell::Occupied, 1)));
    refused("empty run", &|map| map.cells.push((MapCell::Occupied, 0)));
    refused("two corners", &|map| map.zones = vec![zone(corners[..2].to_vec(), 0.0)]);
    refused("heading", &|map| map.zones = vec![zone(corners.clone(), 7.5)]);
    refused("corner", &|map| map.zones = vec![zone(vec![[0.0, f64::NAN]; 3], 0.0)]);
    refused("zones", &|map| map.zones = vec![zone(corners.clone(), 0.0); 201]);
    refused("corners", &|map| map.zones = vec![zone(vec![[0.0, 0.0]; 201], 0.0)]);
}
