//! Each cause why no link can be opened is told in its own words.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::time::{Duration, SystemTime};
use tempfile::TempDir;
use tokio::net::TcpListener;
use xtb_bus::link_problem::{admits, find};
use xtb_bus::{Bus, Enrolled, LinkProblem, Opening, SessionRole, Tls};
use xtb_identity::issue::{Authority, CertificatePurpose, LIFE, issue};
use xtb_identity::{Identity, Role as IdentityRole};
use xtb_protocol::Name;

const DAY: Duration = Duration::from_secs(24 * 3600);

/// A fleet's CA, made ten days ago.
struct Fleet {
    folder: TempDir,
    ca: String,
    key: String,
    began: SystemTime,
}

impl Fleet {
    fn new() -> Self {
        let began = SystemTime::now() - 10 * DAY;
        let made = Authority::create(&Name::new("lab").unwrap(), began).unwrap();
        let folder = tempfile::tempdir().unwrap();
        Self { folder, ca: made.certificate(), key: made.key(), began }
    }

    fn identity(&self, from: SystemTime, life: Duration) -> Enrolled {
        let own: xtb_identity::CommonName = "alice.1".parse().unwrap();
        let issuer = Authority::load(&self.ca, &self.key).unwrap();
        let issued = issue(&issuer, &own, CertificatePurpose::Client, from, life).unwrap();
        let (fleet, ca) = (Name::new("lab").unwrap(), self.ca.clone());
        let role = IdentityRole::Operator;
        let identity = Identity::new(fleet, own, role, Vec::new(), ca, issued.certificate, issued.key);
        Enrolled::write(&identity, &self.folder.path().join("alice")).unwrap()
    }

    fn alice(&self) -> Enrolled {
        self.identity(self.began, LIFE)
    }

    /// The router's files; `trusts` is the CA of those whom it lets in.
    fn router(&self, names: &[&str], from: SystemTime, life: Duration, trusts: &Self) -> Tls {
        let folder = self.folder.path().join("router");
        std::fs::create_dir_all(&folder).unwrap();
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let issuer = Authority::load(&self.ca, &self.key).unwrap();
        let own = "router.1".parse().unwrap();
        let issued = issue(&issuer, &own, CertificatePurpose::Router(&names), from, life).unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        write("ca.pem", &trusts.ca);
        write("certificate.pem", &issued.certificate);
        write("key.pem", &issued.key);
        Tls::in_folder(&folder)
    }

    /// One for this computer.
    async fn open_router(&self) -> Router {
        Router::open(Some(self.router(&["127.0.0.1"], self.began, LIFE, self))).await
    }
}

struct Router {
    _bus: Bus,
    /// Such as `127.0.0.1:40123`.
    host: String,
}

impl Router {
    async fn open(tls: Option<Tls>) -> Self {
        let kind = if tls.is_some() { "tls" } else { "tcp" };
        let role = SessionRole::Router { listen: vec![format!("{kind}/127.0.0.1:0")], connect: Vec::new() };
        let bus = Opening::of(role).tls(tls).once().await.unwrap();
        let locators = bus.locators().await;
        let host = locators[0].split('/').nth(1).unwrap().split(['?', '#']).next().unwrap().to_owned();
        Self { _bus: bus, host }
    }

    fn tls(&self) -> String {
        format!("tls/{}", self.host)
    }
}

async fn found(endpoint: &str, identity: Option<&Enrolled>, now: SystemTime) -> LinkProblem {
    let problem = find(&[endpoint.to_owned()], identity, now).await.unwrap();
    assert!(!problem.hint().is_empty());
    problem
}

async fn told(endpoint: &str, identity: Option<&Enrolled>) -> String {
    found(endpoint, identity, SystemTime::now()).await.to_string()
}

