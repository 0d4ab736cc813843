//! `param`: settings of running robots: shown, changed, saved.

use crate::args::LeaseArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, Verbs, line_of};
use crate::output::{Output, Tone};
use crate::robots::once_each;
use crate::table::{Table, TableCell};
use clap::{ArgGroup, Args, Subcommand};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Duration;
use xtb_client::client::Client;
use xtb_client::multi_robot::in_turn;
use xtb_client::params::{self, resolve};
use xtb_client::text::robot::age;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{ParamChange, ParamInfo, ParamList, ParamValue, ParamWhen};

const HELP: &str = "\
NAME is the whole name of a setting, or its last part. A lower speed needs no control of the robot, as a stop needs \
none; every other change does. A change holds until the robot restarts, unless it is saved.

Examples:
  fleet-cli param list xtb-1
  fleet-cli param set limit_mps 0.2 --all       # a speed limit for the fleet
  fleet-cli param save xtb-1                    # into the robot's own settings file";

/// Arguments of `param`.
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP)]
pub struct ParamArgs {
    /// What to do.
    #[command(subcommand)]
    pub verb: ParamVerb,
}

/// What to do with settings.
#[derive(Debug, Clone, Subcommand)]
pub enum ParamVerb {
    /// List the settings that may change while a robot runs.
    List(ParamListArgs),
    /// Show one setting.
    Get(GetArgs),
    /// Change a setting.
    Set(SetArgs),
    /// Write changed settings into the robots' own settings files.
    Save(SaveArgs),
}

/// Of which robots.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("whose").args(["robots", "tag", "all"]).required(true))]
pub struct WhoseArgs {
    /// Robots.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// Robots with this tag in the roster.
    #[arg(long, value_name = "TAG")]
    pub tag: Option<String>,
    /// All robots present.
    #[arg(long)]
    pub all: bool,
}

/// Arguments of `param list`.
#[derive(Debug, Clone, Args)]
pub struct ParamListArgs {
    /// Of which robots.
    #[command(flatten)]
    pub whose: WhoseArgs,
    /// Show who changed what, and when, instead.
    #[arg(long)]
    pub history: bool,
}

/// Arguments of `param get`.
#[derive(Debug, Clone, Args)]
pub struct GetArgs {
    /// Setting.
    #[arg(value_name = "NAME")]
    pub name: String,
    /// Of which robots.
    #[command(flatten)]
    pub whose: WhoseArgs,
}

