//! Speeds as ratios within one run, compared with the last accepted run; the table and plot of `docs/performance.md`.
//!
//! `cargo bench -p fleet-tests --bench ratios -- --help` lists the options. CI runs the short form by
//! `cargo test --workspace --bench ratios`: in the profile and with the features of its tests everything but this
//! program is built already, and there the libraries below `core/` that do the work are optimized (`Cargo.toml`).
//! Each run names its profile, and only runs of one profile are compared.

#![allow(clippy::print_stdout, clippy::print_stderr)] // a bench

mod options;
mod plot;
mod reference;
mod works;

use fleet_tests::ratios::{Figure, Pair, Row, Run, compare, read_history, shown, with_table};
use options::{HELP, Options};
use reference::References;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};
use works::Work;

const HISTORY: &str = "docs/ratios/history.json";
const PLOT: &str = "docs/ratios/history.svg";
const PAGE: &str = "docs/performance.md";

/// How thoroughly a figure is measured.
struct Form {
    least_pairs: usize,
    most_pairs: usize,
    /// No more pairs after this time, once there are `least_pairs`.
    enough: Duration,
}

const LONG: Form = Form { least_pairs: 7, most_pairs: 41, enough: Duration::from_secs(20) };
const SHORT: Form = Form { least_pairs: 3, most_pairs: 9, enough: Duration::from_secs(1) };

fn main() -> ExitCode {
    let options = match Options::read(std::env::args().skip(1)) {
        Ok(options) => options,
        Err(why) => {
            eprintln!("{why}\n\n{HELP}");
            return ExitCode::from(2);
        }
    };
    if options.help {
        println!("{HELP}");
        return ExitCode::SUCCESS;
    }
    match run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Result<(), Box<dyn Error>> {
    let history = accepted(&options.against)?;
    let run = Run {
        date: options.date.clone().or_else(|| output("date", &["+%F"])).ok_or("the day is not known")?,
        commit: output("git", &["rev-parse", "--short", "HEAD"]).unwrap_or_else(|| "unknown".to_owned()),
        profile: if cfg!(debug_assertions) { "test" } else { "bench" }.to_owned(),
        machine: machine(),
        rows: measured(options.short),
    };
    write(&options.json, &(serde_json::to_string_pretty(&run)? + "\n"))?;
    println!("written to {}", options.json.display());
    tell(&run, &history, options.short);
    if options.accept { accept(run) } else { Ok(()) }
}

fn measured(short: bool) -> Vec<Row> {
    let (form, references) = (if short { SHORT } else { LONG }, References::new());
    println!("| figure | on this machine | ratio | p10 to p90 |\n| --- | ---: | ---: | ---: |");
    let figures = Figure::ALL.into_iter().filter(|figure| !short || figure.is_short());
    figures.filter_map(|figure| measure(figure, &form, &references)).collect()
}

/// Reference and figure in turn, after one of each that does not count.
fn measure(figure: Figure, form: &Form, references: &References) -> Option<Row> {
    let Work { units, mut run } = Work::of(figure);
    let mut pair =
        || Pair { reference_s: timed(|| references.run(figure.reference())), figure_s: timed(&mut run) };
    pair();
    let (began, mut pairs) = (Instant::now(), Vec::new());
    while pairs.len() < form.least_pairs || (pairs.len() < form.most_pairs && began.elapsed() < form.enough) {
        pairs.push(pair());
    }
    let row = Row::of(figure, units, &pairs)?;
    let [unit_us, ratio, p10, p90] = [row.unit_us, row.ratio, row.p10, row.p90].map(shown);
    println!("| {} | {unit_us} µs a {} | {ratio} | {p10} to {p90} |", row.name, row.unit);
    Some(row)
}

/// In s.
fn timed(work: impl FnOnce()) -> f64 {
    let began = Instant::now();
    work();
    began.elapsed().as_secs_f64()
}

/// What has become slower, and what cannot be compared.
fn tell(run: &Run, history: &[Run], short: bool) {
    let Some(compared) = compare(run, history) else {
        println!("no accepted run of profile {}: nothing to compare with", run.profile);
        return;
    };
    for fall in &compared.fell {
        println!("warning: {fall}");
    }
    for name in &compared.new {
        println!("not compared: ratio {name:?} is new or measures another work than the accepted run");
    }
    // The short form leaves rows out.
    for name in compared.missing.iter().filter(|_| !short) {
        println!("not measured: ratio {name:?} of the accepted run");
    }
    println!("{} of {} ratios fell since {}", compared.fell.len(), run.rows.len(), compared.accepted);
    if compared.all_fell() {
        let names: Vec<&str> = compared.fell_beside_the_others().map(|fall| fall.name.as_str()).collect();
        let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        println!(
            "their median is {:.2} of the accepted ones: a computer of another kind, or everything became slower; \
             beside the median fell: {names}",
            compared.median
        );
    }
}

/// Puts the run into the committed history, its plot and its page.
fn accept(run: Run) -> Result<(), Box<dyn Error>> {
    let mut history = accepted(&in_repository(HISTORY))?;
    history.push(run);
    let page = read(&in_repository(PAGE))?;
    let page = with_table(&page, &history).ok_or_else(|| format!("{PAGE} has no marks for the table"))?;
    write(&in_repository(HISTORY), &(serde_json::to_string_pretty(&history)? + "\n"))?;
    write(&in_repository(PLOT), &plot::svg(&history))?;
    write(&in_repository(PAGE), &page)?;
    println!("accepted: {HISTORY}, {PLOT} and {PAGE} are to be committed");
    Ok(())
}

fn accepted(file: &Path) -> Result<Vec<Run>, Box<dyn Error>> {
    Ok(read_history(&file.display().to_string(), &read(file)?)?)
}

fn read(file: &Path) -> Result<String, String> {
    std::fs::read_to_string(file).map_err(|error| format!("{}: {error}", file.display()))
}

fn write(file: &Path, text: &str) -> Result<(), String> {
    std::fs::write(file, text).map_err(|error| format!("{}: {error}", file.display()))
}

/// Cargo starts a bench in its package's folder; its options are seen from the repository.
fn in_repository(file: impl AsRef<Path>) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)
}

/// The first line that a program prints, if it succeeds.
fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok().filter(|it| it.status.success())?;
    let line = String::from_utf8(output.stdout).ok()?.lines().next()?.trim().to_owned();
    (!line.is_empty()).then_some(line)
}

fn machine() -> String {
    let text = |file: &str| std::fs::read_to_string(file).unwrap_or_default();
    let (processors, load) = (text("/proc/cpuinfo"), text("/proc/loadavg"));
    let model = processors.lines().find(|line| line.starts_with("model name"));
    let model =
        model.and_then(|line| line.split_once(':')).map_or("unknown processor", |(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
    let load = load.split(' ').next().filter(|load| !load.is_empty()).unwrap_or("unknown");
    format!("{model}, {cores} cores, load {load} before")
}
