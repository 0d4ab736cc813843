//! What comes over the network reaches a terminal, a log or a line of JSON as text, never as control
//! characters: a false robot answers with all of them.

use crate::attacker;
use crate::commands::fleet_cli;
use fleet_tests::processes::program;
use fleet_tests::{Fleet, Setup, name};
use std::process::{Command, Output};
use xtb_protocol::Uuid;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{
    ErrorBody, Fault, FaultState, Latch, LatchState, LogCode, LogReply, Message, Outcome, RejectCode, Reply,
    RobotState, StopReason,
};

/// A new title, a cleared screen, a forged line in green, C1's CSI, DEL, a line separator and a text that
/// runs from right to left.
const EVIL: &str = "a\x1b]0;owned\x07\x1b[2J\r\nall robots stopped \x1b[32mok\x1b[0m\u{9b}31m\x7f\u{2028}\u{202e}kcab\u{2066}z";

fn is_text(c: char) -> bool {
    let direction =
        matches!(c, '\u{061c}' | '\u{200e}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    !c.is_control() && !direction && !matches!(c, '\u{2028}' | '\u{2029}')
}

/// Each line that was printed is text, and none begins with what the robot wanted a line to begin with.
fn checked(what: &str, output: &Output) -> String {
    let mut whole = String::new();
    for bytes in [&output.stdout, &output.stderr] {
        let text = std::str::from_utf8(bytes).unwrap();
        let bad = text.chars().find(|c| *c != '\n' && !is_text(*c));
        assert_eq!(bad, None, "{what}: {text:?}");
        assert!(
            !text.lines().any(|line| line.trim_start().starts_with("all robots stopped")),
            "{what}: {text}"
        );
        whole.push_str(text);
    }
    whole
}

fn bytes<M: Message>(message: &M) -> Vec<u8> {
    codec::encode(message, Format::Postcard).unwrap()
}

fn evil_state(of: &RobotState) -> RobotState {
    let mut state = RobotState { robot: name("ghost"), ..of.clone() };
    state.latches = vec![LatchState { latch: Latch::Estop, age_ms: 5, by: EVIL.into(), present: false }];
    state.faults = vec![FaultState { fault: Fault::GyroSilent, age_ms: 5, detail: Some(EVIL.into()) }];
    state.stopped_because = vec![StopReason::Estop];
    state
}

fn evil_reply() -> Reply {
    let error = ErrorBody { code: RejectCode::NotReady, message: EVIL.into(), hint: EVIL.into() };
    Reply { id: Uuid::nil(), result: Outcome::Error(error) }
}

#[tokio::test(flavor = "multi_thread")]
async fn control_characters_of_a_false_robot_are_shown_as_text() {
    let fleet = Fleet::start(Setup::default()).await;
    let real = fleet.state(1).await;
    let endpoint = fleet.simulator.endpoint().to_owned();
    let attacker = attacker::session(&endpoint).await;
    let ghost = FleetKeys::new(name("lab")).robot(&name("ghost"));
    let (state, reply) = (bytes(&evil_state(&real)), bytes(&evil_reply()));
    let log = bytes(&LogReply::Error { code: LogCode::Unreadable, message: EVIL.into() });
    let _state = attacker::answer::<RobotState>(&attacker, &ghost.state(), move |_| state.clone()).await;
    let _cmd = attacker::answer::<Reply>(&attacker, &ghost.cmd(None), move |_| reply.clone()).await;
    let _log = attacker::answer::<LogReply>(&attacker, &ghost.log(None), move |_| log.clone()).await;
    let _alive = attacker.liveliness().declare_token(ghost.alive()).await.unwrap();
    let verbs: [&[&str]; 8] = [
        &["list"],
        &["why", "ghost"],
        &["status", "ghost"],
        &["goto", "ghost", "1", "2"],
        &["reset", "ghost"],
        &["fetch-log", "ghost"],
        &["doctor"],
        &["watch", "xtb/lab/ghost/state", "--count", "1"],
    ];
    for verb in verbs {
        let (verb_name, arguments) = (verb.join(" "), verb.to_vec());
        for json in [false, true] {
            let mut command = Command::new(program("fleet-cli"));
            command.env_clear().env("HOME", std::env::temp_dir());
            if json {
                command = fleet_cli(&[]);
            }
            command.args(["--connect", &endpoint, "--timeout", "2"]).args(&arguments);
            let output = tokio::task::spawn_blocking(move || command.output().unwrap()).await.unwrap();
            let text = checked(&verb_name, &output);
            let shows = verb_name != "list" && verb_name != "doctor";
            assert_eq!(text.contains("]0;owned"), shows || text.contains("owned"), "{verb_name}: {text}");
        }
    }
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn control_characters_in_what_cannot_be_read_do_not_reach_the_log() {
    let fleet = Fleet::start(Setup::default()).await;
    let endpoint = fleet.simulator.endpoint().to_owned();
    let attacker = attacker::session(&endpoint).await;
    let ghost = FleetKeys::new(name("lab")).robot(&name("ghost"));
    // The parser repeats the field that it does not know.
    let unknown = serde_json::json!({ EVIL: 1 }).to_string();
    let (session, own) = (attacker.clone(), ghost.state());
    let answering = attacker.declare_queryable(ghost.state()).complete(true).callback(move |query| {
        use zenoh::Wait;
        query.reply(own.clone(), unknown.clone()).encoding("application/json").wait().unwrap();
    });
    let _answering = answering.await.unwrap();
    let _alive = session.liveliness().declare_token(ghost.alive()).await.unwrap();
    for format in ["text", "json"] {
        let mut command = Command::new(program("fleet-cli"));
        command
            .env_clear()
            .env("HOME", std::env::temp_dir())
            .env("XTB_LOG", "debug,zenoh=off,zenoh_transport=off,zenoh_link=off");
        command.args(["--connect", &endpoint, "--log-format", format, "status", "ghost"]);
        let output = tokio::task::spawn_blocking(move || command.output().unwrap()).await.unwrap();
        let text = checked(format, &output);
        assert!(text.contains("owned"), "it was logged: {text}");
    }
    fleet.end().await;
}
