//! Lines that break under a driving truck: the fault has its name in time, the truck stands, and it
//! is well again by itself but does not start to move. Board and gyro hang on ptys.
//!
//! The agents live by the world's clock, so their ticks and the truth's seconds are the same time,
//! and a busy machine slows both down.

mod cables;

use cables::Socket;
use fleet_tests::processes::{Process, program};
use fleet_tests::{Fleet, Setup, agent_config, eventually, name};
use robot_agent::AgentError;
use robot_agent::hardware::serial::SerialHardware;
use robot_agent::hardware::simulated::TruckLines;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_bus::Subscription;
use xtb_control::Mode;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{
    Body, Event, EventKind, Fault, FaultState, GoalStatus, LinkLoss, Outcome, RejectCode, RobotState,
    StopReason, Via,
};
use xtb_sim::{InjectedLineFault, LineFaults, Transmitter};

/// From the last good frame to a fault's name, in ms of the robot's clock. (A pty's hang-up may take the kernel
/// longer than the silence takes to be named: then that is named first.)
const NAMED_WITHIN_MS: u64 = 200;
/// From the last good frame to a neutral motor.
const NEUTRAL_WITHIN_MS: f64 = 250.0;
/// For so long nothing may move after a line is well again.
const STANDS_MS: u64 = 1000;

/// A truck on ptys and its agent.
struct Truck<'a> {
    fleet: &'a Fleet,
    number: usize,
    board: Socket,
    gyro: Socket,
    end: watch::Sender<bool>,
    agent: JoinHandle<Result<(), AgentError>>,
}

/// Which line breaks.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Line {
    Board,
    Gyro,
}

/// How it breaks.
#[derive(Debug, Clone, Copy, PartialEq)]
enum How {
    /// The device at its other end, or the cable.
    Sends(InjectedLineFault),
    /// Pulled out and put in again.
    Unplugged,
    /// Pulled out for a moment, and somebody else was faster.
    Busy,
}

/// Faults that began (true) or ended, and when on the robot's clock.
struct News {
    found: Arc<Mutex<Vec<(u64, Fault, bool)>>>,
    _subscription: Subscription,
}

impl News {
    fn since(&self, since_ms: u64) -> Vec<(u64, Fault, bool)> {
        let mut news = self.found.lock().unwrap().clone();
        news.retain(|(at_ms, ..)| *at_ms > since_ms);
        news
    }

    /// The first fault at this place since then, in ms.
    async fn first_at(&self, place: &str, since_ms: u64) -> u64 {
        let named = || async {
            let begun = |(at_ms, fault, present): (u64, Fault, bool)| {
                (present && fault.place() == place).then_some(at_ms)
            };
            self.since(since_ms).into_iter().find_map(begun)
        };
        eventually("an event that names a fault", named).await
    }

    /// This fault has begun and ended since then, and nothing else was said to be broken.
    fn only(&self, fault: Fault, since_ms: u64) {
        let news = self.since(since_ms);
        let is = |present| news.iter().any(|(_, one, now)| (*one, *now) == (fault, present));
        let elsewhere = news.iter().any(|(_, other, _)| other.place() != fault.place());
        assert!(is(true) && is(false) && !elsewhere, "{fault}: {news:?}");
    }
}

/// A fleet at real time whose lines the tests bring along.
async fn fleet(robots: usize, folder: &Path) -> Fleet {
    let setup = Setup { robots, speed: 1.0, pty: Some(folder.to_owned()), ..Setup::default() };
    let fleet = Fleet::start(setup).await;
    fleet.simulated(0.05).await; // until then there is no truth
    fleet
}

