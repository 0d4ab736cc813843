//! `doctor`: looks at router, roster, robots and what serves them all, and says what to do about what is
//! wrong.

mod checks;
mod clock;
mod finding;
mod fixes;
mod groups;
mod security;
mod services;

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use checks::Facts;
use clap::Args;
use clock::Mark;
use finding::{Finding, Level};
use fixes::FixBook;
use groups::grouped;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use xtb_bus::{Incoming, Subscription};
use xtb_client::Result;
use xtb_client::client::{Client, LastState};
use xtb_client::fleet_view::by_number;
use xtb_client::state_feed::StateFeed;
use xtb_client::{Action, ErrorKind};
use xtb_protocol::keys::{Key, RobotKeys};
use xtb_protocol::messages::{About, Body, Fix, Request, RobotState};
use xtb_protocol::{Name, Uuid};

/// Arguments of `doctor`.
#[derive(Debug, Clone, Args)]
pub struct DoctorArgs {
    /// Expected robots, separated by commas [default: the roster of the config or the simulator].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot)]
    pub expect: Vec<Name>,
}

/// Clocks are compared for this long at least; again while they seem to differ, which a busy network
/// can feign.
const COMPARE_FOR: Duration = Duration::from_secs(1);
/// How often at most.
const COMPARE_TIMES: u32 = 3;
/// How soon a robot that is there shows its state, 20 times a second.
const FIRST_STATE_WITHIN: Duration = Duration::from_secs(1);
/// Who else answers in a robot's name is heard this long after the first answer.
const LINGER: Duration = Duration::from_millis(200);
const LABEL_WIDTHS: [usize; 2] = [8, 9];

/// What was found, as `--json` prints it.
#[derive(Debug, Serialize, JsonSchema)]
struct Report {
    fleet: Name,
    problems: usize,
    warnings: usize,
    findings: Vec<Finding>,
}

impl Report {
    fn new(fleet: &Name, mut findings: Vec<Finding>) -> Self {
        for topic in findings.chunk_by_mut(|one, other| one.topic == other.topic) {
            topic.sort_by_cached_key(|it| (it.robot.is_none(), it.robot.as_ref().map(by_number)));
        }
        let count = |level| findings.iter().filter(|finding| finding.level == level).count();
        let (problems, warnings) = (count(Level::Problem), count(Level::Warning));
        Self { fleet: fleet.clone(), problems, warnings, findings }
    }
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Report>];

/// Checks everything. Problems make it [`Exit::Failed`], warnings do not.
///
/// # Errors
/// An endpoint that is none; a router that does not answer is a finding.
pub async fn run(ctx: &Context, args: &DoctorArgs) -> Result<Exit> {
    let began = Instant::now();
    let (opened, took) = (Client::open(&ctx.settings).await, began.elapsed());
    let mut security = security::look(&ctx.settings).await;
    let findings = match opened {
        Ok(client) => {
            let mut findings = vec![checks::router(&ctx.settings.connect, took)];
            findings.extend(client.not_admitted().await.as_ref().map(checks::no_router));
            let facts = gather(ctx, &client, args).await?;
            security.robots.clone_from(&facts.alive);
            security.answers_others = security::answers_others(&client, facts.alive.first()).await;
            client.close().await;
            findings.extend(security.findings());
            findings.extend(checks::all(&facts));
            findings
        }
        Err(error) if matches!(error.kind, ErrorKind::NoRouter | ErrorKind::NotAdmitted) => {
            let mut findings = vec![checks::no_router(&error)];
            findings.extend(security.findings());
            findings
        }
        Err(error) => return Err(error),
    };
    let report = Report::new(&ctx.settings.fleet, findings);
    ctx.out.result(&report, |report| text(report, &ctx.out))?;
    Ok(if report.problems == 0 { Exit::Done } else { Exit::Failed })
}

