//! A whole robot (brain, controller, monitors) on a simulated truck, and a client who holds its lease.

use crate::agent::steps;
use std::collections::BTreeSet;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{
    Body, Done, Fault, GoalStatus, Lease, LinkLoss, Outcome, Rejected, Reply, Request, RobotState, Setpoint,
};
use xtb_protocol::{Name, Uuid};
use xtb_robot::agent::Arrival;
use xtb_robot::{Robot, RobotIdentity};
use xtb_sim::{Simulation, Truck, TruckParameters, World, lockstep};

/// Between two words of the client, in steps.
const EVERY_STEPS: u64 = 10;

/// One robot in a world of its own.
pub(crate) struct WholeRobot {
    pub(crate) simulation: Simulation,
    pub(crate) robot: Robot,
    /// Speed in rpm and steering, sent again and again.
    pub(crate) setpoint: Option<(f64, f64)>,
    /// Every fault that has been present so far.
    pub(crate) seen: BTreeSet<Fault>,
    client: Name,
    lease: Option<Lease>,
    arrivals: Arrival,
    bytes: Vec<u8>,
}

impl WholeRobot {
    /// It has run for half a second, stands, and has granted its lease.
    pub(crate) fn new(
        world: World,
        parameters: &TruckParameters,
        start: MapPose,
        seed: u64,
        config: &VehicleConfig,
    ) -> Self {
        let identity = RobotIdentity {
            fleet: Name::new("lab").unwrap(),
            robot: Name::robot("xtb-1").unwrap(),
            epoch: seed,
            start_pose: start,
        };
        let mut whole = Self {
            simulation: Simulation::with_starts(world, parameters, &[("xtb-1", start)], seed).unwrap(),
            robot: Robot::new(identity, config.clone(), "test"),
            setpoint: None,
            seen: BTreeSet::new(),
            client: Name::new("cli-1").unwrap(),
            lease: None,
            arrivals: 0,
            bytes: Vec::with_capacity(1024),
        };
        whole.robot.agent_mut().set_link(true);
        whole.run_s(0.5);
        if let Outcome::Ok(Done { lease, .. }) = whole.ask(Body::Acquire { take: false }).result {
            whole.lease = lease;
        }
        whole
    }

    pub(crate) fn truck(&mut self) -> &mut Truck {
        &mut self.simulation.trucks_mut()[0]
    }

    pub(crate) fn ask(&mut self, body: Body) -> Reply {
        self.arrivals += 1;
        let id = Uuid::from_u128(u128::from(self.arrivals));
        let request = Request { id, lease: self.lease, body };
        if let Some(lease) = self.lease {
            self.robot.agent_mut().heard(self.simulation.now(), lease);
        }
        self.robot.request(self.simulation.now(), self.arrivals, &self.client, &request)
    }

    /// Asks for a drive to a point; false if it is refused.
    pub(crate) fn goto(&mut self, x_m: f64, y_m: f64) -> bool {
        let reply = self.ask(Body::Goto {
            x_m,
            y_m,
            yaw_rad: None,
            via: None,
            on_link_loss: LinkLoss::Halt,
            finish_s: 300.0,
        });
        matches!(reply.result, Outcome::Ok(_))
    }

    pub(crate) fn goal_runs(&self) -> bool {
        let status = self.robot.agent().goal().map(|goal| goal.status);
        matches!(status, Some(GoalStatus::Accepted | GoalStatus::Running | GoalStatus::Blocked))
    }

    pub(crate) fn state(&mut self) -> RobotState {
        self.robot.state(self.simulation.now(), Rejected::default())
    }

    pub(crate) fn has(&self, fault: Fault) -> bool {
        self.robot.agent().faults().present().any(|present| present == fault)
    }

    pub(crate) fn step(&mut self) {
        self.speak();
        let Self { simulation, robot, bytes, seen, .. } = self;
        simulation.step();
        let now = simulation.now();
        lockstep::turn(&mut simulation.trucks_mut()[0], robot, now, bytes);
        while robot.agent_mut().next_event().is_some() {}
        seen.extend(robot.agent().faults().present());
    }

    pub(crate) fn run_s(&mut self, seconds: f64) {
        (0..steps(seconds)).for_each(|_| self.step());
    }

    /// The client keeps its lease and, if it teleoperates, sends its setpoint.
    fn speak(&mut self) {
        let now = self.simulation.now();
        let due = (now.ms() / 5).is_multiple_of(EVERY_STEPS);
        if !due || self.lease.is_none() {
            return;
        }
        self.ask(Body::Retain {});
        if let Some((rpm, steering)) = self.setpoint {
            self.arrivals += 1;
            let (lease, echo_tick_ms) = (self.lease, Some(now.ms()));
            let setpoint = Setpoint { lease, seq: self.arrivals, echo_tick_ms, rpm, steering };
            let Self { robot, client, arrivals, .. } = self;
            robot.agent_mut().setpoint(now, now, *arrivals, client, &setpoint);
        }
    }
}
