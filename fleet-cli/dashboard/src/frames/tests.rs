//! What a page gets first, and what it gets after that.

use super::*;
use serde_json::{Value, json};
use xtb_client::fake::{self, name};
use xtb_client::messages::AnyMessage;
use xtb_protocol::keys::{FleetKeys, Key};
use xtb_protocol::messages::{
    Arc, MapCell, NavPhase, ParameterInfo, RosterEntry, RouteSource, SimStats, Suspension, SuspensionCause,
    TaskState,
};

fn scene() -> Scene {
    Scene::new(name("lab"))
}

fn keys() -> FleetKeys {
    FleetKeys::new(name("lab"))
}

fn put(scene: &mut Scene, at_ms: AtMs, key: &str, news: impl Into<AnyMessage>) {
    scene.take(at_ms, &Key::parse(key).unwrap(), news.into());
}

fn put_state(scene: &mut Scene, at_ms: AtMs, state: RobotState) {
    let key = keys().robot(&state.robot).state();
    put(scene, at_ms, &key, state);
}

fn moment(n: u64, now_ms: AtMs) -> Moment {
    Moment { n, now_ms, skipped: 3, link: true }
}

fn news(known: &mut Known, scene: &Scene, now_ms: AtMs) -> Vec<Value> {
    let news = known.news(scene, moment(1, now_ms), None);
    news.iter().map(|message| serde_json::to_value(message).unwrap()).collect()
}

fn row(known: &mut Known, scene: &Scene, now_ms: AtMs) -> Value {
    news(known, scene, now_ms).pop().unwrap()["frame"]["robots"][0].take()
}

fn map(bits: u64) -> FleetMap {
    FleetMap {
        name: "room".into(),
        hash: MapHash::new(bits),
        resolution_m: 0.1,
        origin_m: [0.0, 0.0],
        width: 2,
        height: 1,
        cells: vec![(MapCell::Free, 2)],
        zones: Vec::new(),
    }
}

#[test]
fn map_tasks_and_happenings_come_once_and_when_they_change() {
    let (mut known, mut scene) = (Known::default(), scene());
    let kinds = |known: &mut Known, scene: &Scene| {
        let kind = |message: Value| message.as_object().unwrap().keys().next().unwrap().clone();
        news(known, scene, 0).into_iter().map(kind).collect::<Vec<_>>()
    };
    assert_eq!(
        kinds(&mut known, &scene),
        ["map", "places", "frame"],
        "that there is no map, and no place, is told"
    );
    assert_eq!(kinds(&mut known, &scene), ["frame"]);
    put(&mut scene, 0, &keys().map(), map(1));
    let list = TaskList {
        ledger: 1,
        at_ms: 7,
        ledger_failed: None,
        tasks: Vec::new(),
        left_out: 0,
        suspended: Vec::new(),
    };
    put(&mut scene, 0, &keys().dispatch_tasks(), list.clone());
    put(&mut scene, 0, &keys().dispatch_alive(), AnyMessage::Alive(true));
    assert_eq!(kinds(&mut known, &scene), ["map", "map_content", "tasks", "happenings", "frame"]);
    put(&mut scene, 9, &keys().map(), map(1));
    assert_eq!(kinds(&mut known, &scene), ["frame"], "the same map again");
    put(&mut scene, 9, &keys().map(), map(2));
    put(&mut scene, 9, &keys().dispatch_tasks(), list);
    assert_eq!(kinds(&mut known, &scene), ["map", "map_content", "tasks", "frame"]);
}

#[test]
fn alerts_come_when_they_change_and_are_unknown_without_a_dispatcher() {
    let (mut known, mut scene) = (Known::default(), scene());
    let said = |known: &mut Known, scene: &Scene| {
        let all = news(known, scene, 0);
        all.into_iter().find_map(|mut message| message.as_object_mut()?.remove("alerts"))
    };
    let list = |at_ms, left_out| FleetAlerts { at_ms, alerts: Vec::new(), left_out };
    put(&mut scene, 0, &keys().dispatch_alerts(), list(1, 0));
    assert_eq!(said(&mut known, &scene), None, "nobody is known to be there");
    put(&mut scene, 0, &keys().dispatch_alive(), AnyMessage::Alive(true));
    assert_eq!(said(&mut known, &scene), Some(json!({ "at_ms": 1, "alerts": [], "left_out": 0 })));
    put(&mut scene, 9, &keys().dispatch_alerts(), list(2, 0));
    assert_eq!(said(&mut known, &scene), None, "the same, later");
    put(&mut scene, 9, &keys().dispatch_alerts(), list(3, 1));
    assert_eq!(said(&mut known, &scene).unwrap()["left_out"], 1);
    put(&mut scene, 9, &keys().dispatch_alive(), AnyMessage::Alive(false));
    assert_eq!(said(&mut known, &scene), Some(Value::Null));
}

