//! The grammar of the terminal cockpit.

use clap::Args;
use xtb_protocol::Name;

const TOP_HELP: &str = "\
? shows the keys. s stops the selected robot, S all robots; e and E trigger the emergency stop for one or \
all. None of them asks for confirmation, and S and E act on all robots of the fleet, shown or not. Quitting \
stops the robot that is being driven.

Without UTF-8 in the locale the screen is drawn in ASCII; NO_COLOR, --color never and a monochrome TERM \
switch colours off.

Example: fleet-cli top xtb-1 xtb-2";

/// Arguments of `top`.
#[derive(Debug, Clone, Args)]
#[command(after_help = TOP_HELP)]
pub struct TopArgs {
    /// Robots to show [default: all].
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// View only: nothing is sent to robots.
    #[arg(long)]
    pub read_only: bool,
    /// Draw in ASCII, regardless of the locale.
    #[arg(long)]
    pub ascii: bool,
}
