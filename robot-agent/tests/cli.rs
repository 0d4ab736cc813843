//! The binary from outside: settings, messages, exit codes.

use assert_cmd::Command;
use std::io::{BufRead, BufReader};
use std::process::Stdio;

fn agent() -> Command {
    let mut command = Command::cargo_bin("robot-agent").expect("cargo builds it for this test");
    command.env_clear();
    command
}

fn stderr_of(command: &mut Command, code: i32) -> String {
    let output = command.assert().code(code).get_output().clone();
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn the_printed_configuration_is_commented_and_complete() {
    let output = agent().arg("--print-config").assert().success().get_output().clone();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    for line in ["[agent]", "name = \"xtb-1\"", "[vehicle.goto]", "reference_rpm = 13.0"] {
        assert!(text.contains(line), "{line} is missing from\n{text}");
    }
    let committed = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/default.toml");
    assert_eq!(text, std::fs::read_to_string(committed).expect("configs/default.toml"));
}

#[test]
fn flags_are_over_the_environment_over_the_file() {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), "[agent]\nname = \"from-file\"\nfleet = \"from-file\"\n")
        .expect("writing it");
    let mut command = agent();
    command.arg("--config").arg(file.path()).env("XTB_FLEET", "from-env").args(["--name", "from-flag"]);
    let output = command.args(["--start-pose", "-1.5,2,0.5", "--print-config"]).assert().success();
    let text = String::from_utf8_lossy(&output.get_output().stdout).into_owned();
    for line in ["name = \"from-flag\"", "fleet = \"from-env\"", "x_m = -1.5", "yaw_rad = 0.5"] {
        assert!(text.contains(line), "{line} is missing from\n{text}");
    }
}

#[test]
fn real_time_is_asked_for_by_a_flag_also_before_a_command_and_off_without() {
    for (arguments, says) in [
        (&["--print-config"][..], "realtime = false"),
        (&["--realtime", "--print-config"], "realtime = true"),
        (&["--set", "control.realtime=true", "--print-config"], "realtime = true"),
        (&["--print-config", "--realtime", "record"], "realtime = true"),
    ] {
        let output = agent().args(arguments).assert().success().get_output().clone();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(text.contains(&format!("\n{says}\n")), "{arguments:?}\n{text}");
    }
}

#[test]
fn a_misspelt_key_is_an_error_with_a_suggestion() {
    let said = stderr_of(agent().args(["--set", "vehicle.goto.refrence_rpm=10"]), 2);
    assert!(said.contains("did you mean vehicle.goto.reference_rpm?"), "{said}");
}

#[test]
fn a_value_out_of_range_is_refused_by_name() {
    let said = stderr_of(agent().args(["--set", "vehicle.teleop.max_rpm=300"]), 2);
    assert!(said.contains("teleop.max_rpm") && said.contains("obstacle.threshold_cm"), "{said}");
}

#[test]
fn without_hardware_it_does_not_start_and_says_what_to_give() {
    for verb in [&[][..], &["check-hardware"], &["record", "/nonexistent"]] {
        let said = stderr_of(agent().args(verb), 2);
        assert!(said.contains("error: no hardware is configured\nhint: --hardware serial"), "{said}");
    }
}

#[test]
fn a_port_that_is_not_there_is_named_and_waited_for() {
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("robot-agent"))
        .env_clear()
        .args(["--hardware", "serial", "--board", "/nonexistent/board", "--gyro", "/nonexistent/gyro"])
        .args(["--connect", "tcp/127.0.0.1:1"])
        .stderr(Stdio::piped())
        .spawn()
        .expect("starting it");
    let mut lines = BufReader::new(child.stderr.take().expect("its log")).lines();
    let named = lines.any(|line| line.is_ok_and(|line| line.contains("/nonexistent/board: no such device")));
    let waits = child.try_wait().expect("asking").is_none();
    child.kill().expect("ending it");
    child.wait().expect("its end");
    assert!(named && waits, "named: {named}, waits: {waits}");
}

