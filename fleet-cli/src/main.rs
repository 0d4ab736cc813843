//! The `fleet-cli` binary: arguments, runtime, logging; everything else is in the library.

use fleet_cli::{Cli, Exit};
use std::io::IsTerminal;
use std::process::ExitCode;
use std::time::Duration;

/// Zenoh's blocking tasks may hold a runtime for seconds; nobody waits for that.
const LEAVE_WITHIN: Duration = Duration::from_millis(200);

fn main() -> ExitCode {
    let exit = match Cli::read(std::env::args_os()) {
        Ok(cli) => run(cli),
        Err(error) => fleet_cli::usage(&error),
    };
    ExitCode::from(exit.code())
}

fn run(cli: Cli) -> Exit {
    // A line of a log in the middle of a picture helps nobody.
    if !(cli.takes_screen() && std::io::stderr().is_terminal()) {
        log_to_stderr();
    }
    match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
        Ok(runtime) => {
            let exit = runtime.block_on(fleet_cli::run(cli));
            runtime.shutdown_timeout(LEAVE_WITHIN);
            exit
        }
        Err(error) => {
            tracing::error!("cannot start the runtime: {error}");
            Exit::Failed
        }
    }
}

/// `RUST_LOG` overrides. Zenoh's own warnings would only repeat what commands say in clearer words.
fn log_to_stderr() {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| {
        tracing_subscriber::EnvFilter::new("warn,zenoh=off,zenoh_transport=off,zenoh_link=off")
    });
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
}
