//! Measures the page and the cockpit beside a large live fleet: the table of docs/dashboard-page.md.
//! `cargo build --release --workspace && cargo run --release -p fleet-tests --example watching [N…]`
//!
//! For each number of robots a `fleet-cli sim` as a process of its own, whose robots all wander; then `top` on a
//! terminal of 160 × 50, then the dashboard and its page in a headless Chromium. Of both: how soon all robots are
//! there, how often what is drawn changes, how soon the last robot is selected with the keyboard, and how soon an
//! emergency stop of all is confirmed by all, beside the ground truth. Browser and commands take their part of the
//! same machine.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // a measurement's table; what cannot go on shall end

#[path = "../tests/browser/driver.rs"]
mod driver;
#[path = "thousand/fleet.rs"]
mod fleet;
#[path = "../tests/it/cockpit/pty.rs"]
mod pty;

use driver::{Browser, Dashboard};
use fantoccini::actions::{InputSource, KeyAction, KeyActions};
use fantoccini::key::Key;
use fleet::{LOOK_EVERY, Witness, Work, cli, simulators, until};
use fleet_tests::processes::Process;
use pty::OnTerminal;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

const SIZES: [usize; 3] = [100, 500, 1000];
/// Until all that wander are under way, and how long it is looked at.
const SETTLE: Duration = Duration::from_secs(10);
const WINDOW: Duration = Duration::from_secs(15);
const RESETS: usize = 3;
const PATIENCE: Duration = Duration::from_secs(120);

#[tokio::main]
async fn main() {
    if !driver::is_there() {
        return;
    }
    let mut sizes: Vec<usize> = std::env::args().skip(1).map(|text| text.parse().unwrap()).collect();
    if sizes.is_empty() {
        sizes = SIZES.to_vec();
    }
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!(
        "{} cores, load {} before.\n",
        std::thread::available_parallelism().unwrap(),
        load.split(' ').next().unwrap_or_default()
    );
    println!(
        "| robots | screen | all shown after | real time | drawn per second | last robot selected after | emergency stop confirmed | last motor neutral | details reduced |"
    );
    println!("|{}", " ---: |".repeat(9));
    for robots in sizes {
        let fleet = Fleet::start(robots).await;
        fleet.wander().await;
        cockpit(&fleet).await;
        fleet.wander().await;
        page(&fleet).await;
    }
}

/// Simulated robots, and who hears the truth about them.
struct Fleet {
    robots: usize,
    endpoint: String,
    witness: Arc<Witness>,
    _simulators: Vec<Process>,
}

impl Fleet {
    async fn start(robots: usize) -> Self {
        let (simulators, endpoint) = simulators(robots, 1).await.unwrap();
        let witness = Arc::new(Witness::open(&endpoint, 1).await.unwrap());
        Self { robots, endpoint, witness, _simulators: simulators }
    }

    /// Lets all of them wander, also after an emergency stop.
    async fn wander(&self) {
        // Beside an overloaded computer not all answer in time the first time.
        let endpoint = self.endpoint.clone();
        let reset = move || {
            let mut reset = cli(&["--connect", &endpoint, "--timeout", "30", "reset", "--all", "--yes"]);
            (0..RESETS).any(|_| Process::start(reset.stdout(Stdio::null())).0.wait().unwrap().success())
        };
        assert!(tokio::task::spawn_blocking(reset).await.unwrap(), "reset");
        self.witness.is_over.store(false, Ordering::Relaxed);
        let working = tokio::spawn(Arc::clone(&self.witness).employ(Work::Wander));
        let most_drive = || self.witness.moving() * 10 >= self.robots * 9;
        until("nine of ten robots drive", most_drive).await.unwrap();
        self.witness.is_over.store(true, Ordering::Relaxed);
        working.await.unwrap();
        tokio::time::sleep(SETTLE).await;
    }

    /// How long it takes until the last motor is neutral, in s.
    async fn neutral_s(&self) -> f64 {
        let began = Instant::now();
        until("all are neutral", || self.witness.is_neutral()).await.unwrap();
        began.elapsed().as_secs_f64()
    }
}

/// What one screen did.
struct Row {
    screen: &'static str,
    shown_s: f64,
    real_time: f64,
    drawn_hz: f64,
    selected_s: f64,
    /// By so many, and when the last answer was there.
    confirmed: usize,
    confirmed_s: f64,
    neutral_s: f64,
    reduced: String,
}

impl Row {
    fn print(&self, robots: usize) {
        let Self {
            screen,
            shown_s,
            real_time,
            drawn_hz,
            selected_s,
            confirmed,
            confirmed_s,
            neutral_s,
            reduced,
        } = self;
        println!(
            "| {robots} | {screen} | {shown_s:.1} s | {real_time:.2} | {drawn_hz:.1} | {selected_s:.2} s | by {confirmed} after {confirmed_s:.2} s | {neutral_s:.2} s | {reduced} |"
        );
    }
}

