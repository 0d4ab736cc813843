//! The grammar of what stands in for a lab: a router, simulated robots, the demo.

use super::DEFAULT_ENDPOINT;
use super::values::{drop_outs, fix_noise, fix_rate, part};
use clap::Args;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Arguments of `router`.
#[derive(Debug, Clone, Args)]
pub struct RouterArgs {
    /// Endpoint to listen on; port 0 picks a free port.
    #[arg(long, value_name = "ENDPOINT", default_value = DEFAULT_ENDPOINT)]
    pub listen: String,
}

/// Arguments of `sim`.
#[derive(Debug, Clone, Args)]
pub struct SimArgs {
    /// Number of robots: xtb-1 … xtb-N.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub robots: usize,
    /// World (TOML) [default: an empty room].
    #[arg(long, value_name = "FILE")]
    pub world: Option<PathBuf>,
    /// Vehicle settings of the trucks, such as configs/vehicles/long.toml; `vehicles` in the world file take
    /// precedence [default: the XTB].
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<PathBuf>,
    /// Random seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Speed factor relative to real time.
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    pub speed: f64,
    /// Stop with exit code 1 when the simulation runs slower than 0.9 of --speed: the computer is too slow
    /// for it. Without this the simulator only prints a warning; its robots run in simulated time, clients do
    /// not.
    #[arg(long)]
    pub strict: bool,
    /// Endpoint of its router [default: tcp/127.0.0.1:7447]; with --connect it runs no router.
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Option<String>,
    /// Start no agents; create two serial ports for each truck instead: DIR/ROBOT.board and DIR/ROBOT.gyro.
    #[arg(long, value_name = "DIR")]
    pub pty: Option<PathBuf>,
    /// Write the ground truth to this file at board rate, as JSON lines.
    #[arg(long, value_name = "FILE")]
    pub truth_log: Option<PathBuf>,
    /// Record every sample, command and decision of each robot to DIR/ROBOT-….mcap.
    #[arg(long, value_name = "DIR", conflicts_with = "pty")]
    pub record: Option<PathBuf>,
    /// Also run a dispatcher (with traffic control), and print a summary for each robot at the end.
    #[arg(long)]
    pub dispatch: bool,
    /// The dispatcher's ledger [default: FLEET.ledger in $XDG_DATA_HOME/xtb/sim or ~/.local/share/xtb/sim].
    #[arg(long, value_name = "FILE", requires = "dispatch")]
    pub ledger: Option<PathBuf>,
    /// With --dispatch: start a new ledger; an existing one is kept as NAME.before-TIME.ledger.
    #[arg(long, requires = "dispatch")]
    pub fresh: bool,
    /// Stop when all tasks have ended (at least one); exit code 1 if a task failed or a truck had a contact.
    #[arg(long, requires = "dispatch")]
    pub until_done: bool,
    /// Also serve the dashboard [default: 127.0.0.1:8080].
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", value_parser = super::dashboard::address)]
    pub dashboard: Option<SocketAddr>,
    /// What measures the robots' poses.
    #[command(flatten)]
    pub fixes: FixArgs,
    /// Run a fault scenario of a virtual fleet, without router and agents: prints the events of the scenario
    /// of
    /// --seed, and whether a rule of docs/safety.md was broken.
    #[arg(long = "virtual", conflicts_with_all = ["robots", "world", "vehicle", "speed", "strict", "listen", "pty", "truth_log", "record", "dispatch", "dashboard"])]
    pub virtual_day: bool,
}

/// A simulated tracker that measures where the robots are.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Pose fixes")]
pub struct FixArgs {
    /// Pose fixes per second; 0 = none: odometry only, which drifts.
    #[arg(long = "fixes", value_name = "HZ", default_value_t = 2.0, value_parser = fix_rate)]
    pub rate_hz: f64,
    /// Standard deviation of the pose fixes, in m.
    #[arg(long = "fix-noise", value_name = "METRES", default_value_t = 0.05, value_parser = fix_noise)]
    pub noise_m: f64,
    /// Fraction of pose fixes that are outliers, 0 to 1.
    #[arg(long = "fix-outliers", value_name = "FRACTION", default_value_t = 0.0, value_parser = part)]
    pub outliers: f64,
    /// Mean time between drop-outs of the pose fixes (about 5 s each), in s; 0 = none.
    #[arg(long = "fix-drop-outs", value_name = "SECONDS", default_value_t = 0.0, value_parser = drop_outs)]
    pub drop_out_every_s: f64,
}

impl FixArgs {
    /// As the simulator takes it.
    #[must_use]
    pub fn truth(self) -> xtb_sim::fixes::FixTruth {
        let Self { rate_hz, noise_m, outliers, drop_out_every_s } = self;
        xtb_sim::fixes::FixTruth { rate_hz, noise_m, outliers, drop_out_every_s, ..Default::default() }
    }
}

/// Arguments of `demo`.
#[derive(Debug, Clone, Args)]
pub struct DemoArgs {
    /// No live picture.
    #[arg(long)]
    pub headless: bool,
    /// Number of robots.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub robots: usize,
    /// Random seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Speed factor relative to real time.
    #[arg(long, value_name = "X", default_value_t = 4.0)]
    pub speed: f64,
    /// Goals per robot.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub goals: usize,
    /// Endpoint of its router; port 0 picks a free port.
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:0")]
    pub listen: String,
}
