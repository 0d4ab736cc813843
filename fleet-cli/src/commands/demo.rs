//! `demo`: simulated trucks drive to goals by themselves, with a picture of it and a summary.
//!
//! Nothing is special about it: a simulator with its own router, and a client that sends goals as
//! `goto --wait` does.

use crate::commands::sim::embedded::EmbeddedDispatcher;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::output::Tone;
use crate::table::{Table, TableCell};
use crate::tui::picture::{Picture, PictureTrails};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::io::IsTerminal;
use std::sync::Arc;
use std::time::{Duration, Instant};
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_client::fleet_view::by_number;
use xtb_client::state_feed::StateFeed;
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, Roster};
use xtb_protocol::{Name, Uuid};
use xtb_services::dispatch::store::{Scratch, Store};
use xtb_services::router::check_listen;
use xtb_sim::fixes::FixTruth;
use xtb_simulator::{SimulationPlan, Simulator};

/// Arguments of `demo`.
#[derive(Debug, Clone, Args)]
pub struct DemoArgs {
    /// No live picture.
    #[arg(long)]
    pub headless: bool,
    /// Number of robots.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub robots: usize,
    /// Random seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Speed factor relative to real time.
    #[arg(long, value_name = "X", default_value_t = 4.0)]
    pub speed: f64,
    /// Goals per robot.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub goals: usize,
    /// Endpoint of its router; port 0 picks a free port.
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:0")]
    pub listen: String,
    /// Listen without identities also where other computers can reach it.
    #[arg(long)]
    pub insecure: bool,
}

/// A goal that takes longer than this much simulated time has failed.
const GOAL_WITHIN_S: f64 = 240.0;
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The result, as `--json` prints it.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
struct Summary {
    robots: usize,
    goals: usize,
    reached: usize,
    contacts: u64,
    wall_s: f64,
    simulated_s: f64,
}

/// What came of one goal.
#[derive(Debug, Clone)]
struct Leg {
    robot: Name,
    goal: (f64, f64),
    status: String,
    reached: bool,
    simulated_s: f64,
    error_m: Option<f64>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Summary>];

/// Runs the demonstration.
///
/// # Errors
/// The simulator does not start, or Zenoh would not.
pub async fn run(ctx: &Context, args: DemoArgs) -> Result<Exit> {
    let began = Instant::now();
    if args.goals == 0 {
        return Err(
            Error::new(ErrorKind::Invalid, "a demonstration needs goals").hint("--goals must be 1 or more")
        );
    }
    if let Some(warning) = check_listen(&args.listen, args.insecure)? {
        ctx.out.note(&format!("warning: {warning}"));
    }
    let plan = SimulationPlan {
        fixes: FixTruth { rate_hz: 2.0, ..FixTruth::default() },
        fleet: ctx.settings.fleet.clone(),
        robots: args.robots,
        first: 1,
        fleet_size: None,
        world: None,
        vehicles: Vec::new(),
        starts: Vec::new(),
        seed: args.seed,
        speed: args.speed,
        listen: args.listen.clone(),
        connect: Vec::new(),
        pki: None,
        identity: None,
        pty: None,
        board: None,
        truth_log: None,
        record: None,
        ros2: None,
    };
    let simulator = tokio::select! {
        started = Simulator::start(plan) => started?,
        () = interrupted() => return Ok(Exit::Interrupted),
    };
    let driven = accompanied(ctx, &args, &simulator).await;
    let truth = simulator.truth().latest();
    simulator.stop().await;
    let Some(legs) = driven? else { return Ok(Exit::Interrupted) };
    let summary = Summary {
        robots: args.robots,
        goals: legs.len(),
        reached: legs.iter().filter(|leg| leg.reached).count(),
        contacts: truth.robots.values().map(|robot| robot.contacts).sum(),
        wall_s: round(began.elapsed().as_secs_f64()),
        simulated_s: round(truth.t_s),
    };
    ctx.out.result(&summary, |summary| report(ctx, summary, &legs))?;
    let good = summary.reached == summary.goals && summary.contacts == 0;
    Ok(if good { Exit::Done } else { Exit::Failed })
}

/// The drives, with a dispatcher beside them that has a ledger of its own for as long.
async fn accompanied(ctx: &Context, args: &DemoArgs, simulator: &Simulator) -> Result<Option<Vec<Leg>>> {
    let scratch = Scratch::new();
    let dispatcher =
        EmbeddedDispatcher::start(ctx, simulator, Store::open(scratch.path(), &ctx.settings.fleet)?, None)
            .await?;
    let driven = drive(ctx, args, simulator).await;
    dispatcher.stop().await?;
    driven
}

