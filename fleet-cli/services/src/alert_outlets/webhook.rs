//! A web server that gets each change as the body of a POST, over HTTP or, with a certificate authority, HTTPS.

use super::{Outlet, QUEUE, Shared};
use hyper::client::conn::http1;
use hyper::header::{CONTENT_TYPE, HOST, USER_AGENT};
use hyper::rt::{Read, Write};
use hyper::{Request, Uri};
use hyper_util::rt::TokioIo;
use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::sync::mpsc;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::ClientConfig;
use tokio_rustls::rustls::pki_types::ServerName;
use xtb_client::{Error, ErrorKind, Result};

/// What is not taken is tried once more, this much later: the server may be just restarting.
const AGAIN_AFTER: Duration = Duration::from_secs(2);

/// Where to post, checked.
#[derive(Debug, Clone)]
pub struct Url {
    uri: Uri,
    host: String,
    port: u16,
    tls: Option<Arc<ClientConfig>>,
}

/// A web hook.
#[derive(Debug, Clone)]
pub struct WebhookOutlet {
    /// Where to post.
    pub url: Url,
    /// Connecting, sending and the answer may take this long.
    pub timeout: Duration,
}

impl Url {
    /// `http://HOST[:PORT]/PATH` or, with TLS, `https://…`. `authority` is the file of the certificates that the
    /// server's own has to come from.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]: no such URL, or no certificates.
    pub fn new(url: &str, authority: Option<&Path>) -> Result<Self> {
        let invalid = |what: &str| {
            Error::new(ErrorKind::Config, format!("{url:?} is no web hook: {what}")).hint(
                "such as http://127.0.0.1:8000/alerts, or https://chat.example/hook with webhook_ca = \
                 \"/etc/ssl/certs/ca-certificates.crt\"",
            )
        };
        let uri: Uri = url.parse().map_err(|error| invalid(&format!("{error}")))?;
        let usual = match uri.scheme_str() {
            Some("http") => 80,
            Some("https") => 443,
            _ => return Err(invalid("it begins neither with http:// nor with https://")),
        };
        let host = uri.host().filter(|host| !host.is_empty()).ok_or_else(|| invalid("no host"))?;
        if uri.authority().is_some_and(|authority| authority.as_str().contains('@')) {
            return Err(invalid("a user in it would be logged"));
        }
        let tls = match (usual, authority) {
            (443, Some(file)) => Some(crate::vda5050::trusting(file)?),
            (443, None) => return Err(invalid("https needs webhook_ca, the server's certificate authority")),
            (_, Some(_)) => return Err(invalid("webhook_ca is for https:// only")),
            _ => None,
        };
        let host = host.trim_start_matches('[').trim_end_matches(']').to_owned();
        let port = uri.port_u16().unwrap_or(usual);
        Ok(Self { host, port, tls, uri })
    }
}

/// Starts the task that posts, one change after the other.
pub(super) fn start(outlet: WebhookOutlet) -> Outlet {
    let (sender, mut waiting) = mpsc::channel::<String>(QUEUE);
    let shared = Arc::<Shared>::default();
    let counters = Arc::clone(&shared);
    tokio::spawn(async move {
        // Not the path: it may hold a secret.
        let name = format!("web hook at {}:{}", outlet.url.host, outlet.url.port);
        while let Some(body) = waiting.recv().await {
            let mut posted = post(&outlet, &body).await;
            if posted.is_err() {
                tokio::time::sleep(AGAIN_AFTER).await;
                posted = post(&outlet, &body).await;
            }
            counters.count(&name, &posted);
        }
    });
    Outlet { send: Box::new(move |body| sender.try_send(body).is_ok()), shared }
}

async fn post(WebhookOutlet { url, timeout }: &WebhookOutlet, body: &str) -> std::result::Result<(), String> {
    let posting = async {
        let stream = TcpStream::connect((url.host.as_str(), url.port)).await.map_err(words)?;
        match &url.tls {
            None => exchange(TokioIo::new(stream), url, body).await,
            Some(config) => {
                let name = ServerName::try_from(url.host.clone()).map_err(words)?;
                let stream =
                    TlsConnector::from(Arc::clone(config)).connect(name, stream).await.map_err(words)?;
                exchange(TokioIo::new(stream), url, body).await
            }
        }
    };
    let posted = tokio::time::timeout(*timeout, posting).await;
    posted.unwrap_or_else(|_| Err(format!("no answer within {} s", timeout.as_secs_f64())))
}

async fn exchange(
    stream: impl Read + Write + Unpin + Send + 'static,
    url: &Url,
    body: &str,
) -> std::result::Result<(), String> {
    let (mut sender, connection) = http1::handshake::<_, String>(stream).await.map_err(words)?;
    let driving = tokio::spawn(connection);
    let target = url.uri.path_and_query().map_or("/", |target| target.as_str());
    let host = url.uri.authority().map_or("", |authority| authority.as_str());
    let request = Request::post(target)
        .header(HOST, host)
        .header(USER_AGENT, concat!("fleet-cli/", env!("CARGO_PKG_VERSION")))
        .header(CONTENT_TYPE, "application/json")
        .body(body.to_owned())
        .map_err(words)?;
    let answer = sender.send_request(request).await;
    driving.abort();
    let status = answer.map_err(words)?.status();
    if status.is_success() { Ok(()) } else { Err(format!("answered with {status}")) }
}

fn words(error: impl Display) -> String {
    error.to_string()
}
