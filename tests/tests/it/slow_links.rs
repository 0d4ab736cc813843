//! Verbs over links that are slow, narrow or have gaps.

use fleet_tests::slow_link::{LinkQuality, SlowLink};
use fleet_tests::slow_verbs::{Ended, SlowFleet};
use fleet_tests::{PATIENCE, eventually, name};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use xtb_bus::{Incoming, SessionRole};
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
    let beside = xtb_bus::open(&SessionRole::Client { connect: vec![fleet.router.clone()] }).await.unwrap();
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
async fn stops_and_commands_overtake_states_that_a_narrow_link_cannot_carry() {
    const STATE_BYTES: usize = 8 * 1024;
    /// Sent at once: 16 s of the link.
    const BACKLOG: usize = 500;
    /// Two seconds of the link.
    const MOST_BEFORE: usize = 512 * 1024;
    let router = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = xtb_bus::open(&router).await.unwrap();
    let endpoint = router.locators().await.remove(0);
    let link = SlowLink::open(&endpoint, LinkQuality::throttled(2_000_000), 5).await;
    let robot =
        xtb_bus::open(&SessionRole::Client { connect: vec![link.endpoint().to_owned()] }).await.unwrap();
    let (fleet, client) = (FleetKeys::new(name("lab")), name("lena"));
    let state = fleet.robot(&name("xtb-2")).state();
    let urgent = [
        (fleet.estop_all(Some(&client)), Channel::EstopAll(client.clone())),
        (fleet.robot(&name("xtb-1")).cmd(Some(&client)), Channel::Cmd(client.clone())),
    ];
    // Bytes of states so far, and how many there were before each of the two.
    let arrived = Arc::<Mutex<(usize, [Option<usize>; 2])>>::default();
    let states = arrived.clone();
    let hear = move |incoming: Incoming| states.lock().unwrap().0 += incoming.payload.len();
    let _states = robot.subscribe_raw(&state, hear).await.unwrap();
    let mut subscriptions = Vec::new();
    for (number, (key, _)) in urgent.iter().enumerate() {
        let arrived = arrived.clone();
        let hear = move |_| {
            let mut arrived = arrived.lock().unwrap();
            arrived.1[number] = Some(arrived.0);
        };
        subscriptions.push(robot.subscribe_raw(key, hear).await.unwrap());
    }
    let put = async |key: &str, channel: &Channel, bytes: usize| {
        router.put_raw(key, channel, "zenoh/bytes", vec![7; bytes]).await.unwrap();
    };
    eventually("the robot listens", || async {
        put(&state, &Channel::State, 1).await;
        (arrived.lock().unwrap().0 > 0).then_some(())
    })
    .await;
    for _ in 0..BACKLOG {
        put(&state, &Channel::State, STATE_BYTES).await;
    }
    for (key, channel) in &urgent {
        put(key, channel, 1).await;
    }
    let before = eventually("the stop and the command", || async {
        // They keep coming: what has no priority over them never gets its turn.
        put(&state, &Channel::State, STATE_BYTES).await;
        let [stop, command] = arrived.lock().unwrap().1;
        stop.zip(command)
    })
    .await;
    assert!(before.0.max(before.1) < MOST_BEFORE, "{before:?} bytes of states came before");
    assert!(before.0 > STATE_BYTES, "the link was not congested");
}
