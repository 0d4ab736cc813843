//! Arguments that several verbs share.
use clap::{ArgGroup, Args, ValueEnum};
use xtb_client::multi_robot::Targets;
use xtb_protocol::Name;
use xtb_protocol::messages::LinkLoss;

/// Whether a verb may take control from its holder.
#[derive(Debug, Clone, Copy, Args)]
pub struct LeaseArgs {
    /// Take control from another client; without this, a robot under another client's control refuses.
    #[arg(long)]
    pub take: bool,
}

/// Which robots are to stop.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("who").args(["robots", "all"]).required(true))]
pub struct WhoArgs {
    /// Robots.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// All robots of the roster and all others present.
    #[arg(long)]
    pub all: bool,
    /// Roster for --all, separated by commas [default: the config's or the simulator's].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot, requires = "all")]
    pub expect: Vec<Name>,
}

impl WhoArgs {
    /// Whom that means.
    #[must_use]
    pub fn targets(&self) -> Targets {
        match self.all {
            true => Targets::All { expect: self.expect.clone(), known: Vec::new() },
            false => Targets::Robots(self.robots.clone()),
        }
    }
}

/// What a robot does when it hears nothing more from whoever sent it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LinkLossArg {
    /// The robot stops; its task waits or goes to another robot.
    Halt,
    /// The robot continues to its current goal.
    Finish,
}

impl From<LinkLossArg> for LinkLoss {
    fn from(arg: LinkLossArg) -> Self {
        match arg {
            LinkLossArg::Halt => Self::Halt,
            LinkLossArg::Finish => Self::Finish,
        }
    }
}

