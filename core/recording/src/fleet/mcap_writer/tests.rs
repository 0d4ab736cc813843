//! Files: how they follow each other, and what is left of one that was never finished.

use super::*;
use crate::fleet::reader::{self, RecordingReader};
use xtb_client::subscription::Item;

fn settings(path: &Path) -> McapSettings {
    McapSettings {
        path: path.to_owned(),
        force: false,
        max_bytes: 64 << 10,
        fleet: "lab".into(),
        keys: vec!["xtb/lab/**".into()],
    }
}

fn alive(robot: u32) -> Item {
    Item::Presence(format!("xtb/lab/xtb-{robot}/alive"), true)
}

fn count(path: &Path) -> (u64, Option<String>) {
    let mut reader = RecordingReader::open(path).unwrap();
    let mut messages = 0;
    while let Some(message) = reader.next_message().unwrap() {
        messages += u64::from(message.schema == "xtb.Alive");
    }
    (messages, reader.cut_because().map(str::to_owned))
}

#[test]
fn a_file_that_is_long_enough_is_followed_by_the_next_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("day.mcap");
    std::fs::write(folder.path().join("day-2.mcap"), "somebody else's").unwrap();
    let mut recorder = Recorder::default();
    let mut tape = McapWriter::create(settings(&path), 0).unwrap();
    let mut at_ns = 0;
    while tape.paths().len() < 3 {
        for robot in 0..300 {
            at_ns += 1;
            tape.write(recorder.take(at_ns, &alive(robot))).unwrap();
        }
        let counts = recorder.counts();
        tape.flush(&mut recorder, counts, at_ns).unwrap();
    }
    tape.finish(recorder.counts()).unwrap();
    let names: Vec<_> = tape.paths().iter().map(|path| path.file_name().unwrap().to_owned()).collect();
    assert_eq!(names, ["day.mcap", "day-3.mcap", "day-4.mcap"]);
    let counted: Vec<_> = tape.paths().iter().map(|path| count(path)).collect();
    assert!(counted.iter().all(|(_, cut)| cut.is_none()), "{counted:?}");
    let whole: u64 = counted.iter().map(|(messages, _)| messages).sum();
    // Who is there is told again at the beginning of each further file.
    assert_eq!(whole, recorder.counts().messages + 2 * 300);
    assert!(counted[2].0 >= 300);
    let other = std::fs::read_to_string(folder.path().join("day-2.mcap")).unwrap();
    assert_eq!(other, "somebody else's");
}

#[test]
fn a_file_that_is_there_already_is_left_alone_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("day.mcap");
    std::fs::write(&path, "keep me").unwrap();
    let error = McapWriter::create(settings(&path), 0).err().unwrap();
    assert!(matches!(&error, Error::Exists(there) if *there == path), "{error:?}");
    assert_eq!(error.to_string(), format!("{} already exists", path.display()));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "keep me");
    let mut tape = McapWriter::create(McapSettings { force: true, ..settings(&path) }, 0).unwrap();
    let mut recorder = Recorder::default();
    tape.write(recorder.take(5, &alive(1))).unwrap();
    tape.finish(recorder.counts()).unwrap();
    assert_eq!(count(&path), (1, None));
}

#[test]
fn a_full_disk_is_said_so() {
    let full = Path::new("/dev/full");
    if !full.exists() {
        return; // no such device on this system
    }
    let error = McapWriter::create(McapSettings { force: true, ..settings(full) }, 0).err().unwrap();
    assert!(matches!(error, Error::Write { full: true, .. }), "{error:?}");
    assert!(error.to_string().starts_with("cannot write /dev/full: "), "{error}");
}

#[test]
fn what_was_flushed_is_read_from_a_file_that_was_never_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("day.mcap");
    let mut recorder = Recorder::default();
    let mut tape = McapWriter::create(settings(&path), 0).unwrap();
    tape.write(recorder.take(5, &alive(1))).unwrap();
    let counts = RecordingCounts { dropped: 3, ..recorder.counts() };
    tape.flush(&mut recorder, counts, 6).unwrap();
    tape.write(recorder.take(7, &alive(2))).unwrap();
    let left = folder.path().join("left.mcap");
    std::fs::copy(&path, &left).unwrap();
    assert!(matches!(count(&left), (1, Some(_))), "{:?}", count(&left));
    assert_eq!(reader::span(&left).unwrap().began_ns, 5);
    let mut reader = RecordingReader::open(&left).unwrap();
    while reader.next_message().unwrap().is_some() {}
    assert_eq!((reader.fleet(), &*reader.metadata(COUNTS).unwrap()["dropped"]), (Some("lab"), "3"));
}
