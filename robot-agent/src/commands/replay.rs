//! `replay`: a trace or a recording through the controller again.

use super::{Failure, columns, print, print_json, tell};
use crate::cli::{ReplayArgs, Settings};
use robot_agent::config::SettingLayers;
use robot_agent::files;
use robot_agent::replay::{Comparison, Difference, OtherDecision, WhatIf, compare, unusable, what_if};
use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;
use xtb_control::{Controller, Stamp, VehicleConfig};
use xtb_protocol::trace::{TraceReader, decision_line};
use xtb_recording::Error;
use xtb_recording::robot::{Recording, RecordingEnding};

/// Lines of a what-if that are printed for people; `--json` has them all.
const SHOWN: usize = 60;

pub(crate) fn run(settings: &Settings, args: &ReplayArgs) -> Result<ExitCode, Failure> {
    match (&args.trace, &args.recording) {
        (Some(trace), _) => replay_trace(trace, settings.load_for_replay(SettingLayers::default())?.vehicle),
        (None, Some(recording)) => replay_recording(settings, args, recording),
        (None, None) => {
            Err(Failure::new("nothing to replay", "name a recording, or --trace IN.jsonl").code(2))
        }
    }
}

fn replay_recording(settings: &Settings, args: &ReplayArgs, path: &Path) -> Result<ExitCode, Failure> {
    let failed = |error: Error| {
        Failure::new(format!("{}: {error}", path.display()), "robot-agent --record DIR makes recordings")
    };
    let mut recording = Recording::open(path).map_err(failed)?;
    if let Some(target) = &args.export {
        return export(&mut recording, path, target, &failed);
    }
    let vehicle = vehicle_of(settings, &recording)?;
    if settings.change_anything() {
        let found = what_if(&mut recording, vehicle).map_err(failed)?;
        if args.json {
            print_json(&found)?;
        } else {
            print(&in_words(&found))?;
        }
        return Ok(if found.difference.is_none() { ExitCode::SUCCESS } else { ExitCode::FAILURE });
    }
    let found = compare(&mut recording, vehicle).map_err(failed)?;
    if args.json {
        print_json(&found)?;
    } else {
        print(&verdict(&found, &recording))?;
    }
    Ok(if found.identical { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The recorded constants, or those of --config, with --set on top.
fn vehicle_of(settings: &Settings, recording: &Recording) -> Result<VehicleConfig, Failure> {
    let mut layers = SettingLayers::default();
    if settings.config.is_none()
        && let Some(header) = recording.header()
    {
        layers.file("the recording's configuration", &header.vehicle_toml).map_err(|problem| {
            Failure::new(problem, "the header is damaged, or from another version; --config FILE replaces it")
        })?;
    }
    Ok(settings.load_for_replay(layers)?.vehicle)
}

fn verdict(found: &Comparison, recording: &Recording) -> String {
    let mut text = String::new();
    found.differences.iter().for_each(|difference| text.push_str(&told(difference)));
    if found.identical {
        text.push_str(&format!("identical, {} samples\n", found.samples));
    } else if let Some(header) = recording.header().filter(|header| header.version != robot_agent::VERSION) {
        text.push_str(&format!(
            "(recorded by version {}, this is {})\n",
            header.version,
            robot_agent::VERSION
        ));
    }
    text + &ending(&found.ending)
}

fn told(difference: &Difference) -> String {
    let Difference { t_s, step, sample, stage, field, recorded, replayed } = difference;
    format!(
        "difference at {t_s:.6} s, step {step} ({sample}), stage {stage}: {field}\n  \
         recorded {recorded}\n  replayed {replayed}\n"
    )
}

fn ending(ending: &RecordingEnding) -> String {
    match ending {
        RecordingEnding::Complete => String::new(),
        RecordingEnding::Cut(words) => format!("the recording is incomplete: it ends there ({words})\n"),
    }
}

fn in_words(found: &WhatIf) -> String {
    let WhatIf { samples, differing, decisions, .. } = found;
    let mut text = if decisions.is_empty() {
        format!("no decision would have been different, {samples} samples\n")
    } else {
        format!(
            "{differing} of {samples} steps would have decided differently (with the samples of the recorded \
             drive):\n"
        )
    };
    let mut rows =
        vec![["FROM", "TO", "STEPS", "DECISION", "RECORDED", "REPLAYED"].map(str::to_owned).to_vec()];
    for span in decisions.iter().take(SHOWN) {
        let time = |s: f64| format!("{s:.3} s");
        let OtherDecision { decision, recorded, replayed, from_s, to_s, steps } = span;
        let row = [time(*from_s), time(*to_s), steps.to_string(), (*decision).to_owned()];
        rows.push(row.into_iter().chain([recorded.clone(), replayed.clone()]).collect());
    }
    if !decisions.is_empty() {
        text.push_str(&columns(&rows));
    }
    if decisions.len() > SHOWN {
        text.push_str(&format!("… and {} more (--json lists all)\n", decisions.len() - SHOWN));
    }
    if let Some(difference) = &found.difference {
        text.push_str(&format!("the replay ends here:\n{}", told(difference)));
    }
    text + &ending(&found.ending)
}

/// Writes the recording's samples as a trace, up to where they can be trusted.
fn export(
    recording: &mut Recording,
    source: &Path,
    target: &Path,
    failed: &dyn Fn(Error) -> Failure,
) -> Result<ExitCode, Failure> {
    let mut out: Box<dyn Write> = if target == Path::new("-") {
        Box::new(io::stdout().lock())
    } else {
        let same = target.canonicalize().is_ok_and(|target| source.canonicalize().is_ok_and(|s| s == target));
        let made =
            if same { Err(io::Error::other("this is the recording itself")) } else { File::create(target) };
        Box::new(made.map_err(|error| {
            Failure::new(format!("{}: {error}", target.display()), "--export needs another file")
        })?)
    };
    let mut out = BufWriter::new(&mut out);
    let (mut steps, mut last) = (0, Stamp::ZERO);
    while let Some(step) = recording.next_step().map_err(failed)? {
        if let Some(wrong) = unusable(steps, &step, last) {
            let _ = out.flush();
            return Err(Failure::new(told(&wrong).trim_end(), "the trace ends before this sample"));
        }
        (steps, last) = (steps + 1, step.sample().map_or(last, |(t, _)| t));
        let line = step.trace_line().unwrap_or_default();
        if let Err(error) = writeln!(out, "{line}") {
            return ended(&error);
        }
    }
    tell(&ending(&recording.ending()));
    out.flush().map_or_else(|error| ended(&error), |()| Ok(ExitCode::SUCCESS))
}

/// Prints what the controller decides on each line. A malformed line ends the run.
fn replay_trace(path: &Path, vehicle: VehicleConfig) -> Result<ExitCode, Failure> {
    let name = path.display();
    let mut input: Box<dyn BufRead> = if path == Path::new("-") {
        Box::new(io::stdin().lock())
    } else {
        let file = files::open(path)
            .map_err(|error| Failure::new(format!("{name}: {error}"), "--trace needs a file of samples"))?;
        Box::new(BufReader::new(file))
    };
    let (mut reader, mut controller) = (TraceReader::default(), Controller::new(vehicle));
    let mut out = BufWriter::new(io::stdout().lock());
    for number in 1_u64.. {
        let read = match files::line(&mut input, files::MAX_LINE) {
            Ok(None) => break,
            Ok(Some(line)) => reader.line(&line).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        let (t, sample) = match read {
            Ok(read) => read,
            Err(wrong) => {
                let _ = out.flush();
                let message = format!("{name}:{number}: {wrong}");
                return Err(Failure::at(message, "docs/trace.md describes the format"));
            }
        };
        let decided = decision_line(&controller.step(t, &sample));
        if let Err(error) = writeln!(out, "{decided}") {
            return ended(&error);
        }
    }
    out.flush().map_or_else(|error| ended(&error), |()| Ok(ExitCode::SUCCESS))
}

/// A reader that has gone away (`| head`) is no failure, but the end.
fn ended(error: &io::Error) -> Result<ExitCode, Failure> {
    if error.kind() == io::ErrorKind::BrokenPipe {
        return Ok(ExitCode::SUCCESS);
    }
    Err(Failure::new(format!("cannot write: {error}"), ""))
}
