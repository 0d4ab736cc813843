//! All trucks of a world, stepped together.
//!
//! ```no_run
//! # use xtb_sim::{Simulation, TruckParameters, World};
//! # fn main() -> Result<(), xtb_sim::SimulationError> {
//! let mut simulation = Simulation::new(World::default(), &TruckParameters::default(), &["xtb-1"], 1)?;
//! simulation.step();
//! // The same on any number of threads: the bits do not depend on it. (A step of 100 trucks takes
//! // some 30 µs, so only a standing pool or a much larger fleet gains by it.)
//! let (context, trucks) = simulation.split_step();
//! std::thread::scope(|scope| {
//!     for chunk in trucks.chunks_mut(50) {
//!         scope.spawn(move || chunk.iter_mut().for_each(|truck| truck.step(&context)));
//!     }
//! });
//! # Ok(()) }
//! ```

mod held;

use crate::bodies::Bodies;
use crate::geometry::OrientedBox;
use crate::lattice::footprint;
use crate::parameters::{Body, TruckParameters};
use crate::scene::{Lists, Scene, StepContext};
use crate::step::STEP_NS;
use crate::vehicle::Truck;
use crate::world::{BoxSpec, World};
use crate::world_error::WorldError;
use std::collections::BTreeMap;
use thiserror::Error;
use xtb_control::config::ConfigError;
use xtb_control::frames::MapPose;
use xtb_control::units::Stamp;
use xtb_protocol::messages::TruthRobot;

/// Why a simulation cannot do what was asked.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SimulationError {
    /// The world is impossible.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The truck's true values are impossible.
    #[error("truck parameters: {0}")]
    Parameters(#[from] ConfigError),
    /// Two trucks of one name could not be told apart.
    #[error("two trucks have the name \"{name}\"")]
    NamedTwice {
        /// The name.
        name: String,
    },
    /// There is no truck of this number.
    #[error("there is no truck number {index}, only 0..{count}")]
    NoSuchTruck {
        /// As asked.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A pose that is not finite or too far away.
    #[error("pose {x_m}, {y_m}, {yaw_rad} is not finite or too far away")]
    Pose {
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// Counter-clockwise from +x, in rad.
        yaw_rad: f64,
    },
    /// Two bodies would be in one place.
    #[error("{what} would overlap {other}")]
    Occupied {
        /// What was to be put.
        what: String,
        /// What is already there.
        other: String,
    },
}

/// No coordinate or angle of a pose is farther from 0 than this, in m and rad.
const FARTHEST: f64 = 1e4;
/// Trucks of other programs that a simulation holds at most.
pub const MOST_FOREIGN: usize = 1024;

/// A truck that another program moves.
#[derive(Debug, Clone, Copy)]
struct Foreign {
    body: OrientedBox,
    until: Stamp,
}

/// Trucks in a world, at a moment of simulated time that only [`Simulation::step`] moves on.
#[derive(Debug, Clone)]
pub struct Simulation {
    world: World,
    scene: Scene,
    traffic: Bodies,
    trucks: Vec<Truck>,
    /// By name.
    foreign: BTreeMap<String, Foreign>,
    now: Stamp,
}

/// What some steps of all trucks need; `boxes` and `touched` lie island after island.
pub(crate) struct Window<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) lists: Lists<'a>,
    pub(crate) boxes: &'a mut [OrientedBox],
    pub(crate) touched: &'a mut [bool],
    pub(crate) trucks: &'a mut [Truck],
    pub(crate) start: Stamp,
}

impl Simulation {
    /// Trucks of these names at the world's start poses. `seed` decides all that is random; the
    /// same arguments give the same bits.
    ///
    /// # Errors
    /// Impossible parameters, a name twice, or a world with too little room.
    pub fn new<N: AsRef<str>>(
        world: World,
        parameters: &TruckParameters,
        names: &[N],
        seed: u64,
    ) -> Result<Self, SimulationError> {
        Self::of_kinds(world, &vec![parameters.clone(); names.len()], names, seed)
    }

    /// The same with a kind of truck for each name; each has as much room at its start as the largest needs.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    ///
    /// # Panics
    /// If there are not as many kinds as names.
    pub fn of_kinds<N: AsRef<str>>(
        world: World,
        kinds: &[TruckParameters],
        names: &[N],
        seed: u64,
    ) -> Result<Self, SimulationError> {
        kinds.iter().try_for_each(TruckParameters::validate)?;
        let starts = world.start_poses(names.len(), &Body::around(kinds.iter().map(|kind| &kind.body)))?;
        let robots: Vec<_> = names.iter().map(AsRef::as_ref).zip(starts).collect();
        Self::of_kinds_at(world, kinds, &robots, seed)
    }

