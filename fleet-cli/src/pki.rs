//! The fleet's PKI folder: CA, router certificate and registry. One program at a time changes it, and the registry is
//! written whole or not at all; a router reads it at any time.
//!
//! `ca.pem`, `ca.key` · `identities.toml` (the registry) · `router/` (what a router opens with) · `certificates/`
//! (the last certificate of each identity that has host names) · `seen.toml` (written by the router).

mod delivery;
mod files;
mod validity;

pub use delivery::Delivery;
pub use files::private as write_private;
pub use validity::Validity;

use std::collections::BTreeMap;
use std::fs::File;
use std::net::Ipv6Addr;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use xtb_bus::Tls;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::certificate::Certificate;
use xtb_identity::issue::{Authority, CA_LIFE, CertificatePurpose, IssueError, Issued, issue};
use xtb_identity::{CommonName, Identity, Page, Registry, RegistryEntry, RegistryError, Role, Router};
use xtb_protocol::Name;

/// Names of this computer: each router certificate has them.
pub const LOCAL: [&str; 3] = ["localhost", "127.0.0.1", "::1"];
const CA: &str = "ca.pem";
const CA_KEY: &str = "ca.key";
const ROUTER: &str = "router";

/// A fleet's PKI folder.
#[derive(Debug)]
pub struct Pki {
    folder: PathBuf,
    /// All identities.
    pub registry: Registry,
    /// Held by who changes it.
    _lock: Option<File>,
}

/// The folder that is meant: as named, else `xtb/pki` below the user's configuration.
///
/// # Errors
/// [`ErrorKind::Invalid`]: none is named, and there is no home.
pub fn place(named: Option<&Path>) -> Result<PathBuf> {
    let usual = || Some(xtb_bus::Enrolled::place()?.with_file_name("pki"));
    named.map(Path::to_owned).or_else(usual).ok_or_else(|| {
        Error::new(ErrorKind::Invalid, "there is no home folder for the PKI").hint("name one with --pki DIR")
    })
}

impl Pki {
    /// A new one, with a CA for ten years.
    ///
    /// # Errors
    /// There is one already, a host name that is none, or the folder cannot be written.
    pub fn create(
        folder: &Path,
        fleet: Name,
        names: &[String],
        port: u16,
        validity: Validity,
    ) -> Result<Self> {
        files::private_folder(folder)?;
        let lock = files::lock(folder)?;
        if [Registry::FILE, CA_KEY, CA].iter().any(|file| folder.join(file).exists()) {
            let message = format!("{} already has a PKI", folder.display());
            return Err(Error::new(ErrorKind::Failed, message).hint(
                "`fleet-cli pki list` shows it; another fleet needs another folder (--pki DIR); a new PKI in \
                 its place would lock out everybody",
            ));
        }
        let made = Authority::create(&fleet, validity.from).map_err(not_issued)?;
        let router =
            Router { names: with_local(names), port, generation: 0, expires: validity.from + CA_LIFE };
        let mut pki =
            Self { folder: folder.to_owned(), registry: Registry::new(fleet, router), _lock: Some(lock) };
        // A wrong host name is noticed before anything is written.
        let ca = Authority::load(&made.certificate(), &made.key()).map_err(not_issued)?;
        let issued = pki.issue_router(&ca, validity)?;
        files::private(&folder.join(CA_KEY), made.key().as_bytes())?;
        files::private(&folder.join(CA), made.certificate().as_bytes())?;
        pki.write_router(&made.certificate(), &issued)?;
        pki.save()?;
        Ok(pki)
    }

