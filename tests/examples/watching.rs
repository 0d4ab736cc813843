//! Measures what people see of a large fleet: the dashboard's page in a headless Chromium and the cockpit `top`, each
//! beside a `fleet-cli sim` whose robots stand and publish their states; the table of docs/simulator.md.
//! `cargo build --release --workspace && cargo run --release -p fleet-tests --example watching [N…]`
//!
//! Everything shares one machine, browser and terminal too. A robot counts as shown when it is not stale there.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // what cannot go on shall end; a measurement's table

#[path = "../tests/browser/driver.rs"]
mod driver;
#[path = "../tests/it/cockpit/pty.rs"]
mod pty;

use driver::{Browser, Dashboard};
use fantoccini::key::Key;
use fantoccini::wd::TimeoutConfiguration;
use fleet_tests::processes::{Process, program};
use pty::OnTerminal;
use serde_json::{Value, json};
use std::process::Command;
use std::time::{Duration, Instant};

const SIZES: [usize; 5] = [50, 100, 200, 500, 1000];
/// Pictures are counted for so long, once all robots are shown.
const WINDOW: Duration = Duration::from_secs(10);
/// And robots waited for.
const PATIENCE: Duration = Duration::from_secs(60);
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// How often a robot is looked for by its number; the median counts.
const TIMES: usize = 5;
/// Where the page has an editable field, keys go there.
const FILTER: &str = "robot-filter";

#[tokio::main]
async fn main() {
    if !driver::is_there() {
        return;
    }
    let sizes: Vec<usize> = std::env::args().skip(1).map(|size| size.parse().unwrap()).collect();
    let sizes = if sizes.is_empty() { SIZES.to_vec() } else { sizes };
    println!(
        "| robots | page: shown of them | after | pictures/s | 5 % longer than at | a robot by its number | says | `top`: \
         shows them after | a robot by its number | CPU, cores | says |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for robots in sizes {
        let mut sim = Command::new(program("fleet-cli"));
        let robots_text = robots.to_string();
        sim.args(["--json", "sim", "--listen", "tcp/127.0.0.1:0", "--robots", &robots_text]);
        let (_sim, ready) = Process::start_ready(&mut sim);
        let endpoint = ready.split('"').find(|part| part.starts_with("tcp/")).unwrap().to_owned();
        let page = page(&endpoint, robots).await;
        let cockpit = tokio::task::spawn_blocking(move || cockpit(&endpoint, robots)).await.unwrap();
        println!("| {robots} | {page} | {cockpit} |");
    }
}

async fn page(endpoint: &str, robots: usize) -> String {
    let dashboard = Dashboard::start(endpoint);
    let browser = Browser::start().await;
    let screen = json!({ "width": 1440, "height": 900, "deviceScaleFactor": 1, "mobile": false });
    browser.devtools("Emulation.setDeviceMetricsOverride", screen).await;
    let patient = TimeoutConfiguration::new(Some(PATIENCE), None, None);
    browser.page.update_timeouts(patient).await.unwrap();
    let began = Instant::now();
    browser.page.goto(&dashboard.url()).await.unwrap();
    let count = "return [...store.robots.values()].filter((robot) => !robot.stale).length";
    let mut shown = 0;
    while shown < robots as u64 && began.elapsed() < PATIENCE {
        shown = browser.ask(count).await.as_u64().unwrap();
        tokio::time::sleep(LOOK_EVERY).await;
    }
    let shown_s = began.elapsed().as_secs_f64();
    let (mean, low) = pictures(&browser).await;
    let mut found_s = Vec::new();
    for time in 0..TIMES {
        let number = robots - time;
        let began = Instant::now();
        press(&browser, "/").await;
        let focus = format!("return document.activeElement.id === '{FILTER}'");
        browser.until("the filter has the focus", &focus).await;
        press(&browser, &format!("xtb-{number}")).await;
        press(&browser, &char::from(Key::Enter).to_string()).await;
        browser.until("it is selected", &format!("return store.selected === 'xtb-{number}'")).await;
        found_s.push(began.elapsed().as_secs_f64());
        press(&browser, "/").await;
        press(&browser, &char::from(Key::Escape).to_string()).await;
    }
    let said = browser.ask("return (document.body.innerText.match(/[0-9.]+ × real time/) || [''])[0]").await;
    let complaints = browser.complaints().await;
    assert!(complaints.is_empty(), "{complaints:?}");
    browser.end().await;
    let said = said.as_str().filter(|said| !said.is_empty()).unwrap_or("-").to_owned();
    format!("{shown} | {shown_s:.1} s | {mean:.0} | {low:.0} | {:.2} s | {said}", median(found_s))
}

async fn press(browser: &Browser, keys: &str) {
    use fantoccini::actions::{InputSource, KeyAction, KeyActions};
    let mut actions = KeyActions::new("keys".into());
    for key in keys.chars() {
        actions = actions.then(KeyAction::Down { value: key }).then(KeyAction::Up { value: key });
    }
    browser.page.perform_actions(actions).await.unwrap();
}

/// Pictures a second, on average and where 5 % of the gaps are longer.
async fn pictures(browser: &Browser) -> (f64, f64) {
    let script = format!(
        "const tell = arguments[arguments.length - 1];
         const times = [];
         const began = performance.now();
         const look = (now) => {{
           times.push(now);
           if (now - began < {}) return requestAnimationFrame(look);
           tell(times);
         }};
         requestAnimationFrame(look);",
        WINDOW.as_millis()
    );
    let times = browser.page.execute_async(&script, Vec::new()).await.unwrap();
    let times: Vec<f64> = times.as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    let mut gaps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_unstable_by(f64::total_cmp);
    let mean = gaps.len() as f64 / (times.last().unwrap() - times[0]) * 1e3;
    (mean, 1e3 / gaps[(gaps.len() - 1) * 95 / 100])
}

fn cockpit(endpoint: &str, robots: usize) -> String {
    let began = Instant::now();
    let mut top = OnTerminal::start(160, 50, &["--connect", endpoint, "--client", "pilot", "top"]);
    top.until("all robots", |text| text.contains(&format!("{robots} robots")));
    let shown_s = began.elapsed().as_secs_f64();
    let mut found_s = Vec::new();
    for time in 0..TIMES {
        let robot = format!("xtb-{}", robots - time);
        let began = Instant::now();
        top.keys(&format!("/{robot}"));
        top.until("one robot is left", |text| {
            let rows = text.lines().filter(|line| line.contains("xtb-")).count();
            text.contains(&robot) && rows < 6
        });
        found_s.push(began.elapsed().as_secs_f64());
        top.keys("\x1b");
        top.until("all again", |text| text.lines().filter(|line| line.contains("xtb-")).count() > 6);
    }
    let before = cpu_s(&top.process);
    std::thread::sleep(WINDOW);
    let cores = (cpu_s(&top.process) - before) / WINDOW.as_secs_f64();
    let text = top.screen().text();
    let said = text.lines().find_map(|line| {
        let (before, _) = line.split_once(" × real time")?;
        Some(format!("{} × real time", before.rsplit(' ').next()?))
    });
    top.keys("q");
    let _ = top.ended();
    format!(
        "{shown_s:.1} s | {:.2} s | {cores:.2} | {}",
        median(found_s),
        said.unwrap_or_else(|| "-".to_owned())
    )
}

/// CPU time that it has had, in s.
fn cpu_s(process: &Process) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", process.0.id())).unwrap();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    let ticks = |index: usize| fields[index].parse::<f64>().unwrap();
    (ticks(11) + ticks(12)) / rustix::param::clock_ticks_per_second() as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}