async fn gather(ctx: &Context, client: &Client, args: &DoctorArgs) -> Result<Facts> {
    let any = client.keys().any_robot();
    let services = services::Listening::begin(client).await?;
    let (alive, roster) = tokio::join!(client.alive(), client.roster_entries(&args.expect));
    let mut alive = alive?;
    // Not before: a question for presence right beside a subscription to it was seen to bring nothing.
    let feed = Arc::new(StateFeed::open(client, &any).await?);
    let fixes = listen_for_fixes(client, &feed).await?;
    let (mut abouts, mut unreadable) = (BTreeMap::<Name, Vec<About>>::new(), BTreeMap::new());
    for answer in client.get_each(RobotKeys::about, &alive).await? {
        let Some(robot) = Key::parse(&answer.key).and_then(|key| key.robot) else { continue };
        match answer.decode::<About>() {
            Ok(about) => abouts.entry(robot).or_default().push(about),
            Err(error) => drop(unreadable.insert(robot, error.to_string())),
        }
    }
    // Asked, not only listened to: two robots of one name both answer.
    let mut epochs = BTreeMap::<Name, BTreeSet<u64>>::new();
    for answer in client.get_each(RobotKeys::state, &alive).await? {
        let Some(robot) = Key::parse(&answer.key).and_then(|key| key.robot) else { continue };
        match answer.decode::<RobotState>() {
            Ok(state) => drop(epochs.entry(robot).or_default().insert(state.epoch)),
            Err(error) => drop(unreadable.insert(robot, error.to_string())),
        }
    }
    for (robot, abouts) in &abouts {
        epochs.entry(robot.clone()).or_default().extend(abouts.iter().map(|about| about.epoch));
    }
    alive.extend(feed.alive());
    let (voices, answered_for_nobody) = tokio::join!(voices(client, &alive), answered_for_nobody(client));
    let rates = clock_rates(&feed, &alive, &abouts).await;
    let states = feed.states().into_iter().filter_map(|(name, seen)| Some((name, seen.fresh()?.clone())));
    let states = states.collect();
    let fixes = fixes.book();
    Ok(Facts {
        connected: ctx.settings.connect.join(", "),
        services: services.end(client, ctx.settings.timeout).await?,
        simulator: client.sim_stats().await?,
        simulated: client.simulated().await?.into_iter().flatten().map(|entry| entry.name).collect(),
        fleet: ctx.settings.fleet.clone(),
        roster: roster?,
        alive,
        abouts,
        unreadable,
        epochs,
        voices,
        answered_for_nobody,
        states,
        rates,
        fixes,
    })
}

/// Fixes as they come in, beside what the robots say of themselves.
struct FixEar {
    book: Arc<Mutex<FixBook>>,
    _fixes: Subscription,
}

