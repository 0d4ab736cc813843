//! The simulator of bad days: a fleet, its people and their network in virtual time, one history a seed.
//!
//! The robots are the agents' own code ([`xtb_authority::Robot`]), the people use the clients' own
//! ([`xtb_authority::Operator`]). Everything else goes wrong: messages are lost, late, doubled and
//! repeated by strangers, agents are killed, held up and restarted, lines break, sticks are held. A
//! witness of each robot, which knows only what reached its door and what it answered, checks at every
//! turn that nothing moves without authority.
//!
//! ```text
//!   seed ─► plan: world, changes, scenes
//!                       │
//!   people ◄──► network ┼──► door ─► agent ◄──► truck        one turn = 5 ms
//!                       │      └───────┬──────────┘
//!                       └──────────► witness ─► violation, with the last lines of the history
//! ```
//! Same seed, same history, bit for bit, on any machine and in any number of threads.

mod changes;
mod fleet;
mod history;
mod network;
mod people;
mod plan;
mod report;
mod scenes;
mod witness;

use crate::faults::{DriveFault, SensorFaults};
use crate::parameters::TruckParameters;
use crate::simulation::{STEP_NS, Simulation, SimulationError};
use fleet::{Process, Told};
use history::{Happened, History, Sender};
use network::{End, Message, Network, Parcel, Seen};
use people::Person;
use plan::Plan;
use thiserror::Error;
use witness::{Broken, Motion, Truth, Witness};
use xtb_authority::Guard;
use xtb_control::VehicleConfig;
use xtb_control::units::Stamp;
use xtb_protocol::Uuid;
use xtb_protocol::keys::{Name, NameError};
use xtb_protocol::messages::{Body, EventKind, Request, TruthRobot};

pub use report::{Counts, Invariant, Report, Violation};

/// Turns of 5 ms since the day began.
type Turn = u32;

const MS_PER_TURN: u64 = STEP_NS / 1_000_000;

const fn ms(ms: u32) -> Turn {
    ms / MS_PER_TURN as u32
}

fn turns(s: f64) -> Turn {
    (s * 1000.0 / MS_PER_TURN as f64) as Turn
}

fn stamp(turn: Turn) -> Stamp {
    Stamp::from_ms(u64::from(turn) * MS_PER_TURN)
}

/// A truck this near to a wall that touches something touches the wall.
const NEAR_M: f64 = 0.05;

/// How a day is to be simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Every robot is without this rule: for the mutation check alone.
    pub without: Option<Guard>,
}

/// Why there is no such day.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DayError {
    /// The world or its trucks are impossible.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A name that cannot stand in a key.
    #[error(transparent)]
    Name(#[from] NameError),
}

/// Simulates the day of this seed.
///
/// # Errors
/// A world that the seed makes impossible: a bug of this module.
pub fn run(seed: u64, options: Options) -> Result<Report, DayError> {
    live(seed, options, |_| {})
}

/// The same, and tells what happens, line by line, as it happens.
///
/// # Errors
/// As [`run`].
pub fn tell(seed: u64, options: Options, mut line: impl FnMut(&str)) -> Result<Report, DayError> {
    let mut told = 0;
    live(seed, options, |history| {
        let (lines, by_now) = history.since(told);
        told = by_now;
        lines.iter().for_each(|text| line(text));
    })
}

fn live(seed: u64, options: Options, mut each_turn: impl FnMut(&History)) -> Result<Report, DayError> {
    let mut day = Day::new(seed, options)?;
    let mut broken = None;
    while broken.is_none() && day.now < day.plan.length {
        broken = day.turn().err();
        each_turn(&day.history);
    }
    Ok(day.report(seed, broken))
}

/// One robot with all that surrounds it.
struct Post {
    process: Process,
    witness: Witness,
    transmitter: crate::Transmitter,
    lines: crate::LineFaults,
    plugged: [bool; 2],
    sensors: SensorFaults,
    drive: DriveFault,
    driven: bool,
    contacts: u64,
    session: bool,
}

