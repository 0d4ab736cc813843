//! The bytes of wire version 1. This file is never edited to pass: bytes that change need a new
//! version of their type, and a file of their own.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_control::PwmCount;
use xtb_control::controller::{GyroSample, PwmOutputs};
use xtb_protocol::board::FrameWriter;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::gyro_3dmg::EulerFrame;
use xtb_protocol::messages::{
    Done, Estop, Estopped, Event, EventKind, GoalStatus, Message, RejectCode, Reply, Setpoint,
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
