//! The `fleet-cli` binary: arguments, runtime, logging; everything else is in the library.

use fleet_cli::{Cli, Exit};
use robot_agent::logging;
use std::io::IsTerminal;
use std::process::ExitCode;
use std::time::Duration;

/// Zenoh's blocking tasks may hold a runtime for seconds; nobody waits for that.
const LEAVE_WITHIN: Duration = Duration::from_millis(200);

/// Zenoh's own warnings would only repeat what commands say in clearer words.
const USUAL_LOG: &str = "warn,zenoh=off,zenoh_transport=off,zenoh_link=off";

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
        logging::start(cli.global.log_format, USUAL_LOG);
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
