//! `export`: a recording of the fleet as tables, one for each type of message.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::recording::playback_worker::not_readable;
use clap::{ArgGroup, Args};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind, Result};
use xtb_recording::fleet::table::MessageTable;
use xtb_recording::fleet::{reader, schemas};

/// Arguments of `export`.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("format").required(true))]
pub struct ExportArgs {
    /// File written by `record`.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Write one table (CSV) for each message type: RobotState.csv …; texts like formulas get an apostrophe.
    #[arg(long, group = "format")]
    pub csv: bool,
    /// Folder for the tables [default: FILE without its extension].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overwrite existing tables.
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Exported {
    tables: BTreeMap<PathBuf, u64>,
    left_out: u64,
    cut: Option<String>,
}

struct Sheet {
    path: PathBuf,
    table: MessageTable,
    file: BufWriter<File>,
    rows: u64,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Exported>];

/// Writes the tables.
///
/// # Errors
/// A file that is no recording, a table that is there already, a full disk.
pub fn run(ctx: &Context, args: &ExportArgs) -> Result<Exit> {
    let folder = args.out.clone().unwrap_or_else(|| args.file.with_extension(""));
    let wrong = |error| not_readable(&args.file, &error);
    let (mut reader, _) = reader::begin(&args.file).map_err(wrong)?;
    let mut sheets: BTreeMap<String, Sheet> = BTreeMap::new();
    let mut left_out = 0;
    while let Some(message) = reader.next_message().map_err(wrong)? {
        if schemas::is_derived(&message.schema) {
            continue;
        }
        let (Some(schema), Ok(value)) = (schemas::of(&message.schema), serde_json::from_slice(&message.data))
        else {
            left_out += 1;
            continue;
        };
        if !sheets.contains_key(&message.schema) {
            let name = message.schema.trim_start_matches("xtb.");
            let path = folder.join(format!("{name}.csv"));
            let sheet =
                begin(&path, MessageTable::of(schema), args.force).map_err(|it| cannot_write(&path, &it))?;
            sheets.insert(message.schema.clone(), sheet);
        }
        if let Some(sheet) = sheets.get_mut(&message.schema) {
            let row = sheet.table.row(message.log_ns, &message.topic, &value);
            sheet.file.write_all(row.as_bytes()).map_err(|error| cannot_write(&sheet.path, &error))?;
            sheet.rows += 1;
        }
    }
    let mut tables = BTreeMap::new();
    for mut sheet in sheets.into_values() {
        sheet.file.flush().map_err(|error| cannot_write(&sheet.path, &error))?;
        tables.insert(sheet.path, sheet.rows);
    }
    let cut = reader.cut_because().map(str::to_owned);
    ctx.out.result(&Exported { tables, left_out, cut }, words)?;
    Ok(Exit::Done)
}

fn begin(path: &Path, table: MessageTable, force: bool) -> io::Result<Sheet> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let file = if force { File::create(path) } else { File::create_new(path) };
    let mut file = BufWriter::new(file?);
    file.write_all(table.header().as_bytes())?;
    Ok(Sheet { path: path.to_owned(), table, file, rows: 0 })
}

fn cannot_write(path: &Path, error: &io::Error) -> Error {
    match error.kind() {
        io::ErrorKind::AlreadyExists => {
            Error::new(ErrorKind::Invalid, format!("{} already exists", path.display()))
                .hint("choose another folder with --out, or overwrite it with --force")
        }
        _ => Error::new(ErrorKind::Failed, format!("cannot write {}: {error}", path.display())),
    }
}

fn words(exported: &Exported) -> String {
    let mut lines: Vec<String> =
        exported.tables.iter().map(|(path, rows)| format!("{}: {rows} rows", path.display())).collect();
    if exported.left_out > 0 {
        lines.push(format!("{} messages of unknown types skipped", exported.left_out));
    }
    if let Some(reason) = &exported.cut {
        lines.push(format!("the recording is incomplete: {reason}"));
    }
    lines.join("\n")
}
