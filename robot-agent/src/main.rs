//! `robot-agent`: read the settings, then run the robot or one of the other verbs.

mod cli;
mod commands;

use clap::{CommandFactory, Parser};
use cli::{Args, Verb};
use commands::{Failure, calibrate, check_hardware, ports, print, replay, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    let args = Args::parse();
    dispatch(args).unwrap_or_else(|failure| failure.report())
}

fn dispatch(args: Args) -> Result<ExitCode, Failure> {
    let settings = &args.settings;
    match args.command {
        Some(Verb::Replay(replay)) => return replay::run(settings, &replay),
        Some(Verb::Ports(ports)) => return ports::run(&ports),
        Some(Verb::Completions { shell }) => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Args::command(), "robot-agent", &mut script);
            print(&String::from_utf8_lossy(&script))?;
            return Ok(ExitCode::SUCCESS);
        }
        _ => {}
    }
    let file = settings.load()?;
    if args.print_config {
        print(&file.to_toml())?;
        return Ok(ExitCode::SUCCESS);
    }
    match args.command {
        Some(Verb::Calibrate(asked)) => calibrate::run(&file, settings.file().as_deref(), &asked),
        Some(Verb::CheckHardware(check)) => check_hardware::run(&file, &check),
        Some(Verb::Record(record)) => run::run(&file, Some(&record.folder), args.log_format),
        _ => run::run(&file, args.record.as_deref(), args.log_format),
    }
}
