//! `calibrate`: sweep a servo, measure, fit Annex A's line, and write it into the configuration.
//!
//! ```text
//!   warning, confirmation ─► bench: set-up, sweep ─► fit ─► table, plot ─► R < 0.98? ─ no ─► ask, write
//!   --readings FILE ────────────────────────────────┘                      yes: refused, nothing written
//! ```

pub(crate) mod bench;
pub(crate) mod console;
mod pistons;
mod plot;
mod readings;
mod report;
mod sweep;
mod write;

use super::{Failure, print, print_json, run, tell};
use crate::cli::CalibrateArgs;
use bench::{Bench, Trouble};
use console::{Console, Input};
use indicatif::{ProgressBar, ProgressStyle};
use pistons::Piston;
use report::Report;
use robot_agent::config::ConfigFile;
use robot_agent::hardware::instruments::Instruments;
use robot_agent::settings_file;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use xtb_control::PwmCount;
use xtb_control::calibration::{
    Actuator, ActuatorKind, Fit, FitError, Point, Sweep, SweepError, SweepStep, fit,
};

/// A simulated truck's world need not wait for anybody's watch: as fast as the machine goes.
const SIMULATED_SPEED: f64 = 1000.0;

impl From<Trouble> for Failure {
    fn from(trouble: Trouble) -> Self {
        Self::new(format!("{trouble}; {}", trouble.aftermath()), trouble.hint())
    }
}

/// Calibrates one actuator. `config` is the file that the settings came from.
pub(crate) fn run(
    file: &ConfigFile,
    config: Option<&Path>,
    args: &CalibrateArgs,
) -> Result<ExitCode, Failure> {
    if !args.what.is_fitted(&file.vehicle) {
        let message =
            format!("{}: this car has none, its front axle steers alone (vehicle.drivetrain)", args.what);
        return Err(Failure::new(message, "steering-front is the one to calibrate").code(2));
    }
    let console = Console::start(Input::Terminal)?;
    let points = match &args.readings {
        Some(path) => readings::read(path, args.what)?,
        None => measure(file, args, &console)?,
    };
    let near = args.write.as_deref().or(config);
    conclude(file, args, &console, &points, near, print).map(|_| ExitCode::SUCCESS)
}

/// Fits, shows, and writes to `near` if nothing is against it: the fit in one line.
fn conclude(
    file: &ConfigFile,
    args: &CalibrateArgs,
    console: &Console,
    points: &[Point],
    near: Option<&Path>,
    show: impl Fn(&str) -> Result<(), Failure>,
) -> Result<String, Failure> {
    let (fit, refused) = judge(points);
    let (what, vehicle) = (args.what, &file.vehicle);
    let old_centre = match what.kind() {
        ActuatorKind::Steering(0) => Some(vehicle.steering.front_centre),
        ActuatorKind::Steering(_) => Some(vehicle.steering.rear_centre),
        ActuatorKind::Bumper(_) | ActuatorKind::Piston(_) => None,
    };
    let old = what.line(&vehicle.calibration);
    let report = Report { what, old, old_centre, points, fit: fit.as_ref(), refused };
    let plot = write_plot(args, &report, near)?;
    let destination = near.filter(|_| !args.dry_run);
    if !args.json {
        show(&report.table())?;
    }
    tell(&format!("plot: {}\n", plot.display()));
    let written = match (destination, &fit, refused) {
        (Some(path), Some(fit), None) => offer(args, console, path, what, fit)?,
        _ => None,
    };
    if args.json {
        print_json(&report.json(Some(&plot), written))?;
    }
    if let Some(refused) = refused {
        let hint = "nothing was written; the plot shows the points";
        return Err(Failure::new(format!("{what}: fit rejected: {refused}"), hint));
    }
    if destination.is_none() && !args.dry_run {
        tell("not written: no --config, and no --write FILE\n");
    }
    Ok(report.summary().unwrap_or_default())
}

/// The line, if there is one, and what is against it.
fn judge(points: &[Point]) -> (Option<Fit>, Option<FitError>) {
    match fit(points) {
        Ok(fit) => (Some(fit), fit.check().err()),
        Err(refused) => (None, Some(refused)),
    }
}

