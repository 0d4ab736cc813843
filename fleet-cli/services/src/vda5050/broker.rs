//! Where the broker is, and how it is reached.

use super::failed;
use rumqttc::{LastWill, MqttOptions, QoS, TlsConfiguration, Transport};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::CertificateDer;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use xtb_client::{Error, ErrorKind, Result};
use xtb_recording::files;
use xtb_vda5050::incoming::MAX_BYTES;

/// A broker that is not heard for half as long again is gone; the standard wants some 15 s.
const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// Longest packet that is read. What is longer ends the connection, what is shorter and still too long is an error of
/// the order.
const MAX_PACKET: usize = 4 * MAX_BYTES;
/// Longest password that is read, in bytes.
const MAX_PASSWORD: usize = 4096;
/// Longest file of certificates, in bytes.
const MAX_CERTIFICATES: usize = 1 << 20;

/// Who logs in at a broker.
#[derive(Clone)]
pub struct Login {
    user: String,
    password: String,
}

impl std::fmt::Debug for Login {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Login").field("user", &self.user).finish_non_exhaustive()
    }
}

impl Login {
    /// A user, and the file whose first line is the password.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]: the file cannot be read.
    pub fn read(user: &str, password: Option<&Path>) -> Result<Self> {
        let read = |path: &Path| {
            let cannot = |what: String| failed(format!("cannot read {}: {what}", path.display()));
            let text = files::text(path, MAX_PASSWORD).map_err(|error| cannot(error.to_string()))?;
            Ok::<_, Error>(text.lines().next().unwrap_or_default().to_owned())
        };
        let password = password.map(read).transpose()?.unwrap_or_default();
        Ok(Self { user: user.to_owned(), password })
    }
}

/// A broker.
#[derive(Debug, Clone)]
pub struct Broker {
    host: String,
    port: u16,
    tls: Option<Arc<ClientConfig>>,
    login: Option<Login>,
}

impl Broker {
    /// `mqtt://HOST[:PORT]` or, with TLS, `mqtts://HOST[:PORT]`. `authority` is the file of the certificates that a
    /// broker's own has to come from.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: no such URL; [`ErrorKind::Config`]: no certificates.
    pub fn new(url: &str, authority: Option<&Path>, login: Option<Login>) -> Result<Self> {
        let invalid = |what: &str| {
            Error::new(ErrorKind::Invalid, format!("{url:?} is no broker: {what}"))
                .hint("such as mqtt://127.0.0.1:1883, or mqtts://broker.example --mqtt-ca ca.pem")
        };
        let (scheme, rest) =
            url.split_once("://").ok_or_else(|| invalid("it does not begin with mqtt://"))?;
        let usual = match scheme {
            "mqtt" => 1883,
            "mqtts" => 8883,
            _ => return Err(invalid("it begins neither with mqtt:// nor with mqtts://")),
        };
        if rest.contains(['/', '@', '?', '#']) {
            return Err(invalid("there is more in it than host and port; --mqtt-user names a user"));
        }
        let (host, port) = match rest.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            Some((host, "")) => (host, None),
            Some((host, port)) => (host, Some(port.strip_prefix(':').ok_or_else(|| invalid("no port"))?)),
            None => rest.split_once(':').map_or((rest, None), |(host, port)| (host, Some(port))),
        };
        let port = port.map_or(Ok(usual), str::parse).map_err(|_| invalid("no port"))?;
        if host.is_empty() || host.chars().any(|c| c.is_control() || c.is_whitespace()) {
            return Err(invalid("no host"));
        }
        let tls = match (scheme, authority) {
            ("mqtts", Some(file)) => Some(trusting(file)?),
            ("mqtts", None) => return Err(invalid("TLS needs the broker's certificate authority")),
            (_, Some(_)) => return Err(invalid("a certificate authority is for mqtts:// only")),
            _ => None,
        };
        Ok(Self { host: host.to_owned(), port, tls, login })
    }

    /// `host:port`, for people.
    #[must_use]
    pub fn place(&self) -> String {
        format!("{}:{}", self.host, self.port)
    }

    /// A connection of this client, with what the broker shall say when it is gone.
    pub(super) fn options(&self, client_id: &str, will: LastWill) -> MqttOptions {
        let mut options = MqttOptions::new(client_id, &self.host, self.port);
        options.set_keep_alive(KEEP_ALIVE).set_clean_session(true).set_last_will(will);
        options.set_max_packet_size(MAX_PACKET, MAX_PACKET);
        if let Some(Login { user, password }) = &self.login {
            options.set_credentials(user, password);
        }
        if let Some(tls) = &self.tls {
            let tls = TlsConfiguration::Rustls(Arc::clone(tls));
            options.set_transport(Transport::tls_with_config(tls));
        }
        options
    }
}

/// A last will: retained, and sure to arrive.
pub(super) fn will(topic: String, message: &serde_json::Value) -> LastWill {
    LastWill::new(topic, message.to_string(), QoS::AtLeastOnce, true)
}

/// TLS that trusts the authorities in this file, and nobody else.
pub(crate) fn trusting(file: &Path) -> Result<Arc<ClientConfig>> {
    let cannot = |what: String| failed(format!("{}: {what}", file.display()));
    let mut roots = RootCertStore::empty();
    let pem = files::bytes(file, MAX_CERTIFICATES).map_err(|error| cannot(error.to_string()))?;
    for certificate in CertificateDer::pem_slice_iter(&pem) {
        let certificate = certificate.map_err(|error| cannot(error.to_string()))?;
        roots.add(certificate).map_err(|error| cannot(error.to_string()))?;
    }
    if roots.is_empty() {
        return Err(cannot("no certificate".to_owned()));
    }
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(|error| cannot(error.to_string()))?;
    Ok(Arc::new(config.with_root_certificates(roots).with_no_client_auth()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broker_is_a_scheme_a_host_and_a_port() {
        let place = |url: &str| Broker::new(url, None, None).map(|broker| broker.place());
        assert_eq!(place("mqtt://broker.example").unwrap(), "broker.example:1883");
        assert_eq!(place("mqtt://[::1]:1884").unwrap(), "::1:1884");
        for bad in [
            "broker:1883",
            "http://a",
            "mqtt://",
            "mqtt://u:p@a",
            "mqtt://a/b",
            "mqtt://a:x",
            "mqtt://a b",
            "mqtts://a",
        ] {
            assert_eq!(place(bad).unwrap_err().kind, ErrorKind::Invalid, "{bad}");
        }
    }

    #[test]
    fn files_that_cannot_be_used_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let (missing, empty) = (folder.path().join("no.pem"), folder.path().join("empty.pem"));
        std::fs::write(&empty, "").unwrap();
        for file in [&missing, &empty] {
            let failure = Broker::new("mqtts://a", Some(file), None).unwrap_err();
            assert!(failure.kind == ErrorKind::Config && failure.message.contains(".pem"), "{failure}");
        }
        let password = folder.path().join("password");
        std::fs::write(&password, "secret\n").unwrap();
        let login = Login::read("fleet", Some(&password)).unwrap();
        assert!(login.password == "secret" && !format!("{login:?}").contains("secret"));
        assert!(Login::read("fleet", Some(&missing)).unwrap_err().message.contains("no.pem"));
    }
}
