//! `bring-up`: leads through a new truck, step by step, from the board's first word to its calibration.
//!
//! ```text
//!   settings ─► plan ─► Session (pure) ── say, ask, look, move ──► this shell ─► console, lines, files
//!                          ▲                                          │
//!                          └────────── lines typed, looks, verdicts ──┘
//! ```
//! What moves by hand is seen by a robot without a session, as in `check-hardware`; what moves by itself moves on
//! the bench of `calibrate`. On a simulated truck a simulated person does what is asked for.

mod detect;
mod dialogue;
mod motions;
mod plan;
mod report;
mod session;
#[cfg(feature = "sim")]
mod simulated;
mod truck;

use super::calibrate::bench::Bench;
use super::calibrate::calibrated;
use super::calibrate::console::{Console, Input};
use super::{Failure, print, run, tell};
use crate::cli::{BringUpArgs, CalibrateArgs, Settings};
use dialogue::{Chore, Question, Verdict, Wrong};
use plan::{Step, steps};
use report::Report;
use robot_agent::config::ConfigFile;
use robot_agent::hardware::instruments::Instruments;
use robot_agent::settings_file::{self, SettingChange};
use robot_agent::{VERSION, files};
use session::{Event, Session, Then};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::SystemTime;
use truck::Truck;
use xtb_control::calibration::Actuator;

/// Who does what the hands and eyes are asked for. A real one does it without being told by us.
trait Person {
    fn hands(&mut self, _: Chore, _now_s: f64) {}
    fn goes_on(&mut self, _now_s: f64) {}
    fn asked(&mut self, _: &Question) {}
    fn told_of_failure(&mut self) {}
    fn begins_to_watch(&mut self) {}
    fn eyes(&mut self, _: &mut Bench) {}
    fn instruments(&self) -> Option<Instruments> {
        None
    }
}

/// Somebody at the console.
struct RealPerson;

impl Person for RealPerson {}

/// The report in its two forms, beside the settings.
struct Files {
    json: PathBuf,
    text: PathBuf,
}

impl Files {
    fn beside(config: &Path) -> Self {
        Self { json: config.with_extension("bring-up.json"), text: config.with_extension("bring-up.txt") }
    }

    /// What was noted before.
    fn read(&self) -> Result<Option<Report>, Failure> {
        let name = self.json.display();
        let text = match files::text(&self.json, files::MAX_TEXT) {
            Ok(text) => text,
            Err(error) if error.is_missing() => return Ok(None),
            Err(error) => return Err(Failure::new(format!("cannot read {name}: {error}"), "")),
        };
        let hint = "--restart begins anew, in its place";
        Report::read(&text).map(Some).map_err(|error| Failure::new(format!("{name}: {error}"), hint))
    }

    fn write(&self, report: &Report) -> Result<(), Failure> {
        for (path, text) in [(&self.json, report.json()), (&self.text, report.text())] {
            files::replace(path, text.as_bytes()).map_err(|error| {
                let hint = "the report is written beside the settings: that folder needs write permission";
                Failure::new(format!("cannot write {}: {error}", path.display()), hint)
            })?;
        }
        Ok(())
    }
}

/// Brings a truck up, as far as it goes.
pub(crate) fn run(settings: &Settings, args: &BringUpArgs) -> Result<ExitCode, Failure> {
    let file = settings.load()?;
    let Some(config) = settings.file() else {
        let hint = "--config robot.toml: an empty file will do; what is found is written to it and beside it";
        return Err(Failure::new("bring-up needs a file with the settings", hint).code(2));
    };
    let (files, plan) = (Files::beside(&config), steps(&file.vehicle));
    let robot = file.agent()?.robot;
    let before = if args.restart { None } else { files.read()? };
    let mut report = before.unwrap_or_else(|| Report::new(robot.as_str(), VERSION));
    report.begin(VERSION, &file.vehicle, &plan);
    if args.report {
        return finish(&report, args);
    }
    report.keep_private(&file.hardware.board, "the board's port");
    report.keep_private(&file.hardware.gyro, "the gyro's port");
    report.keep_private(&config.display().to_string(), "the settings");
    if let Some(folder) = config.parent().filter(|folder| folder.is_absolute()) {
        report.keep_private(&folder.display().to_string(), "the settings' folder");
    }
    let chosen = chosen(&plan, &report, args)?;
    if chosen.is_empty() {
        return finish(&report, args);
    }
    let session = Session::new(file.vehicle.clone(), report, chosen, args.patience);
    let mut shell = Shell::start(&file, &config, files, session)?;
    let ended = shell.pump();
    shell.truck.stand();
    let report = shell.session.report_mut();
    // What has been calibrated is in the file now.
    report.begin(VERSION, &settings.load()?.vehicle, &plan);
    shell.files.write(shell.session.report())?;
    tell(&format!("\nreport: {}, {}\n", shell.files.json.display(), shell.files.text.display()));
    ended?;
    finish(shell.session.report(), args)
}

