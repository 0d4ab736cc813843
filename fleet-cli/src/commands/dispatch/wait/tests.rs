//! Waiting for tasks of a dispatcher that a test plays.

use super::*;
use std::future::pending;
use std::pin::pin;
use xtb_client::fake::{FakeDispatcher, FakeDispatcherState, task};
use xtb_protocol::messages::{DispatchCode, DispatchError, DispatchOutcome, TaskChange};

const ID: TaskId = TaskId::new(1);

async fn with(tasks: Vec<TaskView>) -> (Client, Context, FakeDispatcher) {
    let client = Client::alone(Duration::from_secs(30)).await;
    let ctx = Context::of(&client);
    let fake =
        FakeDispatcher::start(&client, FakeDispatcherState { tasks, ..FakeDispatcherState::default() }).await;
    (client, ctx, fake)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn it_stays_until_the_task_is_done() {
    let (client, ctx, fake) = with(vec![task(1, TaskState::Running)]).await;
    let ending = async {
        fake.until(|told| !told.asked.is_empty()).await;
        fake.told.lock().unwrap().tasks = vec![task(1, TaskState::Done)];
    };
    let stop = pin!(pending());
    let (exit, ()) = tokio::join!(run(&ctx, &client, &[ID], false, stop), ending);
    assert_eq!(exit, Ok(Exit::Done));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_of_several_that_has_failed_makes_it_fail() {
    let (client, ctx, _fake) = with(vec![task(1, TaskState::Done), task(2, TaskState::Cancelled)]).await;
    let ids = [ID, TaskId::new(2)];
    assert_eq!(run(&ctx, &client, &ids, false, pin!(pending())).await, Ok(Exit::Failed));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn ctrl_c_leaves_the_task_and_says_so() {
    let (client, ctx, fake) = with(vec![task(1, TaskState::Running)]).await;
    let stop = pin!(fake.until(|told| !told.asked.is_empty()));
    let failure = run(&ctx, &client, &[ID], false, stop).await.unwrap_err();
    assert_eq!(failure.message, "interrupted: the dispatcher continues with t1");
    assert!(failure.hint.contains("fleet-cli cancel t1"), "{}", failure.hint);
    assert_eq!(Exit::from(failure.kind), Exit::Interrupted);
    let cancels = |body: &DispatchBody| matches!(body, DispatchBody::Cancel { .. });
    assert!(!fake.told.lock().unwrap().asked.iter().any(|request| cancels(&request.body)));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn ctrl_c_cancels_if_that_was_wished_and_says_what_is_not_confirmed() {
    let change =
        |state, error| DispatchOutcome::Changed(vec![TaskChange { id: ID, state: Some(state), error }]);
    let late =
        DispatchError { code: DispatchCode::Unconfirmed, message: "not yet".into(), hint: String::new() };
    for (answer, code) in
        [(change(TaskState::Cancelled, None), 130), (change(TaskState::Cancelling, Some(late)), 3)]
    {
        let (client, ctx, fake) = with(vec![task(1, TaskState::Running)]).await;
        fake.told.lock().unwrap().answers.push_back(Some(answer));
        let stop = pin!(fake.until(|told| !told.asked.is_empty()));
        let exit =
            run(&ctx, &client, &[ID], true, stop).await.unwrap_or_else(|failure| Exit::from(failure.kind));
        assert_eq!(exit.code(), code);
    }
}
