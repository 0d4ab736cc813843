//! Driving with a gamepad: an emulated one, which the page finds where browsers list real ones.

use crate::driver::{self, Browser, Dashboard, say};
use crate::hand;
use crate::signing_in::screen;
use crate::{alone, fleet_on_page};
use fleet_tests::{Fleet, GroundTruth, Setup, eventually, name};
use serde_json::json;
use std::time::{Duration, Instant};
use xtb_client::{Client, Control, Settings};

/// A gamepad of the standard layout, not plugged in yet; its values change all the time, as real ones do.
const PLUGGABLE: &str = "
    window.pad = {id: 'emulated', index: 0, connected: true, mapping: 'standard', axes: [0, 0, 0, 0],
        buttons: Array.from({length: 17}, () => ({pressed: false, touched: false, value: 0})),
        get timestamp() { return performance.now(); }};
    window.pads = [null, null];
    Object.defineProperty(navigator, 'getGamepads', {value: () => window.pads});";
/// The motor has to be neutral this long after the gamepad is lost, in s of the world.
const LOST_S: f64 = 0.25;
/// Driving has begun this long after the press, or it is pressed again.
const BEGINS_WITHIN: Duration = Duration::from_secs(10);
/// No trial takes longer on a machine that is busy with other things.
const NEUTRAL_S: f64 = 1.0;

/// Pages that are opened from now on find a gamepad as soon as it is plugged in.
pub(crate) async fn emulate(browser: &Browser) {
    browser.devtools("Page.addScriptToEvaluateOnNewDocument", json!({ "source": PLUGGABLE })).await;
}

async fn fleet_and_pad() -> (Fleet, Dashboard, Browser) {
    let starts = vec![(0.0, 0.0, std::f64::consts::FRAC_PI_2)];
    let fleet = Fleet::start(Setup { robots: 1, speed: 1.0, starts, ..Setup::default() }).await;
    let dashboard = Dashboard::start(fleet.simulator.endpoint());
    let browser = Browser::start().await;
    emulate(&browser).await;
    browser.open(&dashboard.url(), 1).await;
    (fleet, dashboard, browser)
}

/// Takes xtb-1 by hand.
pub(crate) async fn begin(browser: &Browser) {
    browser.click("[data-robot=xtb-1]").await;
    let hidden = "return document.getElementById('drive').hidden";
    eventually("the joystick", || async {
        browser.click("#drive-begin").await;
        // A machine that is too busy may lose the control at once: then once more.
        let since = Instant::now();
        while browser.ask(hidden).await == true {
            if since.elapsed() > BEGINS_WITHIN {
                return None;
            }
        }
        Some(())
    })
    .await;
}

/// Holds the deadman button and the stick ahead until the robot rolls.
async fn roll(fleet: &impl GroundTruth, browser: &Browser) {
    browser.ask("window.pads = [window.pad]; window.pad.axes[1] = -1;").await;
    // A page that was held up lets go by itself: then the hand has to do so too, and press again. On a machine that
    // is too busy to keep the control it is taken anew.
    let stands = "return document.getElementById('drive').hidden ? 'ended'
        : document.querySelector('#stick.held') ? 'held'
        : document.getElementById('drive-pad').textContent.includes('hold a shoulder') ? 'ready' : 'spent'";
    eventually("rolling", || async {
        match browser.ask(stands).await.as_str() {
            Some("ended") => {
                let why = browser.ask("return document.getElementById('map-note').textContent.trim()").await;
                say(&format!("driving has ended: {why}"));
                begin(browser).await;
            }
            Some("ready") => drop(browser.ask("window.pad.buttons[5].pressed = true;").await),
            Some("spent") => drop(browser.ask("window.pad.buttons[5].pressed = false;").await),
            _ => {}
        }
        let truth = fleet.truth(1);
        (truth.speed_mps > 0.05 && truth.neutral_since_s.is_none()).then_some(())
    })
    .await;
}

/// From just before `script` to neutral, in s of the world.
async fn neutral_after(fleet: &impl GroundTruth, browser: &Browser, script: &str) -> f64 {
    let since_s = fleet.time_s();
    browser.ask(script).await;
    hand::neutral_since_s(fleet).await - since_s
}

