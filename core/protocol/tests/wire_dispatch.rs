//! The bytes of what the dispatcher and its clients say in version 1, and of assignments in requests of
//! version 2. This file is never edited to pass: bytes that change need a new version of their type, and
//! a file of their own.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    Assignment, Body, DispatchBody, DispatchCode, DispatchRequest, Errand, Lease, LinkLoss, Message,
    OnTakeover, Request, TaskEvent, TaskId, TaskKind, TaskSpec, TaskState, TaskStep, Via, Waypoint, Who,
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

fn request(body: Body) -> Request {
    Request { id: id(), lease: Some(Lease { epoch: 300, root: 2 }), body }
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

#[test]
fn the_versions() {
    for (encoding, name) in [
        (encoding::<DispatchRequest>(Format::Postcard), "DispatchRequest"),
        (encoding::<TaskEvent>(Format::Postcard), "TaskEvent"),
    ] {
        assert_eq!(encoding, format!("application/x-postcard;xtb.{name}.v1"));
    }
}

#[test]
fn an_assignment() {
    let assignment = Assignment { ledger: 300, task: TaskId::new(17), assign_seq: 5, leg: 2 };
    assert_eq!(assignment.goal_id().to_string(), "00000000-012c-8000-8000-000001400002");
    let errand = Errand::Goto { x_m: 1.5, y_m: -2.0, yaw_rad: None, via: Some(Via::Planned) };
    let body = Body::Assign { assignment, errand, on_link_loss: LinkLoss::Finish, finish_s: 60.0 };
    pinned(
        &request(body),
        concat!(
            "1000112233445566778899aabbccddeeff01ac020209ac0203743137050200000000000000f83f0000000000",
            "0000c0000101010000000000004e40"
        ),
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","lease":{"epoch":300,"root":2},"body":{"ass"#,
            r#"ign":{"assignment":{"ledger":300,"task":"t17","assign_seq":5,"leg":2},"errand":{"goto":{"#,
            r#""x_m":1.5,"y_m":-2.0,"yaw_rad":null,"via":"planned"}},"on_link_loss":"finish","finish_s""#,
            r#":60.0}}}"#
        ),
    );
    let errand = Errand::Wander { for_s: 20.0 };
    let body = Body::Assign { assignment, errand, on_link_loss: LinkLoss::Halt, finish_s: 60.0 };
    pinned(
        &request(body),
        concat!(
            "1000112233445566778899aabbccddeeff01ac020209ac020374313705020100000000000034400000000000",
            "00004e40"
        ),
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","lease":{"epoch":300,"root":2},"body":{"ass"#,
            r#"ign":{"assignment":{"ledger":300,"task":"t17","assign_seq":5,"leg":2},"errand":{"wander""#,
            r#":{"for_s":20.0}},"on_link_loss":"halt","finish_s":60.0}}}"#
        ),
    );
    pinned(
        &request(Body::Withdraw { ledger: 300, assign_seq: 5 }),
        "1000112233445566778899aabbccddeeff01ac02020aac0205",
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","lease":{"epoch":300,"root":2},"body":{"wit"#,
            r#"hdraw":{"ledger":300,"assign_seq":5}}}"#
        ),
    );
}

