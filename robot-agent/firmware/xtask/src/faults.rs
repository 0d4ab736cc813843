//! Plants faults into a copy of the firmware, one at a time: the checks have to catch each.
//!
//! The shipped sources have no trace of this. A fault is a place in a file and what stands there instead;
//! a place that is not found exactly once is an error, so that a change of the firmware cannot silence one.

use crate::{Failure, build, pins};
use std::path::Path;
use std::process::Command;
use std::{env, fs};

struct Fault {
    name: &'static str,
    /// From the repository's root.
    file: &'static str,
    right: &'static str,
    wrong: &'static str,
    /// The checks at the pins that look at such things.
    pins: &'static str,
}

const LOGIC: &str = "robot-agent/firmware/logic/src";

/// Faults that somebody could make.
const FAULTS: [Fault; 17] = [
    Fault {
        name: "watchdog a period late",
        file: "outputs.rs",
        right: "self.held = self.is_starved(watchdog, wrap);",
        wrong: "self.held = self.is_starved(watchdog.plus(Ticks::from_us(22_200)), wrap);",
        pins: "watchdog",
    },
    Fault {
        name: "pulses written without regard to the wrap",
        file: "robot-agent/firmware/pico/src/outputs.rs",
        right: "if left < WRITING || counter < self.period_counts / 2 {",
        wrong: "let _ = (left, WRITING);\n            while PWM.ch(1).ctr().read().ctr() > 2500 {}\n            PWM.ch(1).ctr().write(|w| w.set_ctr(0));\n            if false {",
        pins: "pulses",
    },
    Fault {
        name: "outputs of a slice swapped",
        file: "robot-agent/firmware/pico/src/outputs.rs",
        right: "w.set_a(pair[0]);\n                    w.set_b(pair[1]);",
        wrong: "w.set_a(pair[1]);\n                    w.set_b(pair[0]);",
        pins: "pulses",
    },
    Fault {
        name: "no CRC check",
        file: "core/board-codec/src/reader.rs",
        right: "if got != expected {",
        wrong: "if false {",
        pins: "garbage",
    },
    Fault {
        name: "any frame ends the watchdog",
        file: "outputs.rs",
        right: "if pulses[MOTOR] == NEUTRAL || !self.is_starved(watchdog, now) {",
        wrong: "let _ = (watchdog, now);\n        {",
        pins: "watchdog",
    },
    Fault {
        name: "pistons go on under the watchdog",
        file: "outputs.rs",
        right: "self.current[PISTONS].fill(NEUTRAL);",
        wrong: "let _ = PISTONS;",
        pins: "watchdog",
    },
    Fault {
        name: "steering goes straight under the watchdog",
        file: "outputs.rs",
        right: "self.current[MOTOR] = NEUTRAL;",
        wrong: "self.current = AT_REST;",
        pins: "watchdog",
    },
    Fault {
        name: "a set-up feeds the watchdog",
        file: "board.rs",
        right: "let setup = Setup::from_payload(payload)?;",
        wrong: "let setup = Setup::from_payload(payload)?;\n                self.outputs.request(crate::AT_REST, STATUS, now);",
        pins: "watchdog",
    },
    Fault {
        name: "pulses of any length",
        file: "outputs.rs",
        right: "pulses.iter().all(|pulse| PULSES.contains(pulse))",
        wrong: "pulses.iter().any(|pulse| PULSES.contains(pulse))",
        pins: "pulses",
    },
    Fault {
        name: "an edge lost in each encoder window",
        file: "encoder.rs",
        right: "self.seen = counter;",
        wrong: "self.seen = counter.wrapping_add(1);",
        pins: "encoder",
    },
    Fault {
        name: "impossible set-ups accepted",
        file: "setup.rs",
        right: "setup.channels == WIRING",
        wrong: "setup.channels[0] == WIRING[0]",
        pins: "setup",
    },
    Fault {
        name: "no answer to a set-up",
        file: "board.rs",
        right: "self.outbox.status = true;\n                self.set_up(setup, now)",
        wrong: "self.set_up(setup, now)",
        pins: "setup",
    },
    Fault {
        name: "converted before the multiplexer has settled",
        file: "robot-agent/firmware/pico/src/main.rs",
        right: "let (first, second) = analog.convert(&visit);\n            board.converted(first, second, now);\n            analog.select(board.selected());",
        wrong: "analog.select(visit.channel);\n            let (first, second) = analog.convert(&visit);\n            board.converted(first, second, now);",
        pins: "ranges",
    },
    Fault {
        name: "range finders of the second multiplexer misplaced",
        file: "scan.rs",
        right: "self.more_ranges.get_mut(channel)",
        wrong: "self.more_ranges.get_mut(3_usize.wrapping_sub(channel))",
        pins: "ranges",
    },
    Fault {
        name: "receiver read in the middle of a pulse",
        file: "receiver.rs",
        right: "if gate.high {",
        wrong: "if gate.high && self.stuck {",
        pins: "receiver",
    },
    Fault {
        name: "release of the emergency stop lets it drive on",
        file: "outputs.rs",
        right: "self.heard = None; // releasing",
        wrong: "self.held = true; // releasing",
        pins: "stop",
    },
    Fault {
        name: "no hardware watchdog",
        file: "robot-agent/firmware/pico/src/main.rs",
        right: "watchdog.start(HANG);",
        wrong: "watchdog.stop();",
        pins: "hang",
    },
];

