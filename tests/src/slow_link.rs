//! A slow link: a TCP proxy on loopback that delays, throttles and stalls what passes between a client and
//! its router.
//!
//! Each direction is one queue for all connections, as a radio link is: bytes leave it at its rate, in order,
//! and arrive after the delay. A queue holds [`LinkQuality::queue_bytes`] at most; when it is full the proxy
//! reads no more, and the sender meets TCP's own back pressure. Socket buffers are kept small so that nothing
//! else holds a backlog.

use rand_core::Rng;
use rand_pcg::Pcg32;
use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::io::AsyncWriteExt;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, watch};
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::Instant;

/// A packet's payload.
const CHUNK_BYTES: usize = 1448;
/// Of each socket, in bytes; the system doubles it.
const SOCKET_BUFFER: u32 = 16 * 1024;
/// Packets on their way in one connection and direction, at most.
const PACKETS: usize = 4096;
/// Connections that wait to be accepted.
const BACKLOG: u32 = 64;

/// What a link is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkQuality {
    /// Each way.
    pub delay: Duration,
    /// Added to the delay of each packet: uniform, from nothing to this. Packets stay in order.
    pub jitter: Duration,
    /// Each way; `None` = as fast as it likes.
    pub bits_per_s: Option<u64>,
    /// What may wait in each direction's queue, in bytes.
    pub queue_bytes: usize,
}

impl Default for LinkQuality {
    fn default() -> Self {
        Self { delay: Duration::ZERO, jitter: Duration::ZERO, bits_per_s: None, queue_bytes: 4 * 1024 * 1024 }
    }
}

impl LinkQuality {
    /// A link that only delays.
    #[must_use]
    pub fn delayed(each_way: Duration) -> Self {
        Self { delay: each_way, ..Self::default() }
    }

    /// A link of so many bits a second, with a queue of 64 KiB.
    #[must_use]
    pub fn throttled(bits_per_s: u64) -> Self {
        Self { bits_per_s: Some(bits_per_s), queue_bytes: 64 * 1024, ..Self::default() }
    }
}

/// A link on its way to one router, until it is dropped.
pub struct SlowLink {
    endpoint: String,
    up: Arc<Direction>,
    down: Arc<Direction>,
    stalled: watch::Sender<bool>,
    serving: JoinHandle<()>,
}

impl Drop for SlowLink {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

impl SlowLink {
    /// A link to the router at `router`, such as `tcp/127.0.0.1:7447`. The jitter follows from `seed`.
    ///
    /// # Panics
    /// If `router` is no address, or no port is free.
    pub async fn open(router: &str, quality: LinkQuality, seed: u64) -> Self {
        let address = router.strip_prefix("tcp/").and_then(|address| address.parse().ok());
        let router: SocketAddr = address.unwrap_or_else(|| panic!("{router} is no TCP address"));
        let listener = listen().unwrap_or_else(|error| panic!("a slow link: {error}"));
        let own = listener.local_addr().unwrap_or_else(|error| panic!("a slow link: {error}"));
        let direction = |seed| Arc::new(Direction::new(quality, seed));
        let (up, down) = (direction(seed), direction(seed ^ u64::MAX));
        let (stalled, stalls) = watch::channel(false);
        let serving = tokio::spawn(serve(listener, router, up.clone(), down.clone(), stalls));
        Self { endpoint: format!("tcp/{own}"), up, down, stalled, serving }
    }

    /// Where a client connects.
    #[must_use]
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// Bytes that have left the queue to the router, and the one to the clients.
    #[must_use]
    pub fn carried(&self) -> (u64, u64) {
        (self.up.carried.load(Ordering::Relaxed), self.down.carried.load(Ordering::Relaxed))
    }

