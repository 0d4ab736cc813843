//! Arguments of `plan`.

use super::values::seconds;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

const PLAN_HELP: &str = "\
An instance names a world file in the same folder, and robots with start and goal (x, y in m, yaw in rad):

  world: lab.toml
  agents:
    - {name: xtb-1, start: [0, 0, 1.57], goal: [0, 6, 1.57]}
  speed_m_s: 0.35     # default
  clearance_m: 0.05   # default; between robots, and to walls
  look_out_m: 0.27    # default; kept free in front of both bumpers

The schedule has a row {x, y, yaw, t} for each step (t in s; in steps for CL-MAPF instances); between two \
rows a robot drives one arc or waits. It is checked again before it is written. Exit code 1: no schedule was \
found; the message names the robots that block each other.";

/// Arguments of `plan`.
#[derive(Debug, Clone, Args)]
#[command(after_help = PLAN_HELP)]
pub struct PlanArgs {
    /// Instance to plan: a CL-MAPF instance, or a world with robots (YAML).
    #[arg(value_name = "INSTANCE")]
    pub instance: PathBuf,
    /// Write the schedule (YAML) to this file.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Time limit, in s.
    #[arg(long, value_name = "SECONDS", default_value = "20", value_parser = seconds)]
    pub time_limit: Duration,
    /// Draw the schedule (SVG) to this file.
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Random seed.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}
