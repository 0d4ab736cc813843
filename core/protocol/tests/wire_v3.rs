//! The bytes of those types that are in version 3. This file is never edited to pass: bytes that
//! change need a new version of their type, and a file of their own.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_control::Mode;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{BatteryLevel, Event, EventKind, Fault, GoalStatus, Latch, Message, StopReason};
use xtb_protocol::{Name, Uuid};

fn id() -> Uuid {
    Uuid::from_u128(0x0011_2233_4455_6677_8899_aabb_ccdd_eeff)
}

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn pinned<M: Message + PartialEq + std::fmt::Debug>(message: &M, postcard: &str, json: &str) {
    let bytes = encode(message, Format::Postcard).unwrap();
    let text = encode(message, Format::Json).unwrap();
    assert_eq!((hex(&bytes).as_str(), std::str::from_utf8(&text).unwrap()), (postcard, json));
    for (format, bytes) in [(Format::Postcard, &bytes), (Format::Json, &text)] {
        assert_eq!(&decode::<M>(&encoding::<M>(format), bytes).unwrap().0, message);
    }
}

fn event(kind: EventKind) -> Event {
    Event { robot: name("xtb-1"), epoch: 5, seq: 1, tick_ms: 1000, kind }
}

#[test]
fn the_versions() {
    assert_eq!(encoding::<Event>(Format::Postcard), "application/x-postcard;xtb.Event.v3");
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

/// The names of an enum in the order of their numbers on the wire.
fn names<T: serde::de::DeserializeOwned + serde::Serialize>() -> String {
    let known = (0_u8..128).map_while(|number| postcard::from_bytes::<T>(&[number]).ok());
    let names: Vec<_> = known.map(|value| serde_json::to_value(value).unwrap()).collect();
    names.iter().map(|name| name.as_str().unwrap()).collect::<Vec<_>>().join(" ")
}

/// A name put in between, or taken away, would change the meaning of all that follow.
#[test]
fn the_numbers_of_the_names() {
    assert_eq!(
        names::<Latch>(),
        "estop remote_takeover board_lost gyro_lost runaway sensor_fault battery_critical"
    );
    assert_eq!(
        names::<Fault>(),
        concat!(
            "board_unplugged board_busy board_no_permission board_port_broken board_silent ",
            "board_garbage board_half_frames board_wrong_device board_not_set_up gyro_unplugged ",
            "gyro_busy gyro_no_permission gyro_port_broken gyro_silent gyro_garbage gyro_half_frames ",
            "gyro_wrong_device encoder_silent converter_silent remote_lost tilt_out_of_range ",
            "recording_failed board_frozen gyro_frozen encoder_out_of_range converter_frozen ",
            "infrared_frozen infrared_out_of_range runaway stalled battery_low battery_critical"
        )
    );
    assert_eq!(
        names::<StopReason>(),
        concat!(
            "no_command goal_reached stop cancelled time_up setpoint_expired link_lost setpoint_zero ",
            "obstacle_front obstacle_rear wander_pause board_lost gyro_lost remote_neutral remote_lost ",
            "estop remote_takeover runaway sensor_fault battery_critical lease_expired lease_taken ",
            "lease_released loop_stalled stalled over_speed changing_direction coasting starting planning ",
            "waiting_for_traffic giving_way way_blocked pose_uncertain in_keep_out at_cusp"
        )
    );
    assert_eq!(names::<BatteryLevel>(), "unknown ok warn finish critical");
    assert_eq!(
        names::<GoalStatus>(),
        "accepted running blocked reached cancelled replaced failed interrupted"
    );
    assert_eq!(names::<Mode>(), "idle manual teleop goto wander fault");
}
