//! Arguments of `plan`.

use super::values::seconds;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

const PLAN_HELP: &str = "\
An instance of our own names a world beside it and robots with start and goal (x, y in m, yaw in rad):

  world: lab.toml
  agents:
    - {name: xtb-1, start: [0, 0, 1.57], goal: [0, 6, 1.57]}
  speed_m_s: 0.35     # default
  clearance_m: 0.05   # default; between robots, and from walls
  look_out_m: 0.27    # default; kept free before both bumpers

The schedule has a row {x, y, yaw, t} for each step (t in s; in steps for CL-MAPF instances), between two \
rows a robot drives one arc or waits. It is checked once more before it is written. Exit code 1: none was \
found, and which robots were in each other's way.";

/// Arguments of `plan`.
#[derive(Debug, Clone, Args)]
#[command(after_help = PLAN_HELP)]
pub struct PlanArgs {
    /// What to plan: a CL-MAPF instance, or a world with robots (YAML).
    #[arg(value_name = "INSTANCE")]
    pub instance: PathBuf,
    /// Where to write the schedule (YAML).
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Give up after this long, in s.
    #[arg(long, value_name = "SECONDS", default_value = "20", value_parser = seconds)]
    pub time_limit: Duration,
    /// Draw the schedule (SVG).
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}
