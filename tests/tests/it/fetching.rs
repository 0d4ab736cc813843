//! `fleet-cli fetch-log`: a robot's recordings come over Zenoh as they are on its disk, whatever
//! interrupts them.

use crate::attacker;
use crate::commands::{fleet_cli, sim};
use fleet_tests::processes::{Process, program};
use fleet_tests::{PATIENCE, name};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;
use xtb_bus::SessionRole;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{LogReply, LogRequest};

const OLD: &str = "xtb-1-20041201T120000Z.mcap";

/// Bytes that nobody guesses from those before.
fn noise(bytes: usize) -> Vec<u8> {
    let mut state = 2_004_262_u64;
    let next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    std::iter::repeat_with(next).take(bytes).collect()
}

fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |about| about.len())
}

#[test]
fn a_recording_is_fetched_whole_and_goes_on_where_it_was_interrupted() {
    let (theirs, ours) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let recording = noise(12_000_000);
    fs::write(theirs.path().join(OLD), &recording).unwrap();
    fs::write(theirs.path().join("xtb-9-20041201T120000Z.mcap"), b"another robot's").unwrap();
    let sim = sim(&["--robots", "1", "--record", theirs.path().to_str().unwrap()]);
    let (code, list, output) = sim.run(&["fetch-log", "xtb-1", "--list"]);
    let names: Vec<&str> =
        list["files"].as_array().unwrap().iter().map(|f| f["file"].as_str().unwrap()).collect();
    assert_eq!((code, names.len()), (0, 2), "{output:?}");
    assert!(names.contains(&OLD) && names.iter().all(|name| name.starts_with("xtb-1-")), "{names:?}");

    // Killed on the way, then again: what had come is not asked for again.
    let (here, part) = (ours.path().join("old.mcap"), ours.path().join("old.mcap.part"));
    let fetch = ["fetch-log", "xtb-1", OLD, "--out", here.to_str().unwrap()];
    let mut command = fleet_cli(&["--connect", &sim.endpoint]);
    let child = command.args(fetch).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let process = Process(child);
    let began = Instant::now();
    while length(&part) < 100_000 {
        assert!(began.elapsed() < PATIENCE && !here.exists(), "it was to be killed on the way");
        std::thread::yield_now();
    }
    drop(process);
    assert!(!here.exists());
    let kept = length(&part);
    let (code, fetched, output) = sim.run(&fetch);
    assert_eq!((code, fetched["bytes"].as_u64()), (0, Some(12_000_000)), "{output:?}");
    assert_eq!(fetched["resumed_from"].as_u64(), Some(kept), "{output:?}");
    assert!(fs::read(&here).unwrap() == recording && !part.exists());

    // Never over something that is there, and never onto something else.
    let (code, refused, output) = sim.run(&fetch);
    assert_eq!(code, 1, "{output:?}");
    assert!(refused["error"]["message"].as_str().unwrap().contains("already exists"), "{refused}");
    fs::remove_file(&here).unwrap();
    fs::write(&part, noise(200_000).iter().map(|byte| byte ^ 1).collect::<Vec<_>>()).unwrap();
    let (code, refused, output) = sim.run(&fetch);
    assert_eq!((code, length(&part)), (1, 200_000), "{output:?}");
    assert!(refused["error"]["hint"].as_str().unwrap().contains("--restart"), "{refused}");
    let (code, fetched, output) = sim.run(&[&fetch[..], &["--restart"]].concat());
    assert_eq!((code, fetched["resumed_from"].as_u64()), (0, Some(0)), "{output:?}");
    assert!(fs::read(&here).unwrap() == recording);
}

#[test]
fn the_newest_recording_is_fetched_while_it_is_written_and_can_be_replayed() {
    let (theirs, ours) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let sim = sim(&["--robots", "1", "--record", theirs.path().to_str().unwrap(), "--speed", "8"]);
    let (code, _, output) = sim.run(&["goto", "xtb-1", "0.5", "1.5", "--wait"]);
    assert_eq!(code, 0, "{output:?}");
    let here = ours.path().join("newest.mcap");
    let (code, fetched, output) = sim.run(&["fetch-log", "xtb-1", "--out", here.to_str().unwrap()]);
    assert_eq!((code, &fetched["open"]), (0, &Value::from(true)), "{output:?}");
    let replayed = Command::new(program("robot-agent")).arg("replay").arg(&here).output().unwrap();
    let text = String::from_utf8_lossy(&replayed.stdout);
    assert!(text.contains("identical"), "{replayed:?}");
}

#[test]
fn what_is_not_there_is_said_with_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let sim = sim(&["--robots", "1"]);
    let out = folder.path().join("x.mcap");
    let (code, refused, output) = sim.run(&["fetch-log", "xtb-1", "--out", out.to_str().unwrap()]);
    assert_eq!(code, 1, "{output:?}");
    assert!(refused["error"]["hint"].as_str().unwrap().contains("robot-agent --record"), "{refused}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}

/// The bytes of an answer that lists one recording; no codec of ours would write them.
fn list_of(file: &str) -> Vec<u8> {
    let length = u8::try_from(file.len()).unwrap();
    // One file: its name, 5 bytes, 7 s old, closed; none left out.
    [&[0, 1, length], file.as_bytes(), &[5, 7, 0, 0]].concat()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_false_robot_does_not_say_where_its_recording_is_written() {
    let place = tempfile::tempdir().unwrap();
    let (work, outside) = (place.path().join("work"), place.path().join("outside.mcap"));
    fs::create_dir(&work).unwrap();
    let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = xtb_bus::open(&role).await.unwrap();
    let endpoint = router.locators().await.remove(0);
    let attacker = attacker::session(&endpoint).await;
    let key = FleetKeys::new(name("lab")).robot(&name("xtb-1")).log(None);
    let stamp = "20041201T120000Z";
    let absolute = outside.to_str().unwrap().to_owned();
    let named = [
        "../outside.mcap".to_owned(),
        absolute,
        format!("../xtb-1-{stamp}.mcap"),
        format!("xtb-1-{stamp}.mcap/../../outside.mcap"),
        format!("xtb-1-{stamp}/../xtb-1-{stamp}.mcap"),
        format!("xtb-2-{stamp}.mcap"),
        format!("xtb-1-{stamp}.sh"),
        format!("xtb-1-{stamp}.mcap\0"),
        ".bashrc".to_owned(),
    ];
    for file in named {
        let list = list_of(&file);
        let piece = codec::encode(
            &LogReply::Piece { bytes: 5, open: false, data: b"owned".to_vec() },
            Format::Postcard,
        );
        let piece = piece.unwrap();
        let _answering = attacker::answer::<LogReply>(&attacker, &key, move |asked| {
            let encoding = codec::encoding::<LogRequest>(Format::Postcard);
            match codec::decode::<LogRequest>(&encoding, asked).unwrap().0 {
                LogRequest::List {} => list.clone(),
                LogRequest::Read { .. } => piece.clone(),
            }
        })
        .await;
        let mut command = fleet_cli(&["--connect", &endpoint, "--timeout", "1", "fetch-log", "xtb-1"]);
        command.current_dir(&work);
        let output = tokio::task::spawn_blocking(move || command.output().unwrap()).await.unwrap();
        let files = |folder: &Path| fs::read_dir(folder).unwrap().count();
        assert_eq!((files(place.path()), files(&work)), (1, 0), "{file:?} wrote: {output:?}");
        assert_eq!(output.status.code(), Some(1), "{file:?}: {output:?}");
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("recording"), "{file:?}: {said}");
    }
    router.close().await;
}
