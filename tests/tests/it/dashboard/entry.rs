//! Who comes in, and who does not.

use super::Rig;
use super::page::{Page, connect, metric, request};
use fleet_tests::Setup;

const TOKEN: &str = "0123456789abcdef0123";

#[tokio::test(flavor = "multi_thread")]
async fn a_foreign_page_opens_no_socket_and_posts_nothing() {
    let rig = Rig::start(Setup::default()).await;
    let address = rig.dashboard.address();
    let foreign = "http://evil.example";
    for headers in [&[("origin", foreign)][..], &[("origin", "null")], &[]] {
        let (status, body) = connect(address, headers).await.unwrap_err();
        assert_eq!(status, 403, "{headers:?}");
        assert!(body.contains("only the dashboard's own page"), "{body}");
    }
    let (status, answer) = request(address, "POST", "/ws", &[("Origin", foreign)]).await;
    assert_eq!(status, 403);
    assert!(!answer.to_lowercase().contains("access-control"), "{answer}");
    let own = format!("http://{address}");
    assert_eq!(request(address, "POST", "/", &[("Origin", &own)]).await.0, 405);
    assert_eq!(request(address, "OPTIONS", "/ws", &[("Origin", foreign)]).await.0, 403);
    assert_eq!(metric(address, "xtb_dashboard_requests_refused_total{reason=\"origin\"}").await, 5.0);
    Page::open(address).await.take().await.unwrap();
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_name_that_is_not_ours_and_a_wrong_token_stay_out() {
    let rig = Rig::with(Setup::default(), |settings| settings.token = Some(TOKEN.into())).await;
    let address = rig.dashboard.address();
    assert_eq!(request(address, "GET", "/", &[("Host", "evil.example")]).await.0, 403);
    assert_eq!(request(address, "GET", "/healthz", &[]).await.0, 200);
    let own = format!("http://{address}");
    for path in ["/", "/metrics", "/assets/main.js", "/?token=0123456789abcdef0124"] {
        let (status, answer) = request(address, "GET", path, &[]).await;
        assert_eq!(status, 401, "{path}");
        assert!(answer.contains("a token is needed") && !answer.contains(TOKEN), "{answer}");
    }
    assert_eq!(connect(address, &[("origin", &own)]).await.unwrap_err().0, 401);
    assert!(rig.dashboard.url().ends_with(&format!("/?token={TOKEN}")));
    let (status, welcome) = request(address, "GET", &format!("/?token={TOKEN}"), &[]).await;
    assert_eq!(status, 200);
    let cookie = welcome.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap();
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
    let cookie = cookie.split(';').next().unwrap();
    let (status, page) = request(address, "GET", "/", &[("Cookie", cookie)]).await;
    assert_eq!(status, 200);
    assert!(page.contains("content-security-policy: default-src 'none'"), "{page}");
    assert!(connect(address, &[("origin", &own), ("cookie", cookie)]).await.is_ok());
    assert_eq!(connect(address, &[("cookie", cookie)]).await.unwrap_err().0, 403);
    let bearer = format!("Bearer {TOKEN}");
    assert!(connect(address, &[("authorization", &bearer)]).await.is_ok(), "a program needs no origin");
    assert_eq!(request(address, "GET", "/metrics", &[("Authorization", &bearer)]).await.0, 200);
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn so_many_pages_and_no_more() {
    let rig = Rig::start(Setup::default()).await;
    let address = rig.dashboard.address();
    let own = format!("http://{address}");
    let mut pages = Vec::new();
    for _ in 0..16 {
        pages.push(connect(address, &[("origin", &own)]).await.unwrap());
    }
    let (status, body) = connect(address, &[("origin", &own)]).await.unwrap_err();
    assert_eq!(status, 503);
    assert!(body.contains("16 pages"), "{body}");
    drop(pages.pop());
    fleet_tests::eventually("room again", || async { connect(address, &[("origin", &own)]).await.ok() })
        .await;
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_message_that_is_too_long_closes_the_socket_and_nonsense_is_counted() {
    let rig = Rig::start(Setup::default()).await;
    let address = rig.dashboard.address();
    let mut page = rig.page().await;
    page.say(&serde_json::json!({ "what": 1 })).await;
    fleet_tests::eventually("counted", || async {
        (metric(address, "xtb_dashboard_messages_malformed_total").await == 1.0).then_some(())
    })
    .await;
    page.say(&serde_json::json!("x".repeat(3 << 20))).await;
    while page.take().await.is_some() {}
    rig.end().await;
}

#[test]
fn another_address_without_tls_is_refused_before_anything_is_begun() {
    let mut command = std::process::Command::new(fleet_tests::processes::program("fleet-cli"));
    command.env_clear().args(["--connect", "tcp/127.0.0.1:1", "dashboard", "--listen", "0.0.0.0:0"]);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("whoever reaches 0.0.0.0:0 could drive every robot"), "{said}");
    assert!(said.contains("pki add-service dashboard") && said.contains("--insecure"), "{said}");
    command.arg("--insecure");
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("a token is needed") && said.contains("proxy with TLS"), "{said}");
}
