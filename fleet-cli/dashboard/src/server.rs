//! The dashboard's HTTP server: page, socket, metrics. No robot is reached by a plain request.

use super::access::{Access, Visitor};
use super::app::{App, Shown};
use super::listener::{Peer, Speaks};
use super::metrics::Metrics;
use super::people::People;
use super::places::Places;
use super::security::{Entry, Guard, HEADERS, Origin, Refusal, TLS_ONLY};
use super::tls::{Loaded, Secure};
use super::{assets, listener, playback_routes, sign_in, socket};
use axum::extract::ws::WebSocket;
use axum::extract::{Request, State, WebSocketUpgrade};
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::net::{TcpListener, TcpSocket};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use tokio_rustls::TlsAcceptor;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Uuid;
use xtb_protocol::messages::{MapEdit, Message as _};

/// Pages that may be connected at once.
pub(super) const MOST_SOCKETS: usize = 16;
/// Longest message from a page, in bytes: an edit of the map.
const MAX_MESSAGE: usize = MapEdit::MAX_BYTES;
/// Bytes of a message that wait for the network before it is told to take them.
const WRITE_BUFFER: usize = 64 * 1024;
/// What the system keeps for a page that does not read, in bytes; else it may be megabytes.
const SEND_BUFFER: u32 = 256 * 1024;
/// Connections that wait in the system's queue.
const BACKLOG: u32 = 128;
/// Pages and wheels that are waited for at the end.
const BUSY: u32 = 1024;
/// Sockets are closed, wheels let go, and then it ends.
const ENDS_WITHIN: Duration = Duration::from_millis(1500);

/// How it is served.
#[derive(Debug, Clone)]
pub struct ServerSettings {
    /// Where; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Over TLS, where people sign in. `None` = plain HTTP.
    pub secure: Option<Secure>,
    /// Without TLS: who does not know it stays out.
    pub token: Option<String>,
    /// Others may reach it without TLS.
    pub insecure: bool,
    /// No commands.
    pub read_only: bool,
    /// Pages behind a proxy that may command.
    pub allow_origins: Vec<Origin>,
    /// Proxies that stand in front: their connections are those of many people.
    pub proxies: Vec<IpAddr>,
    /// Frames a second at most.
    pub hz: f64,
}

impl ServerSettings {
    /// Whether it may be served so: to be asked before anything else is begun.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: others can reach it without TLS, or it has a token that is too short;
    /// [`ErrorKind::Config`]: what TLS needs cannot be read.
    pub fn check(&self) -> Result<()> {
        self.access(String::new()).map(drop)
    }

    /// How people get in, and what is spoken.
    fn access(&self, cookie: String) -> Result<(Access, Option<TlsAcceptor>)> {
        let Some(secure) = &self.secure else {
            return Ok((Access::plain(self.listen, self.token.clone(), cookie, self.insecure)?, None));
        };
        if self.token.is_some() {
            return Err(Error::new(ErrorKind::Invalid, "with TLS each person signs in with an own token")
                .hint("leave --token out, or unset XTB_DASHBOARD_TOKEN"));
        }
        let Loaded { acceptor, hosts, registry } = secure.load()?;
        Ok((Access::People { people: People::new(registry), hosts }, Some(acceptor)))
    }
}

/// A server that runs until it is stopped or dropped.
pub struct Running {
    address: SocketAddr,
    url: String,
    stop: watch::Sender<bool>,
    places: Arc<Semaphore>,
    busy: Arc<Semaphore>,
    tasks: Vec<JoinHandle<()>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.send_replace(true);
        self.tasks.iter().for_each(JoinHandle::abort);
    }
}

