//! Driving by hand in the browser: what is let go of stops, however it is let go.

use crate::driver::{self, say};
use crate::hand::{self, drive};
use crate::{alone, fleet_on_page};
use fleet_tests::Fleet;
use serde_json::json;
use xtb_protocol::messages::RobotState;

/// The motor has to be neutral this long after the page has gone, in s of the world. The measurement
/// (`--example dashboard_rate`) holds 250 ms; here a busy machine delays browser and agents.
const NEUTRAL_S: f64 = 1.0;

/// From `since_s` to neutral, in s of the world.
async fn neutral_s(fleet: &Fleet, since_s: f64) -> f64 {
    hand::neutral_since_s(fleet).await - since_s
}

fn is_free(state: &RobotState) -> bool {
    state.lease.is_none()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_stands_when_the_stick_is_let_go_the_page_hidden_or_the_tab_closed() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let (fleet, dashboard, browser) = fleet_on_page(1, 1.0).await;

    drive(&fleet, &browser).await;
    let let_go_s = fleet.time_s();
    browser.page.release_actions().await.unwrap();
    let took_s = neutral_s(&fleet, let_go_s).await;
    say(&format!("let go: neutral after {:.0} ms", took_s * 1e3));
    assert!(took_s < NEUTRAL_S, "neutral {took_s} s after the stick was let go");
    browser.click("#drive-end").await;
    fleet.until(1, "the lease is given back", is_free).await;

    drive(&fleet, &browser).await;
    let blurred_s = fleet.time_s();
    browser.ask("window.dispatchEvent(new Event('blur'))").await;
    let took_s = neutral_s(&fleet, blurred_s).await;
    say(&format!("focus lost: neutral after {:.0} ms", took_s * 1e3));
    assert!(took_s < NEUTRAL_S, "neutral {took_s} s after the focus was lost");
    browser.page.release_actions().await.unwrap();
    browser.click("#drive-end").await;
    fleet.until(1, "the lease is given back", is_free).await;

    // The tab that drives is closed while the stick is held; the other one lives on.
    let first = browser.page.window().await.unwrap();
    let second = browser.page.new_window(true).await.unwrap();
    browser.page.switch_to_window(second.handle).await.unwrap();
    browser.open(&dashboard.url(), 1).await;
    drive(&fleet, &browser).await;
    let closed_s = fleet.time_s();
    browser.page.close_window().await.unwrap();
    let took_s = neutral_s(&fleet, closed_s).await;
    say(&format!("tab closed: neutral after {:.0} ms", took_s * 1e3));
    assert!(took_s < NEUTRAL_S, "neutral {took_s} s after the tab was closed");
    fleet.until(1, "the lease is given back", is_free).await;
    browser.page.switch_to_window(first).await.unwrap();
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}

/// For so long nothing may move after the browser has woken up, in s of the world.
const STANDS_S: f64 = 1.0;

#[tokio::test(flavor = "multi_thread")]
async fn a_frozen_browser_stops_the_robot_and_does_not_drive_on_when_it_wakes_up() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    drive(&fleet, &browser).await;
    let frozen_s = fleet.time_s();
    browser.freeze(true);
    let neutral_since_s = hand::neutral_since_s(&fleet).await;
    let took_s = neutral_since_s - frozen_s;
    say(&format!("browser frozen: neutral after {:.0} ms", took_s * 1e3));
    assert!(took_s < NEUTRAL_S, "neutral {took_s} s after the browser froze");
    fleet.simulated(STANDS_S).await;
    browser.freeze(false);
    // The stick is still pressed, but the page has let go of it.
    browser.until("the page runs again", "return document.querySelector('#stick.held') === null").await;
    fleet.simulated(STANDS_S).await;
    assert_eq!(fleet.truth(1).neutral_since_s, Some(neutral_since_s), "it drove on");
    browser.end().await;
    fleet.end().await;
}

/// Steps through `press_hold.js` with a clock of our own, in the browser.
const HOLD: &str = "
    const tell = arguments[arguments.length - 1];
    import('/assets/press_hold.js').then(({PressHold}) => {
        const said = {};
        let hold = new PressHold();
        said.nothingHeld = hold.tick(0, 1);
        hold.stick(7, 0.5, 1, 1000);
        said.held = hold.tick(1050, 0.5);
        said.late = hold.tick(1400, 1);
        said.afterLate = hold.tick(1450, 1);
        hold.stick(7, 0, 1, 2000);
        hold.stick(8, 0, -1, 2010);
        said.secondFinger = hold.tick(2050, 1);
        hold.stickReleased(8);
        said.stillHeld = hold.held;
        hold.stickReleased(7);
        said.released = hold.tick(2100, 1);
        hold.keyDown('KeyW', 3000);
        hold.keyDown('ArrowRight', 3000);
        said.keys = hold.tick(3050, 1);
        hold.keyUp('KeyW');
        said.one = hold.tick(3100, 1);
        hold.keyUp('ArrowRight');
        said.none = hold.tick(3150, 1);
        tell(said);
    });";

#[tokio::test(flavor = "multi_thread")]
async fn a_setpoint_comes_only_of_what_is_held_now_and_a_late_tick_lets_go() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    let said = browser.page.execute_async(HOLD, Vec::new()).await.unwrap();
    for nothing in ["nothingHeld", "late", "afterLate", "released", "none"] {
        assert!(said[nothing].is_null(), "{nothing}: {said}");
    }
    assert_eq!(said["held"], json!({ "seq": 1, "throttle": 0.5, "steering": 0.5 }), "{said}");
    assert_eq!((&said["secondFinger"]["throttle"], &said["stillHeld"]), (&json!(1), &json!(true)), "{said}");
    assert_eq!((&said["keys"]["throttle"], &said["keys"]["steering"]), (&json!(1), &json!(1)), "{said}");
    assert_eq!((&said["one"]["throttle"], &said["one"]["steering"]), (&json!(0), &json!(1)), "{said}");
    browser.end().await;
    fleet.end().await;
}
