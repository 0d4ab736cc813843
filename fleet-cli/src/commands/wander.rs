//! `wander`: let robots wander.

use super::goal::{self, Task};
use crate::args::{LeaseArgs, LinkLossArg};
use crate::context::Context;
use crate::exit::Exit;
use crate::robots::{self, RobotsWord};
use crate::values::seconds;
use clap::Args;
use std::time::Duration;
use xtb_client::Result;
use xtb_client::goal::GoalTarget;

/// Arguments of `wander`.
#[derive(Debug, Clone, Args)]
pub struct WanderArgs {
    /// Robots; @TAG means all of the roster that have the tag.
    #[arg(value_name = "ROBOT", required = true, value_parser = RobotsWord::parse)]
    pub robots: Vec<RobotsWord>,
    /// Duration [default: until stopped, or 300 s without --wait].
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Option<Duration>,
    /// Wait and show progress until it ends; Ctrl-C cancels it.
    #[arg(long)]
    pub wait: bool,
    /// What the robot does after 0.5 s without a message from this program: halt, or finish [default: halt
    /// with --wait, else finish].
    #[arg(long, value_enum, value_name = "POLICY")]
    pub on_link_loss: Option<LinkLossArg>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// Starts it; with `--wait` stays until it has ended.
///
/// # Errors
/// No router, or, of one robot, no answer or a refusal; of several each one's is said beside its name.
pub async fn run(ctx: &Context, args: WanderArgs) -> Result<Exit> {
    let WanderArgs { robots, lasting, wait, on_link_loss, lease } = args;
    let (target, on_link_loss) = (GoalTarget::Wander { lasting }, on_link_loss.map(Into::into));
    let task = |robot| Task { robot, target, within: None, wait, on_link_loss, take: lease.take };
    goal::run(ctx, async |client| {
        let robots = robots::meant(client, &robots).await.all()?;
        Ok(robots.into_iter().map(task).collect())
    })
    .await
}