impl<'a> Truck<'a> {
    /// Starts an agent; its ports are still empty.
    fn unplugged(fleet: &'a Fleet, number: usize, folder: &Path) -> Self {
        let socket = |device: &str| Socket::empty(folder, &format!("{device}-{number}"));
        let (board, gyro) = (socket("board"), socket("gyro"));
        let lines = TruckLines { board: Box::new(board.cable.clone()), gyro: Box::new(gyro.cable.clone()) };
        fleet.simulator.world().replace_lines(number - 1, lines);
        let hardware = SerialHardware::start(board.settings(), gyro.settings()).unwrap();
        let truth = fleet.truth(number);
        let mut config = agent_config(fleet.simulator.endpoint(), "lab");
        config.robot = name(&format!("xtb-{number}"));
        config.start_pose = MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad };
        let clock = fleet.simulator.world().time().join();
        let (end, shutdown) = watch::channel(false);
        let agent =
            tokio::spawn(async move { robot_agent::run(&config, Box::new(hardware), clock, shutdown).await });
        Self { fleet, number, board, gyro, end, agent }
    }

    fn plugged(fleet: &'a Fleet, number: usize, folder: &Path) -> Self {
        let truck = Self::unplugged(fleet, number, folder);
        truck.board.plug();
        truck.gyro.plug();
        truck
    }

    fn socket(&self, line: Line) -> &Socket {
        match line {
            Line::Board => &self.board,
            Line::Gyro => &self.gyro,
        }
    }

    async fn until(&self, what: &str, is: impl Fn(&RobotState) -> bool) -> RobotState {
        self.fleet.until(self.number, &format!("xtb-{}: {what}", self.number), is).await
    }

    async fn well(&self) -> RobotState {
        let heard = |state: &RobotState| {
            let ages = state.input_age_ms;
            [ages.gyro, ages.encoder, ages.adc].iter().all(|age| age.is_some_and(|ms| ms <= 200))
        };
        self.until("no fault", |state| state.faults.is_empty() && heard(state)).await
    }

    async fn named(&self, fault: Fault) -> RobotState {
        self.until(&fault.to_string(), |state| state_of(state, fault).is_some()).await
    }

    /// A goal straight ahead, from where the robot believes to be.
    async fn ahead(&self, way_m: f64) -> (f64, f64) {
        let pose = self.fleet.state(self.number).await.pose;
        (pose.x_m + way_m * pose.yaw_rad.cos(), pose.y_m + way_m * pose.yaw_rad.sin())
    }

    async fn ask_ahead(&self, way_m: f64) -> Outcome {
        let (x_m, y_m) = self.ahead(way_m).await;
        let body = Body::Goto {
            x_m,
            y_m,
            yaw_rad: None,
            via: Some(Via::Direct),
            on_link_loss: LinkLoss::Finish,
            finish_s: 300.0,
        };
        self.fleet.ask(self.number, body).await
    }

    async fn drive(&self) {
        self.well().await;
        let outcome = self.ask_ahead(2.6).await;
        assert!(matches!(outcome, Outcome::Ok(_)), "{outcome:?}");
        let moving = || async { (self.fleet.truth(self.number).speed_mps > 0.08).then_some(()) };
        eventually("the truck to drive", moving).await;
    }

    fn set_line_fault(&self, line: Line, fault: InjectedLineFault) {
        let mut faults = LineFaults::default();
        match line {
            Line::Board => faults.board = fault,
            Line::Gyro => faults.gyro = fault,
        }
        let index = self.number - 1;
        self.fleet.simulator.world().change(move |world| world.trucks_mut()[index].set_line_faults(faults));
    }

    /// The goal has failed, the motor is neutral, and nobody can drive it.
    async fn stands_with(&self, line: Line, state: &RobotState) {
        let goal = state.goal.as_ref().map(|goal| goal.status);
        assert!(matches!(state.mode, Mode::Idle | Mode::Fault), "{state:?}");
        assert_eq!(goal, Some(GoalStatus::Failed), "{state:?}");
        let reason = match line {
            Line::Board => StopReason::BoardLost,
            Line::Gyro => StopReason::GyroLost,
        };
        assert!(state.stopped_because.contains(&reason), "{state:?}");
        match self.ask_ahead(0.5).await {
            Outcome::Error(error) => assert_eq!(error.code, RejectCode::Latched),
            Outcome::Ok(done) => panic!("{done:?}"),
        }
    }

    async fn neutral_since_s(&self) -> f64 {
        eventually("neutral", || async { self.fleet.truth(self.number).neutral_since_s }).await
    }

    /// The line is well again: nothing moves by itself, and a new goal is reached.
    async fn stands_and_works(&self, neutral_since_s: f64) {
        let state = self.well().await;
        self.until("a second later", |later| later.tick_ms >= state.tick_ms + STANDS_MS).await;
        let truth = self.fleet.truth(self.number);
        assert_eq!(truth.neutral_since_s, Some(neutral_since_s), "xtb-{} began to move", self.number);
        let state = self.well().await;
        assert_eq!(state.mode, Mode::Idle);
        assert!(truth.speed_mps < 0.01, "xtb-{} rolls at {} m/s", self.number, truth.speed_mps);
        let reset = self.fleet.ask(self.number, Body::Reset { latch: None }).await;
        assert!(matches!(reset, Outcome::Ok(_)), "{reset:?}");
        let (x_m, y_m) = self.ahead(0.4).await;
        self.fleet.reaches(self.number, x_m, y_m).await;
    }

    /// One line breaks while the truck drives, and is mended.
    async fn suffers(&self, line: Line, how: How, fault: Fault) {
        let news = self.news_of_faults().await;
        self.drive().await;
        let driving_ms = self.fleet.state(self.number).await.tick_ms;
        let mut holder = None;
        match how {
            How::Sends(broken) => self.set_line_fault(line, broken),
            How::Unplugged => self.socket(line).unplug(),
            How::Busy => holder = Some(self.socket(line).plug_locked()),
        }
        let state = self.named(fault).await;
        let silent_ms = silent_ms(line, &state);
        let silent_since_ms = state.tick_ms - silent_ms;
        let named_ms = news.first_at(fault.place(), driving_ms).await.saturating_sub(silent_since_ms);
        assert!(named_ms <= NAMED_WITHIN_MS, "{fault} was named after {named_ms} ms: {state:?}");
        self.stands_with(line, &state).await;
        let neutral_since_s = self.neutral_since_s().await;
        let neutral_ms = neutral_since_s * 1000.0 - silent_since_ms as f64;
        assert!(neutral_ms <= NEUTRAL_WITHIN_MS, "{fault}: neutral after {neutral_ms} ms");

        match how {
            How::Sends(_) => self.set_line_fault(line, InjectedLineFault::None),
            How::Unplugged => self.socket(line).plug(),
            How::Busy => drop(holder),
        }
        self.stands_and_works(neutral_since_s).await;
        news.only(fault, driving_ms);
    }

    /// Faults that begin and end from now on.
    async fn news_of_faults(&self) -> News {
        let found = Arc::<Mutex<Vec<_>>>::default();
        let (list, key) = (found.clone(), self.fleet.robot(self.number).event());
        let subscription = self.fleet.bus.subscribe_events(&key, move |incoming| {
            let Ok(event) = incoming.decode::<Event>() else { return };
            if let EventKind::Fault { fault, present, .. } = event.kind {
                list.lock().unwrap().push((event.tick_ms, fault, present));
            }
        });
        News { found, _subscription: subscription.await.unwrap() }
    }

    async fn end(self) {
        self.end.send_replace(true);
        self.agent.await.unwrap().unwrap();
    }
}

