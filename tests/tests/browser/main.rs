//! The dashboard in a real browser: a headless Chromium shows the page of a real server, which drives
//! simulated robots over a real router. What became of them is judged by the ground truth.
//!
//! A binary of its own, two tests at a time, and those that measure alone: a browser beside sixty other tests would be slow.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod alerts;
mod axe;
mod crowd;
mod day;
mod driver;
mod driving;
mod foreign;
mod gamepad;
mod hand;
mod many;
mod map;
mod playing;
mod pose;
mod signing_in;
mod tasks;

use driver::{Browser, Dashboard};
use fantoccini::actions::{InputSource, KeyAction, KeyActions};
use fantoccini::key::Key;
use fleet_tests::{Fleet, Setup, eventually};
use tokio::sync::{Semaphore, SemaphorePermit};

/// Room for the tests that run: two browsers at a time.
static ROOM: Semaphore = Semaphore::const_new(2);

/// Held by a test that says how soon something has to happen: no other runs meanwhile.
async fn alone() -> SemaphorePermit<'static> {
    ROOM.acquire_many(2).await.unwrap()
}

/// Held by every other test.
async fn beside_another() -> SemaphorePermit<'static> {
    ROOM.acquire().await.unwrap()
}

/// Robots side by side, looking north, and a browser that shows them.
async fn fleet_on_page(robots: usize, speed: f64) -> (Fleet, Dashboard, Browser) {
    let starts = (0..robots).map(|i| (1.2 * i as f64, 0.0, std::f64::consts::FRAC_PI_2)).collect();
    let fleet = Fleet::start(Setup { robots, speed, starts, ..Setup::default() }).await;
    let dashboard = Dashboard::start(fleet.simulator.endpoint());
    let browser = Browser::start().await;
    browser.open(&dashboard.url(), robots).await;
    (fleet, dashboard, browser)
}

/// Where the page shows a robot, in m.
async fn shown_at(browser: &Browser, number: usize) -> (f64, f64) {
    let script = format!("const {{x_m, y_m}} = store.robots.get('xtb-{number}').pose; return [x_m, y_m];");
    let at = browser.ask(&script).await;
    (at[0].as_f64().unwrap(), at[1].as_f64().unwrap())
}

/// Presses E-STOP ALL; the page says that each of xtb-1, xtb-2 … has confirmed it.
async fn estop_all(browser: &Browser, robots: usize) {
    browser.click("#estop").await;
    let answered = "const said = document.getElementById('stops').textContent;
        return said.includes('Emergency stop of all robots') && !said.includes('waiting for confirmation')";
    browser.until("the page shows what came of the emergency stop", answered).await;
    let outcomes =
        "return [...document.querySelectorAll('[data-stopped].good')].map((chip) => chip.dataset.stopped)";
    let said = browser.ask("return document.getElementById('stops').innerText").await;
    let all: Vec<_> = (1..=robots).map(|number| format!("xtb-{number}")).collect();
    assert_eq!(browser.ask(outcomes).await, serde_json::json!(all), "{said}");
}

#[tokio::test(flavor = "multi_thread")]
async fn goals_are_clicked_and_reached_and_an_emergency_stop_latches_all() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(3, 2.0).await;
    browser.click("[data-tool=goals]").await;
    for number in 1..=3 {
        browser.click(&format!("[data-robot=xtb-{number}]")).await;
        let goal = browser.on_screen(1.2 * (number - 1) as f64, 1.2).await;
        browser.click_at(goal).await;
        fleet.until(number, "a goal", |state| state.goal.is_some()).await;
    }
    for number in 1..=3 {
        eventually("the robot moves on the page", || async {
            (shown_at(&browser, number).await.1 > 0.3).then_some(())
        })
        .await;
    }
    browser
        .until(
            "all goals are reached on the page",
            "return [...store.robots.values()].every((robot) => robot.goal?.status === 'reached')",
        )
        .await;
    for number in 1..=3 {
        let truth = fleet.truth(number);
        let off_m = (truth.x_m - 1.2 * (number - 1) as f64).hypot(truth.y_m - 1.2);
        assert!(off_m < 0.5, "xtb-{number} is {off_m} m from where the page was clicked");
    }

    // All under way again, then the button.
    for number in 1..=3 {
        browser.click(&format!("[data-robot=xtb-{number}]")).await;
        browser.click_at(browser.on_screen(1.2 * (number - 1) as f64, 2.6).await).await;
    }
    eventually("all drive", || async { (1..=3).all(|n| fleet.truth(n).speed_mps > 0.05).then_some(()) })
        .await;
    estop_all(&browser, 3).await;
    browser
        .until(
            "the page shows the latches",
            "return [...store.robots.values()].every((robot) => robot.latches.includes('estop'))",
        )
        .await;
    for number in 1..=3 {
        eventually("neutral", || async { fleet.truth(number).neutral_since_s }).await;
        assert!(!fleet.state(number).await.latches.is_empty());
    }
    browser.click("[data-reset=estop]").await;
    fleet.until(3, "reset", |state| state.latches.is_empty()).await;
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_server_is_said_and_what_is_old_is_grey() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, dashboard, browser) = fleet_on_page(2, 1.0).await;
    browser.until("all is well", "return document.getElementById('banner').hidden").await;
    drop(dashboard);
    let lost = "const banner = document.getElementById('banner');
        return !banner.hidden && banner.textContent.includes('Connection lost');";
    browser.until("the page says that it is alone", lost).await;
    let grey = "return [...store.robots.values()].every((robot) => robot.stale && robot.speed_mps === null)
        && document.querySelectorAll('.robot-row.is-stale').length === 2";
    browser.until("all robots are grey", grey).await;
    let grows = "return [...store.robots.values()].every((robot) => robot.age_ms > 2000)";
    browser.until("the ages grow", grows).await;
    browser.click("#estop").await;
    let not_sent = "return document.getElementById('stops').textContent.includes('NOT CONFIRMED')";
    browser.until("a stop that cannot be sent is said to be none", not_sent).await;
    browser.end().await;
    fleet.end().await;
}