struct Day {
    plan: Plan,
    next_change: usize,
    now: Turn,
    simulation: Simulation,
    posts: Vec<Post>,
    people: Vec<Person>,
    names: Vec<Name>,
    network: Network,
    history: History,
    counts: Counts,
    told: Vec<Told>,
    outbox: Vec<Parcel>,
}

type Found = (u8, Broken);

impl Day {
    fn new(seed: u64, options: Options) -> Result<Self, DayError> {
        let mut plan = Plan::draw(seed);
        let (world, starts) = plan.world().map_err(SimulationError::from)?;
        let vehicle = VehicleConfig::default();
        let names: Vec<String> = (1..=plan.robots).map(|i| format!("xtb-{i}")).collect();
        let starts: Vec<_> = names.iter().map(String::as_str).zip(starts).collect();
        let simulation = Simulation::with_starts(world, &TruckParameters::default(), &starts, seed)?;
        let fleet = Name::new("lab")?;
        let people_count = plan.people + plan.scenes.len();
        let names =
            (0..people_count).map(|i| Name::new(&format!("person-{i}"))).collect::<Result<Vec<_>, _>>()?;
        let person = |i| Person::new(i, plan.robots, plan.noise.fork());
        let mut people: Vec<Person> = (0..people_count as u8).map(person).collect();
        for scene in &plan.scenes {
            people[usize::from(scene.person)].play(scene.robot, scene.script());
        }
        let posts = (0..plan.robots)
            .map(|i| Post {
                process: Process::new(
                    &fleet,
                    &vehicle,
                    seed.wrapping_mul(64).wrapping_add(i as u64 * 8),
                    options.without,
                ),
                witness: Witness::new(people_count),
                transmitter: crate::Transmitter::default(),
                lines: crate::LineFaults::default(),
                plugged: [true; 2],
                sensors: SensorFaults::default(),
                drive: DriveFault::default(),
                driven: false,
                contacts: 0,
                session: true,
            })
            .collect();
        let network = Network::new(people_count, plan.robots, plan.people, plan.noise.fork());
        Ok(Self {
            plan,
            next_change: 0,
            now: 0,
            simulation,
            posts,
            people,
            names,
            network,
            history: History::default(),
            counts: Counts::default(),
            told: Vec::new(),
            outbox: Vec::new(),
        })
    }

    /// The world moves on by 5 ms, then everybody has a turn.
    fn turn(&mut self) -> Result<(), Found> {
        self.simulation.step();
        self.now += 1;
        self.network.advance(self.now);
        self.change();
        self.deliver()?;
        for i in 0..self.posts.len() {
            self.robot_turn(i).map_err(|broken| (i as u8, broken))?;
        }
        for person in &mut self.people {
            person.turn(self.now, self.plan.robots, &mut self.outbox);
        }
        for parcel in self.outbox.drain(..) {
            self.network.send(parcel);
        }
        Ok(())
    }

    fn change(&mut self) {
        while let Some((at, change)) = self.plan.changes.get(self.next_change).copied() {
            if at > self.now {
                return;
            }
            self.next_change += 1;
            self.apply(change);
        }
    }

    /// What arrived at this turn.
    fn deliver(&mut self) -> Result<(), Found> {
        let mut arrived = self.network.take_arrived();
        for parcel in arrived.drain(..) {
            let Parcel { by, robot, message } = parcel;
            match message {
                Message::Reply(_) | Message::Estopped(..) | Message::State(_) => {
                    self.people[usize::from(by.person)].receive(self.now, robot, &message);
                }
                message => self.at_door(by, robot, message),
            }
        }
        self.network.give_back(arrived);
        Ok(())
    }

