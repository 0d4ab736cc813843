//! Makes docs/images/dashboard-*.png: the dashboard in a headless Chromium, at the size of a desktop and
//! of a phone, dark and light, with a simulated fleet that works.
//!
//! `cargo build --workspace && cargo run -p fleet-tests --example screens [FOLDER]`

#![allow(clippy::unwrap_used)] // what cannot go on shall end

#[path = "../tests/browser/driver.rs"]
mod driver;

use driver::{Browser, Dashboard, say};
use fleet_tests::dispatch::{Asker, Serve, goto, route};
use fleet_tests::{Fleet, Setup, eventually};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;
use xtb_protocol::messages::{DispatchBody, TaskKind, TaskSpec, Waypoint, Who};
use xtb_sim::World;
use xtb_sim::fixes::FixTruth;

const PATIENCE: Duration = Duration::from_secs(60);
const DESKTOP: (u32, u32) = (1440, 900);
const PHONE: (u32, u32) = (390, 844);

/// Where a picture is taken and what it is called.
struct Camera {
    browser: Browser,
    folder: PathBuf,
}

impl Camera {
    async fn setting(&self, (width, height): (u32, u32), scheme: &str) {
        let is_phone = width < 600;
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": is_phone });
        self.browser.devtools("Emulation.setDeviceMetricsOverride", metrics).await;
        let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.browser.devtools("Emulation.setEmulatedMedia", media).await;
        // Two pictures later the page has its new size.
        let drawn = "const [tell] = arguments; requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(tell, 500)));";
        self.browser.page.execute_async(drawn, Vec::new()).await.unwrap();
    }

    async fn take(&self, name: &str) {
        let file = self.folder.join(format!("dashboard-{name}.png"));
        let png = self.browser.page.screenshot().await.unwrap();
        say(&format!("{} ({} kB)", file.display(), png.len() / 1000));
        std::fs::write(file, png).unwrap();
    }
}

#[tokio::main]
async fn main() {
    if !driver::is_there() {
        return;
    }
    let folder = std::env::args()
        .nth(1)
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/images"), PathBuf::from);
    let ledger = tempfile::tempdir().unwrap();
    let fleet = fleet().await;
    let _serve = Serve::start(fleet.simulator.endpoint(), &ledger.path().join("lab.ledger"));
    let dashboard = Dashboard::start(fleet.simulator.endpoint());
    let camera = Camera { browser: Browser::start().await, folder };
    let browser = &camera.browser;
    browser.open(&dashboard.url(), 5).await;
    camera.setting(DESKTOP, "dark").await;
    work(&fleet).await;
    browser.click("[data-robot=xtb-2]").await;
    browser
        .until(
            "trails",
            "return [...store.robots.values()].filter((robot) => robot.trail.length > 25).length >= 3",
        )
        .await;
    browser.until("a full plot", "return store.samples.t.length > 500").await;
    camera.take("desktop-dark").await;

    camera.setting(DESKTOP, "light").await;
    browser.click("[data-for=tasks]").await;
    browser.click_at(browser.on_screen(2.6, -3.2).await).await;
    browser.until("a preview", "return aim.preview !== null").await;
    browser.ask("aim.preview.yaw_rad = 0.9;").await;
    camera.setting(DESKTOP, "light").await;
    camera.take("desktop-light").await;

    camera.setting(PHONE, "light").await;
    browser.ask("aim.clear();").await;
    browser.click("[data-for=robots]").await;
    camera.setting(PHONE, "light").await;
    camera.take("phone-light").await;

    browser.click("[data-robot=xtb-5]").await;
    browser.click("#drive-begin").await;
    browser.until("the joystick", "return !document.getElementById('drive').hidden").await;
    camera.setting(PHONE, "dark").await;
    camera.take("phone-dark").await;
    browser.click("#drive-end").await;
    edit(&camera).await;

    camera.setting(DESKTOP, "dark").await;
    browser.click("[data-robot=xtb-3]").await;
    browser.click("#estop").await;
    browser
        .until(
            "all are latched",
            "return [...store.robots.values()].every((robot) => robot.latches.length > 0)",
        )
        .await;
    browser.until("who has stopped", "return document.querySelectorAll('[data-stopped]').length >= 5").await;
    camera.setting(DESKTOP, "dark").await;
    camera.take("estop").await;
    for complaint in browser.complaints().await {
        say(&format!("the page says: {complaint}"));
    }
    camera.browser.end().await;
    fleet.end().await;
}

/// The map while it is edited; nothing is saved.
async fn edit(camera: &Camera) {
    let browser = &camera.browser;
    camera.setting(DESKTOP, "dark").await;
    browser.click("[data-for=edit]").await;
    browser.click("#edit-begin").await;
    browser.click("[data-arm=keep_out]").await;
    browser.drag(browser.on_screen(1.8, -1.6).await, browser.on_screen(4.2, 0.2).await).await;
    browser.until("a zone", "return editor.draft.selected?.kind === 'zones'").await;
    browser.fill("#edit-name", "crane").await;
    browser.fill("#edit-why", "the crane has moved").await;
    browser.until("a version", "return editor.history !== null && editor.draft.item.name === 'crane'").await;
    camera.setting(DESKTOP, "dark").await;
    camera.take("editing").await;
    browser.click("#edit-end").await;
}

/// Five robots in the lab.
async fn fleet() -> Fleet {
    let world = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../worlds/lab.toml")).unwrap();
    // The last one before a wall, for its range finders to see.
    let starts =
        vec![(-2.0, -2.0, 0.8), (0.0, -4.0, 1.57), (2.5, 0.5, 3.1), (-3.0, 2.0, 0.0), (5.35, -3.0, 0.0)];
    let world = World::from_toml(&world).unwrap();
    let fixes = FixTruth { rate_hz: 2.0, ..FixTruth::default() };
    Fleet::start(Setup {
        robots: starts.len(),
        speed: 1.0,
        world: Some(world),
        starts,
        fixes,
        ..Setup::default()
    })
    .await
}

/// Gives the robots something to do, and waits until they are at it.
async fn work(fleet: &Fleet) {
    let asker = Asker::connect(fleet.simulator.endpoint(), "alice").await;
    let at = |x_m, y_m| Waypoint { x_m, y_m, yaw_rad: None };
    let patrol = TaskKind::Patrol {
        points: vec![at(-1.5, 2.5), at(3.0, 2.5), at(3.5, -2.0)],
        dwell_s: 2.0,
        for_s: None,
    };
    let who = |spec: TaskSpec, robot: &str| TaskSpec { who: Who::Robot(fleet_tests::name(robot)), ..spec };
    let tasks = vec![
        who(route(&[(1.0, 1.0), (0.5, 5.5), (3.0, 5.0)]), "xtb-1"),
        who(TaskSpec { priority: 7, ..TaskSpec::new(patrol) }, "xtb-2"),
        who(route(&[(-2.5, -2.0), (-3.0, -4.0)]), "xtb-3"),
        who(route(&[(-2.0, 3.0), (-2.5, 5.0), (0.0, 6.0)]), "xtb-4"),
        TaskSpec { priority: 2, ..who(goto(-2.0, 5.0), "xtb-1") },
    ];
    asker.ask_until(DispatchBody::Submit { tasks }, PATIENCE).await;
    eventually("robots under way", || async {
        ((1..=4).filter(|&n| fleet.truth(n).speed_mps.abs() > 0.05).count() >= 3).then_some(())
    })
    .await;
}
