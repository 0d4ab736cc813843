//! The grammar of `fetch-log`.

use clap::Args;
use std::path::PathBuf;
use xtb_protocol::Name;

const HELP: &str = "\
What has come is kept in FILE.part, and the same command goes on where it was interrupted.

Examples:
  fleet-cli fetch-log xtb-1 --list
  fleet-cli fetch-log xtb-1                     # the newest one
  robot-agent replay xtb-1-20041201T120000Z.mcap";

/// Arguments of `fetch-log`.
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP)]
pub struct FetchLogArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Which recording, as `--list` shows it [default: the newest].
    #[arg(value_name = "RECORDING")]
    pub file: Option<String>,
    /// Show what the robot has.
    #[arg(long, conflicts_with_all = ["file", "out", "restart"])]
    pub list: bool,
    /// Where it goes [default: its own name, in this folder].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Begin anew, whatever was fetched before.
    #[arg(long)]
    pub restart: bool,
}
