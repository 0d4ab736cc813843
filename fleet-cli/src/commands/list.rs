//! `list`: which robots are there, which are missing, and how they are.
//!
//! Where the table is wider than the terminal, latches and faults go to lines of their own below their robot's
//! row, and the columns become fewer and narrower in the order of `NARROWER`. Elsewhere, as in a pipe, nothing
//! is left out.

mod docks;

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone, terminal_columns};
use crate::table::{Narrowing, Table, TableCell};
use crate::text::task as task_text;
use crate::text::width::{shortened, text_width};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::time::Duration;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::DispatcherClient;
use xtb_client::fleet_view::{FleetView, RobotView};
use xtb_client::text::reasons;
use xtb_client::text::robot::{self as describe, UNKNOWN};
use xtb_protocol::Name;
use xtb_protocol::messages::{BatteryLevel, RobotHome, RobotState, Suspension};

/// Arguments of `list`.
#[derive(Debug, Clone, Args)]
pub struct ListArgs {
    /// Expected robots, separated by commas [default: the roster of the config or the simulator].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot)]
    pub expect: Vec<Name>,
}

const HEADINGS: [&str; 9] = ["name", "mode", "stopped", "pose", "speed", "battery", "control", "goal", "age"];

/// What makes the table narrower, the least needed first. Name, mode, stopped, battery and goal always stay.
const NARROWER: [Narrowing; 10] = [
    Narrowing::Drop("start"),
    Narrowing::Drop("tags"),
    Narrowing::Drop("alias"),
    Narrowing::Shorten("control", 10),
    Narrowing::Drop("age"),
    Narrowing::Drop("speed"),
    Narrowing::Shorten("goal", 24),
    Narrowing::Drop("control"),
    Narrowing::Drop("pose"),
    // Room for the longest status.
    Narrowing::Shorten("goal", 12),
];

/// The fleet, and what its dispatcher has suspended.
#[derive(Debug, Serialize, JsonSchema)]
struct Listed<'a> {
    #[serde(flatten)]
    view: &'a FleetView,
    /// Empty also if there is no dispatcher.
    suspended: Vec<Suspension>,
    /// Robots that are at a dock or parking place, or have to go to one; empty also if no dispatcher sends them.
    homes: Vec<RobotHome>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Listed<'_>>];

/// Asks once and prints a row for each robot. A robot that should be there and is not, or is there and does not
/// say how it is, makes it [`Exit::Unknown`].
///
/// # Errors
/// No router, or nobody is there and nobody is expected.
pub async fn run(ctx: &Context, args: &ListArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let dispatching = DispatcherClient::of(&client);
    let (roster, simulator, status, homes) = tokio::join!(
        client.roster_entries(&args.expect),
        client.sim_stats(),
        dispatching.status(),
        dispatching.homes()
    );
    let roster = roster?.unwrap_or_default();
    let expected = roster.iter().map(|entry| entry.name.clone()).collect();
    // The states last: they age while others are waited for.
    let (alive, states) = client.heard().await?;
    let view = FleetView::of(&ctx.settings.fleet, &alive, &states, &expected).with_roster(&roster);
    let view = view.with_aliases(&ctx.settings.aliases);
    let view = FleetView { simulator: simulator?, ..view };
    let nobody = !view.robots.iter().any(|robot| robot.alive);
    if nobody && let Some(error) = client.not_admitted().await {
        return Err(error);
    }
    if view.robots.is_empty() {
        return Err(client.nobody());
    }
    let suspended = status.map(|status| status.suspended).unwrap_or_default();
    let homes = homes.ok().flatten().map(|homes| homes.robots).unwrap_or_default();
    ctx.out.result(&Listed { view: &view, suspended, homes }, |Listed { view, suspended, homes }| {
        let more = task_text::suspended(suspended, None, &ctx.out);
        let lines = [table(view, terminal_columns(), &ctx.out)].into_iter().chain(docks::line(homes));
        lines.chain(more).collect::<Vec<_>>().join("\n")
    })?;
    if nobody && !ctx.out.json {
        ctx.out.failure(&client.nobody());
    }
    client.close().await;
    Ok(if view.is_known() { Exit::Done } else { Exit::Unknown })
}

/// Where a robot's latches and faults stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Problems {
    InRow,
    Below,
}

