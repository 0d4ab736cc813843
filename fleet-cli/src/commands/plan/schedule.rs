//! The schedule as a file: `statistics`, then for each robot x, y, yaw and t of each row.

use super::Statistics;
use super::instance::Instance;
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use serde_saphyr::FlowMap;
use xtb_client::{Error, ErrorKind, Result};
use xtb_traffic::solver::Schedule;

#[derive(Serialize)]
struct File<'a> {
    statistics: &'a Statistics,
    schedule: Ways<'a>,
}

/// A map in the instance's order.
struct Ways<'a> {
    instance: &'a Instance,
    schedule: &'a Schedule,
}

#[derive(Serialize)]
struct Row {
    x: f64,
    y: f64,
    yaw: f64,
    t: f64,
}

impl Serialize for Ways<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.schedule.ways.len()))?;
        for way in &self.schedule.ways {
            let rows = way.rows.iter().map(|row| {
                let [x, y, yaw] = self.instance.place(&row.pose);
                FlowMap(Row { x, y, yaw, t: self.instance.time(row.step) })
            });
            map.serialize_entry(&way.name, &rows.collect::<Vec<_>>())?;
        }
        map.end()
    }
}

/// The file's text.
///
/// # Errors
/// None in practice: everything in it can be written.
pub(super) fn text(instance: &Instance, schedule: &Schedule, statistics: &Statistics) -> Result<String> {
    serde_saphyr::to_string(&File { statistics, schedule: Ways { instance, schedule } })
        .map_err(|error| Error::new(ErrorKind::Failed, format!("cannot write YAML: {error}")))
}
