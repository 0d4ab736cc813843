//! Driving by hand from a page: every way in which the hand can be lost ends in neutral.

use super::Rig;
use super::page::Page;
use fleet_tests::{Setup, eventually};
use serde_json::json;
use std::time::Duration;
use xtb_protocol::messages::StopReason;

async fn rig() -> Rig {
    Rig::start(Setup { speed: 1.0, ..Setup::default() }).await
}

async fn take(page: &mut Page, robot: &str, take: bool) {
    let answer = page.ask(json!({ "teleop": { "robot": robot, "take": take } })).await;
    assert_eq!(answer["ok"]["robot"], robot, "{answer}");
    page.until("the word", |page| (page.teleop["state"] == "driving").then_some(())).await;
}

/// Holds the stick, 20 times a second, until the truck rolls.
async fn roll(rig: &Rig, page: &mut Page) {
    let rolling = || {
        let truth = rig.fleet.truth(1);
        truth.speed_mps > 0.1 && truth.neutral_since_s.is_none()
    };
    let mut held = 0;
    while !rolling() {
        held += 1;
        assert!(held < 1200, "a minute of driving in vain");
        page.steer(0.6).await;
        page.take_for(50).await;
    }
}

/// From `since_s` to neutral on the board, in s of the world.
async fn neutral_after(rig: &Rig, since_s: f64) -> f64 {
    eventually("neutral", || async { rig.fleet.truth(1).neutral_since_s }).await - since_s
}

#[tokio::test(flavor = "multi_thread")]
async fn a_closed_socket_is_neutral_at_once() {
    let rig = rig().await;
    let mut page = rig.page().await;
    take(&mut page, "xtb-1", false).await;
    roll(&rig, &mut page).await;
    page.steer(0.6).await;
    let closed_s = rig.fleet.time_s();
    drop(page);
    let took_s = neutral_after(&rig, closed_s).await;
    eprintln!("neutral {took_s:.3} s after the socket was closed");
    assert!(took_s < 0.5, "{took_s} s");
    let state = rig.fleet.until(1, "the lease given back", |state| state.lease.is_none()).await;
    assert_eq!(state.reference_rpm, 0.0);
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn silence_is_neutral_although_the_socket_is_open() {
    let rig = rig().await;
    let mut page = rig.page().await;
    take(&mut page, "xtb-1", false).await;
    roll(&rig, &mut page).await;
    let neutral_s = page.until("neutral", |_| rig.fleet.truth(1).neutral_since_s).await;
    let state =
        rig.fleet.until(1, "standing", |state| state.stopped_because == [StopReason::SetpointExpired]).await;
    let age_ms = state.input_age_ms.setpoint.unwrap();
    let took_s = neutral_s - (state.tick_ms - age_ms) as f64 / 1000.0;
    eprintln!("neutral {took_s:.3} s after the last setpoint arrived");
    assert!(took_s <= 0.25, "{took_s} s");
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hand_that_sees_an_old_picture_drives_nobody() {
    let rig = rig().await;
    let mut page = rig.page().await;
    take(&mut page, "xtb-1", false).await;
    let old = page.frame["n"].as_u64().unwrap();
    page.until("later frames", |page| (page.frame["n"].as_u64()? > old + 10).then_some(())).await;
    for n in [old, 0, u64::from(u32::MAX)] {
        for _ in 0..10 {
            page.steer_by(n, 0.6).await;
            page.take_for(20).await;
        }
    }
    let state = rig.fleet.state(1).await;
    assert_eq!(state.input_age_ms.setpoint, None, "none went on to the robot");
    roll(&rig, &mut page).await;
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_page_is_told_who_drives_and_may_take_it() {
    let rig = rig().await;
    let (mut first, mut second) = (rig.page().await, rig.page().await);
    take(&mut first, "xtb-1", false).await;
    let driver = first.hello["client"].as_str().unwrap().to_owned();
    let answer = second.ask(json!({ "teleop": { "robot": "xtb-1", "take": false } })).await;
    assert_eq!(answer["error"]["code"], "lease_held", "{answer}");
    assert!(answer["error"]["message"].as_str().unwrap().contains(&driver), "{answer}");
    take(&mut second, "xtb-1", true).await;
    first.until("the word", |page| (page.teleop["state"] == "ended").then_some(())).await;
    let why = first.teleop["why"].as_str().unwrap();
    assert!(why.contains(second.hello["client"].as_str().unwrap()), "{why}");
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn letting_go_and_stopping_end_it_and_give_the_lease_back() {
    let rig = rig().await;
    let mut page = rig.page().await;
    for end in [json!({ "teleop_end": {} }), json!({ "stop": { "robot": null } })] {
        page.teleop = json!(null);
        take(&mut page, "xtb-1", false).await;
        roll(&rig, &mut page).await;
        assert!(page.ask(end.clone()).await["ok"].is_object(), "{end}");
        page.until("the word", |page| (page.teleop["state"] == "ended").then_some(())).await;
        rig.fleet.until(1, "the lease given back", |state| state.lease.is_none()).await;
        eventually("standing", || async { (rig.fleet.truth(1).speed_mps.abs() < 0.02).then_some(()) }).await;
    }
    page.take_for(Duration::from_millis(50).as_millis() as u64).await;
    rig.end().await;
}