/// Writes the result if that is wished; where it was written.
fn offer<'a>(
    args: &CalibrateArgs,
    console: &Console,
    path: &'a Path,
    what: Actuator,
    fit: &Fit,
) -> Result<Option<&'a Path>, Failure> {
    let changes = write::changes(what, fit);
    let mut question = format!("{}:\n", path.display());
    for change in &changes {
        question.push_str(&format!("  {change}\n"));
    }
    if !args.yes {
        if !console.is_manned() {
            tell("not written: no terminal to ask for confirmation, and no --yes\n");
            return Ok(None);
        }
        if !console.confirm(&format!("{question}Write this?"))? {
            tell("not written\n");
            return Ok(None);
        }
    }
    settings_file::write(path, &changes)
        .map_err(|error| Failure::new(error, "nothing was written; --write FILE selects another file"))?;
    tell(&format!("written to {}; a running agent uses it after its next start\n", path.display()));
    Ok(Some(path))
}

/// Next to the configuration, unless asked for elsewhere.
fn write_plot(args: &CalibrateArgs, report: &Report<'_>, near: Option<&Path>) -> Result<PathBuf, Failure> {
    let path = args.plot.clone().unwrap_or_else(|| {
        let folder = near.and_then(Path::parent).unwrap_or(Path::new(""));
        folder.join(format!("calibration-{}.svg", args.what))
    });
    let refused = report.refused.map(|refused| format!("rejected: {refused}"));
    let summary = report.summary().unwrap_or_default();
    let verdict = refused.as_deref().map_or(Ok(summary.as_str()), Err);
    std::fs::write(&path, plot::svg(args.what, report.points, report.fit, verdict)).map_err(|error| {
        Failure::new(
            format!("cannot write the plot {}: {error}", path.display()),
            "--plot selects another file",
        )
    })?;
    Ok(path)
}

/// Asks, moves, measures.
fn measure(file: &ConfigFile, args: &CalibrateArgs, console: &Console) -> Result<Vec<Point>, Failure> {
    let simulated = file.hardware.kind == "simulated";
    let sweep = sweep_of(file, args);
    possible(&sweep)?;
    permission(args, console, &sweep, simulated, is_by_hand(file, args.what))?;

    let (lines, instruments) = open(file)?;
    let mut bench = Bench::new(lines, instruments, &file.vehicle, console.interrupted().clone())
        .map_err(|error| Failure::new(error, "").code(2))?;
    bench.set_up()?;
    on_bench(file, args, console, &mut bench)
}

/// The pulses there and back, and outwards.
fn possible(sweep: &Sweep) -> Result<(Vec<SweepStep>, Vec<PwmCount>), Failure> {
    let impossible = |error: SweepError| Failure::new(error, "see --from, --to and --points").code(2);
    Ok((sweep.there_and_back().map_err(impossible)?, sweep.outwards().map_err(impossible)?))
}

/// A person has to read the angles.
fn is_by_hand(file: &ConfigFile, what: Actuator) -> bool {
    file.hardware.kind != "simulated" && !matches!(what.kind(), ActuatorKind::Piston(_))
}

/// Moves and measures on a bench that has been set up.
fn on_bench(
    file: &ConfigFile,
    args: &CalibrateArgs,
    console: &Console,
    bench: &mut Bench,
) -> Result<Vec<Point>, Failure> {
    let what = args.what;
    let (steps, counts) = possible(&sweep_of(file, args))?;
    if let ActuatorKind::Piston(index) = what.kind() {
        return measure_piston(bench, file, (what, index), &counts);
    }
    let readings = steps.iter().filter(|step| step.read).count();
    let progress = if is_by_hand(file, what) { ProgressBar::hidden() } else { progress_bar(what, readings) };
    let points =
        sweep::angles(&steps, &mut sweep::Truck { bench, actuator: what, console, progress: &progress })?;
    progress.finish_and_clear();
    Ok(points)
}

