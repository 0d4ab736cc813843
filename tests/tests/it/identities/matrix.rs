//! Each role × each kind of message × both flows × every key, against the oracle: 0 differences.
//!
//! The observer has a router's rights. What an identity sends is judged by what the observer gets or the router has
//! on record, what it is sent by what it gets, both once a marker has come the same way.

use super::keys::keys;
use super::oracle::Who;
use super::session::{EVERYTHING, TEST, answer, client, marker, markers, router, settled};
use super::{EVERYBODY, REVOKED, everybody};
use fleet_tests::eventually;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use zenoh::Session;
use zenoh::Wait;
use zenoh::key_expr::keyexpr;
use zenoh::qos::CongestionControl::Block;
use zenoh::query::{ConsolidationMode, QueryTarget, ReplyKeyExpr};
use zenoh::sample::SampleKind;

/// Longer than the test runs.
const LONG: Duration = Duration::from_secs(120);

/// Kinds and keys (by number) that came.
type Passed = Arc<Mutex<BTreeSet<(&'static str, usize)>>>;

fn number(bytes: impl AsRef<[u8]>) -> Option<usize> {
    std::str::from_utf8(bytes.as_ref()).ok()?.parse().ok()
}

fn pass(passed: &Passed, kind: &'static str, index: Option<usize>) {
    if let Some(index) = index {
        passed.lock().unwrap().insert((kind, index));
    }
}

/// Hears every put, delete and question, until it is dropped.
async fn hear(session: &Session, passed: &Passed) -> Box<dyn std::any::Any> {
    let mut heard: Vec<Box<dyn std::any::Any>> = Vec::new();
    for key in EVERYTHING {
        let to = Arc::clone(passed);
        let puts = session.declare_subscriber(key).callback(move |sample| {
            let kind = if sample.kind() == SampleKind::Put { "put" } else { "delete" };
            pass(&to, kind, sample.attachment().and_then(|number_| number(number_.to_bytes())));
        });
        heard.push(Box::new(puts.await.unwrap()));
        let to = Arc::clone(passed);
        let asked = session.declare_queryable(key).callback(move |query| {
            pass(&to, "query", query.attachment().and_then(|number_| number(number_.to_bytes())));
        });
        heard.push(Box::new(asked.await.unwrap()));
    }
    Box::new(heard)
}

/// Puts, deletes and asks on every key.
async fn send(session: &Session, keys: &[String]) {
    for (index, key) in keys.iter().enumerate() {
        let number = index.to_string();
        session.put(key, "").attachment(&number).congestion_control(Block).await.unwrap();
        session.delete(key).attachment(&number).congestion_control(Block).await.unwrap();
        let asking = session.get(key).attachment(&number).congestion_control(Block).target(QueryTarget::All);
        asking.timeout(LONG).callback(|_| {}).await.unwrap();
    }
}

/// Answers each question on this key with an answer on every key.
async fn answer_all(session: &Session, at: &str, keys: &[String]) -> Box<dyn std::any::Any> {
    let keys = keys.to_vec();
    let answering = session.declare_queryable(at.to_owned()).callback(move |query| {
        for (index, key) in keys.iter().enumerate() {
            // A question to all keys does not take each.
            let _ = query.reply(key, index.to_string()).wait();
        }
    });
    Box::new(answering.await.unwrap())
}

/// Asks on this key, and takes answers on any.
async fn ask_all(session: &Session, at: &str, passed: &Passed) {
    let asking = session.get(at).target(QueryTarget::All).consolidation(ConsolidationMode::None);
    let asking = asking.congestion_control(Block);
    let answers = asking.accept_replies(ReplyKeyExpr::Any).timeout(LONG).await.unwrap();
    while let Ok(answer) = answers.recv_async().await {
        pass(passed, "reply", answer.result().ok().and_then(|sample| number(sample.payload().to_bytes())));
    }
}

/// Presence on every key.
async fn tokens(session: &Session, keys: &[String]) -> Vec<zenoh::liveliness::LivelinessToken> {
    let mut tokens = Vec::new();
    for key in keys {
        tokens.push(session.liveliness().declare_token(key).await.unwrap());
    }
    tokens
}

/// What the router has on record of what a session has declared: `subscriber`, `queryable` or `token`.
async fn on_record(router: &Session, what: &str, of: &Session) -> BTreeSet<String> {
    let (own, zid) = (format!("@/{}/router/{what}/", router.zid()), of.zid().to_string());
    let mut found = BTreeSet::new();
    for all in EVERYTHING {
        let answers = router.get(format!("{own}{all}")).timeout(LONG).await.unwrap();
        while let Ok(answer) = answers.recv_async().await {
            let sample = answer.into_result().unwrap();
            let sources = String::from_utf8(sample.payload().to_bytes().into_owned()).unwrap();
            if sources.contains(&zid) {
                found.insert(sample.key_expr().as_str().strip_prefix(&own).unwrap().to_owned());
            }
        }
    }
    found
}

/// Compares what came with the oracle; gives back the number of cells, and the differences.
struct Judge<'a> {
    name: &'a str,
    who: Who,
    keys: &'a [String],
    flow: &'static str,
    cells: usize,
    wrong: Vec<String>,
}

