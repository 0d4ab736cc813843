//! Measures the dashboard's page in a headless Chromium: how many pictures it draws with 50 robots at
//! 20 Hz, what it thins out, and how soon a robot that was driven by hand stands when its tab is closed.
//!
//! `cargo build --workspace && cargo run -p fleet-tests --example dashboard_rate [SECONDS] [TRIALS]`
//!
//! The 50 robots are played: real states and samples at 20 and 10 Hz over a real router, with made-up
//! poses. As many agents would need more than a small machine has. The one of the trials is real.

#![allow(clippy::unwrap_used)] // what cannot go on shall end

#[path = "../tests/browser/driver.rs"]
mod driver;
#[path = "../tests/browser/hand.rs"]
mod hand;

use driver::{Browser, Dashboard, say};
use fleet_tests::{Fleet, Setup, eventually, name};
use serde_json::Value;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::task::JoinHandle;
use xtb_bus::{Bus, Role};
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{RobotState, Sensors};

const ROBOTS: usize = 50;
const EVERY: Duration = Duration::from_millis(50);

#[tokio::main]
async fn main() {
    if !driver::is_there() {
        return;
    }
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<u64>().unwrap());
    let seconds = arguments.next().unwrap_or(30);
    let trials = arguments.next().unwrap_or(20);
    let fleet = Fleet::start(Setup { speed: 1.0, ..Setup::default() }).await;
    let dashboard = Dashboard::start(fleet.simulator.endpoint());
    closed_tabs(&fleet, &dashboard, trials).await;
    let crowd = crowd(&fleet).await;
    pictures(&dashboard, seconds).await;
    crowd.abort();
    fleet.end().await;
}

/// Pictures drawn in `seconds`, once the page has settled.
async fn pictures(dashboard: &Dashboard, seconds: u64) {
    let browser = Browser::start().await;
    browser.open(&dashboard.url(), ROBOTS + 1).await;
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
        "{} robots at 20 Hz for {seconds} s: {mean:.1} pictures/s on average, median {:.1}, 5 % of the gaps longer than at {:.1}; \
         {} frames shown, {} left out; thinned out: {}",
        ROBOTS + 1,
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

/// Robots that go round in circles, as far as anybody can tell.
async fn crowd(fleet: &Fleet) -> JoinHandle<()> {
    let role = Role::Client { connect: vec![fleet.simulator.endpoint().to_owned()] };
    let bus = xtb_bus::open(&role).await.unwrap();
    let state = fleet.state(1).await;
    let sensors = sensors(&bus, fleet).await;
    tokio::spawn(async move {
        let keys = FleetKeys::new(name("lab"));
        let mut players = Vec::new();
        for number in 0..ROBOTS {
            let robot = name(&format!("car-{number}"));
            let keys = keys.robot(&robot);
            let states =
                bus.publisher::<RobotState>(&keys.state(), &Channel::State, Format::Postcard).await.unwrap();
            let samples =
                bus.publisher::<Sensors>(&keys.sensors(), &Channel::Sensors, Format::Postcard).await.unwrap();
            let token = bus.declare_alive(&keys.alive()).await.unwrap();
            players.push((robot, states, samples, token));
        }
        let mut tick = tokio::time::interval(EVERY);
        for n in 0_u64.. {
            tick.tick().await;
            for (number, (robot, states, samples, _)) in players.iter().enumerate() {
                let state = on_circle(&state, robot, number, n);
                let _ = states.put(&state).await;
                if (n + number as u64).is_multiple_of(2) {
                    let _ = samples.put(&seeing(&sensors, &state)).await;
                }
            }
        }
    })
}

fn on_circle(template: &RobotState, robot: &xtb_protocol::Name, number: usize, n: u64) -> RobotState {
    let mut state = template.clone();
    let angle = n as f64 * 0.01 + number as f64;
    let (cx, cy) = ((number % 10) as f64 * 1.5, (number / 10) as f64 * 1.5);
    (state.robot, state.seq, state.tick_ms) = (robot.clone(), n, n * 50);
    (state.pose.x_m, state.pose.y_m) = (cx + 0.5 * angle.cos(), cy + 0.5 * angle.sin());
    state.pose.yaw_rad = angle + std::f64::consts::FRAC_PI_2;
    state.speed_mps = Some(0.1);
    state.reference_rpm = 12.0;
    state
}

fn seeing(template: &Sensors, state: &RobotState) -> Sensors {
    let mut sensors = template.clone();
    (sensors.robot, sensors.tick_ms) = (state.robot.clone(), state.tick_ms);
    sensors.ir_front_cm = [Some(40.0), Some(35.0), Some(30.0), None, Some(60.0), None];
    sensors
}

/// One of the real robot's samples.
async fn sensors(bus: &Bus, fleet: &Fleet) -> Sensors {
    let heard = Arc::<Mutex<Option<Sensors>>>::default();
    let into = Arc::clone(&heard);
    let key = fleet.robot(1).sensors();
    let _listening =
        bus.subscribe(&key, move |incoming| *into.lock().unwrap() = incoming.decode().ok()).await.unwrap();
    eventually("samples", || async { heard.lock().unwrap().clone() }).await
}