#[test]
fn there_is_a_manual_page_for_each_command() {
    let home = tempfile::tempdir().expect("a folder");
    let folder = home.path().join("share/man1");
    agent().arg("man").arg(&folder).assert().success();
    let page = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a page");
    assert!(
        page("robot-agent.1").contains("Exit codes") && page("robot-agent-man.1").contains("manual pages")
    );
    assert!(page("robot-agent-calibrate.1").contains("dry\\-run"));
    let said = stderr_of(agent().args(["man", "/dev/null/pages"]), 1);
    assert!(
        said.contains("cannot write manual pages to /dev/null/pages: ") && said.contains("hint: "),
        "{said}"
    );
}

#[test]
fn help_documents_the_exit_codes() {
    let output = agent().arg("--help").assert().success().get_output().clone();
    assert!(String::from_utf8_lossy(&output.stdout).contains("Exit codes"));
}

/// The identity file of `xtb-7`, in a folder.
fn identity_file(
    folder: &std::path::Path,
    role: xtb_identity::Role,
    days: u64,
    now: std::time::SystemTime,
) -> std::path::PathBuf {
    use std::time::Duration;
    use xtb_identity::issue::{Authority, CertificatePurpose, issue};
    let fleet = xtb_protocol::Name::new("lab").expect("a name");
    let made = Authority::create(&fleet, now).expect("a CA");
    let ca = Authority::load(&made.certificate(), &made.key()).expect("the CA");
    let own: xtb_identity::CommonName = "xtb-7.1".parse().expect("a common name");
    let life = Duration::from_secs(days * 24 * 3600);
    let issued = issue(&ca, &own, CertificatePurpose::Client, now, life).expect("a certificate");
    let routers = vec!["tls/127.0.0.1:1".to_owned()];
    let (certificate, key) = (issued.certificate, issued.key);
    let identity =
        xtb_identity::Identity::new(fleet, own, role, routers, made.certificate(), certificate, key);
    let file = folder.join("xtb-7.xtbid");
    std::fs::write(&file, identity.to_text().expect("its text")).expect("writing it");
    file
}

#[test]
fn name_fleet_and_router_follow_from_the_identity() {
    let home = tempfile::tempdir().expect("a folder");
    let file = identity_file(home.path(), xtb_identity::Role::Robot, 30, std::time::SystemTime::now());
    let at_home = || {
        let mut command = agent();
        command.env("HOME", home.path());
        command
    };
    let enrol = at_home().arg("enrol").arg(&file).assert().success().get_output().clone();
    let said = String::from_utf8_lossy(&enrol.stdout).into_owned();
    assert!(said.starts_with("xtb-7, robot of fleet lab: may be driven, under its own name\n"), "{said}");
    assert!(said.contains("Next: `robot-agent --hardware serial`"), "{said}");
    let said = String::from_utf8_lossy(&enrol.stderr).into_owned();
    assert!(said.contains("can be read by others (mode 0644)"), "{said}");

    let printed = at_home().arg("--print-config").assert().success().get_output().clone();
    let printed = String::from_utf8_lossy(&printed.stdout).into_owned();
    for line in ["name = \"xtb-7\"", "fleet = \"lab\"", "connect = [\"tls/127.0.0.1:1\"]"] {
        assert!(printed.contains(line), "{line} is missing from\n{printed}");
    }
    for (arguments, says) in [
        (&["--name", "xtb-1"][..], "--name xtb-1 is not that of the identity"),
        (&["--fleet", "hall"], "--fleet hall is not that of the identity"),
        (&["--set", "agent.name=xtb-3"], "the robot is set to xtb-3, but the identity is of robot xtb-7"),
        (&["--set", "zenoh.mode=peer"], "peers have no identity"),
        (&["--connect", "tcp/127.0.0.1:7447"], "tcp/127.0.0.1:7447 has no TLS"),
        (&["--connect", "tcp/10.0.0.1:7447"], "tcp/10.0.0.1:7447 has no TLS"),
        (&["--identity", "/nonexistent"], "cannot read the identity: /nonexistent/identity.toml"),
        (&["--identity", "none", "--connect", "tls/127.0.0.1:1"], "tls/127.0.0.1:1 needs an identity"),
    ] {
        let said = stderr_of(at_home().args(arguments).args(["--hardware", "simulated"]), 2);
        assert!(said.contains(says) && said.contains("hint: "), "{arguments:?}: {said}");
    }
}

