//! Every verb under every role: who may is not held up, who may not is told at once, without a message to anybody.

#![allow(clippy::unwrap_used)]

use clap::CommandFactory as _;
use fleet_cli::Cli;
use fleet_cli::commands::rights::Rights;
use std::collections::BTreeSet;
use std::time::{Duration, Instant, SystemTime};
use tempfile::TempDir;
use xtb_bus::Enrolled;
use xtb_client::{ErrorKind, Settings};
use xtb_identity::issue::{Authority, CertificatePurpose, Issued, LIFE, issue};
use xtb_identity::{CommonName, Identity, Role};
use xtb_protocol::Name;

const LOOKS: &[Role] = &[
    Role::Viewer,
    Role::Operator,
    Role::Dashboard,
    Role::Dispatcher,
    Role::Traffic,
    Role::Map,
    Role::Recorder,
];
const DRIVES: &[Role] = &[Role::Operator, Role::Dashboard];
const STOPS: &[Role] = &[Role::Viewer, Role::Operator, Role::Dashboard];
const ALL: &[Role] = &Role::ALL;

/// Command lines, and who may give them: written by hand, not made of what the program says.
const MATRIX: &[(&str, &[Role])] = &[
    ("list", LOOKS),
    ("status xtb-1", LOOKS),
    ("why xtb-1", LOOKS),
    ("doctor", LOOKS),
    ("top", LOOKS),
    ("watch xtb/lab/*/state", LOOKS),
    ("record --for 1", LOOKS),
    ("tasks", LOOKS),
    ("names robots", LOOKS),
    ("traffic status", LOOKS),
    ("map show --live", LOOKS),
    ("alerts", LOOKS),
    ("alerts --watch", LOOKS),
    ("events --since 1h --robot xtb-1 --kind latch", LOOKS),
    ("report --day yesterday", LOOKS),
    ("map history", LOOKS),
    ("place list", LOOKS),
    ("place here dock xtb-1 --file map.yaml", LOOKS),
    ("place add dock 1 2", DRIVES),
    ("place here dock xtb-1", DRIVES),
    ("place remove dock", DRIVES),
    ("goto xtb-1 1 2", DRIVES),
    ("wander xtb-1", DRIVES),
    ("stop xtb-1", DRIVES),
    ("stop --all", DRIVES),
    ("reset xtb-1", DRIVES),
    ("set-pose xtb-1 0 0", DRIVES),
    ("param list xtb-1", DRIVES),
    ("param get limit_mps xtb-1", DRIVES),
    ("param set limit_mps 0.2 xtb-1", DRIVES),
    ("param save xtb-1", DRIVES),
    ("teleop xtb-1", DRIVES),
    ("fetch-log xtb-1", DRIVES),
    ("task t1", DRIVES),
    ("cancel t1", DRIVES),
    ("pause t1", DRIVES),
    ("resume t1", DRIVES),
    ("retry t1", DRIVES),
    ("extend t1 3,0", DRIVES),
    ("vda5050 serve --mqtt mqtt://127.0.0.1", DRIVES),
    ("home xtb-1", DRIVES),
    ("home --all --parking", DRIVES),
    ("dispatch goto 1 2", DRIVES),
    ("dispatch route 1,2 3,4", DRIVES),
    ("dispatch patrol 1,2 3,4", DRIVES),
    ("dispatch wander --for 5", DRIVES),
    ("dispatch submit tasks.toml", DRIVES),
    ("dispatch status", DRIVES),
    ("dispatch activate", DRIVES),
    ("alerts ack 3 5", DRIVES),
    ("alerts ack --all", DRIVES),
    ("dispatch adopt", DRIVES),
    ("estop xtb-1", STOPS),
    ("estop --all", STOPS),
    ("dispatch serve", &[Role::Dispatcher]),
    ("traffic serve", &[Role::Traffic, Role::Dispatcher]),
    ("map serve map.yaml", &[Role::Map, Role::Dispatcher, Role::Simulator]),
    ("dashboard", &[Role::Dashboard]),
    ("sim", &[Role::Simulator]),
    ("demo", &[Role::Simulator]),
    // No session, or a router of its own.
    ("map show map.yaml", ALL),
    ("map check map.yaml", ALL),
    ("map import map.yaml --out x", ALL),
    ("map history map.yaml", ALL),
    ("place list --file map.yaml", ALL),
    ("place add dock 1 2 --file map.yaml", ALL),
    ("place remove dock --file map.yaml", ALL),
    ("dispatch compact", ALL),
    ("dispatch export", ALL),
    ("play a.mcap", ALL),
    ("export a.mcap --csv", ALL),
    ("audit a.mcap", ALL),
    ("router", ALL),
    ("plan instance.yaml --out x", ALL),
    ("schema list", ALL),
    ("man pages", ALL),
    ("completions bash", ALL),
];
/// They make identities, so they need none.
const MAKE_IDENTITIES: [&str; 3] = ["pki", "enrol", "help"];

fn cli(line: &str) -> Cli {
    let words = std::iter::once("fleet-cli").chain(line.split_whitespace()).map(Into::into);
    Cli::read(words).unwrap_or_else(|error| panic!("{line}: {error}"))
}