#[test]
fn an_overloaded_simulator_is_told_in_words_as_long_as_it_is_heard() {
    let (mut known, mut scene) = (Known::default(), scene());
    let mut said =
        |scene: &Scene, now_ms| news(&mut known, scene, now_ms).pop().unwrap()["frame"]["simulator"].take();
    assert_eq!(said(&scene, 0), Value::Null);
    let stats = |factor| SimStats { t_s: 1.0, speed: 4.0, real_time_factor: factor, first: None };
    put(&mut scene, 1000, &keys().sim_stats(), stats(Some(0.76)));
    assert_eq!(said(&scene, 2000), "simulator runs at 0.76 × real time, 4 × requested");
    assert_eq!(said(&scene, 9000), Value::Null, "that was long ago");
    put(&mut scene, 9000, &keys().sim_stats(), stats(Some(3.7)));
    assert_eq!(said(&scene, 9000), Value::Null, "fast enough");
}

#[test]
fn only_new_happenings_come() {
    let (mut known, mut scene) = (Known::default(), scene());
    let numbers = |known: &mut Known, scene: &Scene| {
        let all = news(known, scene, 0);
        let found = all.iter().find_map(|message| message["happenings"].as_array());
        found.map(|list| list.iter().map(|one| one["number"].as_u64().unwrap()).collect::<Vec<_>>())
    };
    for there in [true, false] {
        put(&mut scene, 0, &keys().dispatch_alive(), AnyMessage::Alive(there));
    }
    assert_eq!(numbers(&mut known, &scene), Some(vec![1, 2]));
    assert_eq!(numbers(&mut known, &scene), None);
    put(&mut scene, 0, &keys().dispatch_alive(), AnyMessage::Alive(true));
    assert_eq!(numbers(&mut known, &scene), Some(vec![3]));
}

#[test]
fn a_stale_robot_keeps_its_place_and_nothing_else() {
    let (mut known, mut scene) = (Known::default(), scene());
    let mut state = fake::state("xtb-1");
    state.pose.x_m = 1.23456;
    state.latches = vec![fake::latch(Latch::Estop, "cli-1", false)];
    put_state(&mut scene, 1000, state);
    let fresh = row(&mut known, &scene, 1040);
    assert_eq!((&fresh["stale"], &fresh["age_ms"]), (&json!(false), &json!(40)));
    assert_eq!((&fresh["latches"], &fresh["mode"]), (&json!(["estop"]), &json!("idle")));
    assert_eq!(fresh["pose"]["x_m"], json!(1.2346));
    let stale = row(&mut known, &scene, 1501);
    let names = ["name", "alive", "age_ms", "stale", "tags", "pose", "body", "trail", "trail_reset"];
    for (field, value) in stale.as_object().unwrap() {
        assert_eq!(value.is_null(), !names.contains(&field.as_str()), "{field} is {value}");
    }
    assert_eq!((&stale["stale"], &stale["pose"]["x_m"]), (&json!(true), &json!(1.2346)));
}

#[test]
fn who_was_never_heard_has_no_age_and_no_place() {
    let (mut known, mut scene) = (Known::default(), scene());
    scene.expect(RosterEntry { name: name("xtb-7"), tags: vec!["red".into()], start_pose: None });
    let row = row(&mut known, &scene, 0);
    assert_eq!((&row["age_ms"], &row["pose"], &row["stale"]), (&Value::Null, &Value::Null, &json!(true)));
    assert_eq!((&row["alive"], &row["tags"]), (&json!(false), &json!(["red"])));
}

