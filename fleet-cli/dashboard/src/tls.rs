//! TLS in front of the page: 1.3 alone; the page's certificate, and a client certificate of the fleet's CA from who
//! has one. Certificate and registry are read again when their files change.

use super::files::{Stamp, read, stamp};
use super::people::{People, Shown};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring::default_provider;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::server::WebPkiClientVerifier;
use tokio_rustls::rustls::version::TLS13;
use tokio_rustls::rustls::{self, RootCertStore, ServerConfig, ServerConnection};
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::Registry;
use xtb_identity::certificate::Certificate;

/// How soon a changed file is seen: who is revoked is out within two of these.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// Where the page's certificate and the people's names stand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Secure {
    /// The dashboard's identity: `ca.pem`, `page-certificate.pem`, `page-key.pem`.
    pub identity: PathBuf,
    /// The fleet's registry, `identities.toml`.
    pub registry: PathBuf,
}

/// What was read of it.
pub(super) struct Loaded {
    pub(super) acceptor: TlsAcceptor,
    /// Names and addresses that the page's certificate is for.
    pub(super) hosts: Vec<String>,
    pub(super) registry: Registry,
}

impl Secure {
    /// Reads everything.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]: a file is missing, or is not what it should be.
    pub(super) fn load(&self) -> Result<Loaded> {
        let (acceptor, hosts) = self.page()?;
        Ok(Loaded { acceptor, hosts, registry: self.people()? })
    }

    fn page(&self) -> Result<(TlsAcceptor, Vec<String>)> {
        let text = |name: &str| {
            let path = self.identity.join(name);
            read(&path).map_err(|error| {
                broken(&path, &error).hint(
                    "`fleet-cli pki add-service dashboard --address HOST` makes an identity with a certificate for the \
                     page; `fleet-cli enrol dashboard.xtbid` puts it there",
                )
            })
        };
        let (ca, chain, key) = (text("ca.pem")?, text("page-certificate.pem")?, text("page-key.pem")?);
        let path = self.identity.join("page-certificate.pem");
        let hosts = Certificate::parse(&chain).map_err(|error| broken(&path, &error))?.hosts;
        let config = config(&ca, &chain, &key).map_err(|reason| broken(&path, &reason))?;
        Ok((TlsAcceptor::from(Arc::new(config)), hosts))
    }

    fn people(&self) -> Result<Registry> {
        let path = &self.registry;
        let text = read(path).map_err(|error| {
            broken(path, &error).hint(
                "the registry says who may sign in: on another computer than the one with the CA, copy \
                 identities.toml there, and give its folder with --pki",
            )
        })?;
        Registry::parse(&text).map_err(|error| broken(path, &error))
    }

    fn stamps(&self) -> [Option<Stamp>; 2] {
        [stamp(&self.registry), stamp(&self.identity.join("page-certificate.pem"))]
    }

    /// Reads again what has changed, until it is dropped. What cannot be read leaves what was there before.
    pub(super) async fn follow(self, people: People, acceptors: watch::Sender<TlsAcceptor>) {
        let mut known = [None; 2];
        let mut look = tokio::time::interval(LOOK_EVERY);
        loop {
            look.tick().await;
            let own = self.clone();
            // A file system may be slow.
            let looked = tokio::task::spawn_blocking(move || {
                let now = own.stamps();
                let registry = (now[0] != known[0]).then(|| own.people());
                let page = (now[1] != known[1]).then(|| own.page());
                (now, registry, page)
            });
            let Ok((now, registry, page)) = looked.await else { return };
            known = now;
            match registry {
                Some(Ok(registry)) => people.update(registry),
                Some(Err(error)) => tracing::error!("the registry of before goes on: {error}"),
                None => {}
            }
            match page {
                Some(Ok((acceptor, _))) => drop(acceptors.send_replace(acceptor)),
                Some(Err(error)) => tracing::error!("the certificate of before goes on: {error}"),
                None => {}
            }
        }
    }
}

/// What the client of a connection has shown.
pub(super) fn shown(connection: &ServerConnection) -> Option<Shown> {
    Shown::read(connection.peer_certificates()?.first()?)
}

fn config(ca: &str, chain: &str, key: &str) -> std::result::Result<ServerConfig, String> {
    let said = |error: rustls::Error| error.to_string();
    let certificates = |pem: &str| -> std::result::Result<Vec<CertificateDer<'static>>, String> {
        CertificateDer::pem_slice_iter(pem.as_bytes())
            .collect::<std::result::Result<_, _>>()
            .map_err(|error| error.to_string())
    };
    let mut roots = RootCertStore::empty();
    for certificate in certificates(ca)? {
        roots.add(certificate).map_err(said)?;
    }
    let key = PrivateKeyDer::from_pem_slice(key.as_bytes()).map_err(|error| error.to_string())?;
    let provider = Arc::new(default_provider());
    // Who has no certificate signs in; one of another CA, or an expired one, is refused.
    let clients = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), Arc::clone(&provider))
        .allow_unauthenticated()
        .build()
        .map_err(|error| error.to_string())?;
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&TLS13])
        .map_err(said)?
        .with_client_cert_verifier(clients)
        .with_single_cert(certificates(chain)?, key)
        .map_err(said)?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(config)
}

fn broken(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    Error::new(ErrorKind::Config, format!("{}: {reason}", path.display()))
}
