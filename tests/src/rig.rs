//! Trucks on ptys, agents and a router as processes of their own, and what happens to the trucks when
//! those are killed: the trials behind `docs/safety.md`, few in CI, many in the bench `safety`.
//!
//! The ground truth is the simulated board's: since when it gives the motor neutral, on the world's
//! clock, which runs at real time. A truck drives to and fro between its start and 1.2 m ahead.

use crate::identities::{Access, Pki};
use crate::processes::{Process, RouterProcess, Signal, program};
use crate::{Fleet, Pilot, Setup, eventually};
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::process::Command;
use xtb_bus::Bus;
use xtb_control::Mode;
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, RobotState, TruthRobot, Via};

/// A truck that drives.
const DRIVES_MPS: f64 = 0.08;
/// How far it goes from its start.
const WAY_M: f64 = 1.2;
/// A truck that does not drive by then is sent again.
const AGAIN_S: f64 = 2.0;
/// For so long nothing may move after a stop.
const STANDS_S: f64 = 1.0;
/// Who drives, and who else may come to the router.
const PERSON: &str = "rig";
pub(crate) const STRANGER: &str = "stranger";

/// What a trial found.
#[derive(Debug, Clone, Copy)]
pub struct Trial {
    /// From the event to neutral on the board, in s of the world.
    pub neutral_s: f64,
    /// Whether it moved before it was commanded anew.
    pub moved: bool,
}

/// Trucks, their world, their agents and their router.
pub struct Rig {
    /// The world.
    pub fleet: Fleet,
    access: Access,
    router: RouterProcess,
    lines: PathBuf,
    agents: Vec<Process>,
    homes: Vec<TruthRobot>,
}

impl Rig {
    /// This many trucks, their agents ready; with or without identities.
    ///
    /// # Panics
    /// If something does not start.
    pub async fn start(robots: usize, lines: &Path, identities: bool) -> Self {
        let setup = Setup { robots, speed: 1.0, pty: Some(lines.to_owned()), ..Setup::default() };
        let access = Access::of(identities, robots, &[PERSON, STRANGER]);
        let router = RouterProcess::start(access.pki().map(Pki::folder));
        let fleet = Fleet::start(setup).await;
        fleet.simulated(0.1).await; // until then there is no truth
        let homes = (1..=robots).map(|number| fleet.truth(number)).collect();
        let mut rig = Self { fleet, access, router, lines: lines.to_owned(), agents: Vec::new(), homes };
        for number in 1..=robots {
            let agent = rig.agent(number);
            rig.agents.push(agent);
        }
        rig
    }

    fn agent(&self, number: usize) -> Process {
        let truth = self.fleet.truth(number);
        let pose = format!("{:.4},{:.4},{:.4}", truth.x_m, truth.y_m, truth.yaw_rad);
        let line = |device: &str| self.lines.join(format!("xtb-{number}.{device}"));
        let mut command = Command::new(program("robot-agent"));
        command.args(["--hardware", "serial"]);
        match self.access.pki() {
            None => command.args(["--name", &format!("xtb-{number}")]),
            Some(pki) => command.arg("--identity").arg(pki.folder().join(format!("xtb-{number}"))),
        };
        command.arg("--board").arg(line("board")).arg("--gyro").arg(line("gyro"));
        command.args(["--start-pose", &pose, "--connect", self.endpoint()]);
        Process::start(&mut command)
    }

    /// Where its router listens.
    pub fn endpoint(&self) -> &str {
        self.router.endpoint()
    }

    /// A session of the person who drives.
    pub async fn client(&self) -> Bus {
        self.access.session(PERSON, self.endpoint()).await
    }

    /// A truck's client there.
    pub async fn pilot(&self, bus: &Bus, number: usize) -> Pilot {
        Pilot::new(bus, "lab", &format!("xtb-{number}"), PERSON).await
    }

