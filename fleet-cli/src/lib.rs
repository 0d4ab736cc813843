//! The operator's command line: everything that people use of the fleet.
//!
//! A goal's walk begins here: `commands/goto.rs` → `client.rs` → `xtb-robot`'s operator →
//! `xtb-bus` → Zenoh.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod cli;
pub mod commands;
pub mod config;
pub mod context;
pub mod dashboard;
pub mod error;
#[cfg(feature = "foxglove")]
pub mod foxglove;
pub mod interrupt;
mod map_file;
mod nearest;
pub mod output;
pub mod recording;
pub mod scene;
pub mod services;
pub mod simulator;
pub mod table;
pub mod terminal;
mod text;
pub mod tui;
pub mod vehicle_file;

pub use cli::Cli;
pub use context::Context;
pub use error::{Exit, Error, ErrorKind, Result};
pub use output::Output;

use cli::Verb;
use interrupt::{or_interrupted, or_interrupted_saying};

const SHOWS_POSE: &str = "`fleet-cli status ROBOT` shows the pose";
const SHOWS_STANDSTILL: &str = "`fleet-cli list` shows which robots are stopped or latched";

/// Carries out one command line and says how it ended.
pub async fn run(cli: Cli) -> Exit {
    let out = Output::new(cli.global.json, cli.global.color);
    match dispatch(cli, out).await {
        Ok(exit) => exit,
        Err(failure) => {
            out.failure(&failure);
            Exit::from(failure.kind)
        }
    }
}

/// Wrong usage, `--help` or `--version`: says it, as JSON if the command line asks for that.
pub fn usage(error: &clap::Error) -> Exit {
    let json = error.use_stderr() && std::env::args_os().any(|argument| argument == "--json");
    if json {
        Output { json, colors: false }.failure(&cli::usage_failure(error));
    } else {
        // clap knows where it belongs and how to paint it; a closed pipe is nobody's concern here.
        let _ = error.print();
    }
    if error.use_stderr() { Exit::Usage } else { Exit::Done }
}

async fn dispatch(cli: Cli, out: Output) -> Result<Exit> {
    // Not before a verb asks for it: completions must not fail over a broken config.
    let ctx = || Context::new(&cli.global, out);
    match cli.verb {
        Verb::List(args) => or_interrupted(commands::list::run(&ctx()?, &args)).await,
        Verb::Status(args) if args.watch => commands::status::run(&ctx()?, &args).await,
        Verb::Status(args) => or_interrupted(commands::status::run(&ctx()?, &args)).await,
        Verb::Why(args) => or_interrupted(commands::why::run(&ctx()?, &args)).await,
        Verb::Doctor(args) => or_interrupted(commands::doctor::run(&ctx()?, &args)).await,
        Verb::Goto(args) => commands::goto::run(&ctx()?, args).await,
        Verb::Wander(args) => commands::wander::run(&ctx()?, args).await,
        Verb::Stop(args) => {
            let ctx = ctx()?;
            let stop = commands::stop::run(&ctx, &args);
            or_interrupted_saying(stop, "stop not confirmed", SHOWS_STANDSTILL).await
        }
        Verb::Estop(args) => {
            let ctx = ctx()?;
            let estop = commands::estop::run(&ctx, &args);
            or_interrupted_saying(estop, "stop not confirmed", SHOWS_STANDSTILL).await
        }
        Verb::Reset(args) => {
            let ctx = ctx()?;
            let reset = commands::reset::run(&ctx, &args);
            or_interrupted_saying(reset, "reset not confirmed; no robot moves", SHOWS_STANDSTILL).await
        }
        Verb::SetPose(args) => {
            let ctx = ctx()?;
            let set = commands::set_pose::run(&ctx, &args);
            or_interrupted_saying(set, "pose not confirmed; no robot moves", SHOWS_POSE).await
        }
        Verb::Teleop(args) => commands::teleop::run(&ctx()?, &args).await,
        Verb::Top(args) => commands::top::run(&ctx()?, &args).await,
        Verb::Watch(args) => commands::watch::run(&ctx()?, &args).await,
        Verb::Record(args) => commands::record::run(&ctx()?, args).await,
        Verb::Play(args) => commands::play::run(&ctx()?, &args).await,
        Verb::Export(args) => commands::export::run(&ctx()?, &args),
        Verb::Traffic(args) => commands::traffic::run(&ctx()?, &args).await,
        Verb::Dispatch(args) => commands::dispatch::run(&ctx()?, &args).await,
        Verb::Tasks(args) => commands::tasks::run(&ctx()?, &args).await,
        Verb::Task(args) => or_interrupted(commands::task::run(&ctx()?, &args)).await,
        Verb::Cancel(args) => changing(commands::change::cancel(&ctx()?, args)).await,
        Verb::Pause(args) => changing(commands::change::pause(&ctx()?, args)).await,
        Verb::Resume(args) => changing(commands::change::resume(&ctx()?, args)).await,
        Verb::Retry(args) => changing(commands::change::retry(&ctx()?, args)).await,
        Verb::FetchLog(args) => commands::fetch_log::run(&ctx()?, &args).await,
        Verb::Map(args) => commands::map::run(&ctx()?, &args).await,
        Verb::Dashboard(args) => commands::dashboard::run(&ctx()?, &args).await,
        Verb::Router(args) => commands::router::run(&ctx()?, &args).await,
        Verb::Sim(args) => commands::sim::run(&ctx()?, args).await,
        Verb::Demo(args) => commands::demo::run(&ctx()?, args).await,
        Verb::Plan(args) => commands::plan::run(out, args).await,
        Verb::Names(args) => commands::names::run(&ctx()?, &args).await,
        Verb::Completions(args) => commands::completions::run(out, &args),
    }
}

async fn changing(command: impl Future<Output = Result<Exit>>) -> Result<Exit> {
    or_interrupted_saying(command, "change not confirmed", "`fleet-cli tasks` shows their state").await
}
