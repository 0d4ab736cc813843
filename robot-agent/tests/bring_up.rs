//! `robot-agent bring-up` over ptys, as on a real truck: a person reads what it says, moves the simulated truck with
//! their hands, looks at it, and types.
//!
//! The whole of it takes minutes, as everything happens in real time, and a busy computer is too slow for it. With
//! `XTB_BOARD_FIRMWARE` the truck's I/O board is the emulated Pico with that firmware (an ELF file):
//!
//! ```sh
//! XTB_BOARD_FIRMWARE=… cargo test --release -p robot-agent --test bring_up -- --ignored --nocapture
//! ```

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a test that cannot go on shall end; people look at the long one

use robot_agent::clock::WorldTime;
use robot_agent::hardware::simulated::{RunningWorld, TruckLines, TruckPorts};
use serde_json::Value;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use xtb_board_emulator::Emulator;
use xtb_control::VehicleConfig;
use xtb_control::calibration::Measured;
use xtb_sim::{Hands, Simulation, Transmitter, Truck, TruckParameters, World};

/// What eyes see of the truck in a step.
#[derive(Debug, Clone, Copy)]
struct Sight {
    measured: Measured,
    speed_mps: f64,
    battery_v: f64,
}

/// A truck in its room, at real time, and the person beside it.
struct Bench {
    world: RunningWorld,
    sights: Arc<Mutex<Vec<Sight>>>,
    ports: TruckPorts,
    /// What the settings say of the vehicle; the truck is so.
    vehicle: VehicleConfig,
    /// The step that is under way.
    step: String,
    /// Since when it is looked at.
    watched: usize,
    /// A switch that is switched back some time later.
    automatic_after: Option<usize>,
}

impl Bench {
    fn new(vehicle: VehicleConfig, seed: u64) -> Self {
        let mut parameters = TruckParameters::of(&vehicle);
        parameters.board.answers_asks = true;
        let mut simulation = Simulation::new(World::default(), &parameters, &["xtb-1"], seed).unwrap();
        if let Some(firmware) = std::env::var_os("XTB_BOARD_FIRMWARE").map(PathBuf::from) {
            let emulator = Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware/emulator");
            let board = Emulator::start(&firmware, &emulator, vehicle.remote.enabled)
                .unwrap_or_else(|error| panic!("{error}: {}", error.hint()));
            simulation.trucks_mut()[0].set_external_board(Arc::new(Mutex::new(board)));
        }
        let (lines, ports) = TruckLines::over_ptys().unwrap();
        let sights = Arc::new(Mutex::new(Vec::new()));
        let seen = sights.clone();
        let look = move |simulation: &Simulation| {
            let mut truck = simulation.trucks()[0].clone();
            let (speed_mps, battery_v) = (truck.truth().speed_mps, truck.battery_v());
            seen.lock().unwrap().push(Sight { measured: truck.measured(), speed_mps, battery_v });
        };
        let world = RunningWorld::start(simulation, vec![lines], WorldTime::new(), 1.0, look).unwrap();
        let (step, watched, automatic_after) = (String::new(), 0, None);
        Self { world, sights, ports, vehicle, step, watched, automatic_after }
    }

    fn truck(&self, act: impl FnOnce(&mut Truck) + Send + 'static) {
        self.world.change(move |simulation| act(&mut simulation.trucks_mut()[0]));
    }

    fn since(&self, from: usize) -> Vec<Sight> {
        self.sights.lock().unwrap()[from..].to_vec()
    }

    fn now(&self) -> usize {
        self.sights.lock().unwrap().len()
    }

    /// The angle of the servo of this step now, in degrees, read several times.
    fn angle_deg(&self) -> f64 {
        let of = |sight: &Sight| angle_deg(&self.step, &sight.measured);
        let all = self.since(self.now().saturating_sub(20));
        all.iter().map(of).sum::<f64>() / all.len() as f64
    }