#[test]
fn an_expired_identity_is_said_at_once() {
    let home = tempfile::tempdir().expect("a folder");
    let now = std::time::SystemTime::now();
    let three_days_ago = now - std::time::Duration::from_secs(3 * 24 * 3600);
    let file = identity_file(home.path(), xtb_identity::Role::Robot, 1, three_days_ago);
    let said = stderr_of(agent().arg("enrol").arg(&file).args(["--to", "/nonexistent"]), 2);
    assert!(said.contains("the certificate of xtb-7 expired on "), "{said}");
    let identity = xtb_identity::Identity::parse(&std::fs::read_to_string(&file).expect("the file"));
    let folder = home.path().join("identity");
    xtb_bus::Enrolled::write(&identity.expect("an identity"), &folder).expect("writing it");
    let said = stderr_of(agent().arg("--identity").arg(&folder).args(["--hardware", "simulated"]), 2);
    assert!(said.contains("expired on ") && said.contains("hint: `fleet-cli pki renew xtb-7`"), "{said}");
}

#[test]
fn only_a_robots_identity_runs_a_robot_and_what_needs_no_router_works_under_every_role() {
    let home = tempfile::tempdir().expect("a folder");
    let trace = home.path().join("empty.jsonl");
    std::fs::write(&trace, "").expect("writing it");
    for role in xtb_identity::Role::ALL {
        let file = identity_file(home.path(), role, 30, std::time::SystemTime::now());
        let identity = xtb_identity::Identity::parse(&std::fs::read_to_string(&file).expect("the file"));
        let folder = home.path().join(role.as_str());
        xtb_bus::Enrolled::write(&identity.expect("an identity"), &folder).expect("writing it");
        let under = |arguments: &[&str]| {
            let mut command = agent();
            command.env("HOME", home.path()).env("XTB_IDENTITY", &folder).args(arguments);
            command
        };
        if role != xtb_identity::Role::Robot {
            let says = format!("xtb-7 is {}, not a robot", role.noun());
            for verb in [&[][..], &["record", "recordings"], &["--print-config"]] {
                let mut command = under(&["--hardware", "simulated"]);
                let said = stderr_of(command.args(verb).current_dir(home.path()), 2);
                assert!(
                    said.contains(&says) && said.contains("hint: enrol a robot's file"),
                    "{role}: {said}"
                );
            }
            assert!(!home.path().join("recordings").exists(), "{role} began to record");
            let said = stderr_of(under(&["enrol"]).arg(&file), 2);
            assert!(said.contains("its identity is not for this program"), "{role}: {said}");
        }
        for verb in [&["ports"][..], &["completions", "bash"], &["--help"]] {
            under(verb).assert().success();
        }
        under(&["replay", "--trace"]).arg(&trace).assert().success();
        under(&["check-hardware", "--hardware", "simulated"]).assert().success();
    }
}

#[test]
fn json_is_asked_for_before_or_after_the_command() {
    for line in [["--json", "ports"], ["ports", "--json"]] {
        let output = agent().args(line).assert().success().get_output().stdout.clone();
        let found: serde_json::Value = serde_json::from_slice(&output).expect("JSON");
        assert!(found["ports"].is_array(), "{line:?}: {found}");
    }
    let said = stderr_of(agent().args(["--json", "--hardware", "simulated"]), 2);
    assert!(said.contains("--json is for the other commands") && said.contains("hint: "), "{said}");
}

#[test]
fn a_recording_that_cannot_be_made_names_its_folder_and_the_reason() {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    let folder = file.path().join("recordings");
    let mut command = agent();
    command.args(["--hardware", "simulated", "--connect", "tcp/127.0.0.1:1", "--record"]).arg(&folder);
    let said = stderr_of(&mut command, 1);
    let words = format!("cannot record: into {}: ", folder.display());
    assert!(said.contains(&words) && said.contains("hint: --record needs a folder"), "{said}");
}
