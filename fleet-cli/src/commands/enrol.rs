//! `enrol`: an identity file becomes this computer's identity.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use clap::Args;
use robot_agent::enrol::{self, EnrolOutcome, EnrolRefusal};
use std::path::PathBuf;
use std::time::SystemTime;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::Role;

const ENROL_HELP: &str = "\
From then on every command uses this identity: fleet, name and router follow from it. A renewed certificate is \
enrolled the same way; programs that run take it when they connect the next time. Robots are enrolled with \
`robot-agent enrol`.

Examples:
  fleet-cli enrol alice.xtbid --remove
  fleet-cli enrol dispatcher.xtbid --to /srv/xtb/dispatcher
  fleet-cli dispatch serve --identity /srv/xtb/dispatcher";

/// Arguments of `enrol`.
#[derive(Debug, Clone, Args)]
#[command(after_help = ENROL_HELP)]
pub struct EnrolArgs {
    /// Identity file, from `fleet-cli pki add-person` or `add-service`.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Folder to write to [default: $XDG_CONFIG_HOME/xtb/identity or ~/.config/xtb/identity].
    #[arg(long, value_name = "DIR")]
    pub to: Option<PathBuf>,
    /// Delete the file afterwards.
    #[arg(long)]
    pub remove: bool,
    /// Replace another identity in this folder.
    #[arg(long)]
    pub force: bool,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<enrol::EnrolReport<'_>>];

/// Enrols this computer.
///
/// # Errors
/// A file that is no identity, a robot's, or has expired; a folder that has another one.
pub fn run(ctx: &Context, args: &EnrolArgs) -> Result<Exit> {
    let failed = |refusal: EnrolRefusal| {
        let kind = if refusal.is_of_the_file() { ErrorKind::Config } else { ErrorKind::Failed };
        Error::new(kind, refusal.to_string()).hint(refusal.hint())
    };
    let is_ours = |role| !matches!(role, Role::Robot | Role::Router);
    let done = enrol::enrol(&args.file, args.to.as_deref(), args.force, SystemTime::now(), is_ours);
    let mut done = done.map_err(failed)?;
    done.settle(&args.file, args.remove).map_err(failed)?;
    ctx.out.result(&done.report(), |_| format!("{}\nNext: {}", done.text(), next(&done, args)))?;
    if !ctx.out.json {
        for warning in &done.warnings {
            ctx.out.note(&format!("warning: {warning}"));
        }
    }
    Ok(Exit::Done)
}

/// What it is for.
fn next(done: &EnrolOutcome, args: &EnrolArgs) -> String {
    let verb = match done.enrolled.identity.role {
        Role::Dispatcher => "dispatch serve",
        Role::Traffic => "traffic serve",
        Role::Map => "map serve FILE",
        Role::Dashboard => "dashboard",
        Role::Recorder => "record",
        Role::Simulator => "sim --connect ROUTER",
        _ => "list",
    };
    match &args.to {
        Some(folder) => format!("`fleet-cli {verb} --identity {}`", folder.display()),
        None => format!("`fleet-cli {verb}`"),
    }
}
