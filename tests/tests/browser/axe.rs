//! axe-core on every page and panel, as a desktop and as a phone shows them, dark and light: nothing serious, nothing
//! critical. axe-core is a program of Node's registry; without it this test says so and is skipped.

use super::driver::{self, Browser, say};
use super::signing_in::Secured;
use super::{beside_another, fleet_on_page, press};
use fantoccini::Locator;
use serde_json::{Value, json};
use std::path::PathBuf;

/// What axe-core found that is bad, in words.
const RUN: &str = "
    const tell = arguments[arguments.length - 1];
    axe.run(document, {resultTypes: ['violations']}).then(({violations}) => tell(violations
        .filter(({impact}) => ['serious', 'critical'].includes(impact))
        .flatMap(({id, help, nodes}) => nodes.map((node) => `${id}: ${help}: ${node.target.join(' ')}: ${node.failureSummary}`))),
        (error) => tell([String(error)]));";

/// The program, from `XTB_NODE_MODULES`; says so if it is not there.
fn axe() -> Option<String> {
    let modules = std::env::var_os("XTB_NODE_MODULES").map(PathBuf::from);
    let program =
        modules.and_then(|modules| std::fs::read_to_string(modules.join("axe-core/axe.min.js")).ok());
    if program.is_none() {
        say("SKIP: no axe-core in XTB_NODE_MODULES; `npm install axe-core` brings it");
    }
    program
}

/// What it finds on the page as it is with this tab open, at each size and in each colour.
async fn check(browser: &Browser, program: &str, what: &str, tab: &str) {
    for (width, height) in [(1440, 900), (390, 844)] {
        let metrics =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        browser.devtools("Emulation.setDeviceMetricsOverride", metrics).await;
        let open = "document.documentElement.dataset.tab = arguments[0];";
        browser.page.execute(open, vec![json!(tab)]).await.unwrap();
        for scheme in ["dark", "light"] {
            let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
            browser.devtools("Emulation.setEmulatedMedia", media).await;
            // Panels are drawn anew five times a second.
            let drawn = "const [tell] = arguments; requestAnimationFrame(() => setTimeout(() => requestAnimationFrame(tell), 300));";
            browser.page.execute_async(drawn, Vec::new()).await.unwrap();
            browser.page.execute(program, Vec::new()).await.unwrap();
            let found = browser.page.execute_async(RUN, Vec::new()).await.unwrap();
            let found: Vec<&str> = found.as_array().unwrap().iter().filter_map(Value::as_str).collect();
            assert!(found.is_empty(), "{what}, {width}×{height}, {scheme}:\n{}", found.join("\n"));
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_page_and_no_panel_has_a_serious_fault_of_accessibility() {
    let Some(program) = axe().filter(|_| driver::is_there()) else { return };
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(2, 1.0).await;
    browser.click("[data-robot=xtb-1]").await;
    check(&browser, &program, "a robot selected", "robot").await;
    for tab in ["robots", "tasks", "events"] {
        check(&browser, &program, tab, tab).await;
    }
    press(&browser, &['/']).await;
    browser.until("the filter", "return document.activeElement.id === 'robot-filter'").await;
    press(&browser, &['z']).await;
    browser.until("nobody fits", "return document.querySelectorAll('.robot-row').length === 0").await;
    check(&browser, &program, "a filter that nobody fits", "robots").await;
    browser.click("#robots .empty button").await;
    browser.ask("aim.preview = {x_m: 0, y_m: 1, yaw_rad: 0};").await;
    check(&browser, &program, "a goal that is aimed at", "robot").await;
    browser.ask("aim.clear();").await;
    browser.click("#drive-begin").await;
    browser.until("the joystick", "return !document.getElementById('drive').hidden").await;
    check(&browser, &program, "driving by hand", "robot").await;
    browser.click("#estop").await;
    let answered = "return document.querySelectorAll('[data-stopped]').length === 2";
    browser.until("the emergency stop is answered", answered).await;
    check(&browser, &program, "after an emergency stop", "robot").await;
    browser.end().await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn signing_in_and_a_viewers_page_have_no_serious_fault_of_accessibility() {
    let Some(program) = axe().filter(|_| driver::is_there()) else { return };
    let _room = beside_another().await;
    let secured = Secured::start().await;
    let browser = Browser::start().await;
    browser.page.goto(&secured.url()).await.unwrap();
    browser.page.wait().for_element(Locator::Css("#token")).await.unwrap();
    check(&browser, &program, "signing in", "robot").await;
    super::signing_in::show(&browser, "not a token").await;
    browser.page.wait().for_element(Locator::Css("#error:not([hidden])")).await.unwrap();
    check(&browser, &program, "a token that is refused", "robot").await;
    super::signing_in::sign_in(&browser, "bob").await;
    check(&browser, &program, "a viewer's page", "robot").await;
    browser.end().await;
    secured.end().await;
}