impl Running {
    /// Listens.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: another address than loopback without a token; [`ErrorKind::PortTaken`].
    pub async fn start(settings: ServerSettings, shown: Shown) -> Result<Self> {
        let cookie = Uuid::new_v4().simple().to_string();
        let (access, acceptor) = settings.access(cookie)?;
        let ServerSettings { listen, secure, token, read_only, allow_origins, proxies, hz, .. } = settings;
        let listener = bind(listen).map_err(|error| taken(listen, &error))?;
        let address = listener.local_addr()?;
        let url = url(address, &access, token.as_deref());
        let guard = Guard::new(listen.ip(), access, allow_origins);
        let (stop, stopped) = watch::channel(false);
        let places = Arc::new(Semaphore::new(MOST_SOCKETS));
        let busy = Arc::new(Semaphore::new(BUSY as usize));
        let app = Arc::new(App {
            metrics: Metrics::new(Arc::clone(&shown.scene)),
            shown,
            read_only,
            guard,
            began: Instant::now(),
            ticks: watch::channel(0).0,
            linked: AtomicBool::new(true),
            places: Arc::clone(&places),
            stop: stopped,
            busy: Arc::clone(&busy),
        });
        let ticker = tokio::spawn(tick(Arc::clone(&app), Duration::from_secs_f64(1.0 / hz)));
        let mut tasks = vec![ticker];
        let speaks = match (secure, acceptor, app.guard.people()) {
            (Some(secure), Some(acceptor), Some(people)) => {
                let (acceptors, latest) = watch::channel(acceptor);
                tasks.push(tokio::spawn(secure.follow(people.clone(), acceptors)));
                Speaks::Tls(latest)
            }
            _ => Speaks::Plain,
        };
        tasks.push(tokio::spawn(async move {
            let router = router(Arc::clone(&app));
            listener::serve(listener, Places::new(&proxies), speaks, router, &app.metrics).await;
        }));
        Ok(Self { address, url, stop, places, busy, tasks })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Pages that are connected.
    #[must_use]
    pub fn pages(&self) -> usize {
        MOST_SOCKETS - self.places.available_permits()
    }

    /// What to open in a browser.
    #[must_use]
    pub fn url(&self) -> String {
        self.url.clone()
    }

    /// Closes all sockets, lets all wheels go, and ends, within 2 s.
    pub async fn stop(self) {
        self.stop.send_replace(true);
        self.tasks.iter().for_each(JoinHandle::abort);
        if tokio::time::timeout(ENDS_WITHIN, self.busy.acquire_many(BUSY)).await.is_err() {
            tracing::warn!("some pages did not close in time");
        }
    }
}

/// What to open in a browser: over TLS, by a name that the certificate is for.
fn url(address: SocketAddr, access: &Access, token: Option<&str>) -> String {
    let Access::People { hosts, .. } = access else {
        let token = token.map(|token| format!("?token={}", escaped(token)));
        return format!("http://{address}/{}", token.unwrap_or_default());
    };
    let ip = address.ip().to_string();
    let host = match hosts.first() {
        Some(first) if !hosts.contains(&ip) => first,
        _ => &ip,
    };
    let host = if host.contains(':') { format!("[{host}]") } else { host.clone() };
    format!("https://{host}:{}/", address.port())
}

/// What may stand in a query as it is.
fn escaped(token: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'_' | b'.' | b'~');
    token.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

async fn tick(app: Arc<App>, every: Duration) {
    let mut ticks = tokio::time::interval(every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    loop {
        ticks.tick().await;
        if let Some(client) = &app.shown.commands {
            app.linked.store(client.bus().is_linked().await, Ordering::Relaxed);
        }
        app.ticks.send_modify(|n| *n += 1);
    }
}

fn router(app: Arc<App>) -> Router {
    Router::new()
        .route("/ws", get(upgrade))
        .route("/metrics", get(metrics))
        .route("/healthz", get(|| async { "ok\n" }))
        .merge(sign_in::routes())
        .merge(playback_routes::routes())
        .fallback(page)
        .layer(from_fn_with_state(Arc::clone(&app), guarded))
        .with_state(app)
}

/// Nobody comes past this.
async fn guarded(
    State(app): State<Arc<App>>,
    Extension(peer): Extension<Peer>,
    mut request: Request,
    next: Next,
) -> Response {
    let admitted = app.guard.admit(request.method(), request.uri(), request.headers(), &peer);
    let is_page = *request.method() == Method::GET && request.uri().path() == "/";
    let mut response = match admitted {
        Ok(Entry::In(visitor)) => {
            request.extensions_mut().insert(visitor);
            next.run(request).await
        }
        Ok(Entry::SetCookie) => welcome(&app.guard),
        Err(Refusal::SignIn) if is_page => sign_in::lead(),
        Err(refusal) => {
            app.metrics.refused(refusal.name());
            let status = match refusal {
                Refusal::Token | Refusal::SignIn => StatusCode::UNAUTHORIZED,
                Refusal::Guesses => StatusCode::TOO_MANY_REQUESTS,
                Refusal::Host | Refusal::Origin => StatusCode::FORBIDDEN,
            };
            (status, refusal.text()).into_response()
        }
    };
    let headers = response.headers_mut();
    for (name, value) in HEADERS.into_iter().chain(app.guard.people().map(|_| TLS_ONLY)) {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    response
}

/// The token leaves the address bar. A redirect would not bear the cookie if another site led here.
fn welcome(guard: &Guard) -> Response {
    let headers = [
        (header::SET_COOKIE, guard.set_cookie()),
        (header::REFRESH, "0; url=/".to_owned()),
        (header::CONTENT_TYPE, "text/html; charset=utf-8".to_owned()),
    ];
    (headers, "<!doctype html><title>XTB fleet</title><a href=\"/\">The dashboard</a>\n").into_response()
}

async fn upgrade(
    State(app): State<Arc<App>>,
    Extension(visitor): Extension<Visitor>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let Ok(place) = Arc::clone(&app.places).try_acquire_owned() else {
        app.metrics.refused("full");
        let text = format!("too many pages: {MOST_SOCKETS} pages are connected; close one of them\n");
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    };
    upgrade
        .max_message_size(MAX_MESSAGE)
        .max_frame_size(MAX_MESSAGE)
        .write_buffer_size(WRITE_BUFFER)
        .on_upgrade(move |socket| serve(app, socket, visitor, place))
}

async fn serve(app: Arc<App>, socket: WebSocket, visitor: Visitor, place: OwnedSemaphorePermit) {
    app.metrics.sockets.inc();
    let gauge = app.metrics.sockets.clone();
    socket::serve(app, socket, visitor).await;
    gauge.dec();
    drop(place);
}

async fn metrics(State(app): State<Arc<App>>) -> Response {
    const TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    match app.metrics.text() {
        Ok(text) => ([(header::CONTENT_TYPE, TYPE)], text).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn page(request: Request) -> Response {
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return (StatusCode::METHOD_NOT_ALLOWED, "commands are accepted only over the page's socket\n")
            .into_response();
    }
    assets::answer(request.uri().path(), request.headers())
        .unwrap_or_else(|| (StatusCode::NOT_FOUND, "page not found\n").into_response())
}

fn bind(listen: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = if listen.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    socket.set_reuseaddr(true)?;
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.bind(listen)?;
    socket.listen(BACKLOG)
}

fn taken(listen: SocketAddr, error: &std::io::Error) -> Error {
    match error.kind() {
        std::io::ErrorKind::AddrInUse => {
            Error::new(ErrorKind::PortTaken, format!("{listen} is already in use"))
                .hint("another dashboard uses it: end that one, or choose another port with --listen")
        }
        _ => Error::new(ErrorKind::Invalid, format!("cannot listen on {listen}: {error}"))
            .hint("an address looks like 127.0.0.1:8080"),
    }
}
