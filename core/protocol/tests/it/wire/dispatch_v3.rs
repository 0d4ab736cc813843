//! The bytes of what the dispatcher and its clients say in version 3. This file is never edited to pass: bytes
//! that change need a new version of their type, and a file of their own.

use super::{id, name, pinned};
use xtb_protocol::codec::{Format, decode, encoding};
use xtb_protocol::messages::{
    Adopted, DispatchBody, DispatchCode, DispatchError, DispatchOutcome, DispatchReply, DispatchRequest,
    DispatchStatus, LinkLoss, OnTakeover, Suspension, SuspensionCause, TaskChange, TaskHistory, TaskId,
    TaskKind, TaskSpec, TaskState, TaskStep, TaskView, Waypoint, Who,
};

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
        map: Some("lab".to_owned()),
        legs_done: 2,
        legs: Some(3),
        failures: 1,
        by: name("cli-7"),
        submitted_ms: 800,
        spec: spec(),
    }
}

fn suspended() -> Vec<Suspension> {
    let stop = SuspensionCause::FleetStop { by: Some(name("cli-7")) };
    let map = SuspensionCause::OtherMap { of: None, now: "lab".to_owned() };
    let suspension = |cause| Suspension { cause, since_ms: 800, tasks: 2 };
    vec![suspension(stop), suspension(map)]
}

fn error() -> DispatchError {
    DispatchError { code: DispatchCode::Unconfirmed, message: "m".to_owned(), hint: "h".to_owned() }
}

#[test]
fn the_versions() {
    for (encoding, name) in [
        (encoding::<DispatchRequest>(Format::Postcard), "DispatchRequest"),
        (encoding::<DispatchReply>(Format::Postcard), "DispatchReply"),
    ] {
        assert_eq!(encoding, format!("application/x-postcard;xtb.{name}.v3"));
    }
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
        (
            DispatchBody::Activate {},
            "1000112233445566778899aabbccddeeff07",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"activate":{}}}"#,
        ),
        (
            DispatchBody::Adopt {},
            "1000112233445566778899aabbccddeeff08",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"adopt":{}}}"#,
        ),
        (
            DispatchBody::Status {},
            "1000112233445566778899aabbccddeeff09",
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"status":{}}}"#,
        ),
        (
            DispatchBody::Extend { task: TaskId::new(17), after: 2, points: vec![point()] },
            concat!(
                "1000112233445566778899aabbccddeeff0a037431370201000000000000f83f00000000000000c0010000",
                "00000000e03f"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"extend":{"task":"t17","after":2"#,
                r#","points":[{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5}]}}}"#
            ),
        ),
    ] {
        pinned(&DispatchRequest { id: id(), body }, postcard, json);
    }
}

