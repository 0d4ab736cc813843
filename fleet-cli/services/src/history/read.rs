//! What the history answers: pages of events, and what each robot did.

use super::{Question, number, stored};
use rusqlite::types::Type;
use rusqlite::{Connection, Row, params};
use std::collections::BTreeMap;
use std::sync::mpsc::Receiver;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Alert, HistoryEvent, HistoryKind, HistoryPlace, HistoryReply, HistoryRequest, MAX_ALERTS, RobotReport,
    StopCount,
};

/// Until nobody asks any more.
pub(super) fn answer_all(connection: &Connection, asked: &Receiver<Question>) {
    while let Ok(question) = asked.recv() {
        let (request, now_ms, answer) = *question;
        // Who has asked may be gone.
        let _ = answer.send(reply(connection, &request, now_ms));
    }
}

pub(super) fn reply(connection: &Connection, request: &HistoryRequest, now_ms: u64) -> HistoryReply {
    let reply = match request {
        HistoryRequest::Events { .. } => events(connection, request, now_ms),
        HistoryRequest::Report { from_ms, to_ms } => {
            report(connection, *from_ms, *to_ms).map(|robots| HistoryReply::Report { robots })
        }
    };
    reply.unwrap_or_else(|error| {
        tracing::warn!("the history cannot be read: {error}");
        HistoryReply::Failed { message: format!("the history cannot be read: {error}") }
    })
}

/// The last alerts, oldest first, before ended ones those that have not; one that this program cannot read is left out.
pub(super) fn alerts(connection: &Connection) -> rusqlite::Result<Vec<Alert>> {
    let mut statement = connection.prepare(
        "SELECT body FROM alerts ORDER BY json_extract(body, '$.ended_ms') IS NOT NULL, id DESC LIMIT ?1",
    )?;
    let bodies = statement.query_map([stored(MAX_ALERTS as u64)], |row| row.get::<_, String>(0))?;
    let mut alerts: Vec<Alert> = Vec::new();
    for body in bodies {
        match serde_json::from_str(&body?) {
            Ok(alert) => alerts.push(alert),
            Err(error) => tracing::warn!("an alert of the history is left out: {error}"),
        }
    }
    alerts.sort_by_key(|alert| alert.id);
    Ok(alerts)
}

fn events(connection: &Connection, request: &HistoryRequest, now_ms: u64) -> rusqlite::Result<HistoryReply> {
    let HistoryRequest::Events { place, limit, since_ms, robot, kinds, search } = request else {
        return Ok(HistoryReply::Events { now_ms, events: Vec::new(), more: false });
    };
    let (after, before, order) = match place {
        HistoryPlace::After(id) => (stored(*id), i64::MAX, "ASC"),
        HistoryPlace::Before(id) => (-1, stored(*id), "DESC"),
        HistoryPlace::Newest => (-1, i64::MAX, "DESC"),
    };
    let sql = format!(
        "SELECT id, at_ms, robot, kind, about, text FROM events \
         WHERE id > ?1 AND id < ?2 AND at_ms >= ?3 AND (?4 IS NULL OR robot = ?4) \
         AND (?5 = '' OR instr(?5, ',' || kind || ',')) \
         AND (?6 IS NULL OR instr(lower(text), lower(?6))) ORDER BY id {order} LIMIT ?7"
    );
    let kinds: String = kinds.iter().map(|kind| format!(",{},", kind.as_str())).collect();
    let limit = *limit as usize;
    let mut statement = connection.prepare(&sql)?;
    let rows = statement.query_map(
        params![
            after,
            before,
            stored(since_ms.unwrap_or(0)),
            robot.as_ref().map(Name::as_str),
            kinds,
            search,
            stored(limit as u64 + 1)
        ],
        event,
    )?;
    let mut events = rows.collect::<rusqlite::Result<Vec<HistoryEvent>>>()?;
    let more = events.len() > limit;
    events.truncate(limit);
    if order == "DESC" {
        events.reverse();
    }
    Ok(HistoryReply::Events { now_ms, events, more })
}

fn event(row: &Row<'_>) -> rusqlite::Result<HistoryEvent> {
    let kind: String = row.get(3)?;
    let kind = HistoryKind::ALL.into_iter().find(|known| known.as_str() == kind);
    Ok(HistoryEvent {
        id: number(row.get(0)?),
        at_ms: number(row.get(1)?),
        robot: row.get::<_, Option<String>>(2)?.map(|text| name(2, &text)).transpose()?,
        kind: kind.ok_or_else(|| unreadable(3, "unknown kind of event".into()))?,
        about: row.get(4)?,
        text: row.get(5)?,
    })
}

