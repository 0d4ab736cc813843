//! `pki renew`: the next certificate.

use super::add::Made;
use super::{LifeArgs, OutArgs, day, time};
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::pki::{Delivery, Pki, with_local};
use clap::{ArgGroup, Args};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::{RegistryError, Role};
use xtb_protocol::Name;

const RENEW_HELP: &str = "\
The certificate before is not admitted any more as soon as the router has read the registry: enrol the new file \
soon. A program that runs takes the new certificate when it connects the next time.

Examples:
  fleet-cli pki renew xtb-1
  fleet-cli pki renew --router --router-name 10.0.0.2";

/// Arguments of `pki renew`.
#[derive(Debug, Clone, Args)]
#[command(after_help = RENEW_HELP, group = ArgGroup::new("whose").args(["name", "router"]).required(true))]
pub struct RenewArgs {
    /// Whose.
    #[arg(value_name = "NAME", value_parser = Name::new)]
    pub name: Option<Name>,
    /// That of the fleet's router, in the PKI folder.
    #[arg(long)]
    pub router: bool,
    /// A router's host names and addresses, instead of those that it has.
    #[arg(long, value_name = "HOST")]
    pub router_name: Vec<String>,
    /// A dashboard's host names and addresses, instead of those that it has.
    #[arg(long, value_name = "HOST", conflicts_with_all = ["router", "router_name"])]
    pub address: Vec<String>,
    /// Admit a revoked identity again.
    #[arg(long, conflicts_with = "router")]
    pub readmit: bool,
    /// Of the certificate.
    #[command(flatten)]
    pub life: LifeArgs,
    /// For its file.
    #[command(flatten)]
    pub out: OutArgs,
}

#[derive(Debug, Serialize, JsonSchema)]
struct RouterRenewed<'a> {
    fleet: &'a Name,
    role: Role,
    generation: u32,
    names: &'a [String],
    expires: String,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<RouterRenewed<'_>>, line_of::<Made>];

/// Makes the next certificate.
///
/// # Errors
/// As [`Pki::renew`] and [`Pki::renew_router`]; a file that is there.
pub(super) fn run(ctx: &Context, folder: &Path, args: &RenewArgs) -> Result<Exit> {
    let mut pki = Pki::change(folder)?;
    let validity = args.life.validity();
    let Some(name) = &args.name else {
        pki.renew_router(&args.router_name, validity)?;
        let router = &pki.registry.router;
        let renewed = RouterRenewed {
            fleet: &pki.registry.fleet,
            role: Role::Router,
            generation: router.generation,
            names: &router.names,
            expires: time(router.expires),
        };
        ctx.out.result(&renewed, |RouterRenewed { generation, names, .. }| {
            format!(
                "router: certificate {generation} until {} for {}. A running router reopens with it; teleoperation \
                 and goals that stop on link loss end then",
                day(router.expires),
                names.join(", ")
            )
        })?;
        return Ok(Exit::Done);
    };
    let role = pki.registry.get(name).map(|entry| entry.role).ok_or_else(|| {
        Error::new(ErrorKind::Invalid, RegistryError::Unknown(name.clone()).to_string())
            .hint("`fleet-cli pki list` shows all identities")
    })?;
    let hosts = match role {
        Role::Router => &args.router_name,
        Role::Dashboard => &args.address,
        _ => &Vec::new(),
    };
    if hosts.is_empty() && !(args.router_name.is_empty() && args.address.is_empty()) {
        return Err(Error::new(
            ErrorKind::Invalid,
            format!("{name} is {}: it has no such host names", role.noun()),
        )
        .hint("--router-name belongs to routers, --address to dashboards"));
    }
    let path = Delivery::place(name, role, args.out.out.as_deref());
    // A router's folder is renewed in its place.
    Delivery::is_free(&path, args.out.force || role == Role::Router)?;
    let hosts = if hosts.is_empty() { Vec::new() } else { with_local(hosts) };
    let identity = pki.renew(name, validity, &hosts, args.readmit)?;
    let file = Delivery::prepare(identity.clone(), path)?.finish(&pki)?;
    args.out.apply(&pki)?;
    ctx.out.result(&Made::of(&identity, validity, &file), |made| {
        let before = identity.generation - 1;
        format!("{}\nCertificate {before} is not admitted any more", made.text(validity))
    })?;
    Ok(Exit::Done)
}