/// The same for somebody who has asked for permission, and writes to this file: the fit in one line.
pub(crate) fn calibrated(
    file: &ConfigFile,
    args: &CalibrateArgs,
    console: &Console,
    bench: &mut Bench,
    config: &Path,
) -> Result<String, Failure> {
    if is_by_hand(file, args.what) {
        tell(BY_HAND);
    }
    let points = on_bench(file, args, console, bench)?;
    let show = |table: &str| {
        tell(table);
        Ok(())
    };
    conclude(file, args, console, &points, Some(config), show)
}

fn measure_piston(
    bench: &mut Bench,
    file: &ConfigFile,
    (what, index): (Actuator, usize),
    counts: &[PwmCount],
) -> Result<Vec<Point>, Failure> {
    let progress = progress_bar(what, counts.len());
    let line = what.line(&file.vehicle.calibration);
    let mut piston = Piston::new(bench, (what, index), &file.vehicle.pistons, line);
    let points = piston.speeds(counts, |point| {
        progress.set_message(format!("pulse {}: {:.1} mm/s", point.count.get(), point.quantity * 1000.0));
        progress.inc(1);
    })?;
    progress.finish_and_clear();
    Ok(points)
}

/// As configured, or as asked for.
fn sweep_of(file: &ConfigFile, args: &CalibrateArgs) -> Sweep {
    let suggested = args.what.default_sweep(&file.vehicle);
    let count =
        |asked: Option<u16>, suggested| asked.and_then(|c| PwmCount::try_from(c).ok()).unwrap_or(suggested);
    Sweep {
        from: count(args.from, suggested.from),
        to: count(args.to, suggested.to),
        points: args.points.unwrap_or(suggested.points),
    }
}

/// Says what is going to move, and goes on only with a yes.
fn permission(
    args: &CalibrateArgs,
    console: &Console,
    sweep: &Sweep,
    simulated: bool,
    by_hand: bool,
) -> Result<(), Failure> {
    if (!args.yes || by_hand) && !console.is_manned() {
        let (reason, hint) = if by_hand {
            ("the angles have to be read by hand", "run it in a terminal, or give --readings FILE")
        } else {
            ("the movement has to be confirmed", "run it in a terminal, or give --yes")
        };
        return Err(Failure::new(format!("{reason}, and there is no terminal"), hint).code(2));
    }
    let whose = if simulated { "a simulated truck's" } else { "the truck's" };
    let warning = if simulated { "" } else { WARNING };
    let how = if by_hand { BY_HAND } else { "" };
    tell(&format!(
        "{}: moves {whose} servo between pulses {} and {} (counts of 0.4 µs).\n{warning}{how}",
        args.what,
        sweep.from.get(),
        sweep.to.get()
    ));
    if args.yes || console.confirm("Go on?")? {
        return Ok(());
    }
    Err(Failure::new("not confirmed: nothing was moved", ""))
}

const WARNING: &str = "\
Put the truck on a stand: ALL WHEELS OFF THE GROUND, hands, hair and cables clear.
The motor stays neutral, but keep a hand on the power switch. Ctrl-C stops with all actuators at rest.
";

const BY_HAND: &str = "\
At each pulse type the angle in degrees; or repeat (to correct the last one), skip, quit.
";

/// The lines as for running; a simulated truck comes with instruments and without waiting.
fn open(file: &ConfigFile) -> Result<(run::Lines, Option<Instruments>), Failure> {
    if file.hardware.kind != "simulated" {
        return Ok((run::open(file)?, None));
    }
    run::open_simulated(file, SIMULATED_SPEED).map(|(lines, instruments)| (lines, Some(instruments)))
}

/// On standard error, and only if that is a terminal.
fn progress_bar(what: Actuator, length: usize) -> ProgressBar {
    let bar = ProgressBar::new(length as u64).with_prefix(what.name());
    match ProgressStyle::with_template("{prefix} [{bar:30}] {pos}/{len}  {msg}") {
        Ok(style) => bar.with_style(style.progress_chars("=> ")),
        Err(_) => bar,
    }
}

#[cfg(test)]
#[cfg(feature = "sim")]
mod tests;
