//! `fleet-cli plan` as a shell sees it.

#![allow(clippy::unwrap_used)]

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Two cars of the public family that have to pass each other, and one that drives away.
const PUBLIC: &str = "\
agents:
  - start: [10, 20, 0]
    name: agent0
    goal: [40, 20, 0]
  - start: [40, 20, 3.14]
    name: agent1
    goal: [10, 20, 3.14]
  - start: [25, 40, 1.57]
    name: agent2
    goal: [5, 5, -1.57]
map:
  dimensions: [50, 50]
  obstacles:
    - [25.5, 17.25]
    - [25.5, 22.75]
";

/// A corridor that is too narrow for two.
const CORRIDOR: &str = "[room]\nwidth_m = 12.0\ndepth_m = 1.2\n";

const FLEET: &str = "\
world: lab.toml
agents:
  - {name: xtb-1, start: [0.0, 0.0, 1.5708], goal: [0.0, 5.5, 1.5708]}
  - {name: xtb-2, start: [0.0, 5.5, -1.5708], goal: [0.0, 0.0, -1.5708]}
";

const HEAD_ON: &str = "\
world: corridor.toml
agents:
  - {name: xtb-1, start: [-5.0, 0.0, 0.0], goal: [5.0, 0.0, 0.0]}
  - {name: xtb-2, start: [5.0, 0.0, 3.1416], goal: [-5.0, 0.0, 3.1416]}
";

/// Two halls with two doors; one leads to the east only, the other one is kept out of.
const ZONES: &str = r#"
[room]
width_m = 10.0
depth_m = 8.0

[[walls]]
points = [[0.0, -4.0], [0.0, -2.8]]

[[walls]]
points = [[0.0, -1.2], [0.0, 1.2]]

[[walls]]
points = [[0.0, 2.8], [0.0, 4.0]]

[[zones]]
name = "out"
kind = "one_way"
heading_rad = 0.0
points = [[-0.5, 1.2], [0.5, 1.2], [0.5, 2.8], [-0.5, 2.8]]
"#;

const KEPT_OUT: &str = r#"
[[zones]]
name = "wet"
kind = "keep_out"
points = [[-0.5, -2.8], [0.5, -2.8], [0.5, -1.2], [-0.5, -1.2]]
"#;

const THROUGH: &str = "\
world: halls.toml
agents:
  - {name: xtb-1, start: [-3.0, -2.0, 0.0], goal: [3.0, -2.0, 0.0]}
  - {name: xtb-2, start: [3.0, 2.0, 3.1416], goal: [-3.0, 2.0, 3.1416]}
";

#[derive(Deserialize)]
struct File {
    statistics: Statistics,
    schedule: BTreeMap<String, Vec<Row>>,
}

#[derive(Deserialize)]
struct Statistics {
    makespan: f64,
    flowtime: f64,
}

#[derive(Deserialize)]
struct Row {
    x: f64,
    y: f64,
    yaw: f64,
    t: f64,
}

struct Folder(TempDir);

