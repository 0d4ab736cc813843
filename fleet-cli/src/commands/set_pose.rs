//! `set-pose`: tell robots that stand where they are. It never moves a robot.

use super::take_control;
use crate::args::LeaseArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::point::{PointArgs, PointWord};
use crate::robots::{self, RobotsWord};
use crate::values::{degrees, metres};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::time::Instant;
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_client::multi_robot::in_turn;
use xtb_client::reset::{STATE_EVERY, next_state};
use xtb_client::state_feed::StateFeed;
use xtb_client::text::robot as describe;
use xtb_client::{Error, ErrorKind, Result, map_source};
use xtb_control::frames::{MapPose, wrap_rad};
use xtb_protocol::messages::{Body, MapPlace, PoseState, RosterEntry, Waypoint};
use xtb_protocol::{Name, Uuid};

/// Arguments of `set-pose`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true)]
pub struct SetPoseArgs {
    /// Robot; it must be stopped. Several, with --start: commas between them, and @TAG for all robots of the roster
    /// that have the tag.
    #[arg(value_name = "ROBOT", value_parser = RobotsWord::parse)]
    pub robots: RobotsWord,
    /// Where it is: east, in m; or a place (`fleet-cli place list`).
    #[arg(value_name = "X|PLACE", value_parser = PointWord::parse, required_unless_present = "start")]
    pub point: Option<PointWord>,
    /// North, in m.
    #[arg(value_name = "Y", value_parser = metres)]
    pub y_m: Option<f64>,
    /// Each robot is at its start pose: the place of the fleet's map with the tag start-ROBOT, else the roster's
    /// start_pose.
    #[arg(long, conflicts_with_all = ["point", "yaw"])]
    pub start: bool,
    /// Yaw, in degrees counter-clockwise from east [default: the place's, else the current yaw].
    #[arg(long, value_name = "DEGREES", value_parser = degrees)]
    pub yaw: Option<f64>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// What came of it, as `--json` prints it.
#[derive(Debug, PartialEq, Serialize, JsonSchema)]
struct Report<'a> {
    robot: &'a Name,
    /// Where it believed itself to be; `None` = its state was not heard.
    before: Option<PoseState>,
    /// What it was told.
    pose: MapPose,
    /// What it says since; `None` = its state was not heard.
    after: Option<PoseState>,
    taken_from: Option<&'a str>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Report<'_>>];

/// Sets the pose.
///
/// # Errors
/// No router, no answer, or a refusal, as of a robot that is under way; without `--yaw` also a robot whose
/// state was not heard.
pub async fn run(ctx: &Context, args: &SetPoseArgs) -> Result<Exit> {
    let to = args.point.clone().map(|point| PointArgs { point, y_m: args.y_m });
    to.as_ref().map(PointArgs::written).transpose()?;
    let client = Client::open(&ctx.settings).await?;
    let robots = robots::meant(&client, std::slice::from_ref(&args.robots)).await.all()?;
    let exit = match (to, &robots[..]) {
        (Some(to), [robot]) => {
            let (at, _) = to.find(&client).await?;
            let yaw_rad = args.yaw.map(f64::to_radians).or(at.yaw_rad);
            one(ctx, &client, robot, Waypoint { yaw_rad, ..at }, args.lease.take).await
        }
        (Some(_), robots) => {
            let message = format!("{} robots cannot stand at one point", robots.len());
            Err(Error::new(ErrorKind::Invalid, message)
                .hint("--start sets each to its own start pose; else set one after the other"))
        }
        (None, robots) => at_start(ctx, &client, robots, args.lease.take).await,
    };
    client.close().await;
    exit
}

async fn one(ctx: &Context, client: &Client, robot: &Name, at: Waypoint, take: bool) -> Result<Exit> {
    let control = take_control(ctx, client, robot, take).await?;
    let outcome = set_pose(ctx, client, &control, robot, at).await;
    let taken_from = control.taken_from().map(str::to_owned);
    control.release().await;
    let report = Report { taken_from: taken_from.as_deref(), ..outcome? };
    ctx.out.result(&report, text)?;
    Ok(Exit::Done)
}

