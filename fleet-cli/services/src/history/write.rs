//! The thread that writes: many jobs to a commit, the oldest rows go first.

use super::{ActivitySample, HistoryRow, Job, MAX_TEXT, PIECE_MS, Retention, Shared, stored};
use rusqlite::{Connection, Transaction, params};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};
use xtb_protocol::Name;
use xtb_protocol::messages::{Alert, MAX_ALERTS};

/// Jobs of one commit at most.
const GROUP: usize = 512;
/// Bounds are looked after this often, and at the start.
const PRUNE_EVERY: Duration = Duration::from_secs(600);
/// And after so many rows, however soon.
const PRUNE_ROWS: u64 = 10_000;
const DAY_MS: u64 = 24 * 3600 * 1000;

pub(super) struct Writer {
    connection: Connection,
    bounds: Retention,
    shared: Arc<Shared>,
    pruned: Option<Instant>,
    rows: u64,
    complained: bool,
}

impl Writer {
    pub(super) fn new(connection: Connection, bounds: Retention, shared: Arc<Shared>) -> Self {
        Self { connection, bounds, shared, pruned: None, rows: 0, complained: false }
    }

    /// Until nobody has anything to write any more.
    pub(super) fn run(&mut self, waiting: &Receiver<Job>) {
        while let Ok(first) = waiting.recv() {
            let group: Vec<Job> = std::iter::once(first).chain(waiting.try_iter().take(GROUP - 1)).collect();
            let rows = group.len() as u64;
            match self.write(&group) {
                Ok(()) => {
                    self.shared.written.fetch_add(rows, Ordering::Relaxed);
                    self.rows += rows;
                    self.complained = false;
                }
                Err(error) => {
                    self.shared.failed.fetch_add(rows, Ordering::Relaxed);
                    self.complain("written", &error);
                }
            }
            let due = self.pruned.is_none_or(|at| at.elapsed() >= PRUNE_EVERY) || self.rows >= PRUNE_ROWS;
            if due && let Err(error) = self.prune(crate::dispatch::store::wall_ms()) {
                self.complain("shortened", &error);
            }
        }
    }

    fn complain(&mut self, what: &str, error: &rusqlite::Error) {
        if !std::mem::replace(&mut self.complained, true) {
            let path = self.connection.path().map(Path::new).unwrap_or(Path::new("?")).display();
            tracing::warn!("the history {path} cannot be {what}: {error}");
        }
    }

    fn write(&mut self, group: &[Job]) -> rusqlite::Result<()> {
        let transaction = self.connection.transaction()?;
        for job in group {
            match job {
                Job::Event(row) => event(&transaction, row)?,
                Job::Samples { at_ms, samples } => {
                    for (robot, done) in samples {
                        sample(&transaction, at_ms / PIECE_MS * PIECE_MS, robot, done)?;
                    }
                }
                Job::Alert(one) => alert(&transaction, one)?,
            }
        }
        transaction.commit()
    }

    /// What is too old goes, and, while the file is too large, the oldest tenth of what is left.
    pub(super) fn prune(&mut self, now_ms: u64) -> rusqlite::Result<()> {
        (self.pruned, self.rows) = (Some(Instant::now()), 0);
        let oldest = stored(now_ms.saturating_sub(u64::from(self.bounds.keep_days) * DAY_MS));
        self.connection.execute("DELETE FROM events WHERE at_ms < ?1", [oldest])?;
        self.connection.execute("DELETE FROM samples WHERE from_ms < ?1", [oldest])?;
        self.connection.execute("DELETE FROM stops WHERE from_ms < ?1", [oldest])?;
        // One that is open is not forgotten, however old: what failed once is told only once.
        let kept = "DELETE FROM alerts WHERE id <= (SELECT max(id) FROM alerts) - ?1 \
                    AND json_extract(body, '$.ended_ms') IS NOT NULL";
        self.connection.execute(kept, [stored(MAX_ALERTS as u64)])?;
        let max_bytes = u64::from(self.bounds.max_mib) << 20;
        while self.bytes()? > max_bytes {
            let gone = self.connection.execute(
                "DELETE FROM events WHERE id <= \
                 (SELECT id FROM events ORDER BY id LIMIT 1 OFFSET (SELECT count(*) / 10 FROM events))",
                [],
            )?;
            let pieces = "DELETE FROM samples WHERE from_ms = (SELECT min(from_ms) FROM samples)";
            if gone == 0 && self.connection.execute(pieces, [])? == 0 {
                break;
            }
            let stops = "DELETE FROM stops WHERE from_ms < (SELECT min(from_ms) FROM samples)";
            self.connection.execute(stops, [])?;
        }
        // It gives back a page with each row.
        let mut vacuum = self.connection.prepare("PRAGMA incremental_vacuum")?;
        let mut rows = vacuum.query([])?;
        while rows.next()?.is_some() {}
        Ok(())
    }

