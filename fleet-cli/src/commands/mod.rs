//! One verb a file.

pub mod change;
pub mod completions;
pub mod dashboard;
pub mod demo;
pub mod dispatch;
pub mod doctor;
pub mod estop;
pub mod export;
pub mod fetch_log;
mod goal;
pub mod goto;
pub mod list;
pub mod map;
pub mod names;
pub mod plan;
pub mod play;
pub mod record;
pub mod reset;
pub mod router;
pub mod set_pose;
pub mod sim;
pub mod status;
pub mod stop;
mod stopped;
pub mod task;
pub mod tasks;
pub mod teleop;
pub mod top;
pub mod traffic;
mod unknown_robots;
pub mod wander;
pub mod watch;
pub mod why;

use crate::context::Context;
use xtb_client::Result;
use crate::output::Progress;
use xtb_client::DispatcherClient;
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_protocol::Name;

/// The robots in the order in which they were named, each once.
fn once_each(named: &[Name]) -> Vec<Name> {
    let mut robots: Vec<Name> = Vec::new();
    for robot in named {
        if !robots.contains(robot) {
            robots.push(robot.clone());
        }
    }
    robots
}

/// Acquires control, and says from whom it was taken.
async fn take_control(ctx: &Context, client: &Client, robot: &Name, take: bool) -> Result<Control> {
    let control = Control::acquire(client, robot, take).await?;
    if let Some(holder) = control.taken_from().filter(|_| !ctx.out.json) {
        ctx.out.note(&format!("took control of {robot} from {holder}"));
    }
    Ok(control)
}

/// The fleet's dispatcher; who has to wait for it is told.
fn dispatcher(client: &Client) -> DispatcherClient<'_> {
    DispatcherClient::of(client).saying(|what| {
        let mut progress = Progress::new();
        progress.show(what);
        Box::new(progress)
    })
}