#[test]
fn a_submission() {
    let others = [
        TaskSpec { who: Who::Robot(name("xtb-1")), ..TaskSpec::new(TaskKind::Goto { to: point() }) },
        TaskSpec { who: Who::Able("wander".to_owned()), ..TaskSpec::new(TaskKind::Wander { for_s: 5.0 }) },
        TaskSpec::new(TaskKind::Patrol { points: vec![point()], dwell_s: 0.0, for_s: None }),
    ];
    let tasks = [spec()].into_iter().chain(others).collect();
    pinned(
        &DispatchRequest { id: id(), body: DispatchBody::Submit { tasks } },
        concat!(
            "1000112233445566778899aabbccddeeff00040101000000000000f83f00000000000000c001000000000000",
            "e03f03000000000000e03f0701e807020372656401010000000000004e400100000000000000400000000000",
            "0000f83f00000000000000c001000000000000e03f050001057874622d3102000000000000c0724000000000",
            "0000003e400300000000000014400500030677616e64657202000000000000c07240000000000000003e4002",
            "01000000000000f83f00000000000000c001000000000000e03f000000000000000000050000020000000000",
            "00c07240000000000000003e40"
        ),
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"submit":{"tasks":[{"kind":{"route""#,
            r#":{"points":[{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5}],"loops":3,"dwell_s":0.5}},"priority":7"#,
            r#","deadline_ms":1000,"who":{"tag":"red"},"retries":1,"on_link_loss":"finish","finish_s":6"#,
            r#"0.0,"on_takeover":"resume","grace_s":2.0},{"kind":{"goto":{"to":{"x_m":1.5,"y_m":-2.0,"y"#,
            r#"aw_rad":0.5}}},"priority":5,"deadline_ms":null,"who":{"robot":"xtb-1"},"retries":2,"on_l"#,
            r#"ink_loss":"halt","finish_s":300.0,"on_takeover":"requeue","grace_s":30.0},{"kind":{"wand"#,
            r#"er":{"for_s":5.0}},"priority":5,"deadline_ms":null,"who":{"able":"wander"},"retries":2,""#,
            r#"on_link_loss":"halt","finish_s":300.0,"on_takeover":"requeue","grace_s":30.0},{"kind":{""#,
            r#"patrol":{"points":[{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5}],"dwell_s":0.0,"for_s":null}},"p"#,
            r#"riority":5,"deadline_ms":null,"who":"any","retries":2,"on_link_loss":"halt","finish_s":3"#,
            r#"00.0,"on_takeover":"requeue","grace_s":30.0}]}}}"#
        ),
    );
}

#[test]
fn defaults_may_be_left_out_in_json() {
    let json = concat!(
        r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"submit":{"tasks":"#,
        r#"[{"kind":{"goto":{"to":{"x_m":1,"y_m":2}}}}]}}}"#
    );
    let (read, _) = decode::<DispatchRequest>("application/json", json.as_bytes()).unwrap();
    let to = Waypoint { x_m: 1.0, y_m: 2.0, yaw_rad: None };
    let tasks = vec![TaskSpec::new(TaskKind::Goto { to })];
    assert_eq!(read, DispatchRequest { id: id(), body: DispatchBody::Submit { tasks } });
}

#[test]
fn other_questions() {
    let tasks = vec![TaskId::new(17)];
    for (body, postcard, json) in [
        (
            DispatchBody::CancelAll {},
            "1000112233445566778899aabbccddeeff06",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"cancel_all":{}}}"#,
        ),
        (
            DispatchBody::Cancel { tasks: tasks.clone() },
            "1000112233445566778899aabbccddeeff010103743137",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"cancel":{"tasks":["t17"]}}}"#,
        ),
        (
            DispatchBody::Pause { tasks: tasks.clone() },
            "1000112233445566778899aabbccddeeff020103743137",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"pause":{"tasks":["t17"]}}}"#,
        ),
        (
            DispatchBody::Resume { tasks: tasks.clone() },
            "1000112233445566778899aabbccddeeff030103743137",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"resume":{"tasks":["t17"]}}}"#,
        ),
        (
            DispatchBody::Retry { tasks },
            "1000112233445566778899aabbccddeeff040103743137",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"retry":{"tasks":["t17"]}}}"#,
        ),
        (
            DispatchBody::Show { task: TaskId::new(17) },
            "1000112233445566778899aabbccddeeff0503743137",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"show":{"task":"t17"}}}"#,
        ),
    ] {
        pinned(&DispatchRequest { id: id(), body }, postcard, json);
    }
}

#[test]
fn an_event() {
    pinned(
        &TaskEvent { ledger: 300, entry: 9, task: TaskId::new(17), step: step() },
        "ac02090374313784070401057874622d3102010172",
        concat!(
            r#"{"ledger":300,"entry":9,"task":"t17","step":{"at_ms":900,"state":"held","robot":"xtb-1","#,
            r#""legs_done":2,"reason":"r"}}"#
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
        names::<TaskState>(),
        "queued assigned running blocked held paused cancelling done failed cancelled"
    );
    assert_eq!(names::<OnTakeover>(), "requeue resume fail");
    assert_eq!(
        names::<DispatchCode>(),
        concat!(
            "malformed out_of_range queue_full unknown_robot unknown_tag unknown_capability deadline_past ",
            "keep_out goal_blocked ledger_failed unknown_task wrong_state unconfirmed overloaded"
        )
    );
}