    /// Where a truck goes next: 1.2 m ahead of its start, or back.
    fn next_goal(&self, number: usize) -> (f64, f64) {
        let (home, now) = (&self.homes[number - 1], self.fleet.truth(number));
        let away = (now.x_m - home.x_m).hypot(now.y_m - home.y_m) > WAY_M / 2.0;
        let way = if away { 0.0 } else { WAY_M };
        (home.x_m + way * home.yaw_rad.cos(), home.y_m + way * home.yaw_rad.sin())
    }

    /// Sends a truck on its way, as soon as it is ready for that, and waits until it drives. Again if it
    /// does not: a machine so busy that its world stands still for 150 ms looks like broken lines.
    async fn drive(&self, number: usize, pilot: &Pilot, on_link_loss: LinkLoss) -> (f64, f64) {
        let (x_m, y_m) = self.next_goal(number);
        let goto =
            Body::Goto { x_m, y_m, yaw_rad: None, via: Some(Via::Direct), on_link_loss, finish_s: 120.0 };
        let asked_s = Cell::new(f64::NEG_INFINITY);
        eventually("driving", || async {
            if self.fleet.time_s() > asked_s.get() + AGAIN_S {
                pilot.ask(Body::Reset { latch: None }).await;
                // Dead reckoning alone would be metres off after some trials.
                let TruthRobot { x_m, y_m, yaw_rad, .. } = self.fleet.truth(number);
                pilot.ask(Body::SetPose { x_m, y_m, yaw_rad }).await;
                pilot.ask(goto.clone()).await;
                asked_s.set(self.fleet.time_s());
            }
            self.drives(number).then_some(())
        })
        .await;
        (x_m, y_m)
    }

    fn drives(&self, number: usize) -> bool {
        let truth = self.fleet.truth(number);
        truth.speed_mps.abs() > DRIVES_MPS && truth.neutral_since_s.is_none()
    }

    async fn neutral_since_s(&self, number: usize) -> f64 {
        eventually("neutral", || async { self.fleet.truth(number).neutral_since_s }).await
    }

    /// Whether it moves within a second although nobody has asked for it.
    async fn moves(&self, number: usize, neutral_since_s: f64) -> bool {
        self.fleet.simulated(STANDS_S).await;
        self.fleet.truth(number).neutral_since_s != Some(neutral_since_s)
    }

    /// `kill -9` of a truck's agent after `after_s` of driving; a new one is started afterwards.
    ///
    /// # Panics
    /// If the truck cannot be driven at all.
    pub async fn kill_agent(&mut self, number: usize, after_s: f64) -> Trial {
        let bus = self.client().await;
        let pilot = self.pilot(&bus, number).await;
        self.drive(number, &pilot, LinkLoss::Finish).await;
        self.fleet.simulated(after_s).await;
        if !self.drives(number) {
            self.drive(number, &pilot, LinkLoss::Finish).await;
        }
        let killed_s = self.fleet.time_s();
        self.agents[number - 1].signal(Signal::Kill);
        let neutral_since_s = self.neutral_since_s(number).await;
        let epoch = self.fleet.time_s();
        let agent = self.agent(number);
        self.agents[number - 1] = agent;
        self.ready(&bus, number).await;
        let moved = self.moves(number, neutral_since_s).await || self.fleet.time_s() < epoch;
        drop(pilot);
        bus.close().await;
        Trial { neutral_s: neutral_since_s - killed_s, moved }
    }

    /// The agent of a truck has heard its board and stands.
    async fn ready(&self, bus: &Bus, number: usize) {
        let key = self.fleet.robot(number).state();
        eventually("an agent that is ready", || async {
            let states = bus.get(&key, std::time::Duration::from_secs(1)).await.ok()?;
            let state = states.first()?.decode::<RobotState>().ok()?;
            (state.mode == Mode::Idle && state.input_age_ms.adc.is_some()).then_some(())
        })
        .await;
    }

