//! `pki token`: a person signs in to the page with it. The registry keeps its digest alone.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::pki::Pki;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::{RegistryError, token_digest};
use xtb_protocol::Name;

/// Arguments of `pki token`.
#[derive(Debug, Clone, Args)]
pub struct TokenArgs {
    /// Whose; the token before is not accepted any more.
    #[arg(value_name = "NAME", value_parser = Name::new)]
    pub name: Name,
    /// Take the token back instead of making one.
    #[arg(long)]
    pub remove: bool,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Token<'a> {
    name: &'a Name,
    #[serde(skip_serializing_if = "Option::is_none")]
    token: Option<String>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Token<'_>>];

/// Makes a token.
///
/// # Errors
/// Nobody has this name, it is no person's, or it is revoked.
pub(super) fn run(ctx: &Context, folder: &Path, args: &TokenArgs) -> Result<Exit> {
    let mut pki = Pki::change(folder)?;
    let name = &args.name;
    let entry = pki.registry.get_mut(name).map_err(|error: RegistryError| {
        Error::new(ErrorKind::Invalid, error.to_string()).hint("`fleet-cli pki list` shows all identities")
    })?;
    if !entry.role.is_person() {
        let message = format!("{name} is {}: only people sign in to the page", entry.role.noun());
        return Err(Error::new(ErrorKind::Invalid, message).hint("`fleet-cli pki add-person` makes people"));
    }
    if entry.revoked && !args.remove {
        return Err(Error::new(ErrorKind::Failed, format!("{name} is revoked")));
    }
    let token = if args.remove { None } else { Some(random()?) };
    entry.token_sha256 = token.as_deref().map(token_digest);
    pki.save()?;
    ctx.out.result(&Token { name, token }, |Token { token, .. }| match token {
        Some(token) => token.clone(),
        None => format!("{name} has no token any more"),
    })?;
    if !args.remove && !ctx.out.json {
        ctx.out.note(&format!("{name} signs in to the page with this token; it is shown only now"));
    }
    Ok(Exit::Done)
}

/// 128 random bits in hexadecimal digits.
pub(super) fn random() -> Result<String> {
    let mut bytes = [0_u8; 16];
    let filled = getrandom::fill(&mut bytes);
    filled.map_err(|error| Error::new(ErrorKind::Failed, format!("no random numbers: {error}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}
