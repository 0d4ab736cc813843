//! `goto`: send robots to a point of the map, or each to a point of its own around it.

use super::goal::{self, Task};
use crate::args::{LeaseArgs, LinkLossArg};
use crate::context::Context;
use crate::exit::Exit;
use crate::point::PointArgs;
use crate::robots::{self, RobotsWord};
use crate::spread;
use crate::values::{apart, degrees, seconds};
use clap::Args;
use std::time::Duration;
use xtb_client::goal::GoalTarget;
use xtb_client::{Client, Error, ErrorKind, Result, map_source};
use xtb_nav::{Clearance, Map};
use xtb_protocol::Name;
use xtb_protocol::messages::Waypoint;

/// Arguments of `goto`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true)]
pub struct GotoArgs {
    /// Robot; several with commas between them, and @TAG for all robots of the roster that have the tag.
    #[arg(value_name = "ROBOT", value_parser = RobotsWord::parse)]
    pub robots: RobotsWord,
    /// Where to.
    #[command(flatten)]
    pub to: PointArgs,
    /// Give each robot a point of its own around the target, this far apart, in m [default: 1]. In a place with an
    /// area several robots get that without being asked for.
    #[arg(long, value_name = "METRES", num_args = 0..=1, require_equals = true, default_missing_value = "1",
        value_parser = apart)]
    pub spread: Option<f64>,
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

/// Sends the goals; with `--wait` stays until they have ended.
///
/// # Errors
/// No router, several robots for one point, or, of one robot, no answer or a refusal; of several each one's is said
/// beside its name.
pub async fn run(ctx: &Context, args: GotoArgs) -> Result<Exit> {
    args.to.written()?;
    goal::run(ctx, async |client| tasks(client, &args).await).await
}

async fn tasks(client: &Client, args: &GotoArgs) -> Result<Vec<Task>> {
    let robots = robots::meant(client, std::slice::from_ref(&args.robots)).await.all()?;
    let points = points(client, &robots, args).await?;
    let task = |(robot, Waypoint { x_m, y_m, yaw_rad }): (Name, Waypoint)| {
        // A place's own yaw is for planned paths; straight to it there is none.
        let own = yaw_rad.filter(|_| args.via != Some(ViaArg::Direct));
        let yaw_rad = args.yaw.map(f64::to_radians).or(own);
        let target = GoalTarget::Point { x_m, y_m, yaw_rad, via: args.via.map(Into::into) };
        let on_link_loss = args.on_link_loss.map(Into::into);
        Task { robot, target, within: args.within, wait: args.wait, on_link_loss, take: args.lease.take }
    };
    Ok(robots.into_iter().zip(points).map(task).collect())
}

/// Where each of the robots goes.
async fn points(client: &Client, robots: &[Name], args: &GotoArgs) -> Result<Vec<Waypoint>> {
    let (at, place) = args.to.find(client).await?;
    let area = place.as_ref().map_or(&[][..], |place| place.points.as_slice());
    if robots.len() == 1 && args.spread.is_none() {
        return Ok(vec![at]);
    }
    if args.spread.is_none() && area.is_empty() {
        let message = format!("{} robots cannot stand at one point", robots.len());
        return Err(Error::new(ErrorKind::Invalid, message).hint(
            "--spread gives each its own point around it; so does a place with an area (`fleet-cli place list`)",
        ));
    }
    let maps = map_source::served(client.bus(), client.keys(), client.settings().timeout).await?;
    let map = maps.iter().find_map(|map| Map::try_from(map).ok());
    let clearance = map.map(|map| Clearance::of(&map.grid_with_keep_outs()));
    let apart_m = args.spread.unwrap_or(spread::APART_M);
    let states = client.states(&client.keys().any_robot()).await?;
    let here = |robot: &Name| states.get(robot).map(|seen| [seen.state.pose.x_m, seen.state.pose.y_m]);
    let others: Vec<[f64; 2]> =
        states.keys().filter(|name| !robots.contains(name)).filter_map(here).collect();
    let floor =
        spread::Floor { middle: [at.x_m, at.y_m], area, clearance: clearance.as_ref(), others: &others };
    let found = spread::points(floor, robots.len(), apart_m);
    if found.len() < robots.len() {
        let whose =
            place.as_ref().map_or("around the point".to_owned(), |place| format!("in {}", place.name));
        let message =
            format!("{whose} is room for {} of {} robots, {apart_m} m apart", found.len(), robots.len());
        return Err(Error::new(ErrorKind::Invalid, message)
            .hint("name fewer robots, or put them closer: --spread=0.8"));
    }
    let from: Vec<Option<[f64; 2]>> = robots.iter().map(here).collect();
    let point = |[x_m, y_m]: [f64; 2]| Waypoint { x_m, y_m, ..at };
    Ok(spread::assigned(&from, &found).into_iter().map(point).collect())
}
