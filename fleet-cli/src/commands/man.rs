//! `man`: the manual pages, one for each command, from the texts of `--help`.

use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::Output;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind, Result};

/// Arguments of `man`.
#[derive(Debug, Clone, Args)]
pub struct ManArgs {
    /// Folder, created if missing, such as ~/.local/share/man/man1.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// Where the pages are.
#[derive(Debug, Serialize, JsonSchema)]
struct Written<'a> {
    folder: &'a Path,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Written<'_>>];

/// Writes the pages; needs neither config nor router.
///
/// # Errors
/// The folder cannot be written to.
pub fn run(out: Output, args: &ManArgs, grammar: clap::Command) -> Result<Exit> {
    let folder = &args.folder;
    let written = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(grammar, folder));
    written.map_err(|error| {
        let message = format!("cannot write manual pages to {}: {error}", folder.display());
        Error::new(ErrorKind::Failed, message).hint("give a folder with write permission")
    })?;
    out.result(&Written { folder }, |_| format!("manual pages written to {}", folder.display()))?;
    Ok(Exit::Done)
}
