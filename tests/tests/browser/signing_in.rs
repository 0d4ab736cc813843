//! The page over TLS, in a browser that does not know the CA: signing in by token, driving, being thrown out; and
//! what a viewer's page looks like.

use super::driver::{self, Browser};
use super::{beside_another, press};
use fantoccini::Locator;
use fantoccini::key::Key;
use fleet_tests::page_identities::{PageIdentities, token};
use fleet_tests::{Fleet, PATIENCE, Setup, eventually, name};
use serde_json::json;
use std::sync::Arc;
use xtb_client::Client;
use xtb_client::scene::live::{Live, Wanted};
use xtb_dashboard::{Running, ServerSettings, Shown};
use xtb_identity::Role;

/// A fleet and its page over TLS, for alice, an operator, and bob, a viewer.
pub(super) struct Secured {
    fleet: Fleet,
    identities: PageIdentities,
    dashboard: Running,
    client: Client,
    _live: Live,
}

impl Secured {
    pub(super) async fn start() -> Self {
        let starts = vec![(0.0, 0.0, std::f64::consts::FRAC_PI_2)];
        let fleet = Fleet::start(Setup { speed: 1.0, starts, ..Setup::default() }).await;
        let identities = PageIdentities::new();
        identities.add("alice", Role::Operator);
        identities.add("bob", Role::Viewer);
        let settings = xtb_client::Settings {
            identity: None,
            connect: vec![fleet.simulator.endpoint().to_owned()],
            fleet: name("lab"),
            client: name("dashboard"),
            timeout: PATIENCE,
            robots: Vec::new(),
            aliases: Default::default(),
        };
        let client = Client::open(&settings).await.unwrap();
        let live = Live::open(&client, Wanted { sensors: true, truth: false }).await.unwrap();
        let settings = ServerSettings {
            listen: "127.0.0.1:0".parse().unwrap(),
            secure: Some(identities.secure()),
            token: None,
            insecure: false,
            read_only: false,
            allow_origins: Vec::new(),
            proxies: Vec::new(),
            hz: 20.0,
        };
        let shown = Shown { scene: Arc::clone(&live.scene), commands: Some(client.clone()), playback: None };
        let dashboard = Running::start(settings, shown).await.unwrap();
        Self { fleet, identities, dashboard, client, _live: live }
    }

    /// Where its page is.
    pub(super) fn url(&self) -> String {
        self.dashboard.url()
    }

    pub(super) async fn end(self) {
        self.dashboard.stop().await;
        self.client.close().await;
        self.fleet.end().await;
    }
}

/// Types a token and goes on, whatever comes of it.
pub(super) async fn show(browser: &Browser, token: &str) {
    let field = browser.page.wait().for_element(Locator::Css("#token")).await.unwrap();
    field.clear().await.unwrap();
    field.send_keys(token).await.unwrap();
    browser.click("#sign-in").await;
}

/// Signs in, and waits until the page shows the robot.
pub(super) async fn sign_in(browser: &Browser, name: &str) {
    show(browser, &token(name)).await;
    at(browser, "/").await;
    browser.until("the robot", "return [...store.robots.values()].some((robot) => !robot.stale)").await;
}

/// Waits until the window shows this path.
async fn at(browser: &Browser, path: &str) {
    eventually(path, || async {
        let url = browser.page.current_url().await.ok()?;
        (url.path() == path).then_some(())
    })
    .await;
}