#[test]
fn a_trail_comes_whole_first_and_then_its_new_points() {
    let (mut known, mut scene) = (Known::default(), scene());
    let go = |scene: &mut Scene, x_m: f64| {
        let mut state = fake::state("xtb-1");
        state.pose.x_m = x_m;
        put_state(scene, 0, state);
    };
    go(&mut scene, 0.0);
    go(&mut scene, 1.0);
    let first = row(&mut known, &scene, 0);
    assert_eq!((&first["trail"], &first["trail_reset"]), (&json!([[0.0, 0.0], [1.0, 0.0]]), &json!(true)));
    go(&mut scene, 2.0);
    let second = row(&mut known, &scene, 0);
    assert_eq!((&second["trail"], &second["trail_reset"]), (&json!([[2.0, 0.0]]), &json!(false)));
    for step in 0..xtb_client::scene::TRAIL + 5 {
        go(&mut scene, 3.0 + step as f64);
    }
    let late = row(&mut known, &scene, 0);
    assert_eq!(
        (late["trail"].as_array().unwrap().len(), &late["trail_reset"]),
        (xtb_client::scene::TRAIL, &json!(true))
    );
}

#[test]
fn a_path_comes_with_its_points_once() {
    let (mut known, mut scene) = (Known::default(), scene());
    let route = |length_m: f64, done_m: f64| {
        let arcs = vec![Arc { length_m, curvature_per_m: 0.0 }, Arc { length_m: 0.2, curvature_per_m: 1.0 }];
        RouteState {
            source: RouteSource::Own,
            plan: 0,
            phase: NavPhase::Following,
            track: Some(Track { start: MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 }, arcs }),
            done_m,
            release_m: 1.2,
            off_m: 0.0,
            waits_for: None,
            blocked_at_m: None,
            plans: 1,
        }
    };
    let mut path = |route: Option<RouteState>| {
        let mut state = fake::state("xtb-1");
        state.nav.route = route;
        put_state(&mut scene, 0, state);
        row(&mut known, &scene, 0)["path"].take()
    };
    let first = path(Some(route(1.0, 0.0)));
    let points = first["points"].as_array().unwrap();
    assert_eq!((&points[0], &points[1], points.len()), (&json!([0.0, 0.0]), &json!([1.0, 0.0]), 4));
    let second = path(Some(route(1.0, 0.5)));
    assert_eq!(second, json!({ "plan": first["plan"], "done_m": 0.5, "release_m": 1.2 }));
    let other = path(Some(route(2.0, 0.0)));
    assert!(other["points"].is_array() && other["plan"] != first["plan"]);
    assert_eq!(path(None), Value::Null);
    assert!(path(Some(route(2.0, 0.1)))["points"].is_array(), "the page has dropped it meanwhile");
}

#[test]
fn the_reference_is_known_with_the_factsheet() {
    let (mut known, mut scene) = (Known::default(), scene());
    let mut state = fake::state("xtb-1");
    state.reference_rpm = 60.0;
    put_state(&mut scene, 0, state);
    assert_eq!(row(&mut known, &scene, 0)["reference_mps"], Value::Null);
    let mut about = fake::about("xtb-1", "");
    let text = |text: &str| text.to_owned();
    let (name, value) = (text("geometry.wheel_diameter_m"), text("0.1"));
    about.vehicle = vec![ParameterInfo { name, value, unit: text("m"), origin: text("ours") }];
    put(&mut scene, 0, &keys().robot(&about.robot.clone()).about(), about);
    assert_eq!(row(&mut known, &scene, 0)["reference_mps"], json!(0.3142));
}

#[test]
fn a_start_pose_of_the_roster_is_sent_once_and_again_when_it_changes() {
    let (mut known, mut scene) = (Known::default(), scene());
    let mut sent = |x_m: f64| {
        let start_pose = Some(MapPose { x_m, y_m: 2.0, yaw_rad: 0.5 });
        scene.expect(RosterEntry { name: name("xtb-1"), tags: Vec::new(), start_pose });
        row(&mut known, &scene, 0).get("start").cloned()
    };
    assert_eq!(sent(1.0), Some(json!({ "x_m": 1.0, "y_m": 2.0, "yaw_rad": 0.5 })));
    assert_eq!(sent(1.0), None);
    assert_eq!(sent(3.0).unwrap()["x_m"], 3.0);
}

