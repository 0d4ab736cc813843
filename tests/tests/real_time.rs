//! Kills, stops and floods with real processes at real time, a few times each; the bench `safety` counts
//! to hundreds. A binary of its own, one test at a time: beside sixty others a world would stand still
//! long enough to look like broken lines.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use fleet_tests::load::{self, Flood};
use fleet_tests::mesh::Mesh;
use fleet_tests::slow_link::{LinkQuality, SlowLink};
use fleet_tests::{Rig, eventually, name};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::Mutex;
use xtb_bus::{Opening, SessionRole};
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{GoalState, GoalStatus};

/// Held by the test that runs.
static MACHINE: Mutex<()> = Mutex::const_new(());

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_agent_is_neutral_within_200_ms_and_its_successor_does_not_move() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::start(1, folder.path(), false).await;
    for after_s in [0.0, 0.7] {
        let trial = rig.kill_agent(1, after_s).await;
        assert!(trial.neutral_s <= 0.2 && !trial.moved, "{trial:?}");
    }
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frozen_agent_is_neutral_within_200_ms_and_does_not_go_on_when_it_is_woken() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::start(1, folder.path(), false).await;
    for stopped_s in [0.0, 1.5] {
        let trial = rig.freeze_agent(1, stopped_s).await;
        assert!(trial.neutral_s <= 0.2 && !trial.moved, "{trial:?}");
    }
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dead_router_ends_teleop_and_goals_that_halt_and_no_others() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::start(3, folder.path(), true).await;
    let (teleop, halt, missed) = rig.kill_router().await;
    // The bench holds the limits of 250 and 700 ms; a busy machine delays the agents' own threads.
    assert!(teleop.neutral_s <= 0.5 && !teleop.moved, "{teleop:?}");
    assert!(halt.neutral_s <= 1.4 && !halt.moved, "{halt:?}");
    assert_eq!(missed, None);
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_stop_is_lost_under_load() {
    let _alone = MACHINE.lock().await;
    for identities in [false, true] {
        let stops = load::stops(20, 1, identities).await;
        assert_eq!((stops.lost, stops.took.len()), (0, 20), "with identities: {identities}");
        assert!(stops.others_per_s > 0.0);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flood_of_strangers_stops_neither_the_robot_nor_its_states() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::start(1, folder.path(), false).await;
    let flooded =
        load::flood(&rig, async |router| Flood::from(router, 5).await, Duration::from_secs(3)).await;
    assert!(flooded.stood.is_none() && flooded.arrived_per_s > 0.0, "{:?}", flooded.stood);
    assert!(flooded.growth_kib <= 32 * 1024, "{} KiB", flooded.growth_kib);
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_of_a_dead_router_go_on_at_another_one_and_the_others_do_not_notice() {
    let _alone = MACHINE.lock().await;
    for identities in [false, true] {
        let mut mesh = match Mesh::start(identities).await {
            Ok(mesh) => mesh,
            Err(why) => return skip(&format!("no network namespaces here: {why}")),
        };
        let failover = mesh.kill_router().await;
        assert!(failover.gap_s <= 5.0 && failover.others_gap_s <= 1.0, "{failover:?}");
        let runs = |goal: &GoalState| !goal.status.is_final();
        assert!(runs(&failover.elsewhere) && runs(&failover.finishing), "{failover:?}");
        assert_eq!(failover.halting.status, GoalStatus::Failed, "{failover:?}");
        mesh.lists_all().await;
        mesh.restart_router().await;
    }
}

/// A computer that falls asleep, or leaves the radio cell, while it listens to the whole fleet.
#[tokio::test(flavor = "multi_thread")]
async fn who_listens_over_a_dead_link_holds_up_nobody_else() {
    const STATE_BYTES: usize = 8 * 1024;
    /// More than the link and the system's buffers hold, many times.
    const STATES: usize = 4000;
    /// Zenoh waits 5 s for a queue before it closes the link behind it.
    const MOST_SILENT: Duration = Duration::from_secs(3);
    /// Nobody takes the dead link for lost meanwhile.
    const LEASE: Duration = Duration::from_secs(300);
    let _alone = MACHINE.lock().await; // Zenoh's threads belong to the process
    let open = |role| Opening::of(role).link_lease(LEASE);
    let router = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = open(router).once().await.unwrap();
    let endpoint = router.locators().await.remove(0);
    let link = SlowLink::open(&endpoint, LinkQuality::default(), 6).await;
    let client = |endpoint: &str| open(SessionRole::Client { connect: vec![endpoint.to_owned()] });
    let asleep = client(link.endpoint()).once().await.unwrap();
    let awake = client(&endpoint).once().await.unwrap();
    let fleet = FleetKeys::new(name("lab"));
    let estop_all = fleet.estop_all(Some(&name("cli-1")));
    let mut robots = Vec::new();
    for number in 1..=3 {
        let keys = fleet.robot(&name(&format!("xtb-{number}")));
        robots.push((client(&endpoint).once().await.unwrap(), keys));
    }

    // How many states came, when the last one did, and the longest time without one.
    let heard = Arc::new(std::sync::Mutex::new((0, Instant::now(), Duration::ZERO)));
    let hear = {
        let heard = heard.clone();
        move |_| {
            let (count, last, silent) = &mut *heard.lock().unwrap();
            (*count, *silent) = (*count + 1, (*silent).max(last.elapsed()));
            *last = Instant::now();
        }
    };
    let _states = awake.subscribe_raw("xtb/lab/*/state", hear).await.unwrap();
    let listens = Arc::new(AtomicBool::new(false));
    let hear = {
        let listens = listens.clone();
        move |_| listens.store(true, Ordering::Relaxed)
    };
    let _all = asleep.subscribe_raw("xtb/lab/**", hear).await.unwrap();
    let speak = async || {
        for (robot, keys) in &robots {
            for _ in 0..8 {
                let state = vec![7; STATE_BYTES];
                robot.put_raw(&keys.state(), &Channel::State, "zenoh/bytes", state).await.unwrap();
            }
            robot.put_raw(&keys.event(), &Channel::Event, "zenoh/bytes", vec![7; 100]).await.unwrap();
            let estop = Channel::EstopAll(name("cli-1")); // as somebody repeats it until all have acknowledged
            robot.put_raw(&estop_all, &estop, "zenoh/bytes", vec![7; 100]).await.unwrap();
        }
    };
    eventually("both listen", || async {
        speak().await;
        (listens.load(Ordering::Relaxed) && heard.lock().unwrap().0 > 0).then_some(())
    })
    .await;

    link.stall(true);
    *heard.lock().unwrap() = (0, Instant::now(), Duration::ZERO);
    let silent = eventually("the states", || async {
        speak().await;
        let (count, last, silent) = *heard.lock().unwrap();
        (count >= STATES).then(|| silent.max(last.elapsed()))
    })
    .await;
    assert!(silent < MOST_SILENT, "{silent:?} without a state");
}

#[allow(clippy::print_stderr)] // people who run the tests shall see it
fn skip(why: &str) {
    eprintln!("skipped: {why}");
}
