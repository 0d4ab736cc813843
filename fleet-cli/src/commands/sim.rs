//! `sim`: simulated trucks with real agents, until Ctrl-C.

pub(crate) mod embedded;
mod fault_scenario;
mod identities;
mod ready;
mod world;

pub(crate) use world::read_world;

use super::dashboard;
use crate::commands::dashboard::DashboardArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::text::task as task_text;
use crate::values::{drop_outs, fix_noise, fix_rate, part, ros_domain};
use crate::vehicle_file;
use clap::Args;
use embedded::EmbeddedDispatcher;
use identities::Identities;
use ready::{Found, announce};
use schemars::JsonSchema;
use serde::Serialize;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::pin::pin;
use tokio::sync::watch;
use xtb_client::DEFAULT_ENDPOINT;
use xtb_client::client::Client;
use xtb_client::text::robot as describe;
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::Role;
use xtb_protocol::messages::Suspension;
use xtb_services::dispatch::store::{self, Store};
use xtb_services::dispatch::usage::Usage;
use xtb_services::ros2::FleetNode;
use xtb_services::router::check_listen;
use xtb_sim::{Pace, VehicleFile, World};
use xtb_simulator::{BoardFirmware, LatestStats, SimulationPlan, Simulator};

/// Arguments of `sim`.
#[derive(Debug, Clone, Args)]
pub struct SimArgs {
    /// Number of robots: xtb-1 … xtb-N, at most 1000.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub robots: usize,
    /// Number of the first robot, if another simulator (--connect) has the robots before it, in the same world.
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "pty")]
    pub first: usize,
    /// Number of robots of all simulators of this world, the same for each of them; their robots meet
    /// [default: those of this one and the ones before].
    #[arg(long, value_name = "N", conflicts_with = "pty")]
    pub fleet_size: Option<usize>,
    /// World (TOML), or a map of ROS (map_server YAML) [default: an empty room].
    #[arg(long, value_name = "FILE")]
    pub world: Option<PathBuf>,
    /// Vehicle settings of the trucks, such as configs/vehicles/long.toml; `vehicles` in the world file take
    /// precedence [default: the XTB].
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<PathBuf>,
    /// Random seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Speed factor relative to real time.
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    pub speed: f64,
    /// Stop with exit code 1 when the simulation runs slower than 0.9 of --speed: the computer is too slow
    /// for it. Without this the simulator only prints a warning; its robots run in simulated time, clients do
    /// not.
    #[arg(long)]
    pub strict: bool,
    /// Endpoint of its router [default: tcp/127.0.0.1:7447, with --identities tls/127.0.0.1:7447]; with --connect
    /// it runs no router.
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Option<String>,
    /// Listen without identities also where other computers can reach it.
    #[arg(long)]
    pub insecure: bool,
    /// Run under identities: router, agents and services over TLS, with the set in this folder, which is made if
    /// the folder is empty. It is for trials: all its keys are in one place. `--identity DIR/operator` and
    /// `--identity DIR/viewer` use it.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["insecure", "pty"])]
    pub identities: Option<PathBuf>,
    /// Start no agents; create two serial ports for each truck instead: DIR/ROBOT.board and DIR/ROBOT.gyro.
    #[arg(long, value_name = "DIR")]
    pub pty: Option<PathBuf>,
    /// Run this firmware on the trucks' I/O boards: the ELF file that `cargo xtask uf2` builds, each in an
    /// emulator. Needs Node 18; one robot keeps about one core busy.
    #[arg(long, value_name = "ELF")]
    pub board_firmware: Option<PathBuf>,
    /// Folder of the emulator.
    #[arg(
        long,
        value_name = "DIR",
        default_value = "robot-agent/firmware/emulator",
        requires = "board_firmware"
    )]
    pub emulator: PathBuf,
    /// Write the ground truth to this file at board rate, as JSON lines.
    #[arg(long, value_name = "FILE")]
    pub truth_log: Option<PathBuf>,
    /// Record every sample, command and decision of each robot to DIR/ROBOT-….mcap.
    #[arg(long, value_name = "DIR", conflicts_with = "pty")]
    pub record: Option<PathBuf>,
    /// Also run a dispatcher (with traffic control), and print a summary for each robot at the end.
    #[arg(long)]
    pub dispatch: bool,
    /// The dispatcher's ledger [default: FLEET.ledger in $XDG_DATA_HOME/xtb/sim or ~/.local/share/xtb/sim].
    #[arg(long, value_name = "FILE", requires = "dispatch")]
    pub ledger: Option<PathBuf>,
    /// With --dispatch: start a new ledger; an existing one is kept as NAME.before-TIME.ledger.
    #[arg(long, requires = "dispatch")]
    pub fresh: bool,
    /// With --dispatch: send robots to docks of the world when their battery gets low, and back to work [default: if
    /// the fleet config has a section home].
    #[arg(long, requires = "dispatch")]
    pub home: bool,
    /// Stop when all tasks have ended (at least one); exit code 1 if a task failed or a truck had a contact.
    #[arg(long, requires = "dispatch")]
    pub until_done: bool,
    /// Also serve the dashboard [default: 127.0.0.1:8080].
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", value_parser = crate::commands::dashboard::address)]
    pub dashboard: Option<SocketAddr>,
    /// Robots and fleet are also nodes of ROS 2, in this ROS_DOMAIN_ID [default: 0]; with another --speed than 1
    /// also /clock.
    #[arg(long, value_name = "DOMAIN", num_args = 0..=1, default_missing_value = "0", value_parser = ros_domain(), conflicts_with = "pty")]
    pub ros2: Option<u32>,
    /// What measures the robots' poses.
    #[command(flatten)]
    pub fixes: FixArgs,
    /// Run a fault scenario of a virtual fleet, without router and agents: prints the events of the scenario
    /// of
    /// --seed, and whether a rule of docs/safety.md was broken.
    #[arg(long = "virtual", conflicts_with_all = ["robots", "first", "fleet_size", "world", "vehicle", "speed", "strict", "listen", "identities", "pty", "board_firmware", "truth_log", "record", "dispatch", "dashboard", "ros2"])]
    pub virtual_day: bool,
}

