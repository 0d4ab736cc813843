//! `top` on a terminal, against a simulated fleet: seen, sent, driven, stopped.

pub(crate) mod pty;

use crate::commands::{Sim, fleet_cli, sim};
use fleet_tests::PATIENCE;
use fleet_tests::processes::{Process, Signal, program};
use pty::OnTerminal;
use rustix::termios::{Winsize, tcsetwinsize};
use serde_json::{Value, json};
use serialport::{SerialPort, TTYPort};
use std::fs::File;
use std::io::Read;
use std::process::Command;
use std::time::{Duration, Instant};

fn top(sim: &Sim, size: (u16, u16), arguments: &[&str]) -> OnTerminal {
    let mut all = vec!["--connect", &sim.endpoint, "--client", "pilot", "--color", "always", "top"];
    all.extend(arguments);
    OnTerminal::start(size.0, size.1, &all)
}

/// A robot's state, once it is so.
fn until(sim: &Sim, robot: &str, what: &str, so: impl Fn(&Value) -> bool) -> Value {
    let give_up = Instant::now() + PATIENCE;
    loop {
        let (_, status, _) = sim.run(&["status", robot]);
        let state = status["robots"][0]["state"].clone();
        if so(&state) {
            return state;
        }
        assert!(Instant::now() < give_up, "waited in vain for: {what}: {state}");
    }
}

/// Takes the wheel and holds the key for ahead until the robot obeys.
fn drive(sim: &Sim, top: &mut OnTerminal) {
    top.keys("t");
    top.until("the wheel", |text| text.contains("DRIVING xtb-1"));
    let give_up = Instant::now() + PATIENCE;
    while sim.run(&["status", "xtb-1"]).1["robots"][0]["state"]["mode"] != "teleop" {
        assert!(Instant::now() < give_up, "it was never driven\n{}", top.screen().text());
        top.keys("\x1b[A");
    }
}

#[test]
fn three_robots_are_seen_one_is_sent_by_the_cursor_and_all_are_latched_by_one_key() {
    let sim = sim(&["--robots", "3"]);
    let mut top = top(&sim, (80, 24), &[]);
    top.until("three robots", |text| ["xtb-1", "xtb-2", "xtb-3"].iter().all(|robot| text.contains(robot)));
    top.until("what they do", |text| text.matches(" idle ").count() == 3);

    // From the second robot two cells up, and there.
    top.keys("2g\x1b[A\x1b[A\r");
    top.until("its answer", |text| text.contains("goto xtb-2") && text.contains("accepted"));
    let state = until(&sim, "xtb-2", "the goal", |state| !state["goal"].is_null());
    assert_eq!(state["goal"]["by"], "pilot", "{state}");
    let goal_y_m = state["goal"]["y_m"].as_f64().unwrap();
    assert!(goal_y_m > state["pose"]["y_m"].as_f64().unwrap(), "{state}");
    top.until("it drives", |text| text.contains("1 driving"));

    top.keys("E");
    top.until("all latched", |text| {
        text.contains("E-STOP ALL: 3 of 3 latched") && text.matches("LATCHED estop").count() >= 3
    });
    for robot in ["xtb-1", "xtb-2", "xtb-3"] {
        let state = until(&sim, robot, "latched", |state| state["latches"][0]["latch"] == "estop");
        assert_eq!(state["latches"][0]["by"], "pilot", "{state}");
    }

    // A reset is asked for, and ends it.
    top.keys("1x");
    top.until("the question", |text| text.contains("Reset xtb-1?"));
    top.keys("y");
    until(&sim, "xtb-1", "reset", |state| state["latches"] == json!([]));
    top.keys("X");
    top.until("the question for the others", |text| text.contains("Reset all latched robots? xtb-2, xtb-3"));
    top.keys("y");
    for robot in ["xtb-2", "xtb-3"] {
        until(&sim, robot, "reset too", |state| state["latches"] == json!([]));
    }
    top.keys("q");
    assert_eq!(top.ended(), Some(0));
}

