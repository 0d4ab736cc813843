//! Trucks and their robots in one loop, without threads, clocks or Zenoh: as fast as it goes.
//!
//! The same [`Robot`] as in `robot-agent`, the same bytes between it and its truck. A turn is a step
//! of the world; same arguments, same bits.

mod traffic;

pub use traffic::Traffic;

use crate::fixes::{FixMaker, FixTruth};
use crate::rng::Rng;
use crate::simulation::{Simulation, SimulationError};
use crate::vehicle::Truck;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use thiserror::Error;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::units::Stamp;
use xtb_nav::Map;
use xtb_nav::geometry::Car;
use xtb_nav::navigator::near::Surroundings;
use xtb_nav::navigator::right_of_way::Neighbour;
use xtb_nav::navigator::{PlanDone, PreparedMap};
use xtb_nav::planner::Planner;
use xtb_protocol::keys::{FloorCell, NameError};
use xtb_protocol::messages::{Body, Lease, Outcome, Rejected, Reply, Request, RobotState, TruthRobot};
use xtb_protocol::{Name, Uuid};
use xtb_robot::agent::Arrival;
use xtb_robot::{Identity, Robot};

/// Why robots cannot be put into a simulation.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LockstepError {
    /// The world or its trucks are impossible.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A truck's name cannot be a robot's.
    #[error(transparent)]
    Name(#[from] NameError),
}

/// How long a plan takes in simulated time.
pub const PLAN_MS: u64 = 50;

/// The robots hear each other's states this often, as `robot-agent` lets them.
const HEARING_MS: u64 = 200;

/// What a robot listens to.
#[derive(Debug, Clone)]
struct Listener {
    around: Surroundings,
    cells: BTreeSet<FloorCell>,
}

/// A simulation with a robot on each of its trucks.
#[derive(Debug)]
pub struct Lockstep {
    simulation: Simulation,
    robots: Vec<Robot>,
    /// What the one client of each robot holds, once it has asked for something.
    leases: Vec<Option<Lease>>,
    bytes: Vec<u8>,
    asked: Arrival,
    /// What measures the trucks from outside.
    fixes: Vec<FixMaker>,
    traffic: Option<Traffic>,
    planner: Planner,
    /// Plans on their way back, with when and to whom.
    plans: VecDeque<(Stamp, usize, PlanDone)>,
    /// Whose agents have died.
    dead: BTreeSet<usize>,
    /// When the robots hear each other next, and the squares of the floor that each listens to.
    next_hearing: Stamp,
    listeners: Vec<Listener>,
    /// The part of what they say that gets lost on the way to each.
    unheard: (f64, Rng),
}

impl Lockstep {
    /// Puts a robot of `fleet` on each truck, told where it starts.
    ///
    /// # Errors
    /// A truck whose name cannot be a robot's.
    pub fn new(simulation: Simulation, fleet: &Name, vehicle: &VehicleConfig) -> Result<Self, LockstepError> {
        let robot = |(epoch, truck): (usize, &Truck)| {
            let TruthRobot { x_m, y_m, yaw_rad, .. } = truck.truth();
            let identity = Identity {
                fleet: fleet.clone(),
                robot: Name::robot(truck.name())?,
                epoch: epoch as u64,
                start_pose: MapPose { x_m, y_m, yaw_rad },
            };
            Ok(Robot::new(identity, vehicle.clone(), "lockstep"))
        };
        let robots: Vec<Robot> =
            simulation.trucks().iter().enumerate().map(robot).collect::<Result<_, NameError>>()?;
        let leases = vec![None; robots.len()];
        let around = Surroundings::of(&Car::of(vehicle));
        let listeners = vec![Listener { around, cells: BTreeSet::new() }; robots.len()];
        Ok(Self {
            simulation,
            robots,
            leases,
            bytes: Vec::with_capacity(1024),
            asked: 0,
            fixes: Vec::new(),
            traffic: None,
            planner: Planner::new(),
            plans: VecDeque::new(),
            dead: BTreeSet::new(),
            next_hearing: Stamp::ZERO,
            listeners,
            unheard: (0.0, Rng::new(0, 0)),
        })
    }

