//! `report`: what each robot did on a day.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use crate::table::{Table, TableCell};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use xtb_client::client::Client;
use xtb_client::fleet_view::by_number;
use xtb_client::{DispatcherClient, Error, ErrorKind, Result};
use xtb_protocol::messages::{HistoryReply, HistoryRequest, RobotReport, StopCount};
use xtb_services::history::local_day;

const HELP: &str = "\
From the history that the dispatcher keeps while it runs. used is the part of the time in which the robot was heard \
that it had a task or a goal; times are by the robot's clock, simulated for simulated robots.

Examples:
  fleet-cli report
  fleet-cli report --day 2026-11-24 --csv";

/// Arguments of `report`.
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP)]
pub struct ReportArgs {
    /// Day of this computer's time zone, such as 2026-11-24, or yesterday [default: today].
    #[arg(long, value_name = "DAY")]
    pub day: Option<String>,
    /// As comma-separated values, with a heading.
    #[arg(long)]
    pub csv: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize, JsonSchema)]
struct Report {
    day: String,
    from_ms: u64,
    to_ms: u64,
    robots: Vec<Line>,
}

/// A robot's line.
#[derive(Debug, Serialize, JsonSchema)]
struct Line {
    #[serde(flatten)]
    report: RobotReport,
    /// 0 to 1; null: it was not heard.
    utilisation: Option<f64>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Report>];

/// Prints it.
///
/// # Errors
/// No day, no router, no dispatcher, or one without a history.
pub async fn run(ctx: &Context, args: &ReportArgs) -> Result<Exit> {
    if args.csv && ctx.out.json {
        return Err(
            Error::new(ErrorKind::Invalid, "--csv and --json exclude each other").hint("give one of them")
        );
    }
    let (day, from_ms, to_ms) = local_day(args.day.as_deref())?;
    let client = Client::open(&ctx.settings).await?;
    let asked = DispatcherClient::of(&client).history(&HistoryRequest::Report { from_ms, to_ms }).await;
    client.close().await;
    let HistoryReply::Report { mut robots } = asked? else {
        return Err(Error::new(ErrorKind::Failed, "not an answer to a question for a report"));
    };
    robots.sort_by_cached_key(|robot| by_number(&robot.robot));
    let robots = robots.into_iter().map(|report| {
        let used = report.active_s / report.heard_s;
        Line { utilisation: (report.heard_s > 0.0).then_some(used), report }
    });
    let report = Report { day, from_ms, to_ms, robots: robots.collect() };
    if args.csv {
        ctx.out.text(&csv(&report))?;
    } else {
        ctx.out.result(&report, |report| table(report, &ctx.out))?;
    }
    Ok(Exit::Done)
}

fn volts(volts: Option<f64>) -> String {
    volts.map_or_else(|| "unknown".to_owned(), |volts| format!("{volts:.1} V"))
}

fn table(report: &Report, out: &Output) -> String {
    if report.robots.is_empty() {
        return format!("no robot was heard on {}", report.day);
    }
    let mut table = Table::new(&[
        "robot", "driven", "driving", "heard", "used", "done", "failed", "battery", "least", "stops",
    ]);
    let hours = |seconds: f64| format!("{:.2} h", seconds / 3600.0);
    for Line { report: robot, utilisation } in &report.robots {
        let failed = if robot.failed > 0 { Tone::Bad } else { Tone::Plain };
        table.row(vec![
            TableCell::new(robot.robot.as_str(), Tone::Strong),
            format!("{:.1} m", robot.driven_m).into(),
            hours(robot.driving_s).into(),
            hours(robot.heard_s).into(),
            utilisation.map_or_else(|| "-".to_owned(), |part| format!("{:.0} %", 100.0 * part)).into(),
            robot.done.to_string().into(),
            TableCell::new(robot.failed.to_string(), failed),
            volts(robot.battery_v).into(),
            volts(robot.battery_min_v).into(),
            stops(&robot.stops, " ", ", ").into(),
        ]);
    }
    format!("{}\n{}", report.day, table.render(out).trim_end())
}

fn stops(stops: &[StopCount], between: &str, after: &str) -> String {
    let each = stops.iter().map(|StopCount { reason, count }| format!("{count}{between}{reason}"));
    each.collect::<Vec<_>>().join(after)
}

fn csv(report: &Report) -> String {
    let mut lines = vec![
        "day,robot,driven_m,driving_s,heard_s,active_s,utilisation,done,failed,battery_v,battery_min_v,stops"
            .to_owned(),
    ];
    let known = |value: Option<f64>| value.map(|value| format!("{value:.3}")).unwrap_or_default();
    // Names and reasons hold neither comma nor quote.
    lines.extend(report.robots.iter().map(|Line { report: robot, utilisation }| {
        format!(
            "{},{},{:.3},{:.1},{:.1},{:.1},{},{},{},{},{},{}",
            report.day,
            robot.robot,
            robot.driven_m,
            robot.driving_s,
            robot.heard_s,
            robot.active_s,
            known(*utilisation),
            robot.done,
            robot.failed,
            known(robot.battery_v),
            known(robot.battery_min_v),
            stops(&robot.stops, ":", ";")
        )
    }));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;

    fn report() -> Report {
        let stop = |reason: &str, count| StopCount { reason: reason.to_owned(), count };
        let report = RobotReport {
            robot: name("xtb-1"),
            heard_s: 7200.0,
            active_s: 3600.0,
            driving_s: 1800.0,
            driven_m: 123.456,
            done: 4,
            failed: 1,
            stops: vec![stop("goal_reached", 4), stop("way_blocked", 2)],
            battery_min_v: Some(7.05),
            battery_v: None,
        };
        let robots = vec![Line { report, utilisation: Some(0.5) }];
        Report { day: "2026-11-26".into(), from_ms: 1, to_ms: 2, robots }
    }

    #[test]
    fn a_line_for_each_robot() {
        let text = table(&report(), &Output { json: false, colors: false });
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "2026-11-26");
        let words: Vec<&str> = lines[2].split("  ").map(str::trim).filter(|word| !word.is_empty()).collect();
        assert_eq!(
            words,
            [
                "xtb-1",
                "123.5 m",
                "0.50 h",
                "2.00 h",
                "50 %",
                "4",
                "1",
                "unknown",
                "7.0 V",
                "4 goal_reached, 2 way_blocked"
            ]
        );
        let none = Report { robots: Vec::new(), ..report() };
        assert_eq!(table(&none, &Output { json: false, colors: false }), "no robot was heard on 2026-11-26");
    }

    #[test]
    fn comma_separated_values_have_as_many_fields_as_their_heading() {
        let text = csv(&report());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0].split(',').count(), lines[1].split(',').count());
        assert_eq!(
            lines[1],
            "2026-11-26,xtb-1,123.456,1800.0,7200.0,3600.0,0.500,4,1,,7.050,4:goal_reached;2:way_blocked"
        );
    }
}