impl Judge<'_> {
    fn cell(&mut self, kind: &str, key: &str, expected: bool, came: bool) {
        self.cells += 1;
        if came != expected {
            let (name, flow) = (self.name, self.flow);
            self.wrong.push(format!("{name}: {flow} {kind} {key}: came = {came}"));
        }
    }

    fn kind(&mut self, kind: &str, came: impl Fn(usize, &str) -> bool, judged: impl Fn(&str) -> bool) {
        for (index, key) in self.keys.iter().enumerate().filter(|(_, key)| judged(key)) {
            let expected = self.who.may(self.flow, kind, key);
            self.cell(kind, key, expected, came(index, key));
        }
    }

    /// The keys that meet one that may be declared.
    fn met(&self, kind: &str) -> BTreeSet<usize> {
        let keys: Vec<&keyexpr> = self.keys.iter().map(|key| keyexpr::new(key.as_str()).unwrap()).collect();
        let allowed: Vec<&keyexpr> =
            keys.iter().filter(|key| self.who.may(self.flow, kind, key)).copied().collect();
        let met = |(_, key): &(usize, &&keyexpr)| allowed.iter().any(|other| other.intersects(key));
        keys.iter().enumerate().filter(met).map(|(index, _)| index).collect()
    }

    /// Where a key counts as declared when anything that meets it is.
    fn matching(&mut self, kind: &str, came: &BTreeSet<usize>, judged: impl Fn(&str) -> bool) {
        let met = self.met(kind);
        for (index, key) in self.keys.iter().enumerate().filter(|(_, key)| judged(key)) {
            self.cell(kind, key, met.contains(&index), came.contains(&index));
        }
    }
}

fn all(_: &str) -> bool {
    true
}

fn judges<'a>(keys: &'a [String], flow: &'static str) -> Vec<Judge<'a>> {
    let admitted = EVERYBODY.iter().map(|(name, role)| (*name, Some(*role)));
    let judge =
        |(name, role)| Judge { name, who: Who::new(name, role), keys, flow, cells: 0, wrong: Vec::new() };
    admitted.chain([(REVOKED, None)]).map(judge).collect()
}

