//! The bytes of wire version 1. This file is never edited to pass: bytes that change need a new
//! version of their type, and a file of their own.

use super::{hex, id, pinned};
use xtb_control::PwmCount;
use xtb_control::controller::{GyroSample, PwmOutputs};
use xtb_protocol::Name;
use xtb_protocol::board::FrameWriter;
use xtb_protocol::codec::{Format, encoding};
use xtb_protocol::gyro_3dmg::EulerFrame;
use xtb_protocol::messages::{
    AckBody, AckReply, AckRequest, Acknowledged, Alert, AlertKind, Done, Estop, Estopped, Event, EventKind,
    FleetAlerts, FleetMap, FleetPlaces, GoalStatus, HistoryEvent, HistoryKind, HistoryPlace, HistoryReply,
    HistoryRequest, MapCell, MapHash, MapPlace, MapZone, MapZoneKind, Message, PlaceKind, RejectCode, Reply,
    RobotReport, Setpoint, StopCount,
};

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

fn alerts() -> FleetAlerts {
    let by = Name::new("alice").unwrap();
    let alert = Alert {
        id: 3,
        kind: AlertKind::Latched,
        robot: Some(Name::new("xtb-1").unwrap()),
        subject: Some("estop".to_owned()),
        text: "xtb-1 latched".to_owned(),
        remedy: "reset it".to_owned(),
        since_ms: 5,
        acknowledged: Some(Acknowledged { by, person: Some("alice@desk".to_owned()), at_ms: 6 }),
        ended_ms: None,
    };
    FleetAlerts { at_ms: 7, alerts: vec![alert], left_out: 1 }
}

#[test]
fn alerts_and_who_has_seen_them() {
    pinned(
        &alerts(),
        concat!(
            "0701030001057874622d3101056573746f700d7874622d31206c6174636865640872657365742069",
            "74050105616c696365010a616c696365406465736b060001"
        ),
        concat!(
            r#"{"at_ms":7,"alerts":[{"id":3,"kind":"latched","robot":"xtb-1","subject":"estop","#,
            r#""text":"xtb-1 latched","remedy":"reset it","since_ms":5,"acknowledged":{"by":"alice","#,
            r#""person":"alice@desk","at_ms":6},"ended_ms":null}],"left_out":1}"#
        ),
    );
    let person = Some("bob@desk".to_owned());
    pinned(
        &AckRequest { body: AckBody::Alerts { ids: vec![3, 5] }, person },
        "000203050108626f62406465736b",
        r#"{"body":{"alerts":{"ids":[3,5]}},"person":"bob@desk"}"#,
    );
    pinned(
        &AckRequest { body: AckBody::All {}, person: None },
        "0100",
        r#"{"body":{"all":{}},"person":null}"#,
    );
    pinned(
        &AckReply { acknowledged: vec![3], before: vec![4], unknown: vec![9] },
        "010301040109",
        r#"{"acknowledged":[3],"before":[4],"unknown":[9]}"#,
    );
}

#[test]
fn acknowledgements_that_cannot_be_are_refused() {
    let request = |ids: usize, person: Option<&str>| {
        let person = person.map(str::to_owned);
        AckRequest { body: AckBody::Alerts { ids: vec![1; ids] }, person }.validate()
    };
    request(1, None).unwrap();
    request(500, Some(&"x".repeat(64))).unwrap();
    assert!(request(0, None).is_err() && request(501, None).is_err());
    assert!(request(1, Some("")).is_err() && request(1, Some(&"x".repeat(65))).is_err());
    let many = FleetAlerts { alerts: vec![alerts().alerts[0].clone(); 501], ..alerts() };
    assert!(many.validate().is_err());
}

#[test]
fn the_fleets_history() {
    let robot = || Name::new("xtb-1").unwrap();
    pinned(
        &HistoryRequest::Events {
            place: HistoryPlace::After(300),
            limit: 2,
            since_ms: Some(5),
            robot: Some(robot()),
            kinds: vec![HistoryKind::Goal, HistoryKind::Alert],
            search: None,
        },
        "0000ac0202010501057874622d3102020800",
        concat!(
            r#"{"events":{"place":{"after":300},"limit":2,"since_ms":5,"robot":"xtb-1","#,
            r#""kinds":["goal","alert"],"search":null}}"#
        ),
    );
    pinned(
        &HistoryRequest::Report { from_ms: 1, to_ms: 2 },
        "010102",
        r#"{"report":{"from_ms":1,"to_ms":2}}"#,
    );
    let event = HistoryEvent {
        id: 4,
        at_ms: 7,
        robot: Some(robot()),
        kind: HistoryKind::Latch,
        about: Some("estop".to_owned()),
        text: "xtb-1 LATCHED".to_owned(),
    };
    pinned(
        &HistoryReply::Events { now_ms: 9, events: vec![event], more: true },
        "000901040701057874622d310501056573746f700d7874622d31204c41544348454401",
        concat!(
            r#"{"events":{"now_ms":9,"events":[{"id":4,"at_ms":7,"robot":"xtb-1","kind":"latch","#,
            r#""about":"estop","text":"xtb-1 LATCHED"}],"more":true}}"#
        ),
    );
    let report = RobotReport {
        robot: robot(),
        heard_s: 2.0,
        active_s: 1.5,
        driving_s: 0.5,
        driven_m: 0.25,
        done: 4,
        failed: 1,
        stops: vec![StopCount { reason: "way_blocked".to_owned(), count: 2 }],
        battery_min_v: Some(7.5),
        battery_v: None,
    };
    pinned(
        &HistoryReply::Report { robots: vec![report] },
        concat!(
            "0101057874622d310000000000000040000000000000f83f000000000000e03f000000000000d03f",
            "0401010b7761795f626c6f636b656402010000000000001e4000"
        ),
        concat!(
            r#"{"report":{"robots":[{"robot":"xtb-1","heard_s":2.0,"active_s":1.5,"driving_s":0.5,"#,
            r#""driven_m":0.25,"done":4,"failed":1,"stops":[{"reason":"way_blocked","count":2}],"#,
            r#""battery_min_v":7.5,"battery_v":null}]}}"#
        ),
    );
    let message = "no".to_owned();
    pinned(&HistoryReply::Failed { message }, "02026e6f", r#"{"failed":{"message":"no"}}"#);
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