    /// Trucks of these names at poses of the caller's choice, which may lie closer together than
    /// those of [`World::start_poses`] but not inside anything.
    ///
    /// # Errors
    /// Impossible parameters, a name twice, or a pose that is occupied or not finite.
    pub fn with_starts(
        world: World,
        parameters: &TruckParameters,
        robots: &[(&str, MapPose)],
        seed: u64,
    ) -> Result<Self, SimulationError> {
        Self::of_kinds_at(world, &vec![parameters.clone(); robots.len()], robots, seed)
    }

    /// The same with a kind of truck for each robot.
    ///
    /// # Errors
    /// As [`Simulation::with_starts`].
    ///
    /// # Panics
    /// If there are not as many kinds as robots.
    pub fn of_kinds_at(
        world: World,
        kinds: &[TruckParameters],
        robots: &[(&str, MapPose)],
        seed: u64,
    ) -> Result<Self, SimulationError> {
        assert_eq!(kinds.len(), robots.len(), "a kind for each robot");
        kinds.iter().try_for_each(TruckParameters::validate)?;
        for (i, (name, _)) in robots.iter().enumerate() {
            if robots[..i].iter().any(|(other, _)| other == name) {
                return Err(SimulationError::NamedTwice { name: (*name).to_owned() });
            }
        }
        let trucks: Vec<_> = robots
            .iter()
            .zip(kinds)
            .enumerate()
            .map(|(i, ((name, start), kind))| Truck::new(i, name, start, kind, seed))
            .collect();
        let scene = Scene::new(&world);
        let traffic = Bodies::new(&scene, &trucks, std::iter::empty());
        let foreign = BTreeMap::new();
        let simulation = Self { world, scene, traffic, trucks, foreign, now: Stamp::ZERO };
        for (i, (_, start)) in robots.iter().enumerate() {
            simulation.check_free(i, start)?;
        }
        Ok(simulation)
    }

    /// Simulated time since the start.
    #[must_use]
    pub fn now(&self) -> Stamp {
        self.now
    }

    /// The world as it is now.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// All trucks in their order.
    #[must_use]
    pub fn trucks(&self) -> &[Truck] {
        &self.trucks
    }

    /// All trucks in their order, to exchange bytes with them.
    pub fn trucks_mut(&mut self) -> &mut [Truck] {
        &mut self.trucks
    }

