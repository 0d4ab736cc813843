//! The page over TLS: who signs in, what each role may do, and how one is thrown out.

use super::Rig;
use super::page::{Page, upgrade};
use fleet_tests::page_identities::{PageIdentities, token};
use fleet_tests::{Setup, eventually};
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::crypto::ring::default_provider;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use tokio_rustls::rustls::version::{TLS12, TLS13};
use tokio_rustls::rustls::{ClientConfig, RootCertStore, SupportedProtocolVersion};
use xtb_identity::Role;
use xtb_identity::issue::{CertificatePurpose, Issued, LIFE};

/// A revoked person is out within this.
const OUT_WITHIN: Duration = Duration::from_secs(2);

/// A fleet, a dashboard with TLS, and a browser's way to it.
struct Secured {
    rig: Rig,
    identities: PageIdentities,
    address: SocketAddr,
}

type Stream = TlsStream<TcpStream>;

fn connector(ca: &str, own: Option<&Issued>, version: &'static SupportedProtocolVersion) -> TlsConnector {
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_slice(ca.as_bytes()).unwrap()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(default_provider()))
        .with_protocol_versions(&[version])
        .unwrap()
        .with_root_certificates(roots);
    let config = match own {
        None => config.with_no_client_auth(),
        Some(own) => {
            let chain = vec![CertificateDer::from_pem_slice(own.certificate.as_bytes()).unwrap()];
            let key = PrivateKeyDer::from_pem_slice(own.key.as_bytes()).unwrap();
            config.with_client_auth_cert(chain, key).unwrap()
        }
    };
    TlsConnector::from(Arc::new(config))
}

impl Secured {
    /// With these people in the registry.
    async fn start(setup: Setup, people: &[(&str, Role)]) -> Self {
        let identities = PageIdentities::new();
        people.iter().for_each(|(name, role)| identities.add(name, *role));
        let rig = Rig::with(setup, |settings| settings.secure = Some(identities.secure())).await;
        let address = rig.dashboard.address();
        Self { rig, identities, address }
    }

    /// The own origin, by address.
    fn origin(&self) -> String {
        format!("https://{}", self.address)
    }

    async fn stream(&self, own: Option<&Issued>) -> std::io::Result<Stream> {
        let stream = TcpStream::connect(self.address).await?;
        let name = ServerName::try_from("127.0.0.1").unwrap();
        connector(&self.identities.ca(), own, &TLS13).connect(name, stream).await
    }

