//! One verb a file.

pub mod change;
pub mod completions;
mod confirm;
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
mod muster;
pub mod names;
pub mod plan;
pub mod play;
pub mod record;
pub mod reset;
pub mod router;
pub mod sim;
pub mod status;
pub mod stop;
pub mod task;
pub mod tasks;
pub mod teleop;
pub mod top;
pub mod traffic;
pub mod wander;
pub mod watch;
pub mod why;

use crate::client::Client;
use crate::context::Context;
use crate::error::Result;
use crate::lease::Control;
use xtb_protocol::Name;

/// Acquires control, and says from whom it was taken.
async fn take_control(ctx: &Context, client: &Client, robot: &Name, take: bool) -> Result<Control> {
    let control = Control::acquire(client, robot, take).await?;
    if let Some(holder) = control.taken_from().filter(|_| !ctx.out.json) {
        ctx.out.note(&format!("took control of {robot} from {holder}"));
    }
    Ok(control)
}