impl Folder {
    fn with(files: &[(&str, &str)]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for (name, text) in files {
            std::fs::write(folder.path(name), text).unwrap();
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, line: &str) -> Assert {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fleet-cli"));
        command.env_clear().env("HOME", self.0.path()).current_dir(self.0.path());
        command.args(line.split_whitespace()).assert()
    }

    fn schedule(&self, name: &str) -> File {
        serde_saphyr::from_str(&std::fs::read_to_string(self.path(name)).unwrap()).unwrap()
    }
}

fn json(assert: &Assert) -> serde_json::Value {
    serde_json::from_slice(&assert.get_output().stdout).unwrap()
}

#[test]
fn a_public_instance_becomes_a_schedule_and_a_drawing() {
    let folder = Folder::with(&[("instance.yaml", PUBLIC)]);
    let ended = folder.run("plan instance.yaml --out schedule.yaml --plot plan.svg --seed 3 --json").code(0);
    let summary = json(&ended);
    let file = folder.schedule("schedule.yaml");
    assert_eq!(summary["agents"], 3);
    assert_eq!(summary["makespan"].as_f64().unwrap(), file.statistics.makespan);
    let number = |name: &str| summary[name].as_f64().unwrap();
    assert!(number("makespan") <= number("first_makespan") && number("flowtime") <= number("first_flowtime"));
    assert!(number("first_runtime") <= number("runtime") && summary["improved"].is_u64());
    let last: Vec<f64> = file.schedule.values().map(|rows| rows[rows.len() - 1].t).collect();
    assert_eq!(file.statistics.flowtime, last.iter().sum::<f64>());
    let rows = &file.schedule["agent2"];
    let (first, last) = (&rows[0], &rows[rows.len() - 1]);
    assert_eq!((first.x, first.y, first.yaw, first.t), (25.0, 40.0, 1.57, 0.0));
    assert!((last.x - 5.0).hypot(last.y - 5.0) < 1e-3 && (last.yaw + 1.57).abs() < 1e-3);
    // These files' y points down: a car with yaw 90° drives ahead towards smaller y.
    for pair in rows.windows(2) {
        let (dx, dy) = (pair[1].x - pair[0].x, pair[1].y - pair[0].y);
        let middle =
            pair[0].yaw + (pair[1].yaw - pair[0].yaw + 9.0).rem_euclid(std::f64::consts::TAU) / 2.0 - 4.5;
        let aside = dx * middle.sin() + dy * middle.cos();
        assert!(aside.abs() < 0.01, "sideways by {aside}");
        assert!(dx.hypot(dy) <= 2.118 * 1.001, "too far in one step");
    }
    let drawing = std::fs::read_to_string(folder.path("plan.svg")).unwrap();
    assert!(drawing.starts_with("<svg") && drawing.trim_end().ends_with("</svg>"));
    assert_eq!((drawing.matches("<circle").count(), drawing.matches("<text").count()), (2, 3));
}

#[test]
fn trucks_in_a_world_of_ours_swap_places_through_its_door() {
    let lab = include_str!("../../worlds/lab.toml");
    let folder = Folder::with(&[("lab.toml", lab), ("fleet.yaml", FLEET)]);
    folder.run("plan fleet.yaml --out schedule.yaml").code(0);
    let file = folder.schedule("schedule.yaml");
    let rows = &file.schedule["xtb-1"];
    let last = &rows[rows.len() - 1];
    assert!(last.x.hypot(last.y - 5.5) < 1e-3);
    for rows in file.schedule.values() {
        for pair in rows.windows(2) {
            let way = (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y);
            assert!(way <= 0.35 * (pair[1].t - pair[0].t) * 1.001, "faster than 0.35 m/s");
        }
    }
    // Both have been north of the partition and south of it, through a door of 2 m.
    let through =
        |rows: &[Row]| rows.iter().filter(|row| (row.y - 4.0).abs() < 0.3).all(|row| row.x.abs() < 1.0);
    assert!(file.schedule.values().all(|rows| through(rows)));
}

#[test]
fn a_worlds_zones_hold_for_its_plans() {
    let wet = format!("{ZONES}{KEPT_OUT}");
    let east = THROUGH.lines().take(3).collect::<Vec<_>>().join("\n");
    let folder = Folder::with(&[("halls.toml", ZONES), ("both.yaml", THROUGH)]);
    // The one-way door is not taken to the west, though xtb-2 stands before it.
    folder.run("plan both.yaml --out schedule.yaml").code(0);
    let door = |file: &File, name: &str| {
        let rows = &file.schedule[name];
        rows.windows(2).find(|pair| (pair[0].x < 0.0) != (pair[1].x < 0.0)).unwrap()[0].y
    };
    assert!(door(&folder.schedule("schedule.yaml"), "xtb-2") < 0.0);
    // With the other door kept out of, the way east leads through it, and there is none to the west.
    let folder = Folder::with(&[("halls.toml", &wet), ("east.yaml", &east), ("both.yaml", THROUGH)]);
    folder.run("plan east.yaml --out schedule.yaml").code(0);
    assert!(door(&folder.schedule("schedule.yaml"), "xtb-1") > 0.0);
    let ended = folder.run("plan both.yaml --out both.out --json").code(1);
    let error = &json(&ended)["error"];
    let message = error["message"].as_str().unwrap();
    assert!(message.contains("no path from the start to the goal of xtb-2"), "{message}");
}

#[test]
fn without_a_schedule_it_ends_in_time_and_says_who_is_in_the_way() {
    let folder = Folder::with(&[("corridor.toml", CORRIDOR), ("fleet.yaml", HEAD_ON)]);
    let begun = Instant::now();
    let ended = folder.run("plan fleet.yaml --out schedule.yaml --time-limit 1 --json").code(1);
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
    let error = &json(&ended)["error"];
    assert_eq!(error["code"], "failed");
    let message = error["message"].as_str().unwrap();
    assert!(message.contains("still in conflict: xtb-1 and xtb-2"), "{message}");
    assert!(!folder.path("schedule.yaml").exists());
}

#[test]
fn what_cannot_be_planned_is_named() {
    let on_disc = PUBLIC.replace("[25, 40, 1.57]", "[25, 24, 1.57]");
    let typo = FLEET.replace("agents:", "speed: 3\nagents:");
    let folder = Folder::with(&[
        ("disc.yaml", on_disc.as_str()),
        ("typo.yaml", typo.as_str()),
        ("lab.toml", "[room]\nwidth_m = 5.0\ndepth_m = 5.0\n"),
        ("outside.yaml", FLEET),
        ("nothing.yaml", "map: 3\n"),
    ]);
    for (line, code, says) in [
        ("plan disc.yaml --out s.yaml", 1, "the start of agent2 overlaps the obstacle at (25.50, 22.75)"),
        ("plan outside.yaml --out s.yaml", 1, "the start of xtb-2 at (0.00, 5.50) is outside the map"),
        ("plan typo.yaml --out s.yaml", 2, "unknown field"),
        ("plan nothing.yaml --out s.yaml", 2, "nothing.yaml"),
        ("plan missing.yaml --out s.yaml", 2, "cannot read missing.yaml"),
        ("plan disc.yaml", 2, "--out"),
        ("plan disc.yaml --out s.yaml --time-limit 0", 2, "seconds"),
    ] {
        let ended = folder.run(line).code(code);
        let said = String::from_utf8(ended.get_output().stderr.clone()).unwrap();
        assert!(said.contains(says), "{line}: {said}");
    }
    assert!(!folder.path("s.yaml").exists());
}
