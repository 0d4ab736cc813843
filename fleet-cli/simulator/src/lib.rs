//! A fleet of simulated trucks with real agents: the only part of this program that holds robots.
//!
//! One world thread, as many for control loops as there are cores, a Zenoh session for each robot (of up to 64), and a router
//! unless one is named. Agents talk to their trucks through board frames and gyro bytes alone: in-memory
//! lines, or ptys to which separate `robot-agent` processes connect.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod agents;
mod boards;
mod fixes;
mod foreign;
mod plan;
mod ptys;
mod stats;
mod truth;

pub use agents::RunningAgent;
pub use boards::BoardFirmware;
pub use plan::{MAX_ROBOTS, SimulationPlan};
pub use stats::LatestStats;
pub use truth::TruthView;

use agents::{AgentSettings, Life};
use boards::Boards;
use plan::Session;
use robot_agent::SharedResources;
use robot_agent::clock::WorldTime;
use robot_agent::hardware::simulated::{RunningWorld, SimulatedHardware, TruckLines};
use stats::StatsService;
use std::num::NonZero;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_bus::{Bus, Service, Subscription};
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_nav::Map;
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{FleetKeys, Key};
use xtb_protocol::messages::{Roster, RosterEntry};
use xtb_services::map_server::MapService;
use xtb_services::router::GuardedRouter;
use xtb_sim::{MAP_RESOLUTION_M, Simulation, ToMapError, TruckParameters, VehicleFile};

/// Agents are alive within a second, hundreds one after the other on a busy machine: so long after the last
/// one no more are expected.
const NEXT_WITHIN: Duration = Duration::from_secs(60);
/// For an answer of the router, and for the rest of the agents when one has lost its name.
const ALIVE_WITHIN: Duration = Duration::from_secs(1);
/// More robots share sessions: the links of hundreds cost more than their controllers.
const MOST_SESSIONS: usize = 64;
/// Between two looks at the agents.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// For whoever serves a map already.
const MAP_ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// A running simulation.
pub struct Simulator {
    endpoint: String,
    fleet: Name,
    settings: AgentSettings,
    vehicles: Vec<VehicleConfig>,
    roster: Roster,
    agents: Vec<Option<RunningAgent>>,
    truth: TruthView,
    publishing: [JoinHandle<()>; 2],
    _roster_service: Service,
    /// The robots of the same world that others move.
    _foreign: Option<Subscription>,
    map_service: Option<MapService>,
    /// The one that is served, as the world has it.
    map: Option<Map>,
    stats: StatsService,
    bus: Bus,
    /// Where it is one with identities.
    router: Option<GuardedRouter>,
    world: RunningWorld,
    ptys: Option<ptys::PtyFolder>,
    boards: Boards,
}

impl Simulator {
    /// The map that it serves and its later versions, if it does.
    #[must_use]
    pub fn maps(&self) -> Option<watch::Receiver<Arc<Map>>> {
        self.map_service.as_ref().map(MapService::maps)
    }

    /// The map that it serves, if it does, as the world has it.
    #[must_use]
    pub fn map(&self) -> Option<&Map> {
        self.map.as_ref()
    }

    /// Starts everything and waits until every agent is alive.
    ///
    /// # Errors
    /// As [`Simulator::begin`] and [`Simulator::ready`].
    pub async fn start(plan: SimulationPlan) -> Result<Self> {
        let simulator = Self::begin(plan).await?;
        simulator.ready().await?;
        Ok(simulator)
    }

