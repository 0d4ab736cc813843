//! `pki add-robot`, `add-person`, `add-service`, `add-router`: new identities.

use super::{LifeArgs, OutArgs, day, time};
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::pki::{Delivery, Pki, Validity, with_local};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::{Identity, Role};
use xtb_protocol::Name;

/// Arguments of `pki add-robot`.
#[derive(Debug, Clone, Args)]
pub struct AddRobotArgs {
    /// The robot's name.
    #[arg(value_name = "NAME", value_parser = Name::robot)]
    pub name: Name,
    /// Of its certificate.
    #[command(flatten)]
    pub life: LifeArgs,
    /// For its file.
    #[command(flatten)]
    pub out: OutArgs,
}

/// Arguments of `pki add-person`.
#[derive(Debug, Clone, Args)]
pub struct AddPersonArgs {
    /// The person's name: 1 to 20 of a-z and 0-9.
    #[arg(value_name = "NAME", value_parser = Name::new)]
    pub name: Name,
    /// operator: looks, drives, changes tasks, fetches recordings · viewer: looks, and calls an emergency stop.
    #[arg(long, value_name = "ROLE", value_parser = of(&Role::PEOPLE))]
    pub role: Role,
    /// Of its certificate.
    #[command(flatten)]
    pub life: LifeArgs,
    /// For its file.
    #[command(flatten)]
    pub out: OutArgs,
}

/// Arguments of `pki add-service`.
#[derive(Debug, Clone, Args)]
pub struct AddServiceArgs {
    /// What it is.
    #[arg(value_name = "ROLE", value_parser = of(&Role::SERVICES))]
    pub role: Role,
    /// Its name [default: that of its role].
    #[arg(long, value_name = "NAME", value_parser = Name::new)]
    pub name: Option<Name>,
    /// dashboard: host name or address by which browsers reach the page, which gets a certificate of its own; for
    /// several, repeat it.
    #[arg(long, value_name = "HOST")]
    pub address: Vec<String>,
    /// Of its certificate.
    #[command(flatten)]
    pub life: LifeArgs,
    /// For its file.
    #[command(flatten)]
    pub out: OutArgs,
}

const ROUTER_HELP: &str = "\
Writes the folder NAME: copy it to the other computer and start the router there with \
`fleet-cli router --pki NAME --listen tls/0.0.0.0:PORT --connect tls/HOST:PORT`. After each change of \
identities copy identities.toml again. All routers of a mesh use the same port.";

/// Arguments of `pki add-router`.
#[derive(Debug, Clone, Args)]
#[command(after_help = ROUTER_HELP)]
pub struct AddRouterArgs {
    /// The router's name.
    #[arg(value_name = "NAME", value_parser = Name::new)]
    pub name: Name,
    /// Host name or address by which it is reached; for several, repeat it.
    #[arg(long, value_name = "HOST", required = true)]
    pub router_name: Vec<String>,
    /// Of its certificate.
    #[command(flatten)]
    pub life: LifeArgs,
    /// For its folder.
    #[command(flatten)]
    pub out: OutArgs,
}

fn of(roles: &'static [Role]) -> impl TypedValueParser<Value = Role> {
    PossibleValuesParser::new(roles.iter().map(|role| role.as_str())).try_map(|role| role.parse::<Role>())
}

/// What was made.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Made {
    name: Name,
    fleet: Name,
    role: Role,
    generation: u32,
    expires: String,
    file: String,
    routers: Vec<String>,
}

impl Made {
    pub(super) fn of(identity: &Identity, validity: Validity, file: &Path) -> Self {
        Self {
            name: identity.name.clone(),
            fleet: identity.fleet.clone(),
            role: identity.role,
            generation: identity.generation,
            expires: time(validity.expires()),
            file: file.display().to_string(),
            routers: identity.routers.clone(),
        }
    }

    /// In words, and what to do with the file.
    pub(super) fn text(&self, validity: Validity) -> String {
        let Self { name, fleet, role, generation, file, routers, .. } = self;
        let whose = format!(
            "{file}: {role} {name} of fleet {fleet}, certificate {generation} until {}",
            day(validity.expires())
        );
        match role {
            Role::Router => format!(
                "{whose}\nNext: copy the folder to that computer, then `fleet-cli router --pki {file} --listen \
                 tls/0.0.0.0:PORT --connect {}`",
                routers.first().map_or("tls/HOST:PORT", String::as_str)
            ),
            role => {
                let program = if *role == Role::Robot { "robot-agent" } else { "fleet-cli" };
                format!(
                    "{whose}, connects to {}\nNext: hand the file over (it holds a private key), then there \
                     `{program} enrol {name}.xtbid`",
                    routers.join(", ")
                )
            }
        }
    }
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Made>];

/// Makes a robot's identity.
///
/// # Errors
/// As [`Pki::add`]; a file that is there.
pub(super) fn robot(ctx: &Context, folder: &Path, args: &AddRobotArgs) -> Result<Exit> {
    add(ctx, folder, (&args.name, Role::Robot), &[], args.life, &args.out)
}

/// Makes a person's identity.
///
/// # Errors
/// As [`Pki::add`]; a file that is there.
pub(super) fn person(ctx: &Context, folder: &Path, args: &AddPersonArgs) -> Result<Exit> {
    add(ctx, folder, (&args.name, args.role), &[], args.life, &args.out)
}

/// Makes a service's identity.
///
/// # Errors
/// As [`Pki::add`]; a file that is there, or an address for what has no page.
pub(super) fn service(ctx: &Context, folder: &Path, args: &AddServiceArgs) -> Result<Exit> {
    if args.role != Role::Dashboard && !args.address.is_empty() {
        return Err(Error::new(ErrorKind::Invalid, format!("a {} has no page for browsers", args.role))
            .hint("--address belongs to `pki add-service dashboard`"));
    }
    let usual = || Name::new(args.role.as_str());
    let name = args.name.clone().map_or_else(usual, Ok);
    let name = name.map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))?;
    let hosts = if args.address.is_empty() { Vec::new() } else { with_local(&args.address) };
    add(ctx, folder, (&name, args.role), &hosts, args.life, &args.out)
}

/// Makes another router's folder.
///
/// # Errors
/// As [`Pki::add`]; a folder that is there.
pub(super) fn router(ctx: &Context, folder: &Path, args: &AddRouterArgs) -> Result<Exit> {
    let hosts = with_local(&args.router_name);
    add(ctx, folder, (&args.name, Role::Router), &hosts, args.life, &args.out)
}

fn add(
    ctx: &Context,
    folder: &Path,
    (name, role): (&Name, Role),
    hosts: &[String],
    life: LifeArgs,
    out: &OutArgs,
) -> Result<Exit> {
    let mut pki = Pki::change(folder)?;
    let path = Delivery::place(name, role, out.out.as_deref());
    Delivery::is_free(&path, out.force)?;
    let validity = life.validity();
    let identity = pki.add(name, role, validity, hosts)?;
    let file = Delivery::prepare(identity.clone(), path)?.finish(&pki)?;
    out.apply(&pki)?;
    ctx.out.result(&Made::of(&identity, validity, &file), |made| made.text(validity))?;
    Ok(Exit::Done)
}
