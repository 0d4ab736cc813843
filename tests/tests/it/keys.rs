//! A key that comes in is exactly one of ours with a concrete client, or it does nothing but count.

use crate::attacker;
use fleet_tests::{Fleet, Setup, eventually, name};
use xtb_control::Mode;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{
    Body, Done, Estop, Estopped, Latch, Lease, Outcome, Reply, Request, RobotState, Setpoint, StopReason,
};

/// The first robot's keys under another channel name or with wildcards: what follows `xtb/lab/xtb-1/`.
fn below(fleet: &Fleet, rest: &str) -> String {
    fleet.robot(1).state().replace("state", rest)
}

fn acquire() -> Request {
    Request { id: Uuid::new_v4(), lease: None, body: Body::Acquire { take: true } }
}

fn lease_of(payload: &[u8]) -> Lease {
    let encoding = codec::encoding::<Reply>(Format::Postcard);
    let (reply, _) = codec::decode::<Reply>(&encoding, payload).unwrap();
    match reply.result {
        Outcome::Ok(Done { lease: Some(lease), .. }) => lease,
        other => panic!("no lease: {other:?}"),
    }
}

fn malformed(state: &RobotState) -> u64 {
    state.rejected.malformed
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_with_a_wildcard_for_channel_fleet_or_client_gets_no_lease() {
    let fleet = Fleet::start(Setup::default()).await;
    let attacker = attacker::session(fleet.simulator.endpoint()).await;
    let other_fleet = below(&fleet, "cmd/guest").replace("lab", "*");
    let all = below(&fleet, "**").replace("xtb-1/", "");
    let rests = ["*/guest", "c$*/guest", "**/guest", "cmd/*", "cmd/g$*", "cmd/**", "**"];
    let exprs: Vec<String> = rests.iter().map(|rest| below(&fleet, rest)).chain([other_fleet, all]).collect();
    for (already, key_expr) in exprs.iter().enumerate() {
        let answers = attacker::ask(&attacker, key_expr, &acquire()).await;
        let replies: Vec<&String> =
            answers.iter().map(|(key, _)| key).filter(|key| key.contains("/cmd/")).collect();
        assert_eq!(replies, Vec::<&String>::new(), "an answer on {key_expr}");
        let counted = |state: &RobotState| malformed(state) > already as u64;
        let state = fleet.until(1, "it counted", counted).await;
        assert_eq!(state.lease, None, "{key_expr}");
    }
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_to_all_robots_is_answered_by_each_on_its_own_key() {
    let fleet = Fleet::start(Setup { robots: 2, ..Setup::default() }).await;
    let attacker = attacker::session(fleet.simulator.endpoint()).await;
    let me = name("me");
    let answers = eventually("both robots' leases", || async {
        let key_expr = fleet.any_robot().cmd(Some(&me));
        let mut answers = attacker::ask(&attacker, &key_expr, &acquire()).await;
        answers.sort();
        (answers.len() == 2).then_some(answers)
    })
    .await;
    let keys: Vec<&str> = answers.iter().map(|(key, _)| key.as_str()).collect();
    assert_eq!(keys, [fleet.robot(1).cmd(Some(&me)), fleet.robot(2).cmd(Some(&me))]);
    for (_, reply) in &answers {
        lease_of(reply);
    }
    let estop = Estop { id: Uuid::new_v4() };
    let stopped = attacker::ask(&attacker, &fleet.any_robot().estop(Some(&me)), &estop).await;
    assert_eq!(stopped.len(), 2);
    fleet.until(2, "the latch", |state| state.latches.iter().any(|latch| latch.by == "me")).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn setpoints_on_a_wildcard_key_do_not_drive() {
    let fleet = Fleet::start(Setup::default()).await;
    let attacker = attacker::session(fleet.simulator.endpoint()).await;
    let cmd = fleet.robot(1).cmd(Some(&name("guest")));
    let answers = attacker::ask(&attacker, &cmd, &acquire()).await;
    let lease = lease_of(&answers[0].1);
    let encoding = codec::encoding::<Setpoint>(Format::Postcard);
    for (n, rest) in ["t$*/guest", "*/guest", "**/guest", "tele$*op/guest"].iter().enumerate() {
        let seen = fleet.state(1).await;
        let setpoint = Setpoint {
            lease: Some(lease),
            seq: 1 + n as u64,
            echo_tick_ms: Some(seen.tick_ms),
            rpm: 20.0,
            steering: 0.0,
        };
        let bytes = codec::encode(&setpoint, Format::Postcard).unwrap();
        attacker::put(&attacker, &below(&fleet, rest), &encoding, bytes).await;
        // A key with ** also reaches the robot's other subscriptions: each of them counts it.
        let counted = |state: &RobotState| malformed(state) > malformed(&seen);
        let state = fleet.until(1, "it counted", counted).await;
        assert_eq!((state.mode, state.input_age_ms.setpoint), (Mode::Idle, None), "{rest}");
    }
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn only_an_emergency_stop_with_a_concrete_client_latches() {
    let fleet = Fleet::start(Setup::default()).await;
    let attacker = attacker::session(fleet.simulator.endpoint()).await;
    let keys = FleetKeys::new(name("lab"));
    let every = below(&fleet, "**").replace("lab/xtb-1/", "");
    let other_fleet = below(&fleet, "estop/guest").replace("lab", "*");
    let rests = ["estop/*", "e$*/guest", "*/guest", "estop/g$*", "estop/**"];
    let exprs = rests.iter().map(|rest| below(&fleet, rest)).chain([every, other_fleet]);
    let stop = || codec::encode(&Estop { id: Uuid::new_v4() }, Format::Postcard).unwrap();
    let encoding = codec::encoding::<Estop>(Format::Postcard);
    for key_expr in exprs.chain([keys.estop_all(None)]) {
        let before = malformed(&fleet.state(1).await);
        attacker::put(&attacker, &key_expr, &encoding, stop()).await;
        let state = fleet.until(1, "it counted", |state| malformed(state) > before).await;
        assert_eq!(state.latches, [], "{key_expr}");
    }
    // A stop by somebody, for this robot or all of them, is one, whatever its payload.
    let guest = name("guest");
    let ours = [
        (fleet.robot(1).estop(Some(&guest)), encoding.as_str(), stop()),
        (keys.estop_all(Some(&guest)), encoding.as_str(), stop()),
        (fleet.any_robot().estop(Some(&guest)), encoding.as_str(), stop()),
        (fleet.robot(1).estop(Some(&guest)), "text/plain", b"halt".to_vec()),
        (keys.estop_all(Some(&guest)), "", Vec::new()),
    ];
    for (key, encoding, bytes) in ours {
        attacker::put(&attacker, &key, encoding, bytes).await;
        let by_guest = |state: &RobotState| {
            let is = |latch: &xtb_protocol::messages::LatchState| {
                (latch.latch, latch.by.as_str()) == (Latch::Estop, "guest")
            };
            state.latches.iter().any(is)
        };
        let state = fleet.until(1, "the latch", by_guest).await;
        assert!(state.stopped_because.contains(&StopReason::Estop), "{key}: {:?}", state.stopped_because);
        let reset = fleet.ask(1, Body::Reset { latch: None }).await;
        assert!(matches!(reset, Outcome::Ok(_)), "{reset:?}");
    }
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_and_presence_on_other_keys_are_nobodys() {
    let fleet = Fleet::start(Setup::default()).await;
    let attacker = attacker::session(fleet.simulator.endpoint()).await;
    let _present = attacker.liveliness().declare_token("xtb/lab/**").await.unwrap();
    let me = name("me");
    // Answers on the question's own key, which has a wildcard for the robot.
    let ghost = Estopped { robot: name("ghost"), latched: true };
    let ghost = codec::encode(&ghost, Format::Postcard).unwrap();
    let _answering =
        attacker::answer::<Estopped>(&attacker, "xtb/lab/*/estop/me", move |_| ghost.clone()).await;
    let channel = Channel::Estop(me.clone());
    let estop = Estop { id: Uuid::new_v4() };
    let key_expr = fleet.any_robot().estop(Some(&me));
    let within = std::time::Duration::from_secs(5);
    // Until what the attacker has declared is known to the router.
    for _ in 0..100 {
        let mut heard = Vec::new();
        let asked =
            fleet.bus.ask_each(&key_expr, &channel, &estop, within, |answer| heard.push(answer.key)).await;
        asked.unwrap();
        assert_eq!(heard, [fleet.robot(1).estop(Some(&me))]);
        if fleet.bus.foreign_keys() > 0 {
            break;
        }
    }
    assert_eq!(fleet.bus.foreign_keys(), 1, "the other one is counted");
    let alive = fleet.bus.alive(&fleet.any_robot().alive(), within).await.unwrap();
    assert_eq!(alive, [fleet.robot(1).alive()]);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_speaks_for_another_robot_is_not_believed() {
    let fleet = Fleet::start(Setup::default()).await;
    let state = fleet.state(1).await;
    let attacker = attacker::session(fleet.simulator.endpoint()).await;
    let said = codec::encode(&state, Format::Postcard).unwrap();
    let ghost = FleetKeys::new(name("lab")).robot(&name("ghost")).state();
    let _answering = attacker::answer::<RobotState>(&attacker, &ghost, move |_| said.clone()).await;
    let answers = eventually("both answers", || async {
        let key_expr = fleet.any_robot().state();
        let answers = fleet.bus.get(&key_expr, std::time::Duration::from_secs(5)).await;
        Some(answers.unwrap()).filter(|answers| answers.len() == 2)
    })
    .await;
    for answer in answers {
        let read = answer.decode::<RobotState>();
        assert_eq!(read.is_ok(), answer.key == fleet.robot(1).state(), "{}: {read:?}", answer.key);
    }
    fleet.end().await;
}