/// Arguments of `param set`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true)]
pub struct SetArgs {
    /// Setting.
    #[arg(value_name = "NAME")]
    pub name: String,
    /// Its new value, in its unit.
    #[arg(value_name = "VALUE")]
    pub value: f64,
    /// Of which robots.
    #[command(flatten)]
    pub whose: WhoseArgs,
    /// Control of the robots.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// Arguments of `param save`.
#[derive(Debug, Clone, Args)]
pub struct SaveArgs {
    /// Of which robots.
    #[command(flatten)]
    pub whose: WhoseArgs,
    /// Control of the robots.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// What came of it, by robot.
#[derive(Debug, Serialize, JsonSchema)]
struct Report {
    robots: BTreeMap<Name, RobotReport>,
}

/// The settings that were asked for, or why there are none.
#[derive(Debug, Serialize, JsonSchema)]
struct RobotReport {
    params: Vec<ParamInfo>,
    changes: Vec<ParamChange>,
    error: Option<Refused>,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Refused {
    code: String,
    message: String,
    hint: String,
}

/// What it prints with `--json`.
pub(super) const JSON: Verbs =
    &[("param list", LINES), ("param get", LINES), ("param set", LINES), ("param save", LINES)];
const LINES: &[LineKind] = &[line_of::<Report>];

/// Shows, changes or saves settings.
///
/// # Errors
/// No router, nobody to ask; of one robot alone also its refusal.
pub async fn run(ctx: &Context, args: &ParamArgs) -> Result<Exit> {
    let whose = match &args.verb {
        ParamVerb::List(args) => &args.whose,
        ParamVerb::Get(args) => &args.whose,
        ParamVerb::Set(args) => &args.whose,
        ParamVerb::Save(args) => &args.whose,
    };
    let client = Client::open(&ctx.settings).await?;
    let asking = async {
        let robots = robots(&client, whose).await?;
        let each = robots.iter().map(|robot| one(&client, robot, &args.verb));
        Ok::<_, Error>(robots.iter().cloned().zip(in_turn(each).await).collect::<Vec<_>>())
    };
    let asked = asking.await;
    client.close().await;
    let mut asked = asked?;
    if let [(_, Err(_))] = &asked[..]
        && let Some((_, Err(error))) = asked.pop()
    {
        return Err(error);
    }
    let exit = asked.iter().find_map(|(_, done)| done.as_ref().err().map(|error| Exit::from(error.kind)));
    let report = Report { robots: asked.into_iter().map(|(robot, done)| (robot, report(done))).collect() };
    let history = matches!(&args.verb, ParamVerb::List(args) if args.history);
    ctx.out.result(
        &report,
        |report| if history { changes(report, &ctx.out) } else { table(report, &ctx.out) },
    )?;
    Ok(exit.unwrap_or(Exit::Done))
}

async fn robots(client: &Client, whose: &WhoseArgs) -> Result<Vec<Name>> {
    if let Some(tag) = &whose.tag {
        let tag = tag.trim_start_matches('@');
        let roster = client.roster_entries(&[]).await?.unwrap_or_default();
        let bears = |tags: &[String]| tags.iter().any(|its| its.trim_start_matches('@') == tag);
        let robots: Vec<Name> =
            roster.into_iter().filter(|entry| bears(&entry.tags)).map(|entry| entry.name).collect();
        if robots.is_empty() {
            let message = format!("no robot of the roster has the tag {tag}");
            return Err(Error::new(ErrorKind::NoRobot, message).hint("`fleet-cli list` shows tags"));
        }
        return Ok(robots);
    }
    if whose.all {
        let robots: Vec<Name> = client.alive().await?.into_iter().collect();
        return if robots.is_empty() { Err(client.nobody()) } else { Ok(robots) };
    }
    Ok(once_each(&whose.robots))
}

async fn one(client: &Client, robot: &Name, verb: &ParamVerb) -> Result<ParamList> {
    let only = |list: ParamList, name: &str| {
        let params = list.params.into_iter().filter(|param| param.name == name).collect();
        ParamList { params, changes: list.changes }
    };
    match verb {
        ParamVerb::List(_) => params::list(client, robot).await,
        ParamVerb::Get(args) => {
            let list = params::list(client, robot).await?;
            let name = resolve(&list, &args.name)?.to_owned();
            Ok(only(list, &name))
        }
        ParamVerb::Set(args) => {
            let list = params::list(client, robot).await?;
            let name = resolve(&list, &args.name)?.to_owned();
            let value = ParamValue { name: name.clone(), value: args.value };
            Ok(only(params::set(client, robot, vec![value], args.lease.take).await?, &name))
        }
        ParamVerb::Save(args) => params::save(client, robot, args.lease.take).await,
    }
}

fn report(done: Result<ParamList>) -> RobotReport {
    match done {
        Ok(ParamList { params, changes }) => RobotReport { params, changes, error: None },
        Err(Error { kind, message, hint }) => {
            let error = Some(Refused { code: kind.code(), message, hint });
            RobotReport { params: Vec::new(), changes: Vec::new(), error }
        }
    }
}

fn refusal(robot: &Name, refused: &Refused, out: &Output) -> String {
    let hint = if refused.hint.is_empty() { String::new() } else { format!("\n  → {}", refused.hint) };
    format!("{}{hint}", out.paint(Tone::Bad, &format!("{robot}: {}", refused.message)))
}

fn table(report: &Report, out: &Output) -> String {
    let mut table = Table::new(&["robot", "setting", "value", "unit", "saved", "range", "changes"]);
    for (robot, of) in &report.robots {
        for param in &of.params {
            let is_saved = param.value == param.saved;
            let saved = if is_saved { String::new() } else { param.saved.to_string() };
            let when = match param.when {
                ParamWhen::Always => "always",
                ParamWhen::Standing => "while standing",
            };
            table.row(vec![
                TableCell::new(robot.as_str(), Tone::Strong),
                param.name.clone().into(),
                TableCell::new(param.value.to_string(), if is_saved { Tone::Plain } else { Tone::Warning }),
                param.unit.clone().into(),
                saved.into(),
                format!("{}..={}", param.min, param.max).into(),
                when.into(),
            ]);
        }
    }
    with_refusals(table.render(out), report, out)
}

fn changes(report: &Report, out: &Output) -> String {
    let mut table = Table::new(&["robot", "ago", "by", "setting", "from", "to"]);
    for (robot, of) in &report.robots {
        for change in &of.changes {
            table.row(vec![
                TableCell::new(robot.as_str(), Tone::Strong),
                age(Duration::from_millis(change.age_ms)).into(),
                change.by.to_string().into(),
                change.name.clone().into(),
                change.from.to_string().into(),
                change.to.to_string().into(),
            ]);
        }
    }
    if report.robots.values().all(|of| of.changes.is_empty() && of.error.is_none()) {
        return "nothing was changed since these robots started".to_owned();
    }
    with_refusals(table.render(out), report, out)
}

fn with_refusals(table: String, report: &Report, out: &Output) -> String {
    let refused = |(robot, of): (&Name, &RobotReport)| Some(refusal(robot, of.error.as_ref()?, out));
    let mut lines =
        if report.robots.values().any(|of| of.error.is_none()) { vec![table] } else { Vec::new() };
    lines.extend(report.robots.iter().filter_map(refused));
    lines.join("\n")
}
