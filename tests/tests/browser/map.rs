//! Editing the map on the page: places, zones, undo, and what somebody else saves meanwhile.

use crate::driver::{self, Browser};
use crate::{beside_another, fleet_on_page};
use fantoccini::actions::{InputSource, KeyAction, KeyActions};
use fantoccini::key::Key;
use fleet_tests::processes::program;
use fleet_tests::{Fleet, eventually};
use std::process::Command;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Body, Done, GoalStatus, LinkLoss, Outcome, RobotState, Via};

/// What no robot may enter: [west, south, east, north], in m.
const CRANE: [f64; 4] = [-1.0, 2.0, 1.0, 3.0];

/// Opens the panel and begins.
pub(crate) async fn edit(browser: &Browser) {
    browser.click("[data-for=edit]").await;
    browser.click("#edit-begin").await;
    browser.until("the draft", "return editor.draft !== null").await;
}

/// Names what is selected.
pub(crate) async fn name(browser: &Browser, text: &str) {
    browser.fill("#edit-name", text).await;
    browser.until("the name", &format!("return editor.draft.item?.name === '{text}'")).await;
}

/// Adds a place.
pub(crate) async fn place(browser: &Browser, text: &str, x_m: f64, y_m: f64) {
    browser.click("[data-arm=place]").await;
    browser.click_at(browser.on_screen(x_m, y_m).await).await;
    browser.until("the place", "return editor.draft.selected?.kind === 'places'").await;
    name(browser, text).await;
}

/// Draws a keep-out zone.
pub(crate) async fn keep_out(browser: &Browser, [west, south, east, north]: [f64; 4]) {
    browser.click("[data-arm=keep_out]").await;
    let (from, to) = (browser.on_screen(west, south).await, browser.on_screen(east, north).await);
    browser.drag(from, to).await;
    browser.until("the zone", "return editor.draft.selected?.kind === 'zones'").await;
}

/// Saves for everybody.
pub(crate) async fn save(browser: &Browser, why: &str) {
    browser.fill("#edit-why", why).await;
    browser.click("#edit-save").await;
    browser.until("it is saved", "return !editor.dirty && editor.said !== null").await;
}

/// Sends the first robot to a point along a path.
async fn planned(fleet: &Fleet, x_m: f64, y_m: f64) -> Uuid {
    let (via, on_link_loss) = (Some(Via::Planned), LinkLoss::Finish);
    let body = Body::Goto { x_m, y_m, yaw_rad: None, via, on_link_loss, finish_s: 300.0 };
    match fleet.ask(1, body).await {
        Outcome::Ok(Done { goal: Some(goal), .. }) => goal,
        other => panic!("the goal was not accepted: {other:?}"),
    }
}