#[test]
fn a_robot_is_driven_while_a_key_repeats_and_stands_free_after_leaving() {
    let sim = sim(&["--robots", "1"]);
    let mut top = top(&sim, (80, 24), &[]);
    top.until("the robot", |text| text.contains(" idle "));
    drive(&sim, &mut top);
    top.keys("\x1b[A\x1b[A");
    top.keys("q");
    assert_eq!(top.ended(), Some(0));
    let state = until(&sim, "xtb-1", "free", |state| state["lease"].is_null());
    assert_eq!((&state["mode"], &state["reference_rpm"]), (&json!("idle"), &json!(0.0)), "{state}");
}

#[test]
fn a_lost_focus_takes_the_hand_off_the_wheel() {
    let sim = sim(&["--robots", "1"]);
    let mut top = top(&sim, (160, 50), &[]);
    top.until("the robot", |text| text.contains(" idle "));
    drive(&sim, &mut top);
    // As a held key goes on while the window is left.
    top.keys("\x1b[A\x1b[A\x1b[O\x1b[A");
    top.until("let go", |text| text.contains("xtb-1 confirmed the stop; control released"));
    until(&sim, "xtb-1", "free", |state| state["lease"].is_null());
    top.keys("\x03");
    assert_eq!(top.ended(), Some(0));
}

#[test]
fn a_router_that_is_killed_shows_and_comes_back_by_itself() {
    let mut router = fleet_tests::processes::RouterProcess::start(None);
    let endpoint = router.endpoint().to_owned();
    let top = OnTerminal::start(80, 24, &["--connect", &endpoint, "top", "--read-only"]);
    top.until("an empty fleet", |text| text.contains("no robot of this fleet"));
    router.kill();
    top.until("the lost link", |text| text.contains("NO LINK to the router for"));
    router.restart();
    top.until("the link", |text| !text.contains("NO LINK"));
    let _robots = sim_at(&endpoint);
    top.until("a robot", |text| text.contains(" idle "));
}

/// A simulated robot at a router that runs already.
fn sim_at(endpoint: &str) -> fleet_tests::processes::Process {
    let mut command = fleet_cli(&["--connect", endpoint, "sim", "--robots", "1"]);
    fleet_tests::processes::Process::start_ready(&mut command).0
}

#[test]
fn without_a_terminal_or_with_json_it_says_what_to_use_instead() {
    for (arguments, message) in [(&["top"][..], "needs a terminal"), (&["--json", "top"], "no --json")] {
        let mut command = std::process::Command::new(fleet_tests::processes::program("fleet-cli"));
        let output = command.args(arguments).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8_lossy(&said).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(message) && said.contains("fleet-cli list"), "{said}");
    }
}

/// Starts `fleet-cli` on a terminal that is closed as soon as it has drawn something there.
fn on_a_terminal_that_goes(arguments: &[&str]) -> Process {
    let (mut master, slave) = TTYPort::pair().unwrap();
    let name = slave.name().unwrap();
    let line = || File::options().read(true).write(true).open(&name).unwrap();
    tcsetwinsize(line(), Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
    let mut command = Command::new("setsid");
    command.arg(program("fleet-cli")).args(arguments).env_clear();
    command.env("HOME", std::env::temp_dir()).env("PATH", "/usr/bin:/bin").env("TERM", "xterm-256color");
    let process = Process(command.stdin(line()).stdout(line()).stderr(line()).spawn().unwrap());
    master.set_timeout(PATIENCE).unwrap();
    let (mut bytes, mut drawn) = ([0; 4096], 0);
    while drawn < 2000 {
        drawn += master.read(&mut bytes).unwrap();
    }
    process
}

#[test]
fn a_demo_whose_window_is_gone_ends_when_it_is_told_to() {
    let mut demo =
        on_a_terminal_that_goes(&["demo", "--robots", "2", "--goals", "50", "--listen", "tcp/127.0.0.1:0"]);
    demo.signal(Signal::Interrupt);
    let give_up = Instant::now() + PATIENCE;
    while demo.runs() {
        assert!(Instant::now() < give_up, "it does not end");
        std::thread::sleep(Duration::from_millis(20));
    }
}
