//! One verb a file: its arguments, then what it does. A new verb is a file and its lines here.

pub mod alerts;
pub mod audit;
pub mod change;
pub mod completions;
pub mod dashboard;
pub mod demo;
pub mod dispatch;
pub mod doctor;
pub mod enrol;
pub mod estop;
pub mod events;
pub mod export;
pub mod extend;
pub mod fetch_log;
mod goal;
pub mod goto;
pub mod home;
pub mod list;
pub mod man;
pub mod map;
pub mod names;
pub mod param;
pub mod pki;
pub mod place;
pub mod plan;
pub mod play;
pub mod record;
pub mod report;
pub mod reset;
pub mod rights;
pub mod router;
pub mod schema;
pub mod set_pose;
pub mod sim;
pub mod status;
pub mod stop;
mod stopped;
pub mod task;
pub mod tasks;
pub mod teleop;
pub mod top;
pub mod traffic;
mod unknown_robots;
pub mod vda5050;
pub mod wander;
pub mod watch;
pub mod why;

use crate::args::GlobalArgs;
use crate::context::{Context, Uses};
use crate::exit::Exit;
use crate::interrupt::{or_interrupted, or_interrupted_saying};
use crate::output::{Output, ProgressLine};
use clap::Subcommand;
use rights::Rights;
use std::sync::OnceLock;
use xtb_client::DispatcherClient;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_protocol::Name;

const SHOWS_POSE: &str = "`fleet-cli status ROBOT` shows the pose";
const SHOWS_STANDSTILL: &str = "`fleet-cli list` shows which robots are stopped or latched";

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// List the robots and their state.
    List(list::ListArgs),
    /// Show the state of robots in detail.
    Status(status::StatusArgs),
    /// Explain why a robot is stopped, or is allowed to drive, and what to do.
    Why(why::WhyArgs),
    /// Check router, roster, versions, clocks and configs, and show what to do.
    Doctor(doctor::DoctorArgs),
    /// Send robots to a point on the map.
    Goto(goto::GotoArgs),
    /// Make robots wander.
    Wander(wander::WanderArgs),
    /// Send robots to docks or parking places now.
    Home(home::HomeArgs),
    /// Stop robots: cancels their goals.
    Stop(stop::StopArgs),
    /// Emergency stop: robots stay stopped until they are reset (not a safety-rated stop).
    Estop(estop::EstopArgs),
    /// Reset latched stops whose cause is gone; robots stay stopped until a new command.
    Reset(reset::ResetArgs),
    /// Set the pose of stopped robots when it is uncertain or wrong.
    SetPose(set_pose::SetPoseArgs),
    /// Show, change and save settings of running robots, such as a speed limit.
    Param(param::ParamArgs),
    /// Drive a robot by hand.
    Teleop(teleop::TeleopArgs),
    /// Full-screen view of the fleet: map, robots, events; keys send, stop and drive.
    Top(top::TopArgs),
    /// Print messages as JSON lines.
    Watch(watch::WatchArgs),
    /// Record the fleet's messages into MCAP, for Foxglove, Python, `play` and `export`.
    Record(record::RecordArgs),
    /// Play back a recording of the fleet.
    Play(play::PlayArgs),
    /// Export a recording of the fleet as tables.
    Export(export::ExportArgs),
    /// Show who commanded what and when, by name, from recordings and the dispatcher's ledger.
    Audit(audit::AuditArgs),
    /// Download a recording from a robot.
    FetchLog(fetch_log::FetchLogArgs),
    /// Show, check, import or serve a map.
    Map(map::MapArgs),
    /// Named points of the map: list, add and remove them.
    Place(place::PlaceArgs),
    /// Traffic control: coordinate robots with planned goals.
    Traffic(traffic::TrafficArgs),
    /// Dispatcher: accept tasks for the fleet and assign them to its robots.
    Dispatch(dispatch::DispatchArgs),
    /// VDA 5050: show the robots to a master control over MQTT, and carry out its orders.
    #[command(name = "vda5050")]
    Vda5050(vda5050::Vda5050Args),
    /// Show the dispatcher's tasks.
    Tasks(tasks::TasksArgs),
    /// Show one task and its history.
    Task(task::TaskArgs),
    /// Cancel tasks; the answer comes when their robots have confirmed.
    Cancel(change::CancelArgs),
    /// Pause tasks; their robots stop.
    Pause(change::PauseArgs),
    /// Resume tasks that are paused or on hold.
    Resume(change::ResumeArgs),
    /// Queue failed or cancelled tasks again.
    Retry(change::RetryArgs),
    /// Add points to a route that has not ended.
    Extend(extend::ExtendArgs),
    /// Show what needs a person, and acknowledge it.
    Alerts(alerts::AlertsArgs),
    /// Show what happened in the fleet, from the dispatcher's history.
    Events(events::EventsArgs),
    /// Show what each robot did on a day: metres, hours, tasks, stops, battery.
    Report(report::ReportArgs),
    /// Show and control the fleet in a browser.
    Dashboard(dashboard::DashboardArgs),
    /// Make, renew and revoke identities: who belongs to the fleet.
    Pki(pki::PkiArgs),
    /// Enrol this computer with an identity file.
    Enrol(enrol::EnrolArgs),
    /// Run a router: the only infrastructure that a small lab needs.
    Router(router::RouterArgs),
    /// Run simulated robots with real agents.
    Sim(sim::SimArgs),
    /// Show simulated robots driving to their goals.
    Demo(demo::DemoArgs),
    /// Plan collision-free paths for many robots at once, without a fleet.
    Plan(plan::PlanArgs),
    /// Write the manual pages into a folder.
    Man(man::ManArgs),
    /// Print what the lines of a verb with --json hold, as JSON Schema.
    Schema(schema::SchemaArgs),
    /// Print a completion script; in bash, fish and zsh it completes the names of robots and tasks.
    Completions(completions::CompletionsArgs),
    /// Print the names of robots or tasks, for completion scripts.
    #[command(hide = true)]
    Names(names::NamesArgs),
}

