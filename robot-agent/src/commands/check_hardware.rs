//! `check-hardware`: read every sensor once and say what is wrong.
//!
//! A robot without a session runs on the opened lines, as in a run, until everything has been heard
//! and has gone on for a while, or the time is up. It is given no command, the transmitter cannot
//! take over and the platform stands, so the motor is neutral all the time.

mod rows;
mod watch;

use super::run::{Lines as Opened, open, wait_for_signal};
use super::{Failure, columns, print, print_json, tell};
use crate::cli::CheckArgs;
use robot_agent::VERSION;
use robot_agent::config::ConfigFile;
use robot_agent::hardware::lines::Lines;
use rows::{Evidence, Row, Verdict, rows};
use serde::Serialize;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use watch::Watch;
use xtb_control::vehicle::Platform;
use xtb_control::{PwmCount, Stamp, VehicleConfig};
use xtb_protocol::messages::FaultState;
use xtb_robot::robot::TURN_NS;
use xtb_robot::{Robot, RobotIdentity};

/// `--timeout` takes these, in s.
const TIMEOUTS_S: std::ops::RangeInclusive<f64> = 0.1..=3600.0;
/// After a delay of more than this the missed turns are given up.
const GIVE_UP_NS: u64 = 100_000_000;
/// Who waits longer than this is told for what, and again each time that it has passed.
const PATIENCE_S: f64 = 1.0;

/// What has been found.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    /// Nothing is missing or suspicious.
    ok: bool,
    faults: Vec<Trouble>,
    rows: Vec<Row>,
}

impl Report {
    /// How many rows are ok, and what is wrong with the others, with what to do.
    pub(crate) fn summary(&self) -> (usize, Vec<String>) {
        let faults = self.faults.iter().map(|trouble| format!("{}: {}", trouble.fault, trouble.advice));
        let rows = self.rows.iter().filter_map(Row::trouble);
        let well = self.rows.iter().filter(|row| row.verdict == Verdict::Ok).count();
        (well, faults.chain(rows).collect())
    }
}

/// A fault with what to do about it.
#[derive(Debug, Serialize)]
struct Trouble {
    fault: String,
    detail: Option<String>,
    advice: &'static str,
}

