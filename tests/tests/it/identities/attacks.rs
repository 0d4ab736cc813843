//! Each attack, tried as every identity that the attack is not the job of: nothing reaches whom it is meant for, and
//! a real robot that is held by somebody drives nowhere.

use super::robot::Robot;
use super::session::client;
use super::{EVERYBODY, REVOKED, everybody};
use fleet_tests::identities::Pki;
use fleet_tests::{Pilot, eventually};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use xtb_identity::Role;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::messages::{Body, Message, Request, Setpoint};
use zenoh::Session;
use zenoh::Wait;
use zenoh::query::{ConsolidationMode, QueryTarget, ReplyKeyExpr};

const LONG: Duration = Duration::from_secs(60);
/// What every attack bears.
const ATTACK: &str = "attack";
/// What alice's own questions bear.
const QUESTION: &str = "question";

/// Puts that nobody may send but these roles. `OTHER` is a name that is not the attacker's.
const PUTS: [(&str, &[Role]); 24] = [
    // take over teleoperation
    ("xtb-1/teleop/alice", &[Role::Operator]),
    ("*/teleop/alice", &[Role::Operator]),
    ("xtb-1/teleop/*", &[]),
    ("xtb-1/*/alice", &[]),
    ("xtb-1/*/eve", &[]),
    ("xtb-1/**", &[]),
    ("**", &[]),
    ("*/*/alice", &[]),
    // stop under another's name
    ("xtb-1/estop/alice", &[Role::Operator]),
    ("all/estop/alice", &[Role::Operator]),
    ("all/estop/*", &[]),
    // forge what the fleet says
    ("xtb-2/state", &[Role::Simulator]),
    ("*/state", &[Role::Simulator]),
    ("xtb-2/event", &[Role::Simulator]),
    ("xtb-2/near/x0y0", &[Role::Simulator]),
    ("xtb-1/fix", &[Role::Tracker, Role::Simulator]),
    ("xtb-1/route", &[Role::Traffic, Role::Dispatcher]),
    ("traffic/state", &[Role::Traffic, Role::Dispatcher]),
    ("map", &[Role::Map, Role::Dispatcher, Role::Simulator]),
    ("map/places", &[Role::Map, Role::Dispatcher, Role::Simulator]),
    ("dispatch/tasks", &[Role::Dispatcher]),
    ("dispatch/event", &[Role::Dispatcher]),
    ("dispatch/alerts", &[Role::Dispatcher]),
    ("sim/truth", &[Role::Simulator]),
];
/// Questions that nobody may ask but these.
const QUESTIONS: [(&str, &[Role]); 12] = [
    // steal the lease; command under the holder's; log and tasks under another's name
    ("xtb-1/cmd/alice", &[Role::Operator]),
    ("*/cmd/alice", &[Role::Operator]),
    ("xtb-1/cmd/nobody", &[]),
    ("xtb-1/cmd/*", &[]),
    ("xtb-1/log/alice", &[Role::Operator]),
    ("xtb-1/param/alice", &[Role::Operator]),
    ("xtb-1/estop/alice", &[Role::Operator]),
    ("dispatch/cmd/alice", &[Role::Operator]),
    ("dispatch/ack/alice", &[Role::Operator]),
    ("dispatch/standby/dispatch", &[Role::Dispatcher]),
    ("map/edit/alice", &[Role::Operator]),
    ("xtb-1/*/alice", &[]),
];
/// Answers that nobody may give but these: a shadow of the robot, the dispatcher, the map or the roster.
const SHADOWS: [(&str, &[Role]); 16] = [
    ("xtb-1/state", &[Role::Robot, Role::Simulator]),
    ("xtb-1/about", &[Role::Robot, Role::Simulator]),
    ("xtb-1/cmd/alice", &[Role::Robot, Role::Simulator]),
    ("xtb-1/event/@adv/**", &[Role::Robot, Role::Simulator]),
    ("dispatch/tasks", &[Role::Dispatcher]),
    ("dispatch/homes", &[Role::Dispatcher]),
    ("dispatch/cmd/alice", &[Role::Dispatcher]),
    ("dispatch/ack/alice", &[Role::Dispatcher]),
    ("dispatch/alerts", &[Role::Dispatcher]),
    ("dispatch/history", &[Role::Dispatcher]),
    ("map", &[Role::Map, Role::Dispatcher, Role::Simulator]),
    ("map/places", &[Role::Map, Role::Dispatcher, Role::Simulator]),
    ("map/history", &[Role::Map, Role::Dispatcher, Role::Simulator]),
    ("map/edit/alice", &[Role::Map, Role::Dispatcher, Role::Simulator]),
    ("sim/roster", &[Role::Simulator]),
    ("identity/alice", &[]),
];
/// Names that nobody may have but these.
const NAMES: [(&str, &[Role]); 4] = [
    ("xtb-2/alive", &[Role::Simulator]),
    ("traffic/alive", &[Role::Traffic, Role::Dispatcher]),
    ("dispatch/alive", &[Role::Dispatcher]),
    ("xtb-2/event/@adv/pub/1/1/_", &[Role::Simulator]),
];

