//! What is shown, against where the playing says that it is.

use super::*;
use std::path::PathBuf;
use xtb_bus::Incoming;
use xtb_client::subscription::Item;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::messages::RobotState;
use xtb_recording::fleet::mcap_writer::{McapSettings, McapWriter};
use xtb_recording::fleet::recorder::Recorder;

const STATES: u64 = 5_000;

/// A robot that says one state a second.
fn recording(folder: &Path) -> PathBuf {
    let path = folder.join("day.mcap");
    let settings = McapSettings {
        path: path.clone(),
        force: false,
        max_bytes: u64::MAX,
        fleet: "lab".into(),
        keys: Vec::new(),
    };
    let mut tape = McapWriter::create(settings, 0).unwrap();
    let mut recorder = Recorder::default();
    for n in 0..STATES {
        let state = RobotState { tick_ms: n, ..xtb_client::fake::state("xtb-1") };
        let payload = codec::encode(&state, Format::Postcard).unwrap();
        let encoding = codec::encoding::<RobotState>(Format::Postcard);
        let item = Item::Message(Incoming { key: "xtb/lab/xtb-1/state".into(), encoding, payload });
        tape.write(recorder.take(n * 1_000_000_000, &item)).unwrap();
    }
    tape.finish(recorder.counts()).unwrap();
    path
}

fn shown(playing: &PlaybackWorker) -> u64 {
    let scene = playing.scene();
    let scene = scene.lock();
    let (_, robot) = scene.robots().iter().next().unwrap();
    robot.state.as_ref().unwrap().value.tick_ms
}

fn wait(mut is: impl FnMut() -> bool) {
    let give_up = Instant::now() + Duration::from_secs(60);
    while !is() {
        assert!(Instant::now() < give_up);
        std::thread::yield_now();
    }
}

#[test]
fn what_says_that_it_has_ended_shows_the_last_message() {
    let folder = tempfile::tempdir().unwrap();
    let path = recording(folder.path());
    let playing = PlaybackWorker::open(&path, PlaySettings { speed: 1e9, ..Default::default() }).unwrap();
    wait(|| playing.status().ended);
    assert_eq!(shown(&playing), STATES - 1);
}

#[test]
fn what_says_that_it_is_at_a_place_shows_that_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = recording(folder.path());
    let playing = PlaybackWorker::open(&path, PlaySettings::default()).unwrap();
    playing.pause(true);
    for place in [4_000, 10, 4_999, 0, 2_500] {
        playing.seek(place * 1000);
        wait(|| playing.status().caught_up);
        assert_eq!((playing.status().position_ms, shown(&playing)), (place * 1000, place));
    }
}
