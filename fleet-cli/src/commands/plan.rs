//! `plan`: ways for a whole fleet at once, computed beforehand, on which no two robots ever touch.

mod drawing;
mod instance;
mod race;
mod schedule;

use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::output::{Output, ProgressLine};
use crate::values::seconds;
use clap::Args;
use instance::Instance;
use race::{Planned, Race};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use xtb_client::{Error, ErrorKind, Result};
use xtb_traffic::solver::{ProblemError, ScheduleFault, Unsolved};

const PLAN_HELP: &str = "\
An instance names a world file in the same folder, and robots with start and goal (x, y in m, yaw in rad):

  world: lab.toml
  agents:
    - {name: xtb-1, start: [0, 0, 1.57], goal: [0, 6, 1.57]}
  speed_m_s: 0.35     # default
  clearance_m: 0.05   # default; between robots, and to walls
  look_out_m: 0.27    # default; kept free in front of both bumpers

The schedule has a row {x, y, yaw, t} for each step (t in s; in steps for CL-MAPF instances); between two \
rows a robot drives one arc or waits. It is checked again before it is written. Exit code 1: no schedule was \
found; the message names the robots that block each other.";

/// Arguments of `plan`.
#[derive(Debug, Clone, Args)]
#[command(after_help = PLAN_HELP)]
pub struct PlanArgs {
    /// Instance to plan: a CL-MAPF instance, or a world with robots (YAML).
    #[arg(value_name = "INSTANCE")]
    pub instance: PathBuf,
    /// Write the schedule (YAML) to this file.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Time limit, in s. Ends sooner when a round of improvements finds nothing.
    #[arg(long, value_name = "SECONDS", default_value = "20", value_parser = seconds)]
    pub time_limit: Duration,
    /// Draw the schedule (SVG) to this file.
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Random seed.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Between two lines of progress.
const PROGRESS_EVERY: Duration = Duration::from_millis(500);

/// What came out, for programs and people.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub(crate) struct Statistics {
    agents: usize,
    /// Way of all robots together, in the instance's unit.
    cost: f64,
    /// When the last one arrives, in the schedule's unit of time.
    makespan: f64,
    /// Sum of all arrivals.
    flowtime: f64,
    /// In s.
    runtime: f64,
    /// When the first schedule was found, in s.
    first_runtime: f64,
    /// The first schedule's, in the schedule's unit of time.
    first_makespan: f64,
    /// The first schedule's, in the schedule's unit of time.
    first_flowtime: f64,
    /// How often makespan or flowtime became less after that.
    improved: usize,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Statistics>];

/// Plans, checks the plan once more, and writes it.
///
/// # Errors
/// An instance that cannot be read, or has no solution; no schedule within the time; files that cannot
/// be written.
pub async fn run(out: Output, args: PlanArgs) -> Result<Exit> {
    let begun = Instant::now();
    let instance = Instance::read(&out, &args.instance)?;
    let race = Race::start(&instance.problem, args.seed, begun + args.time_limit);
    let planned = tokio::select! {
        ended = follow(out, begun, &args, &race) => ended,
        () = interrupted() => {
            race.stop();
            return Ok(Exit::Interrupted);
        }
    };
    let planned = planned.map_err(|unsolved| explain(unsolved, &instance, &args))?;
    let schedule = &planned.schedule;
    xtb_traffic::solver::check(&instance.problem, schedule).map_err(|fault| wrong(&fault))?;
    let statistics = statistics(&instance, &planned, begun);
    write(&args.out, &schedule::text(&instance, schedule, &statistics)?)?;
    if let Some(file) = &args.plot {
        write(file, &drawing::svg(&instance.problem, schedule))?;
    }
    out.result(&statistics, |statistics| {
        format!(
            "{} robots, makespan {:.1}, flowtime {:.1}, {:.1} s → {}\n\
             first schedule after {:.1} s: makespan {:.1}, flowtime {:.1}; improved {} times",
            statistics.agents,
            statistics.makespan,
            statistics.flowtime,
            statistics.runtime,
            args.out.display(),
            statistics.first_runtime,
            statistics.first_makespan,
            statistics.first_flowtime,
            statistics.improved,
        )
    })?;
    Ok(Exit::Done)
}

/// Waits for the race, telling how long it takes.
async fn follow(
    out: Output,
    begun: Instant,
    args: &PlanArgs,
    race: &Race,
) -> std::result::Result<Planned, Unsolved> {
    let mut progress = ProgressLine::new();
    loop {
        tokio::time::sleep(race::LOOK_EVERY).await;
        if let Some(ended) = race.ended() {
            progress.end();
            return ended;
        }
        if !out.json && begun.elapsed() > PROGRESS_EVERY {
            let (spent, limit) = (begun.elapsed().as_secs(), args.time_limit.as_secs_f64());
            progress.show(&format!("planning: {spent} of at most {limit} s"));
        }
    }
}

fn explain(unsolved: Unsolved, instance: &Instance, args: &PlanArgs) -> Error {
    let unsolved = match unsolved {
        Unsolved::Problem(error) => Unsolved::Problem(instance.placed(error)),
        other => other,
    };
    let place = args.instance.display();
    let (kind, hint) = match unsolved {
        Unsolved::Problem(
            ProblemError::Value { .. } | ProblemError::TooMany(_) | ProblemError::SameName(_),
        ) => (ErrorKind::Config, "check the numbers and names of the instance"),
        Unsolved::Problem(_) => {
            (ErrorKind::Failed, "no schedule can start or end there: move the start or goal")
        }
        Unsolved::NoWay { .. } => {
            (ErrorKind::Failed, "it is blocked, too wide, or its turning radius is too large")
        }
        Unsolved::OutOfBudget { .. } | Unsolved::NotBegun => {
            (ErrorKind::Failed, "a longer --time-limit or another --seed may help")
        }
    };
    Error::new(kind, format!("{place}: {unsolved}")).hint(hint)
}

/// What must never happen: nothing is written then.
fn wrong(fault: &ScheduleFault) -> Error {
    Error::new(ErrorKind::Failed, format!("the schedule is invalid: {fault}; it was not written"))
        .hint("this is a bug in fleet-cli; another --seed may help")
}

fn statistics(instance: &Instance, planned: &Planned, begun: Instant) -> Statistics {
    let (schedule, first) = (&planned.schedule, &planned.first);
    Statistics {
        agents: schedule.ways.len(),
        cost: schedule.length_m(),
        makespan: instance.time(schedule.makespan()),
        flowtime: instance.time(schedule.flowtime()),
        runtime: begun.elapsed().as_secs_f64(),
        first_runtime: first.after.as_secs_f64(),
        first_makespan: instance.time(first.makespan),
        first_flowtime: instance.time(first.flowtime),
        improved: planned.improved,
    }
}

fn write(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).map_err(|error| {
        Error::new(ErrorKind::Failed, format!("cannot write {}: {error}", path.display()))
            .hint("--out and --plot need files in existing folders")
    })
}
