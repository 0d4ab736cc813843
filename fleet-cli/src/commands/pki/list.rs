//! `pki list`: all identities.

use super::{day, time};
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::Tone;
use crate::pki::Pki;
use crate::table::{Table, TableCell};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, SystemTime};
use xtb_client::Result;
use xtb_identity::Role;

/// So long before it ends a certificate is to be renewed.
const SOON: Duration = Duration::from_secs(30 * 24 * 3600);

#[derive(Debug, Serialize, JsonSchema)]
struct Row {
    name: String,
    role: Role,
    generation: u32,
    expires: String,
    expired: bool,
    revoked: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    last_seen: Option<String>,
    /// Whether this person has a token for the page.
    token: bool,
    #[serde(skip)]
    ends: SystemTime,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Listed {
    fleet: String,
    endpoints: Vec<String>,
    router: Row,
    identities: Vec<Row>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Listed>];

/// Lists them.
///
/// # Errors
/// There is no PKI.
pub(super) fn run(ctx: &Context, folder: &Path) -> Result<Exit> {
    let pki = Pki::open(folder)?;
    let (now, mut seen) = (SystemTime::now(), pki.seen());
    let router = &pki.registry.router;
    let mut row = |name: &str, role, generation, ends: SystemTime, revoked, token| Row {
        name: name.to_owned(),
        role,
        generation,
        expires: time(ends),
        expired: ends < now,
        revoked,
        last_seen: seen.remove(name),
        token,
        ends,
    };
    let own = row("router", Role::Router, router.generation, router.expires, false, false);
    let identities = pki.registry.identities.iter().map(|entry| {
        let (name, token) = (entry.name.as_str(), entry.token_sha256.is_some());
        row(name, entry.role, entry.generation, entry.expires, entry.revoked, token)
    });
    let listed = Listed {
        fleet: pki.registry.fleet.to_string(),
        endpoints: pki.endpoints(),
        identities: identities.collect(),
        router: own,
    };
    ctx.out.result(&listed, |listed| {
        let mut table = Table::new(&["name", "role", "certificate", "until", "state", "last seen"]);
        for row in std::iter::once(&listed.router).chain(&listed.identities) {
            let (state, tone) = state(row, now);
            table.row(vec![
                TableCell::new(row.name.as_str(), Tone::Strong),
                row.role.to_string().into(),
                row.generation.to_string().into(),
                day(row.ends).into(),
                TableCell::new(state, tone),
                row.last_seen.clone().unwrap_or_else(|| "–".into()).into(),
            ]);
        }
        format!("fleet {}, {}\n{}", listed.fleet, listed.endpoints.join(", "), table.render(&ctx.out))
    })?;
    Ok(Exit::Done)
}

fn state(row: &Row, now: SystemTime) -> (&'static str, Tone) {
    match row {
        Row { revoked: true, .. } => ("revoked", Tone::Bad),
        Row { expired: true, .. } => ("expired", Tone::Bad),
        Row { ends, .. } if *ends < now + SOON => ("expires soon", Tone::Warning),
        _ => ("valid", Tone::Good),
    }
}
