//! Traffic control beside the robots of a lockstep simulation: the same state machine as behind
//! `fleet-cli traffic serve`, the same messages, on a network that may lose them.

use super::window::Crew;
use crate::rng::Rng;
use std::collections::BTreeMap;
use std::sync::Arc;
use xtb_control::units::Stamp;
use xtb_nav::Car;
use xtb_nav::map::Map;
use xtb_protocol::messages::{Rejected, RobotState};
use xtb_traffic::coordinator::{Coordinator, GridRoom, JointResult, Neighbours, ReportedRobot};

/// Reports come in and guides go out this often.
const TICK_MS: u64 = 100;
/// A joint plan takes this long in simulated time.
const JOINT_MS: u64 = 500;
/// A message is this long on its way.
const WAY_MS: u64 = 10;

/// Traffic control and its network.
#[derive(Debug)]
pub struct Traffic {
    room: Arc<GridRoom>,
    coordinator: Option<Coordinator>,
    epoch: u64,
    seq: u64,
    next: Stamp,
    due: Vec<(Stamp, JointResult)>,
    /// By name.
    views: BTreeMap<String, ReportedRobot>,
    noise: Rng,
    /// The part of all messages that gets lost.
    pub lost: f64,
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
            views: BTreeMap::new(),
            noise: Rng::new(seed ^ 0x7AFF_1C00, 0),
            lost: 0.0,
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
        Some(self.due.iter().map(|(at, _)| *at).fold(self.next, Stamp::min))
    }

    /// One step of the simulation.
    pub(super) fn step(&mut self, now: Stamp, crews: &mut [Crew]) {
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
        for robot in crews.iter_mut().filter(|crew| !crew.dead).map(|crew| &mut crew.robot) {
            if !self.noise.chance(self.lost) {
                let state: RobotState = robot.state(now, Rejected::default());
                let view = ReportedRobot::of(&state, Some(Car::of(robot.vehicle())), WAY_MS);
                self.views.insert(view.name.clone(), view.clone());
                coordinator.robot(now, view);
            }
        }
        let guides = coordinator.tick(now);
        self.seq += 1;
        let near = Neighbours::of(self.views.values());
        for robot in crews.iter_mut().filter(|crew| !crew.dead).map(|crew| &mut crew.robot) {
            let name = robot.agent().identity().robot.to_string();
            if let Some(guide) = guides.get(&name)
                && !self.noise.chance(self.lost)
            {
                robot.agent_mut().route(now, &guide.route(self.epoch, self.seq, near.near(&name)));
            }
        }
        while let Some(job) = coordinator.job(now) {
            self.due.push((now.plus_ms(JOINT_MS), job.solve(&mut || true)));
        }
    }
}
