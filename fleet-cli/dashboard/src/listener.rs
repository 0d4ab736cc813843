//! Connections, bounded: how many there are, and how long each may take for what it says and hears.

use super::metrics::Metrics;
use super::people::Shown;
use super::places::{Place, Places};
use super::tls;
use axum::Router;
use axum::http::StatusCode;
use axum::serve::Listener;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::future::Future;
use std::io;
use std::net::IpAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::{Instant, Sleep};
use tokio_rustls::TlsAcceptor;

/// A request's first line and headers are there within this, from when it is waited for; so is a TLS handshake.
const HEADERS_WITHIN: Duration = Duration::from_secs(5);
/// A page answers each frame, and a browser's other requests are short: who says nothing for so long is
/// gone.
const SILENT: Duration = Duration::from_secs(60);
/// Who takes nothing of what is sent for so long does not read it.
const STUCK: Duration = Duration::from_secs(10);
/// What is read ahead of one connection, in bytes; longer headers are refused.
const READ_AHEAD: usize = 32 * 1024;
/// To whom there is no room for.
const NO_ROOM: &[u8] =
    b"HTTP/1.1 503 Service Unavailable\r\nconnection: close\r\ncontent-length: 25\r\n\r\ntoo many connections here";

/// To whom speaks HTTP where TLS is spoken.
const NOT_TLS: &[u8] = b"HTTP/1.1 400 Bad Request\r\nconnection: close\r\ncontent-type: text/plain\r\n\
     content-length: 47\r\n\r\nthis address speaks TLS: begin it with https://\n";
/// The first byte of a TLS connection.
const HANDSHAKE: u8 = 22;

/// Who is at the other end of a connection; each of its requests bears it.
#[derive(Debug, Clone)]
pub(super) struct Peer {
    /// Its address.
    pub(super) from: IpAddr,
    /// The client certificate that it has shown.
    pub(super) certificate: Option<Shown>,
}

/// What is spoken.
#[derive(Clone)]
pub(super) enum Speaks {
    /// HTTP.
    Plain,
    /// HTTP in TLS; the latest is used.
    Tls(watch::Receiver<TlsAcceptor>),
}

/// Answers connections until it is dropped.
pub(super) async fn serve(
    mut listener: TcpListener,
    places: Places,
    speaks: Speaks,
    router: Router,
    metrics: &Metrics,
) {
    let mut open = JoinSet::new();
    loop {
        // It waits where the system has no room for a connection.
        let (stream, from) = Listener::accept(&mut listener).await;
        while open.try_join_next().is_some() {}
        let Some(place) = places.take(from.ip()) else {
            metrics.refused("connections");
            if matches!(speaks, Speaks::Plain) {
                // Whether it hears that is its own affair.
                let _ = stream.try_write(NO_ROOM);
            }
            continue;
        };
        // Frames are small and late ones are worth nothing.
        if stream.set_nodelay(true).is_ok() {
            let (place, router, from) = (Arc::new(place), router.clone(), from.ip().to_canonical());
            let metrics = metrics.clone();
            match &speaks {
                Speaks::Plain => {
                    let peer = Peer { from, certificate: None };
                    let connection = Connection::new(stream, Arc::clone(&place));
                    open.spawn(answer(connection, peer, place, router));
                }
                Speaks::Tls(acceptors) => {
                    let acceptor = acceptors.borrow().clone();
                    open.spawn(answer_tls(stream, acceptor, from, place, router, metrics));
                }
            }
        }
    }
}

/// The same after a handshake, which takes no longer than a request's headers may.
async fn answer_tls(
    stream: TcpStream,
    acceptor: TlsAcceptor,
    from: IpAddr,
    place: Arc<Place>,
    router: Router,
    metrics: Metrics,
) {
    let own = Arc::clone(&place);
    let handshake = async {
        let mut first = [0];
        if stream.peek(&mut first).await? > 0 && first != [HANDSHAKE] {
            // What is left unread would take the answer with it.
            let _ = (stream.try_read(&mut [0; 4096]), stream.try_write(NOT_TLS));
            return Err(io::Error::new(io::ErrorKind::InvalidData, "it does not speak TLS"));
        }
        acceptor.accept(Connection::new(stream, own)).await
    };
    let done = tokio::select! {
        done = tokio::time::timeout(HEADERS_WITHIN, handshake) => done,
        () = place.taken() => return,
    };
    match done.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into())) {
        Ok(stream) => {
            let certificate = tls::shown(stream.get_ref().1);
            answer(stream, Peer { from, certificate }, place, router).await;
        }
        Err(error) => {
            metrics.refused("handshake");
            tracing::debug!("a TLS handshake of {from} with the dashboard: {error}");
        }
    }
}

/// One connection, until it ends, becomes a page's socket, or has to make room.
async fn answer<S: AsyncRead + AsyncWrite + Unpin + Send + 'static>(
    stream: S,
    peer: Peer,
    place: Arc<Place>,
    router: Router,
) {
    let router = TowerToHyperService::new(router);
    let working = Arc::clone(&place);
    let service = service_fn(move |mut request: hyper::Request<hyper::body::Incoming>| {
        working.at_work();
        request.extensions_mut().insert(peer.clone());
        let (response, place) = (router.call(request), Arc::clone(&working));
        async move {
            let response = response.await;
            let is_socket =
                response.as_ref().is_ok_and(|response| response.status() == StatusCode::SWITCHING_PROTOCOLS);
            if !is_socket {
                place.idle();
            }
            response
        }
    });
    let io = TokioIo::new(stream);
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEADERS_WITHIN).max_buf_size(READ_AHEAD);
    tokio::select! {
        ended = http.serve_connection(io, service).with_upgrades() => {
            if let Err(error) = ended {
                tracing::debug!("a connection to the dashboard: {error}");
            }
        }
        () = place.taken() => {}
    }
}

/// A connection that ends when nothing is read from it for [`SILENT`], or it takes nothing for [`STUCK`].
struct Connection {
    stream: TcpStream,
    silent: Pin<Box<Sleep>>,
    stuck: Option<Pin<Box<Sleep>>>,
    _place: Arc<Place>,
}

impl Connection {
    fn new(stream: TcpStream, place: Arc<Place>) -> Self {
        let silent = Box::pin(tokio::time::sleep(SILENT));
        Self { stream, silent, stuck: None, _place: place }
    }

    /// What came of a write; one that cannot go on for too long has failed.
    fn written(&mut self, cx: &mut Context<'_>, write: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        if write.is_ready() {
            self.stuck = None;
            return write;
        }
        let stuck = self.stuck.get_or_insert_with(|| Box::pin(tokio::time::sleep(STUCK)));
        match stuck.as_mut().poll(cx) {
            Poll::Ready(()) => Poll::Ready(Err(io::ErrorKind::TimedOut.into())),
            Poll::Pending => Poll::Pending,
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if let Poll::Ready(read) = Pin::new(&mut self.stream).poll_read(cx, buffer) {
            self.silent.as_mut().reset(Instant::now() + SILENT);
            return Poll::Ready(read);
        }
        match self.silent.as_mut().poll(cx) {
            Poll::Ready(()) => Poll::Ready(Err(io::ErrorKind::TimedOut.into())),
            Poll::Pending => Poll::Pending,
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let write = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.written(cx, write)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let write = Pin::new(&mut self.stream).poll_write_vectored(cx, bytes);
        self.written(cx, write)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}
