//! Who changed a map, when and why: kept beside the map's file, one JSON line a version, the newest last.
//!
//! Each line also has the zones and places of its version. Bounded: the oldest lines go first.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;
use xtb_nav::Map;
use xtb_protocol::Name;
use xtb_protocol::messages::{MAX_MAP_VERSIONS, MapPlace, MapVersion, MapZone};
use xtb_recording::files::{self, FileError};

/// Longest history, in bytes: a version with the most zones and places takes about 2 MiB, a usual one some KiB.
const MAX_BYTES: usize = 8 << 20;
/// Who is said to have changed the file itself.
const FILE: &str = "file";

/// Why a history cannot be gone on with.
#[derive(Debug, Error)]
pub enum MapVersionsError {
    /// It cannot be read.
    #[error("cannot read {path}: {source}")]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: FileError,
    },
    /// A line is not a version.
    #[error("{path}, line {line}: {reason}")]
    Line {
        /// Which file.
        path: PathBuf,
        /// Which line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: serde_json::Error,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    version: MapVersion,
    zones: Vec<MapZone>,
    places: Vec<MapPlace>,
}

/// The versions of one map, the newest last.
#[derive(Debug, Clone, Default)]
pub struct MapVersions {
    path: Option<PathBuf>,
    lines: VecDeque<(MapVersion, String)>,
}

impl MapVersions {
    /// Of the map in this file: beside it, `lab.yaml` → `lab.yaml.history.jsonl`.
    #[must_use]
    pub fn beside(map: &Path) -> PathBuf {
        let mut name = map.file_name().unwrap_or_default().to_owned();
        name.push(".history.jsonl");
        map.with_file_name(name)
    }

    /// Goes on with the history in this file; one that is not there begins with the first change.
    ///
    /// # Errors
    /// See [`MapVersionsError`].
    pub fn open(path: &Path) -> Result<Self, MapVersionsError> {
        let text = match files::text(path, 2 * MAX_BYTES) {
            Ok(text) => text,
            Err(error) if error.is_missing() => String::new(),
            Err(source) => return Err(MapVersionsError::Unreadable { path: path.to_owned(), source }),
        };
        let read = |(i, line): (usize, &str)| match serde_json::from_str::<Line>(line) {
            Ok(read) => Ok((read.version, line.to_owned())),
            Err(reason) => Err(MapVersionsError::Line { path: path.to_owned(), line: i + 1, reason }),
        };
        let lines = text.lines().enumerate().map(read).collect::<Result<_, _>>()?;
        Ok(Self { path: Some(path.to_owned()), lines })
    }

