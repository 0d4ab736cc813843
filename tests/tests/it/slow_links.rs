//! Verbs over links that are slow, narrow or have gaps.

use fleet_tests::slow_link::{LinkQuality, SlowLink};
use fleet_tests::slow_verbs::{Ended, SlowFleet};
use fleet_tests::{PATIENCE, eventually, name};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use xtb_bus::{Incoming, Role};
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{GoalStatus, RobotState};

async fn all_work(robots: usize, quality: LinkQuality, seed: u64) {
    let fleet = SlowFleet::start(robots, quality, seed).await;
    let failed: Vec<Ended> = fleet.all().await.into_iter().filter(|ended| ended.code != Some(0)).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_verb_works_over_a_link_of_500_ms_each_way() {
    all_work(2, LinkQuality::delayed(Duration::from_millis(500)), 2).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_verb_works_over_a_link_of_50_kbit_s() {
    all_work(3, LinkQuality::throttled(50_000), 3).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_goal_that_a_gap_in_the_network_ended_points_to_the_policy_for_such_gaps() {
    let fleet = SlowFleet::start(2, LinkQuality::default(), 4).await;
    let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<String>>();
    let mut waiting = std::pin::pin!(fleet.run("goto", words("goto xtb-1 0 4 --via direct --wait")));
    let beside = xtb_bus::open(&Role::Client { connect: vec![fleet.router.clone()] }).await.unwrap();
    let key = FleetKeys::new(name("lab")).robot(&name("xtb-1")).state();
    let status = || async {
        let answers = beside.get(&key, Duration::from_secs(2)).await.unwrap();
        answers.first()?.decode::<RobotState>().unwrap().goal.map(|goal| goal.status)
    };
    let begun = async {
        eventually("a goal that runs", || async {
            status().await.filter(|status| *status == GoalStatus::Running)
        })
        .await;
        fleet.link.stall(true);
        eventually("the goal's end", || async { status().await.filter(|status| status.is_final()) }).await;
        fleet.link.stall(false);
    };
    let both = async { tokio::join!(&mut waiting, begun) };
    let (ended, ()) = tokio::time::timeout(PATIENCE, both).await.unwrap();
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.said.contains("--on-link-loss finish"), "{ended:?}");
    assert!(!ended.said.contains("--take"), "{ended:?}");
}

/// What the network has not carried yet waits in Zenoh's queues, by priority, and not in the system's buffers, in order.
#[tokio::test(flavor = "multi_thread")]
async fn an_emergency_stop_overtakes_what_a_narrow_link_has_not_carried_yet() {
    /// Of states, in a second more than half a minute of the link.
    const STATES: usize = 1000;
    const STATE_BYTES: usize = 8 * 1024;
    /// Two seconds of the link.
    const MOST_BEFORE: usize = 512 * 1024;
    let router = Role::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = xtb_bus::open(&router).await.unwrap();
    let endpoint = router.locators().await.remove(0);
    let link = SlowLink::open(&endpoint, LinkQuality::throttled(2_000_000), 5).await;
    let robot = xtb_bus::open(&Role::Client { connect: vec![link.endpoint().to_owned()] }).await.unwrap();
    let keys = FleetKeys::new(name("lab"));
    let (state, stop) = (keys.robot(&name("xtb-2")).state(), keys.estop_all(Some(&name("lena"))));
    let arrived = Arc::<Mutex<(usize, bool)>>::default();
    let (states, stops) = (arrived.clone(), arrived.clone());
    let hear = move |incoming: Incoming| {
        let mut arrived = states.lock().unwrap();
        arrived.0 += if arrived.1 { 0 } else { incoming.payload.len() };
    };
    let _states = robot.subscribe_raw(&state, hear).await.unwrap();
    let _stops = robot.subscribe_raw(&stop, move |_| stops.lock().unwrap().1 = true).await.unwrap();
    let put = async |key: &str, channel: Channel, bytes: usize| {
        router.put_raw(key, &channel, "zenoh/bytes", vec![7; bytes]).await.unwrap();
    };
    eventually("the robot listens", || async {
        put(&state, Channel::State, 1).await;
        (arrived.lock().unwrap().0 > 0).then_some(())
    })
    .await;
    for _ in 0..STATES {
        put(&state, Channel::State, STATE_BYTES).await;
    }
    put(&stop, Channel::EstopAll(name("lena")), 1).await;
    eventually("the stop", || async { arrived.lock().unwrap().1.then_some(()) }).await;
    let before = arrived.lock().unwrap().0;
    assert!(before < MOST_BEFORE, "{before} bytes of states came before the stop");
    assert!(before > STATE_BYTES, "the link was not congested");
}
