//! A truck on ptys whose I/O board runs our firmware, as a person starts it: `fleet-cli sim --pty --board-firmware`,
//! and beside it `robot-agent check-hardware` and `bring-up`, in real time.
//!
//! `XTB_BOARD_FIRMWARE` names the firmware's ELF file. A busy computer is too slow for it:
//!
//! ```sh
//! XTB_BOARD_FIRMWARE=… cargo test -p fleet-tests --test it -- --ignored board_firmware
//! ```

use crate::commands::{fleet_cli, ready};
use fleet_tests::processes::program;
use serde_json::Value;
use std::env;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn agent(settings: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(program("robot-agent"));
    command.env_clear().args(arguments).arg("--config").arg(settings);
    command.stdin(Stdio::null()).output().unwrap()
}

#[test]
#[ignore = "real time, and an emulated chip: needs a quiet computer"]
fn check_hardware_and_bring_up_find_the_board_and_every_sensor() {
    let firmware =
        env::var_os("XTB_BOARD_FIRMWARE").expect("XTB_BOARD_FIRMWARE names the firmware's ELF file");
    let folder = tempfile::tempdir().unwrap();
    let lines = folder.path().join("lines");
    let emulator = concat!(env!("CARGO_MANIFEST_DIR"), "/../robot-agent/firmware/emulator");
    let mut sim = fleet_cli(&["sim", "--listen", "tcp/127.0.0.1:0", "--emulator", emulator, "--pty"]);
    sim.arg(&lines)
        .arg("--board-firmware")
        .arg(firmware)
        .env("PATH", env::var_os("PATH").unwrap_or_default());
    let _sim = ready(&mut sim);
    let settings = folder.path().join("robot.toml");
    let port = |line: &str| lines.join(line).display().to_string();
    let (board, gyro) = (port("xtb-1.board"), port("xtb-1.gyro"));
    std::fs::write(&settings, format!("[hardware]\nkind = \"serial\"\nboard = {board:?}\ngyro = {gyro:?}\n"))
        .unwrap();

    let output = agent(&settings, &["check-hardware", "--json", "--timeout", "60"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = report["rows"].as_array().unwrap();
    let wrong: Vec<&Value> = rows.iter().filter(|row| row["verdict"] != "ok").collect();
    assert!(output.status.success() && wrong.is_empty(), "{wrong:?} {report}");
    let firmware = rows.iter().find(|row| row["what"] == "board firmware").unwrap();
    assert!(firmware["reads_as"].as_str().unwrap().contains("Pico, hash 0x"), "{firmware}");

    for step in ["board", "check"] {
        let output = agent(&settings, &["bring-up", "--only", step]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains("  ok: "), "the others are open: {said}");
    }
}
