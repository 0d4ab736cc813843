//! States and events in JSON, for programs in other languages.

use crate::attacker;
use fleet_tests::processes::{Process, RouterProcess, program};
use fleet_tests::{Fleet, Setup, eventually, name};
use serde_json::Value;
use std::process::Command;
use std::sync::mpsc;
use xtb_bus::SessionRole;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::RobotState;

#[tokio::test(flavor = "multi_thread")]
async fn states_come_in_json_as_they_are_and_events_from_the_last_ones_on() {
    let fleet = Fleet::start(Setup { robots: 2, ..Setup::default() }).await;
    let goal = fleet.goto(1, 0.0, 0.8).await;
    fleet.outcome(1, goal).await;
    let session = attacker::session(fleet.simulator.endpoint()).await;
    let (sender, states) = mpsc::channel();
    let hear = move |sample: zenoh::sample::Sample| {
        let _ = sender.send((sample.encoding().to_string(), sample.payload().to_bytes().into_owned()));
    };
    let _states = session.declare_subscriber(fleet.robot(1).state_json()).callback(hear).await.unwrap();
    let (encoding, first) = eventually("a state", || async { states.try_recv().ok() }).await;
    assert_eq!(encoding, "application/json");
    let first: RobotState = serde_json::from_slice(&first).unwrap();
    let later = |seq| move |bytes: &[u8]| serde_json::from_slice::<RobotState>(bytes).unwrap().seq == seq + 1;
    let is_next = later(first.seq);
    let next = eventually("the next state", || async { states.try_recv().ok() }).await;
    assert!(is_next(&next.1), "no state is left out");

    // An ordinary subscriber gets what happens from now on, an advanced one the last events too.
    use zenoh_ext::{AdvancedSubscriberBuilderExt, HistoryConfig};
    let (sender, events) = mpsc::channel();
    let hear = move |sample: zenoh::sample::Sample| {
        let _ = sender.send(sample.payload().to_bytes().into_owned());
    };
    let _events = session
        .declare_subscriber(fleet.robot(1).event_json())
        .callback(hear)
        .advanced()
        .history(HistoryConfig::default().detect_late_publishers().max_samples(64))
        .await
        .unwrap();
    eventually("the end of the goal", || async {
        let event: Value = serde_json::from_slice(&events.try_recv().ok()?).unwrap();
        let reached = event["kind"]["goal"]["status"] == "reached";
        (reached && event["kind"]["goal"]["id"] == goal.to_string()).then_some(())
    })
    .await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recorder_hears_states_and_makes_nobody_publish_them_in_json() {
    let folder = tempfile::tempdir().unwrap();
    let router = RouterProcess::start(None);
    let mut record = Command::new(program("fleet-cli"));
    record
        .args(["--json", "--connect", router.endpoint(), "record", "--out"])
        .arg(folder.path().join("a.mcap"));
    let (_recorder, ready) = Process::start_ready(&mut record);
    assert!(ready.contains("\"ready\":true"), "{ready}");
    let role = SessionRole::Client { connect: vec![router.endpoint().to_owned()] };
    let bus = xtb_bus::open(&role).await.unwrap();
    let keys = FleetKeys::new(name("lab")).robot(&name("ghost"));
    let states = bus.publisher::<RobotState>(&keys.state(), &Channel::State, Format::Postcard).await.unwrap();
    let json = &keys.state_json();
    let json = bus.publisher::<RobotState>(json, &Channel::StateJson, Format::Json).await.unwrap();
    eventually("the recorder", || async { states.has_listeners().await.then_some(()) }).await;
    assert!(!json.has_listeners().await);

    let session = attacker::session(router.endpoint()).await;
    let _listening = session.declare_subscriber(keys.state_json()).callback(|_| ()).await.unwrap();
    eventually("a listener", || async { json.has_listeners().await.then_some(()) }).await;
    bus.close().await;
}