impl FixEar {
    fn book(&self) -> FixBook {
        self.book.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

async fn listen_for_fixes(client: &Client, feed: &Arc<StateFeed>) -> Result<FixEar> {
    let book = Arc::new(Mutex::new(FixBook::default()));
    let (heard, feed) = (Arc::clone(&book), Arc::clone(feed));
    let each = move |incoming: Incoming| {
        let Some(robot) = Key::parse(&incoming.key).and_then(|key| key.robot) else { return };
        let Ok(fix) = incoming.decode::<Fix>() else { return };
        let states = feed.states().into_iter();
        let states = states.filter_map(|(name, seen)| Some((name, seen.fresh()?.clone()))).collect();
        heard.lock().unwrap_or_else(PoisonError::into_inner).hear(&robot, &fix, &states);
    };
    let _fixes = client.bus().subscribe(&client.keys().any_robot().fix(), each).await?;
    Ok(FixEar { book, _fixes })
}

/// How many programs answer each robot's commands. (What is asked, to retain a lease that nobody holds, is refused
/// and changes nothing.)
async fn voices(client: &Client, alive: &BTreeSet<Name>) -> BTreeMap<Name, usize> {
    // Who may not command gets no answer: nothing can be said of it then.
    if client.may(Action::Drive).is_err() {
        return BTreeMap::new();
    }
    let mut asking = JoinSet::new();
    for robot in alive {
        let (client, robot) = (client.clone(), robot.clone());
        asking.spawn(async move { (robot.clone(), answers_to_a_command(&client, &robot).await) });
    }
    asking.join_all().await.into_iter().collect()
}

/// Whether somebody answers the commands to a robot that is not there.
async fn answered_for_nobody(client: &Client) -> bool {
    if client.may(Action::Drive).is_err() {
        return false;
    }
    let invented = format!("nobody-{}", &Uuid::new_v4().simple().to_string()[..12]);
    match Name::robot(&invented) {
        Ok(robot) => answers_to_a_command(client, &robot).await > 0,
        Err(_) => false,
    }
}

async fn answers_to_a_command(client: &Client, robot: &Name) -> usize {
    let request = Request { id: Uuid::new_v4(), lease: None, body: Body::Retain {} };
    let (keys, within) = (client.keys().robot(robot), client.patience());
    let heard = client.bus().ask_all(&keys, client.name(), &request, within, LINGER).await;
    heard.map_or(0, |replies| replies.len())
}

/// How fast each robot's clock runs beside ours; `None` = it was not heard twice, or has restarted.
async fn clock_rates(
    feed: &StateFeed,
    alive: &BTreeSet<Name>,
    abouts: &BTreeMap<Name, Vec<About>>,
) -> BTreeMap<Name, Option<f64>> {
    let all_heard = async {
        while !alive.iter().all(|robot| feed.last(robot).is_some()) {
            feed.news().await;
        }
    };
    // Who is not heard by then is found to be silent.
    let _ = tokio::time::timeout(FIRST_STATE_WITHIN, all_heard).await;
    let first = feed.states();
    let mark = |seen: &LastState| Mark::of(seen.at, &seen.state);
    let mut rates = BTreeMap::new();
    for _ in 0..COMPARE_TIMES {
        tokio::time::sleep(COMPARE_FOR).await;
        rates = alive
            .iter()
            .map(|robot| {
                let last = feed.last(robot);
                let rate =
                    first.get(robot).zip(last).and_then(|(first, last)| mark(&last).rate_since(&mark(first)));
                (robot.clone(), rate)
            })
            .collect();
        let simulated = |robot: &Name| abouts.get(robot).is_some_and(|abouts| checks::is_simulated(abouts));
        let off = |(robot, rate): (&Name, &Option<f64>)| {
            !simulated(robot) && rate.is_some_and(|rate| !checks::keeps_step(rate))
        };
        if !rates.iter().any(off) {
            break;
        }
    }
    rates
}

fn text(report: &Report, out: &Output) -> String {
    let [level_width, topic_width] = LABEL_WIDTHS;
    let mut lines = Vec::new();
    for group in grouped(&report.findings) {
        let finding = group.first;
        let (word, tone) = match finding.level {
            Level::Ok => ("ok", Tone::Good),
            Level::Warning => ("warning", Tone::Warning),
            Level::Problem => ("problem", Tone::Bad),
        };
        let word = out.paint(tone, &format!("{word:level_width$}"));
        let topic = out.paint(Tone::Dim, &format!("{:topic_width$}", finding.topic));
        lines.push(format!("{word} {topic} {}", group.text()));
        if let Some(hint) = group.hint() {
            let indent = level_width + topic_width + 1;
            lines.push(format!("{:indent$} {}", "", out.paint(Tone::Dim, &format!("→ {hint}"))));
        }
    }
    let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    lines.push(format!("{}, {}", count(report.problems, "problem"), count(report.warnings, "warning")));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::{FakeDispatcher, FakeDispatcherState, FakeRobot, name, task};
    use xtb_protocol::codec::Format;
    use xtb_protocol::keys::Channel;
    use xtb_protocol::messages::{DispatchOutcome, DispatchStatus, FixSource, Latch, TaskState};

    #[test]
    fn a_finding_of_many_robots_is_one_line_and_one_of_the_fleet_stays_its_own() {
        let same = |robot: &str| Finding::warning("versions", "old", "update").of(&name(robot));
        let robots: Vec<String> = (1..=10).map(|n| format!("xtb-{n}")).collect();
        let mut findings: Vec<Finding> = robots.iter().map(|robot| same(robot)).collect();
        findings.insert(3, Finding::warning("versions", "older", "update").of(&name("xtb-99")));
        findings.push(Finding::warning("versions", "old", "update"));
        let text = text(&Report::new(&name("lab"), findings), &Output { json: false, colors: false });
        let first: Vec<&str> = text.lines().step_by(2).collect();
        let names = robots[..8].join(", ");
        assert_eq!(
            first,
            [
                format!("warning  versions  {names} and 2 more: old").as_str(),
                "warning  versions  xtb-99: older",
                "warning  versions  old",
                "0 problems, 12 warnings"
            ]
        );
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_missing_and_a_latched_robot_are_found_with_what_to_do() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        robot.lock().state.latches = vec![xtb_client::fake::latch(Latch::Estop, "cli-1", false)];
        let args = DoctorArgs { expect: vec![name("xtb-1"), name("xtb-2")] };
        let facts = gather(&Context::of(&client), &client, &args).await.unwrap();
        let rate = facts.rates[&name("xtb-1")].unwrap();
        assert!((0.5..1.5).contains(&rate), "{rate}");
        let report = Report::new(&name("lab"), checks::all(&facts));
        let text = text(&report, &Output { json: false, colors: false });
        assert!(text.contains("problem  roster    xtb-2: missing"), "{text}");
        assert!(text.contains("problem  latches   xtb-1: estop by cli-1"), "{text}");
        assert!(text.contains("→ `fleet-cli why xtb-1`"), "{text}");
        assert!(text.contains("ok       versions"), "{text}");
        assert!(report.problems >= 2 && text.ends_with("warnings"), "{text}");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn tasks_of_all_pages_are_counted() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let _robot = FakeRobot::start(&client, "xtb-1").await;
        let (ledger_failed, map) = (None, None);
        let status =
            DispatchStatus { ledger: 1, ledger_failed, map, tasks: 7, open: 6, assigned: 0, robots: 1 };
        let told = FakeDispatcherState {
            answers: [Some(DispatchOutcome::Status(status))].into(),
            tasks: (1..=7).map(|number| task(number, TaskState::Queued)).collect(),
            page: Some(2),
            ..FakeDispatcherState::default()
        };
        let _dispatcher = FakeDispatcher::start(&client, told).await;
        let facts = gather(&Context::of(&client), &client, &DoctorArgs { expect: Vec::new() }).await.unwrap();
        let report = Report::new(&name("lab"), checks::all(&facts));
        let text = text(&report, &Output { json: false, colors: false });
        assert!(text.contains("6 of 7 tasks are open"), "{text}");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn two_robots_whose_fixes_are_crossed_are_found() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robots = [("xtb-1", 0.0), ("xtb-2", 4.0)];
        let mut fakes = Vec::new();
        let mut senders = Vec::new();
        for (robot, x_m) in robots {
            let fake = FakeRobot::start(&client, robot).await;
            fake.lock().state.pose.x_m = x_m;
            fakes.push(fake);
            let key = client.keys().robot(&name(robot)).fix();
            senders.push(client.bus().publisher::<Fix>(&key, &Channel::Fix, Format::Json).await.unwrap());
        }
        let sending = tokio::spawn(async move {
            let mut tick = tokio::time::interval(Duration::from_millis(100));
            loop {
                tick.tick().await;
                for (sender, x_m) in senders.iter().zip([4.0, 0.0]) {
                    let fix = Fix {
                        x_m,
                        y_m: 0.0,
                        yaw_rad: None,
                        sigma_m: 0.05,
                        sigma_yaw_rad: 0.05,
                        source: FixSource::MotionCapture,
                        age_ms: 0,
                    };
                    sender.put(&fix).await.unwrap();
                }
            }
        });
        let args = DoctorArgs { expect: vec![name("xtb-1"), name("xtb-2")] };
        let facts = gather(&Context::of(&client), &client, &args).await.unwrap();
        sending.abort();
        let report = Report::new(&name("lab"), checks::all(&facts));
        let text = text(&report, &Output { json: false, colors: false });
        for (robot, other) in [("xtb-1", "xtb-2"), ("xtb-2", "xtb-1")] {
            let crossed = format!("problem  fixes     {robot}: its fixes and those of {other} are swapped");
            assert!(text.contains(&crossed), "{text}");
        }
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_answers_in_the_name_of_robots_is_found() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let _robot = FakeRobot::start(&client, "xtb-1").await;
        let other = client.another().await;
        let _shadow = xtb_client::fake::yes_man(&other).await;
        let facts = gather(&Context::of(&client), &client, &DoctorArgs { expect: Vec::new() }).await.unwrap();
        let report = Report::new(&name("lab"), checks::all(&facts));
        let text = text(&report, &Output { json: false, colors: false });
        assert!(text.contains("problem  names     xtb-1: 2 programs answer its commands"), "{text}");
        assert!(
            text.contains("problem  names     a program answers commands to robots that are not present")
        );
    }
}