    fn at_door(&mut self, by: Sender, robot: u8, message: Message) {
        let (now, post) = (self.now, &mut self.posts[usize::from(robot)]);
        if !post.process.runs() {
            return;
        }
        match message {
            // Encoded and decoded are some of them: all would take too long.
            Message::Ask(request) if self.counts.requests.is_multiple_of(16) => {
                self.ask(by, robot, scenes::crossed(request));
            }
            Message::Ask(request) => self.ask(by, robot, request),
            Message::Setpoint(setpoint) => {
                let tick = post.process.clock(now);
                let fresh = post.witness.setpoint(now, tick, by, &setpoint);
                self.counts.setpoints += 1;
                self.counts.obeyed += u64::from(fresh);
                post.process.setpoint(now, by, &self.names[usize::from(by.name)], setpoint);
                self.history.note_setpoint(now, robot, by, &setpoint, fresh);
            }
            Message::Estop(id) => self.estop(by, robot, id, false),
            Message::AskEstop(id) => self.estop(by, robot, id, true),
            Message::Bytes(bytes) => {
                if let Some(request) = scenes::decoded(&bytes) {
                    self.ask(by, robot, request);
                }
            }
            Message::Reply(_) | Message::Estopped(..) | Message::State(_) => {}
        }
    }

    fn estop(&mut self, by: Sender, robot: u8, id: Uuid, asked: bool) {
        let post = &mut self.posts[usize::from(robot)];
        self.counts.estops += 1;
        if post.witness.estop(post.process.latest() + 1, id) {
            self.history.note(self.now, Some(robot), Happened::Estop { by, id: id.as_u128() });
        }
        post.process.estop(by, id, asked);
    }

    fn ask(&mut self, by: Sender, robot: u8, request: Request) {
        let post = &mut self.posts[usize::from(robot)];
        self.counts.requests += 1;
        let retain = matches!(request.body, Body::Retain {});
        if !retain {
            let (id, lease, body) = (request.id.as_u128(), request.lease, request.body.clone());
            self.history.note(self.now, Some(robot), Happened::Asked { by, id, lease, body });
        }
        post.witness.asked(self.now, by, post.process.latest() + 1, &request);
        if let Some(reply) = post.process.ask(self.now, by, &self.names[usize::from(by.name)], request) {
            self.network.send(Parcel { by, robot, message: Message::Reply(reply) });
        }
    }

    fn robot_turn(&mut self, i: usize) -> Result<(), Broken> {
        let (now, robot) = (self.now, i as u8);
        let Self { simulation, posts, network, history, told, names, .. } = self;
        let (post, truck) = (&mut posts[i], &mut simulation.trucks_mut()[i]);
        if post.process.boot(now, truck) {
            post.witness.booted();
            self.counts.boots += 1;
            history.note(now, Some(robot), Happened::Agent(true));
        }
        let up = network.is_up(End::Robot(robot));
        if up != std::mem::replace(&mut post.session, up) {
            history.note(now, Some(robot), Happened::Session(up));
        }
        let turned = post.process.turn(now, truck, up, names, told);
        let motor = truck.truth().motor_counts;
        let mut told = std::mem::take(told);
        let heard = told.drain(..).try_for_each(|told| self.hear(robot, told));
        self.told = told;
        heard?;
        let post = &mut self.posts[i];
        let driven = motor != xtb_control::PwmCount::NEUTRAL.get();
        if driven != std::mem::replace(&mut post.driven, driven) {
            self.history.note(now, Some(robot), Happened::Motor(motor));
        }
        self.counts.driven += u64::from(driven);
        self.history.hash.add(u64::from(motor));
        let truck = &self.simulation.trucks()[i];
        let (battery_v, truck) = (truck.battery_v(), truck.truth());
        let truth = Truth {
            transmitter: post.transmitter,
            board_line: post.lines.board,
            gyro_line: post.lines.gyro,
            plugged: post.plugged,
            sensors: post.sensors,
            drive: post.drive,
            battery_v,
            speed_mps: truck.speed_mps,
            motor,
            turned,
        };
        post.witness.turn(now, &truth)?;
        let motion = self.motion(i, &truck);
        let post = &mut self.posts[i];
        post.contacts = truck.contacts;
        post.witness.moved(now, &motion)
    }