#[test]
fn answers() {
    let change = TaskChange { id: TaskId::new(17), state: Some(TaskState::Cancelling), error: Some(error()) };
    let history = TaskHistory { task: view(), steps: vec![step()], left_out: 4 };
    for (result, postcard, json) in [
        (
            DispatchOutcome::Submitted(vec![TaskId::new(17)]),
            concat!(
                "1000112233445566778899aabbccddeeff0001037431370502000105636c692d37a006020100036c6162a0",
                "0602"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"submitted":["t17"]},"left_out""#,
                r#":5,"suspended":[{"cause":{"fleet_stop":{"by":"cli-7"}},"since_ms":800,"tasks":2},{"cau"#,
                r#"se":{"other_map":{"of":null,"now":"lab"}},"since_ms":800,"tasks":2}]}"#
            ),
        ),
        (
            DispatchOutcome::Changed(vec![change]),
            concat!(
                "1000112233445566778899aabbccddeeff0101037431370106010c016d01680502000105636c692d37a006",
                "020100036c6162a00602"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"changed":[{"id":"t17","state":"#,
                r#""cancelling","error":{"code":"unconfirmed","message":"m","hint":"h"}}]},"left_out":5,""#,
                r#"suspended":[{"cause":{"fleet_stop":{"by":"cli-7"}},"since_ms":800,"tasks":2},{"cause":"#,
                r#"{"other_map":{"of":null,"now":"lab"}},"since_ms":800,"tasks":2}]}"#
            ),
        ),
        (
            DispatchOutcome::Shown(Box::new(history)),
            concat!(
                "1000112233445566778899aabbccddeeff02037431370284070001057874622d3101036c61620201030105",
                "636c692d37a0060101000000000000f83f00000000000000c001000000000000e03f03000000000000e03f",
                "0701e807020372656401010000000000004e400100000000000000400184070401057874622d3102010172",
                "040502000105636c692d37a006020100036c6162a00602"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"shown":{"task":{"id":"t17","st"#,
                r#"ate":"running","since_ms":900,"reason":null,"robot":"xtb-1","map":"lab","legs_done":2,"#,
                r#""legs":3,"failures":1,"by":"cli-7","submitted_ms":800,"spec":{"kind":{"route":{"points"#,
                r#"":[{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5}],"loops":3,"dwell_s":0.5}},"priority":7,"deadl"#,
                r#"ine_ms":1000,"who":{"tag":"red"},"retries":1,"on_link_loss":"finish","finish_s":60.0,""#,
                r#"on_takeover":"resume","grace_s":2.0}},"steps":[{"at_ms":900,"state":"held","robot":"xt"#,
                r#"b-1","legs_done":2,"reason":"r"}],"left_out":4}},"left_out":5,"suspended":[{"cause":{""#,
                r#"fleet_stop":{"by":"cli-7"}},"since_ms":800,"tasks":2},{"cause":{"other_map":{"of":null"#,
                r#","now":"lab"}},"since_ms":800,"tasks":2}]}"#
            ),
        ),
        (
            DispatchOutcome::Error(error()),
            concat!(
                "1000112233445566778899aabbccddeeff030c016d01680502000105636c692d37a006020100036c6162a0",
                "0602"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"error":{"code":"unconfirmed",""#,
                r#"message":"m","hint":"h"}},"left_out":5,"suspended":[{"cause":{"fleet_stop":{"by":"cli-"#,
                r#"7"}},"since_ms":800,"tasks":2},{"cause":{"other_map":{"of":null,"now":"lab"}},"since_m"#,
                r#"s":800,"tasks":2}]}"#
            ),
        ),
        (
            DispatchOutcome::Activated(suspended().pop()),
            concat!(
                "1000112233445566778899aabbccddeeff04010100036c6162a006020502000105636c692d37a006020100",
                "036c6162a00602"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"activated":{"cause":{"other_ma"#,
                r#"p":{"of":null,"now":"lab"}},"since_ms":800,"tasks":2}},"left_out":5,"suspended":[{"cau"#,
                r#"se":{"fleet_stop":{"by":"cli-7"}},"since_ms":800,"tasks":2},{"cause":{"other_map":{"of"#,
                r#"":null,"now":"lab"}},"since_ms":800,"tasks":2}]}"#
            ),
        ),
        (
            DispatchOutcome::Adopted(Adopted { map: Some("lab".to_owned()), tasks: vec![TaskId::new(17)] }),
            concat!(
                "1000112233445566778899aabbccddeeff0501036c616201037431370502000105636c692d37a006020100",
                "036c6162a00602"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"adopted":{"map":"lab","tasks":"#,
                r#"["t17"]}},"left_out":5,"suspended":[{"cause":{"fleet_stop":{"by":"cli-7"}},"since_ms":"#,
                r#"800,"tasks":2},{"cause":{"other_map":{"of":null,"now":"lab"}},"since_ms":800,"tasks":2"#,
                r#"}]}"#
            ),
        ),
        (
            DispatchOutcome::Status(DispatchStatus {
                ledger: 300,
                ledger_failed: None,
                map: Some("lab".to_owned()),
                tasks: 9,
                open: 3,
                assigned: 2,
                robots: 4,
            }),
            concat!(
                "1000112233445566778899aabbccddeeff06ac020001036c6162090302040502000105636c692d37a00602",
                "0100036c6162a00602"
            ),
            concat!(
                r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"status":{"ledger":300,"ledger_"#,
                r#"failed":null,"map":"lab","tasks":9,"open":3,"assigned":2,"robots":4}},"left_out":5,"su"#,
                r#"spended":[{"cause":{"fleet_stop":{"by":"cli-7"}},"since_ms":800,"tasks":2},{"cause":{""#,
                r#"other_map":{"of":null,"now":"lab"}},"since_ms":800,"tasks":2}]}"#
            ),
        ),
    ] {
        pinned(&DispatchReply { id: id(), result, left_out: 5, suspended: suspended() }, postcard, json);
    }
}

#[test]
fn an_extension_of_other_points_than_the_client_believes() {
    let error = DispatchError { code: DispatchCode::Stale, ..error() };
    let reply =
        DispatchReply { id: id(), result: DispatchOutcome::Error(error), left_out: 0, suspended: vec![] };
    pinned(
        &reply,
        "1000112233445566778899aabbccddeeff030e016d01680000",
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"error":{"code":"stale","message""#,
            r#":"m","hint":"h"}},"left_out":0,"suspended":[]}"#
        ),
    );
}

/// A name put in between, or taken away, would change the meaning of all that follow.
#[test]
fn the_numbers_of_the_codes() {
    let known = (0_u8..128).map_while(|number| postcard::from_bytes::<DispatchCode>(&[number]).ok());
    let names: Vec<String> =
        known.map(|code| serde_json::to_string(&code).unwrap().replace('"', "")).collect();
    assert_eq!(
        names.join(" "),
        concat!(
            "malformed out_of_range queue_full unknown_robot unknown_tag unknown_capability deadline_past ",
            "keep_out goal_blocked ledger_failed unknown_task wrong_state unconfirmed overloaded stale"
        )
    );
}

/// Recordings of earlier versions hold answers as JSON.
#[test]
fn what_is_left_out_may_be_left_out_in_json() {
    let json = r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","result":{"submitted":["t17"]}}"#;
    assert_eq!(decode::<DispatchReply>("application/json", json.as_bytes()).unwrap().0.left_out, 0);
}