/// `place add` of somebody else.
fn add_place(fleet: &Fleet, words: &[&str]) {
    let mut command = Command::new(program("fleet-cli"));
    command.args(["--connect", fleet.simulator.endpoint(), "place", "add"]).args(words);
    let done = command.output().unwrap();
    assert!(done.status.success(), "{done:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_place_is_named_a_robot_is_sent_there_and_a_new_keep_out_makes_it_plan_anew() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(2, 2.0).await;
    edit(&browser).await;
    place(&browser, "bench", 3.0, 2.5).await;
    save(&browser, "where we solder").await;
    browser.until("the place is served", "return store.places.some((place) => place.name === 'bench')").await;
    browser.click("#edit-end").await;
    // A robot is sent to it by a click on its mark.
    browser.click("[data-tool=goals]").await;
    browser.click("[data-robot=xtb-2]").await;
    let (x, y) = browser.on_screen(3.0, 2.5).await;
    browser.click_at((x + 6.0, y - 5.0)).await;
    let sent = fleet.until(2, "a goal", |state| state.goal.is_some()).await.goal.unwrap();
    assert_eq!((sent.x_m, sent.y_m), (Some(3.0), Some(2.5)), "the place, not the pixel");

    // A keep-out on the way of another one.
    edit(&browser).await;
    keep_out(&browser, CRANE).await;
    name(&browser, "crane").await;
    browser.fill("#edit-why", "a crane stands there").await;
    let id = planned(&fleet, 0.0, 4.5).await;
    let known = fleet
        .until(1, "a path", |state| state.nav.route.as_ref().is_some_and(|route| route.track.is_some()))
        .await;
    browser.click("#edit-save").await;
    let map = |state: &RobotState| state.nav.map.as_ref().map(|map| map.hash.clone());
    let before = map(&known);
    let now = fleet
        .until(1, "the new map and a new path", |state| {
            let newer = state.nav.route.as_ref().map(|route| route.plans)
                > known.nav.route.as_ref().map(|route| route.plans);
            map(state) != before && newer
        })
        .await;
    let served = browser.ask("return [store.map.hash, store.map.zones.length]").await;
    assert_eq!((served[0].as_str(), served[1].as_u64()), (map(&now).as_deref(), Some(1)));
    let [west, south, east, north] = CRANE;
    eventually("it reaches its goal around the zone", || async {
        let at = fleet.truth(1);
        let within = at.x_m > west && at.x_m < east && at.y_m > south && at.y_m < north;
        assert!(!within, "it drives through the keep-out at ({}, {})", at.x_m, at.y_m);
        let goal = fleet.state(1).await.goal?;
        (goal.id == id && goal.status == GoalStatus::Reached).then_some(())
    })
    .await;
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn changes_are_undone_moved_and_deleted_and_marked_until_they_are_saved() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    edit(&browser).await;
    let state = |text: &str| format!("return document.getElementById('edit-state').textContent === '{text}'");
    browser.until("nothing is changed yet", &state("no changes")).await;
    keep_out(&browser, [2.0, 2.0, 3.0, 3.0]).await;
    place(&browser, "gate", -2.0, -2.0).await;
    browser.until("two changes", &state("2 unsaved changes")).await;
    browser.until("the title says so", "return document.title.startsWith('* ')").await;
    assert_eq!(
        browser.ask("return [store.map.zones.length, store.places.length]").await,
        serde_json::json!([0, 0])
    );

    // By its middle, then by a corner.
    browser.click_at(browser.on_screen(2.5, 2.5).await).await;
    browser.until("the zone", "return editor.draft.item?.kind === 'keep_out'").await;
    browser.drag(browser.on_screen(2.5, 2.5).await, browser.on_screen(3.5, 2.5).await).await;
    browser
        .until("moved", "return editor.draft.item.points[0][0] === 3 && editor.draft.item.points[0][1] === 2")
        .await;
    browser.drag(browser.on_screen(4.0, 3.0).await, browser.on_screen(4.5, 4.0).await).await;
    browser.until("longer", "const [x, y] = editor.draft.item.points[2]; return x === 4.5 && y === 4;").await;
    // A side's middle becomes a corner.
    browser.drag(browser.on_screen(3.5, 2.0).await, browser.on_screen(3.5, 1.5).await).await;
    browser.until("five corners", "return editor.draft.item.points.length === 5").await;

    let with_control = |key: char| {
        let control = char::from(Key::Control);
        let (down, up) = (|value| KeyAction::Down { value }, |value| KeyAction::Up { value });
        KeyActions::new("keyboard".into()).then(down(control)).then(down(key)).then(up(key)).then(up(control))
    };
    for corners in ["points.length === 4", "points[2][0] === 4", "points[0][0] === 2"] {
        browser.page.perform_actions(with_control('z')).await.unwrap();
        browser.until("a step back", &format!("return editor.draft.now.zones[0].{corners}")).await;
    }
    browser.click("#edit-redo").await;
    browser.until("a step on", "return editor.draft.now.zones[0].points[0][0] === 3").await;
    browser.click("[data-item=gate]").await;
    browser.click("#edit-remove").await;
    browser.until("one change", &state("1 unsaved change")).await;
    assert_eq!(
        browser.ask("return document.getElementById('edit-save').disabled").await,
        true,
        "no reason yet"
    );
    save(&browser, "a corner for the press").await;
    browser
        .until("saved", "return store.map.zones.length === 1 && store.map.zones[0].points[0][0] === 3")
        .await;
    browser.until("nothing is open", &state("no changes")).await;
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_somebody_else_has_saved_is_said_and_neither_overwrites_the_other() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    add_place(&fleet, &["bench", "1", "1"]);
    browser.until("the other's place", "return store.places.length === 1").await;
    edit(&browser).await;
    browser.click("[data-item=bench]").await;
    browser.fill("#edit-item input[type=number]", "90").await;
    place(&browser, "gate", -2.0, -2.0).await;
    // Meanwhile, in a terminal.
    add_place(&fleet, &["bench", "1.5", "1", "--replace", "--why", "it was moved"]);
    add_place(&fleet, &["door", "3", "3"]);
    browser.until("it is said", "return document.getElementById('edit-merge') !== null").await;
    browser.fill("#edit-why", "a gate").await;
    assert_eq!(browser.ask("return document.getElementById('edit-save').disabled").await, true);
    browser.click("#edit-merge").await;
    let lost = "return editor.lost.length === 1 && editor.lost[0] === 'bench'";
    browser.until("what both have changed is named", lost).await;
    save(&browser, "a gate").await;
    browser
        .until("all three", "return store.places.map((place) => place.name).join() === 'bench,door,gate'")
        .await;
    assert_eq!(browser.ask("return store.places[0].x_m").await, 1.5, "as the other one has it");
    let whys = "return editor.history?.versions.map((version) => version.why).join('; ')
        === 'as found; place bench; it was moved; place door; a gate'";
    browser.until("who changed it and why", whys).await;
    let by = browser.ask("return editor.history.versions.map((version) => version.by)").await;
    assert!(
        by[1].as_str().unwrap().starts_with("cli-") && by[4].as_str().unwrap().starts_with("web-"),
        "{by}"
    );
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}