/// Drives with the gamepad and loses it, three times.
pub(crate) async fn lose(fleet: &impl GroundTruth, browser: &Browser) {
    let mut took_s = Vec::new();
    for _ in 0..3 {
        roll(fleet, browser).await;
        took_s.push(neutral_after(fleet, browser, "window.pads = [null, null];").await);
        say(&format!("gamepad lost: neutral after {:.0} ms", took_s[took_s.len() - 1] * 1e3));
    }
    assert!(took_s.iter().all(|took_s| *took_s < NEUTRAL_S), "{took_s:?}");
    // A page that was held up had let go before: that tells nothing of a lost gamepad.
    assert!(took_s.iter().any(|took_s| (0.0..=LOST_S).contains(took_s)), "{took_s:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gamepad_drives_while_its_deadman_button_is_held_and_a_lost_one_means_neutral() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let (fleet, _dashboard, browser) = fleet_and_pad().await;
    begin(&browser).await;
    roll(&fleet, &browser).await;
    screen(&browser, "gamepad").await;
    lose(&fleet, &browser).await;
    for (what, script) in [
        ("deadman released", "window.pad.buttons[5].pressed = false;"),
        (
            "unplugged",
            "window.pad.connected = false; window.dispatchEvent(new Event('gamepaddisconnected'));",
        ),
        ("focus lost", "window.dispatchEvent(new Event('blur'));"),
    ] {
        browser.ask("window.pad.connected = true;").await;
        roll(&fleet, &browser).await;
        let took_s = neutral_after(&fleet, &browser, script).await;
        say(&format!("{what}: neutral after {:.0} ms", took_s * 1e3));
        assert!(took_s < NEUTRAL_S, "{what}: neutral {took_s} s later");
    }
    // The deadman button is still held, but it has to be pressed anew.
    let neutral_since_s = fleet.truth(1).neutral_since_s;
    fleet.simulated(1.0).await;
    assert_eq!(
        (fleet.truth(1).neutral_since_s, neutral_since_s.is_some()),
        (neutral_since_s, true),
        "it drove on"
    );
    let said = browser.ask("return document.getElementById('drive-pad').textContent").await;
    assert!(said.as_str().unwrap().contains("release the shoulder button first"), "{said}");

    // Nor does a button that is stuck from the beginning drive anybody.
    browser.click("#drive-end").await;
    fleet.until(1, "the lease is given back", |state| state.lease.is_none()).await;
    begin(&browser).await;
    fleet.simulated(1.0).await;
    assert_eq!(fleet.truth(1).neutral_since_s, neutral_since_s, "it drove");
    roll(&fleet, &browser).await;
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}

/// Steps through `gamepad.js` with pads and a clock of our own, in the browser.
const STEPS: &str = "
    const tell = arguments[arguments.length - 1];
    import('/assets/gamepad.js').then(({Gamepad}) => {
        const pad = (more) => ({index: 0, connected: true, mapping: 'standard', axes: [0, -1, 0, 0], timestamp: 1,
            buttons: Array.from({length: 17}, () => ({pressed: false})), ...more});
        const held = (more) => {
            const one = pad(more);
            one.buttons[4] = {pressed: true};
            return one;
        };
        const said = {};
        const one = new Gamepad();
        said.heldAtFirst = one.read([held()], 0);
        said.up = one.read([pad()], 20);
        said.held = one.read([held({axes: [0.5, -0.866]})], 40);
        said.inDeadZone = one.read([held({axes: [0.05, -0.05], timestamp: 2})], 60);
        said.other = one.read([null, held({index: 1})], 80);
        said.otherHeldOn = one.read([null, held({index: 1})], 100);
        one.read([pad()], 120);
        said.again = one.read([held()], 140) !== null;
        said.stillSoon = one.read([held()], 3000) !== null;
        said.silent = one.read([held()], 3200);
        said.movesAgain = one.read([held({timestamp: 9})], 3220);
        one.read([pad({timestamp: 10})], 3240);
        said.afterRelease = one.read([held({timestamp: 11})], 3260) !== null;
        one.release();
        said.takenAway = one.read([held({timestamp: 12})], 3280);
        one.read([pad()], 3300);
        said.unknownLayout = one.read([held({mapping: ''})], 3320);
        said.words = one.says;
        one.read([pad()], 3340);
        said.noNumber = one.read([held({axes: [NaN, -1]})], 3360);
        said.empty = one.read([null, null, null, null], 3380);
        said.noWords = one.says;
        tell(said);
    }, (error) => tell({error: String(error)}));";

#[tokio::test(flavor = "multi_thread")]
async fn a_deadman_button_counts_only_when_it_was_pressed_anew_on_a_pad_that_is_there() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    let said = browser.page.execute_async(STEPS, Vec::new()).await.unwrap();
    for nothing in [
        "heldAtFirst",
        "up",
        "other",
        "otherHeldOn",
        "silent",
        "movesAgain",
        "takenAway",
        "unknownLayout",
        "noNumber",
        "empty",
    ] {
        assert_eq!(said.get(nothing), Some(&serde_json::Value::Null), "{nothing}: {said}");
    }
    for yes in ["again", "stillSoon", "afterRelease"] {
        assert_eq!(said[yes], true, "{yes}: {said}");
    }
    let (x, y) = (said["held"]["x"].as_f64().unwrap(), said["held"]["y"].as_f64().unwrap());
    assert!((x - 0.5).abs() < 1e-3 && (y - 0.866).abs() < 1e-3, "{said}");
    assert_eq!(said["inDeadZone"], json!({ "x": 0, "y": 0 }));
    assert!(said["words"].as_str().unwrap().contains("layout is unknown"), "{said}");
    assert_eq!(said["noWords"], "");
    browser.end().await;
    fleet.end().await;
}

