//! The grammar of the terminal cockpit.

use clap::Args;
use xtb_protocol::Name;

const TOP_HELP: &str = "\
? shows the keys. s stops the selected robot, S all; e and E call the emergency stop. None of them needs a \
second key, and S and E reach all robots of the fleet, shown or not. Leaving stops the robot that is driven.

Without UTF-8 in the locale everything is drawn in ASCII; NO_COLOR, --color never and a monochrome TERM draw \
without colours.

Example: fleet-cli top xtb-1 xtb-2";

/// Arguments of `top`.
#[derive(Debug, Clone, Args)]
#[command(after_help = TOP_HELP)]
pub struct TopArgs {
    /// Robots to show [default: all].
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// Only look: nothing is sent to robots.
    #[arg(long)]
    pub read_only: bool,
    /// Draw in ASCII, whatever the locale says.
    #[arg(long)]
    pub ascii: bool,
}