/// Each robot at its start pose; what comes of it is said of each, and the worst is the command's end.
async fn at_start(ctx: &Context, client: &Client, robots: &[Name], take: bool) -> Result<Exit> {
    let roster = client.roster_entries(&[]).await?.unwrap_or_default();
    let places = map_source::places(client.bus(), client.keys(), ctx.settings.timeout).await?;
    let places = places.unwrap_or_default(); // without a map the roster may say it
    let each = robots.iter().map(|robot| {
        let start = start_pose(&places, &roster, robot);
        async move {
            let set = match start {
                Some(at) => one(ctx, client, robot, at, take).await,
                None => {
                    let message = format!("neither map nor roster have a start pose of {robot}");
                    Err(Error::new(ErrorKind::Invalid, message).hint(format!(
                        "give a place of the map the tag start-{robot}, or write start_pose below its name in the \
                         fleet config; else give X and Y"
                    )))
                }
            };
            set.unwrap_or_else(|error| {
                ctx.out.failure_of(robot, &error);
                Exit::from(error.kind)
            })
        }
    });
    Ok(in_turn(each).await.into_iter().fold(Exit::Done, Exit::worse))
}

/// Where a robot starts: as the map says, else the roster.
fn start_pose(places: &[MapPlace], roster: &[RosterEntry], robot: &Name) -> Option<Waypoint> {
    if let Some(&MapPlace { x_m, y_m, yaw_rad, .. }) = places.iter().find(|place| place.is_start_of(robot)) {
        return Some(Waypoint { x_m, y_m, yaw_rad });
    }
    let MapPose { x_m, y_m, yaw_rad } = roster.iter().find(|entry| entry.name == *robot)?.start_pose?;
    Some(Waypoint { x_m, y_m, yaw_rad: Some(yaw_rad) })
}

async fn set_pose<'a>(
    ctx: &Context,
    client: &Client,
    control: &Control,
    robot: &'a Name,
    at: Waypoint,
) -> Result<Report<'a>> {
    let feed = StateFeed::open(client, &client.keys().robot(robot)).await?;
    let before = next_state(&feed, robot, Instant::now(), ctx.settings.timeout, |_| true).await;
    let before = before.map(|state| state.pose);
    let Some(yaw_rad) = at.yaw_rad.or(before.map(|pose| pose.yaw_rad)) else {
        let message = format!("no state from {robot}: its current yaw is unknown");
        return Err(Error::new(ErrorKind::NoRobot, message).hint("give it with --yaw DEGREES"));
    };
    let pose = MapPose { x_m: at.x_m, y_m: at.y_m, yaw_rad: wrap_rad(yaw_rad) };
    let MapPose { x_m, y_m, yaw_rad } = pose;
    control.request(Uuid::new_v4(), Body::SetPose { x_m, y_m, yaw_rad }).await?;
    let since = Instant::now() + STATE_EVERY;
    let after = next_state(&feed, robot, since, ctx.settings.timeout, |_| true).await;
    Ok(Report { robot, before, pose, after: after.map(|state| state.pose), taken_from: None })
}

fn text(report: &Report<'_>) -> String {
    let before = report.before.as_ref().map_or_else(|| "unknown".to_owned(), describe::pose);
    let told = describe::map_pose(&report.pose);
    let words = format!("{}: was at {before}, is now at {told}", report.robot);
    match report.after {
        Some(_) => words,
        None => format!("{words}; no state received since"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use xtb_client::fake::{FakeRobot, name};

    async fn set(yaw: Option<f64>) -> (Report<'static>, Body) {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        robot.lock().state.pose.yaw_rad = 1.5;
        let robot_name: &'static Name = Box::leak(Box::new(name("xtb-1")));
        let control = Control::acquire(&client, robot_name, false).await.unwrap();
        let at = Waypoint { x_m: 2.0, y_m: -3.0, yaw_rad: yaw.map(f64::to_radians) };
        let report = set_pose(&Context::of(&client), &client, &control, robot_name, at).await.unwrap();
        let asked = robot.lock().asked.last().unwrap().1.clone();
        (report, asked)
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn without_a_yaw_the_present_one_stays() {
        let (report, asked) = set(None).await;
        assert_eq!(asked, Body::SetPose { x_m: 2.0, y_m: -3.0, yaw_rad: 1.5 });
        assert_eq!(text(&report), "xtb-1: was at (0.00, 0.00) 86°, is now at (2.00, -3.00) 86°");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_yaw_is_given_in_degrees_and_sent_within_a_turn() {
        let (_, asked) = set(Some(270.0)).await;
        let Body::SetPose { yaw_rad, .. } = asked else { panic!("{asked:?}") };
        assert!((yaw_rad + std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{yaw_rad}");
    }
}