fn verdict(judges: Vec<Judge<'_>>) {
    let (mut cells, mut wrong) = (0, Vec::new());
    for judge in judges {
        cells += judge.cells;
        wrong.extend(judge.wrong);
    }
    assert!(wrong.is_empty(), "{} of {cells} cells differ:\n{}", wrong.len(), wrong.join("\n"));
    assert!(cells > 9_000, "{cells} cells");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_each_role_sends_passes_as_the_design_says() {
    let (pki, keys) = (everybody(), keys());
    let router = router(&pki, "egress").await;
    let observer = client(&pki, "router", &router.endpoint).await;
    let passed = Passed::default();
    let (_markers, _heard) =
        (answer(&observer, &format!("{TEST}/marker")).await, hear(&observer, &passed).await);
    settled(&observer).await;
    let mut judges = judges(&keys, "in");
    for judge in &mut judges {
        let session = client(&pki, judge.name, &router.endpoint).await;
        passed.lock().unwrap().clear();
        send(&session, &keys).await;
        marker(&session).await;
        let at = format!("{TEST}/{}", judge.name);
        let answering = answer_all(&session, &at, &keys).await;
        marker(&session).await;
        ask_all(&observer, &at, &passed).await;
        drop(answering);
        let came = passed.lock().unwrap().clone();
        for kind in ["put", "delete", "query", "reply"] {
            judge.kind(kind, |index, _| came.contains(&(kind, index)), all);
        }
        declare(judge, &router.session, &observer, &session).await;
        look_who_is_there(judge, &observer, &session).await;
        session.close().await.unwrap();
    }
    verdict(judges);
}

/// Subscribers, queryables and tokens on every key: on record at the router, or, on keys that it keeps no public
/// record of, by what comes of them.
async fn declare(judge: &mut Judge<'_>, router: &Session, observer: &Session, session: &Session) {
    let (passed, mut declared) = (Passed::default(), Vec::<Box<dyn std::any::Any>>::new());
    for (index, key) in judge.keys.iter().enumerate() {
        let to = Arc::clone(&passed);
        let each = move |sample: zenoh::sample::Sample| {
            let came = sample.attachment().and_then(|own| number(own.to_bytes()));
            pass(&to, "declare_subscriber", came.filter(|came| *came == index));
        };
        declared.push(Box::new(session.declare_subscriber(key).callback(each).await.unwrap()));
        let to = Arc::clone(&passed);
        let each = move |query: zenoh::query::Query| {
            let came = query.attachment().and_then(|own| number(own.to_bytes()));
            pass(&to, "declare_queryable", came.filter(|came| *came == index));
        };
        declared.push(Box::new(session.declare_queryable(key).callback(each).await.unwrap()));
    }
    declared.push(Box::new(tokens(session, judge.keys).await));
    marker(session).await;
    for (kind, what) in [
        ("declare_subscriber", "subscriber"),
        ("declare_queryable", "queryable"),
        ("liveliness_token", "token"),
    ] {
        let found = on_record(router, what, session).await;
        judge.kind(kind, |_, key| found.contains(key), is_public);
    }
    send(observer, judge.keys).await;
    marker(session).await;
    let came = passed.lock().unwrap().clone();
    for kind in ["declare_subscriber", "declare_queryable"] {
        let came = came.iter().filter(|(its, _)| *its == kind).map(|(_, index)| *index).collect();
        judge.matching(kind, &came, |key| !is_public(key));
    }
    let mut found = BTreeSet::new();
    for all in EVERYTHING {
        let there = observer.liveliness().get(all).timeout(LONG).await.unwrap();
        while let Ok(answer) = there.recv_async().await {
            found.insert(answer.into_result().unwrap().key_expr().to_string());
        }
    }
    judge.kind("liveliness_token", |_, key| found.contains(key), |key| !is_public(key));
    drop(declared);
    marker(session).await;
}

/// Whether a router's public record can have a key: none with a chunk that wildcards do not meet.
fn is_public(key: &str) -> bool {
    !key.contains('@')
}

/// Asks who is there on every key, at once, and then from now on; somebody is.
async fn look_who_is_there(judge: &mut Judge<'_>, observer: &Session, session: &Session) {
    let there = tokens(observer, judge.keys).await;
    settled(observer).await;
    let passed = Passed::default();
    for (index, key) in judge.keys.iter().enumerate() {
        let (to, own) = (Arc::clone(&passed), key.clone());
        let each = move |answer: zenoh::query::Reply| {
            let came = answer.result().is_ok_and(|sample| sample.key_expr().as_str() == own);
            pass(&to, "liveliness_query", came.then_some(index));
        };
        session.liveliness().get(key).timeout(LONG).callback(each).await.unwrap();
    }
    markers(session).await;
    let mut watching = Vec::new();
    for (index, key) in judge.keys.iter().enumerate() {
        let (to, own) = (Arc::clone(&passed), key.clone());
        let each = move |sample: zenoh::sample::Sample| {
            let came = sample.key_expr().as_str() == own;
            pass(&to, "declare_liveliness_subscriber", came.then_some(index));
        };
        watching
            .push(session.liveliness().declare_subscriber(key).history(true).callback(each).await.unwrap());
    }
    // Whoever may is told in the end; a marker can overtake that.
    let kind = "declare_liveliness_subscriber";
    let met = judge.met(kind);
    eventually("presence", || async {
        marker(session).await;
        let came = passed.lock().unwrap();
        met.iter().all(|index| came.contains(&(kind, *index))).then_some(())
    })
    .await;
    let came = passed.lock().unwrap().clone();
    judge.kind("liveliness_query", |index, _| came.contains(&("liveliness_query", index)), all);
    // What one subscription brings, the session gives to its others too.
    let came = came.iter().filter(|(its, _)| *its == kind).map(|(_, index)| *index).collect();
    judge.matching(kind, &came, all);
    drop(there);
    settled(observer).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_each_role_is_sent_passes_as_the_design_says() {
    let (pki, keys) = (everybody(), keys());
    let router = router(&pki, "ingress").await;
    let observer = client(&pki, "router", &router.endpoint).await;
    let _markers = answer(&observer, &format!("{TEST}/marker")).await;
    let at = format!("{TEST}/all");
    let _answering = answer_all(&observer, &at, &keys).await;
    settled(&observer).await;
    let mut judges = judges(&keys, "out");
    for judge in &mut judges {
        let session = client(&pki, judge.name, &router.endpoint).await;
        let passed = Passed::default();
        let heard = hear(&session, &passed).await;
        marker(&session).await;
        send(&observer, &keys).await;
        marker(&session).await;
        ask_all(&session, &at, &passed).await;
        drop(heard);
        let came = passed.lock().unwrap().clone();
        for kind in ["put", "delete", "query", "reply"] {
            judge.kind(kind, |index, _| came.contains(&(kind, index)), all);
        }
        hear_declarations(judge, &observer, &session).await;
        session.close().await.unwrap();
    }
    drop(router);
    verdict(judges);
}

/// The observer subscribes, answers and is there on every key: whether the session sees it.
async fn hear_declarations(judge: &mut Judge<'_>, observer: &Session, session: &Session) {
    let (passed, mut watching) = (Passed::default(), Vec::new());
    for key in EVERYTHING {
        let (to, keys) = (Arc::clone(&passed), judge.keys.to_vec());
        let each = move |sample: zenoh::sample::Sample| {
            pass(&to, "liveliness_token", keys.iter().position(|key| *key == sample.key_expr().as_str()));
        };
        watching.push(session.liveliness().declare_subscriber(key).callback(each).await.unwrap());
    }
    let (mut publishers, mut queriers) = (Vec::new(), Vec::new());
    // A session with a querier on all keys would no longer ask where it has not heard of an answer, as of the marker.
    let queried: Vec<&String> = judge.keys.iter().filter(|key| *key != "**").collect();
    for key in judge.keys {
        publishers.push(session.declare_publisher(key).await.unwrap());
    }
    for key in &queried {
        queriers.push(session.declare_querier(*key).target(QueryTarget::All).await.unwrap());
    }
    markers(session).await;
    let mut declared: Vec<Box<dyn std::any::Any>> = vec![Box::new(tokens(observer, judge.keys).await)];
    for key in judge.keys {
        declared.push(Box::new(observer.declare_subscriber(key).callback(|_| {}).await.unwrap()));
        declared.push(Box::new(observer.declare_queryable(key).callback(|_| {}).await.unwrap()));
    }
    markers(session).await;
    let (mut subscribed, mut served) = (BTreeSet::new(), BTreeSet::new());
    for (index, publisher) in publishers.iter().enumerate() {
        if publisher.matching_status().await.unwrap().matching() {
            subscribed.insert(index);
        }
    }
    for (key, querier) in queried.iter().zip(&queriers) {
        if querier.matching_status().await.unwrap().matching() {
            served.insert((*key).clone());
        }
    }
    let came = passed.lock().unwrap().clone();
    judge.kind("liveliness_token", |index, _| came.contains(&("liveliness_token", index)), all);
    judge.matching("declare_subscriber", &subscribed, all);
    // Of what meets a querier's key Zenoh tells it the sum, on that key.
    judge.kind("declare_queryable", |_, key| served.contains(key), |key| key != "**");
    drop(declared);
    settled(observer).await;
}