    /// While it is stalled nothing arrives, either way; what was sent arrives afterwards.
    pub fn stall(&self, stalled: bool) {
        self.stalled.send_replace(stalled);
    }
}

fn listen() -> io::Result<TcpListener> {
    let socket = TcpSocket::new_v4()?;
    small_buffers(&socket)?;
    socket.bind(SocketAddr::from(([127, 0, 0, 1], 0)))?;
    socket.listen(BACKLOG)
}

fn small_buffers(socket: &TcpSocket) -> io::Result<()> {
    socket.set_recv_buffer_size(SOCKET_BUFFER)?;
    socket.set_send_buffer_size(SOCKET_BUFFER)
}

async fn serve(
    listener: TcpListener,
    router: SocketAddr,
    up: Arc<Direction>,
    down: Arc<Direction>,
    stalled: watch::Receiver<bool>,
) {
    let mut connections = JoinSet::new();
    loop {
        tokio::select! {
            accepted = listener.accept() => {
                let Ok((client, _)) = accepted else { continue };
                connections.spawn(connect(client, router, up.clone(), down.clone(), stalled.clone()));
            }
            Some(_) = connections.join_next() => {}
        }
    }
}

/// One connection, until either side closes it.
async fn connect(
    client: TcpStream,
    router: SocketAddr,
    up: Arc<Direction>,
    down: Arc<Direction>,
    stalled: watch::Receiver<bool>,
) -> io::Result<()> {
    let socket = TcpSocket::new_v4()?;
    small_buffers(&socket)?;
    let router = socket.connect(router).await?;
    for stream in [&client, &router] {
        stream.set_nodelay(true)?;
    }
    let (from_client, to_client) = client.into_split();
    let (from_router, to_router) = router.into_split();
    tokio::select! {
        ended = up.carry(from_client, to_router, stalled.clone()) => ended,
        ended = down.carry(from_router, to_client, stalled) => ended,
    }
}

/// One direction of the link, for all connections.
struct Direction {
    quality: LinkQuality,
    room: Arc<Semaphore>,
    carried: AtomicU64,
    sending: Mutex<Sending>,
}

struct Sending {
    /// The link is busy until then.
    free_at: Instant,
    rng: Pcg32,
}

/// Bytes on their way, and the room that they take in the queue.
struct Packet {
    leaves: Instant,
    arrives: Instant,
    bytes: Vec<u8>,
    room: OwnedSemaphorePermit,
}

impl Direction {
    fn new(quality: LinkQuality, seed: u64) -> Self {
        let queue = quality.queue_bytes.clamp(CHUNK_BYTES, Semaphore::MAX_PERMITS);
        let sending = Sending { free_at: Instant::now(), rng: Pcg32::new(seed, 1) };
        Self {
            quality,
            room: Arc::new(Semaphore::new(queue)),
            carried: AtomicU64::new(0),
            sending: Mutex::new(sending),
        }
    }

    /// When so many bytes have left the link, and when they arrive.
    fn schedule(&self, bytes: usize) -> (Instant, Instant) {
        let mut sending = self.sending.lock().unwrap_or_else(PoisonError::into_inner);
        let takes = self.quality.bits_per_s.map_or(Duration::ZERO, |bits_per_s| {
            Duration::from_secs_f64(bytes as f64 * 8.0 / bits_per_s.max(1) as f64)
        });
        let leaves = sending.free_at.max(Instant::now()) + takes;
        sending.free_at = leaves;
        let share = f64::from(sending.rng.next_u32()) / f64::from(u32::MAX);
        (leaves, leaves + self.quality.delay + self.quality.jitter.mul_f64(share))
    }

    async fn carry(
        &self,
        from: OwnedReadHalf,
        to: OwnedWriteHalf,
        stalled: watch::Receiver<bool>,
    ) -> io::Result<()> {
        let (queue, packets) = mpsc::channel(PACKETS);
        // The reader ends first: what it has read still arrives.
        tokio::try_join!(self.read(from, queue), self.write(to, packets, stalled)).map(drop)
    }

