//! `dispatch compact`: one snapshot in place of all that the ledger holds.

use crate::commands::dispatch::LedgerArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::{LedgerEntry, Record, TaskStore};
use xtb_services::dispatch::store::{self, Store};

/// Arguments of `dispatch compact`.
#[derive(Debug, Clone, Args)]
pub struct DispatchCompactArgs {
    /// Which ledger.
    #[command(flatten)]
    pub ledger: LedgerArgs,
}

/// What it came to.
#[derive(Debug, Serialize, JsonSchema)]
struct Compacted {
    ledger: String,
    records: usize,
    tasks: usize,
    open: usize,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Compacted>];

/// Compacts it.
///
/// # Errors
/// There is none, a dispatcher holds it, it is a stand-by's, it is damaged, or the disk is full: nothing is changed
/// then.
pub(super) fn run(ctx: &Context, args: &DispatchCompactArgs) -> Result<Exit> {
    let path = store::path(args.ledger.ledger.as_deref(), &ctx.settings.fleet)?;
    if !path.exists() {
        return Err(Error::new(ErrorKind::Config, format!("no ledger at {}", path.display()))
            .hint("give one with --ledger"));
    }
    let store = Store::open(&path, &ctx.settings.fleet)?;
    store.no_copy()?;
    let Store { mut ledger, entries, .. } = store;
    let (records, n) = (entries.len(), ledger.last_seq() + 1);
    let keep = xtb_dispatch::DispatcherSettings::default().keep_ended;
    let book = TaskStore::replay(keep, entries).map_err(|error| store::unreadable(&path, &error))?;
    let compacted = Compacted {
        ledger: path.display().to_string(),
        records,
        tasks: book.tasks().count(),
        open: book.open_count(),
    };
    let record = Record::Snapshot(Box::new(book));
    let v = record.version();
    ledger.compact(&LedgerEntry { v, n, at_ms: store::wall_ms(), record })?;
    ctx.out.result(&compacted, |Compacted { ledger, records, tasks, open }| {
        format!("{ledger}: {records} records compacted to one, with {tasks} tasks, {open} of them open")
    })?;
    Ok(Exit::Done)
}