    /// The number of the truck of this name.
    #[must_use]
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.trucks.iter().position(|truck| truck.name() == name)
    }

    /// The true state of every truck, in their order.
    pub fn truths(&self) -> impl Iterator<Item = TruthRobot> {
        self.trucks.iter().map(Truck::truth)
    }

    /// One step of [`STEP_NS`] for all trucks.
    pub fn step(&mut self) {
        let (context, trucks) = self.split_step();
        for truck in trucks {
            truck.step(&context);
        }
    }

    /// Begins a step that the caller finishes: every truck must be stepped with the context exactly
    /// once, in any order and on any thread.
    pub fn split_step(&mut self) -> (StepContext<'_>, &mut [Truck]) {
        let Window { scene, lists, boxes, touched, trucks, start } = self.split_window(1);
        (StepContext { scene, lists, first: 0, boxes, touched, start }, trucks)
    }

    /// Trucks of other programs are there, which may be gone after the next step.
    pub(crate) fn has_foreign(&self) -> bool {
        !self.foreign.is_empty()
    }

    /// Begins so many steps that the caller finishes: every truck must be stepped as often, island by island.
    pub(crate) fn split_window(&mut self, steps: u64) -> Window<'_> {
        let now = self.now;
        self.foreign.retain(|_, known| known.until >= now);
        self.traffic.update(&self.trucks, self.foreign.values().map(|known| known.body), steps);
        for truck in &self.trucks {
            for &other in truck.ran_into() {
                self.traffic.mark_touched(other);
            }
        }
        let start = self.now;
        self.now = start.plus_ns(steps * STEP_NS);
        let (lists, boxes, touched) = self.traffic.split();
        Window { scene: &self.scene, lists, boxes, touched, trucks: &mut self.trucks, start }
    }

    /// Puts a truck elsewhere, standing. Its clocks, sensors and counters go on.
    ///
    /// # Errors
    /// No such truck, or a pose that is occupied or not finite.
    pub fn place(&mut self, index: usize, pose: MapPose) -> Result<(), SimulationError> {
        self.check_free(index, &pose)?;
        let count = self.trucks.len();
        let truck = self.trucks.get_mut(index).ok_or(SimulationError::NoSuchTruck { index, count })?;
        truck.place(&pose);
        Ok(())
    }

    /// A truck that another program moves is here, for the trucks of this world a body like theirs: they see it,
    /// and one that drives into it stops and has a contact. What it drives into itself is the other program's
    /// business. It is gone after `until`, unless it is told again. False = it is not taken: a pose that is not
    /// finite, the name of a truck of this world, or one of more than [`MOST_FOREIGN`].
    pub fn put_foreign(&mut self, name: &str, pose: &MapPose, body: &Body, until: Stamp) -> bool {
        let is_known = self.foreign.contains_key(name);
        let room = is_known || self.foreign.len() < MOST_FOREIGN;
        let is_own = !is_known && self.index_of(name).is_some();
        let finite = [pose.x_m, pose.y_m, pose.yaw_rad].iter().all(|v| v.is_finite() && v.abs() <= FARTHEST);
        if !room || is_own || !finite {
            return false;
        }
        let foreign = Foreign { body: footprint(pose, body), until };
        self.traffic.admit(&foreign.body);
        match self.foreign.get_mut(name) {
            Some(known) => *known = foreign,
            None => drop(self.foreign.insert(name.to_owned(), foreign)),
        }
        true
    }

    /// The names of those that other programs move, as of the last step.
    pub fn foreign(&self) -> impl Iterator<Item = &str> {
        self.foreign.keys().map(String::as_str)
    }

    /// Adds a box, or moves and resizes the one of that name.
    ///
    /// # Errors
    /// An impossible box, or one on top of a truck.
    pub fn put_box(&mut self, name: &str, spec: BoxSpec) -> Result<(), SimulationError> {
        let mut world = self.world.clone();
        world.put_box(name, spec)?;
        let what = format!("box \"{name}\"");
        let shape = spec.shape();
        if let Some(truck) = self.trucks.iter().find(|t| t.body().separation_m(&shape) <= 0.0) {
            return Err(SimulationError::Occupied { what, other: truck.name().to_owned() });
        }
        self.change_world(world);
        Ok(())
    }

    /// Takes a box away.
    ///
    /// # Errors
    /// No box has this name.
    pub fn remove_box(&mut self, name: &str) -> Result<(), SimulationError> {
        let mut world = self.world.clone();
        world.remove_box(name)?;
        self.change_world(world);
        Ok(())
    }

    fn change_world(&mut self, world: World) {
        self.world = world;
        self.scene = Scene::new(&self.world);
        self.trucks.iter_mut().for_each(Truck::look_again);
        let foreign = self.foreign.values().map(|known| known.body);
        self.traffic = Bodies::new(&self.scene, &self.trucks, foreign);
    }

    /// Refuses a pose of truck `index` inside something or beyond the limits.
    fn check_free(&self, index: usize, pose: &MapPose) -> Result<(), SimulationError> {
        let &MapPose { x_m, y_m, yaw_rad } = pose;
        if ![x_m, y_m, yaw_rad].iter().all(|v| v.is_finite() && v.abs() <= FARTHEST) {
            return Err(SimulationError::Pose { x_m, y_m, yaw_rad });
        }
        let count = self.trucks.len();
        let truck = self.trucks.get(index).ok_or(SimulationError::NoSuchTruck { index, count })?;
        let here = footprint(pose, truck.dimensions());
        let solids = self.world.solids().map(|solid| (solid.what, solid.shape));
        let others = self.trucks.iter().filter(|other| other.name() != truck.name());
        let foreign = self.foreign.iter().map(|(name, known)| (name.clone(), known.body));
        let others = others.map(|other| (other.name().to_owned(), other.body()));
        let mut all = solids.chain(others).chain(foreign);
        match all.find(|(_, shape)| here.separation_m(shape) <= 0.0) {
            Some((other, _)) => Err(SimulationError::Occupied { what: truck.name().to_owned(), other }),
            None => Ok(()),
        }
    }
}
