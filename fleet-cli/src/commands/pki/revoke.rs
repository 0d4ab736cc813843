//! `pki revoke`: an identity is not admitted any more.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::pki::Pki;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::Role;
use xtb_protocol::Name;

const REVOKE_HELP: &str = "\
A running router reads the registry at once and reopens, which ends all its links: robots under teleoperation \
stop, goals that stop on link loss (`halt`) end, goals with `finish` go on; everybody else is back within two \
seconds. Other routers need a copy of identities.toml.";

/// Arguments of `pki revoke`.
#[derive(Debug, Clone, Args)]
#[command(after_help = REVOKE_HELP)]
pub struct RevokeArgs {
    /// Whose identity.
    #[arg(value_name = "NAME", value_parser = Name::new)]
    pub name: Name,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Revoked<'a> {
    name: &'a Name,
    role: Role,
    revoked: bool,
    /// Whether it was already.
    before: bool,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Revoked<'_>>];

/// Revokes an identity.
///
/// # Errors
/// Nobody has this name.
pub(super) fn run(ctx: &Context, folder: &Path, args: &RevokeArgs) -> Result<Exit> {
    let mut pki = Pki::change(folder)?;
    let name = &args.name;
    let entry = pki.registry.get_mut(name).map_err(|error| {
        Error::new(ErrorKind::Invalid, error.to_string()).hint("`fleet-cli pki list` shows all identities")
    })?;
    let (role, before) = (entry.role, entry.revoked);
    entry.revoked = true;
    entry.token_sha256 = None;
    if !before {
        pki.save()?;
    }
    ctx.out.result(&Revoked { name, role, revoked: true, before }, |_| match before {
        true => format!("{name} was revoked already"),
        false => format!(
            "{name} ({role}) is revoked. A running router reopens at once: teleoperation and goals that stop on \
             link loss end for all robots, others go on; `fleet-cli pki renew {name} --readmit` admits it again"
        ),
    })?;
    Ok(Exit::Done)
}
