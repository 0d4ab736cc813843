//! What Zenoh needs of an identity: three files, TLS 1.3, certificates on both sides.

use std::path::{Path, PathBuf};

/// The files of an identity, all PEM. A session reads certificate and key again whenever it connects, so a renewed
/// certificate needs no restart; a router reads them when it is opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tls {
    /// The CA of those who are trusted.
    pub ca: PathBuf,
    /// The own certificate.
    pub certificate: PathBuf,
    /// Its key.
    pub key: PathBuf,
}

impl Tls {
    /// The files in an identity's folder.
    #[must_use]
    pub fn in_folder(folder: &Path) -> Self {
        let file = |name| folder.join(name);
        Self { ca: file("ca.pem"), certificate: file("certificate.pem"), key: file("key.pem") }
    }

    /// Zenoh's settings and their values in JSON.
    pub(crate) fn settings(&self, listens: bool) -> Vec<(&'static str, String)> {
        let text = |path: &Path| serde_json::Value::from(path.to_string_lossy()).to_string();
        let mut settings = vec![
            ("transport/link/tls/root_ca_certificate", text(&self.ca)),
            ("transport/link/tls/enable_mtls", "true".into()),
            ("transport/link/tls/verify_name_on_connect", "true".into()),
            ("transport/link/tls/close_link_on_expiration", "true".into()),
            ("transport/link/tls/connect_certificate", text(&self.certificate)),
            ("transport/link/tls/connect_private_key", text(&self.key)),
            ("adminspace/enabled", "false".into()),
            // Peers would talk to each other past the router's rules.
            ("scouting/gossip/enabled", "false".into()),
        ];
        if listens {
            settings.push(("transport/link/tls/listen_certificate", text(&self.certificate)));
            settings.push(("transport/link/tls/listen_private_key", text(&self.key)));
        }
        settings
    }
}
