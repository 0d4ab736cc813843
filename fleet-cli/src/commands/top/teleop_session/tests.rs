//! The wheel of a robot that the test plays.

use super::*;
use xtb_client::fake::{FakeRobot, name};
use xtb_protocol::messages::{Body, Setpoint};

const AHEAD: StickPosition = StickPosition { throttle: 1.0, steering: 0.0 };

async fn setpoints(
    client: &Client,
    robot: &Name,
) -> (xtb_bus::Subscription, mpsc::UnboundedReceiver<Setpoint>) {
    let (sender, setpoints) = mpsc::unbounded_channel();
    let each = move |incoming: xtb_bus::Incoming| {
        sender.send(incoming.decode::<Setpoint>().unwrap()).unwrap_or_default();
    };
    let teleop = client.keys().robot(robot).teleop(None);
    (client.bus().subscribe(&teleop, each).await.unwrap(), setpoints)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_order_is_sent_once_and_letting_go_ends_in_zero_stop_and_release() {
    let client = Client::alone(Duration::from_secs(30)).await;
    let robot = FakeRobot::start(&client, "xtb-1").await;
    let (_watch, mut sent) = setpoints(&client, &name("xtb-1")).await;
    let mut hand = Some(Hand::take(client.clone(), name("xtb-1"), false));
    assert_eq!(news(&mut hand).await, TeleopStatus::Held { max_rpm: 30.0 });
    let mut orders = 0;
    // The first ones may come before the robot was heard: then nothing is sent.
    let first = loop {
        hand.as_ref().unwrap().drive(AHEAD);
        orders += 1;
        if let Ok(Some(setpoint)) = tokio::time::timeout(Duration::from_millis(50), sent.recv()).await {
            break setpoint;
        }
    };
    assert_eq!((first.seq, first.rpm), (1, 30.0));
    hand.as_mut().unwrap().let_go();
    assert_eq!(news(&mut hand).await, TeleopStatus::Ended(Some(true)));
    assert!(hand.is_none());
    let mut rest = Vec::new();
    while let Ok(setpoint) = sent.try_recv() {
        rest.push(setpoint.rpm);
    }
    assert!(rest.len() <= orders && rest.last() == Some(&0.0), "{rest:?} after {orders} orders");
    let fake = robot.lock();
    assert!(fake.asked.iter().any(|(_, body)| matches!(body, Body::Stop {})) && fake.lease.is_none());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_only_held_the_wheel_stops_nobody() {
    let client = Client::alone(Duration::from_secs(30)).await;
    let robot = FakeRobot::start(&client, "xtb-1").await;
    let mut hand = Some(Hand::take(client.clone(), name("xtb-1"), false));
    // Before it is even held.
    hand.as_mut().unwrap().let_go();
    let mut last = news(&mut hand).await;
    if last == (TeleopStatus::Held { max_rpm: 30.0 }) {
        last = news(&mut hand).await;
    }
    assert_eq!(last, TeleopStatus::Ended(None));
    let fake = robot.lock();
    assert!(!fake.asked.iter().any(|(_, body)| matches!(body, Body::Stop {})) && fake.lease.is_none());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_wheel_in_other_hands_is_refused_and_one_that_is_taken_away_is_lost() {
    let client = Client::alone(Duration::from_secs(30)).await;
    let robot = FakeRobot::start(&client, "xtb-1").await;
    robot.lock().grant(&name("alice"));
    let mut hand = Some(Hand::take(client.clone(), name("xtb-1"), false));
    let refused = news(&mut hand).await;
    assert!(
        matches!(&refused, TeleopStatus::Refused { held: true, text } if text.contains("alice")),
        "{refused:?}"
    );
    let mut hand = Some(Hand::take(client.clone(), name("xtb-1"), true));
    assert!(matches!(news(&mut hand).await, TeleopStatus::Held { .. }));
    robot.lock().grant(&name("bob"));
    let lost = news(&mut hand).await;
    assert!(
        matches!(&lost, TeleopStatus::Lost(text) if text.contains("bob") || text.contains("lost")),
        "{lost:?}"
    );
}
