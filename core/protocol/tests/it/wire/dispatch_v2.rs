//! The bytes of the dispatcher's list of tasks in version 2. This file is never edited to pass: bytes
//! that change need a new version of their type, and a file of their own.

use super::{name, pinned};
use xtb_protocol::codec::{Format, decode, encoding};
use xtb_protocol::messages::{
    LinkLoss, OnTakeover, Suspension, SuspensionCause, TaskId, TaskKind, TaskList, TaskSpec, TaskState,
    TaskView, Waypoint, Who,
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

#[test]
fn the_version() {
    assert_eq!(encoding::<TaskList>(Format::Postcard), "application/x-postcard;xtb.TaskList.v2");
}

#[test]
fn the_list() {
    let list = TaskList {
        ledger: 300,
        at_ms: 950,
        ledger_failed: Some("full".to_owned()),
        tasks: vec![view()],
        left_out: 9,
        suspended: suspended(),
    };
    pinned(
        &list,
        concat!(
            "ac02b607010466756c6c01037431370284070001057874622d3101036c61620201030105636c692d37a006",
            "0101000000000000f83f00000000000000c001000000000000e03f03000000000000e03f0701e807020372",
            "656401010000000000004e400100000000000000400902000105636c692d37a006020100036c6162a00602"
        ),
        concat!(
            r#"{"ledger":300,"at_ms":950,"ledger_failed":"full","tasks":[{"id":"t17","state":"running"#,
            r#"","since_ms":900,"reason":null,"robot":"xtb-1","map":"lab","legs_done":2,"legs":3,"fai"#,
            r#"lures":1,"by":"cli-7","submitted_ms":800,"spec":{"kind":{"route":{"points":[{"x_m":1.5"#,
            r#","y_m":-2.0,"yaw_rad":0.5}],"loops":3,"dwell_s":0.5}},"priority":7,"deadline_ms":1000,"#,
            r#""who":{"tag":"red"},"retries":1,"on_link_loss":"finish","finish_s":60.0,"on_takeover":"#,
            r#""resume","grace_s":2.0}}],"left_out":9,"suspended":[{"cause":{"fleet_stop":{"by":"cli-"#,
            r#"7"}},"since_ms":800,"tasks":2},{"cause":{"other_map":{"of":null,"now":"lab"}},"since_m"#,
            r#"s":800,"tasks":2}]}"#
        ),
    );
}

/// Recordings of version 1 hold lists as JSON.
#[test]
fn what_is_left_out_may_be_left_out_in_json() {
    let json = r#"{"ledger":300,"at_ms":950,"ledger_failed":null,"tasks":[]}"#;
    let (list, _) = decode::<TaskList>("application/json", json.as_bytes()).unwrap();
    assert_eq!((list.left_out, list.suspended), (0, Vec::new()));
}
