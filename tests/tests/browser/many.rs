//! A hundred robots on the page: those in trouble first, one found with the keyboard.

use super::driver::{self, Browser, Dashboard};
use super::signing_in::screen;
use super::{alone, crowd, press};
use fantoccini::key::Key;
use fleet_tests::{Fleet, Setup};
use serde_json::json;
use std::time::Duration;
use xtb_client::fake;
use xtb_protocol::messages::{Latch, RobotState};

const ROBOTS: usize = 99;
/// Often enough that none is stale.
const EVERY: Duration = Duration::from_millis(200);

fn change(number: usize, state: &mut RobotState) {
    if number == 77 {
        state.latches = vec![fake::latch(Latch::Estop, "carol", false)];
    }
}

async fn rows(browser: &Browser) -> serde_json::Value {
    browser.ask("return [...document.querySelectorAll('.robot-row')].map((row) => row.dataset.robot)").await
}

#[tokio::test(flavor = "multi_thread")]
async fn of_a_hundred_robots_those_in_trouble_stand_first_and_two_digits_find_one() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let fleet = Fleet::start(Setup { speed: 1.0, ..Setup::default() }).await;
    let crowd = crowd::crowd(&fleet, ROBOTS, EVERY, change).await;
    let dashboard = Dashboard::start(fleet.simulator.endpoint());
    let browser = Browser::start().await;
    browser.open(&dashboard.url(), ROBOTS + 1).await;
    let first = "return document.querySelector('.robot-row')?.dataset.robot === 'car-77'";
    browser.until("the one that is latched stands first", first).await;
    assert_eq!(rows(&browser).await.as_array().unwrap().len(), 100);
    let latched = "return document.querySelector('[data-filter=latched]')?.textContent === '1 latched'";
    browser.until("and is counted", latched).await;

    screen(&browser, "hundred").await;
    press(&browser, &['/']).await;
    browser.until("the filter has the focus", "return document.activeElement.id === 'robot-filter'").await;
    press(&browser, &['4']).await;
    press(&browser, &['2']).await;
    browser.until("one is left", "return document.querySelectorAll('.robot-row').length === 1").await;
    assert_eq!(rows(&browser).await, json!(["car-42"]));
    press(&browser, &[char::from(Key::Enter)]).await;
    browser.until("it is selected", "return store.selected === 'car-42'").await;
    screen(&browser, "filtered").await;

    browser.click("[data-filter=latched]").await;
    browser.until("by state", "return document.querySelectorAll('.robot-row').length === 1").await;
    assert_eq!(rows(&browser).await, json!(["car-77"]));
    press(&browser, &['/']).await;
    browser.until("the filter again", "return document.activeElement.id === 'robot-filter'").await;
    press(&browser, &[char::from(Key::Escape)]).await;
    browser.until("all again", "return document.querySelectorAll('.robot-row').length === 100").await;
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    crowd.abort();
    browser.end().await;
    fleet.end().await;
}

/// `robot_filter.js` on robots of our own.
const FILTER: &str = "
    const tell = arguments[arguments.length - 1];
    import('/assets/robot_filter.js').then(({Order, counts, shownRobots}) => {
        const robot = (name, more) => ({name, alive: true, stale: false, latches: [], faults: [], why: [], goal: null,
            mode: 'idle', tags: [], alias: null, ...more});
        const robots = [
            robot('xtb-1', {tags: ['north'], alias: 'Red Fox'}), robot('xtb-2', {why: ['no_command']}),
            robot('xtb-3', {latches: ['estop'], tags: ['@north']}), robot('xtb-12', {alive: false}),
            robot('xtb-21', {goal: {status: 'blocked'}}), robot('xtb-22', {mode: 'goto'}),
        ];
        const order = new Order();
        order.update(robots, false);
        const found = (text) => shownRobots(robots, text, order).map((one) => one.name).join(' ');
        const said = {};
        for (const text of ['', '@north', '@NOR latched', 'fox', '2', '12', 'mis', 'blocked', 'driving', 'nobody']) said[text] = found(text);
        said.counts = counts(robots).map(([name, count]) => `${count} ${name}`).join(' ');
        // While it is held nobody moves, and who is new comes last.
        const later = [...robots.map((one) => (one.name === 'xtb-22' ? robot('xtb-22', {latches: ['estop']}) : one)), robot('xtb-23', {latches: ['estop']})];
        order.update(later, true);
        said.held = shownRobots(later, '', order).map((one) => one.name).join(' ');
        order.update(later, false);
        said.letGo = shownRobots(later, '', order).map((one) => one.name).join(' ');
        tell(said);
    }, (error) => tell({error: String(error)}));";

#[tokio::test(flavor = "multi_thread")]
async fn robots_are_filtered_by_name_number_alias_tag_and_state_and_no_row_moves_while_it_is_held() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let (fleet, _dashboard, browser) = super::fleet_on_page(1, 1.0).await;
    let said = browser.page.execute_async(FILTER, Vec::new()).await.unwrap();
    for (text, found) in [
        ("", "xtb-3 xtb-12 xtb-21 xtb-1 xtb-2 xtb-22"),
        ("@north", "xtb-3 xtb-1"),
        ("@NOR latched", "xtb-3"),
        ("fox", "xtb-1"),
        ("2", "xtb-2 xtb-12 xtb-21 xtb-22"),
        ("12", "xtb-12"),
        ("mis", "xtb-12"),
        ("blocked", "xtb-21"),
        ("driving", "xtb-22"),
        ("nobody", ""),
        ("held", "xtb-3 xtb-12 xtb-21 xtb-1 xtb-2 xtb-22 xtb-23"),
        ("letGo", "xtb-3 xtb-22 xtb-23 xtb-12 xtb-21 xtb-1 xtb-2"),
    ] {
        assert_eq!(said[text], found, "{text:?} of {said}");
    }
    assert_eq!(said["counts"], "1 latched 1 missing 1 blocked 1 driving 2 idle", "{said}");
    browser.end().await;
    fleet.end().await;
}