    /// What is in use of the file.
    fn bytes(&self) -> rusqlite::Result<u64> {
        let pragma = |name| {
            self.connection.pragma_query_value(None, name, |row| row.get::<_, i64>(0)).map(super::number)
        };
        Ok((pragma("page_count")?.saturating_sub(pragma("freelist_count")?)) * pragma("page_size")?)
    }
}

fn event(transaction: &Transaction<'_>, row: &HistoryRow) -> rusqlite::Result<()> {
    let HistoryRow { at_ms, robot, kind, about, text, once } = row;
    let put = "INSERT OR IGNORE INTO events (at_ms, robot, kind, about, text, epoch, seq) \
               VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)";
    let text: String = match text.char_indices().find(|(at, _)| *at >= MAX_TEXT) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.clone(),
    };
    let (epoch, seq) = once.map(|(epoch, seq)| (epoch.cast_signed(), seq.cast_signed())).unzip();
    let robot = robot.as_ref().map(Name::as_str);
    let put = transaction.prepare(put)?.execute(params![
        stored(*at_ms),
        robot,
        kind.as_str(),
        about,
        text,
        epoch,
        seq
    ]);
    put.map(drop)
}

fn sample(
    transaction: &Transaction<'_>,
    from_ms: u64,
    robot: &Name,
    done: &ActivitySample,
) -> rusqlite::Result<()> {
    let put = "INSERT INTO samples VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10) \
               ON CONFLICT (from_ms, robot) DO UPDATE SET \
               heard_s = heard_s + excluded.heard_s, active_s = active_s + excluded.active_s, \
               driving_s = driving_s + excluded.driving_s, driven_m = driven_m + excluded.driven_m, \
               done = done + excluded.done, failed = failed + excluded.failed, \
               battery_min_v = min(ifnull(battery_min_v, excluded.battery_min_v), \
                                   ifnull(excluded.battery_min_v, battery_min_v)), \
               battery_v = ifnull(excluded.battery_v, battery_v)";
    let (from_ms, robot) = (stored(from_ms), robot.as_str());
    transaction.prepare(put)?.execute(params![
        from_ms,
        robot,
        done.heard_s,
        done.active_s,
        done.driving_s,
        done.driven_m,
        stored(done.done),
        stored(done.failed),
        done.battery_min_v,
        done.battery_v
    ])?;
    let put = "INSERT INTO stops VALUES (?1, ?2, ?3, ?4) \
               ON CONFLICT (from_ms, robot, reason) DO UPDATE SET count = count + excluded.count";
    let mut put = transaction.prepare(put)?;
    for (reason, count) in &done.stops {
        put.execute(params![from_ms, robot, reason, stored(*count)])?;
    }
    Ok(())
}

fn alert(transaction: &Transaction<'_>, alert: &Alert) -> rusqlite::Result<()> {
    let body = serde_json::to_string(alert)
        .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))?;
    let put = "INSERT OR REPLACE INTO alerts (id, body) VALUES (?1, ?2)";
    transaction.prepare(put)?.execute(params![stored(alert.id), body]).map(drop)
}
