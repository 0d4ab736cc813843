//! One scenario: the robots, their people and their network, turn by turn.

use crate::agents::{Process, Told};
use crate::change::{End, Sender};
use crate::event_log::{Answer, EventLog, Happened};
use crate::network::{Message, Network, Parcel, Seen};
use crate::operators::Person;
use crate::oracle::{Broken, Motion, Oracle, Truth};
use crate::plan::{self, Plan};
use crate::report::{DayCounts, DayReport, Violation};
use crate::scripts;
use crate::time::{MS_PER_TURN, Turn};
use crate::{ScenarioError, ScenarioOptions};
use xtb_control::VehicleConfig;
use xtb_protocol::Uuid;
use xtb_protocol::keys::Name;
use xtb_protocol::messages::{Body, EventKind, Request, TruthRobot};
use xtb_sim::faults::{DriveFault, SensorFaults};
use xtb_sim::parameters::TruckParameters;
use xtb_sim::simulation::{Simulation, SimulationError};

/// A truck this near to a wall that touches something touches the wall.
const NEAR_M: f64 = 0.05;

/// One robot with all that surrounds it.
pub(crate) struct Post {
    pub(crate) process: Process,
    pub(crate) oracle: Oracle,
    pub(crate) transmitter: xtb_sim::Transmitter,
    pub(crate) lines: xtb_sim::LineFaults,
    pub(crate) plugged: [bool; 2],
    pub(crate) sensors: SensorFaults,
    /// None of them is broken.
    pub(crate) sensors_well: bool,
    pub(crate) drive: DriveFault,
    /// What the agent has said in the present turn.
    told: Vec<Told>,
    driven: bool,
    contacts: u64,
    session: bool,
}

pub(crate) struct Scenario {
    pub(crate) plan: Plan,
    next_change: usize,
    pub(crate) now: Turn,
    pub(crate) simulation: Simulation,
    pub(crate) posts: Vec<Post>,
    pub(crate) people: Vec<Person>,
    names: Vec<Name>,
    pub(crate) network: Network,
    pub(crate) event_log: EventLog,
    counts: DayCounts,
    outbox: Vec<Parcel>,
    /// The robot that broke a rule, and which one.
    broken: Option<(u8, Broken)>,
}

