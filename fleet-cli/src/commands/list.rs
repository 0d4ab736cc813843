//! `list`: which robots are there, which are missing, and how they are.

use crate::context::Context;
use crate::exit::Exit;
use crate::output::{Output, Tone};
use crate::table::{Cell, Table};
use crate::text::task as task_text;
use clap::Args;
use serde::Serialize;
use std::time::Duration;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::DispatcherClient;
use xtb_client::fleet_view::{FleetView, RobotView};
use xtb_client::text::reasons;
use xtb_client::text::robot::{self as describe, UNKNOWN};
use xtb_protocol::Name;
use xtb_protocol::messages::{BatteryLevel, RobotState, Suspension};

/// Arguments of `list`.
#[derive(Debug, Clone, Args)]
pub struct ListArgs {
    /// Expected robots, separated by commas [default: the roster of the config or the simulator].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot)]
    pub expect: Vec<Name>,
}

const HEADINGS: [&str; 9] = ["name", "mode", "stopped", "pose", "speed", "battery", "control", "goal", "age"];

/// The fleet, and what its dispatcher has suspended.
#[derive(Debug, Serialize)]
struct Listed<'a> {
    #[serde(flatten)]
    view: &'a FleetView,
    /// Empty also if there is no dispatcher.
    suspended: Vec<Suspension>,
}

/// Asks once and prints a row for each robot. A robot that should be there and is not, or is there and does not
/// say how it is, makes it [`Exit::Unknown`].
///
/// # Errors
/// No router, or nobody is there and nobody is expected.
pub async fn run(ctx: &Context, args: &ListArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let dispatching = DispatcherClient::of(&client);
    let (roster, simulator, status) =
        tokio::join!(client.roster_entries(&args.expect), client.sim_stats(), dispatching.status());
    let roster = roster?.unwrap_or_default();
    let expected = roster.iter().map(|entry| entry.name.clone()).collect();
    // The states last: they age while others are waited for.
    let (alive, states) = client.heard().await?;
    let view = FleetView::of(&ctx.settings.fleet, &alive, &states, &expected).with_roster(&roster);
    let view = FleetView { simulator: simulator?, ..view };
    if view.robots.is_empty() {
        return Err(client.nobody());
    }
    let suspended = status.map(|status| status.suspended).unwrap_or_default();
    ctx.out.result(&Listed { view: &view, suspended }, |Listed { view, suspended }| {
        let more = task_text::suspended(suspended, None, &ctx.out);
        [table(view, &ctx.out)].into_iter().chain(more).collect::<Vec<_>>().join("\n")
    })?;
    if !view.robots.iter().any(|robot| robot.alive) && !ctx.out.json {
        ctx.out.failure(&client.nobody());
    }
    client.close().await;
    Ok(if view.is_known() { Exit::Done } else { Exit::Unknown })
}

fn table(view: &FleetView, out: &Output) -> String {
    // Only where the roster knows any.
    let tagged = view.robots.iter().any(|robot| !robot.tags.is_empty());
    let placed = view.robots.iter().any(|robot| robot.start_pose.is_some());
    let extra = [("tags", tagged), ("start", placed)];
    let headings = extra.iter().filter(|(_, shown)| *shown).map(|(heading, _)| *heading);
    let mut table = Table::new(&HEADINGS.into_iter().chain(headings).collect::<Vec<_>>());
    for robot in &view.robots {
        let mut cells = row(robot);
        cells.resize(HEADINGS.len(), "".into());
        if tagged {
            cells.push(robot.tags.join(" ").into());
        }
        if placed {
            cells.push(Cell::new(
                robot.start_pose.as_ref().map_or_else(String::new, describe::map_pose),
                Tone::Dim,
            ));
        }
        table.row(cells);
    }
    let slow = view.simulator.as_ref().filter(|stats| stats.is_slow()).map(describe::simulator);
    let slow = slow.map(|words| format!("\n{}", out.paint(Tone::Warning, &words))).unwrap_or_default();
    format!("{}{slow}", table.render(out).trim_end())
}

