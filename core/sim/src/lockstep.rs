//! Trucks and their robots in one loop, without threads, clocks or Zenoh: as fast as it goes.
//!
//! The same [`Robot`] as in `robot-agent`, the same bytes between it and its truck. A turn is a step
//! of the world; same arguments, same bits, step by step or many at once ([`Lockstep::run`]), on any
//! number of threads.

mod traffic;
mod window;

pub use traffic::Traffic;

use crate::bodies::WINDOW_STEPS;
use crate::executor::{Executor, Sequential};
use crate::fixes::{FixMaker, FixTruth};
use crate::rng::Rng;
use crate::simulation::{Simulation, SimulationError};
use crate::step::STEP_NS;
use crate::vehicle::Truck;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use thiserror::Error;
use window::Crew;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::units::Stamp;
use xtb_nav::Map;
use xtb_nav::geometry::Car;
use xtb_nav::navigator::PreparedMap;
use xtb_nav::navigator::near::Surroundings;
use xtb_nav::navigator::right_of_way::Neighbour;
use xtb_nav::planner::Planner;
use xtb_protocol::board::Frame;
use xtb_protocol::keys::{FloorCell, NameError};
use xtb_protocol::messages::{Body, Outcome, Rejected, Reply, Request, RobotState, TruthRobot};
use xtb_protocol::{Name, Uuid};
use xtb_robot::agent::Arrival;
use xtb_robot::{Robot, RobotIdentity};

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
    crews: Vec<Crew>,
    asked: Arrival,
    traffic: Option<Traffic>,
    planners: Vec<Planner>,
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
        let vehicles = vec![vehicle.clone(); simulation.trucks().len()];
        Self::of_kinds(simulation, fleet, &vehicles)
    }

    /// The same with a vehicle for each robot.
    ///
    /// # Errors
    /// As [`Lockstep::new`].
    ///
    /// # Panics
    /// If there are not as many vehicles as trucks.
    pub fn of_kinds(
        simulation: Simulation,
        fleet: &Name,
        vehicles: &[VehicleConfig],
    ) -> Result<Self, LockstepError> {
        assert_eq!(vehicles.len(), simulation.trucks().len(), "a vehicle for each truck");
        let robot = |(epoch, (truck, vehicle)): (usize, (&Truck, &VehicleConfig))| {
            let TruthRobot { x_m, y_m, yaw_rad, .. } = truck.truth();
            let identity = RobotIdentity {
                fleet: fleet.clone(),
                robot: Name::robot(truck.name())?,
                epoch: epoch as u64,
                start_pose: MapPose { x_m, y_m, yaw_rad },
            };
            Ok(Crew::new(Robot::new(identity, vehicle.clone(), "lockstep")))
        };
        let crews: Vec<Crew> = simulation
            .trucks()
            .iter()
            .zip(vehicles)
            .enumerate()
            .map(robot)
            .collect::<Result<_, NameError>>()?;
        let listener =
            |vehicle| Listener { around: Surroundings::of(&Car::of(vehicle)), cells: BTreeSet::new() };
        let listeners = vehicles.iter().map(listener).collect();
        Ok(Self {
            simulation,
            crews,
            asked: 0,
            traffic: None,
            planners: Vec::new(),
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
        if self.crews.get(index)?.lease.is_none() {
            let id = Uuid::from_u128(u128::MAX - u128::from(self.asked));
            let reply =
                self.ask(index, client, &Request { id, lease: None, body: Body::Acquire { take: true } })?;
            let Outcome::Ok(done) = reply.result else { return Some(reply) };
            self.crews[index].lease = done.lease;
        }
        let lease = self.crews[index].lease;
        self.ask(index, client, &Request { lease, ..request.clone() })
    }

    fn ask(&mut self, index: usize, client: &Name, request: &Request) -> Option<Reply> {
        let now = self.now();
        self.asked += 1;
        let arrival = self.asked;
        self.crews.get_mut(index).map(|crew| crew.robot.request(now, arrival, client, request))
    }

    /// The state of the robot with this index; `None` if there is none.
    pub fn state(&mut self, index: usize) -> Option<RobotState> {
        let now = self.now();
        self.crews.get_mut(index).map(|crew| crew.robot.state(now, Rejected::default()))
    }

    /// The robot with this index, to be told of poses and paths between two steps.
    pub fn robot_mut(&mut self, index: usize) -> Option<&mut Robot> {
        self.crews.get_mut(index).map(|crew| &mut crew.robot)
    }

    /// Pose fixes for every robot from now on.
    pub fn set_fixes(&mut self, truth: FixTruth, seed: u64) {
        for (truck, crew) in self.crews.iter_mut().enumerate() {
            crew.fixes = Some(FixMaker::new(truth.clone(), seed, truck));
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
        for crew in &mut self.crews {
            crew.robot.agent_mut().set_floor(floor.clone());
        }
    }

    /// This part of what the robots say to each other gets lost from now on.
    pub fn set_unheard(&mut self, part: f64, seed: u64) {
        self.unheard = (part, Rng::new(seed ^ 0x4EA2_0000, 0));
    }

    /// What each says of itself, to those near it that drive alone, as `robot-agent` lets them.
    fn hear(&mut self) {
        let now = self.now();
        if now < self.next_hearing || !self.crews.iter().any(|crew| crew.robot.agent().goes_alone(now)) {
            return;
        }
        self.next_hearing = now.plus_ms(HEARING_MS);
        let mut told = BTreeMap::<FloorCell, Vec<(usize, Arc<Neighbour>)>>::new();
        let mut here = Vec::with_capacity(self.crews.len());
        for (index, crew) in self.crews.iter_mut().enumerate() {
            let state = crew.robot.state(now, Rejected::default());
            here.push((state.pose.x_m, state.pose.y_m));
            let said = Neighbour::of(&state).filter(|_| !crew.dead).map(Arc::new);
            if let Some(said) = said {
                for cell in said.cells() {
                    told.entry(cell).or_default().push((index, said.clone()));
                }
            }
        }
        for (index, (crew, listener)) in self.crews.iter_mut().zip(&mut self.listeners).enumerate() {
            let robot = &mut crew.robot;
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
        if let Some(crew) = self.crews.get_mut(index) {
            crew.dead = true;
        }
    }

    /// Whether the agent of the robot with this index has died.
    #[must_use]
    pub fn is_dead(&self, index: usize) -> bool {
        self.crews.get(index).is_some_and(|crew| crew.dead)
    }

    /// One step of the world and one turn of every robot.
    pub fn step(&mut self) {
        self.run(1, &Sequential);
    }

    /// So many steps, with the same bits as one by one, whatever the executor: trucks that cannot come near each
    /// other meanwhile are moved on by several steps in a row.
    pub fn run(&mut self, steps: u64, executor: &impl Executor) {
        let mut left = steps;
        let mut goals = true;
        while left > 0 {
            let steps = self.window_steps(goals).min(left);
            left -= steps;
            let window = self.simulation.split_window(steps);
            let news = window::run(window, &mut self.crews, steps, executor);
            if news.jobs {
                window::plan(&mut self.crews, &mut self.planners, executor);
            }
            if news.goals {
                self.hear();
            }
            let now = self.now();
            if let Some(traffic) = &mut self.traffic {
                traffic.step(now, &mut self.crews);
            }
            if news.plans {
                self.crews.iter_mut().for_each(|crew| crew.deliver_plans(now));
            }
            goals = news.goals;
        }
    }

    /// For so many steps nobody hears anything of anybody, but at the end. `goals`: whether anybody may have a
    /// planned one; who has none gets none within a window.
    fn window_steps(&self, goals: bool) -> u64 {
        if self.simulation.has_foreign() {
            return 1;
        }
        let now = self.now();
        let until = |next: Stamp| next.ns().saturating_sub(now.ns()).div_ceil(STEP_NS);
        let traffic = self.traffic.as_ref().and_then(Traffic::next);
        // A path that somebody asks for is back at the earliest when the window ends.
        let most = if goals { PLAN_MS * 1_000_000 / STEP_NS } else { WINDOW_STEPS };
        let steps = traffic.map_or(most, |next| until(next).clamp(1, most));
        if !goals {
            return steps;
        }
        if now < self.next_hearing {
            return until(self.next_hearing).min(steps);
        }
        // It is due as soon as somebody goes alone.
        let then = now.plus_ns(steps * STEP_NS);
        if self.crews.iter().any(|crew| crew.robot.agent().goes_alone(then)) { 1 } else { steps }
    }
}

/// One turn of a robot on its truck: what the truck has sent, the robot's turn, what it sends. `bytes`
/// is scratch space.
pub fn turn(truck: &mut Truck, robot: &mut Robot, now: Stamp, bytes: &mut Vec<u8>) {
    listen(truck, robot, now, bytes);
    let frame = robot.turn(now);
    speak(truck, robot, now, frame);
}

/// What the truck has sent.
fn listen(truck: &mut Truck, robot: &mut Robot, now: Stamp, bytes: &mut Vec<u8>) {
    bytes.clear();
    truck.take_board_tx(bytes);
    robot.board_bytes(now, bytes);
    bytes.clear();
    truck.take_gyro_tx(bytes);
    robot.gyro_bytes(now, bytes);
}

/// The frame of the robot's turn, and what else it sends.
fn speak(truck: &mut Truck, robot: &mut Robot, now: Stamp, frame: Option<Frame>) {
    if let Some(frame) = frame {
        truck.board_rx(frame.as_bytes());
    }
    while let Some(frame) = robot.board_request(now) {
        truck.board_rx(frame.as_bytes());
    }
    if let Some(command) = robot.gyro_request(now) {
        truck.gyro_rx(command);
    }
}
