//! What the Debian packages bring beside the programs: it fits them, and what systemd and udev expect. That a package
//! installs, runs and is upgraded is shown by packaging/check.

#![allow(clippy::print_stderr)] // what is skipped is said

use assert_cmd::cargo::cargo_bin;
use std::collections::BTreeSet;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use toml::{Table, Value};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A file of the package.
fn file(name: &str) -> String {
    let path = root().join("packaging/robot-agent").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The value of a setting of the unit.
fn unit(key: &str) -> String {
    let unit = file("robot-agent.service");
    let value = unit.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    value.unwrap_or_else(|| panic!("{key} is missing in\n{unit}")).to_owned()
}

#[test]
fn systemd_is_told_that_the_robot_is_under_control_and_then_that_its_loop_turns() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("notify");
    let socket = UnixDatagram::bind(&path).expect("a socket");
    socket.set_read_timeout(Some(Duration::from_secs(30))).expect("a limit");
    let mut agent = Command::new(cargo_bin("robot-agent"))
        .env_clear()
        .envs([("NOTIFY_SOCKET", path.as_os_str()), ("WATCHDOG_USEC", "400000".as_ref())])
        .args(["--hardware", "simulated", "--identity", "none", "--connect", "tcp/127.0.0.1:1"])
        .stderr(Stdio::null())
        .spawn()
        .expect("starting it");
    let told = || {
        let mut bytes = [0; 100];
        let read = socket.recv(&mut bytes).map_err(|error| error.to_string());
        read.map(|length| String::from_utf8_lossy(&bytes[..length]).into_owned())
    };
    let heard: Vec<_> = (0..4).map(|_| told()).collect();
    let pid = rustix::process::Pid::from_child(&agent);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).expect("ending it");
    let ended = agent.wait().expect("its end");
    let alive = || Ok("WATCHDOG=1\n".to_owned());
    let first = Ok("READY=1\nWATCHDOG=1\n".to_owned());
    assert_eq!(heard, [first, alive(), alive(), alive()]);
    assert!(ended.success(), "{ended}");
}

#[test]
#[allow(clippy::print_stderr)] // what was not tested
fn systemd_finds_nothing_wrong_with_the_unit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("robot-agent.service");
    // It asks whether the program is there.
    let program = cargo_bin("robot-agent").display().to_string();
    let text = file("robot-agent.service").replace("/usr/bin/robot-agent", &program);
    std::fs::write(&path, text).expect("writing it");
    let Ok(said) = Command::new("systemd-analyze").args(["verify", "--man=no"]).arg(&path).output() else {
        return eprintln!("SKIP: no systemd-analyze; the unit is not verified");
    };
    // An unknown setting is no failure to it, but it says so.
    let own = String::from_utf8_lossy(&said.stderr).into_owned();
    let own: Vec<&str> = own.lines().filter(|line| line.contains("robot-agent")).collect();
    assert!(said.status.success() && own.is_empty(), "{own:?}");
}

#[test]
fn what_the_unit_starts_is_understood_with_the_settings_of_the_package() {
    let start = unit("ExecStart");
    let arguments = start.strip_prefix("/usr/bin/robot-agent ").expect("its whole path");
    let settings = root().join("packaging/robot-agent/robot.toml").display().to_string();
    let arguments = arguments.replace("/etc/xtb/robot.toml", &settings);
    let mut agent = assert_cmd::Command::new(cargo_bin("robot-agent"));
    let printed = agent.env_clear().args(arguments.split(' ')).arg("--print-config").assert().success();
    let printed = String::from_utf8_lossy(&printed.get_output().stdout).into_owned();
    for line in ["kind = \"serial\"", "board = \"/dev/xtb-board\"", "realtime = true"] {
        assert!(printed.contains(line), "{line} is missing from\n{printed}");
    }
}

#[test]
fn the_unit_permits_what_real_time_needs_and_no_more() {
    assert_eq!(unit("LimitRTPRIO"), robot_agent::realtime::PRIORITY.to_string());
    assert_eq!((unit("LimitMEMLOCK"), unit("User")), ("infinity".into(), "xtb".into()));
    let users = file("robot-agent.sysusers");
    assert!(users.contains("u xtb ") && users.contains("m xtb dialout"), "{users}");
}

/// `KEY{attribute}=="value"`.
fn is_udev(part: &str) -> bool {
    let quoted = part.strip_suffix('"').and_then(|part| part.split_once('"'));
    let Some((key, value)) = quoted else { return false };
    let key = ["==", "!=", "+=", "="].iter().find_map(|operator| key.strip_suffix(operator));
    let name = key.map(|key| {
        key.split_once('{').map_or(key, |(name, rest)| if rest.ends_with('}') { name } else { "" })
    });
    let upper = |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_uppercase());
    name.is_some_and(upper) && !value.contains('"')
}

#[test]
fn udev_names_the_ports_of_the_settings_also_in_the_rules_to_be_taken() {
    let rules = file("99-xtb.rules");
    let rules =
        rules.lines().map(|line| line.trim_start_matches('#')).filter(|line| line.starts_with("SUBSYSTEM"));
    let mut names = BTreeSet::new();
    for rule in rules {
        for part in rule.split(", ") {
            assert!(is_udev(part), "{part} in {rule}");
            let name = part.strip_prefix("SYMLINK+=\"").map(|name| name.trim_end_matches('"'));
            names.extend(name.map(|name| format!("/dev/{name}")));
        }
    }
    let settings: Table = file("robot.toml").parse().expect("TOML");
    let port = |key: &str| settings["hardware"][key].as_str().expect("a text").to_owned();
    assert_eq!(names, BTreeSet::from([port("board"), port("gyro")]));
}

#[test]
fn packages_name_files_that_exist() {
    for package in ["robot-agent", "fleet-cli"] {
        let manifest = std::fs::read_to_string(root().join(package).join("Cargo.toml")).expect("a manifest");
        let manifest: Table = manifest.parse().expect("TOML");
        let deb = &manifest["package"]["metadata"]["deb"];
        let assets = deb["assets"].as_array().expect("a list").iter();
        let sources = assets.map(|asset| asset[0].as_str().expect("a path")).collect::<Vec<_>>();
        assert!(sources.contains(&&*format!("target/release/{package}")), "{sources:?}");
        let licence = deb["license-file"][0].as_str();
        let scripts = deb.get("maintainer-scripts").and_then(Value::as_str);
        let named = sources.into_iter().chain(licence).chain(scripts);
        for path in named.filter(|path| !path.starts_with("target/release/")) {
            assert!(root().join(package).join(path).exists(), "{package}: {path}");
        }
    }
}
