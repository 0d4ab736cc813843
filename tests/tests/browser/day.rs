//! An operator's day at the page of `fleet-cli sim`, a process of its own with eight robots, dispatcher and dashboard:
//! places, goals, a closed way, an emergency stop and the way back from it, a task, driving by hand. After each step
//! the page shows what the robots say and what is true.

use crate::driver::{self, Browser, say};
use crate::{alone, estop_all, gamepad, map};
use fleet_tests::processes::{Process, Signal, program};
use fleet_tests::{GroundTruth, Monitor, eventually, name};
use serde_json::Value;
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use xtb_bus::{Bus, SessionRole};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{
    AlertKind, FleetAlerts, FleetMap, FleetPlaces, GoalStatus, Message, RobotState, TaskList, TaskState,
    TruthRobot,
};

const ROBOTS: usize = 8;
const WORLD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../worlds/lab.toml");
const ASK_WITHIN: Duration = Duration::from_secs(5);

/// Who is sent where: robot, a place that is named first, its x and y in m. The last one has to go through the door.
const SENT: [(usize, &str, f64, f64); 3] =
    [(2, "bay-east", 2.0, 1.3), (5, "bay-west", -4.0, 1.3), (UNDER_WAY, "bay-north", 0.0, 6.2)];
/// The robot that is under way when its way is closed, and at the emergency stop.
const UNDER_WAY: usize = 3;
/// Its way is closed here, north of the door, in m.
const CLOSED_Y_M: f64 = 5.2;
/// The zone, from there on west, south, east and north, in m.
const CLOSED_M: [f64; 2] = [0.4, 0.2];
/// So far from the zone the robot is at least when it is saved, in m.
const BEFORE_M: f64 = 1.0;
/// The robot that gets the task, and how far north of it that leads, in m.
const WORKER: usize = 7;
const TASK_M: f64 = 1.5;
/// So far it is driven at least before the day goes on, in m.
const MOVED_M: f64 = 0.3;
/// As far from its goal a robot may be by the ground truth, in m.
const REACHED_M: f64 = 0.5;
/// For so long nothing may move after a reset, in s of the world.
const STANDS_S: f64 = 1.0;
const ROLLS_MPS: f64 = 0.05;

/// A path of the page has points at the ends of its straights only: here twenty more on each.
const DENSE: &str = "const dense = (points) => points.flatMap(([x0, y0], i) => {
        const [x1, y1] = points[i + 1] ?? [x0, y0];
        return Array.from({length: 20}, (_, k) => [x0 + ((x1 - x0) * k) / 20, y0 + ((y1 - y0) * k) / 20]);
    });";

/// The simulation, and whoever watches it from outside.
struct Lab {
    monitor: Monitor,
    bus: Bus,
    keys: FleetKeys,
    url: String,
    sim: Process,
    _ledger: TempDir,
}

impl Lab {
    async fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(program("fleet-cli"));
        command.args(["--json", "sim", "--robots", &ROBOTS.to_string(), "--listen", "tcp/127.0.0.1:0"]);
        command.args(["--world", WORLD, "--dashboard", "127.0.0.1:0", "--dispatch", "--ledger"]);
        command.arg(folder.path().join("lab.ledger"));
        let (sim, lines) = Process::start_lines(&mut command, 2);
        let read =
            |line: &String| serde_json::from_str::<Value>(line).unwrap_or_else(|_| panic!("{lines:?}"));
        let (robots, page) = (read(&lines[0]), read(&lines[1]));
        let role = SessionRole::Client { connect: vec![robots["router"].as_str().unwrap().to_owned()] };
        let bus = xtb_bus::open(&role).await.unwrap();
        let monitor = Monitor::listen(&bus, "lab").await;
        let ready = |state: &RobotState| state.nav.map.is_some() && state.nav.traffic;
        for number in 1..=ROBOTS {
            monitor.until(number, "map and traffic control", ready).await;
        }
        let url = page["url"].as_str().unwrap().to_owned();
        Self { monitor, bus, keys: FleetKeys::new(name("lab")), url, sim, _ledger: folder }
    }

    /// What is served on a key.
    async fn served<M: Message>(&self, key: &str) -> M {
        eventually(key, || async { self.bus.get(key, ASK_WITHIN).await.unwrap().first()?.decode::<M>().ok() })
            .await
    }

    /// The ground truth of all robots.
    fn trucks(&self) -> [TruthRobot; ROBOTS] {
        std::array::from_fn(|index| self.monitor.truth(index + 1))
    }

    async fn rolls(&self, number: usize) {
        eventually(&format!("xtb-{number} rolls"), || async {
            let truck = self.monitor.truth(number);
            (truck.speed_mps.abs() > ROLLS_MPS && truck.neutral_since_s.is_none()).then_some(())
        })
        .await;
    }
}

