//! `completions`: scripts for shells.

use crate::cli::{Cli, CompletionsArgs};
use crate::error::{Exit, Result};
use crate::output::Output;
use clap::CommandFactory;

/// Prints the script; needs neither config nor router.
///
/// # Errors
/// Nobody reads it.
pub fn run(out: Output, args: &CompletionsArgs) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "fleet-cli", &mut script);
    out.text(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Done)
}