/// Presses keys one after the other and lets go of all of them.
#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_stuck_is_said_and_what_is_old_is_grey_until_it_goes_on() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, dashboard, browser) = fleet_on_page(2, 1.0).await;
    let grey = "return [...store.robots.values()].every((robot) => robot.stale && robot.speed_mps === null)
        && document.getElementById('banner').textContent.includes('No data')";
    dashboard.freeze(true);
    browser.until("the page says that nothing comes", grey).await;
    dashboard.freeze(false);
    let well = "return [...store.robots.values()].every((robot) => !robot.stale && robot.speed_mps !== null)
        && document.getElementById('banner').hidden";
    browser.until("all is well again", well).await;
    browser.end().await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_that_is_too_slow_says_what_it_leaves_out_and_shows_it_again_when_it_is_not() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(2, 1.0).await;
    // Something else keeps the page's only thread busy for 70 ms of each picture.
    let busy = "window.busy = true;
        const work = () => {
            const until = performance.now() + 70;
            while (performance.now() < until);
            if (window.busy) requestAnimationFrame(work);
        };
        requestAnimationFrame(work);";
    browser.ask(busy).await;
    let said = "return pace.level >= 2
        && document.getElementById('pace').textContent.includes('Reduced detail: short trails; infrared only');";
    browser.until("the page says what it leaves out", said).await;
    browser.ask("window.busy = false;").await;
    // The way back takes the page half a minute: here at pictures' times that pass at once.
    let levels = "const [paced, levels] = [new pace.constructor(), []];
        let now = 0;
        for (const [fps, for_s] of [[20, 30], [40, 30], [60, 60]]) {
            for (const end = now + for_s * 1000; now < end; now += 1000 / fps) paced.drew(now);
            levels.push(paced.thinned().length);
        }
        return levels;";
    assert_eq!(browser.ask(levels).await, serde_json::json!([5, 5, 0]));
    browser.end().await;
    fleet.end().await;
}

async fn press(browser: &Browser, keys: &[char]) {
    let mut actions = KeyActions::new("keyboard".into());
    for &value in keys {
        actions = actions.then(KeyAction::Down { value });
    }
    for &value in keys.iter().rev() {
        actions = actions.then(KeyAction::Up { value });
    }
    browser.page.perform_actions(actions).await.unwrap();
}

/// Goes on with the tab key until `script`, about the element `it` that has the focus, says true.
async fn tab_to(browser: &Browser, what: &str, script: &str) {
    eventually(what, || async {
        press(browser, &[char::from(Key::Tab)]).await;
        (browser.ask(&format!("const it = document.activeElement; return {script};")).await == true)
            .then_some(())
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_keyboard_alone_sends_a_goal_and_stops_all() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(2, 2.0).await;
    tab_to(&browser, "the list has the focus", "it.dataset.robot === 'xtb-2'").await;
    press(&browser, &[char::from(Key::Enter)]).await;
    tab_to(&browser, "the map has the focus", "it.id === 'floor'").await;
    for _ in 0..4 {
        press(&browser, &[char::from(Key::Up)]).await;
    }
    press(&browser, &[char::from(Key::Enter)]).await;
    browser.until("a preview", "return aim.preview !== null").await;
    press(&browser, &[char::from(Key::Enter)]).await;
    let goal = fleet.until(2, "the goal", |state| state.goal.is_some()).await.goal.unwrap();
    let (x_m, y_m) = (goal.x_m.unwrap(), goal.y_m.unwrap());
    assert!((x_m - 1.25).abs() < 0.3 && (y_m - 1.0).abs() < 0.3, "the goal is ({x_m}, {y_m})");
    press(&browser, &[char::from(Key::Shift), ' ']).await;
    for number in 1..=2 {
        fleet.until(number, "latched", |state| !state.latches.is_empty()).await;
    }
    // What is pressed with the keyboard has a name.
    let nameless = "return [...document.querySelectorAll('button, input, select')].filter((one) =>
        !one.textContent.trim() && !one.ariaLabel && !one.labels?.length).map((one) => one.outerHTML)";
    assert_eq!(browser.ask(nameless).await, serde_json::json!([]));
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}
