//! Commands, carried out on robots that the test plays.

use super::*;
use crate::tui::top::Target;
use std::time::Duration;
use xtb_client::fake::{FakeRobot, latch, name};
use xtb_protocol::messages::{Body, GoalStatus, Latch};

async fn client() -> Client {
    Client::alone(Duration::from_secs(30)).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_goal_is_sent_as_the_verb_does_and_the_lease_given_back() {
    let client = client().await;
    let robot = FakeRobot::start(&client, "xtb-1").await;
    let command = Command::Goto { robot: name("xtb-1"), x_m: 1.0, y_m: 2.0, yaw_rad: Some(0.5), take: false };
    let outcome = execute(&Context::of(&client), &client, &[], &command).await;
    assert_eq!((outcome.tone, outcome.text.as_str(), outcome.held), (Tone::Good, "accepted", false));
    let fake = robot.lock();
    let sent = fake.asked.iter().find_map(|(_, body)| match body {
        Body::Goto { x_m, y_m, yaw_rad, .. } => Some((*x_m, *y_m, *yaw_rad)),
        _ => None,
    });
    assert_eq!((sent, &fake.lease), (Some((1.0, 2.0, Some(0.5))), &None));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_in_other_hands_is_taken_only_when_told_to() {
    let client = client().await;
    let robot = FakeRobot::start(&client, "xtb-1").await;
    robot.lock().grant(&name("alice"));
    robot.lock().state.goal = Some(xtb_client::fake::goal(Uuid::from_u128(1), GoalStatus::Running));
    let command = Command::Reset { robot: name("xtb-1"), take: false };
    let refused = execute(&Context::of(&client), &client, &[], &command).await;
    assert!(refused.held && refused.tone == Tone::Bad && refused.text.contains("alice"), "{refused:?}");
    let taken = execute(&Context::of(&client), &client, &[], &command.taking().unwrap()).await;
    assert!(!taken.held && taken.text.ends_with("control taken from alice"), "{taken:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_emergency_stop_of_all_names_who_has_not_answered() {
    let client = Client::alone(Duration::from_secs(1)).await;
    let _other = client.another().await; // a session without any link waits a minute for one
    let there = FakeRobot::start(&client, "xtb-1").await;
    let silent = FakeRobot::start(&client, "xtb-2").await;
    silent.lock().mute = true;
    let outcome = execute(&Context::of(&client), &client, &[], &Command::Estop(Target::All)).await;
    assert_eq!(outcome.tone, Tone::Bad);
    assert!(outcome.text.starts_with("1 of 2 latched; NO ANSWER, may be driving: xtb-2"), "{outcome:?}");
    assert_eq!(there.lock().state.latches[0].latch, Latch::Estop);
    let one = execute(&Context::of(&client), &client, &[], &Command::Estop(Target::One(name("xtb-1")))).await;
    assert_eq!((one.tone, one.text.as_str()), (Tone::Good, "latched"));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_reset_that_is_refused_says_what_is_still_latched() {
    let client = client().await;
    let robot = FakeRobot::start(&client, "xtb-1").await;
    robot.lock().state.latches = vec![latch(Latch::GyroLost, "gyro_silent", true)];
    let command = Command::Reset { robot: name("xtb-1"), take: false };
    let outcome = execute(&Context::of(&client), &client, &[], &command).await;
    assert!(outcome.tone == Tone::Bad && outcome.text.contains("still latched: gyro_lost"), "{outcome:?}");
}
