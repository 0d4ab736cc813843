//! What a robot, a person or a service enrols with: one file, `NAME.xtbid`.

use crate::certificate::{Certificate, CertificateError};
use crate::{CommonName, Role};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::time::SystemTime;
use thiserror::Error;
use xtb_protocol::Name;

const VERSION: u32 = 1;

/// It cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum IdentityError {
    /// Not TOML, or not of this shape.
    #[error("it is no identity file: {0}")]
    Malformed(String),
    /// Of a later version of this program.
    #[error("version {0} of the file is not known to this program")]
    Version(u32),
    /// The CA's or the own certificate cannot be read.
    #[error("its {what}: {reason}")]
    Certificate {
        /// Which of them.
        what: &'static str,
        /// Why not.
        reason: CertificateError,
    },
    /// The certificate is another one's.
    #[error("it is for {says}, but its certificate is for {certificate}")]
    Other {
        /// By the file.
        says: CommonName,
        /// By the certificate.
        certificate: CommonName,
    },
    /// From this moment on.
    #[error("the certificate of {name} expired on {since}")]
    Expired {
        /// Whose.
        name: Name,
        /// When.
        since: String,
    },
    /// Until this moment.
    #[error("the certificate of {name} is not valid before {until}")]
    NotYet {
        /// Whose.
        name: Name,
        /// When.
        until: String,
    },
}

/// An identity with its certificate and key.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    version: u32,
    /// Where it belongs.
    pub fleet: Name,
    /// Whose.
    pub name: Name,
    /// What it may do.
    pub role: Role,
    /// Which of its certificates this is, from 1.
    pub generation: u32,
    /// The fleet's routers, such as `tls/10.0.0.1:7447`.
    pub routers: Vec<String>,
    /// The fleet's CA, PEM.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub ca: String,
    /// Its certificate, PEM.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub certificate: String,
    /// Its private key, PEM.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub key: String,
    /// A dashboard's second certificate, for browsers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub page: Option<Page>,
}

/// The certificate of a web server, and its key, both PEM. Routers do not take it.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Page {
    /// The certificate, with the page's host names and addresses.
    pub certificate: String,
    /// Its private key.
    pub key: String,
}

impl fmt::Debug for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Identity({}, {} of fleet {})", self.common_name(), self.role, self.fleet)
    }
}

impl Identity {
    /// One of its parts; they are not checked here.
    #[must_use]
    #[allow(clippy::too_many_arguments)] // its fields, each of another kind
    pub fn new(
        fleet: Name,
        own: CommonName,
        role: Role,
        routers: Vec<String>,
        ca: String,
        certificate: String,
        key: String,
    ) -> Self {
        let CommonName { name, generation } = own;
        Self { version: VERSION, fleet, name, role, generation, routers, ca, certificate, key, page: None }
    }

    /// Reads a file's text, and checks that its parts belong together.
    ///
    /// # Errors
    /// [`IdentityError`], but for those about the time.
    pub fn parse(text: &str) -> Result<Self, IdentityError> {
        let identity = Self::parse_facts(text)?;
        identity.check()?;
        Ok(identity)
    }

    /// The same for a text that may lack CA, certificate and key (a folder has them as files of their own).
    ///
    /// # Errors
    /// [`IdentityError::Malformed`], [`IdentityError::Version`].
    pub fn parse_facts(text: &str) -> Result<Self, IdentityError> {
        let identity: Self = toml::from_str(text)
            // The message alone: the line that it would show may be a part of the key.
            .map_err(|error| IdentityError::Malformed(error.message().to_owned()))?;
        if identity.version != VERSION {
            return Err(IdentityError::Version(identity.version));
        }
        Ok(identity)
    }

    /// The same without CA, certificate and key.
    #[must_use]
    pub fn facts(&self) -> Self {
        let (ca, certificate, key) = Default::default();
        Self { ca, certificate, key, page: None, ..self.clone() }
    }

    /// Whether its parts belong together.
    ///
    /// # Errors
    /// [`IdentityError::Certificate`], [`IdentityError::Other`].
    pub fn check(&self) -> Result<(), IdentityError> {
        let broken = |what| move |reason| IdentityError::Certificate { what, reason };
        Certificate::parse(&self.ca).map_err(broken("CA"))?;
        let certificate = self.certificate().map_err(broken("certificate"))?;
        let certificate = certificate.common_name().map_err(broken("certificate"))?;
        let says = self.common_name();
        if certificate != says {
            return Err(IdentityError::Other { says, certificate });
        }
        Ok(())
    }

    /// A file's text.
    ///
    /// # Errors
    /// [`IdentityError::Malformed`].
    pub fn to_text(&self) -> Result<String, IdentityError> {
        toml::to_string(self).map_err(|error| IdentityError::Malformed(error.to_string()))
    }

    /// The common name that its certificate has.
    #[must_use]
    pub fn common_name(&self) -> CommonName {
        CommonName { name: self.name.clone(), generation: self.generation }
    }

    /// What its certificate says.
    ///
    /// # Errors
    /// [`CertificateError::Malformed`].
    pub fn certificate(&self) -> Result<Certificate, CertificateError> {
        Certificate::parse(&self.certificate)
    }

    /// Whether its certificate is valid at this moment.
    ///
    /// # Errors
    /// [`IdentityError::Expired`], [`IdentityError::NotYet`], [`IdentityError::Certificate`].
    pub fn check_at(&self, now: SystemTime) -> Result<(), IdentityError> {
        let broken = |reason| IdentityError::Certificate { what: "certificate", reason };
        let Certificate { not_before, not_after, .. } = self.certificate().map_err(broken)?;
        let name = self.name.clone();
        if now > not_after {
            return Err(IdentityError::Expired { name, since: day(not_after) });
        }
        if now < not_before {
            return Err(IdentityError::NotYet { name, until: day(not_before) });
        }
        Ok(())
    }
}

/// A moment as people read it.
fn day(time: SystemTime) -> String {
    humantime::format_rfc3339_seconds(time).to_string()
}
