//! A fleet with identities: a PKI in a folder of its own, a router on port 0, and sessions of whoever is wanted.
//! And [`Access`], for trials that are made with identities and without.

use crate::{eventually, name};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use xtb_bus::{Bus, Enrolled, Opening, SessionRole, Tls};
use xtb_identity::issue::{Authority, CertificatePurpose, LIFE, issue};
use xtb_identity::{CommonName, Identity, Registry, RegistryEntry, Role, Router};
use xtb_protocol::keys::FleetKeys;
use xtb_services::router::{GuardedRouter, open_with_registry};

/// The fleet of every PKI here.
pub const FLEET: &str = "lab";

/// A PKI, made anew, in a folder that goes with it.
#[derive(Debug)]
pub struct Pki {
    folder: PathBuf,
    registry: Registry,
    ca: String,
    ca_key: String,
}

impl Drop for Pki {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

impl Pki {
    /// One with these identities.
    ///
    /// # Panics
    /// If files cannot be written.
    #[must_use]
    pub fn new(identities: &[(&str, Role)]) -> Self {
        let (fleet, now) = (name(FLEET), SystemTime::now());
        let made = Authority::create(&fleet, now).unwrap_or_else(|error| panic!("{error}"));
        let folder = std::env::temp_dir().join(format!("xtb-pki-{}", xtb_protocol::Uuid::new_v4()));
        let router =
            Router { names: vec!["127.0.0.1".into()], port: 7447, generation: 1, expires: now + LIFE };
        let mut pki = Self {
            folder,
            registry: Registry::new(fleet, router),
            ca: made.certificate(),
            ca_key: made.key(),
        };
        let own = CommonName { name: name("router"), generation: 1 };
        let hosts = ["127.0.0.1".to_owned()];
        let (certificate, key) = pki.issue(&own, CertificatePurpose::Router(&hosts), LIFE);
        let router = pki.folder.join("router");
        fs::create_dir_all(&router).unwrap_or_else(|error| panic!("{error}"));
        for (file, text) in [("ca.pem", &pki.ca), ("certificate.pem", &certificate), ("key.pem", &key)] {
            fs::write(router.join(file), text).unwrap_or_else(|error| panic!("{error}"));
        }
        for (of, role) in identities {
            pki.add(of, *role);
        }
        pki.write();
        pki
    }

    /// Its folder, as a router takes it.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The registry.
    #[must_use]
    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    fn issue(&self, own: &CommonName, purpose: CertificatePurpose<'_>, life: Duration) -> (String, String) {
        let ca = Authority::load(&self.ca, &self.ca_key).unwrap_or_else(|error| panic!("{error}"));
        let issued =
            issue(&ca, own, purpose, SystemTime::now(), life).unwrap_or_else(|error| panic!("{error}"));
        (issued.certificate, issued.key)
    }

    /// Adds one, enrolled in a folder below this one; [`Self::write`] tells routers.
    ///
    /// # Panics
    /// If the name is taken.
    pub fn add(&mut self, of: &str, role: Role) {
        let entry = RegistryEntry {
            name: name(of),
            role,
            generation: 1,
            expires: SystemTime::now() + LIFE,
            revoked: false,
            token_sha256: None,
        };
        self.registry.add(entry).unwrap_or_else(|error| panic!("{error}"));
        self.enrol(of, LIFE);
    }

    /// Makes the certificate of the generation that the registry has, and enrols with it.
    ///
    /// # Panics
    /// If there is nobody of this name.
    pub fn enrol(&self, of: &str, life: Duration) -> Enrolled {
        let entry = self.registry.get(&name(of)).unwrap_or_else(|| panic!("{of} is not there"));
        let own = entry.common_name();
        let (certificate, key) = self.issue(&own, CertificatePurpose::Client, life);
        let identity = Identity::new(
            self.registry.fleet.clone(),
            own,
            entry.role,
            vec!["tls/127.0.0.1:7447".into()],
            self.ca.clone(),
            certificate,
            key,
        );
        Enrolled::write(&identity, &self.folder.join(of)).unwrap_or_else(|error| panic!("{error}"))
    }

    /// One of them, as it was enrolled last.
    ///
    /// # Panics
    /// If it never was.
    #[must_use]
    pub fn enrolled(&self, of: &str) -> Enrolled {
        Enrolled::load(&self.folder.join(of)).unwrap_or_else(|error| panic!("{error}"))
    }

    /// The files of one of them.
    #[must_use]
    pub fn tls(&self, of: &str) -> Tls {
        Tls::in_folder(&self.folder.join(of))
    }

    /// Changes one entry; [`Self::write`] tells routers.
    ///
    /// # Panics
    /// If there is nobody of this name.
    pub fn change(&mut self, of: &str, change: impl FnOnce(&mut RegistryEntry)) {
        change(self.registry.get_mut(&name(of)).unwrap_or_else(|error| panic!("{error}")));
    }

    /// Writes the registry, whole or not at all.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn write(&self) {
        let text = self.registry.to_text().unwrap_or_else(|error| panic!("{error}"));
        let (path, beside) = (self.folder.join("identities.toml"), self.folder.join("identities.new"));
        fs::write(&beside, text)
            .and_then(|()| fs::rename(&beside, &path))
            .unwrap_or_else(|error| panic!("{error}"));
    }

    /// A router that follows this registry, on a free port.
    ///
    /// # Panics
    /// If it cannot be opened.
    pub async fn router(&self) -> GuardedRouter {
        open_with_registry("tls/127.0.0.1:0", &[], &self.folder)
            .await
            .unwrap_or_else(|error| panic!("{error}"))
    }

    /// How a session of one of them is opened.
    #[must_use]
    pub fn opening(&self, of: &str, router: &str) -> Opening {
        let connect = vec![router.to_owned()];
        Opening::of(SessionRole::Client { connect }).tls(Some(self.tls(of)))
    }

    /// The keys of the fleet.
    #[must_use]
    pub fn keys(&self) -> FleetKeys {
        FleetKeys::new(self.registry.fleet.clone())
    }
}

/// How the sessions of a trial come to its router.
#[derive(Debug)]
pub enum Access {
    /// Over TCP, and everybody may do everything.
    Open,
    /// Over TLS, each with its own rights.
    Identities(Pki),
}

impl Access {
    /// Open, or a PKI of these robots (`xtb-1` …) and people, who are operators.
    #[must_use]
    pub fn of(identities: bool, robots: usize, people: &[&str]) -> Self {
        if !identities {
            return Self::Open;
        }
        let mut pki = Pki::new(&[]);
        for number in 1..=robots {
            pki.add(&format!("xtb-{number}"), Role::Robot);
        }
        for person in people {
            pki.add(person, Role::Operator);
        }
        pki.write();
        Self::Identities(pki)
    }

    /// Its PKI, if it has one.
    #[must_use]
    pub fn pki(&self) -> Option<&Pki> {
        match self {
            Self::Open => None,
            Self::Identities(pki) => Some(pki),
        }
    }

    /// A session of one of the people, once the router admits it.
    ///
    /// # Panics
    /// If it never does.
    pub async fn session(&self, of: &str, router: &str) -> Bus {
        let connect = vec![router.to_owned()];
        let opening = Opening::of(SessionRole::Client { connect }).tls(self.pki().map(|pki| pki.tls(of)));
        eventually("a session", || async { opening.clone().once().await.ok() }).await
    }
}
