//! The operator's command line: everything that people use of the fleet.
//!
//! The path of a goal (docs/paths.md) begins here: `commands/goto.rs` → `commands/goal.rs` → `xtb-client`.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod args;
pub mod cli;
pub mod commands;
pub mod config;
pub mod context;
pub mod exit;
pub mod interrupt;
mod json;
mod map_file;
mod nearest;
pub mod output;
pub mod pki;
pub mod point;
pub mod recording;
pub mod robots;
mod spread;
pub mod table;
pub mod terminal;
mod text;
pub mod tui;
mod values;
pub mod vehicle_file;

pub use cli::Cli;
pub use context::Context;
pub use exit::Exit;
pub use output::Output;

use clap::CommandFactory as _;
use std::pin::Pin;

/// Carries out one command line and says how it ended. Boxed, so that it is compiled here, and not once more in the
/// program.
#[must_use]
pub fn run(cli: Cli) -> Pin<Box<dyn Future<Output = Exit>>> {
    Box::pin(carry_out(cli))
}

async fn carry_out(cli: Cli) -> Exit {
    let out = Output::new(cli.global.json, cli.global.color);
    match commands::run(cli.verb, &cli.global, Cli::command(), out).await {
        Ok(exit) => exit,
        Err(failure) => {
            out.failure(&failure);
            Exit::from(failure.kind)
        }
    }
}

/// Wrong usage, `--help` or `--version`: says it, as JSON if the command line asks for that.
pub fn usage(error: &clap::Error) -> Exit {
    let json = error.use_stderr() && std::env::args_os().any(|argument| argument == "--json");
    if json {
        Output { json, colors: false }.failure(&cli::usage_failure(error));
    } else {
        // clap knows where it belongs and how to paint it; a closed pipe is nobody's concern here.
        let _ = error.print();
    }
    if error.use_stderr() { Exit::Usage } else { Exit::Done }
}
