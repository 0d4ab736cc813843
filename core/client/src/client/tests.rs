//! Requests that are turned away and states that come late, against robots that a test plays.

use super::requests::Answer;
use super::*;
use std::sync::atomic::AtomicU32;
use tokio::sync::mpsc;
use xtb_bus::{Question, Service};
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Body, RejectCode, Request};

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn overloaded(id: Uuid) -> Reply {
    Reply::refused(id, RejectCode::Overloaded, "no room", "ask again")
}

/// A robot that turns its first requests away, in a session of its own with this client.
struct Busy {
    client: Client,
    ids: Arc<Mutex<Vec<Uuid>>>,
    _service: Service,
}

async fn busy(robot: &Name, turns_away: u32, timeout: Duration) -> Busy {
    let client = Client::alone(timeout).await;
    let keys = client.keys().robot(robot);
    let (sender, mut questions) = mpsc::unbounded_channel::<Question>();
    let each = move |question| sender.send(question).unwrap_or_default();
    let service = client.bus().serve(&keys.cmd(None), each).await.unwrap();
    let ids = Arc::new(Mutex::new(Vec::new()));
    let (seen, left, own_key) = (Arc::clone(&ids), AtomicU32::new(turns_away), keys.cmd(Some(client.name())));
    tokio::spawn(async move {
        while let Some(question) = questions.recv().await {
            let (request, format) = question.decode::<Request>().unwrap();
            seen.lock().unwrap().push(request.id);
            let away = left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1)).is_ok();
            let reply = if away { overloaded(request.id) } else { Reply::done(request.id, Done::default()) };
            question.reply(&own_key, &reply, format).await.unwrap();
        }
    });
    Busy { client, ids, _service: service }
}

#[test]
fn only_an_overloaded_robot_is_asked_again() {
    let id = Uuid::from_u128(1);
    assert_eq!(Answer::of(vec![overloaded(id)]), Answer::TurnedAway);
    let refused = Reply::refused(id, RejectCode::Busy, "", "");
    assert_eq!(Answer::of(vec![refused.clone()]), Answer::Settled(vec![refused]));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stop_that_is_turned_away_is_asked_again_with_its_id_until_it_is_taken() {
    let robot = name("xtb-1");
    let busy = busy(&robot, 2, Duration::from_secs(30)).await;
    busy.client.request(&robot, Body::Stop {}).await.unwrap();
    let ids = busy.ids.lock().unwrap().clone();
    assert_eq!(ids.len(), 3);
    assert!(ids.iter().all(|id| *id == ids[0]), "{ids:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_that_stays_overloaded_is_said_to_be() {
    let robot = name("xtb-1");
    let busy = busy(&robot, u32::MAX, Duration::from_millis(400)).await;
    let failure = busy.client.request(&robot, Body::Stop {}).await.unwrap_err();
    assert_eq!(failure.kind, ErrorKind::OutcomeUnknown);
    assert!(failure.message.contains("overloaded"), "{failure}");
    assert!(busy.ids.lock().unwrap().len() > 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_state_ages_from_its_own_arrival_while_another_robot_is_waited_for() {
    let client = Client::alone(Duration::from_secs(1)).await;
    let _prompt = crate::fake::FakeRobot::start(&client, "xtb-1").await;
    let unanswered = Mutex::new(Vec::<Question>::new());
    let each = move |question| unanswered.lock().unwrap().push(question);
    let silent = client.keys().robot(&name("xtb-2")).state();
    let _silent = client.bus().serve(&silent, each).await.unwrap();
    let began = Instant::now();
    let (_, states) = client.heard().await.unwrap();
    let (took, age) = (began.elapsed(), states[&name("xtb-1")].age());
    assert!(took >= Duration::from_secs(1), "{took:?}: the silent one is waited for");
    assert!(age > took / 2, "{age:?} of {took:?}");
}