/// The whole table, or what of it fits into `most` columns of a terminal.
fn table(view: &FleetView, most: Option<usize>, out: &Output) -> String {
    let whole = rows(view, Problems::InRow);
    let text = match most {
        Some(most) if whole.width() > most => narrow(view, most, out),
        _ => whole.render(out).trim_end().to_owned(),
    };
    let slow = view.simulator.as_ref().filter(|stats| stats.is_slow()).map(describe::simulator);
    let slow = slow.map(|words| format!("\n{}", out.paint(Tone::Warning, &words))).unwrap_or_default();
    format!("{text}{slow}")
}

fn narrow(view: &FleetView, most: usize, out: &Output) -> String {
    let mut lines = rows(view, Problems::Below).lines_within(most, &NARROWER, out).into_iter();
    let mut shown: Vec<String> = lines.next().into_iter().collect();
    for (line, robot) in lines.zip(&view.robots) {
        shown.push(line);
        if let Some(state) = robot.state.as_ref().filter(|_| robot.alive) {
            let below = below(&latches_and_faults(state), most);
            shown.extend(below.iter().map(|line| out.paint(Tone::Bad, line)));
        }
    }
    shown.join("\n")
}

fn rows(view: &FleetView, problems: Problems) -> Table {
    // Only where the roster knows any.
    let tagged = view.robots.iter().any(|robot| !robot.tags.is_empty());
    let placed = view.robots.iter().any(|robot| robot.start_pose.is_some());
    let called = view.robots.iter().any(|robot| robot.alias.is_some());
    let extra = [("alias", called), ("tags", tagged), ("start", placed)];
    let headings = extra.iter().filter(|(_, shown)| *shown).map(|(heading, _)| *heading);
    let mut table = Table::new(&HEADINGS.into_iter().chain(headings).collect::<Vec<_>>());
    for robot in &view.robots {
        let mut cells = row(robot, problems);
        cells.resize(HEADINGS.len(), "".into());
        if called {
            cells.push(robot.alias.clone().unwrap_or_default().into());
        }
        if tagged {
            cells.push(robot.tags.join(" ").into());
        }
        if placed {
            cells.push(TableCell::new(
                robot.start_pose.as_ref().map_or_else(String::new, describe::map_pose),
                Tone::Dim,
            ));
        }
        table.row(cells);
    }
    table
}

fn row(robot: &RobotView, problems: Problems) -> Vec<TableCell> {
    let name = TableCell::new(robot.name.as_str(), Tone::Strong);
    let age = robot.age_ms.map_or_else(|| UNKNOWN.to_owned(), age);
    match &robot.state {
        _ if !robot.alive => vec![name, TableCell::new("missing", Tone::Bad)],
        None => {
            let mut cells = vec![name];
            cells.resize(HEADINGS.len() - 1, TableCell::new(UNKNOWN, Tone::Warning));
            cells.push(TableCell::new(age, Tone::Bad));
            cells
        }
        Some(state) => vec![
            name,
            reasons::name(&state.mode).into(),
            stands(state, problems),
            describe::pose(&state.pose).into(),
            describe::speed(state).into(),
            battery(state),
            describe::lease_with_age(state).into(),
            state.goal.as_ref().map_or_else(|| "none".to_owned(), describe::goal).into(),
            TableCell::new(age, Tone::Dim),
        ],
    }
}

fn age(ms: u64) -> String {
    describe::age(Duration::from_millis(ms))
}

/// Latches and faults with their ages, or else since when it stands.
fn stands(state: &RobotState, problems: Problems) -> TableCell {
    let all = latches_and_faults(state);
    let latched = !state.latches.is_empty();
    let stopped = match state.stopped_age_ms {
        Some(ms) => age(ms),
        None if state.stopped_because.is_empty() => "no".to_owned(),
        None => "yes".to_owned(),
    };
    match problems {
        _ if all.is_empty() => stopped.into(),
        Problems::Below => TableCell::new(if latched { "LATCHED" } else { "FAULT" }, Tone::Bad),
        Problems::InRow if latched => TableCell::new(all.join(", "), Tone::Bad),
        Problems::InRow => TableCell::new(format!("{stopped}, {}", all.join(", ")), Tone::Bad),
    }
}