impl Scenario {
    pub(crate) fn new(seed: u64, options: ScenarioOptions) -> Result<Self, ScenarioError> {
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
        let person = |i| Person::new(i, plan.robots, plan.rng.fork());
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
                    options.guards,
                ),
                oracle: Oracle::new(people_count),
                transmitter: xtb_sim::Transmitter::default(),
                lines: xtb_sim::LineFaults::default(),
                plugged: [true; 2],
                sensors: SensorFaults::default(),
                sensors_well: true,
                drive: DriveFault::default(),
                told: Vec::new(),
                driven: false,
                contacts: 0,
                session: true,
            })
            .collect();
        let network = Network::new(people_count, plan.robots, plan.people, plan.rng.fork());
        Ok(Self {
            plan,
            next_change: 0,
            now: 0,
            simulation,
            posts,
            people,
            names,
            network,
            event_log: EventLog::default(),
            counts: DayCounts::default(),
            outbox: Vec::new(),
            broken: None,
        })
    }

    /// Moves all of them on by 5 ms: one part of the turn for the robots of all scenarios, then the next part. The code
    /// of a whole turn is larger than the processor's cache for it.
    pub(crate) fn turn(scenarios: &mut [Self]) {
        for part in [Self::move_on, Self::listen, Self::agents_turn, Self::speak, Self::judge] {
            scenarios.iter_mut().for_each(part);
        }
    }

    /// Whether its time is up, or a rule was broken.
    pub(crate) fn is_over(&self) -> bool {
        self.broken.is_some() || self.now >= self.plan.length
    }

    /// The world moves on, then what befalls the robots does, and what was sent to them arrives.
    fn move_on(&mut self) {
        self.simulation.step();
        self.now += 1;
        self.network.advance(self.now);
        self.change();
        self.deliver();
    }

    /// Every agent that runs gets what its truck has sent.
    fn listen(&mut self) {
        let Self { now, simulation, posts, network, event_log, counts, .. } = self;
        for (robot, (post, truck)) in (0..).zip(posts.iter_mut().zip(simulation.trucks_mut())) {
            if post.process.boot(*now, truck) {
                post.oracle.booted();
                counts.boots += 1;
                event_log.note(*now, Some(robot), Happened::Agent(true));
            }
            let up = network.is_up(End::Robot(robot));
            if up != std::mem::replace(&mut post.session, up) {
                event_log.note(*now, Some(robot), Happened::Session(up));
            }
            post.process.listen(*now, truck);
        }
    }

    fn agents_turn(&mut self) {
        for post in &mut self.posts {
            post.process.turn(post.session, &self.names, &mut post.told);
        }
    }

    fn speak(&mut self) {
        for (post, truck) in self.posts.iter_mut().zip(self.simulation.trucks_mut()) {
            post.process.speak(truck, &mut post.told);
        }
    }

    /// The oracles look at what was said and done, then the people have their turn.
    fn judge(&mut self) {
        for robot in 0..self.posts.len() {
            if let Err(broken) = self.judge_robot(robot) {
                self.broken = Some((robot as u8, broken));
                return;
            }
        }
        for person in &mut self.people {
            person.turn(self.now, self.plan.robots, &mut self.outbox);
        }
        for parcel in self.outbox.drain(..) {
            self.network.send(parcel);
        }
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
    fn deliver(&mut self) {
        let mut arrived = self.network.take_arrived();
        for parcel in arrived.drain(..) {
            let Parcel { by, robot, message } = parcel;
            match message {
                Message::Reply(_) | Message::Estopped(..) | Message::State(_) => {
                    self.people[usize::from(by.person)].receive(self.now, robot, &message);
                }
                message => self.arrived(by, robot, message),
            }
        }
        self.network.give_back(arrived);
    }

    fn arrived(&mut self, by: Sender, robot: u8, message: Message) {
        let (now, post) = (self.now, &mut self.posts[usize::from(robot)]);
        if !post.process.runs() {
            return;
        }
        match message {
            // Encoded and decoded are some of them: all would take too long.
            Message::Ask(request) if self.counts.requests.is_multiple_of(16) => {
                self.ask(by, robot, scripts::crossed(*request));
            }
            Message::Ask(request) => self.ask(by, robot, *request),
            Message::Setpoint(setpoint) => {
                let tick = post.process.clock(now);
                let fresh = post.oracle.setpoint(now, tick, by, &setpoint);
                self.counts.setpoints += 1;
                self.counts.obeyed += u64::from(fresh);
                post.process.setpoint(now, by, &self.names[usize::from(by.name)], setpoint);
                self.event_log.note_setpoint(now, robot, by, &setpoint, fresh);
            }
            Message::Estop(id) => self.estop(by, robot, id, false),
            Message::AskEstop(id) => self.estop(by, robot, id, true),
            Message::Bytes(bytes) => {
                if let Some(request) = scripts::decoded(&bytes) {
                    self.ask(by, robot, request);
                }
            }
            Message::Reply(_) | Message::Estopped(..) | Message::State(_) => {}
        }
    }

    fn estop(&mut self, by: Sender, robot: u8, id: Uuid, asked: bool) {
        let post = &mut self.posts[usize::from(robot)];
        self.counts.estops += 1;
        if post.oracle.estop(post.process.latest() + 1, id) {
            self.event_log.note(self.now, Some(robot), Happened::Estop { by, id: id.as_u128() });
        }
        post.process.estop(by, id, asked);
    }

    fn ask(&mut self, by: Sender, robot: u8, request: Request) {
        let post = &mut self.posts[usize::from(robot)];
        self.counts.requests += 1;
        let retain = matches!(request.body, Body::Retain {});
        if !retain {
            let (id, lease, body) = (request.id.as_u128(), request.lease, request.body.clone());
            self.event_log.note(self.now, Some(robot), Happened::Asked { by, id, lease, body });
        }
        post.oracle.asked(self.now, by, post.process.latest() + 1, &request);
        if let Some(reply) = post.process.ask(self.now, by, &self.names[usize::from(by.name)], request) {
            self.network.send(Parcel { by, robot, message: Message::Reply(Box::new(reply)) });
        }
    }

    fn judge_robot(&mut self, i: usize) -> Result<(), Broken> {
        let (now, robot) = (self.now, i as u8);
        if !self.posts[i].told.is_empty() {
            let mut told = std::mem::take(&mut self.posts[i].told);
            let heard = told.drain(..).try_for_each(|told| self.hear(robot, told));
            self.posts[i].told = told;
            heard?;
        }
        let truck = &self.simulation.trucks()[i];
        let (battery_v, truck) = (truck.battery_v(), truck.truth());
        let motor = truck.motor_counts;
        let post = &mut self.posts[i];
        let driven = motor != xtb_control::PwmCount::NEUTRAL.get();
        if driven != std::mem::replace(&mut post.driven, driven) {
            self.event_log.note(now, Some(robot), Happened::Motor(motor));
        }
        self.counts.driven += u64::from(driven);
        self.event_log.hash.add(u64::from(motor));
        let truth = Truth {
            transmitter: post.transmitter,
            board_line: post.lines.board,
            gyro_line: post.lines.gyro,
            plugged: post.plugged,
            sensors: &post.sensors,
            sensors_well: post.sensors_well,
            drive: post.drive,
            battery_v,
            speed_mps: truck.speed_mps,
            motor,
            turned: post.process.has_turn(),
        };
        post.oracle.turn(now, &truth)?;
        let motion = self.motion(i, &truck);
        let post = &mut self.posts[i];
        post.contacts = truck.contacts;
        post.oracle.moved(now, &motion)
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
            sees: post.sensors_well && post.drive == DriveFault::None,
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
        let oracle = &mut self.posts[usize::from(robot)].oracle;
        match told {
            Told::Reply { to, arrival, request, reply } => {
                let answer = oracle.answered(now, to, arrival, &request, &reply);
                let id = request.id.as_u128();
                if let Ok(answer) = &answer {
                    self.counts.goals += u64::from(matches!(answer, Answer::Done { goal: Some(_), .. }));
                    let retain = matches!(request.body, Body::Retain {});
                    self.event_log.answered(now, robot, to.name, id, *answer, retain);
                }
                answer?;
                self.network.send(Parcel { by: to, robot, message: Message::Reply(Box::new(reply)) });
            }
            Told::Estopped { to, id, latched } => {
                oracle.estop_acknowledged(id, latched)?;
                self.network.send(Parcel { by: to, robot, message: Message::Estopped(id, latched) });
            }
            Told::Event(kind) => {
                self.event_log.event(now, robot, &kind);
                match kind {
                    EventKind::Goal { id, status, .. } => oracle.goal_event(id.as_u128(), status)?,
                    EventKind::Lease { holder } => oracle.lease(now, holder.is_some()),
                    _ => {}
                }
            }
            Told::State(state) => {
                oracle.state(now, &state)?;
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

    pub(crate) fn report(self, seed: u64) -> DayReport {
        let at_ms = u64::from(self.now) * MS_PER_TURN;
        let violation = self.broken.map(|(robot, (invariant, detail))| Violation {
            invariant,
            robot: format!("xtb-{}", robot + 1),
            at_ms,
            detail,
            last: self.event_log.last(robot),
        });
        let counts = DayCounts { lost: self.network.lost, ..self.counts };
        let hash = self.event_log.hash.get();
        DayReport { seed, robots: self.posts.len(), lasted_ms: at_ms, hash, counts, violation }
    }
}
