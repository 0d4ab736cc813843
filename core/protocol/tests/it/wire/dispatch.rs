//! The bytes of what the dispatcher and its clients say in version 1, and of assignments in requests of
//! version 2. This file is never edited to pass: bytes that change need a new version of their type, and
//! a file of their own.

use super::{id, name, pinned};
use xtb_protocol::codec::{Format, encoding};
use xtb_protocol::messages::{
    Assignment, Body, Lease, LinkLoss, OnTakeover, Request, TaskAction, TaskEvent, TaskId, TaskState,
    TaskStep, Via,
};

fn request(body: Body) -> Request {
    Request { id: id(), lease: Some(Lease { epoch: 300, root: 2 }), body }
}

fn step() -> TaskStep {
    let reason = Some("r".to_owned());
    TaskStep { at_ms: 900, state: TaskState::Held, robot: Some(name("xtb-1")), legs_done: 2, reason }
}

#[test]
fn the_versions() {
    let encoding = encoding::<TaskEvent>(Format::Postcard);
    assert_eq!(encoding, "application/x-postcard;xtb.TaskEvent.v1");
}

#[test]
fn an_assignment() {
    let assignment = Assignment { ledger: 300, task: TaskId::new(17), assign_seq: 5, leg: 2 };
    assert_eq!(assignment.goal_id().to_string(), "00000000-012c-8000-8000-000001400002");
    let errand = TaskAction::Goto { x_m: 1.5, y_m: -2.0, yaw_rad: None, via: Some(Via::Planned) };
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
    let errand = TaskAction::Wander { for_s: 20.0 };
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
}