async fn cockpit(fleet: &Fleet) {
    let (robots, last) = (fleet.robots, format!("xtb-{}", fleet.robots));
    let began = Instant::now();
    let arguments = ["--connect", &fleet.endpoint, "--timeout", "30", "top"];
    let mut top = OnTerminal::start(160, 50, &arguments);
    let title = |text: &str| text.lines().next().unwrap_or_default().to_owned();
    top.until("all robots", |text| {
        let title = title(text);
        title.contains(&format!("{robots} robots")) && !title.contains("STALE") && !title.contains("MISSING")
    });
    let shown_s = began.elapsed().as_secs_f64();

    let (began, before_s, mut pictures, mut seen) =
        (Instant::now(), fleet.witness.time_s(), 0, String::new());
    while began.elapsed() < WINDOW {
        let text = top.screen().text();
        if text != seen {
            (pictures, seen) = (pictures + 1, text);
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
    let real_time = (fleet.witness.time_s() - before_s) / began.elapsed().as_secs_f64();
    let drawn_hz = f64::from(pictures) / began.elapsed().as_secs_f64();

    let began = Instant::now();
    top.keys(&format!("/{robots}\r"));
    top.until("the last one is selected", |text| text.contains(&format!(">{last}")));
    let selected_s = began.elapsed().as_secs_f64();
    top.keys("/");
    top.until("the filter is written", |text| text.contains("Esc clear"));
    top.keys("\x1b"); // alone: with a letter at once after it, it would be another key
    top.until("all again", |text| !text.contains("Esc clear"));
    let began = Instant::now();
    top.keys("E");
    let (neutral_s, confirmed_s) = tokio::join!(fleet.neutral_s(), async {
        let all = format!("{robots} LATCHED");
        until("all have confirmed", || top.screen().text().contains(&all)).await.unwrap();
        began.elapsed().as_secs_f64()
    });
    let (confirmed, reduced) = (robots, "–".to_owned());
    Row {
        screen: "`top`",
        shown_s,
        real_time,
        drawn_hz,
        selected_s,
        confirmed,
        confirmed_s,
        neutral_s,
        reduced,
    }
    .print(robots);
    top.keys("q");
    top.ended();
}

async fn page(fleet: &Fleet) {
    let (robots, last) = (fleet.robots, format!("xtb-{}", fleet.robots));
    let dashboard = Dashboard::start(&fleet.endpoint);
    let browser = Browser::start().await;
    let began = Instant::now();
    browser.page.goto(&dashboard.url()).await.unwrap();
    let fresh =
        format!("return [...store.robots.values()].filter((robot) => !robot.stale).length === {robots}");
    browser.until("all robots", &fresh).await;
    let shown_s = began.elapsed().as_secs_f64();
    let timeouts = fantoccini::wd::TimeoutConfiguration::new(Some(PATIENCE), None, None);
    browser.page.update_timeouts(timeouts).await.unwrap();

    let before_s = (Instant::now(), fleet.witness.time_s());
    let script = format!(
        "const tell = arguments[arguments.length - 1];
         import('/assets/main.js').then(({{pace}}) => {{
           const [began, thinned] = [performance.now(), new Set()];
           let pictures = 0;
           const look = (now) => {{
             pictures += 1;
             pace.thinned().forEach((one) => thinned.add(one));
             if (now - began < {}) return requestAnimationFrame(look);
             tell({{hz: 1000 * pictures / (now - began), thinned: [...thinned].join(', ')}});
           }};
           requestAnimationFrame(look);
         }});",
        WINDOW.as_millis()
    );
    let seen = browser.page.execute_async(&script, Vec::new()).await.unwrap();
    let real_time = (fleet.witness.time_s() - before_s.1) / before_s.0.elapsed().as_secs_f64();
    let drawn_hz = seen["hz"].as_f64().unwrap();

    let began = Instant::now();
    press(&browser, '/').await;
    browser.until("the filter has the focus", "return document.activeElement.id === 'robot-filter'").await;
    for digit in robots.to_string().chars() {
        press(&browser, digit).await;
    }
    let one = format!("return document.querySelector('.robot-row')?.dataset.robot === '{last}'");
    browser.until("it is found", &one).await;
    press(&browser, char::from(Key::Enter)).await;
    browser.until("it is selected", &format!("return store.selected === '{last}'")).await;
    let selected_s = began.elapsed().as_secs_f64();
    if let Some(folder) = std::env::var_os("XTB_SCREENS") {
        let png = browser.page.screenshot().await.unwrap();
        std::fs::write(std::path::Path::new(&folder).join(format!("watching-{robots}.png")), png).unwrap();
    }

    let began = Instant::now();
    let answered = "const said = document.getElementById('stops').textContent;
        return said.includes('Emergency stop of all robots') && !said.includes('waiting for confirmation')";
    let (neutral_s, confirmed_s) = tokio::join!(fleet.neutral_s(), async {
        browser.click("#estop").await;
        browser.until("the answers", answered).await;
        began.elapsed().as_secs_f64()
    });
    let good = "return document.querySelectorAll('[data-stopped].good').length";
    let confirmed = browser.ask(good).await.as_u64().unwrap() as usize;
    let reduced = seen["thinned"].as_str().unwrap_or_default().to_owned();
    Row {
        screen: "page",
        shown_s,
        real_time,
        drawn_hz,
        selected_s,
        confirmed,
        confirmed_s,
        neutral_s,
        reduced,
    }
    .print(robots);
    browser.end().await;
}

async fn press(browser: &Browser, value: char) {
    let key =
        KeyActions::new("keyboard".into()).then(KeyAction::Down { value }).then(KeyAction::Up { value });
    browser.page.perform_actions(key).await.unwrap();
}
