//! What becomes of an edit of the served map. No Zenoh and no clock: the caller brings both; files are behind
//! [`MapStore`].

use super::history::MapVersions;
use std::collections::VecDeque;
use std::sync::Arc;
use xtb_nav::map::ZoneError;
use xtb_nav::{Map, Zone};
use xtb_protocol::messages::{MapEdit, MapEditCode, MapEditReply, MapHistory};
use xtb_protocol::{Name, Uuid};

/// Answers that are remembered, for whoever asks again.
const ANSWERS: usize = 16;

/// Where a served map is kept.
pub trait MapStore: Send {
    /// The map that is there now.
    ///
    /// # Errors
    /// Why it cannot be read.
    fn read(&mut self) -> Result<Map, String>;

    /// Puts the map's zones and places there, in one step; its floor is the one that is there.
    ///
    /// # Errors
    /// Why it cannot be written; nothing has changed then.
    fn write(&mut self, map: &Map) -> Result<(), String>;
}

/// What somebody has made of the map's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing that counts.
    Same,
    /// Other zones or places, which are served now.
    Changed,
    /// Another floor: that needs a new start.
    OtherFloor,
}

/// The served map, who changed it, and where it is kept.
pub(super) struct Editor {
    map: Arc<Map>,
    history: MapVersions,
    store: Option<Box<dyn MapStore>>,
    answers: VecDeque<(Name, Uuid, MapEditReply)>,
}

