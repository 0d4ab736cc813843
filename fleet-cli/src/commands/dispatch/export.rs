//! `dispatch export`: a ledger's records as JSON lines, as far as they can be read.

use crate::commands::dispatch::LedgerArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use xtb_client::{Error, ErrorKind, Result};
use xtb_services::dispatch::store;
use xtb_services::ledger;

const EXPORT_HELP: &str = "\
Each line is one record of the ledger: {\"seq\", \"at_ms\", \"snapshot\", \"intact\", \"record\"}. If the \
ledger is damaged, standard error describes the damage, and the exit code is 1.";

/// Arguments of `dispatch export`.
#[derive(Debug, Clone, Args)]
#[command(after_help = EXPORT_HELP)]
pub struct DispatchExportArgs {
    /// Which ledger.
    #[command(flatten)]
    pub ledger: LedgerArgs,
}

/// One record.
#[derive(Debug, Serialize, JsonSchema)]
struct Line {
    seq: u64,
    at_ms: i64,
    snapshot: bool,
    intact: bool,
    /// As it was written; a text where it is no JSON any more.
    record: Value,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Line>];

/// Prints what can be read, and says what cannot.
///
/// # Errors
/// There is no ledger, or nothing of it can be read.
pub(super) fn run(ctx: &Context, args: &DispatchExportArgs) -> Result<Exit> {
    let path = store::path(args.ledger.ledger.as_deref(), &ctx.settings.fleet)?;
    if !path.exists() {
        return Err(Error::new(ErrorKind::Config, format!("no ledger at {}", path.display()))
            .hint("give one with --ledger"));
    }
    let reading = ledger::read(&path)?;
    for row in reading.rows {
        let record = serde_json::from_str(&row.body).unwrap_or(Value::String(row.body));
        let (seq, at_ms, snapshot, intact) = (row.seq, row.at_ms, row.snapshot, row.intact);
        ctx.out.line(&Line { seq, at_ms, snapshot, intact, record })?;
    }
    for damage in &reading.damage {
        ctx.out.note(&format!("damage: {damage}"));
    }
    Ok(if reading.damage.is_empty() { Exit::Done } else { Exit::Failed })
}