/// For whoever wants to see it: `XTB_SCREENS` names a folder.
pub(crate) async fn screen(browser: &Browser, name: &str) {
    let Some(folder) = std::env::var_os("XTB_SCREENS") else { return };
    for (size, width, height) in [("desktop", 1440, 900), ("phone", 390, 844)] {
        let metrics =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        browser.devtools("Emulation.setDeviceMetricsOverride", metrics).await;
        tokio::time::sleep(std::time::Duration::from_millis(500)).await;
        let png = browser.page.screenshot().await.unwrap();
        std::fs::write(std::path::Path::new(&folder).join(format!("{name}-{size}.png")), png).unwrap();
    }
    browser.devtools("Emulation.clearDeviceMetricsOverride", json!({})).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_operator_signs_in_drives_and_stops_and_is_thrown_out_when_revoked() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let secured = Secured::start().await;
    let browser = Browser::start().await;
    browser.page.goto(&secured.dashboard.url()).await.unwrap();
    at(&browser, "/sign-in").await;
    screen(&browser, "sign-in").await;
    show(&browser, "0123456789abcdef").await;
    eventually("a refusal", || async {
        let error = browser.page.find(Locator::Css("#error")).await.ok()?.text().await.ok()?;
        error.contains("not valid").then_some(())
    })
    .await;
    screen(&browser, "sign-in-refused").await;
    sign_in(&browser, "alice").await;
    let who = eventually("who is signed in", || async {
        browser.page.find(Locator::Css("#who summary")).await.ok()?.text().await.ok()
    })
    .await;
    assert!(who.contains("alice") && who.contains("operator"), "{who}");
    browser.click("#who summary").await;
    screen(&browser, "who").await;
    browser.click("#who summary").await;

    browser.click("[data-robot=xtb-1]").await;
    browser.click("#drive-begin").await;
    browser.until("the stick", "return !document.getElementById('drive').hidden").await;
    let lease = secured.fleet.until(1, "a lease", |state| state.lease.is_some()).await.lease.unwrap();
    assert!(lease.holder.as_str().starts_with("web-alice-"), "{}", lease.holder);
    eventually("it drives", || async {
        // A page that was held up lets go by itself: then the key has to be pressed again.
        if browser.ask("return document.querySelector('#stick.held') === null;").await == true {
            browser.page.release_actions().await.unwrap();
            let down = fantoccini::actions::KeyAction::Down { value: 'w' };
            let keyboard = fantoccini::actions::KeyActions::new("keyboard".into());
            let hold = fantoccini::actions::InputSource::then(keyboard, down);
            browser.page.perform_actions(hold).await.unwrap();
        }
        (secured.fleet.truth(1).speed_mps > 0.1).then_some(())
    })
    .await;
    press(&browser, &[char::from(Key::Shift), ' ']).await;
    let state = secured.fleet.until(1, "latched", |state| !state.latches.is_empty()).await;
    assert!(state.latches[0].by.as_str().starts_with("web-alice-"), "{:?}", state.latches);
    browser.page.release_actions().await.unwrap();
    eventually("it stands", || async { secured.fleet.truth(1).neutral_since_s }).await;
    // The wrong token has left its trace; the page's policy has refused nothing.
    let complaints: Vec<String> = browser.complaints().await;
    let others = complaints.iter().filter(|text| !text.contains("sign-in") || !text.contains("401"));
    assert_eq!(others.collect::<Vec<_>>(), Vec::<&String>::new());

    secured.identities.change_one("alice", |alice| alice.revoked = true);
    at(&browser, "/sign-in").await;
    screen(&browser, "ended").await;
    browser.end().await;
    secured.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewers_page_has_the_emergency_stop_alone_and_says_why() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let secured = Secured::start().await;
    let browser = Browser::start().await;
    browser.page.goto(&secured.dashboard.url()).await.unwrap();
    sign_in(&browser, "bob").await;
    browser.click("[data-robot=xtb-1]").await;
    screen(&browser, "viewer").await;
    for tab in ["robot", "tasks"] {
        browser.click(&format!("#tab-{tab}")).await;
        // What can be pressed without a word why not, but for looking around and stopping.
        let open = "return [...document.querySelectorAll('[data-tool], #robot .row button, #tasks button, #tasks input')]
            .filter((one) => one.offsetParent !== null && one.id !== 'estop-one')
            .filter((one) => !one.matches(':disabled')
                || !one.closest('[title]')?.title.includes('bob is a viewer: may look and call an emergency stop'))
            .map((one) => one.outerHTML)";
        eventually("nothing but to look", || async { (browser.ask(open).await == json!([])).then_some(()) })
            .await;
        let some = "return document.querySelectorAll('[data-tool]:disabled, #robot button:disabled, #tasks :disabled').length";
        assert!(browser.ask(some).await.as_u64().unwrap() >= 4);
    }
    screen(&browser, "viewer-tasks").await;
    browser.click("#estop").await;
    let state = secured.fleet.until(1, "latched", |state| !state.latches.is_empty()).await;
    assert!(state.latches[0].by.as_str().starts_with("web-bob-"), "{:?}", state.latches);

    browser.click("#who summary").await;
    browser.click("#sign-out").await;
    at(&browser, "/sign-in").await;
    browser.page.goto(&secured.dashboard.url()).await.unwrap();
    at(&browser, "/sign-in").await;
    browser.end().await;
    secured.end().await;
}
