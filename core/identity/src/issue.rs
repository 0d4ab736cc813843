//! The fleet's certificate authority: ECDSA P-256, ten years; leaves for a year, for clients alone, but for the
//! router's and the page's.

use crate::CommonName;
use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DistinguishedName, DnType, ExtendedKeyUsagePurpose,
    IsCa, KeyPair, KeyUsagePurpose, SanType,
};
use std::time::{Duration, SystemTime};
use thiserror::Error;
use time::OffsetDateTime;
use xtb_protocol::Name;

/// Life of the CA.
pub const CA_LIFE: Duration = Duration::from_secs(10 * 365 * 24 * 3600);
/// Life of a certificate that it issues.
pub const LIFE: Duration = Duration::from_secs(365 * 24 * 3600);
/// A certificate begins this much before it is made: computers' clocks differ.
pub const BACKDATED: Duration = Duration::from_secs(3600);

/// A CA that issues.
pub type Issuer = rcgen::Issuer<'static, KeyPair>;

/// A certificate could not be made.
#[derive(Debug, Error)]
pub enum IssueError {
    /// A key that cannot be read, most likely.
    #[error("cannot make a certificate: {0}")]
    Make(#[from] rcgen::Error),
    /// Neither a host name nor an address.
    #[error("{0:?} is neither a host name nor an address")]
    Host(String),
}

/// A certificate and its private key, both PEM.
#[derive(Clone, PartialEq, Eq)]
pub struct Issued {
    /// The certificate.
    pub certificate: String,
    /// Its key.
    pub key: String,
    /// Its last moment.
    pub expires: SystemTime,
}

/// What a certificate is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CertificatePurpose<'a> {
    /// A session of a robot, a person or a service: it cannot pose as a router.
    Client,
    /// A router, also as the client of others: the names and addresses by which it is reached.
    Router(&'a [String]),
    /// A web server alone: the names and addresses by which it is reached. No router takes it.
    Page(&'a [String]),
    /// A person's browser: the same as a session's.
    Browser,
}

/// The fleet's CA, with its key.
pub struct Authority {
    issuer: CertifiedIssuer<'static, KeyPair>,
}

impl Authority {
    /// A new one.
    ///
    /// # Errors
    /// [`IssueError`].
    pub fn create(fleet: &Name, now: SystemTime) -> Result<Self, IssueError> {
        let mut params = CertificateParams::default();
        params.distinguished_name = common_name(&format!("XTB fleet {fleet}"));
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        valid(&mut params, now, CA_LIFE);
        Ok(Self { issuer: CertifiedIssuer::self_signed(params, KeyPair::generate()?)? })
    }

    /// The one of these two PEM texts.
    ///
    /// # Errors
    /// [`IssueError`].
    pub fn load(certificate: &str, key: &str) -> Result<Issuer, IssueError> {
        Ok(rcgen::Issuer::from_ca_cert_pem(certificate, KeyPair::from_pem(key)?)?)
    }

    /// Its certificate, PEM.
    #[must_use]
    pub fn certificate(&self) -> String {
        self.issuer.pem()
    }

    /// Its key, PEM.
    #[must_use]
    pub fn key(&self) -> String {
        self.issuer.key().serialize_pem()
    }
}

/// A certificate for `life` from `now` on.
///
/// # Errors
/// [`IssueError`].
pub fn issue(
    ca: &rcgen::Issuer<'_, KeyPair>,
    own: &CommonName,
    purpose: CertificatePurpose<'_>,
    now: SystemTime,
    life: Duration,
) -> Result<Issued, IssueError> {
    use ExtendedKeyUsagePurpose::{ClientAuth, ServerAuth};
    let mut params = CertificateParams::default();
    params.distinguished_name = common_name(&own.to_string());
    let (uses, hosts): (_, &[String]) = match purpose {
        CertificatePurpose::Client | CertificatePurpose::Browser => (vec![ClientAuth], &[]),
        CertificatePurpose::Router(hosts) => (vec![ServerAuth, ClientAuth], hosts),
        CertificatePurpose::Page(hosts) => (vec![ServerAuth], hosts),
    };
    params.extended_key_usages = uses;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.subject_alt_names = hosts.iter().map(|host| san(host)).collect::<Result<_, _>>()?;
    params.use_authority_key_identifier_extension = true;
    valid(&mut params, now, life);
    let key = KeyPair::generate()?;
    let certificate = params.signed_by(&key, ca)?;
    Ok(Issued { certificate: certificate.pem(), key: key.serialize_pem(), expires: seconds(now + life) })
}

/// The bytes of the first block of a PEM text, as other formats hold them.
#[must_use]
pub fn der(pem: &str) -> Option<Vec<u8>> {
    x509_parser::pem::parse_x509_pem(pem.as_bytes()).ok().map(|(_, pem)| pem.contents)
}

fn common_name(text: &str) -> DistinguishedName {
    let mut name = DistinguishedName::new();
    name.push(DnType::CommonName, text);
    name
}

fn valid(params: &mut CertificateParams, now: SystemTime, life: Duration) {
    params.not_before = OffsetDateTime::from(now - BACKDATED);
    params.not_after = OffsetDateTime::from(seconds(now + life));
}

/// Certificates hold whole seconds.
fn seconds(time: SystemTime) -> SystemTime {
    let since = time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    SystemTime::UNIX_EPOCH + Duration::from_secs(since.as_secs())
}

fn san(host: &str) -> Result<SanType, IssueError> {
    if let Ok(address) = host.parse() {
        return Ok(SanType::IpAddress(address));
    }
    let label = |label: &str| {
        (1..=63).contains(&label.len())
            && label.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-')
            && !label.starts_with('-')
            && !label.ends_with('-')
    };
    // `10.0.0.300` is no address, and no name either.
    let is_name = host.len() <= 253
        && host.split('.').all(label)
        && host.rsplit('.').next().is_some_and(|last| last.bytes().any(|byte| byte.is_ascii_alphabetic()));
    if is_name { Ok(SanType::DnsName(host.try_into()?)) } else { Err(IssueError::Host(host.to_owned())) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::Certificate;
    use crate::{Identity, IdentityError, Role};

    #[test]
    fn an_issued_identity_says_what_was_asked_for_and_when_it_ends() {
        let fleet = Name::new("lab").unwrap();
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1_800_000_000);
        let made = Authority::create(&fleet, now).unwrap();
        let ca = Authority::load(&made.certificate(), &made.key()).unwrap();
        let own: CommonName = "alice.2".parse().unwrap();
        let issued = issue(&ca, &own, CertificatePurpose::Client, now, LIFE).unwrap();
        let routers = vec!["tls/10.0.0.1:7447".to_owned()];
        let identity = Identity::new(
            fleet,
            own.clone(),
            Role::Operator,
            routers,
            made.certificate(),
            issued.certificate.clone(),
            issued.key.clone(),
        );
        assert_eq!(Identity::parse(&identity.to_text().unwrap()), Ok(identity.clone()));
        assert_eq!(identity.certificate().unwrap().common_name(), Ok(own));
        assert!(!format!("{identity:?}").contains("PRIVATE"));

        assert_eq!(identity.check_at(now), Ok(()));
        let late = identity.check_at(issued.expires + Duration::from_secs(1)).unwrap_err();
        assert_eq!(late.to_string(), "the certificate of alice expired on 2028-01-15T08:00:00Z");
        let early = identity.check_at(now - 2 * BACKDATED).unwrap_err();
        assert!(matches!(early, IdentityError::NotYet { .. }), "{early}");

        let mut other = identity;
        other.name = Name::new("bob").unwrap();
        let said = Identity::parse(&other.to_text().unwrap()).unwrap_err().to_string();
        assert_eq!(said, "it is for bob.2, but its certificate is for alice.2");
    }

    #[test]
    fn a_router_is_reached_by_its_names_and_addresses_alone() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1_800_000_000);
        let made = Authority::create(&Name::new("lab").unwrap(), now).unwrap();
        let ca = Authority::load(&made.certificate(), &made.key()).unwrap();
        let hosts = ["10.0.0.1", "lab-pc.local", "::1"].map(str::to_owned);
        let router = "router.1".parse().unwrap();
        let issued = issue(&ca, &router, CertificatePurpose::Router(&hosts), now, LIFE).unwrap();
        assert_eq!(Certificate::parse(&issued.certificate).unwrap().hosts, hosts);
        for bad in ["no host", "", "10.0.0.300", "-a.local", "tls/10.0.0.1", "10.0.0.1:7447"] {
            let hosts = [bad.to_owned()];
            let refused =
                issue(&ca, &router, CertificatePurpose::Router(&hosts), now, LIFE).map(drop).unwrap_err();
            assert!(matches!(refused, IssueError::Host(_)), "{bad}: {refused}");
        }
    }
}
