//! The command line as a whole. Arguments of several verbs stand in `args`, a verb's own beside its body in
//! `commands`.

mod usage;

pub use usage::failure as usage_failure;

use crate::args::{GlobalArgs, IdentityArg};
use crate::commands::Verb;
use clap::parser::ValueSource;
use clap::{Arg, Command, CommandFactory, FromArgMatches, Parser};
use std::ffi::OsString;

/// Where routers listen.
const PORT: u16 = 7447;

const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    failed: refused, goal not reached, task failed or cancelled, contact, port in use …
  2    wrong usage or configuration; nothing was sent
  3    no router, robot or dispatcher answered, or the outcome is unknown
  4    name taken: another robot or simulator of this fleet uses it
  130  interrupted

JSON: with --json each result is one line on standard output, and so is an error:
  {\"error\":{\"code\":…,\"message\":…,\"hint\":…}}";

/// Drive, monitor, send and stop a fleet of XTB robots from one terminal.
#[derive(Debug, Parser)]
#[command(name = "fleet-cli", version, after_help = EXIT_CODES, infer_long_args = false)]
pub struct Cli {
    /// Options of every verb.
    #[command(flatten)]
    pub global: GlobalArgs,
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

impl Cli {
    /// Reads a command line, the program's name first.
    ///
    /// # Errors
    /// Wrong usage; and the texts of `--help` and `--version`, which clap treats alike.
    pub fn read(arguments: impl IntoIterator<Item = OsString>) -> Result<Self, clap::Error> {
        let arguments: Vec<OsString> = arguments.into_iter().map(shielded).collect();
        let mut command = with_negative_numbers(Self::command());
        if arguments.len() < 2 {
            command = command.help_template(usage::SHORT);
        }
        let read = command.try_get_matches_from_mut(arguments);
        let matches = read.map_err(|error| usage::clarified(error, &mut command))?;
        let mut cli = Self::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
        cli.global.connect_given = matches.value_source("connect") == Some(ValueSource::CommandLine);
        cli.global.identity_given = matches.value_source("identity") == Some(ValueSource::CommandLine);
        cli.global.connect.retain(|endpoint| !endpoint.is_empty());
        let tls = matches!(cli.global.identity, Some(IdentityArg::Folder(_)));
        for endpoint in &mut cli.global.connect {
            *endpoint = whole(endpoint, if tls { "tls" } else { "tcp" });
        }
        Ok(cli)
    }

    /// Whether the verb draws on the whole terminal for as long as it runs.
    #[must_use]
    pub fn takes_screen(&self) -> bool {
        match &self.verb {
            Verb::Top(_) => true,
            Verb::Play(args) => args.dashboard.is_none() && !args.lines && !self.global.json,
            _ => false,
        }
    }
}

/// `10.0.0.1` → `tcp/10.0.0.1:7447`: where only a computer is named, the usual protocol and port are meant.
fn whole(endpoint: &str, protocol: &str) -> String {
    if endpoint.contains('/') {
        return endpoint.to_owned();
    }
    let has_port = endpoint.rsplit_once(':').is_some_and(|(host, port)| {
        port.parse::<u16>().is_ok() && (!host.contains(':') || host.ends_with(']'))
    });
    if has_port { format!("{protocol}/{endpoint}") } else { format!("{protocol}/{endpoint}:{PORT}") }
}

/// A negative number is a value, so that each option itself can say why it is none of its own.
fn with_negative_numbers(command: Command) -> Command {
    let takes = |arg: Arg| {
        let takes = arg.get_action().takes_values();
        if takes { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(takes).mut_subcommands(with_negative_numbers)
}

/// clap takes `-1,0` for an option. A blank in front makes it a value, and points are read without it.
fn shielded(argument: OsString) -> OsString {
    let is_point = argument.to_str().is_some_and(|text| {
        let digits = text.strip_prefix('-').unwrap_or_default();
        digits.contains(',') && digits.starts_with(|c: char| c.is_ascii_digit() || c == '.')
    });
    if !is_point {
        return argument;
    }
    let mut shielded = OsString::from(" ");
    shielded.push(argument);
    shielded
}

#[cfg(test)]
mod tests;
