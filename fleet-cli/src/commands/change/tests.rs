//! How a change ends for the shell.

use super::*;
use xtb_protocol::messages::{DispatchCode, DispatchError, TaskId, TaskState};

fn change(state: TaskState, error: Option<DispatchCode>) -> TaskChange {
    let error = error.map(|code| DispatchError { code, message: "so".into(), hint: String::new() });
    TaskChange { id: TaskId::new(3), state: Some(state), error }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn only_what_robots_have_confirmed_is_done() {
    let ctx = Context::of(&Client::alone(std::time::Duration::from_secs(30)).await);
    let ended = change(TaskState::Cancelled, None);
    assert_eq!(report(&ctx, std::slice::from_ref(&ended)), Ok(Exit::Done));
    let late = change(TaskState::Cancelling, Some(DispatchCode::Unconfirmed));
    assert_eq!(report(&ctx, &[ended.clone(), late.clone()]), Ok(Exit::Unknown));
    let wrong = change(TaskState::Done, Some(DispatchCode::WrongState));
    assert_eq!(report(&ctx, &[ended, wrong.clone()]), Ok(Exit::Failed));
    assert_eq!(report(&ctx, &[wrong, late]), Ok(Exit::Unknown));
    assert_eq!(report(&ctx, &[]), Ok(Exit::Done));
}
