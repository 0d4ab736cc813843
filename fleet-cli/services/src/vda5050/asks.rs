//! What a robot's session asks of the dispatcher, and of the robot.

use super::{Fact, Shared, count};
use std::sync::Arc;
use xtb_client::control::Control;
use xtb_client::{DispatcherClient, Error, ErrorKind, Result};
use xtb_protocol::messages::{Body, DispatchBody, DispatchCode, TaskId};
use xtb_protocol::{Name, Uuid};
use xtb_vda5050::{Answer, Ask};

/// An answer, and how the task stands if that was asked.
pub(super) type Answered = (Answer, Option<(TaskId, Fact)>);

pub(super) async fn ask(shared: Arc<Shared>, robot: Name, ask: Ask) -> Answered {
    count(&shared.counters.asked);
    let dispatcher = DispatcherClient::of(&shared.client);
    let one = |task: TaskId| vec![task];
    let done = match ask {
        Ask::Submit { id, spec } => {
            let taken = dispatcher.submit_as(id, vec![*spec]).await;
            return (
                taken.map_or_else(refused, |taken| {
                    taken.tasks.first().copied().map_or_else(nobody, Answer::Submitted)
                }),
                None,
            );
        }
        Ask::Show(task) => {
            return match show(dispatcher, task).await {
                Ok(fact) => (Answer::Done, Some((task, fact))),
                Err(error) => (refused(error), None),
            };
        }
        Ask::SetPose { x_m, y_m, yaw_rad } => {
            let set = set_pose(&shared, &robot, Body::SetPose { x_m, y_m, yaw_rad }).await;
            return (set.map_or_else(|error| Answer::Failed(error.message), |()| Answer::Done), None);
        }
        Ask::Extend { task, after, points } => dispatcher.extend(task, after, points).await,
        Ask::Cancel(task) => dispatcher.change_one(DispatchBody::Cancel { tasks: one(task) }).await,
        Ask::Pause(task) => dispatcher.change_one(DispatchBody::Pause { tasks: one(task) }).await,
        Ask::Resume(task) => dispatcher.change_one(DispatchBody::Resume { tasks: one(task) }).await,
    };
    (done.map_or_else(refused, |()| Answer::Done), None)
}

fn nobody() -> Answer {
    Answer::Unreachable("the dispatcher has taken nothing".to_owned())
}

/// A task of the ledger that the dispatcher has now.
async fn show(dispatcher: DispatcherClient<'_>, task: TaskId) -> Result<Fact> {
    let ledger = dispatcher.status().await?.dispatcher.ledger;
    let view = dispatcher.show(task).await?.task;
    Ok(Fact { ledger, entry: 0, state: view.state, legs_done: view.legs_done, reason: view.reason })
}

async fn set_pose(shared: &Shared, robot: &Name, body: Body) -> Result<()> {
    let control = Control::acquire(&shared.client, robot, false).await?;
    let set = control.request(Uuid::new_v4(), body).await;
    control.release().await;
    set.map(drop)
}

fn refused(error: Error) -> Answer {
    match error.kind {
        ErrorKind::NotDispatched(code) => Answer::Refused(code, error.message),
        ErrorKind::Invalid => Answer::Refused(DispatchCode::OutOfRange, error.message),
        _ => Answer::Unreachable(error.message),
    }
}
