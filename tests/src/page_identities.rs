//! A throw-away fleet for the dashboard's page: CA, page certificate, registry, people.

use std::path::PathBuf;
use std::time::{Duration, SystemTime};
use tempfile::TempDir;
use xtb_dashboard::Secure;
use xtb_identity::issue::{Authority, CertificatePurpose, Issued, LIFE, issue};
use xtb_identity::{CommonName, Registry, RegistryEntry, Role, Router, token_digest};
use xtb_protocol::Name;

/// The hosts of the page's certificate.
const HOSTS: [&str; 2] = ["localhost", "127.0.0.1"];

/// See the module.
pub struct PageIdentities {
    folder: TempDir,
    authority: Authority,
}

fn must<T, E: std::fmt::Display>(result: Result<T, E>) -> T {
    result.unwrap_or_else(|error| panic!("{error}"))
}

impl PageIdentities {
    /// A fleet `lab` without people.
    ///
    /// # Panics
    /// If a file cannot be written; so do the others.
    #[must_use]
    pub fn new() -> Self {
        let fleet = must(Name::new("lab"));
        let (folder, now) = (must(tempfile::tempdir()), SystemTime::now());
        let authority = must(Authority::create(&fleet, now));
        let router =
            Router { names: vec!["127.0.0.1".into()], port: 7447, generation: 1, expires: now + LIFE };
        let own = Self { folder, authority };
        own.write("ca.pem", &own.authority.certificate());
        own.write("identities.toml", &must(Registry::new(fleet, router).to_text()));
        own.renew_page();
        own
    }

    /// For the dashboard.
    #[must_use]
    pub fn secure(&self) -> Secure {
        Secure { identity: self.folder.path().to_owned(), registry: self.path("identities.toml") }
    }

    /// The CA's certificate, PEM.
    #[must_use]
    pub fn ca(&self) -> String {
        self.authority.certificate()
    }

    /// A new certificate for the page.
    pub fn renew_page(&self) {
        let hosts = HOSTS.map(str::to_owned);
        let page = self.certificate("dashboard.1", CertificatePurpose::Page(&hosts), LIFE);
        self.write("page-key.pem", &page.key);
        self.write("page-certificate.pem", &page.certificate);
    }

    /// A certificate of the CA.
    #[must_use]
    pub fn certificate(&self, own: &str, purpose: CertificatePurpose<'_>, life: Duration) -> Issued {
        let ca = must(Authority::load(&self.authority.certificate(), &self.authority.key()));
        let own: CommonName = own.parse().unwrap_or_else(|()| panic!("{own}"));
        must(issue(&ca, &own, purpose, SystemTime::now(), life))
    }

    /// Takes somebody in, with their [`token`].
    pub fn add(&self, name: &str, role: Role) {
        let token_sha256 = Some(token_digest(&token(name)));
        let (name, expires) = (must(Name::new(name)), SystemTime::now() + LIFE);
        self.change(|registry| {
            must(registry.add(RegistryEntry {
                name,
                role,
                generation: 1,
                expires,
                revoked: false,
                token_sha256,
            }));
        });
    }

    /// Changes the registry as `fleet-cli pki` does: a new file takes the place of the old one.
    pub fn change(&self, change: impl FnOnce(&mut Registry)) {
        let mut registry =
            must(Registry::parse(&must(std::fs::read_to_string(self.path("identities.toml")))));
        change(&mut registry);
        self.write("identities.toml", &must(registry.to_text()));
    }

    /// Changes one entry.
    pub fn change_one(&self, name: &str, change: impl FnOnce(&mut RegistryEntry)) {
        self.change(|registry| change(must(registry.get_mut(&must(Name::new(name))))));
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        let beside = self.path(&format!("{name}.new"));
        must(std::fs::write(&beside, text));
        must(std::fs::rename(beside, self.path(name)));
    }
}

impl Default for PageIdentities {
    fn default() -> Self {
        Self::new()
    }
}

/// With which somebody signs in.
#[must_use]
pub fn token(name: &str) -> String {
    format!("{name}-token-0123456789")
}