#[test]
fn a_body_is_sent_once_and_again_when_a_factsheet_says_otherwise() {
    let (mut known, mut scene) = (Known::default(), scene());
    put_state(&mut scene, 0, fake::state("xtb-1"));
    let first = row(&mut known, &scene, 0)["body"].clone();
    assert_eq!((&first["ahead_m"], first["front"].as_array().unwrap().len()), (&json!(0.0), 6), "an XTB's");
    assert!(row(&mut known, &scene, 0).get("body").is_none());
    let text = |text: &str| text.to_owned();
    let info = |(name, value): (&str, &str)| {
        let (name, value) = (text(name), text(value));
        ParameterInfo { name, value, unit: text(""), origin: text("ours") }
    };
    let mut about = fake::about("xtb-1", "");
    about.vehicle = [
        ("drivetrain", "\"front_axle\""),
        ("geometry.body_ahead_m", "0.02"),
        ("geometry.wheelbase_m", "0.3"),
        ("geometry.body_length_m", "0.4"),
        ("geometry.body_width_m", "0.2"),
        ("steering.stop_deg", "20.0"),
        ("range_finders.front", "[{ left_m = 0.0, ahead_m = -0.1 }]"),
    ]
    .map(info)
    .to_vec();
    put(&mut scene, 0, &keys().robot(&about.robot.clone()).about(), about);
    let body = row(&mut known, &scene, 0)["body"].clone();
    assert!((body["ahead_m"].as_f64().unwrap() - 0.17).abs() < 1e-9, "{body}");
    assert!((body["front"][0]["ahead_m"].as_f64().unwrap() - 0.27).abs() < 1e-9, "{body}");
    assert_eq!((body["front"].as_array().unwrap().len(), body["rear"].as_array().unwrap().len()), (1, 6));
}

#[test]
fn a_robot_has_the_task_it_is_at_while_there_is_a_dispatcher() {
    let (mut known, mut scene) = (Known::default(), scene());
    put_state(&mut scene, 0, fake::state("xtb-1"));
    let tasks = vec![fake::task(3, TaskState::Done), fake::task(4, TaskState::Running)];
    let list =
        TaskList { ledger: 1, at_ms: 7, ledger_failed: None, tasks, left_out: 0, suspended: Vec::new() };
    put(&mut scene, 0, &keys().dispatch_tasks(), list);
    assert_eq!(row(&mut known, &scene, 0)["task"], Value::Null);
    put(&mut scene, 0, &keys().dispatch_alive(), AnyMessage::Alive(true));
    assert_eq!(row(&mut known, &scene, 0)["task"], json!("t4"));
}

#[test]
fn a_frame_says_what_is_suspended_in_the_words_of_every_screen() {
    let (mut known, mut scene) = (Known::default(), scene());
    let cause = SuspensionCause::OtherMap { of: Some("lab".into()), now: "hall".into() };
    let suspended = vec![Suspension { cause, since_ms: 5, tasks: 12 }];
    let list =
        TaskList { ledger: 1, at_ms: 7, ledger_failed: None, tasks: Vec::new(), left_out: 0, suspended };
    put(&mut scene, 0, &keys().dispatch_tasks(), list);
    put(&mut scene, 0, &keys().dispatch_alive(), AnyMessage::Alive(true));
    let news = known.news(&scene, moment(1, 0), None);
    let said = &serde_json::to_value(news.last().unwrap()).unwrap()["frame"]["suspended"][0];
    assert_eq!(said["text"], json!("12 open tasks of map lab are suspended: the fleet's map is hall"));
    assert_eq!(said["all"], json!(false));
    assert!(said["remedy"].as_str().unwrap().contains("dispatch adopt"), "{said}");
}

#[test]
fn details_are_of_the_robot_that_is_watched_and_not_of_the_past() {
    let (mut known, mut scene) = (Known::default(), scene());
    put_state(&mut scene, 1000, fake::state("xtb-1"));
    let mut detail = |robot: &str, now_ms| {
        let news = known.news(&scene, moment(1, now_ms), Some(&name(robot)));
        serde_json::to_value(news.last().unwrap()).unwrap()["frame"]["detail"].take()
    };
    assert_eq!(detail("xtb-1", 1000)["state"]["robot"], json!("xtb-1"));
    assert_eq!(detail("xtb-1", 1501)["state"], Value::Null);
    assert_eq!(detail("xtb-2", 1000), Value::Null);
}