fn state_of(state: &RobotState, fault: Fault) -> Option<&FaultState> {
    state.faults.iter().find(|present| present.fault == fault)
}

/// Since the last good frame of a line (or a little longer: the board's status has no age of its own).
fn silent_ms(line: Line, state: &RobotState) -> u64 {
    let ages = state.input_age_ms;
    let heard = match line {
        Line::Board => [ages.encoder, ages.adc, ages.remote],
        Line::Gyro => [ages.gyro, None, None],
    };
    heard.into_iter().flatten().min().unwrap()
}

/// Four trucks, each of which suffers another fault; all at the same time.
async fn four_suffer(cases: [(Line, How, Fault); 4]) {
    let folder = tempfile::tempdir().unwrap();
    let fleet = fleet(4, folder.path()).await;
    let trucks = [1, 2, 3, 4].map(|number| Truck::plugged(&fleet, number, folder.path()));
    let suffer = |i: usize| {
        let (line, how, fault) = cases[i];
        trucks[i].suffers(line, how, fault)
    };
    tokio::join!(suffer(0), suffer(1), suffer(2), suffer(3));
    for truck in trucks {
        truck.end().await;
    }
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_boards_line_that_is_bad_stops_the_truck_and_is_well_again_by_itself() {
    four_suffer([
        (Line::Board, How::Sends(InjectedLineFault::Silent), Fault::BoardSilent),
        (Line::Board, How::Sends(InjectedLineFault::Garbage), Fault::BoardGarbage),
        (Line::Board, How::Sends(InjectedLineFault::HalfFrames), Fault::BoardHalfFrames),
        (Line::Board, How::Sends(InjectedLineFault::WrongDevice), Fault::BoardWrongDevice),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gyros_line_that_is_bad_stops_the_truck_and_is_well_again_by_itself() {
    four_suffer([
        (Line::Gyro, How::Sends(InjectedLineFault::Silent), Fault::GyroSilent),
        (Line::Gyro, How::Sends(InjectedLineFault::Garbage), Fault::GyroGarbage),
        (Line::Gyro, How::Sends(InjectedLineFault::HalfFrames), Fault::GyroHalfFrames),
        (Line::Gyro, How::Sends(InjectedLineFault::WrongDevice), Fault::GyroWrongDevice),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_port_that_goes_or_is_taken_stops_the_truck_and_is_opened_again_by_itself() {
    four_suffer([
        (Line::Board, How::Unplugged, Fault::BoardUnplugged),
        (Line::Gyro, How::Unplugged, Fault::GyroUnplugged),
        (Line::Board, How::Busy, Fault::BoardBusy),
        (Line::Gyro, How::Busy, Fault::GyroBusy),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_board_that_no_longer_hears_the_agent_is_noticed_and_does_not_go_on_when_it_does() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = fleet(1, folder.path()).await;
    let truck = Truck::unplugged(&fleet, 1, folder.path());
    // Without its ports an agent runs, says so and waits.
    let state = truck.named(Fault::BoardUnplugged).await;
    let words = state_of(&state, Fault::GyroUnplugged).and_then(|fault| fault.detail.clone());
    assert!(words.is_some_and(|words| words.ends_with("gyro-1: no such device")), "{state:?}");
    truck.board.plug();
    truck.gyro.plug();

    truck.drive().await;
    truck.board.cable.cut.store(true, Ordering::Relaxed);
    let state = truck.named(Fault::BoardNotSetUp).await;
    truck.stands_with(Line::Board, &state).await;
    let neutral_since_s = truck.neutral_since_s().await;
    truck.board.cable.cut.store(false, Ordering::Relaxed);
    truck.stands_and_works(neutral_since_s).await;
    truck.end().await;
    fleet.end().await;
}

/// `robot-agent` on the lines of `xtb-1`.
fn agent(lines: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(program("robot-agent"));
    command.env_clear().args(arguments).args(["--hardware", "serial", "--name", "xtb-1", "--board"]);
    command.arg(lines.join("xtb-1.board")).arg("--gyro").arg(lines.join("xtb-1.gyro"));
    command
}

async fn check_hardware(lines: &Path, arguments: &[&str]) -> (Option<i32>, Value, Output) {
    let mut command = agent(lines, &["check-hardware", "--json"]);
    command.args(arguments);
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    let report = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"));
    (output.status.code(), report, output)
}

fn row<'a>(report: &'a Value, what: &str) -> &'a Value {
    let row = report["rows"].as_array().unwrap().iter().find(|row| row["what"] == what);
    row.unwrap_or_else(|| panic!("no row {what}: {report}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn check_hardware_reads_everything_names_what_is_broken_and_moves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = fleet(1, folder.path()).await;
    // Somebody holds the transmitter's stick ahead, in manual: a check is no run.
    let sticks = Transmitter { speed: 1.0, selector_manual: true, ..Transmitter::default() };
    fleet.simulator.world().change(move |world| world.trucks_mut()[0].set_transmitter(sticks));
    let neutral_since_s = fleet.truth(1).neutral_since_s;
    assert!(neutral_since_s.is_some());
    let (code, report, output) = check_hardware(folder.path(), &["--timeout", "30"]).await;
    assert_eq!((code, &report["ok"]), (Some(0), &Value::from(true)), "{output:?}");
    assert_eq!(row(&report, "remote selector")["reads_as"], "1.20 ms, manual");
    assert_eq!(row(&report, "board firmware")["raw"], "0x0100");
    assert_eq!(report["rows"].as_array().unwrap().len(), 37);

    let silent = LineFaults { gyro: InjectedLineFault::Silent, ..LineFaults::default() };
    fleet.simulator.world().change(move |world| world.trucks_mut()[0].set_line_faults(silent));
    let (code, report, output) = check_hardware(folder.path(), &["--timeout", "2"]).await;
    assert_eq!((code, &report["faults"][0]["fault"]), (Some(1), &Value::from("gyro_silent")), "{output:?}");
    assert_eq!(row(&report, "gyro yaw")["verdict"], "missing");
    assert_eq!(row(&report, "encoder")["verdict"], "ok");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("waiting for the gyro"), "{said}");
    assert_eq!(fleet.truth(1).neutral_since_s, neutral_since_s, "the motor has turned");

    let output = Command::new(program("robot-agent"))
        .env_clear()
        .args(["check-hardware", "--hardware", "simulated"])
        .output()
        .unwrap();
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && table.ends_with("\nno problems found\n"), "simulated: {output:?}");
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_boards_watchdog_stops_a_truck_whose_agent_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = fleet(1, folder.path()).await;
    let mut command = agent(folder.path(), &["--connect", fleet.simulator.endpoint()]);
    let mut process = Process(command.stderr(Stdio::null()).spawn().unwrap());
    fleet.until(1, "a state", |state| state.faults.is_empty() && state.input_age_ms.adc.is_some()).await;
    let start = fleet.truth(1);
    fleet.goto(1, start.x_m, start.y_m + 2.5).await;
    eventually("the truck to drive", || async { (fleet.truth(1).speed_mps > 0.08).then_some(()) }).await;
    process.0.kill().unwrap();
    let killed_s = fleet.time_s();
    let neutral_s = eventually("neutral", || async { fleet.truth(1).neutral_since_s }).await;
    assert!(neutral_s - killed_s <= 0.2, "neutral only {} s after kill -9", neutral_s - killed_s);
    fleet.end().await;
}
