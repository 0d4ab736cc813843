//! An attacker on the network: a Zenoh session of its own, without any of our checks in between.

use fleet_tests::PATIENCE;
use xtb_protocol::codec;
use xtb_protocol::codec::Format;
use xtb_protocol::messages::Message;
use zenoh::Session;

/// A session that is a client of this router.
pub(crate) async fn session(router: &str) -> Session {
    let mut config = zenoh::Config::default();
    for (name, value) in [
        ("mode", "\"client\"".to_owned()),
        ("connect/endpoints", format!("[{router:?}]")),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
    ] {
        config.insert_json5(name, &value).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

/// Puts bytes on a key expression, each with the care of a request so that all of them arrive.
pub(crate) async fn put(session: &Session, key_expr: &str, encoding: &str, bytes: Vec<u8>) {
    let sending = session.put(key_expr.to_owned(), bytes).encoding(encoding);
    sending.congestion_control(zenoh::qos::CongestionControl::Block).await.unwrap();
}

/// Asks on a key expression, and gives back the keys and payloads of all answers.
pub(crate) async fn ask<M: Message>(
    session: &Session,
    key_expr: &str,
    message: &M,
) -> Vec<(String, Vec<u8>)> {
    let replies = session
        .get(key_expr.to_owned())
        .payload(codec::encode(message, Format::Postcard).unwrap())
        .encoding(codec::encoding::<M>(Format::Postcard))
        .target(zenoh::query::QueryTarget::All)
        .consolidation(zenoh::query::ConsolidationMode::None)
        .timeout(PATIENCE)
        .await
        .unwrap();
    let mut answers = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        if let Ok(sample) = reply.result() {
            answers.push((sample.key_expr().to_string(), sample.payload().to_bytes().into_owned()));
        }
    }
    answers
}

/// Answers each question on `key_expr` with these bytes of an `M`, until it is dropped: on the question's key,
/// or on `key_expr` if that has wildcards.
pub(crate) async fn answer<M: Message>(
    session: &Session,
    key_expr: &str,
    bytes: impl Fn(&[u8]) -> Vec<u8> + Send + Sync + 'static,
) -> zenoh::query::Queryable<()> {
    use zenoh::Wait;
    let own = key_expr.to_owned();
    let queryable = session.declare_queryable(key_expr.to_owned()).complete(true);
    let each = move |query: zenoh::query::Query| {
        let asked = query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default();
        let key = if query.key_expr().is_wild() { own.as_str() } else { query.key_expr().as_str() };
        let reply = query.reply(key, bytes(&asked));
        reply.encoding(codec::encoding::<M>(Format::Postcard)).wait().unwrap();
    };
    queryable.callback(each).await.unwrap()
}