    /// Which way it went first since it has been watched.
    fn direction(&self) -> &'static str {
        let sights = self.since(self.watched);
        if self.step.starts_with("motor") {
            let moving = sights.iter().find(|sight| sight.speed_mps.abs() > 0.02);
            return moving.map_or("nothing", |sight| if sight.speed_mps > 0.0 { "ahead" } else { "astern" });
        }
        let first = angle_deg(&self.step, &sights[0].measured);
        let moved = sights.iter().map(|sight| angle_deg(&self.step, &sight.measured) - first);
        let words = if self.step.contains("steering") { ["right", "left"] } else { ["up", "down"] };
        // More than the errors of two readings.
        moved.into_iter().find(|deg| deg.abs() > 3.0).map_or("nothing", |deg| words[usize::from(deg < 0.0)])
    }

    /// Does what a line asks for.
    fn hands(&mut self, line: &str) {
        if let Some(id) = line.strip_prefix('[').and_then(|line| line.split(']').next()) {
            self.step = id.to_owned();
        }
        let hands = Hands::default();
        if let Some(rest) = line.split("range finder ").nth(1).filter(|_| line.starts_with("Hold something"))
        {
            let mut words = rest.split(' ');
            let is_rear = words.next() == Some("rear");
            let slot: usize = words.next().unwrap().parse().unwrap();
            let cm: f64 =
                line.split(" cm before").next().unwrap().rsplit(' ').next().unwrap().parse().unwrap();
            let fitted = &self.vehicle.range_finders;
            let finder = if is_rear { fitted.rear.0[slot - 1] } else { fitted.front.0[slot - 1] };
            self.world
                .change(move |simulation| simulation.hold_before(0, &finder, is_rear, cm / 100.0).unwrap());
        } else if line.starts_with("Take it away") {
            self.world.change(Simulation::take_away);
        } else if line.starts_with("Turn the wheels") {
            self.truck(move |truck| truck.set_hands(Hands { roll_m: 0.3, ..hands }));
        } else if line.starts_with("Lift the front") {
            self.truck(move |truck| truck.set_hands(Hands { nose_up_deg: 10.0, ..hands }));
        } else if line.starts_with("Lift the left") {
            self.truck(move |truck| truck.set_hands(Hands { left_up_deg: 10.0, ..hands }));
        } else if line.starts_with("Put it down") {
            self.truck(move |truck| truck.set_hands(hands));
        } else if line.starts_with("Turn the car") {
            self.truck(move |truck| truck.set_hands(Hands { turn_deg: 90.0, ..hands }));
        } else if line.contains("sticks let go") {
            self.truck(|truck| truck.set_transmitter(Transmitter::default()));
        } else if line.contains("speed stick fully") {
            self.truck(|truck| truck.set_transmitter(Transmitter { speed: 1.0, ..Default::default() }));
        } else if line.contains("steering stick fully") {
            self.truck(|truck| truck.set_transmitter(Transmitter { steering: 1.0, ..Default::default() }));
        } else if line.starts_with("Switch the selector") {
            self.truck(|truck| {
                truck.set_transmitter(Transmitter { selector_manual: true, ..Default::default() });
            });
            self.automatic_after = Some(self.now() + 200);
        } else if line.starts_with("Press the emergency stop") {
            self.truck(|truck| truck.set_emergency_stop(true));
        } else if line.starts_with("Release it") {
            self.truck(|truck| truck.set_emergency_stop(false));
        }
    }

    /// The answer to a question at the end of what was said.
    fn answer(&mut self, said: &str) -> Option<String> {
        let asked = said.trim_end();
        Some(match asked {
            _ if asked.ends_with("[yes/skip]") || asked.ends_with("such servo]") => {
                self.watched = self.now();
                "yes".into()
            }
            _ if asked.ends_with("or skip:") => {
                self.watched = self.now();
                "wheels up".into()
            }
            _ if asked.ends_with("something else moved]") => self.direction().into(),
            _ if asked.ends_with("[V, or none]") => {
                format!("{:.2}", self.sights.lock().unwrap().last().unwrap().battery_v)
            }
            _ if asked.contains("[Enter keeps") && asked.ends_with(']') => String::new(),
            _ if asked.ends_with("[again/skip/quit]") => "skip".into(),
            _ if asked.ends_with("+ = right:") || asked.ends_with("+ = up:") => {
                format!("{:.1}", self.angle_deg())
            }
            _ => return None,
        })
    }

    /// Runs the program until it ends; its exit code and everything that it said.
    fn run(&mut self, config: &Path, arguments: &[&str]) -> (i32, String) {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("robot-agent"));
        command
            .env_clear()
            .args(["bring-up", "--hardware", "serial", "--patience", "20", "--config"])
            .arg(config);
        command.arg("--board").arg(&self.ports.board).arg("--gyro").arg(&self.ports.gyro).args(arguments);
        let pipes = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = pipes.spawn().unwrap();
        let (mut types, mut reads) = (child.stdin.take().unwrap(), child.stderr.take().unwrap());
        let (mut said, mut acted, mut answered) = (String::new(), 0, 0);
        let mut buffer = [0; 4096];
        loop {
            let n = reads.read(&mut buffer).unwrap();
            if n == 0 {
                break;
            }
            said.push_str(&String::from_utf8_lossy(&buffer[..n]));
            while let Some(length) = said[acted..].find('\n') {
                let line = said[acted..acted + length].to_owned();
                acted += length + 1;
                self.hands(&line);
                self.switch_back();
            }
            if let Some(answer) = self.answer(&said[acted.max(answered)..]) {
                answered = said.len();
                writeln!(types, "{answer}").unwrap();
                said.push_str(&format!("«{answer}»\n"));
                acted = said.len();
            }
        }
        (child.wait().unwrap().code().unwrap(), said)
    }

    /// The selector is on manual for a second.
    fn switch_back(&mut self) {
        let Some(after) = self.automatic_after.take() else { return };
        while self.now() < after {
            std::thread::sleep(Duration::from_millis(5)); // looks again
        }
        self.truck(|truck| truck.set_transmitter(Transmitter::default()));
    }
}

