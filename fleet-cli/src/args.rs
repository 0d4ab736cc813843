//! Arguments of all verbs, and of several.

use crate::robots::{self, RobotsWord};
use crate::values::seconds;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{ArgGroup, Args, ValueEnum};
use robot_agent::logging::LogFormat;
use std::path::PathBuf;
use std::time::Duration;
use xtb_client::multi_robot::Targets;
use xtb_client::{Client, Error, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::LinkLoss;

/// Options that stand before or after the verb.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Global options")]
pub struct GlobalArgs {
    /// Router to connect to; repeat it or separate several with commas [default: those of
    /// the identity, else tcp/127.0.0.1:7447].
    #[arg(long, global = true, env = "XTB_CONNECT", value_name = "ENDPOINT", value_delimiter = ',')]
    pub connect: Vec<String>,
    /// Whether `--connect` stands on the command line (not in the environment).
    #[arg(skip)]
    pub connect_given: bool,
    /// Fleet [default: that of the identity, else lab].
    #[arg(long, global = true, env = "XTB_FLEET", value_name = "NAME")]
    pub fleet: Option<Name>,
    /// Folder of the identity to use, or none [default: $XDG_CONFIG_HOME/xtb/identity or ~/.config/xtb/identity,
    /// if `fleet-cli enrol` has made it]. Fleet, name and routers follow from it.
    #[arg(long, global = true, env = "XTB_IDENTITY", value_name = "DIR|none", value_parser = IdentityArg::parser())]
    pub identity: Option<IdentityArg>,
    /// Whether `--identity` stands on the command line (not in the environment).
    #[arg(skip)]
    pub identity_given: bool,
    /// Print JSON, one line per result.
    #[arg(long, global = true)]
    pub json: bool,
    /// Fleet config (TOML) [default: $XDG_CONFIG_HOME/xtb/fleet.toml or ~/.config/xtb/fleet.toml, if
    /// present].
    #[arg(long, global = true, env = "XTB_CONFIG", value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Name of this client, shown as the controlling client of a robot [default: cli- or the identity's name-, and
    /// six random digits].
    #[arg(long, global = true, value_name = "NAME")]
    pub client: Option<Name>,
    /// Longest time to wait for a router or an answer, in s.
    #[arg(long, global = true, value_name = "SECONDS", default_value = "2", value_parser = seconds)]
    pub timeout: Duration,
    /// When to use colours.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    pub color: ColorChoice,
    /// Format of the log on standard error; XTB_LOG=debug makes it detailed.
    #[arg(long, global = true, value_name = "FORMAT", env = "XTB_LOG_FORMAT", default_value = "text")]
    pub log_format: LogFormat,
}

/// Which identity to use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum IdentityArg {
    /// None, also if this computer has one.
    None,
    /// The one in this folder.
    Folder(PathBuf),
}

impl IdentityArg {
    /// Empty means none too: `XTB_IDENTITY=`.
    fn parser() -> impl TypedValueParser<Value = Self> {
        OsStringValueParser::new().map(|text| match text.as_encoded_bytes() {
            b"" | b"none" => Self::None,
            _ => Self::Folder(text.into()),
        })
    }
}

/// When to use colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ColorChoice {
    /// On a terminal, unless NO_COLOR is set.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

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
    /// Robots; @TAG means all of the roster that have the tag.
    #[arg(value_name = "ROBOT", value_parser = RobotsWord::parse)]
    pub robots: Vec<RobotsWord>,
    /// All robots of the roster and all others present.
    #[arg(long)]
    pub all: bool,
    /// Roster for --all, separated by commas [default: the config's or the simulator's].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot, requires = "all")]
    pub expect: Vec<Name>,
}

impl WhoArgs {
    /// The robots that are named, where there are tags besides: those need not wait for the roster.
    pub(crate) fn at_once(&self) -> Option<Targets> {
        let named = robots::named(&self.robots);
        (named.tags && !named.names.is_empty()).then_some(Targets::Robots(named.names))
    }

    /// Whom that means, and which tag nobody has: the others are not left alone because of it.
    ///
    /// # Errors
    /// Nobody is meant, or the roster could not be asked for.
    pub(crate) async fn targets(&self, client: &Client) -> Result<(Targets, Option<Error>)> {
        if self.all {
            return Ok((Targets::All { expect: self.expect.clone(), known: Vec::new() }, None));
        }
        let meant = robots::meant(client, &self.robots).await;
        match meant.unknown {
            Some(error) if meant.names.is_empty() => Err(error),
            unknown => Ok((Targets::Robots(meant.names), unknown)),
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
