//! The bytes of what the dispatcher and its clients say in version 2. This file is never edited to pass: bytes
//! that change need a new version of their type, and a file of their own.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    DispatchCode, DispatchError, DispatchOutcome, DispatchReply, LinkLoss, Message, OnTakeover, TaskChange,
    TaskHistory, TaskId, TaskKind, TaskList, TaskSpec, TaskState, TaskStep, TaskView, Waypoint, Who,
};
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

fn point() -> Waypoint {
    Waypoint { x_m: 1.5, y_m: -2.0, yaw_rad: Some(0.5) }
}

/// A task that says something in every field.
fn spec() -> TaskSpec {
    TaskSpec {
        kind: TaskKind::Route { points: vec![point()], loops: 3, dwell_s: 0.5 },
        priority: 7,
        deadline_ms: Some(1000),
        who: Who::Tag("red".to_owned()),
        retries: 1,
        on_link_loss: LinkLoss::Finish,
        finish_s: 60.0,
        on_takeover: OnTakeover::Resume,
        grace_s: 2.0,
    }
}

fn step() -> TaskStep {
    let reason = Some("r".to_owned());
    TaskStep { at_ms: 900, state: TaskState::Held, robot: Some(name("xtb-1")), legs_done: 2, reason }
}

fn view() -> TaskView {
    TaskView {
        id: TaskId::new(17),
        state: TaskState::Running,
        since_ms: 900,
        reason: None,
        robot: Some(name("xtb-1")),
        legs_done: 2,
        legs: Some(3),
        failures: 1,
        by: name("cli-7"),
        submitted_ms: 800,
        spec: spec(),
    }
}

fn error() -> DispatchError {
    DispatchError { code: DispatchCode::Unconfirmed, message: "m".to_owned(), hint: "h".to_owned() }
}

#[test]
fn the_versions() {
    for (encoding, name) in [
        (encoding::<DispatchReply>(Format::Postcard), "DispatchReply"),
        (encoding::<TaskList>(Format::Postcard), "TaskList"),
    ] {
        assert_eq!(encoding, format!("application/x-postcard;xtb.{name}.v2"));
    }
}

#[test]
fn answers() {
    let change = TaskChange { id: TaskId::new(17), state: Some(TaskState::Cancelling), error: Some(error()) };
    let history = TaskHistory { task: view(), steps: vec![step()], left_out: 4 };
    for (result, postcard, json) in [
        (
            DispatchOutcome::Submitted(vec![TaskId::new(17)]),
            "1000112233445566778899aabbccddeeff00010374313705",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"submitted":["t17"]},"left_out":5}"#,
        ),
        (
            DispatchOutcome::Changed(vec![change]),
            "1000112233445566778899aabbccddeeff0101037431370106010c016d016805",
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"changed":[{"id":"t17","state":"c"#,
                r#"ancelling","error":{"code":"unconfirmed","message":"m","hint":"h"}}]},"left_out":5}"#
            ),
        ),
        (
            DispatchOutcome::Shown(Box::new(history)),
            concat!(
                "1000112233445566778899aabbccddeeff02037431370284070001057874622d310201030105636c692d37a0",
                "060101000000000000f83f00000000000000c001000000000000e03f03000000000000e03f0701e807020372",
                "656401010000000000004e400100000000000000400184070401057874622d31020101720405"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"shown":{"task":{"id":"t17","stat"#,
                r#"e":"running","since_ms":900,"reason":null,"robot":"xtb-1","legs_done":2,"legs":3,"failur"#,
                r#"es":1,"by":"cli-7","submitted_ms":800,"spec":{"kind":{"route":{"points":[{"x_m":1.5,"y_m"#,
                r#"":-2.0,"yaw_rad":0.5}],"loops":3,"dwell_s":0.5}},"priority":7,"deadline_ms":1000,"who":{"#,
                r#""tag":"red"},"retries":1,"on_link_loss":"finish","finish_s":60.0,"on_takeover":"resume","#,
                r#""grace_s":2.0}},"steps":[{"at_ms":900,"state":"held","robot":"xtb-1","legs_done":2,"reas"#,
                r#"on":"r"}],"left_out":4}},"left_out":5}"#
            ),
        ),
        (
            DispatchOutcome::Error(error()),
            "1000112233445566778899aabbccddeeff030c016d016805",
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"error":{"code":"unconfirmed","me"#,
                r#"ssage":"m","hint":"h"}},"left_out":5}"#
            ),
        ),
    ] {
        pinned(&DispatchReply { id: id(), result, left_out: 5 }, postcard, json);
    }
}

#[test]
fn the_list() {
    let list = TaskList {
        ledger: 300,
        at_ms: 950,
        ledger_failed: Some("full".to_owned()),
        tasks: vec![view()],
        left_out: 9,
    };
    pinned(
        &list,
        concat!(
            "ac02b607010466756c6c01037431370284070001057874622d310201030105636c692d37a006010100000000",
            "0000f83f00000000000000c001000000000000e03f03000000000000e03f0701e80702037265640101000000",
            "0000004e4001000000000000004009"
        ),
        concat!(
            r#"{"ledger":300,"at_ms":950,"ledger_failed":"full","tasks":[{"id":"t17","state":"running","#,
            r#""since_ms":900,"reason":null,"robot":"xtb-1","legs_done":2,"legs":3,"failures":1,"by":"c"#,
            r#"li-7","submitted_ms":800,"spec":{"kind":{"route":{"points":[{"x_m":1.5,"y_m":-2.0,"yaw_r"#,
            r#"ad":0.5}],"loops":3,"dwell_s":0.5}},"priority":7,"deadline_ms":1000,"who":{"tag":"red"},"#,
            r#""retries":1,"on_link_loss":"finish","finish_s":60.0,"on_takeover":"resume","grace_s":2.0"#,
            r#"}}],"left_out":9}"#
        ),
    );
}

/// Recordings of version 1 hold lists as JSON.
#[test]
fn what_is_left_out_may_be_left_out_in_json() {
    let json = r#"{"ledger":300,"at_ms":950,"ledger_failed":null,"tasks":[]}"#;
    let (list, _) = decode::<TaskList>("application/json", json.as_bytes()).unwrap();
    assert_eq!(list.left_out, 0);
    let json = r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"submitted":["t17"]}}"#;
    assert_eq!(decode::<DispatchReply>("application/json", json.as_bytes()).unwrap().0.left_out, 0);
}