fn angle_deg(step: &str, measured: &Measured) -> f64 {
    let end = usize::from(step.ends_with("rear"));
    if step.contains("steering") { measured.steering_deg[end] } else { measured.bumpers_deg[end] }
}

fn outcomes(config: &Path) -> Vec<(String, String)> {
    let report = std::fs::read_to_string(config.with_extension("bring-up.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let entry = |entry: &Value| {
        (entry["step"].as_str().unwrap().to_owned(), entry["outcome"].as_str().unwrap().to_owned())
    };
    report["steps"].as_array().unwrap().iter().map(entry).collect()
}

fn settings(folder: &Path, vehicle: &str) -> (PathBuf, VehicleConfig) {
    let config = folder.join("robot.toml");
    std::fs::write(&config, format!("[vehicle]\n{vehicle}")).unwrap();
    (config, toml::from_str(vehicle).unwrap())
}

#[test]
fn a_truck_on_its_lines_is_moved_by_hand_and_by_itself_and_what_passed_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (config, vehicle) = settings(folder.path(), "platform = \"off\"\n");
    let mut bench = Bench::new(vehicle, 2);
    let steps =
        ["board", "range-front-2", "encoder", "servo-steering-front", "emergency-stop", "motor-ahead"];
    for step in steps {
        let (code, said) = bench.run(&config, &["--only", step]);
        assert!(code == 1 && said.contains("  ok: "), "others are open; {step}:\n{said}");
    }
    let passed: Vec<_> = outcomes(&config).into_iter().filter(|(_, outcome)| outcome == "passed").collect();
    assert_eq!(passed.len(), steps.len(), "{passed:?}");
}

#[test]
fn a_board_that_is_not_there_is_said_and_its_port_stays_out_of_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let (config, vehicle) = settings(folder.path(), "");
    let mut bench = Bench::new(vehicle, 3);
    bench.ports.board = "/nonexistent/board".into();
    let (code, said) = bench.run(&config, &["--only", "board"]);
    assert!(code == 1 && said.contains("/nonexistent/board: no such device"), "{said}");
    for name in ["robot.bring-up.json", "robot.bring-up.txt"] {
        let text = std::fs::read_to_string(folder.path().join(name)).unwrap();
        assert!(text.contains("the board's port: no such device") && !text.contains("nonexistent"), "{text}");
        assert!(!text.contains(&folder.path().display().to_string()), "{text}");
    }
}

#[test]
#[ignore = "minutes, in real time; prints the report"]
fn a_whole_truck_from_its_first_word_to_its_calibration() {
    let folder = tempfile::tempdir().unwrap();
    let (config, vehicle) = settings(folder.path(), "");
    let mut bench = Bench::new(vehicle, 1);
    let (code, said) = bench.run(&config, &[]);
    println!("{said}");
    println!("{}", std::fs::read_to_string(config.with_extension("bring-up.txt")).unwrap());
    assert_eq!(code, 0);
    assert!(outcomes(&config).iter().all(|(_, outcome)| outcome == "passed"));
}
