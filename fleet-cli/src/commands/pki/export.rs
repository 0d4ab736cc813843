//! `pki export`: a person's certificate for a browser, as PKCS #12.

use super::{day, time, token};
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::pki::{Delivery, Pki};
use clap::Args;
use p12_keystore::{Certificate, KeyStore, KeyStoreEntry, PrivateKey, PrivateKeyChain};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::issue::der;
use xtb_protocol::Name;

/// The password, unless one is made.
const PASSWORD: &str = "XTB_P12_PASSWORD";

const EXPORT_HELP: &str = "\
The password is that in XTB_P12_PASSWORD, or a new one that is printed once. The file holds a private key: \
import it into the browser, then delete it. A renewal or revocation ends it too.

Example: fleet-cli pki export --browser alice --out alice.p12";

/// Arguments of `pki export`.
#[derive(Debug, Clone, Args)]
#[command(after_help = EXPORT_HELP)]
pub struct PkiExportArgs {
    /// Whose browser.
    #[arg(long, value_name = "NAME", value_parser = Name::new)]
    pub browser: Name,
    /// File to write.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Overwrite an existing file.
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Exported<'a> {
    name: &'a Name,
    file: String,
    expires: String,
    /// Unless it is that of the environment.
    #[serde(skip_serializing_if = "Option::is_none")]
    password: Option<String>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Exported<'_>>];

/// Writes the file.
///
/// # Errors
/// Nobody has this name, it is no person's, or it is revoked; a file that is there.
pub(super) fn run(ctx: &Context, folder: &Path, args: &PkiExportArgs) -> Result<Exit> {
    Delivery::is_free(&args.out, args.force)?;
    let given = std::env::var(PASSWORD).ok().filter(|password| !password.is_empty());
    let (password, made) = match given {
        Some(password) => (password, None),
        None => {
            let password = token::random()?;
            (password.clone(), Some(password))
        }
    };
    // Held while it is made: the generation must not change meanwhile.
    let pki = Pki::change(folder)?;
    let issued = pki.browser(&args.browser)?;
    let own = store(&args.browser, (&issued.certificate, &issued.key), &pki.ca()?, &password)?;
    crate::pki::write_private(&args.out, &own)?;
    let exported = Exported {
        name: &args.browser,
        file: args.out.display().to_string(),
        expires: time(issued.expires),
        password: made,
    };
    ctx.out.result(&exported, |Exported { name, file, password, .. }| {
        let until = day(issued.expires);
        let password = match password {
            Some(password) => format!("password {password}"),
            None => format!("password as in {PASSWORD}"),
        };
        format!("{file}: browser certificate of {name} until {until}, {password}")
    })?;
    Ok(Exit::Done)
}

fn store(name: &Name, (certificate, key): (&str, &str), ca: &str, password: &str) -> Result<Vec<u8>> {
    let broken = |error: &dyn std::fmt::Display| {
        Error::new(ErrorKind::Failed, format!("cannot write PKCS #12: {error}"))
    };
    let bytes = |pem: &str| der(pem).ok_or_else(|| broken(&"not PEM"));
    let one = |pem: &str| Certificate::from_der(&bytes(pem)?).map_err(|error| broken(&error));
    let key = PrivateKey::from_der(&bytes(key)?).map_err(|error| broken(&error))?;
    let chain = PrivateKeyChain::new(name.as_str().as_bytes(), key, [one(certificate)?, one(ca)?]);
    let mut store = KeyStore::new();
    store.add_entry(name.as_str(), KeyStoreEntry::PrivateKeyChain(chain));
    store.writer(password).write().map_err(|error| broken(&error))
}
