//! What must not be believed changes nothing, is counted and can be seen.

use fleet_tests::{Fleet, Setup, eventually, name};
use std::time::Duration;
use xtb_control::Mode;
use xtb_protocol::Uuid;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{GoalStatus, Outcome, RejectCode, Reply, RobotState};
use xtb_protocol::wire::MAX_BYTES;

const OURS: &str = "application/x-postcard;xtb.Setpoint.v1";

async fn throw(fleet: &Fleet, encoding: &str, bytes: Vec<u8>) {
    let client = name("stranger");
    // Sent with the care of a request, so that Zenoh drops none and all can be counted.
    let channel = Channel::Cmd(client.clone());
    let key = fleet.robot(1).teleop(Some(&client));
    fleet.bus.put_raw(&key, &channel, encoding, bytes).await.unwrap();
}

/// Postcard of a setpoint with this speed.
fn setpoint(rpm: f64) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0];
    bytes.extend(rpm.to_le_bytes());
    bytes.extend(0.0_f64.to_le_bytes());
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_setpoints_move_nothing_and_are_counted_by_kind() {
    let fleet = Fleet::start(Setup::default()).await;
    throw(&fleet, OURS, vec![0xFF; 40]).await;
    throw(&fleet, "", setpoint(20.0)).await;
    throw(&fleet, "application/json", b"{\"rpm\":20".to_vec()).await;
    throw(&fleet, OURS, vec![0; MAX_BYTES + 1]).await;
    throw(&fleet, "application/x-postcard;xtb.Setpoint.v2", setpoint(20.0)).await;
    throw(&fleet, OURS, setpoint(f64::NAN)).await;
    throw(&fleet, OURS, setpoint(f64::INFINITY)).await;
    throw(&fleet, OURS, setpoint(1e9)).await;
    let counted = |state: &RobotState| {
        let r = &state.rejected;
        (r.malformed, r.oversized, r.wrong_version, r.out_of_range) == (3, 1, 1, 3)
    };
    let state = fleet.until(1, "all of them counted", counted).await;
    assert_eq!((state.mode, state.input_age_ms.setpoint), (Mode::Idle, None));
    assert!(fleet.truth(1).neutral_since_s.is_some());
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flood_of_garbage_does_not_keep_a_goal_from_being_reached() {
    let fleet = Fleet::start(Setup::default()).await;
    let goal = fleet.goto(1, 0.2, 1.5).await;
    eventually("the goal's end", || async {
        for _ in 0..20 {
            throw(&fleet, OURS, vec![0xAA; 500]).await;
        }
        let state = fleet.state(1).await;
        state.goal.filter(|now| now.id == goal && now.status == GoalStatus::Reached)
    })
    .await;
    fleet.until(1, "garbage counted", |state| state.rejected.malformed > 0).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_requests_are_refused_by_name_and_start_nothing() {
    let fleet = Fleet::start(Setup::default()).await;
    let key = fleet.robot(1).cmd(Some(&name("stranger")));
    let ours = "application/x-postcard;xtb.Request.v2";
    let json = "application/json";
    let goto = |x: &str| format!(r#"{{"id":"{}","body":{{"goto":{{"x_m":{x},"y_m":1}}}}}}"#, Uuid::nil());
    let cases: [(&str, Vec<u8>, RejectCode); 6] = [
        (ours, vec![0xFF; 30], RejectCode::Malformed),
        ("text/plain", b"go".to_vec(), RejectCode::Malformed),
        (json, goto("\"one\"").into_bytes(), RejectCode::Malformed),
        (json, goto("1000.1").into_bytes(), RejectCode::OutOfRange),
        ("application/x-postcard;xtb.Request.v7", Vec::new(), RejectCode::WrongVersion),
        (json, vec![b' '; MAX_BYTES + 1], RejectCode::Oversized),
    ];
    for (encoding, bytes, code) in cases {
        let answer = eventually("a refusal", || async {
            fleet.bus.ask_raw(&key, encoding, bytes.clone(), Duration::from_secs(5)).await.unwrap()
        })
        .await;
        let reply: Reply = answer.decode().unwrap();
        assert!(matches!(reply.result, Outcome::Error(error) if error.code == code), "{code:?}");
    }
    let state = fleet.until(1, "all counted", |state| state.rejected.malformed >= 3).await;
    assert_eq!((state.mode, state.goal), (Mode::Idle, None));
    fleet.end().await;
}