    /// Starts everything; its agents come to life then.
    ///
    /// # Errors
    /// An impossible plan or world, a port that is taken, a folder that cannot be used.
    pub async fn begin(plan: SimulationPlan) -> Result<Self> {
        plan.check()?;
        let mut files = plan.vehicles.clone();
        files.resize_with(plan.robots, VehicleFile::default);
        let (vehicles, kinds): (Vec<VehicleConfig>, Vec<TruckParameters>) =
            files.into_iter().map(|file| (file.vehicle, file.truth)).unzip();
        let world = plan.world(&kinds);
        let world_map = world.to_map(MAP_RESOLUTION_M);
        let mut simulation = plan.simulation(&kinds, world)?;
        let boards = Boards::switch_on(plan.board.as_ref(), &mut simulation, &kinds)?;
        let roster = roster_of(&simulation)?;
        let Session { bus, endpoint, connect, router } = plan.session().await?;

        let keys = FleetKeys::new(plan.fleet.clone());
        // Before there is a robot: in another world than the others' it must not drive.
        let map_service = serve_map(&bus, &keys, &world_map, plan.shares_world()).await?;
        let time = WorldTime::new();
        let (truth, mut observer) = truth::view(&roster, plan.truth_log.as_deref())?;
        let (lines, hardware, ptys) = lines(&plan, &roster)?;
        let clocks: Vec<_> = hardware.iter().map(|_| time.join()).collect();
        let world = RunningWorld::start(simulation, lines, time.clone(), plan.speed, move |simulation| {
            observer.step(simulation);
        })?;
        let first = plan.shares_world().then(|| u32::try_from(plan.first).ok()).flatten();
        let stats = StatsService::start(&bus, &keys, time, plan.speed, first).await?;

        let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
        let settings = AgentSettings {
            fleet: plan.fleet.clone(),
            connect: connect.clone(),
            identity: plan.identity.clone(),
            record: plan.record.clone(),
            ros2: plan.ros2,
            world_speed: plan.speed,
            link_lease: plan.link_lease(),
            shared: SharedResources::among(cores, plan.robots.div_ceil(MOST_SESSIONS))?,
        };
        let agents = roster
            .robots
            .iter()
            .zip(&vehicles)
            .zip(hardware.into_iter().zip(clocks))
            .map(|(robot, (lines, clock))| Some(RunningAgent::start(&settings, robot, lines, clock)));
        let agents: Vec<_> = agents.collect();

        let publishing = [
            truth::publish(bus.clone(), keys.sim_truth(), truth.clone()),
            fixes::publish(bus.clone(), keys.clone(), &roster, truth.clone(), &plan.fixes, plan.seed),
        ];
        let roster_service = serve_roster(&bus, keys.sim_roster(), roster.clone()).await?;
        let foreign = match kinds.into_iter().next() {
            Some(kind) if plan.shares_world() => {
                let others = foreign::listen(&bus, &keys, &roster, kind.body, world.orders(), stats.told());
                Some(others.await?)
            }
            _ => None,
        };
        Ok(Self {
            endpoint,
            fleet: plan.fleet,
            settings,
            vehicles,
            roster,
            agents,
            truth,
            publishing,
            _roster_service: roster_service,
            _foreign: foreign,
            map: map_service.is_some().then(|| world_map.ok()).flatten(),
            map_service,
            stats,
            bus,
            router,
            world,
            ptys,
            boards,
        })
    }

    /// Where clients connect.
    #[must_use]
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// The same as a list, where it uses several routers.
    #[must_use]
    pub fn endpoints(&self) -> &[String] {
        &self.settings.connect
    }

    /// The robots.
    #[must_use]
    pub fn roster(&self) -> &Roster {
        &self.roster
    }

    /// Where the trucks really are.
    #[must_use]
    pub fn truth(&self) -> &TruthView {
        &self.truth
    }

    /// The world, to be changed while it runs.
    #[must_use]
    pub fn world(&self) -> &RunningWorld {
        &self.world
    }

    /// How fast the world really runs.
    #[must_use]
    pub fn stats(&self) -> watch::Receiver<LatestStats> {
        self.stats.told()
    }

    /// The agent of the robot with this index, if it runs.
    pub fn agent_mut(&mut self, index: usize) -> Option<&mut RunningAgent> {
        self.agents.get_mut(index).and_then(Option::as_mut)
    }

    /// Ends one agent cleanly; its truck stays in the world.
    pub async fn stop_agent(&mut self, index: usize) {
        if let Some(agent) = self.agents.get_mut(index).and_then(Option::take) {
            let _ = agent.stop().await;
        }
    }

    /// Starts an agent again on the truck of one that was stopped. The truck stands where it was
    /// left; the new agent is told where that is.
    pub fn restart_agent(&mut self, index: usize) {
        let Some(entry) = self.roster.robots.get(index) else { return };
        let (hardware, lines) = SimulatedHardware::connect();
        self.world.replace_lines(index, lines);
        let truth = self.truth.latest();
        let mut entry = entry.clone();
        if let Some(now) = truth.robots.get(&entry.name) {
            entry.start_pose = Some(MapPose { x_m: now.x_m, y_m: now.y_m, yaw_rad: now.yaw_rad });
        }
        let settings = self.settings.clone();
        let clock = self.world.time().join();
        let robot = (&entry, &self.vehicles[index]);
        self.agents[index] = Some(RunningAgent::start(&settings, robot, hardware, clock));
    }

    /// Ends everything: agents first (their motors go neutral), then the router.
    pub async fn stop(self) {
        let Self { agents, publishing, bus, router, world, map_service, _roster_service, .. } = self;
        let ending: Vec<_> = agents.into_iter().flatten().map(|agent| tokio::spawn(agent.stop())).collect();
        for agent in ending {
            let _ = agent.await;
        }
        publishing.iter().for_each(JoinHandle::abort);
        drop((world, map_service));
        bus.close().await;
        if let Some(router) = router {
            router.close().await;
        }
    }