/// Whether the robot that is driven is in sight: on the map, and under nothing that lies on it.
const IN_SIGHT: &str = "
    const tell = arguments[arguments.length - 1];
    Promise.all([import('/assets/main.js'), import('/assets/free_area.js')]).then(([{store, view}, {boxesOver, isCovered}]) => {
        const floor = document.getElementById('floor');
        const {x_m, y_m} = store.robots.get('xtb-1').pose;
        const [x, y] = view.toScreen(x_m, y_m);
        tell(!isCovered(x, y, boxesOver(floor), floor.clientWidth, floor.clientHeight, 8));
    }, (error) => tell(String(error)));";

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_is_driven_is_under_no_panel_and_no_note_at_any_size() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    begin(&browser).await;
    let in_sight = |what: &'static str| {
        let browser = &browser;
        async move {
            eventually(what, || async {
                (browser.page.execute_async(IN_SIGHT, Vec::new()).await.unwrap() == true).then_some(())
            })
            .await;
        }
    };
    for (width, height) in [(1440, 900), (390, 844)] {
        let metrics =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        browser.devtools("Emulation.setDeviceMetricsOverride", metrics).await;
        browser.until("the new size", &format!("return innerWidth === {width}")).await;
        in_sight("in sight at this size").await;
        browser.ask("view.panBy(5000, -3000)").await;
        in_sight("in sight after the map was moved").await;
        // A note comes up just where the robot is.
        browser.ask("aim.use('goals')").await;
        browser.until("a note", "return document.getElementById('map-note').textContent.trim() !== ''").await;
        let under = "const note = document.getElementById('map-note').getBoundingClientRect();
            const floor = document.getElementById('floor').getBoundingClientRect();
            const {x_m, y_m} = store.robots.get('xtb-1').pose;
            view.bring(x_m, y_m, note.left + note.width / 2 - floor.left, note.top + note.height / 2 - floor.top);";
        browser.ask(under).await;
        in_sight("in sight beside the note").await;
        browser.ask("aim.use('look')").await;
    }
    browser.end().await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn control_is_taken_by_a_button_that_names_its_holder_and_asks_first() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    let connect = vec![fleet.simulator.endpoint().to_owned()];
    let settings = Settings { connect, client: name("alice"), ..Settings::new("lab").unwrap() };
    let alice = Client::open(&settings).await.unwrap();
    let control = Control::acquire(&alice, &name("xtb-1"), false).await.unwrap();
    browser.click("[data-robot=xtb-1]").await;
    let names = "return document.getElementById('take-control')?.textContent.includes('alice') === true";
    browser.until("who has control", names).await;
    browser.click("#take-control").await;
    browser.until("the question", "return document.getElementById('take') !== null").await;
    screen(&browser, "take-control").await;
    assert!(control.lost().is_none(), "nothing is taken before the answer");
    browser.click("#take").await;
    browser.until("the joystick", "return !document.getElementById('drive').hidden").await;
    eventually("alice has lost control", || async { control.lost() }).await;
    // Words for command lines are not for this page.
    let text = browser.ask("return document.body.innerText").await;
    assert!(!text.as_str().unwrap().contains("--take"), "{text}");
    browser.end().await;
    alice.close().await;
    fleet.end().await;
}
