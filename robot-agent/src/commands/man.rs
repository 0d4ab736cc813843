//! `man`: the manual pages, one for each command, from the texts of `--help`.

use super::Failure;
use std::path::Path;
use std::process::ExitCode;

pub(crate) fn run(grammar: clap::Command, folder: &Path) -> Result<ExitCode, Failure> {
    let written = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(grammar, folder));
    written.map_err(|error| {
        let message = format!("cannot write manual pages to {}: {error}", folder.display());
        Failure::new(message, "give a folder with write permission")
    })?;
    Ok(ExitCode::SUCCESS)
}
