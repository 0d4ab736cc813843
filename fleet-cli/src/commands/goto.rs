//! `goto`: send a robot to a point of the map.

use super::goal::{self, Task};
use crate::args::{LeaseArgs, LinkLossArg};
use crate::context::Context;
use crate::exit::Exit;
use crate::point::PointArgs;
use crate::values::{degrees, seconds};
use clap::Args;
use std::time::Duration;
use xtb_client::Result;
use xtb_client::goal::GoalTarget;
use xtb_protocol::Name;
use xtb_protocol::messages::Waypoint;

/// Arguments of `goto`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true)]
pub struct GotoArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Where to.
    #[command(flatten)]
    pub to: PointArgs,
    /// Yaw on arrival, in degrees counter-clockwise from east; only along a planned path [default: the place's, else
    /// any].
    #[arg(long, value_name = "DEGREES", value_parser = degrees)]
    pub yaw: Option<f64>,
    /// Driving mode [default: planned if the robot has a map, else direct].
    #[arg(long, value_enum)]
    pub via: Option<ViaArg>,
    /// Wait and show progress until the goal ends; Ctrl-C cancels it.
    #[arg(long)]
    pub wait: bool,
    /// Time limit of the goal [default: 300 without --wait, none with it].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub within: Option<Duration>,
    /// What the robot does after 0.5 s without a message from this program: halt, or finish the goal
    /// [default: halt with --wait and without --within, else finish].
    #[arg(long, value_enum, value_name = "POLICY")]
    pub on_link_loss: Option<LinkLossArg>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// How a goal is driven to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ViaArg {
    /// Straight to the point (A-to-B of TM 2004-262); stops at obstacles.
    Direct,
    /// Along a planned path, around obstacles on the map and those that the range finders detect.
    Planned,
}

impl From<ViaArg> for xtb_protocol::messages::Via {
    fn from(via: ViaArg) -> Self {
        match via {
            ViaArg::Direct => Self::Direct,
            ViaArg::Planned => Self::Planned,
        }
    }
}

/// Sends the goal; with `--wait` stays until it has ended.
///
/// # Errors
/// No router, no answer, or a refusal.
pub async fn run(ctx: &Context, args: GotoArgs) -> Result<Exit> {
    let GotoArgs { robot, to, yaw, via, wait, within, on_link_loss, lease } = args;
    let Waypoint { x_m, y_m, yaw_rad } = to.resolve(ctx).await?;
    // A place's own yaw is for planned paths; straight to it there is none.
    let yaw_rad = yaw.map(f64::to_radians).or(yaw_rad.filter(|_| via != Some(ViaArg::Direct)));
    let target = GoalTarget::Point { x_m, y_m, yaw_rad, via: via.map(Into::into) };
    let on_link_loss = on_link_loss.map(Into::into);
    goal::run(ctx, &Task { robot, target, within, wait, on_link_loss, take: lease.take }).await
}
