//! The dashboard's HTTP server: page, socket, and nothing that changes anything by a plain request.

use super::frames::Hello;
use super::{assets, socket};
use crate::client::Client;
use crate::error::{Failure, Kind, Result};
use crate::scene::live::Shared;
use axum::Router;
use axum::extract::{Request, State, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_protocol::Name;

/// Longest message from a page, in bytes.
const MAX_MESSAGE: usize = 16 * 1024;

/// What all requests share.
pub(super) struct App {
    pub(super) scene: Arc<Shared>,
    pub(super) client: Client,
    ticks: watch::Sender<u64>,
}

impl App {
    pub(super) fn hello(&self, client: Name) -> Hello {
        Hello {
            fleet: self.client.fleet().clone(),
            client,
            version: env!("CARGO_PKG_VERSION"),
            writable: true,
            why_not: None,
            live: true,
        }
    }

    pub(super) fn ticks(&self) -> watch::Receiver<u64> {
        self.ticks.subscribe()
    }
}

/// A server that runs until it is dropped.
pub struct Running {
    address: SocketAddr,
    tasks: [JoinHandle<()>; 2],
}

impl Drop for Running {
    fn drop(&mut self) {
        self.tasks.iter().for_each(JoinHandle::abort);
    }
}

impl Running {
    /// Listens.
    ///
    /// # Errors
    /// [`Kind::PortTaken`].
    pub async fn start(client: &Client, scene: Arc<Shared>, listen: SocketAddr, hz: f64) -> Result<Self> {
        let listener = TcpListener::bind(listen).await.map_err(|error| taken(listen, &error))?;
        let address = listener.local_addr()?;
        let app = Arc::new(App { scene, client: client.clone(), ticks: watch::channel(0).0 });
        let ticker = tokio::spawn(tick(Arc::clone(&app), Duration::from_secs_f64(1.0 / hz)));
        let router = Router::new().route("/ws", get(upgrade)).fallback(asset).with_state(app);
        let serving = tokio::spawn(async move {
            if let Err(error) = axum::serve(listener, router).await {
                tracing::error!("the dashboard: {error}");
            }
        });
        Ok(Self { address, tasks: [ticker, serving] })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

async fn tick(app: Arc<App>, every: Duration) {
    let mut ticks = tokio::time::interval(every);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        ticks.tick().await;
        app.ticks.send_modify(|n| *n += 1);
    }
}

async fn upgrade(State(app): State<Arc<App>>, upgrade: WebSocketUpgrade) -> Response {
    let upgrade = upgrade.max_message_size(MAX_MESSAGE).max_frame_size(MAX_MESSAGE);
    upgrade.on_upgrade(move |socket| socket::serve(app, socket))
}

async fn asset(request: Request) -> Response {
    assets::answer(request.uri().path(), request.headers())
        .unwrap_or_else(|| (StatusCode::NOT_FOUND, "there is no such page").into_response())
}

fn taken(listen: SocketAddr, error: &std::io::Error) -> Failure {
    match error.kind() {
        std::io::ErrorKind::AddrInUse => Failure::new(Kind::PortTaken, format!("{listen} is already in use"))
            .hint("another dashboard runs there: end it, or choose a port with --listen"),
        _ => Failure::new(Kind::Usage, format!("cannot listen on {listen}: {error}"))
            .hint("an address looks like 127.0.0.1:8080"),
    }
}
