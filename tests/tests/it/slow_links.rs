//! Verbs over links that are slow, narrow or have gaps.

use fleet_tests::slow_link::LinkQuality;
use fleet_tests::slow_verbs::{Ended, SlowFleet};
use fleet_tests::{PATIENCE, eventually, name};
use std::time::Duration;
use xtb_bus::Role;
use xtb_protocol::keys::FleetKeys;
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
