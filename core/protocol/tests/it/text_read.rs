//! No text of a message does anything to a terminal, whoever wrote it: each is escaped where it is read.

use serde_json::Value;
use xtb_control::frames::MapPose;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    About, DispatchCode, DispatchError, DispatchOutcome, DispatchReply, ErrorBody, Event, EventKind, Fault,
    GoalStatus, Latch, Limits, LogCode, LogReply, LogRequest, Message, Outcome, ParameterInfo, RejectCode,
    Reply, Roster, RosterEntry, Route, Suspension, SuspensionCause, TaskList, TrafficState,
};
use xtb_protocol::wire::{CodecError, JSON};
use xtb_protocol::{Name, Uuid, text};

const EVIL: &str = "a\x1b[2J\r\nok\u{9b}1m\x7f\u{2028}\u{202e}z\0";
const SHOWN: &str = "a\\u{1b}[2J\\r\\nok\\u{9b}1m\\u{7f}\\u{2028}\\u{202e}z\\u{0}";

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

/// Every text in a value.
fn texts<'a>(value: &'a Value, found: &mut Vec<&'a str>) {
    match value {
        Value::String(text) => found.push(text),
        Value::Array(items) => items.iter().for_each(|item| texts(item, found)),
        Value::Object(fields) => fields.values().for_each(|field| texts(field, found)),
        _ => {}
    }
}

/// A message in which `count` texts are evil is read with all of them shown as text, in both formats.
fn is_read_as_text<M: Message>(message: &M, count: usize) {
    for format in [Format::Postcard, Format::Json] {
        let bytes = encode(message, format).unwrap();
        let (read, _) = decode::<M>(&encoding::<M>(format), &bytes).unwrap();
        let value = serde_json::to_value(&read).unwrap();
        let mut found = Vec::new();
        texts(&value, &mut found);
        assert!(!found.iter().any(|it| it.contains(text::is_control)), "{}: {value}", M::NAME);
        assert_eq!(found.iter().filter(|it| **it == SHOWN).count(), count, "{}: {value}", M::NAME);
    }
}

fn evil() -> String {
    EVIL.to_owned()
}

fn suspended() -> Vec<Suspension> {
    let cause = SuspensionCause::OtherMap { of: Some(evil()), now: evil() };
    vec![Suspension { cause, since_ms: 1, tasks: 1 }]
}

#[test]
fn refusals() {
    let error = ErrorBody { code: RejectCode::Busy, message: evil(), hint: evil() };
    is_read_as_text(&Reply { id: Uuid::nil(), result: Outcome::Error(error) }, 2);
    let error = DispatchError { code: DispatchCode::Malformed, message: evil(), hint: evil() };
    is_read_as_text(
        &DispatchReply {
            id: Uuid::nil(),
            result: DispatchOutcome::Error(error),
            left_out: 0,
            suspended: suspended(),
        },
        4,
    );
    is_read_as_text(&LogReply::Error { code: LogCode::Unreadable, message: evil() }, 1);
    is_read_as_text(&LogRequest::Read { file: evil(), offset: 0, length: 1 }, 1);
}

#[test]
fn events() {
    let goal = EventKind::Goal { id: Uuid::nil(), status: GoalStatus::Failed, reason: Some(evil()) };
    let fault = EventKind::Fault { fault: Fault::GyroSilent, present: true, detail: Some(evil()) };
    let latch = EventKind::Latch { latch: Latch::Estop, set: true, by: evil() };
    for kind in [EventKind::Started { version: evil() }, goal, fault, latch] {
        is_read_as_text(&Event { robot: name("xtb-1"), epoch: 1, seq: 1, tick_ms: 1, kind }, 1);
    }
}

#[test]
fn factsheets_and_rosters() {
    let row = ParameterInfo { name: evil(), value: evil(), unit: evil(), origin: evil() };
    let about = About {
        robot: name("xtb-1"),
        fleet: name("lab"),
        version: evil(),
        epoch: 1,
        hardware: evil(),
        start_pose: MapPose::default(),
        limits: Limits { max_rpm: 1.0, admitted_mps: 1.0, setpoint_lifetime_ms: 1, max_coordinate_m: 1.0 },
        capabilities: vec![evil(), evil()],
        vehicle_hash: evil(),
        vehicle: vec![row],
    };
    is_read_as_text(&about, 9);
    let entry = RosterEntry { name: name("xtb-1"), tags: vec![evil()], start_pose: None };
    is_read_as_text(&Roster { robots: vec![entry] }, 1);
}

#[test]
fn traffic_control_and_the_dispatcher() {
    let route = Route {
        epoch: 1,
        seq: 1,
        goal: None,
        track: None,
        plan: 0,
        release_m: 0.0,
        cruise_mps: 0.0,
        waits_for: None,
        reason: Some(evil()),
        others: Vec::new(),
    };
    is_read_as_text(&route, 1);
    let list = TaskList {
        ledger: 1,
        at_ms: 1,
        ledger_failed: Some(evil()),
        tasks: Vec::new(),
        left_out: 0,
        suspended: suspended(),
    };
    is_read_as_text(&list, 3);
    let (led, obstacles) = (Vec::new(), Vec::new());
    is_read_as_text(&TrafficState { epoch: 1, seq: 1, map_hash: evil(), led, obstacles, plans: 0 }, 1);
}

#[test]
fn what_a_parser_repeats_is_text_too() {
    let unknown = serde_json::json!({ EVIL: 1 }).to_string();
    let refused = decode::<Reply>(JSON, unknown.as_bytes()).unwrap_err();
    let version = format!("application/x-postcard;xtb.Reply.v{EVIL}");
    let other = decode::<Reply>(&version, &[]).unwrap_err();
    assert!(matches!(other, CodecError::WrongVersion { .. }), "{other}");
    let encoding = decode::<Reply>(EVIL, &[]).unwrap_err();
    for error in [refused, other, encoding] {
        assert!(!error.to_string().contains(text::is_control), "{:?}", error.to_string());
    }
}
