//! One TLS handshake, and what its end means.

use super::CertificateRefusal;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::io::AsyncReadExt as _;
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use tokio_rustls::rustls::crypto::{CryptoProvider, ring};
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName, UnixTime};
use tokio_rustls::rustls::time_provider::TimeProvider;
use tokio_rustls::rustls::version::TLS13;
use tokio_rustls::rustls::{
    AlertDescription, CertificateError, ClientConfig, DigitallySignedStruct, Error, RootCertStore,
    SignatureScheme,
};
use xtb_identity::Identity;

/// In TLS 1.3 a client has finished before the server has looked at its certificate: a refusal comes with the first
/// read, so much later at most (longer where the handshake took longer).
const REFUSED_WITHIN: Duration = Duration::from_millis(200);

/// How a handshake ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Handshake {
    /// Both sides accept each other; the server's certificate, DER.
    Accepted(Vec<u8>),
    /// The server's certificate is not from the CA that is trusted here, if any is.
    Stranger,
    /// The server's certificate is for these names only.
    OtherNames(Vec<String>),
    /// The server's certificate ended then.
    Expired(SystemTime),
    /// The server's certificate begins then.
    NotYet(SystemTime),
    /// The server refuses the own certificate, or that there is none.
    Refused(CertificateRefusal),
    /// The other side does something else.
    NotTls(String),
}

/// As whom it is tried.
#[derive(Debug, Clone, Copy)]
pub(super) enum Party<'a> {
    /// One that trusts no server: it ends where it is seen to be one.
    Stranger,
    /// One that trusts the CA of this identity, and has no certificate.
    Anonymous(&'a Identity),
    /// This identity.
    Identity(&'a Identity),
}

/// Tries it, as at this time.
pub(super) async fn with(
    stream: TcpStream,
    host: &str,
    party: Party<'_>,
    now: SystemTime,
    within: Duration,
) -> Handshake {
    let Ok(name) = ServerName::try_from(host.to_owned()) else {
        return Handshake::NotTls(format!("{host:?} is no host"));
    };
    let config = match config(party, now) {
        Ok(config) => config,
        Err(error) => return Handshake::Refused(CertificateRefusal::Other(error.to_string())),
    };
    let began = Instant::now();
    let connecting = TlsConnector::from(Arc::new(config)).connect(name, stream);
    match timeout(within, connecting).await {
        Err(_) => Handshake::NotTls("it does not answer a TLS handshake".to_owned()),
        Ok(Err(error)) => ended(&error),
        Ok(Ok(stream)) => refused_later(stream, REFUSED_WITHIN + 2 * began.elapsed()).await,
    }
}

async fn refused_later(mut stream: TlsStream<TcpStream>, within: Duration) -> Handshake {
    match timeout(within, stream.read(&mut [0; 1])).await {
        Ok(Err(error)) if tls(&error).is_some() => ended(&error),
        _ => {
            let sent = stream.get_ref().1.peer_certificates().and_then(<[_]>::first);
            Handshake::Accepted(sent.map(|certificate| certificate.to_vec()).unwrap_or_default())
        }
    }
}

fn config(party: Party<'_>, now: SystemTime) -> Result<ClientConfig, Error> {
    let provider = Arc::new(ring::default_provider());
    let builder = ClientConfig::builder_with_details(Arc::clone(&provider), Arc::new(At(now)))
        .with_protocol_versions(&[&TLS13])?;
    let identity = match party {
        Party::Stranger => {
            let nobody = Arc::new(TrustsNobody(provider));
            return Ok(builder.dangerous().with_custom_certificate_verifier(nobody).with_no_client_auth());
        }
        Party::Anonymous(identity) | Party::Identity(identity) => identity,
    };
    let read = |what: &str| Error::General(format!("its {what} cannot be read"));
    let certificates = |text: &str| {
        CertificateDer::pem_slice_iter(text.as_bytes())
            .collect::<Result<Vec<_>, _>>()
            .map_err(|_| read("certificate"))
    };
    let mut roots = RootCertStore::empty();
    for ca in certificates(&identity.ca)? {
        roots.add(ca)?;
    }
    let builder = builder.with_root_certificates(roots);
    if let Party::Anonymous(_) = party {
        return Ok(builder.with_no_client_auth());
    }
    let key = PrivateKeyDer::from_pem_slice(identity.key.as_bytes()).map_err(|_| read("key"))?;
    builder.with_client_auth_cert(certificates(&identity.certificate)?, key)
}

/// What the library says of it, if it says something.
fn tls(error: &io::Error) -> Option<&Error> {
    error.get_ref()?.downcast_ref()
}

fn ended(error: &io::Error) -> Handshake {
    match tls(error) {
        Some(Error::InvalidCertificate(reason)) => distrusted(reason),
        Some(Error::AlertReceived(alert)) => refused(*alert),
        Some(error) => Handshake::NotTls(error.to_string()),
        None if error.kind() == io::ErrorKind::UnexpectedEof => {
            Handshake::NotTls("it closes the connection".to_owned())
        }
        None => Handshake::NotTls(super::words(error)),
    }
}

fn distrusted(reason: &CertificateError) -> Handshake {
    match reason {
        CertificateError::NotValidForNameContext { presented, .. } => {
            Handshake::OtherNames(presented.iter().map(|name| bare(name)).collect())
        }
        CertificateError::NotValidForName => Handshake::OtherNames(vec!["another host".to_owned()]),
        CertificateError::ExpiredContext { not_after, .. } => Handshake::Expired(time(*not_after)),
        CertificateError::NotValidYetContext { not_before, .. } => Handshake::NotYet(time(*not_before)),
        _ => Handshake::Stranger,
    }
}

fn refused(alert: AlertDescription) -> Handshake {
    Handshake::Refused(match alert {
        AlertDescription::UnknownCA | AlertDescription::BadCertificate | AlertDescription::DecryptError => {
            CertificateRefusal::OtherCa
        }
        AlertDescription::CertificateExpired => CertificateRefusal::Time,
        AlertDescription::CertificateRevoked => CertificateRefusal::Revoked,
        AlertDescription::ProtocolVersion | AlertDescription::HandshakeFailure => {
            return Handshake::NotTls("it does not speak TLS 1.3".to_owned());
        }
        alert => CertificateRefusal::Other(format!("TLS alert {alert:?}")),
    })
}

/// `DnsName("lab-pc")`, `IpAddress(10.0.0.1)`: what is within.
fn bare(name: &str) -> String {
    let inner = name.split_once('(').and_then(|(_, rest)| rest.strip_suffix(')')).unwrap_or(name);
    inner.trim_matches('"').to_owned()
}

fn time(time: UnixTime) -> SystemTime {
    UNIX_EPOCH + Duration::from_secs(time.as_secs())
}

/// The time at which certificates are looked at.
#[derive(Debug)]
struct At(SystemTime);

impl TimeProvider for At {
    fn current_time(&self) -> Option<UnixTime> {
        Some(UnixTime::since_unix_epoch(self.0.duration_since(UNIX_EPOCH).ok()?))
    }
}

/// Ends the handshake at the server's certificate: enough to see that it speaks TLS.
#[derive(Debug)]
struct TrustsNobody(Arc<CryptoProvider>);

impl ServerCertVerifier for TrustsNobody {
    fn verify_server_cert(
        &self,
        _: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        Err(CertificateError::UnknownIssuer.into())
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Err(CertificateError::UnknownIssuer.into())
    }

    fn verify_tls13_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Err(CertificateError::UnknownIssuer.into())
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.0.signature_verification_algorithms.supported_schemes()
    }
}