    /// Waits until each agent is present under its own name, and the router shows that. Agents on ptys
    /// come by themselves.
    ///
    /// # Errors
    /// [`ErrorKind::NameTaken`], another failure of an agent, or too few come to life in time.
    pub async fn ready(&self) -> Result<()> {
        if self.ptys.is_some() {
            return Ok(());
        }
        let key = FleetKeys::new(self.fleet.clone()).any_robot().alive();
        let wanted = self.roster.robots.len();
        let (mut alive, mut since) = (0, Instant::now());
        loop {
            if let Some(failure) = self.failure() {
                return Err(self.all_of(failure).await);
            }
            let mut now = self.lives().filter(|(_, life)| *life == Life::Alive).count();
            if now == wanted {
                let alive = self.bus.alive(&key, ALIVE_WITHIN).await?;
                let robots = alive.iter().filter_map(|key| Key::parse(key)?.robot);
                now = robots.filter(|robot| self.roster.robots.iter().any(|own| own.name == *robot)).count();
            }
            if now >= wanted {
                return Ok(());
            }
            if now > alive {
                (alive, since) = (now, Instant::now());
            }
            if since.elapsed() > NEXT_WITHIN {
                let message = format!("{now} of {wanted} simulated robots started");
                return Err(
                    Error::new(ErrorKind::Failed, message).hint("use fewer --robots or a lower --speed")
                );
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }

    /// Resolves when robots turn out to have lost their names to others.
    pub async fn names_taken(&self) -> Error {
        loop {
            match self.failure() {
                Some(failure) if failure.kind == ErrorKind::NameTaken => return self.all_of(failure).await,
                _ => tokio::time::sleep(LOOK_EVERY).await,
            }
        }
    }

    /// Resolves when an emulated board has ended.
    pub async fn board_ended(&self) -> Error {
        self.boards.ended().await
    }

    fn lives(&self) -> impl Iterator<Item = (&Name, Life)> {
        let agents = self.roster.robots.iter().zip(&self.agents);
        agents.filter_map(|(robot, agent)| Some((&robot.name, agent.as_ref()?.life())))
    }

    /// Why an agent has failed, one that has lost its name before others.
    fn failure(&self) -> Option<Error> {
        let failures = self.lives().filter_map(|(_, life)| match life {
            Life::Failed(failure) => Some(failure),
            _ => None,
        });
        failures.min_by_key(|failure| failure.kind != ErrorKind::NameTaken)
    }

    /// Where one name is taken, others are too: they are named together.
    async fn all_of(&self, first: Error) -> Error {
        if first.kind != ErrorKind::NameTaken {
            return first;
        }
        let decided = async {
            while self.lives().any(|(_, life)| life == Life::Starting) {
                tokio::time::sleep(LOOK_EVERY).await;
            }
        };
        // Who is not decided by then is not named.
        let _ = tokio::time::timeout(ALIVE_WITHIN, decided).await;
        let taken =
            |life: &Life| matches!(life, Life::Failed(failure) if failure.kind == ErrorKind::NameTaken);
        let names = self.lives().filter(|(_, life)| taken(life)).map(|(name, _)| name.clone());
        agents::names_taken(&self.fleet, &names.collect::<Vec<_>>())
    }
}

fn roster_of(simulation: &Simulation) -> Result<Roster> {
    let entry = |truck: &xtb_sim::Truck| {
        let name =
            Name::robot(truck.name()).map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))?;
        let now = truck.truth();
        let start = MapPose { x_m: now.x_m, y_m: now.y_m, yaw_rad: now.yaw_rad };
        Ok(RosterEntry { name, tags: Vec::new(), start_pose: Some(start) })
    };
    Ok(Roster { robots: simulation.trucks().iter().map(entry).collect::<Result<_>>()? })
}

type Lines = (Vec<TruckLines>, Vec<SimulatedHardware>, Option<ptys::PtyFolder>);

fn lines(plan: &SimulationPlan, roster: &Roster) -> Result<Lines> {
    if let Some(folder) = &plan.pty {
        let (folder, lines) = ptys::PtyFolder::create(folder, roster)?;
        return Ok((lines, Vec::new(), Some(folder)));
    }
    let (hardware, lines) = roster.robots.iter().map(|_| SimulatedHardware::connect()).unzip();
    Ok((lines, hardware, None))
}

/// Serves the world's map. A world that has none, and a fleet that has another already, can do without, unless the
/// world is shared: it must be the same then.
async fn serve_map(
    bus: &Bus,
    keys: &FleetKeys,
    map: &std::result::Result<Map, ToMapError>,
    shared: bool,
) -> Result<Option<MapService>> {
    let map = match map {
        Ok(map) => map,
        Err(error) if shared => {
            return Err(Error::new(ErrorKind::Invalid, format!("no map of the world: {error}")));
        }
        Err(error) => {
            tracing::warn!("no map is served: {error}");
            return Ok(None);
        }
    };
    match MapService::start(bus, keys, map, MAP_ANSWER_WITHIN).await {
        Ok(service) => Ok(Some(service)),
        Err(failure) if shared => {
            Err(failure.hint("all simulators of a fleet need the same --world and --fleet-size"))
        }
        Err(failure) => {
            tracing::warn!("the world's map is not served: {failure}");
            Ok(None)
        }
    }
}

async fn serve_roster(bus: &Bus, key: String, roster: Roster) -> Result<Service> {
    let runtime = tokio::runtime::Handle::current();
    let own_key = key.clone();
    let service = bus.serve(&key, move |question| {
        let (own_key, roster) = (own_key.clone(), roster.clone());
        runtime.spawn(async move {
            if let Err(error) = question.reply(&own_key, &roster, Format::Json).await {
                tracing::debug!("cannot send the roster: {error}");
            }
        });
    });
    Ok(service.await?)
}
