//! One map for a fleet, and its changes over a session.

use super::*;
use xtb_client::Client;
use xtb_client::map_edit::{self, MapDraft};
use xtb_client::map_source::{place, places};
use xtb_nav::Grid;
use xtb_protocol::messages::{MapPlace, MapZone};

const PATIENT: Duration = Duration::from_secs(30);

fn map(name: &str, width: usize) -> Map {
    Map::new(name, Grid::free(0.05, [0.0, 0.0], width, 10).unwrap(), Vec::new()).unwrap()
}

fn gate() -> MapPlace {
    serde_json::from_str(r#"{"name":"gate","x_m":0.2,"y_m":0.1}"#).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_map_is_served_at_a_time_and_the_next_when_that_has_ended() {
    let client = Client::alone(PATIENT).await;
    let (bus, keys, within) = (client.bus(), client.keys(), PATIENT);
    assert!(served(bus, keys, within).await.unwrap().is_empty());
    let lab = map("lab", 20);
    let first = MapService::start(bus, keys, &lab, within).await.unwrap();
    let found = served(bus, keys, within).await.unwrap();
    assert_eq!((found.len(), Map::try_from(&found[0]).unwrap()), (1, lab.clone()));

    let refused = MapService::start(bus, keys, &map("barn", 21), within).await.map(drop).unwrap_err();
    let named = format!("another map is already served: lab ({})", lab.hash());
    assert_eq!((refused.kind, refused.message), (ErrorKind::Failed, named));
    assert_eq!(places(bus, keys, within).await.unwrap(), Some(Vec::new()));
    first.file_holds(lab.with(Vec::new(), vec![gate()]).unwrap()).await;
    let mut maps = first.maps();
    maps.wait_for(|map| !map.places().is_empty()).await.unwrap();
    assert_eq!(place(bus, keys, "gate", within).await.unwrap(), gate());
    assert!(place(bus, keys, "door", within).await.is_err());
    // The same floor by another name is no other map.
    drop(MapService::start(bus, keys, &map("room", 20), within).await.unwrap());

    drop(first);
    drop(MapService::start(bus, keys, &map("barn", 21), within).await.unwrap());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_who_edit_the_same_version_do_not_overwrite_each_other() {
    let client = Client::alone(PATIENT).await;
    let (bus, keys) = (client.bus(), client.keys());
    let nobody = map_edit::draft(&client).await.unwrap_err();
    assert_eq!(nobody.kind, ErrorKind::NoMap);
    let service = MapService::start(bus, keys, &map("lab", 20), PATIENT).await.unwrap();
    let crane: MapZone = serde_json::from_str(
        r#"{"name":"crane","kind":"keep_out","points":[[0.1,0.1],[0.3,0.1],[0.3,0.3]]}"#,
    )
    .unwrap();
    let seen = map_edit::draft(&client).await.unwrap();
    let with_zone = MapDraft { zones: vec![crane.clone()], ..seen.clone() };
    let saved = map_edit::save(&client, with_zone, " a crane ").await.unwrap();
    assert_eq!((saved.version.number, saved.version.why.as_str(), saved.stored), (2, "a crane", false));
    assert_eq!(saved.version.by, *client.name());
    // The new map is what everybody gets now.
    let now = map_edit::draft(&client).await.unwrap();
    assert_eq!((now.zones.as_slice(), now.base), (&[crane][..], saved.version.content));
    assert_eq!(service.maps().borrow().hash(), now.base.map);

    let late =
        map_edit::save(&client, MapDraft { places: vec![gate()], ..seen }, "a gate").await.unwrap_err();
    assert_eq!(late.kind, ErrorKind::NotEdited(MapEditCode::Conflict));
    assert!(late.message.contains("a crane"), "{late}");
    map_edit::save(&client, MapDraft { places: vec![gate()], ..now.clone() }, "a gate").await.unwrap();
    let why = map_edit::save(&client, now, "\u{1b}[2J").await.unwrap_err();
    assert_eq!(why.kind, ErrorKind::Invalid);
    let history = map_edit::history(&client).await.unwrap();
    let whys: Vec<_> = history.versions.iter().map(|version| version.why.as_str()).collect();
    assert_eq!(whys, ["as found", "a crane", "a gate"]);

    let second = MapService::start(bus, keys, &service.maps().borrow().clone(), PATIENT).await.unwrap();
    let draft = MapDraft { base: history.versions[2].content, zones: Vec::new(), places: Vec::new() };
    let two = map_edit::save(&client, draft, "all away").await.unwrap_err();
    assert!(two.message.contains("2 programs"), "{two}");
    drop(second);
}
