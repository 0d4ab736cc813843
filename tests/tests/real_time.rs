//! Kills, stops and floods with real processes at real time, a few times each; the bench `safety` counts
//! to hundreds. A binary of its own, one test at a time: beside sixty others a world would stand still
//! long enough to look like broken lines.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use fleet_tests::Rig;
use fleet_tests::load::{self, Flood};
use fleet_tests::mesh::Mesh;
use std::time::Duration;
use tokio::sync::Mutex;
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

#[allow(clippy::print_stderr)] // people who run the tests shall see it
fn skip(why: &str) {
    eprintln!("skipped: {why}");
}