/// Who was reached by what.
type Effects = Arc<Mutex<Vec<String>>>;

/// Everything that those who could be harmed hear, in their own right; until it is dropped.
async fn victims(pki: &Pki, router: &str, effects: &Effects) -> Vec<Box<dyn std::any::Any>> {
    let mut all: Vec<Box<dyn std::any::Any>> = Vec::new();
    for (who, hears, answers) in [
        (
            "xtb-1",
            &[
                "xtb-1/teleop/*",
                "xtb-1/estop/*",
                "all/estop/*",
                "xtb-1/fix",
                "xtb-1/route",
                "map",
                "*/near/x0y0",
            ][..],
            &["xtb-1/cmd/*", "xtb-1/log/*", "xtb-1/param/*", "xtb-1/estop/*", "xtb-1/state"][..],
        ),
        (
            "archive",
            &[
                "*/state",
                "*/event",
                "*/fix",
                "*/route",
                "*/near/*",
                "map",
                "map/places",
                "traffic/state",
                "dispatch/tasks",
                "dispatch/event",
                "dispatch/alerts",
                "sim/truth",
            ],
            &[],
        ),
        (
            "tasks",
            &["all/estop/*"],
            &["dispatch/cmd/*", "dispatch/ack/*", "dispatch/standby/*", "map/edit/*"],
        ),
    ] {
        let session = client(pki, who, router).await;
        for key in hears {
            let to = Arc::clone(effects);
            let each = move |sample: zenoh::sample::Sample| {
                note(&to, sample.attachment(), &format!("{who} hears a put on {}", sample.key_expr()));
            };
            let hearing = session.declare_subscriber(format!("xtb/lab/{key}")).callback(each);
            all.push(Box::new(hearing.await.unwrap()));
        }
        for key in answers {
            let to = Arc::clone(effects);
            let each = move |query: zenoh::query::Query| {
                note(&to, query.attachment(), &format!("{who} is asked on {}", query.key_expr()));
            };
            let answering = session.declare_queryable(format!("xtb/lab/{key}")).callback(each);
            all.push(Box::new(answering.await.unwrap()));
        }
        all.push(Box::new(session));
    }
    let looker = client(pki, "vera", router).await;
    for key in ["*/alive", "traffic/alive", "dispatch/alive", "*/event/@adv/**"] {
        let to = Arc::clone(effects);
        let each = move |sample: zenoh::sample::Sample| {
            // The real robot is there.
            if !sample.key_expr().as_str().contains("/xtb-1/") {
                to.lock().unwrap().push(format!("vera sees {}", sample.key_expr()));
            }
        };
        let watching = looker.liveliness().declare_subscriber(format!("xtb/lab/{key}")).callback(each);
        all.push(Box::new(watching.await.unwrap()));
    }
    settle(&looker, "vera").await;
    all.push(Box::new(looker));
    all
}

fn note(effects: &Effects, attachment: Option<&zenoh::bytes::ZBytes>, what: &str) {
    if let Some(by) =
        attachment.and_then(|by| by.try_to_string().ok()?.strip_prefix(ATTACK).map(str::to_owned))
    {
        effects.lock().unwrap().push(format!("{by}: {what}"));
    }
}

/// Everything that this session has sent has been judged: the router itself answers a question that anybody may ask.
async fn settle(session: &Session, of: &str) {
    let answers = session.get(format!("xtb/lab/identity/{of}")).timeout(LONG).await.unwrap();
    answers.recv_async().await.expect("the router answers").result().unwrap();
}

fn bytes<M: Message>(message: &M) -> (Vec<u8>, String) {
    (codec::encode(message, Format::Postcard).unwrap(), codec::encoding::<M>(Format::Postcard))
}

/// Everything that one identity could try, with the lease that is held.
async fn attack(session: &Session, by: &str, role: Option<Role>, pilot: &Pilot) {
    let mine = |roles: &[Role]| role.is_some_and(|role| roles.contains(&role));
    let attachment = format!("{ATTACK}{by}");
    let lease = pilot.lease();
    let echo = pilot.next_setpoint(0.0, 0.0).unwrap().echo_tick_ms;
    let (drive, kind) =
        bytes(&Setpoint { lease, seq: u64::from(u32::MAX), echo_tick_ms: echo, rpm: 60.0, steering: 0.5 });
    for (key, _) in PUTS.iter().filter(|(_, roles)| !mine(roles)) {
        let put = session.put(format!("xtb/lab/{key}"), drive.clone()).encoding(kind.as_str());
        put.attachment(&attachment).congestion_control(zenoh::qos::CongestionControl::Block).await.unwrap();
    }
    for body in [
        Body::Acquire { take: true },
        Body::Wander { for_s: None, on_link_loss: Default::default(), finish_s: 60.0 },
    ] {
        let lease = if matches!(body, Body::Acquire { .. }) { None } else { lease };
        let (ask, kind) = bytes(&Request { id: Uuid::new_v4(), lease, body });
        for (key, _) in QUESTIONS.iter().filter(|(_, roles)| !mine(roles)) {
            let asking = session.get(format!("xtb/lab/{key}")).payload(ask.clone()).encoding(kind.as_str());
            asking
                .attachment(&attachment)
                .target(QueryTarget::All)
                .timeout(LONG)
                .callback(|_| {})
                .await
                .unwrap();
        }
    }
}

