//! `audit`: who commanded what and when, by name, from recordings and ledgers.

mod command;
mod ledger;
mod recording;

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use crate::table::{Table, TableCell};
use crate::values::moment;
use clap::Args;
use command::Command;
use std::path::PathBuf;
use std::time::SystemTime;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_services::dispatch::store;

const AUDIT_HELP: &str = "\
A client of alice is alice or alice-3f9a1c: --client alice shows all of them. With identities the router lets \
nobody use the name of another; without them a name is what its client says.

Examples:
  fleet-cli audit --since 24h
  fleet-cli audit lab-1700000000.mcap --robot xtb-1
  fleet-cli fetch-log xtb-1 --out run.mcap; fleet-cli audit run.mcap
  fleet-cli audit lab-1700000000.mcap --ledger ~/.local/share/xtb/lab.ledger --client alice --json";

/// Arguments of `audit`.
#[derive(Debug, Clone, Args)]
#[command(after_help = AUDIT_HELP)]
pub struct AuditArgs {
    /// Recordings: of the fleet, written by `record`, or a robot's own (`fetch-log`).
    #[arg(value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Ledger of the dispatcher; for several, repeat it [default: that of the fleet, if no FILE is given].
    #[arg(long, value_name = "FILE")]
    pub ledger: Vec<PathBuf>,
    /// Only what this client commanded, or a session of this person.
    #[arg(long, value_name = "NAME")]
    pub client: Option<Name>,
    /// Only what this robot was commanded.
    #[arg(long, value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Option<Name>,
    /// Only from then on: a time such as 2026-11-24T08:00:00Z, or how long ago, such as 24h.
    #[arg(long, value_name = "TIME", value_parser = moment)]
    pub since: Option<SystemTime>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Command>];

/// Prints the commands of all files, the oldest first.
///
/// # Errors
/// Neither file nor ledger, or one that cannot be read.
pub fn run(ctx: &Context, args: &AuditArgs) -> Result<Exit> {
    let mut ledgers = args.ledger.clone();
    if args.files.is_empty() && ledgers.is_empty() {
        let path = store::path(None, &ctx.settings.fleet)?;
        if !path.exists() {
            return Err(Error::new(
                ErrorKind::Invalid,
                format!("no recording is given, and no ledger is at {}", path.display()),
            )
            .hint("give a FILE written by `fleet-cli record`, or --ledger FILE"));
        }
        ledgers.push(path);
    }
    let mut commands = Vec::new();
    for file in &args.files {
        commands.extend(recording::commands(file, |words| ctx.out.note(&words))?);
    }
    for ledger in &ledgers {
        commands.extend(ledger::commands(ledger, |words| ctx.out.note(&words))?);
    }
    commands.retain(|command| wanted(command, args));
    commands.sort_by_key(|command| command.at_ms);
    show(ctx.out, &commands)?;
    Ok(Exit::Done)
}

fn wanted(command: &Command, args: &AuditArgs) -> bool {
    let by = |client: &Name| command.by.as_deref().is_some_and(|who| is_of(who, client));
    let to = |robot: &Name| command.robot.as_ref() == Some(robot);
    args.client.as_ref().is_none_or(by)
        && args.robot.as_ref().is_none_or(to)
        && args.since.is_none_or(|since| command.at() >= since)
}

/// Whether it is this client, or one of its sessions.
fn is_of(who: &str, client: &Name) -> bool {
    let session = |who: &str| {
        who.strip_prefix(client.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
    };
    // Of a person who signed in to the page.
    session(who) || who.strip_prefix("web-").is_some_and(session)
}

fn show(out: Output, commands: &[Command]) -> Result<()> {
    if out.json {
        return commands.iter().try_for_each(|command| out.line(command));
    }
    if commands.is_empty() {
        return out.text("no commands");
    }
    let mut table = Table::new(&["time", "who", "robot", "what", "result"]);
    for command in commands {
        let who = command.by.as_deref().unwrap_or("unknown");
        table.row(vec![
            TableCell::new(command.time(), Tone::Dim),
            TableCell::new(who, Tone::Strong),
            TableCell::new(command.robot.as_ref().map_or("-", Name::as_str), Tone::Plain),
            TableCell::new(command.text.as_str(), Tone::Plain),
            TableCell::new(command.result.as_deref().unwrap_or("-"), Tone::Plain),
        ]);
    }
    out.text(table.render(&out).trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;

    #[test]
    fn a_person_has_sessions_and_no_other_person() {
        for (who, is) in [
            ("alice", true),
            ("alice-3f9a1c", true),
            ("web-alice-3f9a1c", true),
            ("alicex", false),
            ("web-3f9a1c", false),
            ("bob", false),
        ] {
            assert_eq!(is_of(who, &name("alice")), is, "{who}");
        }
    }

    #[test]
    fn a_time_is_a_moment_or_how_long_ago() {
        assert!(moment("2026-11-24T08:00:00Z").is_ok() && moment("24h").unwrap() < SystemTime::now());
        assert!(moment("yesterday").unwrap_err().contains("24h"));
    }
}