/// A simulated tracker that measures where the robots are.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Pose fixes")]
pub struct FixArgs {
    /// Pose fixes per second; 0 = none: odometry only, which drifts.
    #[arg(long = "fixes", value_name = "HZ", default_value_t = 2.0, value_parser = fix_rate)]
    pub rate_hz: f64,
    /// Standard deviation of the pose fixes, in m.
    #[arg(long = "fix-noise", value_name = "METRES", default_value_t = 0.05, value_parser = fix_noise)]
    pub noise_m: f64,
    /// Fraction of pose fixes that are outliers, 0 to 1.
    #[arg(long = "fix-outliers", value_name = "FRACTION", default_value_t = 0.0, value_parser = part)]
    pub outliers: f64,
    /// Mean time between drop-outs of the pose fixes (about 5 s each), in s; 0 = none.
    #[arg(long = "fix-drop-outs", value_name = "SECONDS", default_value_t = 0.0, value_parser = drop_outs)]
    pub drop_out_every_s: f64,
}

impl FixArgs {
    /// As the simulator takes it.
    #[must_use]
    pub fn truth(self) -> xtb_sim::fixes::FixTruth {
        let Self { rate_hz, noise_m, outliers, drop_out_every_s } = self;
        xtb_sim::fixes::FixTruth { rate_hz, noise_m, outliers, drop_out_every_s, ..Default::default() }
    }
}

/// What helps an overloaded simulator.
const TOO_SLOW: &str = "use fewer --robots, a lower --speed, or a faster computer";

