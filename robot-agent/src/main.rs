//! `robot-agent`: read the settings, then run the robot or one of the other verbs.

mod cli;
mod commands;

use clap::{CommandFactory, Parser};
use cli::{Args, Verb};
use commands::{
    Failure, bring_up, calibrate, check_hardware, enrol, identity, man, ports, print, replay, run,
};
use std::process::ExitCode;

const HELP: &str = "`robot-agent --help` lists them; `fleet-cli status ROBOT --json` shows a robot";

fn main() -> ExitCode {
    let args = Args::parse();
    dispatch(args).unwrap_or_else(|failure| failure.report())
}

fn dispatch(args: Args) -> Result<ExitCode, Failure> {
    let settings = &args.settings;
    match args.command {
        Some(Verb::Replay(replay)) => return replay::run(settings, &replay),
        Some(Verb::BringUp(asked)) => return bring_up::run(settings, &asked),
        Some(Verb::Enrol(enrol)) => return enrol::run(&enrol),
        Some(Verb::Ports(ports)) => return ports::run(&ports),
        Some(Verb::Man { folder }) => return man::run(Args::command(), &folder),
        Some(Verb::Completions { shell }) => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Args::command(), "robot-agent", &mut script);
            print(&String::from_utf8_lossy(&script))?;
            return Ok(ExitCode::SUCCESS);
        }
        _ => {}
    }
    let mut file = settings.load()?;
    if args.print_config {
        identity::of(&mut file, settings.given())?;
        print(&file.to_toml())?;
        return Ok(ExitCode::SUCCESS);
    }
    let record = match args.command {
        Some(Verb::Calibrate(asked)) => return calibrate::run(&file, settings.file().as_deref(), &asked),
        Some(Verb::CheckHardware(check)) => return check_hardware::run(&file, &check),
        Some(Verb::Record(record)) => Some(record.folder),
        _ => args.record,
    };
    if args.json {
        return Err(Failure::new(
            "a robot that runs prints no results: --json is for the other commands",
            HELP,
        )
        .code(2));
    }
    let identity = identity::of(&mut file, settings.given())?;
    run::run(&file, settings.file(), identity, record.as_deref(), args.log_format)
}