    /// `SIGSTOP` of a truck's agent for `stopped_s`, then `SIGCONT`.
    ///
    /// # Panics
    /// If the truck cannot be driven at all.
    pub async fn freeze_agent(&mut self, number: usize, stopped_s: f64) -> Trial {
        let bus = self.client().await;
        let pilot = self.pilot(&bus, number).await;
        self.drive(number, &pilot, LinkLoss::Finish).await;
        let stopped_at_s = self.fleet.time_s();
        self.agents[number - 1].signal(Signal::Stop);
        let neutral_since_s = self.neutral_since_s(number).await;
        self.fleet.simulated(stopped_s).await;
        self.agents[number - 1].signal(Signal::Continue);
        let moved = self.moves(number, neutral_since_s).await;
        drop(pilot);
        bus.close().await;
        Trial { neutral_s: neutral_since_s - stopped_at_s, moved }
    }

    /// `kill -9` of the router while xtb-1 is teleoperated, xtb-2 drives to a goal that halts and xtb-3 to
    /// one that it finishes; a new router is started when the first two stand. Trials of the first
    /// two, and why the third has not arrived, if it has not.
    ///
    /// # Panics
    /// If the trucks cannot be driven at all.
    pub async fn kill_router(&mut self) -> (Trial, Trial, Option<String>) {
        let bus = self.client().await;
        let (teleop, halt, finish) =
            (self.pilot(&bus, 1).await, self.pilot(&bus, 2).await, self.pilot(&bus, 3).await);
        let ahead = self.next_goal(1) != (self.homes[0].x_m, self.homes[0].y_m);
        let rpm = if ahead { 20.0 } else { -20.0 };
        let (mut sent, mut to) = (0, (0.0, 0.0));
        while ![1, 2, 3].iter().all(|number| self.drives(*number)) {
            if !self.drives(3) {
                to = self.drive(3, &finish, LinkLoss::Finish).await;
            }
            if !self.drives(2) {
                self.drive(2, &halt, LinkLoss::Halt).await;
            }
            if sent % 40 == 0 {
                teleop.ask(Body::Reset { latch: None }).await;
            }
            // A joystick that was held before has to be let go once.
            teleop.setpoint(if sent % 40 == 0 { 0.0 } else { rpm }, 0.0).await;
            sent += 1;
            self.fleet.simulated(0.03).await;
        }
        let (x_m, y_m) = to;
        let killed_s = self.fleet.time_s();
        self.router.kill();
        let (first, second) = (self.neutral_since_s(1).await, self.neutral_since_s(2).await);
        drop((teleop, halt, finish));
        bus.close().await;
        self.router.restart();
        let bus = self.client().await;
        self.ready(&bus, 1).await;
        let moved = (self.moves(1, first).await, self.fleet.truth(2).neutral_since_s != Some(second));
        let arrives = || async {
            let states =
                bus.get(&self.fleet.robot(3).state(), std::time::Duration::from_secs(1)).await.ok()?;
            let goal = states.first()?.decode::<RobotState>().ok()?.goal?;
            goal.status.is_final().then_some(goal)
        };
        let goal = eventually("the third goal's end", arrives).await;
        let truth = self.fleet.truth(3);
        let off_m = (truth.x_m - x_m).hypot(truth.y_m - y_m);
        let there = goal.status == GoalStatus::Reached && off_m < 0.6;
        let missed = (!there).then(|| format!("{goal:?}, {off_m:.2} m off"));
        bus.close().await;
        let trial = |since_s: f64, moved| Trial { neutral_s: since_s - killed_s, moved };
        (trial(first, moved.0), trial(second, moved.1), missed)
    }

    /// Memory that a truck's agent holds, in KiB.
    #[must_use]
    pub fn memory_kib(&self, number: usize) -> u64 {
        self.agents[number - 1].memory_kib()
    }

    /// Ends everything.
    pub async fn end(self) {
        drop((self.agents, self.router));
        self.fleet.end().await;
    }
}