impl Verb {
    /// What becomes of this computer's identity.
    fn uses_identity(&self) -> Uses {
        match self {
            Self::Pki(_) | Self::Enrol(_) | Self::Play(_) | Self::Export(_) | Self::Router(_) => {
                Uses::Nothing
            }
            Self::Map(args) if !args.needs_session() => Uses::Nothing,
            Self::Place(args) if !args.needs_session() => Uses::Nothing,
            Self::Sim(args) if args.identities.is_some() => Uses::Nothing,
            Self::Sim(_) | Self::Demo(_) => Uses::IfAsked,
            Self::Doctor(_) => Uses::Unchecked,
            Self::Dispatch(args) if !args.needs_session() => Uses::Unchecked,
            _ => Uses::Always,
        }
    }
}

/// Carries out one verb; `grammar` is the whole command line's, for completions.
///
/// # Errors
/// What the verb says.
pub async fn run(verb: Verb, global: &GlobalArgs, grammar: clap::Command, out: Output) -> Result<Exit> {
    let (rights, settings) = (Rights::of(&verb), OnceLock::new());
    // Not before a verb asks for it: completions must not fail over a broken config.
    let uses = verb.uses_identity();
    let ctx = || {
        let ctx = Context::new(global, uses, out)?;
        rights.check(&ctx.settings)?;
        settings.get_or_init(|| ctx.settings.clone());
        Ok(ctx)
    };
    let done = carry_out(verb, ctx, grammar, out).await;
    match (done, settings.get()) {
        (Err(error), Some(settings)) => Err(rights::explained(settings, error).await),
        (done, _) => done,
    }
}

