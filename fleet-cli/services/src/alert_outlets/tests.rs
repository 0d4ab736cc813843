//! What a command and a web hook get, and what becomes of what they do not take.

use super::*;
use serde_json::Value;
use std::path::Path;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use xtb_client::fake::name;
use xtb_dispatch::alerts::AlertStep;
use xtb_protocol::messages::AlertKind;

const PATIENT: Duration = Duration::from_secs(30);

fn change(text: &str) -> AlertChange {
    let alert = Alert {
        id: 7,
        kind: AlertKind::Latched,
        robot: Some(name("xtb-1")),
        subject: Some("estop".into()),
        text: text.to_owned(),
        remedy: "reset it".into(),
        since_ms: 5,
        acknowledged: None,
        ended_ms: None,
    };
    AlertChange { step: AlertStep::Raised, alert }
}

/// Looks until it is so.
async fn until(so: impl Fn() -> bool) {
    let mut look = tokio::time::interval(Duration::from_millis(5));
    while !so() {
        look.tick().await;
    }
}

fn of_command(program: &str, arguments: &[&str], timeout: Duration) -> Outlets {
    let arguments = arguments.iter().map(ToString::to_string).collect();
    let command = Some(CommandOutlet { program: program.to_owned(), arguments, timeout });
    Outlets::start(name("lab"), OutletSettings { command, webhook: None }).unwrap()
}

/// A program that writes its input to a file, and its arguments to another.
fn writes(to: &Path) -> Outlets {
    let script = "cat > \"$0\"; printf '%s' \"$*\" > \"$0.arguments\"";
    of_command("/bin/sh", &["-c", script, to.to_str().unwrap()], PATIENT)
}

#[tokio::test]
async fn a_command_gets_json_on_its_input_and_whatever_a_text_holds_is_text() {
    let folder = tempfile::tempdir().unwrap();
    let (file, mark) = (folder.path().join("out"), folder.path().join("mark"));
    for text in [
        "xtb-1 latched: emergency stop, by alice".to_owned(),
        format!("\"; touch {0}; $(touch {0}) `touch {0}` | touch {0} & touch {0} #", mark.display()),
        format!("-c touch {}\n--help\0 ' \\ ${{IFS}}", mark.display()),
    ] {
        let outlets = writes(&file);
        outlets.tell(&change(&text));
        until(|| outlets.counters()[0].sent == 1).await;
        let said: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        assert_eq!(
            (&said["fleet"], &said["event"], &said["state"]),
            (&"lab".into(), &"raised".into(), &"open".into())
        );
        assert_eq!(
            (&said["alert"]["text"], &said["alert"]["robot"]),
            (&text.as_str().into(), &"xtb-1".into())
        );
        assert_eq!(std::fs::read_to_string(file.with_extension("arguments")).unwrap(), "");
        assert!(!mark.exists(), "{text:?} was carried out");
    }
}

#[tokio::test]
async fn what_a_command_has_started_ends_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("child");
    let script = "sleep 600 & echo $! > \"$0\"; wait; true";
    let outlets = of_command("/bin/sh", &["-c", script, file.to_str().unwrap()], Duration::from_millis(500));
    outlets.tell(&change("xtb-1 latched"));
    until(|| outlets.counters()[0].failed == 1).await;
    let child = std::fs::read_to_string(&file).unwrap();
    let stat = format!("/proc/{}/stat", child.trim());
    // Gone, or only its name waits for whoever collects it.
    until(|| std::fs::read_to_string(&stat).map_or(true, |stat| stat.contains(") Z "))).await;
}

#[tokio::test]
async fn a_command_that_fails_hangs_or_is_missing_is_counted() {
    for (program, arguments, timeout) in [
        ("/bin/sh", &["-c", "exit 3"][..], PATIENT),
        ("/nowhere/such-a-program", &[], PATIENT),
        ("/bin/sh", &["-c", "exec sleep 60"], Duration::from_millis(50)),
    ] {
        let outlets = of_command(program, arguments, timeout);
        outlets.tell(&change("text"));
        until(|| outlets.counters()[0].failed == 1).await;
        assert_eq!(outlets.counters()[1], OutletCounters::default());
    }
}

/// What a client posts: head and body.
async fn request(stream: &mut TcpStream) -> (String, String) {
    let mut bytes = Vec::new();
    loop {
        let mut piece = [0; 1024];
        let count = stream.read(&mut piece).await.unwrap();
        bytes.extend_from_slice(&piece[..count]);
        let text = String::from_utf8(bytes.clone()).unwrap();
        let Some((head, body)) = text.split_once("\r\n\r\n") else { continue };
        let length = head
            .lines()
            .find_map(|line| line.to_lowercase().strip_prefix("content-length: ").map(str::to_owned));
        if body.len() >= length.unwrap().parse::<usize>().unwrap() {
            return (head.to_owned(), body.to_owned());
        }
    }
}

async fn hook(timeout: Duration) -> (TcpListener, Outlets) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}/alerts?key=1", listener.local_addr().unwrap());
    let webhook = Some(WebhookOutlet { url: Url::new(&url, None).unwrap(), timeout });
    let outlets = Outlets::start(name("lab"), OutletSettings { command: None, webhook }).unwrap();
    (listener, outlets)
}

#[tokio::test]
async fn a_web_hook_gets_a_post_and_is_asked_once_more_if_it_refuses() {
    let (listener, outlets) = hook(PATIENT).await;
    outlets.tell(&change("first"));
    outlets.tell(&change("second"));
    for (text, answer) in
        [("first", "204 No Content"), ("second", "500 Internal Server Error"), ("second", "302 Found")]
    {
        let (mut stream, _) = listener.accept().await.unwrap();
        let (head, body) = request(&mut stream).await;
        assert!(head.starts_with("POST /alerts?key=1 HTTP/1.1"), "{head}");
        assert!(head.to_lowercase().contains("content-type: application/json"), "{head}");
        let said: Value = serde_json::from_str(&body).unwrap();
        assert_eq!((&said["alert"]["text"], &said["alert"]["id"]), (&text.into(), &7.into()));
        stream.write_all(format!("HTTP/1.1 {answer}\r\ncontent-length: 0\r\n\r\n").as_bytes()).await.unwrap();
    }
    until(|| outlets.counters()[1] == OutletCounters { sent: 1, failed: 1, dropped: 0 }).await;
}

#[tokio::test]
async fn a_web_hook_that_does_not_answer_holds_up_nobody_and_what_finds_no_room_is_counted() {
    let (listener, outlets) = hook(PATIENT).await;
    outlets.tell(&change("taken"));
    let _silent = listener.accept().await.unwrap();
    for _ in 0..QUEUE + 5 {
        outlets.tell(&change("waits"));
    }
    assert_eq!(outlets.counters()[1], OutletCounters { sent: 0, failed: 0, dropped: 5 });
}

#[test]
fn an_address_that_is_none_is_refused_with_what_is_wrong() {
    for (wrong, what) in [
        ("ftp://127.0.0.1/", "neither with http://"),
        ("127.0.0.1:80/hook", "is no web hook"),
        ("http://", "is no web hook"),
        ("http://bob:secret@127.0.0.1/", "a user in it"),
        ("https://127.0.0.1/", "needs webhook_ca"),
    ] {
        let failure = Url::new(wrong, None).unwrap_err();
        assert!(failure.message.contains(what), "{failure}");
    }
    assert!(Url::new("http://127.0.0.1/", Some(Path::new("ca.pem"))).unwrap_err().message.contains("https"));
}
