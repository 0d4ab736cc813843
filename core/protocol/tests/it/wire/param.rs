//! The bytes of questions about settings, and of who is at a dock.

use super::{name, pinned};
use xtb_protocol::Uuid;
use xtb_protocol::messages::{
    FleetHomes, HomeStatus, Lease, Message, ParamBody, ParamCareful, ParamChange, ParamCode, ParamInfo,
    ParamList, ParamOutcome, ParamReply, ParamRequest, ParamValue, ParamWhen, RobotHome, TaskId,
};

fn limit(value: f64) -> ParamValue {
    ParamValue { name: "navigation.drive.limit_mps".into(), value }
}

#[test]
fn questions_about_settings() {
    let id = Uuid::from_u128(0x1122);
    let lease = Some(Lease { epoch: 7, root: 3 });
    pinned(
        &ParamRequest { id, lease, body: ParamBody::Set { values: vec![limit(0.25)] } },
        "100000000000000000000000000000112201070301011a6e617669676174696f6e2e64726976652e6c696d69745f6d7073000000000000d03f",
        r#"{"id":"00000000-0000-0000-0000-000000001122","lease":{"epoch":7,"root":3},"body":{"set":{"values":[{"name":"navigation.drive.limit_mps","value":0.25}]}}}"#,
    );
    pinned(
        &ParamRequest { id, lease: None, body: ParamBody::List {} },
        "10000000000000000000000000000011220000",
        r#"{"id":"00000000-0000-0000-0000-000000001122","lease":null,"body":{"list":{}}}"#,
    );
    pinned(
        &ParamRequest { id, lease: None, body: ParamBody::Save {} },
        "10000000000000000000000000000011220002",
        r#"{"id":"00000000-0000-0000-0000-000000001122","lease":null,"body":{"save":{}}}"#,
    );
}

#[test]
fn answers_about_settings() {
    let id = Uuid::from_u128(0x1122);
    let param = ParamInfo {
        name: "navigation.drive.limit_mps".into(),
        value: 0.25,
        saved: 1.0,
        unit: "m/s".into(),
        min: 0.5,
        max: 1.0,
        when: ParamWhen::Always,
        careful: ParamCareful::Lower,
        about: "Fast.".into(),
    };
    let change =
        ParamChange { tick_ms: 1000, age_ms: 20, by: name("bob"), name: "a.b".into(), from: 1.0, to: 0.25 };
    let list = ParamList { params: vec![param], changes: vec![change] };
    pinned(
        &ParamReply { id, result: ParamOutcome::Ok(list) },
        "100000000000000000000000000000112200011a6e617669676174696f6e2e64726976652e6c696d69745f6d7073000000000000d03f000000000000f03f036d2f73000000000000e03f000000000000f03f000105466173742e01e8071403626f6203612e62000000000000f03f000000000000d03f",
        r#"{"id":"00000000-0000-0000-0000-000000001122","result":{"ok":{"params":[{"name":"navigation.drive.limit_mps","value":0.25,"saved":1.0,"unit":"m/s","min":0.5,"max":1.0,"when":"always","careful":"lower","about":"Fast."}],"changes":[{"tick_ms":1000,"age_ms":20,"by":"bob","name":"a.b","from":1.0,"to":0.25}]}}}"#,
    );
    pinned(
        &ParamReply::refused(id, ParamCode::Driving, "no", "stop"),
        "10000000000000000000000000000011220104026e6f0473746f70",
        r#"{"id":"00000000-0000-0000-0000-000000001122","result":{"error":{"code":"driving","message":"no","hint":"stop"}}}"#,
    );
}

#[test]
fn questions_and_answers_that_cannot_be_are_refused() {
    let id = Uuid::nil();
    let set = |values: Vec<ParamValue>| ParamRequest { id, lease: None, body: ParamBody::Set { values } };
    assert!(set(vec![limit(0.2)]).validate().is_ok());
    for values in [vec![], vec![limit(f64::NAN)], vec![limit(0.2); 65]] {
        assert!(set(values.clone()).validate().is_err(), "{values:?}");
    }
}

#[test]
fn who_is_at_a_dock() {
    let on_the_way = RobotHome {
        robot: name("xtb-1"),
        status: HomeStatus::OnTheWay,
        place: Some(name("dock-1")),
        task: Some(TaskId::new(17)),
        battery_v: Some(7.0),
        why: "battery low".into(),
    };
    let waits = RobotHome {
        robot: name("xtb-2"),
        status: HomeStatus::NeedsHelp,
        place: None,
        task: None,
        battery_v: None,
        why: String::new(),
    };
    let homes = FleetHomes { active: true, robots: vec![on_the_way, waits] };
    pinned(
        &homes,
        "0102057874622d31000106646f636b2d310103743137010000000000001c400b62617474657279206c6f77057874622d320700000000",
        r#"{"active":true,"robots":[{"robot":"xtb-1","status":"on_the_way","place":"dock-1","task":"t17","battery_v":7.0,"why":"battery low"},{"robot":"xtb-2","status":"needs_help","place":null,"task":null,"battery_v":null,"why":""}]}"#,
    );
    let robots = vec![RobotHome { battery_v: Some(f64::INFINITY), ..homes.robots[0].clone() }];
    assert!(FleetHomes { active: true, robots }.validate().is_err());
}