fn says(time: SystemTime) -> String {
    humantime::format_rfc3339_seconds(time).to_string()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_identity_that_the_router_admits_finds_no_problem_with_it() {
    let fleet = Fleet::new();
    let router = fleet.open_router().await;
    let text = told(&router.tls(), Some(&fleet.alice())).await;
    assert_eq!(
        text,
        format!("the router at {} accepts the TLS connection, but opens no session", router.host)
    );
    let seen = admits(&router.tls(), &fleet.alice().identity, SystemTime::now()).await.unwrap();
    assert_eq!(
        (seen.certificate.hosts, seen.anonymous, seen.plain),
        (vec!["127.0.0.1".to_owned()], false, false)
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_certificate() {
    let router = Fleet::new().open_router().await;
    let text = told(&router.tls(), None).await;
    let host = &router.host;
    assert_eq!(
        text,
        format!("the router at {host} admits only those with a certificate, and no identity is used here")
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_certificate_of_another_ca() {
    let (fleet, other) = (Fleet::new(), Fleet::new());
    let router = Router::open(Some(fleet.router(&["127.0.0.1"], fleet.began, LIFE, &other))).await;
    let text = told(&router.tls(), Some(&fleet.alice())).await;
    let host = &router.host;
    assert_eq!(
        text,
        format!("the router at {host} refuses the certificate of alice: it is not from the router's CA")
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_expired_certificate_by_this_clock_and_by_the_routers() {
    let fleet = Fleet::new();
    let router = fleet.open_router().await;
    let alice = fleet.identity(fleet.began, 5 * DAY);
    let now = SystemTime::now();
    let text = found(&router.tls(), Some(&alice), now).await.to_string();
    let until = says(fleet.began + 5 * DAY);
    assert_eq!(
        text,
        format!("the certificate of alice expired on {until}; this computer's clock says {}", says(now))
    );
    let behind = found(&router.tls(), Some(&alice), now - 6 * DAY).await.to_string();
    assert_eq!(
        behind,
        format!(
            "the router at {} refuses the certificate of alice: by the router's clock it is expired or not yet \
             valid, by this computer's it is valid",
            router.host
        )
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_certificate_that_is_not_yet_valid() {
    let fleet = Fleet::new();
    let now = SystemTime::now();
    let alice = fleet.identity(now + 2 * DAY, LIFE);
    let text = found("tls/127.0.0.1:1", Some(&alice), now).await.to_string();
    let from = says(now + 2 * DAY - xtb_identity::issue::BACKDATED);
    assert_eq!(
        text,
        format!(
            "the certificate of alice is not valid before {from}; this computer's clock says {}",
            says(now)
        )
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_router_that_is_not_trusted() {
    let (fleet, other) = (Fleet::new(), Fleet::new());
    let router = other.open_router().await;
    let text = told(&router.tls(), Some(&fleet.alice())).await;
    let host = &router.host;
    assert_eq!(
        text,
        format!("the router at {host} is not trusted: its certificate is not from the CA of fleet lab")
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_router_that_is_reached_by_a_wrong_name() {
    let fleet = Fleet::new();
    let tls = fleet.router(&["lab-pc.local", "10.0.0.1"], fleet.began, LIFE, &fleet);
    let router = Router::open(Some(tls)).await;
    let text = told(&router.tls(), Some(&fleet.alice())).await;
    assert_eq!(text, "the certificate of the router is for lab-pc.local, 10.0.0.1, not for 127.0.0.1");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_router_whose_certificate_expired() {
    let fleet = Fleet::new();
    let router = Router::open(Some(fleet.router(&["127.0.0.1"], fleet.began, 5 * DAY, &fleet))).await;
    let now = SystemTime::now();
    let text = found(&router.tls(), Some(&fleet.alice()), now).await.to_string();
    let (host, since) = (&router.host, says(fleet.began + 5 * DAY));
    assert_eq!(
        text,
        format!(
            "the certificate of the router at {host} expired on {since}; this computer's clock says {}",
            says(now)
        )
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_wrong_clock() {
    let fleet = Fleet::new();
    let alice = fleet.alice();
    let long_ago = fleet.began - 3650 * DAY;
    let text = found("tls/127.0.0.1:1", Some(&alice), long_ago).await.to_string();
    let begins = format!(
        "this computer's clock is wrong: it says {}, but the CA of fleet lab is valid from ",
        says(long_ago)
    );
    assert!(text.starts_with(&begins), "{text}");

    let now = SystemTime::now();
    let router = Router::open(Some(fleet.router(&["127.0.0.1"], now, LIFE, &fleet))).await;
    let behind = now - 2 * DAY;
    let text = found(&router.tls(), Some(&alice), behind).await.to_string();
    let (host, from) = (&router.host, says(now - xtb_identity::issue::BACKDATED));
    assert_eq!(
        text,
        format!(
            "this computer's clock is wrong: it says {}, but the certificate of the router at {host} is valid from \
             {from}",
            says(behind)
        )
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn plain_tcp_to_a_router_with_tls() {
    let router = Fleet::new().open_router().await;
    let host = &router.host;
    let text = told(&format!("tcp/{host}"), None).await;
    assert_eq!(text, format!("the router at {host} uses TLS, and tcp/{host} does not"));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn tls_to_a_router_without() {
    let router = Router::open(None).await;
    let text = told(&router.tls(), Some(&Fleet::new().alice())).await;
    assert_eq!(text, format!("the router at {} does not use TLS: it lets in everybody", router.host));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn tls_to_something_else() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let host = listener.local_addr().unwrap().to_string();
    let accepting = tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            drop(stream);
        }
    });
    let text = told(&format!("tls/{host}"), Some(&Fleet::new().alice())).await;
    accepting.abort();
    assert!(text.starts_with(&format!("what listens at {host} is no router with TLS: ")), "{text}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_router_and_no_such_host() {
    let host = TcpListener::bind("127.0.0.1:0").await.unwrap().local_addr().unwrap().to_string();
    let alice = Fleet::new().alice();
    let text = told(&format!("tls/{host}"), Some(&alice)).await;
    assert_eq!(text, format!("no router at tls/{host}: connection refused"));
    let text = told("tls/no-such-host.invalid:7447", Some(&alice)).await;
    assert!(text.starts_with("the host name no-such-host.invalid cannot be resolved: "), "{text}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn of_several_routers_the_one_that_says_most_is_told() {
    let (fleet, other) = (Fleet::new(), Fleet::new());
    let router = other.open_router().await;
    let endpoints = ["tls/127.0.0.1:1".to_owned(), router.tls()];
    let problem = find(&endpoints, Some(&fleet.alice()), SystemTime::now()).await.unwrap();
    assert!(matches!(problem, LinkProblem::NotTrusted { .. }), "{problem}");
    assert!(problem.lasts() && !problem.is_refusal());
    assert!(Path::new(&fleet.folder.path().join("alice")).exists());
}