    /// The one in this folder, to be looked at.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]: there is none, or its registry cannot be read.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(Registry::FILE);
        let text = robot_agent::files::text(&path, robot_agent::files::MAX_TEXT).map_err(|error| {
            if error.is_missing() {
                Error::new(ErrorKind::Config, format!("{} has no PKI", folder.display()))
                    .hint("`fleet-cli pki init` makes one; --pki DIR or XTB_PKI names another folder")
            } else {
                Error::new(ErrorKind::Config, format!("cannot read {}: {error}", path.display()))
            }
        })?;
        let registry = Registry::parse(&text)
            .map_err(|error| Error::new(ErrorKind::Config, format!("{}: {error}", path.display())))?;
        Ok(Self { folder: folder.to_owned(), registry, _lock: None })
    }

    /// The same to be changed, when nobody else does.
    ///
    /// # Errors
    /// As [`Self::open`]; or it has no CA key.
    pub fn change(folder: &Path) -> Result<Self> {
        // Before there is a lock file in a folder that is none.
        Self::open(folder)?;
        if !folder.join(CA_KEY).exists() {
            let message = format!("{} has no ca.key: it is a copy for a router", folder.display());
            return Err(Error::new(ErrorKind::Config, message)
                .hint("change identities where `fleet-cli pki init` was run, then copy identities.toml"));
        }
        let lock = files::lock(folder)?;
        Ok(Self { _lock: Some(lock), ..Self::open(folder)? })
    }

    /// Where it is.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What the fleet's router opens with.
    #[must_use]
    pub fn router(&self) -> Tls {
        Tls::in_folder(&self.folder.join(ROUTER))
    }

    /// The CA's certificate, PEM.
    ///
    /// # Errors
    /// [`ErrorKind::Config`].
    pub fn ca(&self) -> Result<String> {
        self.text(CA)
    }

    /// Where clients connect: the router by the names that were given to it, or this computer's; then the others of
    /// its mesh.
    #[must_use]
    pub fn endpoints(&self) -> Vec<String> {
        let others = self.registry.admitted().filter(|entry| entry.role == Role::Router);
        let others: Vec<String> = others.flat_map(|entry| self.hosts(&entry.name)).collect();
        let names = self.registry.router.names.iter().chain(&others);
        let reached = names.filter(|name| !LOCAL.contains(&name.as_str()));
        let endpoints: Vec<String> = reached.map(|name| endpoint(name, self.registry.router.port)).collect();
        if endpoints.is_empty() { vec![endpoint("127.0.0.1", self.registry.router.port)] } else { endpoints }
    }

    /// When each was seen last, as far as the router has written it.
    #[must_use]
    pub fn seen(&self) -> BTreeMap<String, String> {
        let text = robot_agent::files::text(&self.folder.join("seen.toml"), robot_agent::files::MAX_TEXT);
        text.ok().and_then(|text| toml::from_str(&text).ok()).unwrap_or_default()
    }

    /// A new identity; `hosts`: by which a router or a dashboard's page is reached.
    ///
    /// # Errors
    /// A name that is taken or cannot be, or a host name that is none.
    pub fn add(&mut self, name: &Name, role: Role, validity: Validity, hosts: &[String]) -> Result<Identity> {
        let entry = RegistryEntry {
            name: name.clone(),
            role,
            generation: 1,
            expires: validity.expires(),
            revoked: false,
            token_sha256: None,
        };
        self.registry.add(entry).map_err(|error| refused(&error))?;
        self.identity(name, validity, hosts)
    }

    /// The next certificate of one that is there; the one before is not admitted any more. Without `hosts` it keeps
    /// those that it has.
    ///
    /// # Errors
    /// An unknown name, or one that is revoked and not to be admitted again.
    pub fn renew(
        &mut self,
        name: &Name,
        validity: Validity,
        hosts: &[String],
        readmit: bool,
    ) -> Result<Identity> {
        let hosts = if hosts.is_empty() { self.hosts(name) } else { hosts.to_vec() };
        let entry = self.registry.get_mut(name).map_err(|error| refused(&error))?;
        if entry.revoked && !readmit {
            return Err(Error::new(ErrorKind::Failed, format!("{name} is revoked"))
                .hint("--readmit admits it again, with a new certificate"));
        }
        entry.revoked = false;
        entry.generation += 1;
        entry.expires = validity.expires();
        self.identity(name, validity, &hosts)
    }

    /// The router's next certificate, also for other names if any are given.
    ///
    /// # Errors
    /// A host name that is none, or a folder that cannot be written.
    pub fn renew_router(&mut self, names: &[String], validity: Validity) -> Result<()> {
        if !names.is_empty() {
            self.registry.router.names = with_local(names);
        }
        let issued = self.issue_router(&self.authority()?, validity)?;
        self.write_router(&self.ca()?, &issued)?;
        self.save()
    }

    /// A person's certificate for a browser, of the generation that is admitted.
    ///
    /// # Errors
    /// An unknown name, one that is revoked, or no person's.
    pub fn browser(&self, name: &Name) -> Result<Issued> {
        let entry = self.registry.get(name).ok_or_else(|| refused(&RegistryError::Unknown(name.clone())))?;
        if !entry.role.is_person() {
            let message = format!("{name} is {}, not a person", entry.role.noun());
            return Err(Error::new(ErrorKind::Invalid, message)
                .hint("`fleet-cli pki add-person NAME --role operator` makes a person's identity"));
        }
        if entry.revoked {
            return Err(Error::new(ErrorKind::Failed, format!("{name} is revoked")));
        }
        let now = SystemTime::now();
        let life = entry.expires.duration_since(now).map_err(|_| {
            Error::new(ErrorKind::Failed, format!("the certificate of {name} has expired"))
                .hint(format!("fleet-cli pki renew {name}"))
        })?;
        issue(&self.authority()?, &entry.common_name(), CertificatePurpose::Browser, now, life)
            .map_err(not_issued)
    }

    /// Writes the registry.
    ///
    /// # Errors
    /// The system's words.
    pub fn save(&self) -> Result<()> {
        files::private(&self.folder.join(Registry::FILE), self.registry_text()?.as_bytes())
    }

    /// Asks a router that reads this folder to admit those who were added at once.
    ///
    /// # Errors
    /// The system's words.
    pub fn ask_to_apply(&self) -> Result<()> {
        xtb_services::router::ask_to_apply(&self.folder).map_err(files::failed(&self.folder))
    }

    fn registry_text(&self) -> Result<String> {
        self.registry.to_text().map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))
    }

    /// Host names and addresses in the last certificate of a router or a page; none of others.
    #[must_use]
    pub fn hosts(&self, name: &Name) -> Vec<String> {
        let text = self.text(&format!("certificates/{name}.pem"));
        let certificate = text.ok().and_then(|text| Certificate::parse(&text).ok());
        certificate.map(|certificate| certificate.hosts).unwrap_or_default()
    }

    fn identity(&self, name: &Name, validity: Validity, hosts: &[String]) -> Result<Identity> {
        let entry = self.registry.get(name).ok_or_else(|| refused(&RegistryError::Unknown(name.clone())))?;
        let ca = self.authority()?;
        let make = |purpose| {
            issue(&ca, &entry.common_name(), purpose, validity.from, validity.life).map_err(not_issued)
        };
        let is_router = entry.role == Role::Router;
        let own =
            make(if is_router { CertificatePurpose::Router(hosts) } else { CertificatePurpose::Client })?;
        let page =
            if is_router || hosts.is_empty() { None } else { Some(make(CertificatePurpose::Page(hosts))?) };
        if !hosts.is_empty() {
            let with_hosts = page.as_ref().unwrap_or(&own);
            files::private_folder(&self.folder.join("certificates"))?;
            let path = self.folder.join("certificates").join(format!("{name}.pem"));
            files::private(&path, with_hosts.certificate.as_bytes())?;
        }
        let mut identity = Identity::new(
            self.registry.fleet.clone(),
            entry.common_name(),
            entry.role,
            self.endpoints(),
            self.ca()?,
            own.certificate,
            own.key,
        );
        identity.page = page.map(|Issued { certificate, key, .. }| Page { certificate, key });
        Ok(identity)
    }

    fn issue_router(&mut self, ca: &Issuer, validity: Validity) -> Result<Issued> {
        self.registry.router.generation += 1;
        self.registry.router.expires = validity.expires();
        let own = CommonName { name: router_name()?, generation: self.registry.router.generation };
        let purpose = CertificatePurpose::Router(&self.registry.router.names);
        issue(ca, &own, purpose, validity.from, validity.life).map_err(not_issued)
    }

    fn write_router(&self, ca: &str, issued: &Issued) -> Result<()> {
        write_router(&self.folder.join(ROUTER), ca, &issued.certificate, &issued.key)
    }

    fn authority(&self) -> Result<Issuer> {
        Authority::load(&self.ca()?, &self.text(CA_KEY)?).map_err(not_issued)
    }

    fn text(&self, file: &str) -> Result<String> {
        let path = self.folder.join(file);
        robot_agent::files::text(&path, robot_agent::files::MAX_TEXT).map_err(|error| {
            Error::new(ErrorKind::Config, format!("cannot read {}: {error}", path.display()))
        })
    }
}