    /// Status, headers and body.
    async fn request(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> (u16, String) {
        let stream = self.stream(None).await.unwrap();
        request_on(stream, self.address, method, path, headers, body).await.unwrap()
    }

    /// Signs in: the cookie as it is sent back.
    async fn sign_in(&self, token: &str) -> Result<String, (u16, String)> {
        let body = json!({ "token": token }).to_string();
        let headers = [("Origin", self.origin()), ("Content-Type", "application/json".to_owned())];
        let headers = headers.each_ref().map(|(name, value)| (*name, value.as_str()));
        let (status, answer) = self.request("POST", "/sign-in", &headers, &body).await;
        let set = answer.lines().find_map(|line| line.strip_prefix("set-cookie: ").map(str::to_owned));
        match (status, set) {
            (200, Some(set)) => {
                assert!(set.contains("; Secure; HttpOnly; SameSite=Strict; Path=/"), "{set}");
                assert!(!answer.contains(token), "{answer}");
                Ok(set.split(';').next().unwrap().to_owned())
            }
            _ => Err((status, answer)),
        }
    }

    /// Opens the page's socket.
    async fn socket(
        &self,
        own: Option<&Issued>,
        cookie: Option<&str>,
    ) -> Result<Page<Stream>, (u16, String)> {
        let (stream, origin) = (self.stream(own).await.unwrap(), self.origin());
        let mut headers = vec![("origin", origin.as_str())];
        headers.extend(cookie.map(|cookie| ("cookie", cookie)));
        let url = format!("ws://{}/ws", self.address);
        upgrade(stream, &url, &headers).await.map(Page::on)
    }

    /// The page of somebody who has signed in, with its robot in sight.
    async fn page(&self, name: &str) -> (Page<Stream>, String) {
        let cookie = self.sign_in(&token(name)).await.unwrap();
        let mut page = self.socket(None, Some(&cookie)).await.unwrap();
        let fresh = |page: &Page<Stream>| page.rows().any(|row| row["stale"] == false).then_some(());
        page.until("a robot", fresh).await;
        (page, cookie)
    }

    async fn end(self) {
        self.rig.end().await;
    }
}

/// Status, headers and body of a request on this stream.
async fn request_on(
    mut stream: Stream,
    address: SocketAddr,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &str,
) -> std::io::Result<(u16, String)> {
    let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let head = format!("{method} {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n{headers}");
    let text = format!("{head}Content-Length: {}\r\n\r\n{body}", body.len());
    stream.write_all(text.as_bytes()).await?;
    let mut answer = Vec::new();
    // Not every end is announced.
    let read = stream.read_to_end(&mut answer).await;
    let answer = String::from_utf8_lossy(&answer).into_owned();
    match answer.split(' ').nth(1).and_then(|status| status.parse().ok()) {
        Some(status) => Ok((status, answer)),
        None => Err(read.err().unwrap_or_else(|| std::io::ErrorKind::UnexpectedEof.into())),
    }
}

/// Reads on until the server has closed the socket.
async fn closed(page: &mut Page<Stream>) {
    while page.take().await.is_some() {}
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_signs_in_and_what_it_does_bears_its_name() {
    let setup = Setup { speed: 1.0, ..Setup::default() };
    let secured = Secured::start(setup, &[("alice", Role::Operator)]).await;
    let (mut page, cookie) = secured.page("alice").await;
    assert_eq!(page.hello["who"]["name"], "alice", "{}", page.hello);
    let client = page.hello["client"].as_str().unwrap().to_owned();
    assert!(client.starts_with("web-alice-") && client.len() == "web-alice-3f9a1c".len(), "{client}");

    let answer = page.ask(json!({ "teleop": { "robot": "xtb-1", "take": false } })).await;
    assert_eq!(answer["ok"]["robot"], "xtb-1", "{answer}");
    let lease = secured.rig.fleet.until(1, "her lease", |state| state.lease.is_some()).await.lease.unwrap();
    assert_eq!(lease.holder.as_str(), client);
    page.ask(json!({ "teleop_end": {} })).await;
    secured.rig.fleet.until(1, "the lease given back", |state| state.lease.is_none()).await;
    page.ask(json!({ "estop": { "robot": "xtb-1" } })).await;
    let state = secured.rig.fleet.until(1, "a latch", |state| !state.latches.is_empty()).await;
    assert_eq!(state.latches[0].by.as_str(), client);

    let (status, answer) = secured.request("GET", "/", &[("Cookie", &cookie)], "").await;
    assert_eq!(status, 200);
    assert!(answer.contains("strict-transport-security: max-age="), "{answer}");
    assert!(answer.contains("content-security-policy: default-src 'none'"), "{answer}");
    let (_, who) = secured.request("GET", "/who", &[("Cookie", &cookie)], "").await;
    assert!(who.contains(r#""name":"alice","role":"operator""#), "{who}");
    secured.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stranger_sees_the_form_and_nothing_of_the_fleet() {
    let secured = Secured::start(Setup::default(), &[("alice", Role::Operator)]).await;
    let (status, answer) = secured.request("GET", "/", &[], "").await;
    assert!(status == 303 && answer.contains("location: /sign-in"), "{answer}");
    let (status, form) = secured.request("GET", "/sign-in", &[], "").await;
    assert!(status == 200 && form.contains("Your token"), "{form}");
    let (status, nobody) = secured.request("GET", "/who", &[], "").await;
    assert!(status == 200 && nobody.ends_with(r#"{"who":null}"#), "{nobody}");
    for path in ["/metrics", "/assets/main.js", "/ws"] {
        let origin = secured.origin();
        let (status, answer) = secured.request("GET", path, &[("Origin", &origin)], "").await;
        assert!(status == 401 && answer.contains("sign in first"), "{path}: {answer}");
    }
    assert_eq!(secured.socket(None, None).await.err().unwrap().0, 401);
    assert_eq!(secured.socket(None, Some("__Host-xtb_dashboard=00")).await.err().unwrap().0, 401);
    // A page of somebody else's site signs nobody in.
    let foreign = [("Origin", "https://evil.example"), ("Content-Type", "application/json")];
    assert_eq!(secured.request("POST", "/sign-in", &foreign, r#"{"token":"x"}"#).await.0, 403);
    // Guesses end, for this address, in a minute's silence.
    let mut answers = Vec::new();
    for _ in 0..11 {
        answers.push(secured.sign_in("0123456789abcdef").await.unwrap_err().0);
    }
    assert_eq!(answers, [&[401; 10][..], &[429]].concat());
    secured.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_certificate_of_the_fleet_signs_in_by_itself_and_others_do_not_get_through() {
    let secured = Secured::start(Setup::default(), &[("alice", Role::Operator)]).await;
    let identities = &secured.identities;
    let alice = identities.certificate("alice.1", CertificatePurpose::Browser, LIFE);
    let mut page = secured.socket(Some(&alice), None).await.unwrap();
    page.until("the first word", |page| page.hello.is_object().then_some(())).await;
    assert_eq!(
        (&page.hello["who"]["name"], &page.hello["who"]["certificate"]),
        (&json!("alice"), &json!(true))
    );
    assert!(page.hello["client"].as_str().unwrap().starts_with("web-alice-"));

    // Of the fleet, but nobody who signs in: an older generation of hers, a robot, somebody unknown.
    for own in ["alice.2", "xtb-1.1", "carol.1", "router.1"] {
        let own = identities.certificate(own, CertificatePurpose::Client, LIFE);
        assert_eq!(secured.socket(Some(&own), None).await.err().unwrap().0, 401);
    }
    // Another CA's, and an expired one: the handshake fails, which TLS 1.3 tells with the first bytes.
    let other = PageIdentities::new().certificate("alice.1", CertificatePurpose::Browser, LIFE);
    let expired = identities.certificate("alice.1", CertificatePurpose::Browser, Duration::ZERO);
    eventually("its last second has passed", || async { refused(&secured, &expired).await.then_some(()) })
        .await;
    assert!(refused(&secured, &other).await);
    let (_, metrics) = {
        let stream = secured.stream(Some(&alice)).await.unwrap();
        request_on(stream, secured.address, "GET", "/metrics", &[], "").await.unwrap()
    };
    assert!(metrics.contains("xtb_dashboard_requests_refused_total{reason=\"handshake\"} "), "{metrics}");
    secured.end().await;
}

/// Whether a connection with this certificate gets nothing.
async fn refused(secured: &Secured, own: &Issued) -> bool {
    let Ok(stream) = secured.stream(Some(own)).await else { return true };
    request_on(stream, secured.address, "GET", "/healthz", &[], "").await.is_err()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_server_is_known_by_its_certificate_and_speaks_nothing_older() {
    let secured = Secured::start(Setup::default(), &[]).await;
    let connect = async |ca: &str, name: &'static str, version| {
        let stream = TcpStream::connect(secured.address).await.unwrap();
        connector(ca, None, version).connect(ServerName::try_from(name).unwrap(), stream).await
    };
    let ca = secured.identities.ca();
    assert!(connect(&ca, "localhost", &TLS13).await.is_ok());
    assert!(connect(&ca, "other.example", &TLS13).await.is_err());
    assert!(connect(&PageIdentities::new().ca(), "localhost", &TLS13).await.is_err());
    assert!(connect(&ca, "localhost", &TLS12).await.is_err());
    // Without TLS: told so, at once.
    let (status, answer) = super::page::request(secured.address, "GET", "/healthz", &[]).await;
    assert!(status == 400 && answer.contains("https://"), "{answer}");
    // Renewed: the next connection gets the new one, without a restart.
    let shown = async || {
        let stream = secured.stream(None).await.unwrap();
        stream.get_ref().1.peer_certificates().unwrap()[0].clone()
    };
    let before = shown().await;
    secured.identities.renew_page();
    eventually("the new certificate", || async { (shown().await != before).then_some(()) }).await;
    secured.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_says_nothing_of_a_handshake_is_thrown_out() {
    let secured = Secured::start(Setup::default(), &[]).await;
    let mut silent = TcpStream::connect(secured.address).await.unwrap();
    let mut half = TcpStream::connect(secured.address).await.unwrap();
    // The head of a handshake, and nothing more.
    half.write_all(&[22, 3, 1, 2, 0]).await.unwrap();
    for stream in [&mut silent, &mut half] {
        let ended = tokio::time::timeout(3 * Duration::from_secs(5), stream.read(&mut [0; 64])).await;
        assert!(matches!(ended, Ok(Ok(0) | Err(_))), "{ended:?}");
    }
    assert_eq!(secured.request("GET", "/healthz", &[], "").await.0, 200);
    secured.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_may_call_an_emergency_stop_and_nothing_else() {
    let secured = Secured::start(Setup::default(), &[("bob", Role::Viewer)]).await;
    let (mut page, _) = secured.page("bob").await;
    assert_eq!((&page.hello["writable"], &page.hello["estop"]), (&json!(false), &json!(true)));
    let why = "bob is a viewer: may look and call an emergency stop";
    assert_eq!(page.hello["why_not"], why);
    let spec = json!({ "kind": { "wander": { "for_s": 5 } } });
    let base = json!({ "map": "0000000000000001", "places": "0000000000000002" });
    for command in [
        json!({ "goto": { "robot": "xtb-1", "x_m": 0.0, "y_m": 1.0, "take": true } }),
        json!({ "stop": { "robot": null } }),
        json!({ "stop": { "robot": "xtb-1" } }),
        json!({ "reset": { "robot": "xtb-1" } }),
        json!({ "reset_all": {} }),
        json!({ "speed_limit": { "mps": 0.2 } }),
        json!({ "submit": { "spec": spec } }),
        json!({ "cancel": { "task": "t1" } }),
        json!({ "pause": { "task": "t1" } }),
        json!({ "resume": { "task": "t1" } }),
        json!({ "retry": { "task": "t1" } }),
        json!({ "set_pose": { "robot": "xtb-1", "x_m": 0.0, "y_m": 1.0, "yaw_rad": 0.0, "take": true } }),
        json!({ "edit_map": { "base": base, "zones": [], "places": [], "why": "all away" } }),
        json!({ "activate": {} }),
        json!({ "adopt": {} }),
        json!({ "teleop": { "robot": "xtb-1", "take": true } }),
        json!({ "teleop_end": {} }),
    ] {
        let answer = page.ask(command.clone()).await;
        assert_eq!(
            (&answer["error"]["code"], &answer["error"]["message"]),
            (&json!("not_allowed"), &json!(why))
        );
    }
    for _ in 0..20 {
        page.steer(0.6).await;
    }
    let state = secured.rig.fleet.state(1).await;
    assert!(state.latches.is_empty() && state.goal.is_none() && state.lease.is_none(), "{state:?}");
    assert_eq!(state.input_age_ms.setpoint, None);

    let answer = page.ask(json!({ "estop": { "robot": null } })).await;
    assert_eq!(answer["ok"]["complete"], json!(true), "{answer}");
    let state = secured.rig.fleet.until(1, "latched", |state| !state.latches.is_empty()).await;
    assert!(state.latches[0].by.as_str().starts_with("web-bob-"), "{:?}", state.latches);
    assert_eq!(page.ask(json!({ "reset": { "robot": "xtb-1" } })).await["error"]["code"], "not_allowed");
    secured.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_revoked_driver_is_thrown_out_and_its_robot_stands() {
    let setup = Setup { speed: 1.0, ..Setup::default() };
    let secured = Secured::start(setup, &[("alice", Role::Operator)]).await;
    let (mut page, cookie) = secured.page("alice").await;
    let answer = page.ask(json!({ "teleop": { "robot": "xtb-1", "take": false } })).await;
    assert_eq!(answer["ok"]["robot"], "xtb-1", "{answer}");
    let mut held = 0;
    while secured.rig.fleet.truth(1).speed_mps < 0.1 {
        held += 1;
        assert!(held < 1200, "a minute of driving in vain");
        page.steer(0.6).await;
        page.take_for(50).await;
    }
    secured.identities.change_one("alice", |alice| alice.revoked = true);
    let revoked = Instant::now();
    // She goes on driving until she cannot.
    let out = async {
        loop {
            page.steer(0.6).await;
            let taken = tokio::time::timeout(Duration::from_millis(50), page.take()).await;
            if matches!(taken, Ok(None)) {
                return;
            }
        }
    };
    tokio::time::timeout(fleet_tests::PATIENCE, out).await.expect("she drives on");
    let took = revoked.elapsed();
    eprintln!("out {took:?} after the registry was written");
    assert!(took < OUT_WITHIN, "{took:?}");
    eventually("neutral", || async { secured.rig.fleet.truth(1).neutral_since_s }).await;
    secured.rig.fleet.until(1, "the lease given back", |state| state.lease.is_none()).await;
    assert_eq!(secured.socket(None, Some(&cookie)).await.err().unwrap().0, 401);
    assert_eq!(secured.request("GET", "/", &[("Cookie", &cookie)], "").await.0, 303);
    assert_eq!(secured.sign_in(&token("alice")).await.unwrap_err().0, 401);
    secured.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn signing_out_another_role_and_a_new_token_end_what_is_open() {
    let people = ["alice", "bob", "carol"].map(|name| (name, Role::Operator));
    let secured = Secured::start(Setup::default(), &people).await;
    let (mut first, cookie) = secured.page("alice").await;
    let (mut second, _other_browser) = secured.page("alice").await;
    let origin = secured.origin();
    let headers = [("Origin", origin.as_str()), ("Cookie", cookie.as_str())];
    let (status, answer) = secured.request("POST", "/sign-out", &headers, "").await;
    assert!(status == 204 && answer.contains("Max-Age=0"), "{answer}");
    closed(&mut first).await;
    assert!(second.take().await.is_some(), "the other browser stays");
    assert_eq!(secured.socket(None, Some(&cookie)).await.err().unwrap().0, 401);

    let (mut page, cookie) = secured.page("bob").await;
    secured.identities.change_one("bob", |bob| bob.role = Role::Viewer);
    closed(&mut page).await;
    let mut page = secured.socket(None, Some(&cookie)).await.unwrap();
    page.until("the first word", |page| page.hello.is_object().then_some(())).await;
    assert_eq!((&page.hello["who"]["role"], &page.hello["writable"]), (&json!("viewer"), &json!(false)));

    let (mut page, cookie) = secured.page("carol").await;
    secured.identities.change_one("carol", |carol| carol.token_sha256 = None);
    closed(&mut page).await;
    assert_eq!(secured.socket(None, Some(&cookie)).await.err().unwrap().0, 401);
    secured.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn programs_show_a_token_with_each_request() {
    let secured = Secured::start(Setup::default(), &[("bob", Role::Viewer)]).await;
    let bearer = format!("Bearer {}", token("bob"));
    let (status, text) = secured.request("GET", "/metrics", &[("Authorization", &bearer)], "").await;
    assert!(status == 200 && text.contains("xtb_fleet_robots"), "{text}");
    let stream = secured.stream(None).await.unwrap();
    let url = format!("ws://{}/ws", secured.address);
    let mut page = Page::on(upgrade(stream, &url, &[("authorization", &bearer)]).await.unwrap());
    page.until("the first word", |page| page.hello.is_object().then_some(())).await;
    let who: &Value = &page.hello["who"];
    assert_eq!((&who["name"], &who["role"]), (&json!("bob"), &json!("viewer")));
    secured.identities.change_one("bob", |bob| bob.revoked = true);
    closed(&mut page).await;
    assert_eq!(secured.request("GET", "/metrics", &[("Authorization", &bearer)], "").await.0, 401);
    secured.end().await;
}
