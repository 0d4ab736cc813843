//! `pki init`: CA, registry and router certificate.

use super::{LifeArgs, day, time};
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::pki::{Pki, Validity};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;
use xtb_client::Result;
use xtb_identity::issue::CA_LIFE;

/// Arguments of `pki init`.
#[derive(Debug, Clone, Args)]
pub struct InitArgs {
    /// Host name or address by which robots and people reach the router; for several, repeat it. localhost,
    /// 127.0.0.1 and ::1 are always there.
    #[arg(long, value_name = "HOST")]
    pub router_name: Vec<String>,
    /// The router's port.
    #[arg(long, value_name = "PORT", default_value_t = 7447)]
    pub port: u16,
    /// Of the router's certificate.
    #[command(flatten)]
    pub life: LifeArgs,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Made<'a> {
    fleet: &'a str,
    folder: String,
    ca_expires: String,
    router_names: &'a [String],
    router_expires: String,
    endpoints: Vec<String>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Made<'_>>];

/// Makes a PKI.
///
/// # Errors
/// There is one already, a host name that is none, or the folder cannot be written.
pub(super) fn run(ctx: &Context, folder: &Path, args: &InitArgs) -> Result<Exit> {
    let validity: Validity = args.life.validity();
    let fleet = ctx.settings.fleet.clone();
    let pki = Pki::create(folder, fleet, &args.router_name, args.port, validity)?;
    let router = &pki.registry.router;
    let ca_expires = validity.from + CA_LIFE;
    let made = Made {
        fleet: pki.registry.fleet.as_str(),
        folder: folder.display().to_string(),
        ca_expires: time(ca_expires),
        router_names: &router.names,
        router_expires: time(router.expires),
        endpoints: pki.endpoints(),
    };
    ctx.out.result(&made, |made| {
        format!(
            "PKI of fleet {} in {}: CA until {}, router certificate until {} for {}\n\
             Next: `fleet-cli pki add-robot xtb-1`, `fleet-cli pki add-person alice --role operator`, then \
             `fleet-cli router --listen tls/0.0.0.0:{}`",
            made.fleet,
            made.folder,
            day(ca_expires),
            day(router.expires),
            made.router_names.join(", "),
            router.port,
        )
    })?;
    if args.router_name.is_empty() && !ctx.out.json {
        ctx.out.note(
            "note: without --router-name only this computer can connect; `fleet-cli pki renew --router \
             --router-name HOST` adds the names by which others reach it",
        );
    }
    Ok(Exit::Done)
}
