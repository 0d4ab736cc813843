//! What comes after a link was lost and opened again.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant, SystemTime};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use xtb_bus::{Bus, Incoming, Opening, SessionRole, Tls};
use xtb_identity::issue::{Authority, CertificatePurpose, LIFE, issue};
use xtb_protocol::Name;
use xtb_protocol::keys::{Channel, FleetKeys};

const PATIENCE: Duration = Duration::from_secs(20);
/// Of the client: the router takes its link for lost after so much silence.
const CLIENT_LEASE: Duration = Duration::from_millis(1000);
/// Of the router: the client gives the link up a little later, while the router still tries to write what it has
/// for it, which it does for a quarter of this.
const ROUTER_LEASE: Duration = Duration::from_millis(1200);
/// At most, until it came back in that time: a busy computer may be too late for it.
const OUTAGES: usize = 5;
const ROBOTS: usize = 16;
const SPEAK_EVERY: Duration = Duration::from_millis(2);
/// With this many bytes, what the system and Zenoh keep of a dead link is full at once.
const MESSAGE_BYTES: usize = 4096;

/// A way to the router on which connections can die: they carry nothing any more, and nobody is told.
struct Way {
    endpoint: String,
    /// Connections until now.
    opened: Arc<AtomicUsize>,
    /// So many of the first ones are dead.
    dead: Arc<AtomicUsize>,
}

impl Way {
    async fn to(router: &Bus) -> Self {
        let locator = router.locators().await.remove(0);
        let (kind, address) = locator.split_once('/').unwrap();
        let address = address.split(['?', '#']).next().unwrap().to_owned();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let endpoint = format!("{kind}/{}", listener.local_addr().unwrap());
        let way = Self { endpoint, opened: Arc::default(), dead: Arc::default() };
        let (opened, dead) = (way.opened.clone(), way.dead.clone());
        tokio::spawn(async move {
            while let Ok((near, _)) = listener.accept().await {
                let far = TcpStream::connect(&address).await.unwrap();
                let own = opened.fetch_add(1, Ordering::Relaxed);
                let ((near_in, near_out), (far_in, far_out)) = (near.into_split(), far.into_split());
                tokio::spawn(carry(near_in, far_out, own, dead.clone()));
                tokio::spawn(carry(far_in, near_out, own, dead.clone()));
            }
        });
        way
    }

    fn opened(&self) -> usize {
        self.opened.load(Ordering::Relaxed)
    }
}

async fn carry(mut from: OwnedReadHalf, mut to: OwnedWriteHalf, own: usize, dead: Arc<AtomicUsize>) {
    let mut bytes = vec![0; 64 * 1024];
    while let Ok(count @ 1..) = from.read(&mut bytes).await {
        if own < dead.load(Ordering::Relaxed) {
            std::future::pending::<()>().await;
        }
        if to.write_all(&bytes[..count]).await.is_err() {
            return;
        }
    }
}

/// Certificates of a router on this computer and of a client.
fn certificates(folder: &TempDir) -> [Tls; 2] {
    let now = SystemTime::now();
    let made = Authority::create(&Name::new("lab").unwrap(), now).unwrap();
    let issuer = Authority::load(&made.certificate(), &made.key()).unwrap();
    let host = ["127.0.0.1".to_owned()];
    [("router.1", CertificatePurpose::Router(&host)), ("alice.1", CertificatePurpose::Client)].map(
        |(name, purpose)| {
            let issued = issue(&issuer, &name.parse().unwrap(), purpose, now, LIFE).unwrap();
            let own = folder.path().join(name);
            std::fs::create_dir(&own).unwrap();
            let files =
                [("ca", made.certificate()), ("certificate", issued.certificate), ("key", issued.key)];
            for (file, text) in files {
                std::fs::write(own.join(format!("{file}.pem")), text).unwrap();
            }
            Tls::in_folder(&own)
        },
    )
}

async fn open(role: SessionRole, lease: Duration, tls: Option<Tls>) -> Bus {
    Opening::of(role).link_lease(lease).tls(tls).once().await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_message_comes_under_another_key_after_a_link_was_opened_again() {
    no_message_under_another_key("tcp", None, None).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_message_comes_under_another_key_over_tls_either() {
    let folder = tempfile::tempdir().unwrap();
    let [router, client] = certificates(&folder);
    no_message_under_another_key("tls", Some(router), Some(client)).await;
}

/// A session that comes back has numbered its keys anew, while its router may still hold the old numbers.
async fn no_message_under_another_key(kind: &str, of_router: Option<Tls>, of_client: Option<Tls>) {
    let fleet = FleetKeys::new(Name::new("lab").unwrap());
    let keys: Vec<String> =
        (1..=ROBOTS).map(|number| fleet.robot(&Name::new(&format!("xtb-{number}")).unwrap()).fix()).collect();
    let listen = vec![format!("{kind}/127.0.0.1:0")];
    let router = open(SessionRole::Router { listen, connect: Vec::new() }, ROUTER_LEASE, of_router).await;
    let way = Way::to(&router).await;
    let connect = vec![way.endpoint.clone()];
    let client = open(SessionRole::Client { connect }, CLIENT_LEASE, of_client).await;
    let back = fleet.robot(&Name::new("xtb-0").unwrap()).fix();
    let _listens = router.subscribe_raw(&back, |_| {}).await.unwrap();
    let (heard, wrong) = (Arc::<AtomicUsize>::default(), Arc::<AtomicUsize>::default());
    let mut subscriptions = Vec::new();
    for key in &keys {
        let (own, heard, wrong) = (key.clone(), heard.clone(), wrong.clone());
        let hear = move |message: Incoming| {
            heard.fetch_add(1, Ordering::Relaxed);
            if !message.payload.starts_with(format!("{own} ").as_bytes()) {
                wrong.fetch_add(1, Ordering::Relaxed);
            }
        };
        subscriptions.push(client.subscribe_raw(key, hear).await.unwrap());
    }
    let speaks_until = async |what: &str, is: &dyn Fn() -> bool| {
        let give_up = Instant::now() + PATIENCE;
        let mut turns = tokio::time::interval(SPEAK_EVERY);
        while !is() {
            assert!(Instant::now() < give_up, "waited {PATIENCE:?} in vain for: {what}");
            turns.tick().await;
            // That both hear each other until the link dies makes known who gives it up when.
            client.put_raw(&back, &Channel::Fix, "text/plain", Vec::new()).await.unwrap();
            for key in &keys {
                let mut message = format!("{key} ").into_bytes();
                message.resize(MESSAGE_BYTES, b' ');
                router.put_raw(key, &Channel::Fix, "text/plain", message).await.unwrap();
            }
        }
    };
    let hears = async || {
        let enough = heard.load(Ordering::Relaxed) + 100 * ROBOTS;
        speaks_until("the messages", &|| heard.load(Ordering::Relaxed) >= enough).await;
    };
    hears().await;
    for _ in 0..OUTAGES {
        let before = way.opened();
        way.dead.store(before, Ordering::Relaxed);
        let died = Instant::now();
        speaks_until("the client", &|| way.opened() > before).await;
        let in_time = died.elapsed() < CLIENT_LEASE + ROUTER_LEASE / 4;
        hears().await;
        if in_time {
            break;
        }
    }
    assert_eq!(wrong.load(Ordering::Relaxed), 0, "messages under a wrong key");
}
