//! `enrol`: an identity file becomes this computer's identity.

use crate::context::Context;
use crate::exit::Exit;
use clap::Args;
use robot_agent::enrol::{self, Done};
use serde::Serialize;
use std::path::PathBuf;
use std::time::SystemTime;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::{Identity, Role};
use xtb_protocol::Name;

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

#[derive(Debug, Serialize)]
struct EnrolledNow<'a> {
    name: &'a Name,
    fleet: &'a Name,
    role: Role,
    generation: u32,
    expires: String,
    routers: &'a [String],
    folder: String,
    warnings: &'a [String],
}

/// Enrols this computer.
///
/// # Errors
/// A file that is no identity, a robot's, or has expired; a folder that has another one.
pub fn run(ctx: &Context, args: &EnrolArgs) -> Result<Exit> {
    let now = SystemTime::now();
    let done = enrol::enrol(&args.file, args.to.as_deref(), args.force, now, |role| {
        !matches!(role, Role::Robot | Role::Router)
    });
    let mut done = done.map_err(|refusal| {
        let kind = if refusal.is_of_the_file() { ErrorKind::Config } else { ErrorKind::Failed };
        Error::new(kind, refusal.to_string()).hint(refusal.hint())
    })?;
    if args.remove {
        std::fs::remove_file(&args.file).map_err(|error| {
            let message = format!("enrolled, but cannot delete {}: {error}", args.file.display());
            Error::new(ErrorKind::Failed, message).hint("delete it: it holds the private key")
        })?;
    } else {
        let file = args.file.display();
        done.warnings.push(format!("{file} still holds the private key: delete it (--remove does)"));
    }
    let Identity { name, fleet, role, generation, routers, .. } = &done.enrolled.identity;
    let enrolled = EnrolledNow {
        name,
        fleet,
        role: *role,
        generation: *generation,
        expires: humantime::format_rfc3339_seconds(done.expires).to_string(),
        routers,
        folder: done.enrolled.folder.display().to_string(),
        warnings: &done.warnings,
    };
    ctx.out.result(&enrolled, |_| format!("{}\nNext: {}", done.text(), next(&done, args)))?;
    if !ctx.out.json {
        for warning in &done.warnings {
            ctx.out.note(&format!("warning: {warning}"));
        }
    }
    Ok(Exit::Done)
}

/// What it is for.
fn next(done: &Done, args: &EnrolArgs) -> String {
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
