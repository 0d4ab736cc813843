//! `pki`: who belongs to the fleet. One verb a file.

mod add;
mod export;
mod init;
mod list;
mod renew;
mod revoke;
mod token;

use crate::context::Context;
use crate::exit::Exit;
use crate::json::Verbs;
use crate::pki::{self, Pki, Validity};
use clap::{Args, Subcommand};
use std::path::PathBuf;
use std::time::SystemTime;
use xtb_client::Result;

const PKI_HELP: &str = "\
From nothing to a fleet that only its own can enter:
  fleet-cli pki init --router-name 10.0.0.1
  fleet-cli pki add-robot xtb-1
  fleet-cli pki add-person alice --role operator
  fleet-cli router --listen tls/0.0.0.0:7447
then, with xtb-1.xtbid on the robot and alice.xtbid on alice's computer:
  robot-agent enrol xtb-1.xtbid
  fleet-cli enrol alice.xtbid

An .xtbid file holds a private key: hand it over on a stick or with scp, and delete it afterwards. The PKI \
folder holds the fleet's CA key (ca.key): whoever has it can make any identity. docs/security.md has the rest.";

/// Arguments of `pki`.
#[derive(Debug, Clone, Args)]
#[command(after_help = PKI_HELP)]
pub struct PkiArgs {
    /// PKI folder [default: $XDG_CONFIG_HOME/xtb/pki or ~/.config/xtb/pki].
    #[arg(long, global = true, env = "XTB_PKI", value_name = "DIR")]
    pub pki: Option<PathBuf>,
    /// What to do.
    #[command(subcommand)]
    pub verb: PkiVerb,
}

/// What to do about identities.
#[derive(Debug, Clone, Subcommand)]
pub enum PkiVerb {
    /// Make the fleet's CA, its registry and its router's certificate.
    Init(init::InitArgs),
    /// Make a robot's identity file.
    AddRobot(add::AddRobotArgs),
    /// Make a person's identity file.
    AddPerson(add::AddPersonArgs),
    /// Make a service's identity file.
    AddService(add::AddServiceArgs),
    /// Make the folder of another router of the mesh.
    AddRouter(add::AddRouterArgs),
    /// Make the next certificate of an identity, or of the router; the one before is not admitted any more.
    Renew(renew::RenewArgs),
    /// Revoke an identity: it is not admitted any more.
    Revoke(revoke::RevokeArgs),
    /// List all identities.
    List,
    /// Make a new token with which a person signs in to the page.
    Token(token::TokenArgs),
    /// Write a certificate for a person's browser (PKCS #12).
    Export(export::PkiExportArgs),
}

/// Life of a certificate.
#[derive(Debug, Clone, Copy, Args)]
pub struct LifeArgs {
    /// Days for which the certificate is valid [default: 365]. A negative number makes an expired one, for tests.
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = clap::value_parser!(i32).range(-3650..=3650))]
    pub days: Option<i32>,
    /// First moment at which it is valid (RFC 3339), for tests [default: now].
    #[arg(long, value_name = "TIME", hide = true, value_parser = humantime::parse_rfc3339)]
    pub valid_from: Option<SystemTime>,
}

impl LifeArgs {
    fn validity(self) -> Validity {
        Validity::days(self.valid_from.unwrap_or_else(SystemTime::now), self.days)
    }
}

/// Where a file goes.
#[derive(Debug, Clone, Args)]
pub struct OutArgs {
    /// Folder to write to [default: this one].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overwrite an existing file.
    #[arg(long)]
    pub force: bool,
    /// Let the router admit it at once: it reopens, which ends teleoperation and goals that stop on link loss. Without
    /// this it is admitted when no robot is driven.
    #[arg(long)]
    pub apply: bool,
}

impl OutArgs {
    /// Asks the router, if that is wanted.
    fn apply(&self, pki: &Pki) -> Result<()> {
        if self.apply { pki.ask_to_apply() } else { Ok(()) }
    }
}

/// What its verbs print with `--json`.
pub(super) const JSON: Verbs = &[
    ("pki init", init::JSON),
    ("pki add-robot", add::JSON),
    ("pki add-person", add::JSON),
    ("pki add-service", add::JSON),
    ("pki add-router", add::JSON),
    ("pki renew", renew::JSON),
    ("pki revoke", revoke::JSON),
    ("pki list", list::JSON),
    ("pki token", token::JSON),
    ("pki export", export::JSON),
];

/// Carries out one of its verbs.
///
/// # Errors
/// See each verb.
pub fn run(ctx: &Context, args: &PkiArgs) -> Result<Exit> {
    let folder = pki::place(args.pki.as_deref())?;
    match &args.verb {
        PkiVerb::Init(args) => init::run(ctx, &folder, args),
        PkiVerb::AddRobot(args) => add::robot(ctx, &folder, args),
        PkiVerb::AddPerson(args) => add::person(ctx, &folder, args),
        PkiVerb::AddService(args) => add::service(ctx, &folder, args),
        PkiVerb::AddRouter(args) => add::router(ctx, &folder, args),
        PkiVerb::Renew(args) => renew::run(ctx, &folder, args),
        PkiVerb::Revoke(args) => revoke::run(ctx, &folder, args),
        PkiVerb::List => list::run(ctx, &folder),
        PkiVerb::Token(args) => token::run(ctx, &folder, args),
        PkiVerb::Export(args) => export::run(ctx, &folder, args),
    }
}

/// A moment as people read it.
fn time(time: SystemTime) -> String {
    humantime::format_rfc3339_seconds(time).to_string()
}

/// The day of it.
fn day(at: SystemTime) -> String {
    time(at).chars().take(10).collect()
}
