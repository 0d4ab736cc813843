//! A recording on the page: the bar shows where it is, pauses it, and takes it elsewhere. And a page that has lost its
//! server, which knows nothing of its robots any more.

use crate::driver::{self, Browser};
use crate::{beside_another, fleet_on_page};
use fleet_tests::{eventually, name};
use std::sync::{Arc, Mutex};
use xtb_client::scene::Scene;
use xtb_client::scene::live::SharedScene;
use xtb_dashboard::{Playback, PlaybackPosition, Running, ServerSettings, Shown};

struct Tape(Mutex<PlaybackPosition>);

impl Playback for Tape {
    fn position(&self) -> PlaybackPosition {
        *self.0.lock().unwrap()
    }

    fn seek(&self, position_ms: u64) {
        self.0.lock().unwrap().position_ms = position_ms;
    }

    fn pause(&self, paused: bool) {
        self.0.lock().unwrap().paused = paused;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_bar_of_a_recording_shows_where_it_is_pauses_it_and_takes_it_elsewhere() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let tape = Arc::new(Tape(Mutex::new(PlaybackPosition {
        began_ms: 1_700_000_000_000,
        position_ms: 15_400,
        duration_ms: 65_000,
        speed: 1.0,
        paused: false,
        ended: false,
    })));
    let settings = ServerSettings {
        listen: "127.0.0.1:0".parse().unwrap(),
        secure: None,
        token: None,
        insecure: false,
        read_only: true,
        allow_origins: Vec::new(),
        proxies: Vec::new(),
        hz: 10.0,
    };
    let scene = Arc::new(SharedScene::played(Scene::new(name("lab"))));
    let shown = Shown { scene, commands: None, playback: Some(tape.clone()) };
    let running = Running::start(settings, shown).await.unwrap();
    let browser = Browser::start().await;
    browser.page.goto(&running.url()).await.unwrap();
    let says =
        |text: &str| format!("return document.querySelector('#playback output')?.textContent === '{text}'");
    browser.until("the position", &says("0:15 of 1:05")).await;
    browser.click("#playback button").await;
    eventually("a pause", || async { tape.position().paused.then_some(()) }).await;
    let button = "return document.querySelector('#playback button').textContent === 'Continue'";
    browser.until("the button", button).await;
    let drag = "const slider = document.querySelector('#playback input');
        slider.value = 42000;
        slider.dispatchEvent(new Event('input'));
        const told = document.querySelector('#playback output').textContent;
        slider.dispatchEvent(new Event('change'));
        return told;";
    assert_eq!(browser.ask(drag).await, "0:42 of 1:05", "it follows the hand at once");
    eventually("another place", || async { (tape.position().position_ms == 42_000).then_some(()) }).await;
    browser.until("the other place", &says("0:42 of 1:05")).await;
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    running.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_without_its_server_calls_robots_unknown() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, dashboard, browser) = fleet_on_page(1, 1.0).await;
    let bar = "return document.getElementById('playback').childElementCount === 0";
    browser.until("no bar of a fleet that is live", bar).await;
    drop(dashboard);
    let row = "const text = document.querySelector('[data-robot=xtb-1]').textContent;
        return text.includes('unknown: no connection') && !text.includes('missing')";
    browser.until("an unknown robot", row).await;
    browser.end().await;
    fleet.end().await;
}
