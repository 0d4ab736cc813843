//! What a certificate says: whose, from when to when, for which hosts.

use crate::CommonName;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use thiserror::Error;
use x509_parser::extensions::GeneralName;
use x509_parser::pem::parse_x509_pem;
use x509_parser::prelude::{FromDer as _, X509Certificate};

/// Not a certificate of this project.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CertificateError {
    /// Not PEM, or not X.509 inside.
    #[error("it is no certificate in PEM: {0}")]
    Malformed(String),
    /// No common name, or not `name.generation`.
    #[error("its common name {0:?} is not one of this project, such as xtb-1.1")]
    CommonName(String),
}

/// What a certificate says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Certificate {
    /// Its common name as it stands there.
    pub subject: String,
    /// First moment at which it is valid.
    pub not_before: SystemTime,
    /// Last one.
    pub not_after: SystemTime,
    /// Host names and addresses that it is for; empty for one that is no server's.
    pub hosts: Vec<String>,
    /// The key that it is for, as SubjectPublicKeyInfo in DER.
    pub public_key: Vec<u8>,
}

impl Certificate {
    /// Reads the first certificate of a PEM text.
    ///
    /// # Errors
    /// [`CertificateError::Malformed`].
    pub fn parse(pem: &str) -> Result<Self, CertificateError> {
        let malformed = |error: &dyn std::fmt::Display| CertificateError::Malformed(error.to_string());
        let (_, pem) = parse_x509_pem(pem.as_bytes()).map_err(|error| malformed(&error))?;
        Self::parse_der(&pem.contents)
    }

    /// Reads one as it is sent in a handshake.
    ///
    /// # Errors
    /// [`CertificateError::Malformed`].
    pub fn parse_der(der: &[u8]) -> Result<Self, CertificateError> {
        let malformed = |error: &dyn std::fmt::Display| CertificateError::Malformed(error.to_string());
        let (_, certificate) = X509Certificate::from_der(der).map_err(|error| malformed(&error))?;
        let subject = certificate.subject().iter_common_name().next();
        let subject = subject.and_then(|name| name.as_str().ok()).unwrap_or_default().to_owned();
        let names = certificate.subject_alternative_name().map_err(|error| malformed(&error))?;
        let names = names.map(|names| names.value.general_names.as_slice()).unwrap_or_default();
        Ok(Self {
            subject,
            not_before: time(certificate.validity().not_before.timestamp()),
            not_after: time(certificate.validity().not_after.timestamp()),
            hosts: names.iter().filter_map(host).collect(),
            public_key: certificate.public_key().raw.to_vec(),
        })
    }

    /// Whose it is.
    ///
    /// # Errors
    /// [`CertificateError::CommonName`].
    pub fn common_name(&self) -> Result<CommonName, CertificateError> {
        self.subject.parse().map_err(|()| CertificateError::CommonName(self.subject.clone()))
    }
}

fn host(name: &GeneralName<'_>) -> Option<String> {
    match name {
        GeneralName::DNSName(name) => Some((*name).to_owned()),
        GeneralName::IPAddress(bytes) => match <[u8; 4]>::try_from(*bytes) {
            Ok(v4) => Some(std::net::Ipv4Addr::from(v4).to_string()),
            Err(_) => <[u8; 16]>::try_from(*bytes).ok().map(|v6| std::net::Ipv6Addr::from(v6).to_string()),
        },
        _ => None,
    }
}

fn time(unix_s: i64) -> SystemTime {
    UNIX_EPOCH + Duration::from_secs(u64::try_from(unix_s).unwrap_or(0))
}