    /// Whether it outlives this program.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.path.is_some()
    }

    /// All that are remembered, the newest last.
    #[must_use]
    pub fn versions(&self) -> Vec<MapVersion> {
        self.lines.iter().map(|(version, _)| version.clone()).collect()
    }

    /// The newest.
    #[must_use]
    pub fn newest(&self) -> Option<&MapVersion> {
        self.lines.back().map(|(version, _)| version)
    }

    /// What the file was found with: the first version, or one that somebody made without the map server.
    ///
    /// # Errors
    /// It could not be written; it counts all the same.
    pub(super) fn found(&mut self, now_ms: u64, map: &Map) -> io::Result<()> {
        let (why, write) = match self.newest() {
            Some(newest) if newest.content == map.content() => return Ok(()),
            Some(_) => ("changed in the file", true),
            // Who only serves a map leaves no file.
            None => ("as found", false),
        };
        let Ok(by) = Name::new(FILE) else { return Ok(()) };
        let next = self.with(self.next(now_ms, &by, why, map), map);
        let written = if write { next.write() } else { Ok(()) };
        *self = next;
        written
    }

    /// The version that a change makes.
    pub(super) fn next(&self, now_ms: u64, by: &Name, why: &str, map: &Map) -> MapVersion {
        let number = self.newest().map_or(1, |newest| newest.number.saturating_add(1));
        MapVersion { number, at_ms: now_ms, by: by.clone(), why: why.to_owned(), content: map.content() }
    }

    /// The same with one more version, not written yet.
    pub(super) fn with(&self, version: MapVersion, map: &Map) -> Self {
        let mut next = self.clone();
        let line = Line {
            version: version.clone(),
            zones: map.zones().iter().map(MapZone::from).collect(),
            places: map.places().to_vec(),
        };
        match serde_json::to_string(&line) {
            Ok(text) => next.lines.push_back((version, text)),
            // Every number of a map is finite.
            Err(error) => tracing::error!("a version of the map cannot be written: {error}"),
        }
        let bytes =
            |lines: &VecDeque<(MapVersion, String)>| lines.iter().map(|(_, line)| line.len()).sum::<usize>();
        while next.lines.len() > MAX_MAP_VERSIONS || (next.lines.len() > 1 && bytes(&next.lines) > MAX_BYTES)
        {
            next.lines.pop_front();
        }
        next
    }

    /// Writes it in one step.
    ///
    /// # Errors
    /// The system's words; the file is as it was.
    pub(super) fn write(&self) -> io::Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        let text: String = self.lines.iter().flat_map(|(_, line)| [line.as_str(), "\n"]).collect();
        files::replace(path, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_nav::Grid;

    fn map(places: usize) -> Map {
        let place = |i| {
            serde_json::from_str::<MapPlace>(&format!(r#"{{"name":"p{i}","x_m":0.1,"y_m":0.2}}"#)).unwrap()
        };
        let floor = Map::new("lab", Grid::free(0.05, [0.0, 0.0], 20, 10).unwrap(), Vec::new()).unwrap();
        floor.with_places((0..places).map(place).collect()).unwrap()
    }

    fn add(history: &mut MapVersions, now_ms: u64, why: &str, map: &Map) {
        let version = history.next(now_ms, &Name::new("alice").unwrap(), why, map);
        *history = history.with(version, map);
        history.write().unwrap();
    }

    #[test]
    fn versions_are_read_back_and_the_numbers_go_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = MapVersions::beside(&folder.path().join("lab.yaml"));
        assert_eq!(path.file_name().unwrap(), "lab.yaml.history.jsonl");
        let mut history = MapVersions::open(&path).unwrap();
        history.found(5, &map(0)).unwrap();
        assert!(!path.exists(), "who only serves leaves no file");
        add(&mut history, 7, "a dock", &map(1));
        let mut again = MapVersions::open(&path).unwrap();
        assert_eq!(again.versions(), history.versions());
        let told = |version: &MapVersion| {
            (version.number, version.at_ms, version.by.to_string(), version.why.clone())
        };
        let told: Vec<_> = again.versions().iter().map(told).collect();
        assert_eq!(told, [(1, 5, "file".into(), "as found".into()), (2, 7, "alice".into(), "a dock".into())]);
        again.found(9, &map(1)).unwrap();
        assert_eq!(again.versions().len(), 2, "the same is no change");
        again.found(9, &map(2)).unwrap();
        assert_eq!(again.newest().unwrap().why, "changed in the file");
        assert_eq!(MapVersions::open(&path).unwrap().newest(), again.newest());
    }

    #[test]
    fn the_oldest_versions_go_first() {
        let mut history = MapVersions::default();
        for i in 0..=MAX_MAP_VERSIONS {
            add(&mut history, 0, &format!("change {i}"), &map(i % 3));
        }
        let versions = history.versions();
        assert_eq!((versions.len(), versions[0].number), (MAX_MAP_VERSIONS, 2));
    }

    #[test]
    fn a_history_that_is_none_is_refused_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lab.yaml.history.jsonl");
        let mut history = MapVersions::open(&path).unwrap();
        add(&mut history, 7, "a dock", &map(1));
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text + "what?\n").unwrap();
        let error = MapVersions::open(&path).unwrap_err().to_string();
        assert!(error.contains("jsonl, line 2:"), "{error}");
    }
}