fn name(column: usize, text: &str) -> rusqlite::Result<Name> {
    Name::new(text).map_err(|error| unreadable(column, error.into()))
}

fn unreadable(column: usize, error: Box<dyn std::error::Error + Send + Sync>) -> rusqlite::Error {
    rusqlite::Error::FromSqlConversionFailure(column, Type::Text, error)
}

fn report(connection: &Connection, from_ms: u64, to_ms: u64) -> rusqlite::Result<Vec<RobotReport>> {
    let within = [stored(from_ms), stored(to_ms)];
    let mut statement = connection.prepare(
        "SELECT robot, heard_s, active_s, driving_s, driven_m, done, failed, battery_min_v, battery_v \
         FROM samples WHERE from_ms >= ?1 AND from_ms < ?2 ORDER BY from_ms",
    )?;
    let mut robots: BTreeMap<Name, RobotReport> = BTreeMap::new();
    let mut rows = statement.query(within)?;
    while let Some(row) = rows.next()? {
        let piece = piece(row)?;
        match robots.get_mut(&piece.robot) {
            Some(whole) => add(whole, &piece),
            None => drop(robots.insert(piece.robot.clone(), piece)),
        }
    }
    let mut statement = connection.prepare(
        "SELECT robot, reason, sum(count) FROM stops WHERE from_ms >= ?1 AND from_ms < ?2 \
         GROUP BY robot, reason ORDER BY sum(count) DESC, reason",
    )?;
    let mut rows = statement.query(within)?;
    while let Some(row) = rows.next()? {
        let robot = name(0, &row.get::<_, String>(0)?)?;
        if let Some(report) = robots.get_mut(&robot) {
            report.stops.push(StopCount { reason: row.get(1)?, count: number(row.get(2)?) });
        }
    }
    Ok(robots.into_values().collect())
}

fn piece(row: &Row<'_>) -> rusqlite::Result<RobotReport> {
    Ok(RobotReport {
        robot: name(0, &row.get::<_, String>(0)?)?,
        heard_s: row.get(1)?,
        active_s: row.get(2)?,
        driving_s: row.get(3)?,
        driven_m: row.get(4)?,
        done: number(row.get(5)?),
        failed: number(row.get(6)?),
        stops: Vec::new(),
        battery_min_v: row.get(7)?,
        battery_v: row.get(8)?,
    })
}

/// Adds a later piece.
fn add(whole: &mut RobotReport, piece: &RobotReport) {
    whole.heard_s += piece.heard_s;
    whole.active_s += piece.active_s;
    whole.driving_s += piece.driving_s;
    whole.driven_m += piece.driven_m;
    whole.done += piece.done;
    whole.failed += piece.failed;
    let least = [whole.battery_min_v, piece.battery_min_v].into_iter().flatten().reduce(f64::min);
    whole.battery_min_v = least;
    whole.battery_v = piece.battery_v.or(whole.battery_v);
}

/// A day of this computer's time zone: its date, its first moment and that of the next one, in ms since 1970. `None` =
/// today. SQLite knows the time zone.
///
/// # Errors
/// [`ErrorKind::Invalid`]: no day, as in 2026-11-26.
pub fn local_day(day: Option<&str>) -> Result<(String, u64, u64)> {
    let day = day.unwrap_or("today");
    let (text, named) = match day {
        "today" => ("date('now', 'localtime')", true),
        "yesterday" => ("date('now', 'localtime', '-1 day')", true),
        _ => ("date(?1)", false),
    };
    let sql = format!(
        "SELECT {text}, unixepoch({text}, 'utc'), unixepoch({text}, '+1 day', 'utc') WHERE ?1 IS NOT NULL"
    );
    let found = Connection::open_in_memory().and_then(|sqlite| {
        sqlite.query_row(&sql, [day], |row| {
            Ok((row.get(0)?, number(row.get(1)?) * 1000, number(row.get(2)?) * 1000))
        })
    });
    // It takes the 31st of any month, and moments of a day too.
    found.ok().filter(|(date, ..): &(String, u64, u64)| named || date == day).ok_or_else(|| {
        Error::new(ErrorKind::Invalid, format!("{day:?} is no day")).hint("such as 2026-11-26 or yesterday")
    })
}
