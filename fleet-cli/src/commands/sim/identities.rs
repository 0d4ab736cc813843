//! A set of identities for trials: CA, router and one of each role in one folder, where no fleet would have them.

use crate::context::{Context, session_name};
use crate::pki::{Pki, Validity};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use xtb_bus::Enrolled;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::{Identity, Role};
use xtb_protocol::Name;

/// Those that are made, named as their roles.
const MADE: [Role; 9] = [
    Role::Operator,
    Role::Viewer,
    Role::Simulator,
    Role::Dispatcher,
    Role::Traffic,
    Role::Map,
    Role::Tracker,
    Role::Dashboard,
    Role::Recorder,
];

/// The folder of such a set.
#[derive(Debug)]
pub(super) struct Identities {
    folder: PathBuf,
}

impl Identities {
    /// The one in `folder`; it is made if there is none.
    ///
    /// # Errors
    /// A folder with other things, another fleet's set, or one that is out of date.
    pub(super) fn prepare(ctx: &Context, folder: &Path, listen: &str) -> Result<Self> {
        let own = Self { folder: folder.to_owned() };
        let empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
        if empty {
            own.make(&ctx.settings.fleet, listen)?;
        }
        let pki = Pki::open(&own.pki()).map_err(|error| error.hint("name a folder that is empty"))?;
        let (fleet, wanted) = (&pki.registry.fleet, &ctx.settings.fleet);
        if fleet != wanted {
            let message = format!("{} has the identities of fleet {fleet}", folder.display());
            return Err(Error::new(ErrorKind::Invalid, message)
                .hint(format!("--fleet {fleet}, or another folder for those of {wanted}")));
        }
        let simulator = own.of(Role::Simulator)?;
        simulator.identity.check_at(SystemTime::now()).map_err(|error| {
            Error::new(ErrorKind::Config, error.to_string()).hint("delete the folder: a new set is made then")
        })?;
        Ok(own)
    }

    fn make(&self, fleet: &Name, listen: &str) -> Result<()> {
        let validity = Validity::year(SystemTime::now());
        let address = listen.trim_start_matches("tls/");
        let (host, port) = address.rsplit_once(':').unwrap_or((address, ""));
        let host = host.trim_start_matches('[').trim_end_matches(']');
        let reached = !matches!(host, "0.0.0.0" | "::" | "");
        let names = if reached { vec![host.to_owned()] } else { Vec::new() };
        let port = port.parse().unwrap_or(0);
        let mut pki = Pki::create(&self.pki(), fleet.clone(), &names, port, validity)?;
        for role in MADE {
            let identity = pki.add(&name(role)?, role, validity, &[])?;
            write(&identity, &self.folder.join(role.as_str()))?;
        }
        pki.save()
    }

    /// The folder.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// That of the router.
    pub(super) fn pki(&self) -> PathBuf {
        self.folder.join("pki")
    }

    /// The identity of this role.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn of(&self, role: Role) -> Result<Enrolled> {
        Enrolled::load(&self.folder.join(role.as_str())).map_err(|error| {
            Error::new(ErrorKind::Config, error.to_string()).hint("delete the folder: a new set is made then")
        })
    }

    /// The router listens here now: who uses an identity of the set connects here.
    ///
    /// # Errors
    /// The folders cannot be written.
    pub(super) fn moved(&self, endpoints: &[String]) -> Result<()> {
        for role in MADE {
            let mut identity = self.of(role)?.identity;
            if identity.routers != endpoints {
                identity.routers = endpoints.to_vec();
                write(&identity, &self.folder.join(role.as_str()))?;
            }
        }
        Ok(())
    }
}

/// The same as this role, where there are identities.
///
/// # Errors
/// Its identity cannot be read.
pub(super) fn of(ctx: &Context, set: Option<&Identities>, role: Role) -> Result<Context> {
    let Some(set) = set else { return Ok(ctx.clone()) };
    let enrolled = set.of(role)?;
    let client = session_name(Some(&enrolled.identity))?;
    Ok(ctx.with(|settings| (settings.identity, settings.client) = (Some(enrolled), client)))
}

fn name(role: Role) -> Result<Name> {
    Name::new(role.as_str()).map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))
}

fn write(identity: &Identity, folder: &Path) -> Result<()> {
    let written = Enrolled::write(identity, folder);
    written.map(drop).map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))
}
