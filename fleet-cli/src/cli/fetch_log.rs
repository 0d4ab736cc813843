//! The grammar of `fetch-log`.

use clap::Args;
use std::path::PathBuf;
use xtb_protocol::Name;

const HELP: &str = "\
Data received so far is kept in FILE.part; the same command resumes an interrupted download.

Examples:
  fleet-cli fetch-log xtb-1 --list
  fleet-cli fetch-log xtb-1                     # the newest recording
  robot-agent replay xtb-1-20041201T120000Z.mcap";

/// Arguments of `fetch-log`.
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP)]
pub struct FetchLogArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Recording, as listed by `--list` [default: the newest].
    #[arg(value_name = "RECORDING")]
    pub file: Option<String>,
    /// List the robot's recordings.
    #[arg(long, conflicts_with_all = ["file", "out", "restart"])]
    pub list: bool,
    /// Output file [default: the recording's name, in this folder].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Download from the start, even if part of it is here already.
    #[arg(long)]
    pub restart: bool,
}