    /// Simulated time.
    #[must_use]
    pub fn now(&self) -> Stamp {
        self.simulation.now()
    }

    /// The world and its trucks.
    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The world, to be changed between two steps.
    pub fn simulation_mut(&mut self) -> &mut Simulation {
        &mut self.simulation
    }

    /// Asks the robot with this index; `None` if there is none. A request without a lease bears the one
    /// of `client`, which is acquired the first time and never let go.
    pub fn request(&mut self, index: usize, client: &Name, request: &Request) -> Option<Reply> {
        if request.lease.is_some() {
            return self.ask(index, client, request);
        }
        if self.leases.get(index)?.is_none() {
            let id = Uuid::from_u128(u128::MAX - u128::from(self.asked));
            let reply =
                self.ask(index, client, &Request { id, lease: None, body: Body::Acquire { take: true } })?;
            let Outcome::Ok(done) = reply.result else { return Some(reply) };
            self.leases[index] = done.lease;
        }
        let lease = self.leases[index];
        self.ask(index, client, &Request { lease, ..request.clone() })
    }

    fn ask(&mut self, index: usize, client: &Name, request: &Request) -> Option<Reply> {
        let now = self.now();
        self.asked += 1;
        let arrival = self.asked;
        self.robots.get_mut(index).map(|robot| robot.request(now, arrival, client, request))
    }

    /// The state of the robot with this index; `None` if there is none.
    pub fn state(&mut self, index: usize) -> Option<RobotState> {
        let now = self.now();
        self.robots.get_mut(index).map(|robot| robot.state(now, Rejected::default()))
    }

    /// The robot with this index, to be told of poses and paths between two steps.
    pub fn robot_mut(&mut self, index: usize) -> Option<&mut Robot> {
        self.robots.get_mut(index)
    }

    /// Pose fixes for every robot from now on.
    pub fn set_fixes(&mut self, truth: FixTruth, seed: u64) {
        self.fixes = (0..self.robots.len()).map(|truck| FixMaker::new(truth.clone(), seed, truck)).collect();
    }

    fn fix(&mut self) {
        let now = self.now();
        for ((maker, truck), robot) in
            self.fixes.iter_mut().zip(self.simulation.trucks()).zip(&mut self.robots)
        {
            maker.step(now, &truck.truth());
            while let Some(made) = maker.take(now) {
                robot.agent_mut().fix(now, now, &made.message(now));
            }
        }
    }

    /// Traffic control from now on; `None` = nobody coordinates.
    pub fn set_traffic(&mut self, traffic: Option<Traffic>) {
        self.traffic = traffic;
    }

    /// Traffic control.
    pub fn traffic_mut(&mut self) -> Option<&mut Traffic> {
        self.traffic.as_mut()
    }

    /// Gives every robot this map to plan on.
    pub fn set_map(&mut self, map: &Map) {
        let floor = Arc::new(PreparedMap::of(map.clone()));
        for robot in &mut self.robots {
            robot.agent_mut().set_floor(floor.clone());
        }
    }

    /// Paths that were asked for come back after [`PLAN_MS`], whatever they cost this machine.
    fn deliver_plans(&mut self) {
        let now = self.now();
        while self.plans.front().is_some_and(|(at, ..)| *at <= now) {
            if let Some((_, index, done)) = self.plans.pop_front() {
                self.robots[index].agent_mut().planned(now, done);
            }
        }
    }

    /// This part of what the robots say to each other gets lost from now on.
    pub fn set_unheard(&mut self, part: f64, seed: u64) {
        self.unheard = (part, Rng::new(seed ^ 0x4EA2_0000, 0));
    }

