//! Sessions without any of our checks in between, and routers whose rules are changed in one flow: so that the other
//! is seen alone.

use fleet_tests::identities::Pki;
use serde_json::{Value, json};
use std::time::Duration;
use xtb_services::router::zenohd_config;
use zenoh::{Config, Session, Wait};

/// Everybody may use the keys below this one.
pub(super) const TEST: &str = "test";
const EVERY_KIND: [&str; 9] = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "declare_queryable",
    "reply",
    "liveliness_token",
    "declare_liveliness_subscriber",
    "liveliness_query",
];
/// Nothing takes so long unless something is broken.
const WITHIN: Duration = Duration::from_secs(30);

async fn open(config: &Value) -> Session {
    let config = Config::from_json5(&config.to_string()).unwrap();
    tokio::task::spawn_blocking(|| zenoh::open(config).wait().unwrap()).await.unwrap()
}

/// A router with the rules of this PKI in one flow, and none in the `open` one; and where it is.
pub(super) async fn router(pki: &Pki, open_flow: &str) -> (Session, String) {
    let mut config = zenohd_config("tls/127.0.0.1:0", &[], pki.folder()).unwrap();
    let whole = |id: &str, flows: &[&str], keys: &[&str]| json!({ "id": id, "permission": "allow", "flows": flows, "messages": EVERY_KIND, "key_exprs": keys });
    let rules = &mut config["access_control"];
    let added = [
        whole("open", &[open_flow], &["**", "**/@adv/**"]),
        whole("test", &["ingress", "egress"], &[&format!("{TEST}/**")]),
    ];
    rules["rules"].as_array_mut().unwrap().extend(added);
    let policy = json!({ "id": "test", "rules": ["open", "test"], "subjects": ["anybody"] });
    rules["policies"].as_array_mut().unwrap().push(policy);
    config["adminspace"] = json!({ "enabled": true });
    let session = open(&config).await;
    let endpoint = session.info().locators().await.first().unwrap().to_string();
    (session, endpoint)
}

/// A client's session with this identity.
pub(super) async fn client(pki: &Pki, of: &str, router: &str) -> Session {
    open(&pki.opening(of, router).to_json().unwrap()).await
}

/// Waits until everything that the session has sent is where it should be, and everything that the observer had sent
/// to it before is here: a question and its answer go the same way.
pub(super) async fn marker(session: &Session) {
    let asking = session.get(format!("{TEST}/marker")).target(zenoh::query::QueryTarget::All);
    let replies = asking.timeout(WITHIN).await.unwrap();
    let answer = tokio::time::timeout(WITHIN, replies.recv_async()).await;
    answer.expect("the marker is answered").expect("the marker is answered").result().unwrap();
}
