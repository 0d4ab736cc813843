//! Traffic control beside the robots of a lockstep simulation: the same state machine as behind
//! `fleet-cli traffic serve`, the same messages, on a network that may lose them or bring them late.

use super::window::Crew;
use crate::rng::Rng;
use std::collections::BTreeMap;
use std::sync::Arc;
use xtb_control::units::Stamp;
use xtb_nav::Car;
use xtb_nav::map::Map;
use xtb_protocol::messages::{Rejected, RobotState, Route};
use xtb_traffic::coordinator::{Coordinator, GridRoom, JointResult, Neighbours, ReportedRobot};

/// Reports come in and guides go out this often.
const TICK_MS: u64 = 100;
/// A joint plan takes this long in simulated time.
const JOINT_MS: u64 = 500;
/// A message is this long on its way.
const WAY_MS: u64 = 10;

/// What is on its way.
#[derive(Debug)]
enum Message {
    Report(Box<ReportedRobot>),
    Guide(Box<Route>),
}

/// Traffic control and its network.
#[derive(Debug)]
pub struct Traffic {
    room: Arc<GridRoom>,
    coordinator: Option<Coordinator>,
    epoch: u64,
    seq: u64,
    next: Stamp,
    due: Vec<(Stamp, JointResult)>,
    /// By when they arrive, and in the order in which they were sent; with the robot that has sent or gets it.
    on_way: BTreeMap<(Stamp, u64), (usize, Message)>,
    sent: u64,
    /// When the last message of each robot arrives at traffic control, and the last one for it there.
    last: BTreeMap<usize, [Stamp; 2]>,
    /// By name.
    views: BTreeMap<String, ReportedRobot>,
    noise: Rng,
    /// The part of all messages that gets lost.
    pub lost: f64,
    /// A message arrives up to so much later, in ms, at random, and none before one that was sent earlier. Traffic
    /// control takes it for new, as it does on a real network.
    pub late_ms: u64,
}

impl Traffic {
    /// Traffic control on this map.
    #[must_use]
    pub fn new(map: &Map, seed: u64) -> Self {
        let mut traffic = Self {
            room: Arc::new(GridRoom::of(map)),
            coordinator: None,
            epoch: 0,
            seq: 0,
            next: Stamp::ZERO,
            due: Vec::new(),
            on_way: BTreeMap::new(),
            sent: 0,
            last: BTreeMap::new(),
            views: BTreeMap::new(),
            noise: Rng::new(seed ^ 0x7AFF_1C00, 0),
            lost: 0.0,
            late_ms: 0,
        };
        traffic.restart();
        traffic
    }

    /// It dies: nobody is told anything any more.
    pub fn kill(&mut self) {
        (self.coordinator, self.due) = (None, Vec::new());
    }

    /// It begins anew and knows nothing.
    pub fn restart(&mut self) {
        self.kill();
        self.epoch += 1;
        self.seq = 0;
        self.coordinator = Some(Coordinator::new(self.room.clone(), self.epoch));
    }

    /// The state machine.
    #[must_use]
    pub fn coordinator(&self) -> Option<&Coordinator> {
        self.coordinator.as_ref()
    }

    /// When it does something next; `None` = it is dead.
    pub(super) fn next(&self) -> Option<Stamp> {
        self.coordinator.as_ref()?;
        let arrives = self.on_way.keys().next().map(|(at, _)| *at);
        Some(self.due.iter().map(|(at, _)| *at).chain(arrives).fold(self.next, Stamp::min))
    }

    /// One step of the simulation.
    pub(super) fn step(&mut self, now: Stamp, crews: &mut [Crew]) {
        self.deliver(now, crews);
        let Some(coordinator) = &mut self.coordinator else { return };
        let (due, later) = std::mem::take(&mut self.due).into_iter().partition(|(at, _)| *at <= now);
        self.due = later;
        for (_, result) in due {
            coordinator.planned(now, result);
        }
        if now < self.next {
            return;
        }
        self.next = now.plus_ms(TICK_MS);
        for (index, crew) in crews.iter_mut().enumerate().filter(|(_, crew)| !crew.dead) {
            let robot = &mut crew.robot;
            let state: RobotState = robot.state(now, Rejected::default());
            let report = ReportedRobot::of(&state, Some(Car::of(robot.vehicle())), WAY_MS);
            self.send(now, index, Message::Report(Box::new(report)));
        }
        self.deliver(now, crews);
        let Some(coordinator) = &mut self.coordinator else { return };
        let guides = coordinator.tick(now);
        self.seq += 1;
        let near = Neighbours::of(self.views.values());
        let mut routes = Vec::new();
        for (index, crew) in crews.iter().enumerate().filter(|(_, crew)| !crew.dead) {
            let name = crew.robot.agent().identity().robot.to_string();
            if let Some(guide) = guides.get(&name) {
                routes.push((index, guide.route(self.epoch, self.seq, near.near(&name))));
            }
        }
        for (index, route) in routes {
            self.send(now, index, Message::Guide(Box::new(route)));
        }
        self.deliver(now, crews);
        let Some(coordinator) = &mut self.coordinator else { return };
        while let Some(job) = coordinator.job(now) {
            self.due.push((now.plus_ms(JOINT_MS), job.solve(&mut || true)));
        }
    }

    fn send(&mut self, now: Stamp, index: usize, message: Message) {
        if self.noise.chance(self.lost) {
            return;
        }
        let late_ms = if self.late_ms > 0 { self.noise.up_to(self.late_ms) } else { 0 };
        let to_robot = matches!(message, Message::Guide(_));
        let last = &mut self.last.entry(index).or_insert([Stamp::ZERO; 2])[usize::from(to_robot)];
        *last = now.plus_ms(late_ms).max(*last);
        self.sent += 1;
        self.on_way.insert((*last, self.sent), (index, message));
    }

    /// What has arrived.
    fn deliver(&mut self, now: Stamp, crews: &mut [Crew]) {
        while let Some(first) = self.on_way.first_entry().filter(|first| first.key().0 <= now) {
            let (index, message) = first.remove();
            match message {
                Message::Report(report) => {
                    self.views.insert(report.name.clone(), (*report).clone());
                    if let Some(coordinator) = &mut self.coordinator {
                        coordinator.robot(now, *report);
                    }
                }
                Message::Guide(route) => {
                    if let Some(crew) = crews.get_mut(index).filter(|crew| !crew.dead) {
                        crew.robot.agent_mut().route(now, &route);
                    }
                }
            }
        }
    }
}