/// Sends every robot to its goals. `None` = interrupted.
async fn drive(ctx: &Context, args: &DemoArgs, simulator: &Simulator) -> Result<Option<Vec<Leg>>> {
    let own = ctx.with(|settings| settings.connect = vec![simulator.endpoint().to_owned()]);
    let client = Client::open(&own.settings).await?;
    let feed = Arc::new(StateFeed::open(&client, &client.keys().any_robot()).await?);
    let mut scene = PictureTrails::default();
    let mut tours = tokio::task::JoinSet::new();
    for (index, (robot, start)) in starts(simulator.roster()).enumerate() {
        let goals = lane_goals(args, index, &start);
        scene.goals.insert(robot.clone(), goals.clone());
        let tour =
            Tour { client: client.clone(), feed: feed.clone(), truth: simulator.truth().clone(), robot };
        tours.spawn(tour.drive(goals));
    }
    let mut picture = match !args.headless && !ctx.out.json && std::io::stdout().is_terminal() {
        true => Some(Picture::open()?),
        false => None,
    };
    let mut legs = Vec::new();
    let mut tick = tokio::time::interval(LOOK_EVERY);
    let mut interrupt = std::pin::pin!(interrupted());
    loop {
        tokio::select! {
            finished = tours.join_next() => match finished {
                Some(Ok(tour)) => legs.extend(tour?),
                Some(Err(panic)) => return Err(Error::new(ErrorKind::Failed, panic.to_string())),
                None => break,
            },
            _ = tick.tick(), if picture.is_some() => {
                if let Some(picture) = &mut picture
                    && picture.draw(&mut scene, &simulator.truth().latest(), &feed.states())?
                {
                    return Ok(None);
                }
            }
            () = &mut interrupt => return Ok(None),
        }
    }
    drop(picture);
    client.close().await;
    legs.sort_by_cached_key(|leg| by_number(&leg.robot));
    Ok(Some(legs))
}

fn starts(roster: &Roster) -> impl Iterator<Item = (Name, MapPose)> {
    roster.robots.iter().map(|robot| (robot.name.clone(), robot.start_pose.unwrap_or_default()))
}

/// Goals in the robot's own lane ahead of its start, far and near in turn, a little to either side:
/// so that Table 4 has something to do and nobody crosses anybody's way.
fn lane_goals(args: &DemoArgs, index: usize, start: &MapPose) -> Vec<(f64, f64)> {
    let goal = |leg: usize| {
        let dice = mix(args.seed ^ ((index as u64) << 32) ^ leg as u64);
        let share = |shift: u32| f64::from((dice >> shift) as u16) / f64::from(u16::MAX);
        let aside_m = share(0) - 0.5;
        let ahead_m = if leg.is_multiple_of(2) { 2.2 + 0.6 * share(16) } else { 0.6 + 0.4 * share(16) };
        let (sin, cos) = start.yaw_rad.sin_cos();
        (start.x_m + ahead_m * cos - aside_m * sin, start.y_m + ahead_m * sin + aside_m * cos)
    };
    (0..args.goals).map(goal).map(|(x, y)| (round(x), round(y))).collect()
}

/// Spreads a seed over all bits (SplitMix64's finaliser).
fn mix(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

fn round(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

/// One robot's way from goal to goal.
struct Tour {
    client: Client,
    feed: Arc<StateFeed>,
    truth: xtb_simulator::TruthView,
    robot: Name,
}

impl Tour {
    async fn drive(self, goals: Vec<(f64, f64)>) -> Result<Vec<Leg>> {
        let control = Control::acquire(&self.client, &self.robot, false).await?;
        let mut legs = Vec::new();
        for goal in goals {
            legs.push(self.leg(&control, goal).await?);
        }
        control.release().await;
        Ok(legs)
    }

    async fn leg(&self, control: &Control, goal: (f64, f64)) -> Result<Leg> {
        let id = Uuid::new_v4();
        let began_s = self.truth.latest().t_s;
        let (x_m, y_m) = goal;
        let body = Body::Goto {
            x_m,
            y_m,
            yaw_rad: None,
            via: None,
            on_link_loss: LinkLoss::Halt,
            finish_s: GOAL_WITHIN_S,
        };
        control.request(id, body).await?;
        let status = self.outcome(id, began_s).await;
        let truth = self.truth.latest();
        let robot = truth.robots.get(&self.robot);
        Ok(Leg {
            robot: self.robot.clone(),
            goal,
            status: status
                .map_or_else(|| "timed out".to_owned(), |status| xtb_client::text::reasons::name(&status)),
            reached: status == Some(GoalStatus::Reached),
            simulated_s: truth.t_s - began_s,
            error_m: robot.map(|now| (now.x_m - x_m).hypot(now.y_m - y_m)),
        })
    }

    /// The goal's final status; `None` if it has none in time.
    async fn outcome(&self, id: Uuid, began_s: f64) -> Option<GoalStatus> {
        let mut look = tokio::time::interval(LOOK_EVERY);
        loop {
            look.tick().await;
            let goal = self.feed.last(&self.robot).and_then(|seen| seen.state.goal);
            if let Some(goal) = goal.filter(|goal| goal.id == id && goal.status.is_final()) {
                return Some(goal.status);
            }
            if self.truth.latest().t_s - began_s > GOAL_WITHIN_S {
                return None;
            }
        }
    }
}

fn report(ctx: &Context, summary: &Summary, legs: &[Leg]) -> String {
    let mut table = Table::new(&["robot", "goal", "result", "time", "true error"]);
    for leg in legs {
        let tone = if leg.reached { Tone::Good } else { Tone::Bad };
        table.row(vec![
            TableCell::new(leg.robot.as_str(), Tone::Strong),
            format!("({:.2}, {:.2})", leg.goal.0, leg.goal.1).into(),
            TableCell::new(leg.status.as_str(), tone),
            format!("{:.1} s", leg.simulated_s).into(),
            leg.error_m.map_or_else(|| "unknown".to_owned(), |m| format!("{m:.2} m")).into(),
        ]);
    }
    let Summary { robots, goals, reached, contacts, wall_s, simulated_s } = summary;
    format!(
        "{}\n{reached} of {goals} goals reached by {robots} robots, {contacts} contacts; \
         {simulated_s} s simulated in {wall_s} s",
        table.render(&ctx.out)
    )
}