    /// What each says of itself, to those near it that drive alone, as `robot-agent` lets them.
    fn hear(&mut self) {
        let now = self.now();
        if now < self.next_hearing || !self.robots.iter().any(|robot| robot.agent().goes_alone(now)) {
            return;
        }
        self.next_hearing = now.plus_ms(HEARING_MS);
        let mut told = BTreeMap::<FloorCell, Vec<(usize, Arc<Neighbour>)>>::new();
        let mut here = Vec::with_capacity(self.robots.len());
        for (index, robot) in self.robots.iter_mut().enumerate() {
            let state = robot.state(now, Rejected::default());
            here.push((state.pose.x_m, state.pose.y_m));
            let said = Neighbour::of(&state).filter(|_| !self.dead.contains(&index)).map(Arc::new);
            if let Some(said) = said {
                for cell in said.cells() {
                    told.entry(cell).or_default().push((index, said.clone()));
                }
            }
        }
        for (index, (robot, listener)) in self.robots.iter_mut().zip(&mut self.listeners).enumerate() {
            if !robot.agent().goes_alone(now) {
                continue;
            }
            if let Some(cells) = listener.around.moved(here[index].0, here[index].1) {
                listener.cells = cells;
            }
            let near = listener.cells.iter().filter_map(|cell| told.get(cell)).flatten();
            let near: BTreeMap<usize, &Arc<Neighbour>> = near.map(|(from, said)| (*from, said)).collect();
            for (_, said) in near.into_iter().filter(|(from, _)| *from != index) {
                let (part, noise) = &mut self.unheard;
                if !noise.chance(*part) {
                    robot.agent_mut().neighbour(now, said.clone());
                }
            }
        }
    }

    /// The agent of the robot with this index dies: no turn and no word of it any more, and its truck hears
    /// nothing.
    pub fn kill(&mut self, index: usize) {
        self.dead.insert(index);
    }

    /// Whether the agent of the robot with this index has died.
    #[must_use]
    pub fn is_dead(&self, index: usize) -> bool {
        self.dead.contains(&index)
    }

    /// One step of the world and one turn of every robot.
    pub fn step(&mut self) {
        let Self { simulation, robots, leases, bytes, dead, planner, plans, .. } = self;
        let (context, trucks) = simulation.split_step();
        let now = context.now();
        // One robot after the other, as long as it is in the processor's cache: no truck's step depends on what
        // another robot does in its turn.
        for (index, ((truck, robot), lease)) in trucks.iter_mut().zip(robots).zip(leases).enumerate() {
            truck.step(&context);
            if dead.contains(&index) {
                continue;
            }
            if let Some(lease) = lease {
                robot.agent_mut().heard(now, *lease);
            }
            turn(truck, robot, now, bytes);
            while robot.agent_mut().next_event().is_some() {}
            if let Some(job) = robot.agent_mut().take_plan_job() {
                plans.push_back((now.plus_ms(PLAN_MS), index, job.run(planner)));
            }
        }
        self.fix();
        self.hear();
        if let Some(traffic) = &mut self.traffic {
            traffic.step(now, &mut self.robots, &self.dead);
        }
        self.deliver_plans();
    }
}

/// One turn of a robot on its truck: what the truck has sent, the robot's turn, what it sends. `bytes`
/// is scratch space.
pub fn turn(truck: &mut Truck, robot: &mut Robot, now: Stamp, bytes: &mut Vec<u8>) {
    bytes.clear();
    truck.take_board_tx(bytes);
    robot.board_bytes(now, bytes);
    bytes.clear();
    truck.take_gyro_tx(bytes);
    robot.gyro_bytes(now, bytes);
    if let Some(frame) = robot.turn(now) {
        truck.board_rx(frame.as_bytes());
    }
    while let Some(frame) = robot.board_request(now) {
        truck.board_rx(frame.as_bytes());
    }
    if let Some(command) = robot.gyro_request(now) {
        truck.gyro_rx(command);
    }
}