/// What the page knows of a robot, as a script's expression.
fn row(number: usize) -> String {
    format!("store.robots.get('xtb-{number}')")
}

async fn select(browser: &Browser, number: usize) {
    let robot = format!("xtb-{number}");
    eventually(&format!("{robot} is selected"), || async {
        browser.click(&format!("[data-robot={robot}]")).await;
        (browser.ask("return store.selected").await == robot.as_str()).then_some(())
    })
    .await;
}

/// Names the places, and saves them for everybody.
async fn name_places(lab: &Lab, browser: &Browser) {
    map::edit(browser).await;
    for (_, place, x_m, y_m) in SENT {
        map::place(browser, place, x_m, y_m).await;
    }
    map::save(browser, "where robots wait").await;
    let shown = format!(
        "return {:?}.every((name) => store.places.some((place) => place.name === name))",
        SENT.map(|(_, place, ..)| place)
    );
    browser.until("the new places", &shown).await;
    browser.click("#edit-end").await;
    let served: FleetPlaces = lab.served(&lab.keys.places()).await;
    for (_, place, x_m, y_m) in SENT {
        let there = served.named(place).map(|place| (place.x_m, place.y_m));
        assert_eq!(there, Some((x_m, y_m)), "{place}");
    }
}

/// Sends each to its place with a click on the place's mark.
async fn send(lab: &Lab, browser: &Browser) {
    browser.click("[data-tool=goals]").await;
    for (number, place, x_m, y_m) in SENT {
        select(browser, number).await;
        let (x, y) = browser.on_screen(x_m, y_m).await;
        browser.click_at((x + 6.0, y - 5.0)).await;
        let goal = lab.monitor.until(number, "a goal", |state| state.goal.is_some()).await.goal.unwrap();
        assert_eq!((goal.x_m, goal.y_m), (Some(x_m), Some(y_m)), "{place}, not the pixel");
    }
    lab.rolls(UNDER_WAY).await;
    let shown = format!("return {}.goal?.status === 'running'", row(UNDER_WAY));
    browser.until("it drives on the page", &shown).await;
}

/// Closes the way of the one that goes through the door; it takes another one.
async fn close_the_way(lab: &Lab, browser: &Browser) {
    let path = format!("{DENSE} const path = dense({}.path?.points ?? []);", row(UNDER_WAY));
    let beyond = format!("{path} return path.some(([, y_m]) => y_m > {CLOSED_Y_M})");
    browser.until("its path through the door", &beyond).await;
    let nearest = format!(
        "{path} const away = ([, y_m]) => Math.abs(y_m - {CLOSED_Y_M});
         return path.reduce((best, point) => (away(point) < away(best) ? point : best))[0]"
    );
    let x_m = (browser.ask(&nearest).await.as_f64().unwrap() * 20.0).round() / 20.0;
    let [aside_m, along_m] = CLOSED_M;
    let zone = [x_m - aside_m, CLOSED_Y_M - along_m, x_m + aside_m, CLOSED_Y_M + along_m];
    map::edit(browser).await;
    map::keep_out(browser, zone).await;
    map::name(browser, "pallets").await;
    let [west, south, east, north] = zone;
    let crosses =
        format!("path.some(([x_m, y_m]) => x_m > {west} && x_m < {east} && y_m > {south} && y_m < {north})");
    browser.until("its way leads through the zone", &format!("{path} return {crosses}")).await;
    let at = lab.monitor.truth(UNDER_WAY);
    assert!(at.y_m < south - BEFORE_M, "it is there before the zone is: ({}, {})", at.x_m, at.y_m);
    let before = lab.monitor.until(UNDER_WAY, "a path", |state| state.nav.route.is_some()).await;
    map::save(browser, "pallets stand there").await;

    let another = format!("{path} return path.some(([, y_m]) => y_m > {CLOSED_Y_M}) && !{crosses}");
    browser.until("another path on the page, around the zone", &another).await;
    let hash = lab.served::<FleetMap>(&lab.keys.map()).await.hash.to_string();
    let has = |state: &RobotState| state.nav.map.as_ref().is_some_and(|map| map.hash == hash);
    for number in 1..=ROBOTS {
        lab.monitor.until(number, "the new map", has).await;
    }
    let track = |state: &RobotState| state.nav.route.as_ref().and_then(|route| route.track.clone());
    let differs = |state: &RobotState| track(state).is_some_and(|now| Some(now) != track(&before));
    let after = lab.monitor.until(UNDER_WAY, "another path", differs).await;
    let goal = |state: &RobotState| state.goal.as_ref().map(|goal| goal.id);
    assert_eq!(goal(&after), goal(&before), "the same goal");
    browser.click("#edit-end").await;
}

