//! Sessions without any of our checks in between, and routers whose rules are changed in one flow: so that the other
//! is seen alone.

use fleet_tests::identities::Pki;
use serde_json::{Value, json};
use std::time::Duration;
use xtb_services::router::zenohd_config;
use zenoh::{Config, Session, Wait};

/// What is declared to hear everything: wildcards do not meet chunks that begin with `@`.
pub(super) const EVERYTHING: [&str; 3] = ["**", "**/@adv/**", "@ros2_lv/**"];
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

async fn open(mut config: Value) -> Session {
    // A batch that waits to be filled would be overtaken by messages of lower priority, such as a marker.
    config["transport"]["link"]["tx"]["queue"] = json!({ "batching": { "enabled": false } });
    let config = Config::from_json5(&config.to_string()).unwrap();
    tokio::task::spawn_blocking(|| zenoh::open(config).wait().unwrap()).await.unwrap()
}

/// See [`router`].
pub(super) struct Router {
    pub(super) session: Session,
    pub(super) endpoint: String,
    _answers: Box<dyn std::any::Any>,
}

/// A router with the rules of this PKI in one flow, and none in the `open` one.
pub(super) async fn router(pki: &Pki, open_flow: &str) -> Router {
    let mut config = zenohd_config("tls/127.0.0.1:0", &[], pki.folder(), Some(7)).unwrap();
    let whole = |id: &str, flows: &[&str], keys: &[&str]| json!({ "id": id, "permission": "allow", "flows": flows, "messages": EVERY_KIND, "key_exprs": keys });
    let rules = &mut config["access_control"];
    let added = [
        whole("open", &[open_flow], &EVERYTHING),
        whole("test", &["ingress", "egress"], &[&format!("{TEST}/**")]),
    ];
    rules["rules"].as_array_mut().unwrap().extend(added);
    let policy = json!({ "id": "test", "rules": ["open", "test"], "subjects": ["anybody"] });
    rules["policies"].as_array_mut().unwrap().push(policy);
    config["adminspace"] = json!({ "enabled": true });
    let session = open(config).await;
    let endpoint = session.info().locators().await.first().unwrap().to_string();
    let _answers = answer(&session, &format!("{TEST}/router")).await;
    Router { session, endpoint, _answers }
}

/// Answers questions on this key with nothing.
pub(super) async fn answer(session: &Session, key: &str) -> Box<dyn std::any::Any> {
    let own = key.to_owned();
    let answering = session.declare_queryable(own.clone()).callback(move |query| {
        let _ = query.reply(&own, "").wait();
    });
    Box::new(answering.await.unwrap())
}

/// A client's session with this identity.
pub(super) async fn client(pki: &Pki, of: &str, router: &str) -> Session {
    open(pki.opening(of, router).to_json().unwrap()).await
}

/// Waits until everything that the session has sent is at the observer, and everything that the observer had sent to it
/// before is here: a question and its answer go the same way.
pub(super) async fn marker(session: &Session) {
    asked(session, "marker").await;
}

/// The same for what others have declared: such messages have a queue of their own, of which a marker overtakes the last
/// one once in a while.
pub(super) async fn markers(session: &Session) {
    for _ in 0..5 {
        marker(session).await;
    }
}

/// Waits until the router has taken everything that the session has sent.
pub(super) async fn settled(session: &Session) {
    asked(session, "router").await;
}

async fn asked(session: &Session, key: &str) {
    let asking = session.get(format!("{TEST}/{key}")).target(zenoh::query::QueryTarget::All);
    // A full queue holds it up, and its answer, instead of losing them.
    let asking = asking.congestion_control(zenoh::qos::CongestionControl::Block);
    let replies = asking.timeout(WITHIN).await.unwrap();
    let answer = tokio::time::timeout(WITHIN, replies.recv_async()).await;
    let answer = answer.unwrap_or_else(|_| panic!("{key} takes too long"));
    answer.unwrap_or_else(|_| panic!("{key} is not answered")).result().unwrap();
}
