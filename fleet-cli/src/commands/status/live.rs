//! `status --watch`: repainted on a terminal, a line for each change elsewhere.

use super::block;
use crate::commands::status::StatusArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::output::{Output, Tone};
use crate::terminal::Terminal;
use std::collections::{BTreeMap, BTreeSet};
use std::io::IsTerminal;
use std::pin::pin;
use std::time::Duration;
use tokio::time::Instant;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::fleet_view::{FleetView, RobotView};
use xtb_client::state_feed::StateFeed;
use xtb_client::text::reasons;
use xtb_client::text::robot as describe;
use xtb_protocol::Name;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{GoalStatus, Latch, Rejected, StopReason};

const REPAINT_EVERY: Duration = Duration::from_millis(200);

/// Shows robots until the operator leaves.
pub(super) async fn run(
    ctx: &Context,
    client: &Client,
    args: &StatusArgs,
    wanted: &BTreeSet<Name>,
) -> Result<Exit> {
    let feed = StateFeed::open(client, &client.keys().any_robot()).await?;
    let view = || FleetView::now(&feed, &ctx.settings.fleet, wanted).only(&args.robots);
    if ctx.out.json || !std::io::stdout().is_terminal() || !std::io::stdin().is_terminal() {
        return follow(ctx, view).await;
    }
    repaint(ctx, view).await
}

async fn repaint(ctx: &Context, view: impl Fn() -> FleetView) -> Result<Exit> {
    let mut terminal = Terminal::open()?;
    let mut stop = pin!(interrupted());
    let mut tick = tokio::time::interval(REPAINT_EVERY);
    loop {
        tokio::select! {
            () = &mut stop => return Ok(Exit::Done),
            () = terminal.left() => return Ok(Exit::Done),
            _ = tick.tick() => terminal.paint(&screen(ctx, &view()))?,
        }
    }
}

fn screen(ctx: &Context, view: &FleetView) -> Vec<String> {
    let title = format!("fleet {} · robots: {} · q quits", view.fleet, view.robots.len());
    let mut lines = vec![ctx.out.paint(Tone::Dim, &title)];
    if view.robots.is_empty() {
        lines.push(String::new());
        lines.push(ctx.out.paint(Tone::Warning, "no robot present"));
    }
    for robot in &view.robots {
        lines.push(String::new());
        lines.extend(block::lines(robot, &ctx.out));
    }
    lines
}

/// What has to differ for a robot to get a new line.
#[derive(Debug, Clone, PartialEq)]
struct Gist {
    alive: bool,
    known: Option<Known>,
}

#[derive(Debug, Clone, PartialEq)]
struct Known {
    epoch: u64,
    mode: String,
    stopped_because: Vec<StopReason>,
    latches: Vec<Latch>,
    goal: Option<(Uuid, GoalStatus)>,
    holder: Option<Name>,
    rejected: Rejected,
}

impl Gist {
    fn of(robot: &RobotView) -> Self {
        let known = robot.state.as_ref().filter(|_| robot.alive).map(|state| Known {
            epoch: state.epoch,
            mode: reasons::name(&state.mode),
            stopped_because: state.stopped_because.clone(),
            latches: state.latches.iter().map(|latch| latch.latch).collect(),
            goal: state.goal.as_ref().map(|goal| (goal.id, goal.status)),
            holder: state.lease.as_ref().map(|lease| lease.holder.clone()),
            rejected: state.rejected,
        });
        Self { alive: robot.alive, known }
    }
}

async fn follow(ctx: &Context, view: impl Fn() -> FleetView) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    // Not at once: the first states are on their way.
    let mut tick = tokio::time::interval_at(Instant::now() + REPAINT_EVERY, REPAINT_EVERY);
    let mut shown: BTreeMap<Name, Gist> = BTreeMap::new();
    loop {
        tokio::select! {
            () = &mut stop => return Ok(Exit::Done),
            _ = tick.tick() => {}
        }
        for robot in view().robots {
            let gist = Gist::of(&robot);
            if shown.get(&robot.name) != Some(&gist) {
                ctx.out.result(&robot, |robot| summary(robot, &ctx.out))?;
                shown.insert(robot.name, gist);
            }
        }
    }
}

fn summary(robot: &RobotView, out: &Output) -> String {
    let name = out.paint(Tone::Strong, robot.name.as_str());
    let Some(state) = robot.state.as_ref().filter(|_| robot.alive) else {
        return block::lines(robot, out).join(" ");
    };
    let mut text = format!("{name}  {} at {}", reasons::name(&state.mode), describe::pose(&state.pose));
    if let Some(goal) = &state.goal {
        text.push_str(&format!(" · goal {}", describe::goal(goal)));
    }
    if !state.stopped_because.is_empty() {
        text.push_str(&format!(" · stopped: {}", reasons::reasons(&state.stopped_because)));
    }
    text
}
