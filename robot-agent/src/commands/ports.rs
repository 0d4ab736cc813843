//! `ports`: this machine's serial ports.

use super::{Failure, columns, print, print_json};
use crate::cli::PortsArgs;
use robot_agent::hardware::ports;
use serde::Serialize;
use std::process::ExitCode;

/// What `--json` prints.
#[derive(Serialize)]
struct Listed<'a> {
    ports: &'a [ports::PortEntry],
}

pub(crate) fn run(args: &PortsArgs) -> Result<ExitCode, Failure> {
    let found = ports::list();
    if args.json {
        print_json(&Listed { ports: &found })?;
    } else {
        print(&table(&found))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn table(found: &[ports::PortEntry]) -> String {
    if found.is_empty() {
        return "no serial ports found\n".to_owned();
    }
    let mut rows = vec![["PORT", "FOR THE CONFIGURATION", "USE", "WHAT"].map(str::to_owned).to_vec()];
    for port in found {
        let stable = port.stable_path.as_ref().unwrap_or(&port.path);
        rows.push(vec![port.path.clone(), stable.clone(), port.usage.to_string(), port.kind.to_string()]);
    }
    columns(&rows)
}