struct Refusal(MapEditCode, String, &'static str);

impl Editor {
    /// Without a store, changes end with this program.
    pub(super) fn new(
        now_ms: u64,
        map: Map,
        mut history: MapVersions,
        store: Option<Box<dyn MapStore>>,
    ) -> Self {
        if let Err(error) = history.found(now_ms, &map) {
            tracing::warn!("the map's history cannot be written: {error}");
        }
        Self { map: Arc::new(map), history, store, answers: VecDeque::new() }
    }

    /// The map as it is served.
    pub(super) fn map(&self) -> &Arc<Map> {
        &self.map
    }

    /// Who changed it.
    pub(super) fn told(&self) -> MapHistory {
        let (name, stored) = (self.map.name().to_owned(), self.store.is_some());
        MapHistory { name, stored, versions: self.history.versions() }
    }

    /// An edit: it is saved and served, or nothing changes. The same again is answered as before.
    pub(super) fn edit(&mut self, now_ms: u64, by: &Name, edit: &MapEdit) -> MapEditReply {
        let known = self.answers.iter().find(|(name, id, _)| name == by && *id == edit.id);
        if let Some((_, _, reply)) = known {
            return reply.clone();
        }
        let reply = match self.decide(now_ms, by, edit) {
            Ok(()) => self.saved(),
            Err(Refusal(code, message, hint)) => {
                MapEditReply::Refused { code, message: shortened(message), hint: hint.to_owned() }
            }
        };
        if self.answers.len() == ANSWERS {
            self.answers.pop_front();
        }
        self.answers.push_back((by.clone(), edit.id, reply.clone()));
        reply
    }

    fn decide(&mut self, now_ms: u64, by: &Name, edit: &MapEdit) -> Result<(), Refusal> {
        // Whoever changes the file itself comes first, also within the last second.
        if let Some(store) = &mut self.store {
            let there =
                store.read().map_err(|why| not_stored(format!("the map's file cannot be read: {why}")))?;
            if self.found(now_ms, there) == Found::OtherFloor {
                return Err(not_stored("the map's file has another floor now".to_owned()));
            }
        }
        let invalid =
            |reason: String| Refusal(MapEditCode::Invalid, reason, "nothing was saved; correct that");
        let zones = edit.zones.iter().map(Zone::try_from).collect::<Result<Vec<_>, ZoneError>>();
        let zones = zones.map_err(|error| invalid(error.to_string()))?;
        let next = self.map.with(zones, edit.places.clone()).map_err(|error| invalid(error.to_string()))?;
        if next.content() == self.map.content() {
            return Ok(());
        }
        if edit.base != self.map.content() {
            return Err(self.conflict());
        }
        let version = self.history.next(now_ms, by, &edit.why, &next);
        let history = self.history.with(version, &next);
        // First who and why: a map that changed without would be said to have changed in the file.
        history
            .write()
            .map_err(|error| not_stored(format!("the map's history cannot be written: {error}")))?;
        if let Some(Err(why)) = self.store.as_mut().map(|store| store.write(&next)) {
            if let Err(error) = self.history.write() {
                tracing::warn!("the map's history has a version that was not saved: {error}");
            }
            return Err(not_stored(format!("the map's file cannot be written: {why}")));
        }
        (self.map, self.history) = (Arc::new(next), history);
        Ok(())
    }

    /// The map that is in the file now.
    pub(super) fn found(&mut self, now_ms: u64, map: Map) -> Found {
        if map.content() == self.map.content() {
            return Found::Same;
        }
        if map.grid() != self.map.grid() || map.name() != self.map.name() {
            return Found::OtherFloor;
        }
        if let Err(error) = self.history.found(now_ms, &map) {
            tracing::warn!("the map's history cannot be written: {error}");
        }
        self.map = Arc::new(map);
        Found::Changed
    }

    fn saved(&self) -> MapEditReply {
        match self.history.newest() {
            Some(version) => MapEditReply::Saved { version: version.clone(), stored: self.store.is_some() },
            None => unreachable!("a map that is served has a version"),
        }
    }

    fn conflict(&self) -> Refusal {
        let newest = self.history.newest();
        let newest = newest.map_or_else(String::new, |version| {
            format!(": version {} by {} ({})", version.number, version.by, version.why)
        });
        let message = format!("the map has changed since it was read{newest}");
        Refusal(MapEditCode::Conflict, message, "nothing was saved; read the map again and repeat the change")
    }
}

fn not_stored(message: String) -> Refusal {
    Refusal(MapEditCode::NotStored, message, "nothing was saved; see to the file of the map server")
}

fn shortened(message: String) -> String {
    message.chars().take(500).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use xtb_nav::Grid;
    use xtb_protocol::messages::{MapPlace, MapZone, MapZoneKind};

    /// A file in memory; broken = it cannot be written.
    #[derive(Clone)]
    struct File(Arc<Mutex<(Map, bool)>>);

    impl MapStore for File {
        fn read(&mut self) -> Result<Map, String> {
            Ok(self.0.lock().unwrap().0.clone())
        }

        fn write(&mut self, map: &Map) -> Result<(), String> {
            let mut file = self.0.lock().unwrap();
            if file.1 {
                return Err("no space".to_owned());
            }
            file.0 = map.clone();
            Ok(())
        }
    }

    fn floor(width: usize) -> Map {
        Map::new("lab", Grid::free(0.5, [0.0, 0.0], width, 10).unwrap(), Vec::new()).unwrap()
    }

    fn place(name: &str) -> MapPlace {
        serde_json::from_str(&format!(r#"{{"name":"{name}","x_m":1,"y_m":1}}"#)).unwrap()
    }

    fn zone(points: &[[f64; 2]]) -> MapZone {
        MapZone { name: "crane".into(), kind: MapZoneKind::KeepOut, points: points.to_vec() }
    }

    const CORNERS: [[f64; 2]; 4] = [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]];

    fn edit(editor: &Editor, zones: &[MapZone], places: &[MapPlace]) -> MapEdit {
        let (base, why) = (editor.map().content(), "a crane".to_owned());
        MapEdit { id: Uuid::new_v4(), base, why, zones: zones.to_vec(), places: places.to_vec() }
    }

    fn refused(reply: &MapEditReply) -> (MapEditCode, &str) {
        match reply {
            MapEditReply::Refused { code, message, .. } => (*code, message),
            MapEditReply::Saved { .. } => panic!("{reply:?}"),
        }
    }

    fn number(reply: &MapEditReply) -> u64 {
        match reply {
            MapEditReply::Saved { version, .. } => version.number,
            MapEditReply::Refused { .. } => panic!("{reply:?}"),
        }
    }

    fn names() -> [Name; 2] {
        ["alice", "bob"].map(|name| Name::new(name).unwrap())
    }

    #[test]
    fn an_edit_becomes_a_version_and_one_of_an_older_map_a_conflict() {
        let [alice, bob] = names();
        let mut editor = Editor::new(5, floor(20), MapVersions::default(), None);
        let (first, second) = (edit(&editor, &[zone(&CORNERS)], &[]), edit(&editor, &[], &[place("dock")]));
        assert_eq!(number(&editor.edit(6, &alice, &first)), 2);
        assert_eq!(editor.map().zones().len(), 1);
        let reply = editor.edit(7, &bob, &second);
        assert_eq!(
            refused(&reply),
            (MapEditCode::Conflict, "the map has changed since it was read: version 2 by alice (a crane)")
        );
        assert_eq!(editor.map().places(), [], "nothing is overwritten");
        // Asked again after another change, it is not done again.
        let third = edit(&editor, &[zone(&CORNERS)], &[place("dock")]);
        assert_eq!(number(&editor.edit(8, &bob, &third)), 3);
        assert_eq!(number(&editor.edit(9, &alice, &first)), 2);
        assert_eq!(editor.map().places().len(), 1);
        let told: Vec<_> =
            editor.told().versions.iter().map(|version| (version.at_ms, version.by.to_string())).collect();
        assert_eq!(told, [(5, "file".into()), (6, "alice".into()), (8, "bob".into())]);
    }

    #[test]
    fn what_no_map_can_have_is_refused_and_what_changes_nothing_is_no_version() {
        let [alice, _] = names();
        let mut editor = Editor::new(5, floor(20), MapVersions::default(), None);
        let bow = zone(&[[1.0, 1.0], [2.0, 2.0], [2.0, 1.0], [1.0, 2.0]]);
        let reply = editor.edit(6, &alice, &edit(&editor, &[bow], &[]));
        assert!(
            matches!(refused(&reply), (MapEditCode::Invalid, why) if why.contains("cross or touch")),
            "{reply:?}"
        );
        let twice = edit(&editor, &[zone(&CORNERS), zone(&CORNERS)], &[]);
        assert_eq!(refused(&editor.edit(6, &alice, &twice)).0, MapEditCode::Invalid);
        assert_eq!(number(&editor.edit(6, &alice, &edit(&editor, &[], &[]))), 1);
    }

    #[test]
    fn what_cannot_be_written_is_not_served_and_the_files_own_changes_come_first() {
        let [alice, _] = names();
        let file = File(Arc::new(Mutex::new((floor(20), true))));
        let mut editor = Editor::new(5, floor(20), MapVersions::default(), Some(Box::new(file.clone())));
        let reply = editor.edit(6, &alice, &edit(&editor, &[], &[place("dock")]));
        assert_eq!(refused(&reply), (MapEditCode::NotStored, "the map's file cannot be written: no space"));
        assert_eq!((editor.map().places().len(), editor.told().versions.len()), (0, 1));

        file.0.lock().unwrap().1 = false;
        let late = edit(&editor, &[], &[place("dock")]);
        file.0.lock().unwrap().0 = floor(20).with_places(vec![place("gate")]).unwrap();
        assert_eq!(refused(&editor.edit(7, &alice, &late)).0, MapEditCode::Conflict);
        assert_eq!(editor.map().places(), [place("gate")]);
        let both = edit(&editor, &[], &[place("gate"), place("dock")]);
        assert_eq!(number(&editor.edit(8, &alice, &both)), 3);
        assert_eq!(file.0.lock().unwrap().0.places().len(), 2);

        file.0.lock().unwrap().0 = floor(21);
        let reply = editor.edit(9, &alice, &edit(&editor, &[], &[]));
        assert!(matches!(refused(&reply), (MapEditCode::NotStored, why) if why.contains("another floor")));
    }
}
