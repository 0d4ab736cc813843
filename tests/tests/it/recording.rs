//! Recordings: what was decided is decided again, bit for bit, and what was altered is found.

use fleet_cli::recording::playback_worker::{PlaySettings, PlaybackWorker};
use fleet_tests::{Fleet, Setup, eventually, name};
use mcap::records::MessageHeader;
use mcap::{MessageStream, WriteOptions};
use robot_agent::config::SettingLayers;
use robot_agent::replay::{Comparison, OtherDecision, compare, what_if};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use xtb_control::VehicleConfig;
use xtb_protocol::messages::{Body, GoalStatus, Latch, LinkLoss};
use xtb_recording::Error;
use xtb_recording::robot::{Recording, RecordingEnding};

/// Recordings that the programs of commit 054dffaf made (2026-11-23): `sim --robots 1 --record` and `record`, while
/// `goto xtb-1 0 0.3 --wait` and `estop --all` were run. Whoever changes what the controller decides keeps that they are
/// read, and says which decisions are others now.
const EARLIER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/recordings");

/// Two robots drive, one to a goal that needs several manoeuvres; their recordings.
async fn drive(folder: &Path) -> Vec<PathBuf> {
    let setup = Setup {
        robots: 2,
        starts: vec![(0.0, 0.0, 1.57), (3.0, 0.0, 0.0)],
        record: Some(folder.to_owned()),
        ..Setup::default()
    };
    let fleet = Fleet::start(setup).await;
    let goal = fleet.goto(1, -1.5, 0.4).await;
    fleet.ask(2, Body::Wander { for_s: None, on_link_loss: LinkLoss::Finish, finish_s: 300.0 }).await;
    assert_eq!(fleet.outcome(1, goal).await, GoalStatus::Reached);
    assert_eq!(fleet.state(1).await.rejected.record_dropped, 0);
    fleet.end().await;
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

fn recorded_vehicle(recording: &Recording) -> VehicleConfig {
    let mut layers = SettingLayers::default();
    layers.file("header", &recording.header().unwrap().vehicle_toml).unwrap();
    layers.finish().unwrap().vehicle
}

fn replay(path: &Path) -> Result<Comparison, Error> {
    let mut recording = Recording::open(path)?;
    let vehicle = recorded_vehicle(&recording);
    compare(&mut recording, vehicle)
}

/// Copies a recording with other messages; every check sum of the file is right again.
fn rewrite(from: &Path, to: &Path, mut change: impl FnMut(&str, &mut Vec<u8>)) {
    let bytes = std::fs::read(from).unwrap();
    let file = std::fs::File::create(to).unwrap();
    let mut writer = WriteOptions::new().create(std::io::BufWriter::new(file)).unwrap();
    for message in MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let channel = writer.add_channel(0, &message.channel.topic, "json", &BTreeMap::new()).unwrap();
        let (log_time, publish_time) = (message.log_time, message.publish_time);
        let header = MessageHeader { channel_id: channel, sequence: 0, log_time, publish_time };
        let mut data = message.data.to_vec();
        change(&message.channel.topic, &mut data);
        if data.is_empty() {
            continue;
        }
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    writer.finish().unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recorded_drive_is_identical_and_shows_what_another_parameter_would_have_decided() {
    let folder = tempfile::tempdir().unwrap();
    let files = drive(folder.path()).await;
    assert_eq!(files.len(), 2);
    for file in &files {
        let found = replay(file).unwrap();
        assert!(found.identical && found.samples > 500, "{found:?}");
        assert_eq!(found.ending, RecordingEnding::Complete);
    }
    let other = |change: fn(&mut VehicleConfig)| {
        let mut recording = Recording::open(&files[0]).unwrap();
        let mut vehicle = recorded_vehicle(&recording);
        change(&mut vehicle);
        what_if(&mut recording, vehicle).unwrap()
    };
    let same = other(|_| {});
    assert_eq!((same.differing, same.decisions), (0, Vec::new()));
    let without = other(|vehicle| vehicle.goto.hysteresis_deg = 0.0);
    let is_maneuver =
        |other: &OtherDecision| other.decision == "maneuver" && other.recorded != other.replayed;
    assert!(without.decisions.iter().any(is_maneuver), "{without:?}");
}

#[test]
fn a_robots_recording_by_earlier_programs_is_identical() {
    let found = replay(&Path::new(EARLIER).join("robot-2026-11-23.mcap")).unwrap();
    assert!(found.identical && found.samples == 1118, "{found:?}");
    assert_eq!(found.ending, RecordingEnding::Complete);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fleets_recording_by_earlier_programs_is_played() {
    let file = Path::new(EARLIER).join("fleet-2026-11-23.mcap");
    let settings = PlaySettings { speed: 20.0, ..Default::default() };
    let playing = PlaybackWorker::open(&file, settings).unwrap();
    let ended = || async { Some(playing.status()).filter(|status| status.ended || status.failed.is_some()) };
    let status = eventually("the end", ended).await;
    assert_eq!((status.failed, status.unreadable), (None, 0));
    let scene = playing.scene();
    let scene = scene.lock();
    let robot = &scene.robots()[&name("xtb-1")];
    let state = &robot.state.as_ref().expect("its state").value;
    assert!(
        state.pose.y_m > 0.25 && state.latches.iter().any(|latch| latch.latch == Latch::Estop),
        "{state:?}"
    );
    assert!(robot.sensors.is_some() && scene.map().is_some());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_in_any_sample_is_found_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = &drive(folder.path()).await[0];
    let altered = folder.path().join("altered.mcap");
    // A plain copy first: the rewriting itself changes nothing.
    rewrite(file, &altered, |_, _| {});
    assert!(replay(&altered).unwrap().identical);
    for (kind, nth, bit) in
        [("gyro", 200, 0), ("gyro", 3, 1), ("encoder", 30, 0), ("adc", 40, 2), ("command", 1, 0)]
    {
        let mut seen = 0;
        let mut number = String::new();
        rewrite(file, &altered, |topic, data| {
            if topic.ends_with(&format!("/{kind}")) {
                seen += 1;
                if seen == nth {
                    number = String::from_utf8_lossy(data)[5..].split(',').next().unwrap().to_owned();
                    // The last digit of the message.
                    let digit = data.iter().rposition(u8::is_ascii_digit).unwrap();
                    data[digit] ^= 1 << bit;
                }
            }
        });
        let found = replay(&altered).unwrap();
        let first = found.differences.first().unwrap_or_else(|| panic!("{kind}: {found:?}"));
        assert_eq!((first.stage, first.sample.as_str()), ("input", kind), "{found:?}");
        assert_eq!(first.step.to_string(), number, "{found:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_that_was_cut_anywhere_is_readable_up_to_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let file = &drive(folder.path()).await[1];
    let whole = std::fs::read(file).unwrap();
    let samples = replay(file).unwrap().samples;
    let cut = folder.path().join("cut.mcap");
    let mut before = 0;
    for part in 1..=20 {
        std::fs::write(&cut, &whole[..whole.len() * part / 21]).unwrap();
        match replay(&cut) {
            Ok(found) => {
                assert!(found.identical && (before..=samples).contains(&found.samples), "{found:?}");
                assert!(
                    found.samples == samples || matches!(found.ending, RecordingEnding::Cut(_)),
                    "{found:?}"
                );
                before = found.samples;
            }
            // So short that not even the header is there.
            Err(error) => assert!(before == 0, "{part}/21: {error}"),
        }
    }
    assert!(before > samples * 3 / 4, "{before} of {samples}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_anywhere_in_the_data_of_a_finished_file_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let file = &drive(folder.path()).await[0];
    let whole = std::fs::read(file).unwrap();
    let damaged = folder.path().join("damaged.mcap");
    for part in 1..30 {
        let mut bytes = whole.clone();
        bytes[whole.len() * part / 40] ^= 0x10;
        std::fs::write(&damaged, bytes).unwrap();
        let found = replay(&damaged);
        assert!(found.as_ref().map_or(true, |found| !found.identical), "{part}/40: {found:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_decision_that_was_altered_is_found_even_if_it_is_no_json_any_more() {
    let folder = tempfile::tempdir().unwrap();
    let file = &drive(folder.path()).await[0];
    let altered = folder.path().join("altered.mcap");
    for (nth, at, bit) in [(100, 40, 0), (200, 41, 1), (300, 60, 3), (400, 25, 4)] {
        let mut seen = 0;
        rewrite(file, &altered, |topic, data| {
            if topic.ends_with("/outputs") {
                seen += 1;
                if seen == nth {
                    data[at] ^= 1 << bit;
                }
            }
        });
        let found = replay(&altered);
        assert!(found.as_ref().map_or(true, |found| !found.identical), "{at} {bit}: {found:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gap_ends_what_a_replay_says() {
    let folder = tempfile::tempdir().unwrap();
    let file = &drive(folder.path()).await[0];
    let altered = folder.path().join("gap.mcap");
    // A whole step is missing, as if the recorder had had to drop it.
    rewrite(file, &altered, |_, data| {
        if data.starts_with(b"{\"n\":100,") {
            data.clear();
        }
    });
    let mut recording = Recording::open(&altered).unwrap();
    let vehicle = recorded_vehicle(&recording);
    let found = what_if(&mut recording, vehicle).unwrap();
    assert_eq!(found.difference.map(|difference| difference.stage), Some("recorder"));
    let found = replay(&altered).unwrap();
    assert!(!found.identical && found.differences[0].stage == "recorder", "{found:?}");
}