type Issuer = xtb_identity::issue::Issuer;

/// What a router opens with; the router reads it when the registry has changed, which is written later.
fn write_router(folder: &Path, ca: &str, certificate: &str, key: &str) -> Result<()> {
    files::private_folder(folder)?;
    for (file, text) in [("key.pem", key), ("certificate.pem", certificate), (CA, ca)] {
        files::private(&folder.join(file), text.as_bytes())?;
    }
    Ok(())
}

fn router_name() -> Result<Name> {
    Name::new(ROUTER).map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))
}

/// These names once each, and this computer's.
#[must_use]
pub fn with_local(names: &[String]) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for name in names.iter().cloned().chain(LOCAL.map(str::to_owned)) {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

fn endpoint(host: &str, port: u16) -> String {
    match host.parse::<Ipv6Addr>() {
        Ok(address) => format!("tls/[{address}]:{port}"),
        Err(_) => format!("tls/{host}:{port}"),
    }
}

fn not_issued(error: IssueError) -> Error {
    Error::new(ErrorKind::Invalid, error.to_string())
        .hint("host names look like lab-pc.local, addresses like 10.0.0.1")
}

fn refused(error: &RegistryError) -> Error {
    let failure = Error::new(ErrorKind::Invalid, error.to_string());
    match error {
        RegistryError::Twice(name) => Error { kind: ErrorKind::Failed, ..failure }
            .hint(format!("`fleet-cli pki renew {name}` makes its next certificate")),
        RegistryError::Unknown(_) => failure.hint("`fleet-cli pki list` shows all identities"),
        _ => failure.hint("choose another name"),
    }
}
