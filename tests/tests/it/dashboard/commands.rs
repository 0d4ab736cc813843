//! What a page sees, and what it can ask for.

use super::Rig;
use fleet_tests::processes::{Process, Signal, program};
use fleet_tests::{Fleet, PATIENCE, Setup, eventually, name};
use serde_json::{Value, json};
use std::process::Command;
use std::time::{Duration, Instant};
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{FleetMap, MapCell, MapHash};

#[tokio::test(flavor = "multi_thread")]
async fn a_page_is_told_who_serves_it_then_the_map_then_frames() {
    let rig = Rig::start(Setup { robots: 2, ..Setup::default() }).await;
    let mut page = rig.page().await;
    assert_eq!((&page.hello["fleet"], &page.hello["writable"]), (&json!("lab"), &json!(true)));
    assert!(page.hello["client"].as_str().unwrap().starts_with("web-"), "{}", page.hello);
    assert!(page.map.is_some(), "that there is none is told too");
    let map = FleetMap {
        name: "strip".into(),
        hash: MapHash::new(7),
        resolution_m: 0.5,
        origin_m: [-10.0, -10.0],
        width: 40,
        height: 40,
        cells: vec![(MapCell::Free, 1600)],
        zones: Vec::new(),
    };
    let key = FleetKeys::new(name("lab")).map();
    let hash = json!(map.hash);
    // More than once: the first one may be put before this session has heard who listens.
    let hears = async {
        while page.map.as_ref().is_none_or(|map| map["hash"] != hash) {
            rig.fleet.bus.put(&key, &Channel::Map, &map, Format::Json).await.unwrap();
            page.take().await.expect("the page is served on");
        }
    };
    tokio::time::timeout(PATIENCE, hears).await.expect("waited in vain for the map");
    page.say(&json!({ "watch": "xtb-2" })).await;
    let detail = page
        .until("details with a factsheet and samples", |page| {
            let detail = &page.frame["detail"];
            let whole = detail["about"].is_object() && detail["sensors"].is_object();
            (detail["robot"] == "xtb-2" && whole).then(|| detail.clone())
        })
        .await;
    assert_eq!(detail["state"]["robot"], "xtb-2");
    let row = page.row("xtb-2");
    assert!(row["reference_mps"].is_number() && row["ir_cm"]["front"].is_array(), "{row}");
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_goal_from_the_page_is_reached_and_leaves_a_trail() {
    let rig = Rig::start(Setup::default()).await;
    let mut page = rig.page().await;
    let start = rig.fleet.truth(1);
    let (x_m, y_m) = (start.x_m, start.y_m + 1.2);
    let goto = json!({ "goto": { "robot": "xtb-1", "x_m": x_m, "y_m": y_m, "yaw_rad": null } });
    let answer = page.ask(goto).await;
    assert_eq!(answer["ok"]["status"], "accepted", "{answer}");
    let mut trail = 0;
    page.until("the goal", |page| {
        let row = page.row("xtb-1");
        trail += row["trail"].as_array().map_or(0, Vec::len);
        (row["goal"]["status"] == "reached").then_some(())
    })
    .await;
    assert!(trail > 10, "{trail} points");
    let state = rig.fleet.until(1, "the lease given back", |state| state.lease.is_none()).await;
    assert!(state.goal.unwrap().by.as_str().starts_with("web-"));
    assert!(!page.happenings.is_empty());
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_emergency_stop_of_all_latches_all_and_says_so() {
    let rig = Rig::start(Setup { robots: 3, ..Setup::default() }).await;
    let mut page = rig.page().await;
    let answer = page.ask(json!({ "estop": { "robot": null } })).await;
    assert_eq!(answer["ok"]["complete"], json!(true), "{answer}");
    for number in 1..=3 {
        assert_eq!(answer["ok"]["robots"][format!("xtb-{number}")], "stopped", "{answer}");
    }
    let latched =
        |page: &super::Page| page.rows().all(|row| row["latches"] == json!(["estop"])).then_some(());
    page.until("all latched", latched).await;
    let refused = page.ask(json!({ "goto": { "robot": "xtb-2", "x_m": 0.0, "y_m": 1.0 } })).await;
    assert_eq!(refused["error"]["code"], "latched", "{refused}");
    let reset = page.ask(json!({ "reset": { "robot": "xtb-2" } })).await;
    assert_eq!(reset["ok"]["cleared"], json!(["estop"]), "{reset}");
    page.until("reset", |page| (page.row("xtb-2")["latches"] == json!([])).then_some(())).await;
    // What the person was not shown stays latched.
    let reset = page.ask(json!({ "reset_all": { "shown": { "xtb-2": ["estop"], "xtb-3": [] } } })).await;
    for robot in ["xtb-1", "xtb-3"] {
        let refused = reset["ok"]["robots"][robot]["refused"].as_str().unwrap();
        assert!(refused.contains("latched after the question"), "{reset}");
        assert_eq!(page.row(robot)["latches"], json!(["estop"]), "{reset}");
    }
    // The other two at once.
    let reset = page.ask(json!({ "reset_all": {} })).await;
    let robots = reset["ok"]["robots"].as_object().unwrap();
    assert_eq!(robots.keys().collect::<Vec<_>>(), ["xtb-1", "xtb-3"], "{reset}");
    assert!(robots.values().all(|robot| robot["cleared"] == json!(["estop"])), "{reset}");
    assert_eq!(reset["ok"]["unknown"], json!([]), "{reset}");
    page.until("all reset", |page| page.rows().all(|row| row["latches"] == json!([])).then_some(())).await;
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_dispatcher_a_task_is_refused_with_what_to_do() {
    let rig = Rig::start(Setup::default()).await;
    let mut page = rig.page().await;
    let spec = json!({ "kind": { "wander": { "for_s": 5 } } });
    let answer = page.ask(json!({ "submit": { "spec": spec } })).await;
    assert_eq!(answer["error"]["code"], "no_dispatcher", "{answer}");
    assert!(answer["error"]["hint"].as_str().unwrap().contains("dispatch serve"), "{answer}");
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dashboard_that_only_shows_refuses_everything() {
    let rig = Rig::with(Setup::default(), |settings| settings.read_only = true).await;
    let mut page = rig.page().await;
    assert_eq!(page.hello["writable"], json!(false));
    assert!(page.hello["why_not"].as_str().unwrap().contains("--read-only"));
    for command in [
        json!({ "goto": { "robot": "xtb-1", "x_m": 0.0, "y_m": 1.0 } }),
        json!({ "stop": { "robot": null } }),
        json!({ "estop": { "robot": null } }),
        json!({ "reset": { "robot": "xtb-1" } }),
        json!({ "reset_all": {} }),
        json!({ "teleop": { "robot": "xtb-1", "take": true } }),
        json!({ "teleop_end": {} }),
        json!({ "cancel": { "task": "t1" } }),
    ] {
        let answer = page.ask(command.clone()).await;
        assert!(answer["error"]["message"].as_str().unwrap().contains("no commands"), "{command}: {answer}");
    }
    let state = rig.fleet.state(1).await;
    assert!(state.latches.is_empty() && state.goal.is_none() && state.lease.is_none());
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_program_says_where_it_is_and_ends_its_sockets_with_a_word() {
    let fleet = Fleet::start(Setup::default()).await;
    let mut command = Command::new(program("fleet-cli"));
    command.args(["--json", "--connect", fleet.simulator.endpoint(), "dashboard", "--listen", "127.0.0.1:0"]);
    let (mut process, line) = Process::start_ready(&mut command);
    let ready: Value = serde_json::from_str(&line).unwrap();
    let address = ready["address"].as_str().unwrap().parse().unwrap();
    assert_eq!(ready["url"], json!(format!("http://{address}/")));
    let mut page = super::Page::open(address).await;
    page.until("frames", |page| (page.frames > 2).then_some(())).await;
    let asked = Instant::now();
    process.signal(Signal::Interrupt);
    let mut closed = None;
    while let Some(message) = futures_util::StreamExt::next(&mut page.socket).await {
        if let Ok(tokio_tungstenite::tungstenite::Message::Close(frame)) = message {
            closed = frame;
        }
    }
    assert_eq!(closed.unwrap().reason.as_str(), "dashboard stopped");
    let told = asked.elapsed();
    eventually("the end", || std::future::ready((!process.runs()).then_some(()))).await;
    eprintln!("closed after {told:?}, ended after {:?}", asked.elapsed());
    assert!(asked.elapsed() < Duration::from_secs(10), "{:?}", asked.elapsed());
    fleet.end().await;
}
