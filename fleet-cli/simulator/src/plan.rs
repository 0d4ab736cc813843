//! What to simulate, and what follows from it: the world with its trucks, and the session.

use crate::boards::BoardFirmware;
use std::path::PathBuf;
use std::time::Duration;
use xtb_bus::{Bus, Enrolled, LINK_LEASE, Opening, SessionRole};
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::frames::MapPose;
use xtb_protocol::Name;
use xtb_protocol::messages::MAX_ROSTER;
use xtb_services::router::{self, GuardedRouter};
use xtb_sim::fixes::FixTruth;
use xtb_sim::{Body, Simulation, TruckParameters, VehicleFile, World};

/// More robots than this are not simulated in one process: at real time only a large computer has room for so many,
/// see docs/simulator.md.
pub const MAX_ROBOTS: usize = 1000;
/// Router and agents in one overloaded process are late with their keep-alives; where one of them dies, all do,
/// and whoever is connected sees that at once. (Zenoh's own default.)
const OWN_LINK_LEASE: Duration = Duration::from_secs(10);

/// What to simulate.
#[derive(Debug, Clone)]
pub struct SimulationPlan {
    /// The fleet's name.
    pub fleet: Name,
    /// How many robots.
    pub robots: usize,
    /// The number of the first: 1 for `xtb-1` … `xtb-N`.
    pub first: usize,
    /// Robots of all simulators of this world, which share it; `None` = up to its own last one.
    pub fleet_size: Option<usize>,
    /// The room; `None` = an empty one, large enough.
    pub world: Option<World>,
    /// What the robots are, in their order; those beyond are XTBs.
    pub vehicles: Vec<VehicleFile>,
    /// Where the robots start; empty = the world's own choice.
    pub starts: Vec<MapPose>,
    /// Seed of every random number.
    pub seed: u64,
    /// Times real time.
    pub speed: f64,
    /// Its own router here, unless `connect` names others.
    pub listen: String,
    /// Routers to use instead of an own one.
    pub connect: Vec<String>,
    /// Its router admits by this PKI folder; `None` = whoever reaches it.
    pub pki: Option<PathBuf>,
    /// The identity of all its agents and of its own session: a simulator's.
    pub identity: Option<Enrolled>,
    /// No agents, but two ptys a truck in this folder.
    pub pty: Option<PathBuf>,
    /// What runs on the trucks' I/O boards; `None` = they are simulated.
    pub board: Option<BoardFirmware>,
    /// Where to write the truth at every step.
    pub truth_log: Option<PathBuf>,
    /// What measures the robots' poses.
    pub fixes: FixTruth,
    /// Folder where every agent records its steps.
    pub record: Option<PathBuf>,
    /// Every robot is a node of ROS 2 too, in this `ROS_DOMAIN_ID`.
    pub ros2: Option<u32>,
}

impl SimulationPlan {
    /// Whether that can be.
    pub(super) fn check(&self) -> Result<()> {
        if self.robots == 0 || self.robots > MAX_ROBOTS {
            let message = format!("{} robots cannot be simulated", self.robots);
            return Err(
                Error::new(ErrorKind::Invalid, message).hint(format!("--robots must be 1 to {MAX_ROBOTS}"))
            );
        }
        let last = self.last();
        if self.first == 0 || last > MAX_ROSTER {
            let message = format!("robots {} to {last} cannot be simulated", self.first);
            return Err(Error::new(ErrorKind::Invalid, message)
                .hint(format!("they are numbered from 1 to {MAX_ROSTER}")));
        }
        if !(last..=MAX_ROSTER).contains(&self.size()) {
            let message = format!("a fleet of {} robots has none of the number {last}", self.size());
            return Err(Error::new(ErrorKind::Invalid, message).hint(format!(
                "--fleet-size must be {last} to {MAX_ROSTER}, the same for all its simulators"
            )));
        }
        if self.first > 1 && self.connect.is_empty() {
            let message =
                format!("robots from xtb-{} on are part of a world of another simulator", self.first);
            return Err(Error::new(ErrorKind::Invalid, message)
                .hint("add --connect with the endpoint of the simulator that has the first robots"));
        }
        if !(self.speed.is_finite() && (0.01..=1000.0).contains(&self.speed)) {
            let message = format!("the simulation cannot run at {} × real time", self.speed);
            return Err(Error::new(ErrorKind::Invalid, message).hint("--speed must be 0.01 to 1000"));
        }
        Ok(())
    }

    /// The number of its last robot.
    fn last(&self) -> usize {
        self.first.saturating_add(self.robots).saturating_sub(1)
    }

    /// Robots of the whole fleet.
    fn size(&self) -> usize {
        self.fleet_size.unwrap_or(self.last())
    }

    /// Whether other simulators move robots in the same world.
    pub(super) fn shares_world(&self) -> bool {
        self.size() > self.robots
    }

    /// The world of the whole fleet: an empty room unless there is one, with room for as many as there are.
    pub(super) fn world(&self, kinds: &[TruckParameters]) -> World {
        let fleet = || World::for_robots(self.size(), &Body::around(kinds.iter().map(|kind| &kind.body)));
        self.world.clone().unwrap_or_else(fleet)
    }

    /// Its world, with a truck of each of these kinds.
    pub(super) fn simulation(&self, kinds: &[TruckParameters], world: World) -> Result<Simulation> {
        let names: Vec<String> = (self.first..=self.last()).map(|n| format!("xtb-{n}")).collect();
        let impossible = |error: String| {
            Error::new(ErrorKind::Config, error).hint("use fewer --robots, or a world with more room")
        };
        let starts: Vec<MapPose> = if self.starts.is_empty() {
            let body = Body::around(kinds.iter().map(|kind| &kind.body));
            let all = world.start_poses(self.last(), &body).map_err(|error| impossible(error.to_string()))?;
            all.into_iter().skip(self.first - 1).collect()
        } else {
            self.starts.clone()
        };
        let robots: Vec<_> = names.iter().map(String::as_str).zip(starts).collect();
        let made = Simulation::of_kinds_at(world, &kinds[..robots.len()], &robots, self.seed);
        made.map_err(|error| impossible(error.to_string()))
    }

