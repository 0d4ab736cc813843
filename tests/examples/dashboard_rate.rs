//! Measures the dashboard's page in a headless Chromium: how many pictures it draws with many robots at
//! 20 Hz, what it thins out, and how soon a robot that was driven by hand stands when its tab is closed.
//!
//! `cargo build --workspace && cargo run -p fleet-tests --example dashboard_rate [SECONDS] [TRIALS] [ROBOTS]`
//!
//! The robots are played, 50 unless it is said otherwise: real states and samples at 20 and 10 Hz over a real router,
//! with made-up poses. The one of the trials is real.

#![allow(clippy::unwrap_used)] // what cannot go on shall end

#[path = "../tests/browser/crowd.rs"]
mod crowd;
#[path = "../tests/browser/driver.rs"]
mod driver;
#[path = "../tests/browser/hand.rs"]
mod hand;

use driver::{Browser, Dashboard, say};
use fleet_tests::{Fleet, Setup};
use serde_json::Value;
use std::time::Duration;

const ROBOTS: u64 = 50;
const EVERY: Duration = Duration::from_millis(50);

#[tokio::main]
async fn main() {
    if !driver::is_there() {
        return;
    }
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<u64>().unwrap());
    let seconds = arguments.next().unwrap_or(30);
    let trials = arguments.next().unwrap_or(20);
    let robots = arguments.next().unwrap_or(ROBOTS) as usize;
    let fleet = Fleet::start(Setup { speed: 1.0, ..Setup::default() }).await;
    let dashboard = Dashboard::start(fleet.simulator.endpoint());
    closed_tabs(&fleet, &dashboard, trials).await;
    let crowd = crowd::crowd(&fleet, robots, EVERY, |_, _| {}).await;
    pictures(&dashboard, seconds, robots + 1).await;
    crowd.abort();
    fleet.end().await;
}

/// Pictures drawn in `seconds`, once the page has settled.
async fn pictures(dashboard: &Dashboard, seconds: u64, robots: usize) {
    let browser = Browser::start().await;
    browser.open(&dashboard.url(), robots).await;
    let script = format!(
        "const tell = arguments[arguments.length - 1];
         import('/assets/main.js').then(({{store, pace}}) => {{
           const [times, thinned, skipped] = [[], new Set(), store.frame.skipped];
           const [began, first] = [performance.now(), store.frame.n];
           const look = (now) => {{
             times.push(now);
             pace.thinned().forEach((one) => thinned.add(one));
             if (now - began < {seconds}000) return requestAnimationFrame(look);
             tell({{times, thinned: [...thinned], skipped: store.frame.skipped - skipped, frames: store.frame.n - first}});
           }};
           requestAnimationFrame(look);
         }});"
    );
    browser
        .devtools(
            "Emulation.setDeviceMetricsOverride",
            serde_json::json!({ "width": 1440, "height": 900, "deviceScaleFactor": 1, "mobile": false }),
        )
        .await;
    browser.page.update_timeouts(patient(seconds)).await.unwrap();
    let seen = browser.page.execute_async(&script, Vec::new()).await.unwrap();
    let times: Vec<f64> = seen["times"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    let mut gaps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_unstable_by(f64::total_cmp);
    let fps = |share: f64| 1000.0 / gaps[((gaps.len() - 1) as f64 * share) as usize];
    let mean = gaps.len() as f64 / (times.last().unwrap() - times[0]) * 1000.0;
    say(&format!(
        "{robots} robots at 20 Hz for {seconds} s: {mean:.1} pictures/s on average, median {:.1}, 5 % of the gaps longer than at {:.1}; \
         {} frames shown, {} left out; thinned out: {}",
        fps(0.5),
        fps(0.95),
        seen["frames"],
        seen["skipped"],
        seen["thinned"],
    ));
    browser.end().await;
}

fn patient(seconds: u64) -> fantoccini::wd::TimeoutConfiguration {
    let script = Duration::from_secs(seconds + 60);
    fantoccini::wd::TimeoutConfiguration::new(Some(script), None, None)
}

/// Closes a tab that drives, again and again.
async fn closed_tabs(fleet: &Fleet, dashboard: &Dashboard, trials: u64) {
    let browser = Browser::start().await;
    let first = browser.page.window().await.unwrap();
    let mut took_ms = Vec::new();
    for _ in 0..trials {
        let next = browser.page.new_window(true).await.unwrap();
        browser.page.switch_to_window(next.handle).await.unwrap();
        browser.open(&dashboard.url(), 1).await;
        hand::drive(fleet, &browser).await;
        let closed_s = fleet.time_s();
        browser.page.close_window().await.unwrap();
        took_ms.push((hand::neutral_since_s(fleet).await - closed_s) * 1e3);
        browser.page.switch_to_window(first.clone()).await.unwrap();
        fleet.until(1, "the lease is given back", |state| state.lease.is_none()).await;
    }
    took_ms.sort_unstable_by(f64::total_cmp);
    if let Some((median, worst)) = took_ms.get(took_ms.len() / 2).zip(took_ms.last()) {
        say(&format!(
            "{trials} tabs closed while driving: neutral after {median:.0} ms (median), {worst:.0} ms at most"
        ));
    }
    browser.end().await;
}
