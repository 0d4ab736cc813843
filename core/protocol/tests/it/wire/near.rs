//! The bytes of what a robot tells those near it, in version 1. This file is never edited to pass: bytes that
//! change need a new version of their type, and a file of their own.

use super::{name, pinned};
use xtb_control::frames::MapPose;
use xtb_protocol::codec::{Format, encode, encoding};
use xtb_protocol::messages::{Arc, NearRole, NearState, NearWay, Track};

fn parked() -> NearState {
    NearState {
        robot: name("xtb-2"),
        x_m: 0.0,
        y_m: 0.0,
        yaw_rad: 0.0,
        speed_mps: 0.0,
        role: NearRole::Parked,
        way: None,
        waits_for: None,
    }
}

fn going() -> NearState {
    let arcs =
        vec![Arc { length_m: 0.5, curvature_per_m: 2.0 }, Arc { length_m: -0.25, curvature_per_m: 0.0 }];
    let track = Track { start: MapPose { x_m: 1.0, y_m: -1.0, yaw_rad: 0.5 }, arcs };
    NearState {
        robot: name("xtb-1"),
        x_m: 1.5,
        y_m: -2.0,
        yaw_rad: 0.5,
        speed_mps: 0.125,
        role: NearRole::Alone,
        way: Some(NearWay { track, done_m: 0.25, release_m: 0.5 }),
        waits_for: Some(name("xtb-2")),
    }
}

#[test]
fn what_robots_tell_those_near_them() {
    assert_eq!(encoding::<NearState>(Format::Postcard), "application/x-postcard;xtb.NearState.v1");
    pinned(
        &going(),
        "057874622d31000000000000f83f00000000000000c0000000000000e03f000000000000c03f0001000000000000f03f000000000000f0bf000000000000e03f02000000000000e03f0000000000000040000000000000d0bf0000000000000000000000000000d03f000000000000e03f01057874622d32",
        r#"{"robot":"xtb-1","x_m":1.5,"y_m":-2.0,"yaw_rad":0.5,"speed_mps":0.125,"role":"alone","way":{"track":{"start":{"x_m":1.0,"y_m":-1.0,"yaw_rad":0.5},"arcs":[{"length_m":0.5,"curvature_per_m":2.0},{"length_m":-0.25,"curvature_per_m":0.0}]},"done_m":0.25,"release_m":0.5},"waits_for":"xtb-2"}"#,
    );
    pinned(
        &parked(),
        "057874622d320000000000000000000000000000000000000000000000000000000000000000020000",
        r#"{"robot":"xtb-2","x_m":0.0,"y_m":0.0,"yaw_rad":0.0,"speed_mps":0.0,"role":"parked","way":null,"waits_for":null}"#,
    );
    let names = [NearRole::Alone, NearRole::Driven, NearRole::Parked];
    let numbers = names.map(|role| encode(&NearState { role, ..parked() }, Format::Postcard).unwrap());
    // The role is the third byte from the end.
    assert_eq!(numbers.map(|bytes| bytes[bytes.len() - 3]), [0, 1, 2]);
}

#[test]
fn what_cannot_be_true_is_refused() {
    let far = MapPose { x_m: 2000.0, y_m: 0.0, yaw_rad: 0.0 };
    let way = |start, arcs| Some(NearWay { track: Track { start, arcs }, done_m: 0.0, release_m: 0.0 });
    let long = vec![Arc { length_m: 1.0, curvature_per_m: 0.0 }; Track::MOST_ARCS + 1];
    for wrong in [
        NearState { x_m: f64::NAN, ..parked() },
        NearState { y_m: 2e6, ..parked() },
        NearState { yaw_rad: f64::INFINITY, ..parked() },
        NearState { speed_mps: -3000.0, ..parked() },
        NearState { way: way(far, Vec::new()), ..parked() },
        NearState { way: way(MapPose::default(), long), ..parked() },
        NearState { way: going().way.map(|way| NearWay { release_m: f64::NAN, ..way }), ..parked() },
    ] {
        assert!(encode(&wrong, Format::Postcard).is_err(), "{wrong:?}");
    }
}