/// `LATCHED estop 12.0 s`, `gyro_lost 3.0 s`, `FAULT gyro_silent 3.0 s`: the first of each kind says its kind.
fn latches_and_faults(state: &RobotState) -> Vec<String> {
    let latches = state.latches.iter().map(|set| format!("{} {}", set.latch, age(set.age_ms)));
    let faults = state.faults.iter().map(|set| format!("{} {}", set.fault, age(set.age_ms)));
    let kinds = std::iter::once("LATCHED ").chain(std::iter::repeat(""));
    let latches = kinds.zip(latches).map(|(kind, text)| format!("{kind}{text}"));
    let kinds = std::iter::once("FAULT ").chain(std::iter::repeat(""));
    latches.chain(kinds.zip(faults).map(|(kind, text)| format!("{kind}{text}"))).collect()
}

/// Indented, in as many lines of at most `most` columns as needed.
fn below(items: &[String], most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for item in items {
        // With room for a comma at the end.
        let fits = lines.last().is_some_and(|line| text_width(line) + text_width(item) + 3 <= most);
        match lines.last_mut() {
            Some(line) if fits => {
                line.push_str(", ");
                line.push_str(item);
            }
            last => {
                if let Some(line) = last {
                    line.push(',');
                }
                lines.push(format!("  {item}"));
            }
        }
    }
    lines.iter().map(|line| shortened(line, most)).collect()
}