/// Plants all of them, or those whose name contains a word; false if one was not caught.
pub(crate) fn run(workspace: &Path, only: &[&str]) -> Result<bool, Failure> {
    let root = workspace.ancestors().nth(2).ok_or("the firmware is not in its repository")?;
    let folder = env::temp_dir().join(format!("xtb-planted-{}", std::process::id()));
    let copy = folder.join("robot-agent/firmware");
    let result = in_copy(root, workspace, &folder, &copy, only);
    fs::remove_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    result
}

fn in_copy(
    root: &Path,
    workspace: &Path,
    folder: &Path,
    copy: &Path,
    only: &[&str],
) -> Result<bool, Failure> {
    for part in ["Cargo.toml", "core/board-codec", "robot-agent/firmware"] {
        copy_tree(&root.join(part), &folder.join(part)).map_err(|error| format!("{part}: {error}"))?;
    }
    println!("| {:<46} | {:<10} | {:<16} | caught |", "fault", "host tests", "pins");
    println!("| {} | {} | {} | ------ |", "-".repeat(46), "-".repeat(10), "-".repeat(16));
    let word = |ok: bool| if ok { "pass" } else { "FAIL" };
    let (mut planted, mut missed) = (0, 0);
    let good = (host_tests(copy)?, pins(workspace, &build(copy)?, &[], true)?);
    println!("| {:<46} | {:<10} | {:<16} |        |", "none", word(good.0), format!("all: {}", word(good.1)));
    if good != (true, true) {
        return Err("the firmware does not pass without a fault".into());
    }
    for fault in &FAULTS {
        if !only.is_empty() && !only.iter().any(|word| fault.name.contains(word)) {
            continue;
        }
        let place =
            if fault.file.contains('/') { fault.file.to_owned() } else { format!("{LOGIC}/{}", fault.file) };
        let file = folder.join(&place);
        let text = fs::read_to_string(&file).map_err(|error| format!("{place}: {error}"))?;
        if text.matches(fault.right).count() != 1 {
            return Err(format!("{}: {place} does not say `{}` exactly once", fault.name, fault.right));
        }
        let write = |text: &str| fs::write(&file, text).map_err(|error| format!("{place}: {error}"));
        write(&text.replacen(fault.right, fault.wrong, 1))?;
        let (host, at_pins) =
            (host_tests(copy)?, pins(workspace, &build(copy)?, &["--only", fault.pins], true)?);
        write(&text)?;
        let caught = !host || !at_pins;
        planted += 1;
        missed += u32::from(!caught);
        let at_pins = format!("{}: {}", fault.pins, word(at_pins));
        println!(
            "| {:<46} | {:<10} | {at_pins:<16} | {:<6} |",
            fault.name,
            word(host),
            if caught { "yes" } else { "NO" }
        );
    }
    println!("\n{planted} planted, {missed} not caught");
    Ok(missed == 0 && planted > 0)
}

/// Whether the logic's own tests pass.
fn host_tests(workspace: &Path) -> Result<bool, Failure> {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let tests = |build_only: bool| {
        let mut command = Command::new(&cargo);
        command.current_dir(workspace).args([
            "test",
            "--quiet",
            "--locked",
            "--package",
            "xtb-firmware-logic",
        ]);
        if build_only {
            command.arg("--no-run");
        }
        command.output().map_err(|error| format!("cargo does not start: {error}"))
    };
    let built = tests(true)?;
    if !built.status.success() {
        return Err(format!("the fault does not compile:\n{}", String::from_utf8_lossy(&built.stderr)));
    }
    Ok(tests(false)?.status.success())
}

/// A file or a folder; without what was built or installed there.
fn copy_tree(from: &Path, to: &Path) -> std::io::Result<()> {
    if !from.is_dir() {
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)?;
        }
        return fs::copy(from, to).map(drop);
    }
    for entry in fs::read_dir(from)? {
        let name = entry?.file_name();
        if name != "target" && name != "node_modules" {
            copy_tree(&from.join(&name), &to.join(&name))?;
        }
    }
    Ok(())
}
