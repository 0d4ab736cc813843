//! The bytes of those types that are in version 4, and of the messages that came with them. This file is
//! never edited to pass: bytes that change need a new version of their type, and a file of their own.

use super::{id, name, pinned};
use xtb_control::frames::MapPose;
use xtb_protocol::codec::{Format, encoding};
use xtb_protocol::messages::{
    Arc, Event, EventKind, Fault, Fix, FixSource, GoalStatus, Latch, Route, RouteGoal, Track, TrafficState,
};

fn track() -> Track {
    Track {
        start: MapPose { x_m: 1.0, y_m: -1.0, yaw_rad: 0.5 },
        arcs: vec![
            Arc { length_m: 0.5, curvature_per_m: 2.0 },
            Arc { length_m: -0.25, curvature_per_m: 0.0 },
        ],
    }
}

fn event(kind: EventKind) -> Event {
    Event { robot: name("xtb-1"), epoch: 5, seq: 1, tick_ms: 1000, kind }
}

#[test]
fn the_versions() {
    assert_eq!(encoding::<Event>(Format::Postcard), "application/x-postcard;xtb.Event.v4");
    assert_eq!(encoding::<Route>(Format::Postcard), "application/x-postcard;xtb.Route.v1");
    assert_eq!(encoding::<Fix>(Format::Postcard), "application/x-postcard;xtb.Fix.v1");
    assert_eq!(encoding::<TrafficState>(Format::Postcard), "application/x-postcard;xtb.TrafficState.v1");
}

#[test]
fn a_fix() {
    let fix = Fix {
        x_m: 1.5,
        y_m: -2.0,
        yaw_rad: Some(0.5),
        sigma_m: 0.0625,
        sigma_yaw_rad: 0.125,
        source: FixSource::Tags,
        age_ms: 40,
    };
    pinned(
        &fix,
        concat!("000000000000f83f00000000000000c001000000000000e03f000000000000b03f000000000000c0", "3f0128"),
        concat!(
            r#"{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5,"sigma_m":0.0625,"sigma_yaw_rad":0.125,"source":"t"#,
            r#"ags","age_ms":40}"#
        ),
    );
}

#[test]
fn a_route() {
    let route = Route {
        epoch: 300,
        seq: 9,
        goal: Some(RouteGoal { epoch: 5, id: id() }),
        track: Some(track()),
        plan: 3,
        release_m: 1.0,
        cruise_mps: 0.25,
        waits_for: Some(name("xtb-2")),
        reason: Some("r".to_owned()),
        others: vec![MapPose { x_m: 1.0, y_m: 2.0, yaw_rad: 0.5 }],
    };
    pinned(
        &route,
        concat!(
            "ac020901051000112233445566778899aabbccddeeff01000000000000f03f000000000000f0bf00",
            "0000000000e03f02000000000000e03f0000000000000040000000000000d0bf0000000000000000",
            "03000000000000f03f000000000000d03f01057874622d3201017201000000000000f03f00000000",
            "00000040000000000000e03f"
        ),
        concat!(
            r#"{"epoch":300,"seq":9,"goal":{"epoch":5,"id":"00112233-4455-6677-8899-aabbccddeeff"},"t"#,
            r#"rack":{"start":{"x_m":1.0,"y_m":-1.0,"yaw_rad":0.5},"arcs":[{"length_m":0.5,"curvature"#,
            r#"_per_m":2.0},{"length_m":-0.25,"curvature_per_m":0.0}]},"plan":3,"release_m":1.0,"crui"#,
            r#"se_mps":0.25,"waits_for":"xtb-2","reason":"r","others":[{"x_m":1.0,"y_m":2.0,"yaw_rad""#,
            r#":0.5}]}"#
        ),
    );
}

#[test]
fn the_state_of_traffic_control() {
    let state = TrafficState {
        epoch: 300,
        seq: 2,
        map_hash: "00ff".to_owned(),
        led: vec![name("xtb-1")],
        obstacles: vec![name("xtb-2")],
        plans: 4,
    };
    pinned(
        &state,
        "ac0202043030666601057874622d3101057874622d3204",
        concat!(
            r#"{"epoch":300,"seq":2,"map_hash":"00ff","led":["xtb-1"],"obstacles":["xtb-2"],"plans":4"#,
            r#"}"#
        ),
    );
}

#[test]
fn events_of_a_latch() {
    let set = EventKind::Latch { latch: Latch::Estop, set: true, by: "cli-9".to_owned() };
    pinned(
        &event(set),
        "057874622d310501e80705000105636c692d39",
        concat!(
            r#"{"robot":"xtb-1","epoch":5,"seq":1,"tick_ms":1000,"kind":{"latch":{"latch":"estop",""#,
            r#"set":true,"by":"cli-9"}}}"#
        ),
    );
    let reset = EventKind::Latch { latch: Latch::BatteryCritical, set: false, by: "cli-9".to_owned() };
    pinned(
        &event(reset),
        "057874622d310501e80705060005636c692d39",
        concat!(
            r#"{"robot":"xtb-1","epoch":5,"seq":1,"tick_ms":1000,"kind":{"latch":{"latch":"battery_"#,
            r#"critical","set":false,"by":"cli-9"}}}"#
        ),
    );
}

#[test]
fn an_event_of_a_goal() {
    let kind =
        EventKind::Goal { id: id(), status: GoalStatus::Interrupted, reason: Some("restarted".to_owned()) };
    pinned(
        &event(kind),
        "057874622d310501e807021000112233445566778899aabbccddeeff070109726573746172746564",
        concat!(
            r#"{"robot":"xtb-1","epoch":5,"seq":1,"tick_ms":1000,"kind":{"goal":{"id":"00112233-445"#,
            r#"5-6677-8899-aabbccddeeff","status":"interrupted","reason":"restarted"}}}"#
        ),
    );
}

#[test]
fn an_event_of_the_lease() {
    pinned(
        &event(EventKind::Lease { holder: Some(name("cli-7")) }),
        "057874622d310501e807030105636c692d37",
        concat!(
            r#"{"robot":"xtb-1","epoch":5,"seq":1,"tick_ms":1000,"kind":{"lease":{"holder":"cli-7"}"#,
            r#"}}"#
        ),
    );
}

#[test]
fn an_event_of_a_fault() {
    let kind = EventKind::Fault { fault: Fault::Runaway, present: true, detail: Some("40 rpm".to_owned()) };
    pinned(
        &event(kind),
        "057874622d310501e807041c01010634302072706d",
        concat!(
            r#"{"robot":"xtb-1","epoch":5,"seq":1,"tick_ms":1000,"kind":{"fault":{"fault":"runaway""#,
            r#","present":true,"detail":"40 rpm"}}}"#
        ),
    );
}