fn battery(state: &RobotState) -> TableCell {
    let low = state.battery_level > BatteryLevel::Ok;
    TableCell::new(describe::battery(state), if low { Tone::Warning } else { Tone::Plain })
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake;
    use xtb_control::frames::MapPose;
    use xtb_protocol::Uuid;
    use xtb_protocol::messages::{Fault, FaultState, GoalStatus, Latch, LeaseState, SimStats};

    const OUT: Output = Output { json: false, colors: false };

    fn robot(name: &str, state: RobotState) -> RobotView {
        RobotView {
            name: fake::name(name),
            alias: None,
            alive: true,
            state: Some(state),
            age_ms: Some(30),
            tags: Vec::new(),
            start_pose: None,
        }
    }

    fn fleet(robots: Vec<RobotView>) -> FleetView {
        FleetView { fleet: fake::name("lab"), robots, simulator: None }
    }

    fn missing() -> RobotView {
        RobotView {
            alive: false,
            state: None,
            tags: vec!["arm".into(), "hall".into()],
            start_pose: Some(MapPose { x_m: 1.0, y_m: 2.0, yaw_rad: 0.0 }),
            ..robot("xtb-3", fake::state("xtb-3"))
        }
    }

    fn fault(fault: Fault) -> FaultState {
        FaultState { fault, age_ms: 3000, detail: Some("no such device".into()) }
    }

    /// One drives, one is latched with a fault, one is missing, one says nothing any more.
    fn mixed() -> FleetView {
        let drives = RobotState {
            mode: xtb_control::Mode::Goto,
            lease: Some(LeaseState { holder: fake::name("cli-2"), age_ms: 40 }),
            goal: Some(fake::goal(Uuid::nil(), GoalStatus::Running)),
            ..fake::state("xtb-1")
        };
        let latched = RobotState {
            latches: vec![fake::latch(Latch::Estop, "me", false)],
            faults: vec![fault(Fault::GyroSilent)],
            battery_level: BatteryLevel::Warn,
            ..fake::state("xtb-2")
        };
        let stale = RobotView { state: None, age_ms: Some(9000), ..robot("xtb-4", fake::state("xtb-4")) };
        fleet(vec![robot("xtb-1", drives), robot("xtb-2", latched), missing(), stale])
    }

    #[test]
    fn latches_tags_and_start_poses_are_shown_where_there_are_any() {
        let latches = vec![fake::latch(Latch::Estop, "me", false)];
        let latched = robot("xtb-1", RobotState { latches, ..fake::state("xtb-1") });
        let stopped_age_ms = Some(2500);
        let standing = robot("xtb-2", RobotState { stopped_age_ms, ..fake::state("xtb-2") });
        let mut view = fleet(vec![latched, standing]);
        let text = table(&view, None, &OUT);
        assert!(text.contains("LATCHED estop 12.0 s") && text.contains("2.5 s"), "{text}");
        assert!(!text.contains("tags") && !text.contains("start"), "{text}");
        view.robots.push(missing());
        let text = table(&view, None, &OUT);
        assert!(text.lines().next().unwrap().ends_with("tags      start"), "{text}");
        assert!(text.contains("missing") && text.contains("arm hall  (1.00, 2.00) 0°"), "{text}");
        view.robots[1].alias = Some("Roter Käfer".into());
        let text = table(&view, None, &OUT);
        assert!(text.lines().next().unwrap().contains("alias        tags"), "{text}");
        assert!(text.lines().nth(2).unwrap().ends_with("Roter Käfer"), "{text}");
        for (factor, said) in [(Some(0.19), true), (Some(0.97), false), (None, false)] {
            view.simulator = Some(SimStats { t_s: 9.0, speed: 1.0, real_time_factor: factor, first: None });
            assert_eq!(
                table(&view, None, &OUT).ends_with("\nsimulator runs at 0.19 × real time"),
                said,
                "{factor:?}"
            );
        }
    }

    #[test]
    fn faults_are_shown_in_their_robots_row() {
        let faults = vec![fault(Fault::GyroSilent), fault(Fault::BatteryLow)];
        let driving = RobotState { faults: faults.clone(), ..fake::state("xtb-1") };
        let latches = vec![fake::latch(Latch::GyroLost, "gyro_silent", true)];
        let latched = RobotState { latches, faults, ..fake::state("xtb-2") };
        let text = table(&fleet(vec![robot("xtb-1", driving), robot("xtb-2", latched)]), None, &OUT);
        let rows: Vec<&str> = text.lines().skip(1).collect();
        assert!(rows[0].contains("no, FAULT gyro_silent 3.0 s, battery_low 3.0 s"), "{text}");
        let all = "LATCHED gyro_lost 12.0 s, FAULT gyro_silent 3.0 s, battery_low 3.0 s";
        assert!(rows[1].contains(all), "{text}");
    }

    #[test]
    fn a_wide_terminal_shows_the_same_as_a_pipe() {
        let view = mixed();
        assert_eq!(table(&view, Some(200), &OUT), table(&view, None, &OUT));
        assert!(table(&view, None, &OUT).lines().next().unwrap().contains("speed"));
    }

    #[test]
    fn a_narrow_terminal_shows_what_is_needed() {
        let view = mixed();
        for (most, headings) in [
            (80, ["name", "mode", "stopped", "pose", "battery", "goal"].as_slice()),
            (60, &["name", "mode", "stopped", "battery", "goal"]),
        ] {
            let text = table(&view, Some(most), &OUT);
            let lines: Vec<&str> = text.lines().collect();
            assert!(lines.iter().all(|line| text_width(line) <= most), "{text}");
            assert_eq!(lines[0].split_whitespace().collect::<Vec<_>>(), headings, "{text}");
            for (line, parts) in [
                (1, ["xtb-1", " goto ", " 7.4 V ", " running (1.00, 2.00)"].as_slice()),
                (2, &["xtb-2", " idle ", " LATCHED ", " 7.4 V, warn ", " none"]),
                (3, &["  LATCHED estop 12.0 s, FAULT gyro_silent 3.0 s"]),
                (4, &["xtb-3", " missing"]),
                (5, &["xtb-4", " unknown "]),
            ] {
                for part in parts {
                    assert!(lines[line].contains(part), "{part:?} is missing in line {line} of\n{text}");
                }
            }
        }
    }

    #[test]
    fn many_latches_and_faults_are_all_shown_and_no_width_is_too_small() {
        let latches = [Latch::BoardLost, Latch::BatteryCritical].map(|latch| fake::latch(latch, "me", true));
        let faults = [Fault::InfraredOutOfRange, Fault::BatteryCritical, Fault::EncoderOutOfRange];
        let mut state = RobotState {
            latches: latches.into(),
            faults: faults.map(fault).into(),
            battery_level: BatteryLevel::Critical,
            goal: Some(fake::goal(Uuid::nil(), GoalStatus::Interrupted)),
            stopped_age_ms: Some(125_000),
            ..fake::state("xtb-10")
        };
        let worst = robot("xtb-10", state.clone());
        (state.latches, state.faults) = (Vec::new(), Vec::new());
        let view = fleet(vec![worst, robot("xtb-11", state), missing()]);
        let text = table(&view, Some(60), &OUT);
        for part in [
            "LATCHED board_lost 12.0 s",
            "battery_critical 12.0 s",
            "FAULT infrared_out_of_range 3.0 s",
            "battery_critical 3.0 s",
            "encoder_out_of_range 3.0 s",
            " 2 min 05 s ",
            " 7.4 V, critical ",
            " interrupted",
        ] {
            assert!(text.contains(part), "{part:?} is missing in\n{text}");
        }
        for most in 1..=200 {
            let text = table(&view, Some(most), &OUT);
            assert!(text.lines().all(|line| text_width(line) <= most), "{most}\n{text}");
        }
    }
}
