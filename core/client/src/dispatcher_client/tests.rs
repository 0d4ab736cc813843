//! Questions to a dispatcher that a test plays.

use super::*;
use crate::fake::{FakeDispatcher, FakeDispatcherState, task};
use std::sync::Mutex;
use xtb_bus::Question;
use xtb_protocol::messages::TaskState;

fn patient(client: &Client, starts_within: Duration) -> DispatcherClient<'_> {
    DispatcherClient { client, starts_within, waiting: None }
}

fn error(code: DispatchCode) -> DispatchOutcome {
    DispatchOutcome::Error(DispatchError { code, message: "so it is".into(), hint: "do this".into() })
}

fn one() -> Vec<TaskSpec> {
    vec![task(1, TaskState::Queued).spec]
}

async fn client() -> Client {
    Client::alone(Duration::from_secs(30)).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_submission_is_asked_again_with_its_id_until_it_is_taken() {
    let client = client().await;
    let answers =
        [Some(error(DispatchCode::Overloaded)), Some(DispatchOutcome::Submitted(vec![TaskId::new(17)]))];
    let fake = FakeDispatcher::start(
        &client,
        FakeDispatcherState { answers: answers.into(), ..FakeDispatcherState::default() },
    )
    .await;
    let taken = patient(&client, Duration::from_secs(30)).submit(one()).await.unwrap();
    assert_eq!(taken.tasks, [TaskId::new(17)]);
    let asked = fake.told.lock().unwrap().asked.clone();
    assert_eq!(asked.len(), 2);
    assert_eq!(asked[0], asked[1]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dispatcher_that_is_just_starting_is_waited_for() {
    let client = client().await;
    let dispatching = patient(&client, Duration::from_secs(30));
    let answers = [Some(DispatchOutcome::Submitted(vec![TaskId::new(1)]))];
    let starting = async {
        // It asks at once, and nobody is there.
        assert!(!dispatching.is_there().await);
        FakeDispatcher::start(
            &client,
            FakeDispatcherState { answers: answers.into(), ..FakeDispatcherState::default() },
        )
        .await
    };
    let (taken, _fake) = tokio::join!(dispatching.submit(one()), starting);
    assert_eq!(taken.unwrap().tasks, [TaskId::new(1)]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_a_dispatcher_the_error_says_how_to_start_one() {
    let client = client().await;
    let failure = patient(&client, Duration::from_secs(1)).submit(one()).await.unwrap_err();
    assert_eq!(failure.kind, ErrorKind::NoDispatcher);
    assert_eq!(failure.message, "fleet lab has no dispatcher (waited 1 s): nothing was submitted");
    assert!(failure.hint.contains("fleet-cli dispatch serve"), "{}", failure.hint);
    assert_eq!(patient(&client, Duration::ZERO).list().await.unwrap_err().kind, ErrorKind::NoDispatcher);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dispatcher_that_is_there_and_silent_leaves_the_outcome_unknown() {
    let client = client().await;
    let _fake = FakeDispatcher::start(&client, FakeDispatcherState::default()).await;
    let failure = patient(&client, Duration::from_millis(1)).submit(one()).await.unwrap_err();
    assert_eq!(failure.kind, ErrorKind::OutcomeUnknown);
    assert!(failure.hint.contains("fleet-cli tasks"), "{}", failure.hint);
}

/// It took the question and is gone from the network before it answers.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_submission_that_somebody_took_and_nobody_answered_may_have_been_submitted() {
    let client = client().await;
    let unanswered = Mutex::new(Vec::<Question>::new());
    let each = move |question| unanswered.lock().unwrap().push(question);
    let _service = client.bus().serve(&client.keys().dispatch_cmd(None), each).await.unwrap();
    let dispatching = patient(&client, Duration::from_millis(1));
    assert!(!dispatching.is_there().await);
    let failure = dispatching.submit(one()).await.unwrap_err();
    assert_eq!(failure.kind, ErrorKind::OutcomeUnknown);
    assert!(failure.message.ends_with("outcome unknown"), "{failure}");
    assert!(failure.hint.contains("fleet-cli tasks"), "{}", failure.hint);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_submission_that_was_turned_away_once_and_then_not_answered_may_have_been_submitted() {
    let client = client().await;
    let told = FakeDispatcherState {
        answers: [Some(error(DispatchCode::Overloaded))].into(),
        ..FakeDispatcherState::default()
    };
    let fake = FakeDispatcher::start(&client, told).await;
    let failure = patient(&client, Duration::from_secs(1)).submit(one()).await.unwrap_err();
    assert_eq!(failure.kind, ErrorKind::OutcomeUnknown);
    assert!(fake.told.lock().unwrap().asked.len() >= 2);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_refusal_is_final_and_keeps_its_hint() {
    let client = client().await;
    let answers = [Some(error(DispatchCode::KeepOut))];
    let fake = FakeDispatcher::start(
        &client,
        FakeDispatcherState { answers: answers.into(), ..FakeDispatcherState::default() },
    )
    .await;
    let failure = patient(&client, Duration::from_secs(30)).submit(one()).await.unwrap_err();
    assert_eq!(failure.kind, ErrorKind::NotDispatched(DispatchCode::KeepOut));
    assert_eq!((failure.message.as_str(), failure.hint.as_str()), ("so it is", "do this"));
    assert_eq!(fake.told.lock().unwrap().asked.len(), 1);
}

/// A dispatcher of the version before: it refuses what it cannot read, in its own version.
async fn of_the_version_before(client: &Client) -> (xtb_bus::Service, Arc<Mutex<Vec<String>>>) {
    let asked = Arc::new(Mutex::new(Vec::new()));
    let (sender, mut questions) = tokio::sync::mpsc::unbounded_channel::<Question>();
    let each = move |question| sender.send(question).unwrap_or_default();
    let service = client.bus().serve(&client.keys().dispatch_cmd(None), each).await.unwrap();
    let (key, heard) = (client.keys().dispatch_cmd(Some(client.name())), Arc::clone(&asked));
    tokio::spawn(async move {
        while let Some(question) = questions.recv().await {
            let (request, format) = question.decode::<DispatchRequest>().unwrap();
            heard.lock().unwrap().push(codec::encoding::<DispatchRequest>(format));
            let (id, result) = match format {
                Format::Previous => (request.id, DispatchOutcome::Submitted(vec![TaskId::new(17)])),
                _ => (Uuid::nil(), error(DispatchCode::Malformed)),
            };
            let reply = DispatchReply { id, result, left_out: 0, suspended: Vec::new() };
            question.reply(&key, &reply, Format::Previous).await.unwrap();
        }
    });
    (service, asked)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dispatcher_of_the_version_before_is_asked_in_its_version_unless_that_has_no_words() {
    let client = client().await;
    let (_service, asked) = of_the_version_before(&client).await;
    let dispatching = patient(&client, Duration::from_secs(30));
    assert_eq!(dispatching.submit(one()).await.unwrap().tasks, [TaskId::new(17)]);
    let encodings = asked.lock().unwrap().split_off(0);
    assert_eq!(encodings, [Format::Postcard, Format::Previous].map(codec::encoding::<DispatchRequest>));
    let points = vec![Waypoint { x_m: 1.0, y_m: 0.0, yaw_rad: None }];
    let failure = dispatching.extend(TaskId::new(17), 1, points).await.unwrap_err();
    assert!(failure.message.contains("DispatchRequest version 2 cannot say this"), "{}", failure.message);
    assert!(failure.hint.contains("update"), "{}", failure.hint);
    assert_eq!(asked.lock().unwrap().len(), 1, "it is not asked again");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_list_of_many_pages_is_put_together() {
    let client = client().await;
    let tasks: Vec<_> = (1..=7).map(|number| task(number, TaskState::Queued)).collect();
    let told = FakeDispatcherState { tasks: tasks.clone(), page: Some(2), ..FakeDispatcherState::default() };
    let _fake = FakeDispatcher::start(&client, told).await;
    let list = patient(&client, Duration::ZERO).list().await.unwrap();
    assert_eq!((list.tasks, list.left_out), (tasks, 0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dispatcher_whose_pages_never_end_is_not_asked_for_ever() {
    let client = client().await;
    let tasks = vec![task(1, TaskState::Queued)];
    let told = FakeDispatcherState { tasks, page: Some(0), ..FakeDispatcherState::default() };
    let _fake = FakeDispatcher::start(&client, told).await;
    let failure = patient(&client, Duration::ZERO).list().await.unwrap_err();
    assert!(failure.message.contains("an empty page"), "{failure}");
}

#[test]
fn what_is_unconfirmed_weighs_more_than_what_was_refused() {
    let change = |n, code| TaskChange {
        id: TaskId::new(n),
        state: None,
        error: Some(DispatchError { code, message: String::new(), hint: String::new() }),
    };
    let changes = [change(1, DispatchCode::WrongState), change(2, DispatchCode::Unconfirmed)];
    assert_eq!(worst(&changes).unwrap().code, DispatchCode::Unconfirmed);
    assert_eq!(worst(&changes[..1]).unwrap().code, DispatchCode::WrongState);
    assert_eq!(worst(&[]), None);
}