    async fn read(&self, from: OwnedReadHalf, queue: mpsc::Sender<Packet>) -> io::Result<()> {
        let mut buffer = [0; CHUNK_BYTES];
        loop {
            // Room is taken only for what is there: a silent connection keeps none from the others.
            from.readable().await?;
            let room = self.room.clone().acquire_many_owned(CHUNK_BYTES as u32).await;
            let mut room = room.map_err(io::Error::other)?;
            let read = match from.try_read(&mut buffer) {
                Ok(0) => return Ok(()),
                Ok(read) => read,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => continue,
                Err(error) => return Err(error),
            };
            drop(room.split(CHUNK_BYTES - read));
            let (leaves, arrives) = self.schedule(read);
            let packet = Packet { leaves, arrives, bytes: buffer[..read].to_vec(), room };
            if queue.send(packet).await.is_err() {
                return Ok(());
            }
        }
    }

    async fn write(
        &self,
        mut to: OwnedWriteHalf,
        mut packets: mpsc::Receiver<Packet>,
        mut stalled: watch::Receiver<bool>,
    ) -> io::Result<()> {
        while let Some(Packet { leaves, arrives, bytes, room }) = packets.recv().await {
            tokio::time::sleep_until(leaves).await;
            drop(room);
            self.carried.fetch_add(bytes.len() as u64, Ordering::Relaxed);
            tokio::time::sleep_until(arrives).await;
            if stalled.wait_for(|stalled| !stalled).await.is_err() {
                return Ok(());
            }
            to.write_all(&bytes).await?;
        }
        to.shutdown().await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::AsyncReadExt;

    /// A server that sends back what it gets, and a link to it.
    async fn echo(quality: LinkQuality) -> (SlowLink, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let router = format!("tcp/{}", listener.local_addr().unwrap());
        tokio::spawn(async move {
            while let Ok((mut stream, _)) = listener.accept().await {
                tokio::spawn(async move {
                    let (mut from, mut to) = stream.split();
                    tokio::io::copy(&mut from, &mut to).await
                });
            }
        });
        let link = SlowLink::open(&router, quality, 1).await;
        let address = link.endpoint().strip_prefix("tcp/").unwrap().to_owned();
        let stream = TcpStream::connect(address).await.unwrap();
        (link, stream)
    }

    async fn round_trip(stream: &mut TcpStream, bytes: usize) -> Duration {
        let began = Instant::now();
        let (mut from, mut to) = stream.split();
        let sent = vec![7; bytes];
        let mut got = vec![0; bytes];
        let (written, read) = tokio::join!(to.write_all(&sent), from.read_exact(&mut got));
        written.unwrap();
        read.unwrap();
        assert_eq!(got, sent);
        began.elapsed()
    }

    #[tokio::test]
    async fn a_round_trip_takes_the_delay_twice() {
        let delay = Duration::from_millis(60);
        let (_link, mut stream) = echo(LinkQuality::delayed(delay)).await;
        let took = round_trip(&mut stream, 10).await;
        assert!(took >= 2 * delay, "{took:?}");
    }

    #[tokio::test]
    async fn no_more_bits_pass_than_the_link_has() {
        let (link, mut stream) = echo(LinkQuality::throttled(800_000)).await;
        let took = round_trip(&mut stream, 20_000).await;
        assert!(took >= Duration::from_millis(200), "20 kB at 100 kB/s: {took:?}");
        assert_eq!(link.carried(), (20_000, 20_000));
    }

    #[tokio::test]
    async fn a_full_queue_holds_its_sender_up_and_loses_nothing() {
        let quality = LinkQuality { queue_bytes: 2 * CHUNK_BYTES, ..LinkQuality::throttled(8_000_000) };
        let (_link, mut stream) = echo(quality).await;
        round_trip(&mut stream, 300_000).await;
    }

    #[tokio::test]
    async fn what_was_sent_while_it_stalled_arrives_afterwards() {
        let (link, mut stream) = echo(LinkQuality::default()).await;
        link.stall(true);
        let waiting = tokio::time::timeout(Duration::from_millis(100), round_trip(&mut stream, 10)).await;
        assert!(waiting.is_err(), "{waiting:?}");
        link.stall(false);
        let mut got = [0; 10];
        stream.read_exact(&mut got).await.unwrap();
        assert_eq!(got, [7; 10]);
    }
}