    /// How a truck moves; what it touches is looked at only when it touches something.
    fn motion(&self, i: usize, truck: &TruthRobot) -> Motion {
        let post = &self.posts[i];
        let (at_wall, near_others) = match truck.contacts > post.contacts {
            true => self.surroundings(i, truck),
            false => (false, false),
        };
        Motion {
            steering: post.process.steering(),
            speed_mps: truck.speed_mps,
            contacts: truck.contacts,
            sees: post.sensors == SensorFaults::default() && post.drive == DriveFault::None,
            at_wall,
            near_others,
        }
    }

    /// Whether it is at a wall of the room, and whether it is near anything else.
    fn surroundings(&self, i: usize, truck: &TruthRobot) -> (bool, bool) {
        let (sin, cos) = libm::sincos(truck.yaw_rad);
        let (across_m, along_m) = (0.25 * cos.abs() + 0.2 * sin.abs(), 0.25 * sin.abs() + 0.2 * cos.abs());
        let at_wall = truck.x_m.abs() + across_m > plan::WIDTH_M / 2.0 - NEAR_M
            || truck.y_m.abs() + along_m > plan::DEPTH_M / 2.0 - NEAR_M;
        let near = |(x_m, y_m): (f64, f64)| libm::hypot(x_m - truck.x_m, y_m - truck.y_m) < 1.0;
        let others = self.simulation.truths().enumerate().filter(|(j, _)| *j != i);
        let boxes = self.simulation.world().boxes().map(|(_, spec)| (spec.x_m, spec.y_m));
        (at_wall, others.map(|(_, other)| (other.x_m, other.y_m)).chain(boxes).any(near))
    }

    /// What an agent said in its turn.
    fn hear(&mut self, robot: u8, told: Told) -> Result<(), Broken> {
        let now = self.now;
        let witness = &mut self.posts[usize::from(robot)].witness;
        match told {
            Told::Reply { to, arrival, request, reply } => {
                let answer = witness.answered(now, to, arrival, &request, &reply);
                let id = request.id.as_u128();
                if let Ok(answer) = &answer {
                    self.counts.goals +=
                        u64::from(matches!(answer, history::Answer::Done { goal: Some(_), .. }));
                    let retain = matches!(request.body, Body::Retain {});
                    self.history.answered(now, robot, to.name, id, *answer, retain);
                }
                answer?;
                self.network.send(Parcel { by: to, robot, message: Message::Reply(reply) });
            }
            Told::Estopped { to, id, latched } => {
                witness.estop_acknowledged(latched)?;
                self.network.send(Parcel { by: to, robot, message: Message::Estopped(id, latched) });
            }
            Told::Event(kind) => {
                self.history.event(now, robot, &kind);
                match kind {
                    EventKind::Goal { id, status, .. } => witness.goal_event(id.as_u128(), status)?,
                    EventKind::Lease { holder: None } => witness.lease_freed(now),
                    _ => {}
                }
            }
            Told::State(state) => {
                witness.state(now, &state)?;
                let seen = Seen {
                    epoch: state.epoch,
                    tick_ms: state.tick_ms,
                    seq: state.seq,
                    latched: !state.latches.is_empty(),
                };
                for person in 0..self.people.len() as u8 {
                    let by = Sender { person, name: person };
                    self.network.send(Parcel { by, robot, message: Message::State(seen) });
                }
            }
        }
        Ok(())
    }

    fn report(self, seed: u64, broken: Option<Found>) -> Report {
        let at_ms = u64::from(self.now) * MS_PER_TURN;
        let violation = broken.map(|(robot, (invariant, detail))| Violation {
            invariant,
            robot: format!("xtb-{}", robot + 1),
            at_ms,
            detail,
            last: self.history.last(robot),
        });
        let counts = Counts { lost: self.network.lost, ..self.counts };
        let hash = self.history.hash.get();
        Report { seed, robots: self.posts.len(), lasted_ms: at_ms, hash, counts, violation }
    }
}