/// What stays while others ask: shadows, and names.
async fn squat(
    session: &Session,
    by: &str,
    role: Option<Role>,
    effects: &Effects,
) -> Vec<Box<dyn std::any::Any>> {
    let mine = |roles: &[Role]| role.is_some_and(|role| roles.contains(&role));
    let mut all: Vec<Box<dyn std::any::Any>> = Vec::new();
    for (key, _) in SHADOWS.iter().chain(&[("**", &[][..])]).filter(|(_, roles)| !mine(roles)) {
        let (to, told) = (Arc::clone(effects), format!("{by} is asked as {key}"));
        let each = move |query: zenoh::query::Query| {
            // Its own attacks may be answered by itself.
            if query.attachment().is_some_and(|by| by.to_bytes() == QUESTION.as_bytes()) {
                to.lock().unwrap().push(format!("{told}: {}", query.key_expr()));
            }
            let _ = query.reply(query.key_expr(), ATTACK).wait();
        };
        let shadow = session.declare_queryable(format!("xtb/lab/{key}")).complete(true).callback(each);
        all.push(Box::new(shadow.await.unwrap()));
    }
    for (key, _) in NAMES.iter().filter(|(_, roles)| !mine(roles)) {
        let token = session.liveliness().declare_token(format!("xtb/lab/{key}"));
        all.push(Box::new(token.await.unwrap()));
    }
    all
}

/// Asks as alice where somebody may have a shadow.
async fn ask_where_shadows_are(alice: &Session, effects: &Effects) {
    for (key, _) in SHADOWS {
        let asking = alice.get(format!("xtb/lab/{key}")).attachment(QUESTION).target(QueryTarget::All);
        let asking = asking.consolidation(ConsolidationMode::None).accept_replies(ReplyKeyExpr::Any);
        let to = Arc::clone(effects);
        let each = move |reply: zenoh::query::Reply| {
            if reply.result().is_ok_and(|sample| sample.payload().to_bytes() == ATTACK.as_bytes()) {
                to.lock().unwrap().push(format!("alice is answered on {key}"));
            }
        };
        asking.timeout(LONG).callback(each).await.unwrap();
    }
    settle(alice, "alice").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_identity_can_do_what_is_anothers_and_a_held_robot_stays_with_its_holder() {
    let pki = everybody();
    let router = pki.router().await;
    let endpoint = router.endpoint().to_owned();
    let bus = pki.opening("alice", &endpoint).once().await.unwrap();
    let robot = Robot::start(&pki, &endpoint, &bus, None).await;
    let pilot = Robot::pilot(&bus, "alice").await;
    let alice = client(&pki, "alice", &endpoint).await;
    let effects = Effects::default();
    let victims = victims(&pki, &endpoint, &effects).await;
    let attackers = EVERYBODY.iter().map(|(of, role)| (*of, Some(*role))).chain([(REVOKED, None)]);
    // A router may do everything.
    for (by, role) in attackers.filter(|(_, role)| *role != Some(Role::Router)) {
        let session = client(&pki, by, &endpoint).await;
        let squatting = squat(&session, by, role, &effects).await;
        settle(&session, by).await;
        attack(&session, by, role, &pilot).await;
        settle(&session, by).await;
        ask_where_shadows_are(&alice, &effects).await;
        pilot.setpoint(0.0, 0.0).await;
        drop(squatting);
        session.close().await.unwrap();
    }
    assert_eq!(*effects.lock().unwrap(), Vec::<String>::new());
    assert_eq!(robot.driven(), 0, "somebody has driven it");
    let held = pilot.lease().expect("alice still has it");
    // What would be seen of an attack: alice, who may, drives and is heard.
    let session = client(&pki, "alice", &endpoint).await;
    eventually("alice's own put", || async {
        let put = session.put("xtb/lab/xtb-1/teleop/alice", "").attachment(format!("{ATTACK}alice"));
        put.await.unwrap();
        (!effects.lock().unwrap().is_empty()).then_some(())
    })
    .await;
    eventually("the robot drives", || async {
        pilot.setpoint(60.0, 0.0).await;
        tokio::time::sleep(Duration::from_millis(20)).await;
        (robot.driven() > 0).then_some(())
    })
    .await;
    assert_eq!(pilot.lease(), Some(held));
    drop(victims);
    robot.end().await;
    router.close().await;
}