pub(crate) fn run(file: &ConfigFile, args: &CheckArgs) -> Result<ExitCode, Failure> {
    if !TIMEOUTS_S.contains(&args.timeout) {
        let hint = format!("--timeout must be {} to {} seconds", TIMEOUTS_S.start(), TIMEOUTS_S.end());
        return Err(Failure::new(format!("cannot wait {} s", args.timeout), hint).code(2));
    }
    let interrupted = interrupted()?;
    let report = check(file, open(file)?, args.timeout, &interrupted)?;
    if args.json {
        print_json(&report)?;
    } else {
        print(&table(&report))?;
    }
    Ok(if report.ok { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A robot that only watches: without a session it is given no command, and nothing moves.
pub(crate) fn watcher(file: &ConfigFile) -> Result<Robot, Failure> {
    let agent = file.agent()?;
    let identity =
        RobotIdentity { fleet: agent.fleet, robot: agent.robot, epoch: 0, start_pose: agent.start_pose };
    Ok(Robot::new(identity, harmless(&file.vehicle), VERSION))
}

/// Turns a robot until everything has been heard, the time is up, or `interrupted`.
pub(crate) fn check(
    file: &ConfigFile,
    (hardware, clock): Opened,
    timeout_s: f64,
    interrupted: &AtomicBool,
) -> Result<Report, Failure> {
    let mut robot = watcher(file)?;
    let mut lines = Lines::new(hardware);
    let (began, mut next) = (clock.now(), clock.now());
    let (mut watch, mut told_s) = (Watch::new(&file.vehicle), PATIENCE_S);
    loop {
        next = next.plus_ns(TURN_NS);
        clock.wait_until(next);
        let now = clock.now();
        if now.ns() > next.ns() + GIVE_UP_NS {
            next = now;
        }
        lines.read(&mut robot, now, &mut |_, _| {});
        lines.write(&mut robot, now, &mut |_, _| {});
        if robot.outputs().pwm.motor != PwmCount::NEUTRAL {
            return Err(Failure::new("the motor did not stay neutral", "this is a bug in the program"));
        }
        watch.turn(now, &robot.readings(now));
        let waited_s = now.since_s(began);
        if watch.is_complete(now) || waited_s >= timeout_s || interrupted.load(Ordering::Relaxed) {
            lines.stand(&mut robot, now, &mut |_, _| {});
            return Ok(report(file, &robot, &watch, now));
        }
        if waited_s >= told_s {
            told_s += PATIENCE_S;
            tell(&format!(
                "{waited_s:.0} of {timeout_s} s: waiting for {}\n",
                watch.missing(&robot.readings(now))
            ));
        }
    }
}

/// The truck, but nothing moves: no count is below 0, so the transmitter's selector never means
/// manual while its channels are still read and reset; the pistons stand.
fn harmless(vehicle: &VehicleConfig) -> VehicleConfig {
    let mut vehicle = vehicle.clone();
    vehicle.remote.manual = "below".to_owned();
    vehicle.remote.selector_counts = 0.0;
    vehicle.platform = Platform::Off;
    vehicle
}

/// Becomes true at Ctrl-C.
fn interrupted() -> Result<Arc<AtomicBool>, Failure> {
    let failed = |error: std::io::Error| Failure::new(error, "out of threads or memory");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let flag = Arc::new(AtomicBool::new(false));
    let raised = flag.clone();
    let wait = move || {
        runtime.block_on(wait_for_signal());
        raised.store(true, Ordering::Relaxed);
    };
    std::thread::Builder::new().name("signals".into()).spawn(wait).map_err(failed)?;
    Ok(flag)
}

fn report(file: &ConfigFile, robot: &Robot, watch: &Watch, now: Stamp) -> Report {
    let faults = robot.agent().faults().states(now);
    let readings = robot.readings(now);
    let evidence = Evidence {
        settings: file,
        outputs: robot.outputs(),
        faults: &faults,
        counted: watch.counted(&readings),
        most_pulses: watch.most_pulses(),
        remote: watch.remote(&readings),
        readings,
    };
    let rows = rows(&evidence);
    let well = rows.iter().all(|row| matches!(row.verdict, Verdict::Ok | Verdict::NotFitted));
    let faults: Vec<_> = faults.into_iter().map(trouble).collect();
    Report { ok: well && faults.is_empty(), faults, rows }
}

fn trouble(state: FaultState) -> Trouble {
    let FaultState { fault, detail, .. } = state;
    Trouble { fault: fault.to_string(), detail, advice: fault.remedy() }
}

fn table(report: &Report) -> String {
    let mut text = String::new();
    if !report.faults.is_empty() {
        let heading = ["FAULT", "SYSTEM MESSAGE", "WHAT TO DO"].map(str::to_owned).to_vec();
        let faults = report.faults.iter().map(|trouble| {
            let detail = trouble.detail.clone().unwrap_or_else(|| "-".to_owned());
            vec![trouble.fault.clone(), detail, trouble.advice.to_owned()]
        });
        text = columns(&[heading].into_iter().chain(faults).collect::<Vec<_>>()) + "\n";
    }
    let heading = ["WHAT", "RAW", "READS AS", "VERDICT", "WHAT TO DO"].map(str::to_owned).to_vec();
    let rows = report.rows.iter().map(Row::cells);
    text.push_str(&columns(&[heading].into_iter().chain(rows).collect::<Vec<_>>()));
    let count = |wanted| report.rows.iter().filter(|row| row.verdict == wanted).count();
    let (missing, suspicious) = (count(Verdict::Missing), count(Verdict::Suspicious));
    text.push_str(&match (report.ok, missing + suspicious) {
        (true, _) => "\nno problems found\n".to_owned(),
        (false, 0) => "\nsee the fault above\n".to_owned(),
        (false, _) => format!("\n{missing} missing, {suspicious} suspicious\n"),
    });
    text
}