/// What came of the tasks, said at the end of a simulation with a dispatcher.
#[derive(Debug, Serialize, JsonSchema)]
struct Ended {
    open: u64,
    tasks: u64,
    suspended: Vec<Suspension>,
    contacts: u64,
    simulated_s: f64,
    #[serde(flatten)]
    usage: Usage,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] =
    &[line_of::<ready::Ready<'_>>, line_of::<Ended>, line_of::<fault_scenario::Scenario>];

/// Runs the simulator until it is interrupted.
///
/// # Errors
/// An impossible plan or world, a port that is taken, a folder or file that cannot be written.
pub async fn run(ctx: &Context, args: SimArgs) -> Result<Exit> {
    if args.virtual_day {
        return fault_scenario::tell(ctx, args.seed);
    }
    if ctx.connect_given && args.listen.is_some() {
        return Err(Error::new(ErrorKind::Invalid, "--listen and --connect exclude each other")
            .hint("--connect uses a router that runs elsewhere, --listen starts one here"));
    }
    if let Some(unused) = ctx.unused_routers("sim") {
        ctx.out.note(&unused);
    }
    let listen = listen(ctx, &args)?;
    let set =
        args.identities.as_deref().map(|folder| Identities::prepare(ctx, folder, &listen)).transpose()?;
    let plan = plan(ctx, &args, listen, set.as_ref())?;
    let ledger =
        args.dispatch.then(|| store::simulated(args.ledger.as_deref(), &ctx.settings.fleet)).transpose()?;
    let open = |path: &Path| match args.fresh {
        true => Store::fresh(path, &ctx.settings.fleet),
        false => Store::open(path, &ctx.settings.fleet),
    };
    let store = ledger.as_deref().map(open).transpose()?;
    let set_aside = store.as_ref().and_then(|store| store.set_aside.clone());
    let mut stop = pin!(interrupted());
    let simulator = tokio::select! {
        begun = Simulator::begin(plan) => begun?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let mut slow = pin!(pace(ctx, simulator.stats(), args.strict));
    let starting = async {
        simulator.ready().await?;
        let ros2 = match args.ros2 {
            Some(domain) => Some(fleet_node(ctx, &simulator, set.as_ref(), domain, args.speed).await?),
            None => None,
        };
        let dispatcher = match store {
            Some(store) => {
                let ctx = identities::of(ctx, set.as_ref(), Role::Dispatcher)?;
                Some(EmbeddedDispatcher::start(&ctx, &simulator, store, ctx.home_rules(args.home)).await?)
            }
            None => None,
        };
        Ok((dispatcher, ros2))
    };
    let started = tokio::select! {
        started = starting => started,
        slow = &mut slow => Err(slow),
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let (mut dispatcher, ros2) = match started {
        Ok(started) => started,
        Err(failure) => {
            simulator.stop().await;
            return Err(failure);
        }
    };
    if let Some(set) = &set {
        set.moved(simulator.endpoints())?;
    }
    let found = Found {
        identities: set.as_ref().map(Identities::folder),
        ledger,
        set_aside,
        standing: dispatcher.as_ref().map(EmbeddedDispatcher::standing),
    };
    announce(ctx, &simulator, args.speed, args.pty.as_deref(), &found)?;
    let done = tokio::select! {
        done = until_done(dispatcher.as_mut(), args.until_done) => Some(done),
        taken = simulator.names_taken() => Some(Err(taken)),
        ended = simulator.board_ended() => Some(Err(ended)),
        slow = &mut slow => Some(Err(slow)),
        ended = page(ctx, &simulator, args.dashboard, set.as_ref()) => ended.err().map(Err),
        () = &mut stop => None,
    };
    let exit = match dispatcher {
        Some(dispatcher) if !matches!(done, Some(Err(_))) => tell(ctx, &simulator, dispatcher).await,
        _ => Ok(Exit::Done),
    };
    drop(ros2);
    simulator.stop().await;
    let interrupted = done.is_none();
    done.unwrap_or(Ok(()))?;
    match args.until_done {
        true if interrupted => exit.map(|_| Exit::Interrupted),
        true => exit,
        false => exit.map(|_| Exit::Done),
    }
}

/// The fleet as a node of ROS 2, and its session.
async fn fleet_node(
    ctx: &Context,
    simulator: &Simulator,
    set: Option<&Identities>,
    domain: u32,
    speed: f64,
) -> Result<(FleetNode, Client)> {
    let ctx = identities::of(ctx, set, Role::Operator)?;
    let own = ctx.with(|settings| settings.connect = simulator.endpoints().to_vec());
    let client = Client::open(&own.settings).await?;
    let mut node = FleetNode::start(&client, domain, simulator.map()).await?;
    if speed != 1.0 {
        let truth = simulator.truth().clone();
        node.tell_time(move || truth.now_s()).await?;
    }
    Ok((node, client))
}

/// Where its router listens.
fn listen(ctx: &Context, args: &SimArgs) -> Result<String> {
    let usual = if args.identities.is_some() { "tls/127.0.0.1:7447" } else { DEFAULT_ENDPOINT };
    let listen = args.listen.clone().unwrap_or_else(|| usual.to_owned());
    if ctx.connect_given {
        return match args.identities {
            None => Ok(listen),
            Some(_) => Err(Error::new(ErrorKind::Invalid, "--identities and --connect exclude each other")
                .hint("--connect uses a router that runs elsewhere: name a simulator's identity with --identity")),
        };
    }
    if ctx.settings.identity.is_some() {
        return Err(Error::new(
            ErrorKind::Invalid,
            "--identity is of no use to a router that knows no identities",
        )
        .hint("--identities DIR runs one that does; --connect uses one that runs elsewhere"));
    }
    if args.identities.is_some() && !listen.starts_with("tls/") {
        return Err(Error::new(
            ErrorKind::Invalid,
            format!("{listen} has no TLS, so identities are of no use"),
        )
        .hint(format!("--listen {}", listen.replacen("tcp/", "tls/", 1))));
    }
    if let Some(warning) = check_listen(&listen, args.insecure)? {
        ctx.out.note(&format!("warning: {warning}"));
    }
    Ok(listen)
}

/// What is asked for.
fn plan(ctx: &Context, args: &SimArgs, listen: String, set: Option<&Identities>) -> Result<SimulationPlan> {
    let identity = match set {
        Some(set) => Some(set.of(Role::Simulator)?),
        None => ctx.settings.identity.clone(),
    };
    let world = args.world.as_deref().map(|file| read_world(&ctx.out, file)).transpose()?;
    if args.pty.is_some()
        && (args.vehicle.is_some() || world.as_ref().is_some_and(|it| !it.vehicles().is_empty()))
    {
        ctx.out.note("the agents on these serial ports need the same vehicle settings, under [vehicle] in their configs");
    }
    Ok(SimulationPlan {
        fleet: ctx.settings.fleet.clone(),
        robots: args.robots,
        first: args.first,
        fleet_size: args.fleet_size,
        vehicles: vehicles(args, world.as_ref())?,
        world,
        starts: Vec::new(),
        seed: args.seed,
        speed: args.speed,
        listen,
        pki: set.map(Identities::pki),
        identity,
        connect: if ctx.connect_given { ctx.settings.connect.clone() } else { Vec::new() },
        pty: args.pty.clone(),
        board: args
            .board_firmware
            .clone()
            .map(|firmware| BoardFirmware { firmware, emulator: args.emulator.clone() }),
        truth_log: args.truth_log.clone(),
        fixes: args.fixes.truth(),
        record: args.record.clone(),
        ros2: args.ros2,
    })
}

/// What the robots are: as the world says, else all as `--vehicle` says.
fn vehicles(args: &SimArgs, world: Option<&World>) -> Result<Vec<VehicleFile>> {
    let rest = args.vehicle.as_deref().map_or_else(|| Ok(VehicleFile::default()), vehicle_file::read)?;
    let folder = args.world.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
    let own =
        world.map_or(&[][..], World::vehicles).iter().skip(args.first.saturating_sub(1)).take(args.robots);
    let mut vehicles: Vec<VehicleFile> =
        own.map(|file| vehicle_file::read(&folder.join(file))).collect::<Result<_>>()?;
    // More than it can simulate are refused with the rest of the plan.
    vehicles.resize(args.robots.min(xtb_simulator::MAX_ROBOTS), rest);
    Ok(vehicles)
}

/// Resolves when the simulation shall end by itself.
async fn until_done(dispatcher: Option<&mut EmbeddedDispatcher>, wanted: bool) -> Result<()> {
    match dispatcher {
        Some(dispatcher) if wanted => dispatcher.until_done().await,
        Some(dispatcher) => Err(dispatcher.ended().await),
        None => std::future::pending().await,
    }
}

/// Says when the world falls behind and when it is in time again; with `strict` the first is an error.
async fn pace(ctx: &Context, mut stats: watch::Receiver<LatestStats>, strict: bool) -> Error {
    let mut said = None;
    loop {
        let told = *stats.borrow_and_update();
        let runs = describe::simulator(&told.stats);
        match told.pace.filter(|pace| said.replace(*pace) != Some(*pace)) {
            Some(Pace::FellBehind) if strict => return Error::new(ErrorKind::Failed, runs).hint(TOO_SLOW),
            Some(Pace::FellBehind) => ctx.out.note(&format!("warning: {runs}: {TOO_SLOW}")),
            Some(Pace::CaughtUp) => ctx.out.note(&format!("{runs}: on time again")),
            None => {}
        }
        if stats.changed().await.is_err() {
            return std::future::pending().await;
        }
    }
}

/// The dashboard, if it is wanted, until it is interrupted.
async fn page(
    ctx: &Context,
    simulator: &Simulator,
    listen: Option<SocketAddr>,
    set: Option<&Identities>,
) -> Result<()> {
    let Some(listen) = listen else { return std::future::pending().await };
    let ctx = identities::of(ctx, set, Role::Dashboard)?;
    let own = ctx.with(|settings| settings.connect = simulator.endpoints().to_vec());
    dashboard::run(&own, &DashboardArgs::at(listen)).await.map(drop)
}

/// Ends the dispatcher and says what came of its tasks.
async fn tell(ctx: &Context, simulator: &Simulator, dispatcher: EmbeddedDispatcher) -> Result<Exit> {
    let standing = dispatcher.stop().await?;
    let truth = simulator.truth().latest();
    let contacts = truth.robots.values().map(|robot| robot.contacts).sum();
    let (open, tasks, usage) = (standing.status.open, standing.status.tasks, standing.usage);
    let failed = usage.has_failed();
    let suspended = standing.suspended;
    let ended = Ended { open, tasks, suspended, contacts, simulated_s: truth.t_s, usage };
    ctx.out.result(&ended, |Ended { open, tasks, suspended, contacts, simulated_s, usage }| {
        let suspended: Vec<String> = task_text::suspended(suspended, None, &ctx.out);
        let unassigned = match usage.failed_unassigned {
            0 => None,
            1 => Some("1 task failed without a robot".to_owned()),
            count => Some(format!("{count} tasks failed without a robot")),
        };
        let lines = [embedded::table(&ctx.out, usage)].into_iter().chain(unassigned).chain(suspended);
        format!(
            "{}\n{open} of {tasks} tasks are open; {contacts} contacts in {simulated_s:.0} s simulated",
            lines.collect::<Vec<_>>().join("\n")
        )
    })?;
    Ok(if failed || contacts > 0 { Exit::Failed } else { Exit::Done })
}
