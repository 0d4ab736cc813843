//! Telling a robot on the page where it stands.

use crate::{beside_another, driver, fleet_on_page, map};
use fleet_tests::processes::program;
use std::process::Command;

#[tokio::test(flavor = "multi_thread")]
async fn a_pose_is_pressed_turned_and_set_after_the_page_has_said_what_that_does() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    // So slow that it is still under way when a busy browser has clicked.
    let (fleet, _dashboard, browser) = fleet_on_page(1, 0.2).await;
    browser.click("#set-pose").await;
    let from = browser.on_screen(2.0, 1.0).await;
    browser.drag(from, (from.0 - 80.0, from.1)).await;
    let said = "return document.querySelector('.pose-note')?.textContent.includes('forgets where it believed to be')";
    browser.until("what it does", said).await;
    let at = fleet.truth(1);
    assert_eq!(fleet.state(1).await.pose.x_m, 0.0, "nothing is set yet");
    browser.click("#pose-send").await;
    let set = fleet.until(1, "the pose", |state| (state.pose.x_m - 2.0).abs() < 0.05).await.pose;
    assert!(
        (set.y_m - 1.0).abs() < 0.05 && (set.yaw_rad.abs() - std::f64::consts::PI).abs() < 0.05,
        "{set:?}"
    );
    assert_eq!((fleet.truth(1).x_m, fleet.truth(1).y_m), (at.x_m, at.y_m), "it does not move");

    // One that is under way refuses, and the page says so before.
    fleet.goto(1, -3.0, 1.0).await;
    fleet
        .until(1, "under way", |state| state.goal.as_ref().is_some_and(|goal| !goal.status.is_final()))
        .await;
    browser.click("#set-pose").await;
    browser.click_at(browser.on_screen(0.0, 0.0).await).await;
    let warned = "return document.querySelector('.pose-note [role=alert]')?.textContent.includes('refuses until it stands')";
    browser.until("the warning", warned).await;
    browser.click("#pose-send").await;
    let refused = "return document.getElementById('robot').textContent.includes('cannot be set while the robot is driving')
        || document.getElementById('robot').textContent.includes('has control')
        || document.getElementById('take') !== null";
    browser.until("the refusal", refused).await;
    assert!(fleet.state(1).await.goal.is_some_and(|goal| !goal.status.is_final()), "it goes on");
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_start_pose_is_chosen_on_the_map_and_set_from_the_page_and_from_the_command_line() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(2, 1.0).await;
    map::edit(&browser).await;
    for (place, x_m) in [("desk", -3.0), ("mark", 3.0)] {
        map::place(&browser, place, x_m, 1.0).await;
        browser.fill("#edit-item input[type=number]", "180").await;
        browser.fill("#edit-start", "xtb-2").await;
    }
    let last = "return JSON.stringify(editor.draft.now.places.map(({name, tags}) => [name, tags]))
        === '[[\"desk\",[]],[\"mark\",[\"start-xtb-2\"]]]'";
    browser.until("the place that was chosen last", last).await;
    map::save(&browser, "where they stand in the morning").await;
    browser.click("#edit-end").await;

    browser.click("[data-robot=xtb-2]").await;
    browser.click("#set-start").await;
    let said =
        "return document.querySelector('.pose-note')?.textContent.includes('xtb-2 stands at (3.00, 1.00)')";
    browser.until("what it will do", said).await;
    assert!((fleet.state(2).await.pose.x_m - 1.2).abs() < 0.05, "nothing is set yet");
    browser.click("#pose-send").await;
    let set = fleet.until(2, "the pose", |state| (state.pose.x_m - 3.0).abs() < 0.05).await.pose;
    assert!((set.yaw_rad.abs() - std::f64::consts::PI).abs() < 0.05, "{set:?}");

    // Of the other one the map has none, but the roster has.
    let mut command = Command::new(program("fleet-cli"));
    command.args(["--json", "--connect", fleet.simulator.endpoint(), "set-pose", "xtb-1,xtb-2", "--start"]);
    let done = command.output().unwrap();
    assert!(done.status.success(), "{done:?}");
    let lines = String::from_utf8(done.stdout).unwrap();
    let mut told: Vec<_> = lines
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
        .map(|line| (line["robot"].as_str().unwrap().to_owned(), line["pose"]["x_m"].as_f64().unwrap()))
        .collect();
    told.sort_by(|one, other| one.0.cmp(&other.0));
    assert_eq!(told, [("xtb-1".to_owned(), 0.0), ("xtb-2".to_owned(), 3.0)]);
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}
