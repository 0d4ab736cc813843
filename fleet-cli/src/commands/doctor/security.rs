//! Looks at identity, registry and router: who can come in, and what runs out.

use super::checks::Security;
use crate::pki;
use robot_agent::files;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use xtb_bus::link_problem;
use xtb_client::client::Client;
use xtb_client::{Settings, unique_name};
use xtb_identity::Registry;
use xtb_protocol::messages::{Body, Request};
use xtb_protocol::{Name, Uuid};

/// Where the fleet's CA is, if this computer has it.
const PKI: &str = "XTB_PKI";
/// A longer registry is none.
const MAX_REGISTRY: usize = 4 << 20;
/// An answer that should not come is waited for so long.
const UNANSWERED_FOR: Duration = Duration::from_millis(700);

/// Everything that needs no session.
pub(super) async fn look(settings: &Settings) -> Security {
    let now = SystemTime::now();
    let (mut routers, mut registry, mut readable) = (BTreeMap::new(), None, Vec::new());
    if let Some(enrolled) = &settings.identity {
        readable.extend(enrolled.readable_by_others());
        for endpoint in &settings.connect {
            if let Some(admits) = link_problem::admits(endpoint, &enrolled.identity, now).await {
                routers.insert(endpoint.clone(), admits);
            }
        }
    }
    if let Some(folder) = pki().filter(|folder| folder.join(Registry::FILE).exists()) {
        let secret = [folder.clone(), folder.join("ca.key"), folder.join("router").join("key.pem")];
        readable.extend(secret.into_iter().filter_map(readable_by_others));
        registry = Some(read(&folder.join(Registry::FILE)));
    }
    Security {
        now,
        robots: BTreeSet::new(),
        endpoints: settings.connect.clone(),
        identity: settings.identity.as_ref().map(|enrolled| enrolled.identity.clone()),
        readable,
        registry,
        routers,
        answers_others: None,
    }
}

/// Whether a robot answers this identity when it uses another's name. What is asked, to retain a lease that nobody
/// holds, changes nothing.
pub(super) async fn answers_others(client: &Client, robot: Option<&Name>) -> Option<(Name, Name)> {
    client.settings().identity.as_ref()?;
    let (robot, other) = (robot?.clone(), unique_name("probe").ok()?);
    let request = Request { id: Uuid::new_v4(), lease: None, body: Body::Retain {} };
    let keys = client.keys().robot(&robot);
    let answered = client.bus().ask_all(&keys, &other, &request, UNANSWERED_FOR, Duration::ZERO).await;
    answered.is_ok_and(|replies| !replies.is_empty()).then_some((robot, other))
}

fn pki() -> Option<PathBuf> {
    let named = std::env::var_os(PKI).filter(|folder| !folder.is_empty());
    pki::place(named.as_ref().map(Path::new)).ok()
}

fn read(path: &Path) -> Result<Registry, String> {
    let text = files::text(path, MAX_REGISTRY).map_err(|error| format!("{}: {error}", path.display()))?;
    Registry::parse(&text).map_err(|error| format!("{}: {error}", path.display()))
}

fn readable_by_others(path: PathBuf) -> Option<(PathBuf, u32)> {
    let mode = fs::metadata(&path).ok()?.mode() & 0o777;
    (mode & 0o077 != 0).then_some((path, mode))
}