async fn carry_out(
    verb: Verb,
    ctx: impl Fn() -> Result<Context>,
    grammar: clap::Command,
    out: Output,
) -> Result<Exit> {
    match verb {
        Verb::List(args) => or_interrupted(list::run(&ctx()?, &args)).await,
        Verb::Status(args) if args.watch => status::run(&ctx()?, &args).await,
        Verb::Status(args) => or_interrupted(status::run(&ctx()?, &args)).await,
        Verb::Why(args) => or_interrupted(why::run(&ctx()?, &args)).await,
        Verb::Doctor(args) => or_interrupted(doctor::run(&ctx()?, &args)).await,
        Verb::Goto(args) => goto::run(&ctx()?, args).await,
        Verb::Wander(args) => wander::run(&ctx()?, args).await,
        Verb::Home(args) => home::run(&ctx()?, &args).await,
        Verb::Stop(args) => {
            let ctx = ctx()?;
            let stop = stop::run(&ctx, &args);
            or_interrupted_saying(stop, "stop not confirmed", SHOWS_STANDSTILL).await
        }
        Verb::Estop(args) => {
            let ctx = ctx()?;
            let estop = estop::run(&ctx, &args);
            or_interrupted_saying(estop, "stop not confirmed", estop::MAY_DRIVE).await
        }
        Verb::Reset(args) => {
            let ctx = ctx()?;
            let reset = reset::run(&ctx, &args);
            or_interrupted_saying(reset, "reset not confirmed; no robot moves", SHOWS_STANDSTILL).await
        }
        Verb::SetPose(args) => {
            let ctx = ctx()?;
            let set = set_pose::run(&ctx, &args);
            or_interrupted_saying(set, "pose not confirmed; no robot moves", SHOWS_POSE).await
        }
        Verb::Param(args) => {
            let ctx = ctx()?;
            let param = param::run(&ctx, &args);
            or_interrupted_saying(param, "settings not confirmed", "`fleet-cli param list` shows them").await
        }
        Verb::Teleop(args) => teleop::run(&ctx()?, &args).await,
        Verb::Top(args) => top::run(&ctx()?, &args).await,
        Verb::Watch(args) => watch::run(&ctx()?, &args).await,
        Verb::Record(args) => record::run(&ctx()?, args).await,
        Verb::Play(args) => play::run(&ctx()?, &args).await,
        Verb::Export(args) => export::run(&ctx()?, &args),
        Verb::Audit(args) => audit::run(&ctx()?, &args),
        Verb::Traffic(args) => traffic::run(&ctx()?, &args).await,
        Verb::Dispatch(args) => dispatch::run(&ctx()?, &args).await,
        Verb::Vda5050(args) => vda5050::run(&ctx()?, &args).await,
        Verb::Tasks(args) => tasks::run(&ctx()?, &args).await,
        Verb::Task(args) => or_interrupted(task::run(&ctx()?, &args)).await,
        Verb::Cancel(args) => changing(change::cancel(&ctx()?, args)).await,
        Verb::Pause(args) => changing(change::pause(&ctx()?, args)).await,
        Verb::Resume(args) => changing(change::resume(&ctx()?, args)).await,
        Verb::Retry(args) => changing(change::retry(&ctx()?, args)).await,
        Verb::Extend(args) => changing(extend::run(&ctx()?, args)).await,
        Verb::Alerts(args) if args.watch => alerts::watch(&ctx()?, &args).await,
        Verb::Alerts(args) => or_interrupted(alerts::run(&ctx()?, &args)).await,
        Verb::Events(args) => events::run(&ctx()?, &args).await,
        Verb::Report(args) => or_interrupted(report::run(&ctx()?, &args)).await,
        Verb::FetchLog(args) => fetch_log::run(&ctx()?, &args).await,
        Verb::Map(args) => map::run(&ctx()?, &args).await,
        Verb::Place(args) => or_interrupted(place::run(&ctx()?, &args)).await,
        Verb::Dashboard(args) => dashboard::run(&ctx()?, &args).await,
        Verb::Pki(args) => pki::run(&ctx()?, &args),
        Verb::Enrol(args) => enrol::run(&ctx()?, &args),
        Verb::Router(args) => router::run(&ctx()?, &args).await,
        Verb::Sim(args) => sim::run(&ctx()?, args).await,
        Verb::Demo(args) => demo::run(&ctx()?, args).await,
        Verb::Plan(args) => plan::run(out, args).await,
        Verb::Names(args) => names::run(&ctx()?, &args).await,
        Verb::Schema(args) => schema::run(out, &args),
        Verb::Man(args) => man::run(out, &args, grammar),
        Verb::Completions(args) => completions::run(out, &args, grammar),
    }
}

async fn changing(command: impl Future<Output = Result<Exit>>) -> Result<Exit> {
    or_interrupted_saying(command, "change not confirmed", "`fleet-cli tasks` shows their state").await
}

/// Acquires control, and says from whom it was taken.
async fn take_control(ctx: &Context, client: &Client, robot: &Name, take: bool) -> Result<Control> {
    let control = Control::acquire(client, robot, take).await?;
    if let Some(holder) = control.taken_from().filter(|_| !ctx.out.json) {
        ctx.out.note(&format!("took control of {robot} from {holder}"));
    }
    Ok(control)
}

/// The fleet's dispatcher; who has to wait for it is told.
fn dispatcher(client: &Client) -> DispatcherClient<'_> {
    DispatcherClient::of(client).saying(|what| {
        let mut progress = ProgressLine::new();
        progress.show(what);
        Box::new(progress)
    })
}