/// The two that had a short way are there.
async fn two_have_arrived(lab: &Lab, browser: &Browser) {
    for (number, place, x_m, y_m) in SENT.into_iter().filter(|(number, ..)| *number != UNDER_WAY) {
        let shown = format!("return {}.goal?.status === 'reached'", row(number));
        browser.until(&format!("xtb-{number} has reached {place}"), &shown).await;
        let truck = lab.monitor.truth(number);
        let off_m = (truck.x_m - x_m).hypot(truck.y_m - y_m);
        assert!(off_m < REACHED_M, "xtb-{number} is {off_m} m from {place}");
    }
}

/// Stops all while one is under way.
async fn stop_all(lab: &Lab, browser: &Browser) {
    lab.rolls(UNDER_WAY).await;
    estop_all(browser, ROBOTS).await;
    let latched = "return [...store.robots.values()].every((robot) => robot.latches.includes('estop'))";
    browser.until("the page shows the latches", latched).await;
    for number in 1..=ROBOTS {
        lab.monitor.until(number, "latched", |state| !state.latches.is_empty()).await;
        eventually("neutral", || async { lab.monitor.truth(number).neutral_since_s }).await;
    }
    let ended = |state: &RobotState| state.goal.as_ref().is_some_and(|goal| goal.status.is_final());
    let goal = lab.monitor.until(UNDER_WAY, "its goal has ended", ended).await.goal.unwrap();
    assert_ne!(goal.status, GoalStatus::Reached);
    browser.until("the dispatcher is suspended", "return store.isSuspended()").await;
}

/// One of the nine alerts is acknowledged: that the dispatcher is suspended.
async fn acknowledge(lab: &Lab, browser: &Browser) {
    browser.until("the title counts", "return document.title === '(9) XTB lab'").await;
    browser.click("#alert-badge").await;
    let id = "return store.alerts.alerts.find((alert) => alert.kind === 'suspended').id";
    let id = browser.ask(id).await.as_u64().unwrap();
    browser.click(&format!("[aria-label='Acknowledge alert {id}']")).await;
    let by = format!(
        "return document.querySelector('[data-alert=\"{id}\"]')?.textContent.includes('acknowledged by web-')"
    );
    browser.until("by whom", &by).await;
    browser.until("the title", "return document.title === '(8) XTB lab'").await;
    let alerts: FleetAlerts = lab.served(&lab.keys.dispatch_alerts()).await;
    let seen: Vec<_> = alerts.alerts.iter().filter(|alert| alert.acknowledged.is_some()).collect();
    assert_eq!(
        seen.iter().map(|alert| (alert.id, alert.kind)).collect::<Vec<_>>(),
        [(id, AlertKind::Suspended)]
    );
}

/// All are reset with one button, and none of them moves.
async fn reset_all(lab: &Lab, browser: &Browser) {
    browser.click("#reset-all").await;
    let asks = "return document.querySelector('[aria-label=\"Reset all\"]')?.textContent
        .includes('The dispatcher is suspended') === true";
    browser.until("it asks, and says what follows", asks).await;
    browser.click("#reset-all-yes").await;
    let none = "return [...store.robots.values()].every((robot) => robot.latches.length === 0)
        && document.getElementById('reset-all') === null";
    browser.until("no latch is left on the page", none).await;
    for number in 1..=ROBOTS {
        lab.monitor.until(number, "reset", |state| state.latches.is_empty()).await;
    }
    // The one that is left is acknowledged.
    browser.until("the title", "return document.title === 'XTB lab'").await;
}

