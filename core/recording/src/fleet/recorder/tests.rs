//! Which records an item becomes, and what is counted.

use super::*;
use xtb_bus::Incoming;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::messages::{Estop, FleetMap, MapCell, MapHash, Message};

fn item<M: Message>(key: &str, message: &M, format: Format) -> Item {
    let payload = codec::encode(message, format).unwrap();
    Item::Message(Incoming { key: key.into(), encoding: codec::encoding::<M>(format), payload })
}

fn state(robot: &str) -> Item {
    item(&format!("xtb/lab/{robot}/state"), &xtb_client::fake::state(robot), Format::Postcard)
}

fn map() -> Item {
    let map = FleetMap {
        name: "lab".into(),
        hash: MapHash::new(1),
        resolution_m: 0.1,
        origin_m: [0.0, 0.0],
        width: 4,
        height: 3,
        cells: vec![(MapCell::Occupied, 4), (MapCell::Free, 8)],
        zones: Vec::new(),
    };
    item("xtb/lab/map", &map, Format::Postcard)
}

/// Topics that were made known, and messages as (topic, sequence, JSON).
fn told(records: &[FileRecord]) -> (Vec<String>, Vec<(u16, u32, serde_json::Value)>) {
    let mut topics = Vec::new();
    let mut messages = Vec::new();
    for record in records {
        match record {
            FileRecord::Topic { name, .. } => topics.push(name.clone()),
            FileRecord::Message { topic, sequence, data, .. } => {
                messages.push((*topic, *sequence, serde_json::from_slice(data).unwrap()));
            }
        }
    }
    (topics, messages)
}

#[test]
fn a_topic_is_the_key_and_messages_are_json_whatever_they_were_sent_as() {
    for format in [Format::Postcard, Format::Json] {
        let estop = Estop { id: Uuid::nil() };
        let mut recorder = Recorder::default();
        let (topics, messages) = told(&recorder.take(7, &item("xtb/lab/all/estop/me", &estop, format)));
        assert_eq!(topics, ["xtb/lab/all/estop/me", LOG_TOPIC]);
        assert_eq!(messages[0], (0, 0, serde_json::to_value(&estop).unwrap()));
        assert_eq!(messages[1].2["message"], "emergency stop requested");
    }
}

#[test]
fn a_state_is_also_a_pose_and_now_and_then_a_picture() {
    let mut recorder = Recorder::default();
    let (topics, messages) = told(&recorder.take(0, &state("xtb-1")));
    assert_eq!(topics, ["xtb/lab/xtb-1/state", "xtb/lab/xtb-1/state/pose", SCENE_TOPIC]);
    assert_eq!(messages.len(), 3);
    let ms = 1_000_000;
    let pictures: Vec<usize> =
        [50, 100, 150, 200].map(|at| told(&recorder.take(at * ms, &state("xtb-1"))).1.len()).into();
    assert_eq!(pictures, [2, 3, 2, 3]);
    assert_eq!((recorder.counts().messages, recorder.counts().derived), (5, 8));
}

#[test]
fn what_is_none_of_ours_is_counted_and_left_out() {
    let mut recorder = Recorder::default();
    let foreign = Incoming { key: "ros/odom".into(), encoding: "text/plain".into(), payload: vec![1] };
    let broken = Incoming { key: "xtb/lab/xtb-1/state".into(), ..foreign.clone() };
    assert_eq!(recorder.take(0, &Item::Message(foreign)), []);
    assert_eq!(recorder.take(0, &Item::Message(broken)), []);
    assert_eq!(recorder.counts(), RecordingCounts { unreadable: 2, ..RecordingCounts::default() });
}

#[test]
fn made_up_keys_are_bounded() {
    let mut recorder = Recorder::default();
    let estop = Estop { id: Uuid::nil() };
    for n in 0..MOST_TOPICS + 10 {
        recorder.take(0, &item(&format!("xtb/lab/all/estop/c{n}"), &estop, Format::Json));
    }
    // One of the topics is the log.
    assert_eq!(recorder.counts().messages, MOST_TOPICS as u64 - 1);
    assert_eq!(recorder.counts().unreadable, 11);
}

#[test]
fn a_further_file_begins_with_what_still_holds() {
    let mut recorder = Recorder::default();
    recorder.take(0, &map());
    recorder.take(1, &Item::Presence("xtb/lab/xtb-1/alive".into(), false));
    recorder.take(2, &Item::Presence("xtb/lab/xtb-1/alive".into(), true));
    recorder.take(3, &state("xtb-1"));
    let (topics, messages) = told(&recorder.next_file(9));
    assert!(topics.contains(&"xtb/lab/xtb-1/state".to_owned()), "{topics:?}");
    let texts: Vec<String> = messages.iter().map(|(.., value)| value.to_string()).collect();
    assert_eq!(messages.len(), 3, "{texts:?}");
    assert!(texts.contains(&r#"{"alive":true}"#.to_owned()), "{texts:?}");
    assert!(texts.iter().any(|text| text.contains("resolution_m")), "{texts:?}");
    assert!(texts.iter().any(|text| text.contains("cubes")), "{texts:?}");
    assert_eq!((recorder.counts().messages, recorder.counts().repeated), (4, 3));
}