/// Shows it; all is well only if every step is.
fn finish(report: &Report, args: &BringUpArgs) -> Result<ExitCode, Failure> {
    print(&if args.json { report.json() } else { report.text() })?;
    Ok(if report.is_complete() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The steps of this run: those that are open, or as asked for.
fn chosen(plan: &[Step], report: &Report, args: &BringUpArgs) -> Result<Vec<Step>, Failure> {
    let at = |id: &str| {
        plan.iter().position(|step| step.id() == id).ok_or_else(|| {
            let all = plan.iter().map(|step| step.id()).collect::<Vec<_>>().join(", ");
            Failure::new(format!("this truck has no step {id}"), format!("its steps are {all}")).code(2)
        })
    };
    if let Some(id) = &args.only {
        return Ok(vec![plan[at(id)?]]);
    }
    if let Some(id) = &args.from {
        return Ok(plan[at(id)?..].to_vec());
    }
    Ok(plan.iter().copied().filter(|step| !report.is_well(&step.id())).collect())
}

/// Everything that is not the session.
struct Shell<'a> {
    file: &'a ConfigFile,
    config: &'a Path,
    files: Files,
    session: Session,
    // Before the console, whose simulated person may wait for the world.
    truck: Truck<'a>,
    person: Box<dyn Person>,
    console: Console,
    /// What is typed counts at any time, not only when something was asked.
    is_terminal: bool,
    now_s: f64,
}

impl<'a> Shell<'a> {
    fn start(
        file: &'a ConfigFile,
        config: &'a Path,
        files: Files,
        session: Session,
    ) -> Result<Self, Failure> {
        let (lines, input, person) = open(file)?;
        let is_terminal = matches!(input, Input::Standard) && std::io::stdin().is_terminal();
        let console = Console::start(input)?;
        let truck = Truck::new(file, lines, console.interrupted().clone());
        Ok(Self { file, config, files, session, truck, person, console, is_terminal, now_s: 0.0 })
    }

    /// Until the session ends, or Ctrl-C.
    fn pump(&mut self) -> Result<(), Failure> {
        let mut event = Event::Begin;
        loop {
            let now = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
            self.session.report_mut().at(&now);
            let next = self.session.on(event);
            if !next.say.is_empty() {
                tell(&next.say);
            }
            if next.note {
                self.files.write(self.session.report())?;
            }
            event = match next.then {
                Then::End => return Ok(()),
                Then::GoOn => self.wait(self.is_terminal)?,
                Then::Look(chore) => {
                    self.person.hands(chore, self.now_s);
                    self.wait(self.is_terminal)?
                }
                Then::Answer(question) => {
                    if self.is_terminal {
                        while let Ok(Some(_)) = self.console.typed() {} // before it was asked
                    }
                    self.person.asked(&question);
                    self.answer()?
                }
                Then::Decide => {
                    self.person.told_of_failure();
                    self.answer()?
                }
                Then::Check => Event::Did(self.truck.check()?),
                Then::Move(motion) => {
                    let Self { truck, person, .. } = self;
                    person.begins_to_watch();
                    Event::Did(truck.run(motion, &mut |bench| person.eyes(bench))?)
                }
                Then::Calibrate(actuator) => Event::Did(self.calibrate(actuator)?),
                Then::Write(lengths) => Event::Did(self.write(&lengths)),
            };
        }
    }

    /// A turn of the lines, or a line if one is listened for.
    fn wait(&mut self, listens: bool) -> Result<Event, Failure> {
        if self.console.interrupted().load(Ordering::Relaxed) {
            return Err(Failure::new("interrupted", "the same command goes on here"));
        }
        if listens {
            match self.console.typed() {
                Ok(Some(line)) => {
                    if !self.is_terminal {
                        tell(&format!("{line}\n")); // nobody has seen it being typed
                    }
                    return Ok(Event::Typed(line));
                }
                Ok(None) => {}
                Err(_) => return Ok(Event::InputEnded),
            }
        }
        let view = self.truck.look()?;
        self.now_s = view.now_s;
        self.person.goes_on(view.now_s);
        Ok(Event::Look(Box::new(view)))
    }

    /// Until a line comes; the lines go on meanwhile.
    fn answer(&mut self) -> Result<Event, Failure> {
        loop {
            match self.wait(true)? {
                Event::Look(_) => {}
                event => return Ok(event),
            }
        }
    }

    fn calibrate(&mut self, what: Actuator) -> Result<Verdict, Failure> {
        let args = CalibrateArgs::confirmed(what);
        let found = self
            .truck
            .bench(self.person.instruments())
            .and_then(|mut bench| calibrated(self.file, &args, &self.console, &mut bench, self.config));
        if self.console.interrupted().load(Ordering::Relaxed) {
            return found.map(Ok);
        }
        Ok(found.map_err(|Failure { message, hint, .. }| Wrong::new(message, hint)))
    }

    fn write(&self, lengths: &[(&'static str, f64)]) -> Verdict {
        let change = |(key, m): &(&str, f64)| SettingChange::new(&format!("vehicle.geometry.{key}"), *m);
        let changes: Vec<_> = lengths.iter().map(change).collect();
        settings_file::write(self.config, &changes)
            .map_err(|error| Wrong::new(error.to_string(), "nothing was written: measure again"))?;
        let words = lengths.iter().map(|(key, m)| format!("{key} = {m}"));
        Ok(format!("written: {}", words.collect::<Vec<_>>().join(", ")))
    }
}

/// Lines, answers, and who gives them.
fn open(file: &ConfigFile) -> Result<(run::Lines, Input, Box<dyn Person>), Failure> {
    #[cfg(feature = "sim")]
    if file.hardware.kind == "simulated" {
        let (lines, input, person) = simulated::meet(file)?;
        return Ok((lines, input, Box::new(person)));
    }
    Ok((run::open(file)?, Input::Standard, Box::new(RealPerson)))
}

#[cfg(test)]
#[cfg(feature = "sim")]
mod tests;