    /// Real agents, on ptys, and routers elsewhere notice a lost link as ever, unless a simulator is there too.
    pub(super) fn link_lease(&self) -> Duration {
        let alone = (self.connect.is_empty() || self.first > 1) && self.pty.is_none();
        if alone { OWN_LINK_LEASE } else { LINK_LEASE }
    }

    /// The simulator's own session, and its router unless it uses another one.
    pub(super) async fn session(&self) -> Result<Session> {
        if !self.connect.is_empty() {
            let bus = self.client(&self.connect).await?;
            return Ok(Session {
                bus,
                endpoint: self.connect.join(", "),
                connect: self.connect.clone(),
                router: None,
            });
        }
        let Some(pki) = &self.pki else {
            let (bus, endpoint) = router::open_leased(&self.listen, &[], self.link_lease()).await?;
            return Ok(Session { bus, endpoint: endpoint.clone(), connect: vec![endpoint], router: None });
        };
        let router =
            router::open_leased_with_registry(&self.listen, &[], pki, self.link_lease(), self.ros2).await?;
        let endpoint = on_this_computer(router.endpoint());
        let connect = vec![endpoint.clone()];
        // A client as its agents are: a router's own session is under no rules.
        let bus = self.client(&connect).await?;
        Ok(Session { bus, endpoint, connect, router: Some(router) })
    }

    async fn client(&self, connect: &[String]) -> Result<Bus> {
        let role = SessionRole::Client { connect: connect.to_vec() };
        let tls = self.identity.as_ref().map(Enrolled::tls);
        Ok(Opening::of(role).link_lease(self.link_lease()).tls(tls).once().await?)
    }
}

/// The simulator's way to its clients.
pub(super) struct Session {
    /// Its own session.
    pub(super) bus: Bus,
    /// Where it can be reached.
    pub(super) endpoint: String,
    /// Where its agents connect.
    pub(super) connect: Vec<String>,
    /// Its router, where that is a session of its own.
    pub(super) router: Option<GuardedRouter>,
}

/// The certificate of a router that listens on all addresses names this computer's, perhaps not all others.
fn on_this_computer(endpoint: &str) -> String {
    match endpoint.rsplit_once(':') {
        Some((_, port)) => format!("tls/127.0.0.1:{port}"),
        None => endpoint.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_sim::MAP_RESOLUTION_M;

    fn plan(first: usize, robots: usize, fleet_size: Option<usize>) -> SimulationPlan {
        SimulationPlan {
            fleet: Name::new("lab").unwrap(),
            robots,
            first,
            fleet_size,
            world: None,
            vehicles: Vec::new(),
            starts: Vec::new(),
            seed: 1,
            speed: 1.0,
            listen: "tcp/127.0.0.1:0".into(),
            connect: if first > 1 { vec!["tcp/127.0.0.1:7447".into()] } else { Vec::new() },
            pki: None,
            identity: None,
            pty: None,
            board: None,
            truth_log: None,
            fixes: FixTruth::default(),
            record: None,
            ros2: None,
        }
    }

    /// Its map's hash, and which robot starts where.
    fn made(plan: &SimulationPlan) -> (String, Vec<(String, f64, f64)>) {
        let kinds = vec![TruckParameters::default(); plan.robots];
        let world = plan.world(&kinds);
        let hash = world.to_map(MAP_RESOLUTION_M).unwrap().hash().to_string();
        let simulation = plan.simulation(&kinds, world).unwrap();
        let start = |truck: &xtb_sim::Truck| (truck.name().to_owned(), truck.truth().x_m, truck.truth().y_m);
        (hash, simulation.trucks().iter().map(start).collect())
    }

    #[test]
    fn simulators_of_one_fleet_have_one_world_and_each_its_own_places_in_it() {
        let (whole, first, second) = (plan(1, 40, None), plan(1, 25, Some(40)), plan(26, 15, None));
        assert!(!whole.shares_world() && first.shares_world() && second.shares_world());
        let ((world, all), (one, some), (other, rest)) = (made(&whole), made(&first), made(&second));
        assert_eq!((&one, &other), (&world, &world));
        assert_eq!([some, rest].concat(), all);
    }

    #[test]
    fn numbers_that_cannot_be_are_refused() {
        for (first, robots, fleet_size) in [(1, MAX_ROBOTS, None), (501, 500, None), (1, 500, Some(1000))] {
            assert_eq!(plan(first, robots, fleet_size).check(), Ok(()), "{first} {robots} {fleet_size:?}");
        }
        for (first, robots, fleet_size) in [
            (1, 0, None),
            (1, MAX_ROBOTS + 1, None),
            (0, 3, None),
            (MAX_ROSTER, 2, None),
            (usize::MAX, 2, None),
            (1, 5, Some(4)),
            (1, 5, Some(MAX_ROSTER + 1)),
        ] {
            let refused = plan(first, robots, fleet_size).check().unwrap_err();
            assert_eq!(refused.kind, ErrorKind::Invalid, "{first} {robots} {fleet_size:?}");
        }
        let alone = SimulationPlan { connect: Vec::new(), ..plan(26, 15, None) };
        assert!(alone.check().unwrap_err().hint.contains("--connect"));
    }
}