struct Fleet {
    folder: TempDir,
    ca: String,
    key: String,
}

impl Fleet {
    fn new() -> Self {
        let made = Authority::create(&Name::new("lab").unwrap(), SystemTime::now()).unwrap();
        Self { folder: tempfile::tempdir().unwrap(), ca: made.certificate(), key: made.key() }
    }

    /// One named `me`; it reaches no router.
    fn enrolled(&self, role: Role) -> Enrolled {
        let own: CommonName = "me.1".parse().unwrap();
        let issuer = Authority::load(&self.ca, &self.key).unwrap();
        let Issued { certificate, key, .. } =
            issue(&issuer, &own, CertificatePurpose::Client, SystemTime::now(), LIFE).unwrap();
        let routers = vec!["tls/127.0.0.1:1".to_owned()];
        let fleet = Name::new("lab").unwrap();
        let identity = Identity::new(fleet, own, role, routers, self.ca.clone(), certificate, key);
        Enrolled::write(&identity, &self.folder.path().join(role.as_str())).unwrap()
    }
}

#[test]
fn every_verb_is_allowed_to_whom_the_matrix_names_and_refused_to_all_others() {
    let fleet = Fleet::new();
    for role in Role::ALL {
        let settings = Settings { identity: Some(fleet.enrolled(role)), ..Settings::new("lab").unwrap() };
        for (line, allowed) in MATRIX {
            let verb = cli(line).verb;
            let began = Instant::now();
            let checked = Rights::of(&verb).check(&settings);
            assert!(began.elapsed() < Duration::from_millis(100), "{role}: {line}");
            assert_eq!(checked.is_ok(), allowed.contains(&role), "{role}: {line}: {checked:?}");
            let Err(error) = checked else { continue };
            assert_eq!(error.kind, ErrorKind::NotAllowed, "{role}: {line}");
            let words = "me is ";
            assert!(error.message.starts_with(words) && error.message.ends_with(role.allows()), "{error}");
            assert!(!error.hint.is_empty(), "{role}: {line}");
        }
    }
}

#[test]
fn the_matrix_has_every_verb() {
    let has: BTreeSet<String> = MATRIX
        .iter()
        .flat_map(|(line, _)| {
            let words: Vec<&str> = line.split_whitespace().take(2).collect();
            [words[0].to_owned(), words.join(" ")]
        })
        .collect();
    for verb in Cli::command().get_subcommands() {
        let name = verb.get_name();
        if MAKE_IDENTITIES.contains(&name) {
            continue;
        }
        assert!(has.contains(name), "{name} has no row");
        for inner in verb.get_subcommands().filter(|inner| inner.get_name() != "help") {
            let both = format!("{name} {}", inner.get_name());
            assert!(has.contains(&both), "{both} has no row");
        }
    }
}

/// Without an identity everything is tried, as before.
#[test]
fn without_an_identity_nothing_is_refused() {
    let settings = Settings::new("lab").unwrap();
    for (line, _) in MATRIX {
        Rights::of(&cli(line).verb).check(&settings).unwrap();
    }
}

#[test]
fn a_viewer_who_stops_robots_is_told_of_the_emergency_stop() {
    let viewer = Some(Fleet::new().enrolled(Role::Viewer));
    let settings = Settings { identity: viewer, ..Settings::new("lab").unwrap() };
    let error = Rights::of(&cli("stop --all").verb).check(&settings).unwrap_err();
    assert_eq!(error.message, "me is a viewer: may look and call an emergency stop");
    assert_eq!(
        error.hint,
        "`fleet-cli estop` is allowed; an operator can control robots: `fleet-cli pki add-person NAME --role \
         operator` adds one"
    );
}

/// The program as a shell sees it. No router is there, and one would be waited for: who is told at once has not looked
/// for it.
#[test]
fn who_may_not_is_told_by_the_program_before_it_looks_for_a_router() {
    let fleet = Fleet::new();
    let home = tempfile::tempdir().unwrap();
    for (role, line) in [
        (Role::Viewer, "goto xtb-1 1 2"),
        (Role::Viewer, "stop --all"),
        (Role::Viewer, "dispatch goto 1 2"),
        (Role::Operator, "traffic serve"),
        (Role::Recorder, "estop --all"),
        (Role::Robot, "list"),
    ] {
        let folder = fleet.enrolled(role).folder;
        let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_fleet-cli"));
        command.env_clear().env("HOME", home.path()).env("XTB_IDENTITY", folder);
        command.args(["--json", "--timeout", "60"]).args(line.split_whitespace());
        let began = Instant::now();
        let ended = command.timeout(Duration::from_secs(30)).assert().code(1);
        let took = began.elapsed();
        let said: serde_json::Value = serde_json::from_slice(&ended.get_output().stdout).unwrap();
        assert_eq!(said["error"]["code"], "not_allowed", "{role}: {line}: {said}");
        // Of which a debug build on a busy computer needs most to start.
        assert!(took < Duration::from_secs(20), "{role}: {line}: {took:?}");
    }
}
