//! The same goal for several robots at once, each as if it were the only one.

use super::{Stop, Task, one};
use crate::context::Context;
use crate::exit::Exit;
use crate::output::ProgressLine;
use futures_util::future::join_all;
use xtb_client::Client;
use xtb_client::multi_robot::in_turn;

/// Each robot's result is said as soon as it is there; the worst one is the command's.
pub(super) async fn each(ctx: &Context, client: &Client, tasks: &[Task], stop: &Stop) -> Exit {
    let waits = tasks.iter().any(|task| task.wait);
    if waits && !ctx.out.json {
        ctx.out.note(&format!("waiting for {} robots; Ctrl-C cancels their goals", tasks.len()));
    }
    let each = tasks.iter().map(|task| async move {
        one(ctx, client, task, stop.clone(), ProgressLine::silent()).await.unwrap_or_else(|error| {
            ctx.out.failure_of(&task.robot, &error);
            Exit::from(error.kind)
        })
    });
    // Where it waits, all drive at the same time.
    let ended = if waits { join_all(each).await } else { in_turn(each).await };
    ended.into_iter().fold(Exit::Done, Exit::worse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures_util::FutureExt;
    use std::pin::Pin;
    use std::time::Duration;
    use xtb_client::fake::{FakeRobot, name};
    use xtb_client::goal::GoalTarget;
    use xtb_protocol::messages::Body;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn one_that_refuses_holds_up_no_other_and_makes_the_command_fail() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robots = [FakeRobot::start(&client, "xtb-1").await, FakeRobot::start(&client, "xtb-2").await];
        robots[0].lock().grant(&name("cli-123456"));
        let ctx = Context::of(&client);
        let to = |robot: &str, x_m: f64| Task {
            robot: name(robot),
            target: GoalTarget::Point { x_m, y_m: 0.0, yaw_rad: None, via: None },
            within: None,
            wait: false,
            on_link_loss: None,
            take: false,
        };
        let tasks = [to("xtb-1", 1.0), to("xtb-2", 2.0)];
        let never: Pin<Box<dyn Future<Output = ()>>> = Box::pin(std::future::pending());
        let never = never.shared();
        assert_eq!(each(&ctx, &client, &tasks, &never).await, Exit::Failed);
        let sent = |robot: &FakeRobot| {
            let fake = robot.lock();
            fake.asked.iter().filter(|(_, body)| matches!(body, Body::Goto { .. })).count()
        };
        assert_eq!((sent(&robots[0]), sent(&robots[1])), (0, 1));
        assert_eq!(each(&ctx, &client, &tasks[1..], &never).await, Exit::Done);
    }
}