/// A task waits as long as the dispatcher is suspended; nothing moves until it is activated.
async fn activate(lab: &Lab, browser: &Browser) {
    let (before, since_s) = (lab.trucks(), lab.monitor.time_s());
    browser.click("[data-for=tasks]").await;
    let chosen = format!(
        "const who = document.querySelectorAll('#tasks .form select')[1];
         if (!who) return false;
         who.value = 'robot:xtb-{WORKER}';
         return who.dispatchEvent(new Event('change', {{bubbles: true}}));"
    );
    browser.until("the robot is chosen", &chosen).await;
    browser.click("#task-points").await;
    let truck = before[WORKER - 1];
    browser.click_at(browser.on_screen(truck.x_m, truck.y_m + TASK_M).await).await;
    browser.until("the point", "return aim.points.length === 1").await;
    browser.click("#task-submit").await;
    let waits = "return document.getElementById('tasks').textContent.includes('It is not assigned yet')";
    browser.until("the task waits", waits).await;
    eventually("some time", || async { (lab.monitor.time_s() >= since_s + STANDS_S).then_some(()) }).await;
    for (index, (was, is)) in before.iter().zip(lab.trucks()).enumerate() {
        let (was, is) = (was.neutral_since_s, is.neutral_since_s);
        assert_eq!((is, was.is_some()), (was, true), "xtb-{} has moved", index + 1);
    }

    browser.click("#activate").await;
    browser.click("#activate-yes").await;
    let on = "return !store.isSuspended()
        && document.getElementById('services').textContent.includes('dispatcher on')";
    browser.until("the dispatcher is on", on).await;
    let begun = "return ['running', 'done'].includes(store.tasks?.tasks[0].state)";
    browser.until("the task has begun", begun).await;
    eventually("its robot has moved", || async {
        let is = lab.monitor.truth(WORKER);
        ((is.x_m - truck.x_m).hypot(is.y_m - truck.y_m) > MOVED_M).then_some(())
    })
    .await;
    let tasks: TaskList = lab.served(&lab.keys.dispatch_tasks()).await;
    assert_eq!(tasks.tasks[0].robot, Some(name(&format!("xtb-{WORKER}"))));
    assert!(matches!(tasks.tasks[0].state, TaskState::Running | TaskState::Done), "{:?}", tasks.tasks[0]);
    let over = "return store.alerts.alerts.every((alert) => alert.ended_ms !== null)";
    browser.until("every alert has ended", over).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_operator_sends_closes_a_way_stops_all_starts_again_and_drives_by_gamepad() {
    if !driver::is_there() {
        return;
    }
    let _room = alone().await;
    let began = Instant::now();
    let mut lab = Lab::start().await;
    let browser = Browser::start().await;
    gamepad::emulate(&browser).await;
    browser.open(&lab.url, ROBOTS).await;
    let there = "return store.frame.traffic_control && store.frame.dispatcher && store.map !== null";
    browser.until("traffic control, dispatcher and map", there).await;
    let told = |what: &str| say(&format!("{:5.1} s: {what}", began.elapsed().as_secs_f64()));
    told("the page shows eight robots");

    name_places(&lab, &browser).await;
    told("three places are named");
    send(&lab, &browser).await;
    told("three robots are sent");
    close_the_way(&lab, &browser).await;
    told("a zone is closed, a robot takes another way");
    two_have_arrived(&lab, &browser).await;
    told("two have arrived");
    stop_all(&lab, &browser).await;
    told("all are stopped");
    acknowledge(&lab, &browser).await;
    told("an alert is acknowledged");
    reset_all(&lab, &browser).await;
    told("all are reset");
    activate(&lab, &browser).await;
    told("the dispatcher is activated");
    select(&browser, 1).await;
    gamepad::begin(&browser).await;
    gamepad::lose(&lab.monitor, &browser).await;
    told("a robot was driven by hand");

    let contacts = lab.trucks().map(|truck| truck.contacts);
    assert_eq!(contacts, [0; ROBOTS], "a robot has touched something");
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    lab.bus.close().await;
    lab.sim.signal(Signal::Interrupt);
    eventually("the simulation ends", || std::future::ready((!lab.sim.runs()).then_some(()))).await;
}