fn row(robot: &RobotView) -> Vec<Cell> {
    let name = Cell::new(robot.name.as_str(), Tone::Strong);
    let age = robot.age_ms.map_or_else(|| UNKNOWN.to_owned(), |ms| describe::age(Duration::from_millis(ms)));
    match &robot.state {
        _ if !robot.alive => vec![name, Cell::new("missing", Tone::Bad)],
        None => {
            let mut cells = vec![name];
            cells.resize(HEADINGS.len() - 1, Cell::new(UNKNOWN, Tone::Warning));
            cells.push(Cell::new(age, Tone::Bad));
            cells
        }
        Some(state) => vec![
            name,
            reasons::name(&state.mode).into(),
            stands(state),
            describe::pose(&state.pose).into(),
            describe::speed(state).into(),
            battery(state),
            describe::lease_with_age(state).into(),
            state.goal.as_ref().map_or_else(|| "none".to_owned(), describe::goal).into(),
            Cell::new(age, Tone::Dim),
        ],
    }
}

/// Latches with their ages, or else since when it stands.
fn stands(state: &RobotState) -> Cell {
    let since = |ms| describe::age(Duration::from_millis(ms));
    if !state.latches.is_empty() {
        let latches = state.latches.iter().map(|latch| format!("{} {}", latch.latch, since(latch.age_ms)));
        return Cell::new(format!("LATCHED {}", latches.collect::<Vec<_>>().join(", ")), Tone::Bad);
    }
    match state.stopped_age_ms {
        Some(ms) => since(ms).into(),
        None if state.stopped_because.is_empty() => "no".into(),
        None => "yes".into(),
    }
}

fn battery(state: &RobotState) -> Cell {
    let low = state.battery_level > BatteryLevel::Ok;
    Cell::new(describe::battery(state), if low { Tone::Warning } else { Tone::Plain })
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake;
    use xtb_control::frames::MapPose;
    use xtb_protocol::messages::{Latch, SimStats};

    #[test]
    fn latches_tags_and_start_poses_are_shown_where_there_are_any() {
        let robot = |name: &str, state| RobotView {
            name: fake::name(name),
            alive: true,
            state: Some(state),
            age_ms: Some(30),
            tags: Vec::new(),
            start_pose: None,
        };
        let latches = vec![fake::latch(Latch::Estop, "me", false)];
        let latched = robot("xtb-1", RobotState { latches, ..fake::state("xtb-1") });
        let stopped_age_ms = Some(2500);
        let standing = robot("xtb-2", RobotState { stopped_age_ms, ..fake::state("xtb-2") });
        let missing = RobotView {
            alive: false,
            state: None,
            tags: vec!["arm".into(), "hall".into()],
            start_pose: Some(MapPose { x_m: 1.0, y_m: 2.0, yaw_rad: 0.0 }),
            ..robot("xtb-3", fake::state("xtb-3"))
        };
        let out = Output { json: false, colors: false };
        let mut view =
            FleetView { fleet: fake::name("lab"), robots: vec![latched, standing], simulator: None };
        let text = table(&view, &out);
        assert!(text.contains("LATCHED estop 12.0 s") && text.contains("2.5 s"), "{text}");
        assert!(!text.contains("tags") && !text.contains("start"), "{text}");
        view.robots.push(missing);
        let text = table(&view, &out);
        assert!(text.lines().next().unwrap().ends_with("tags      start"), "{text}");
        assert!(text.contains("missing") && text.contains("arm hall  (1.00, 2.00) 0°"), "{text}");
        for (factor, said) in [(Some(0.19), true), (Some(0.97), false), (None, false)] {
            view.simulator = Some(SimStats { t_s: 9.0, speed: 1.0, real_time_factor: factor });
            assert_eq!(
                table(&view, &out).ends_with("\nsimulator runs at 0.19 × real time"),
                said,
                "{factor:?}"
            );
        }
    }
}
