//! A real agent with an identity, on real time in a simulated room, with an ear on its board's line.

use fleet_tests::identities::Pki;
use fleet_tests::{Pilot, Probe, agent_config, eventually, name};
use robot_agent::clock::{Clock, WorldTime};
use robot_agent::config::{AgentConfig, Ros2};
use robot_agent::hardware::simulated::{RunningWorld, SimulatedHardware};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_bus::Bus;
use xtb_control::PwmCount;
use xtb_control::controller::PwmOutputs;
use xtb_sim::{Simulation, TruckParameters, World};

/// See the module's documentation.
pub(crate) struct Robot {
    passed: Receiver<(PwmOutputs, Instant)>,
    end: watch::Sender<bool>,
    agent: JoinHandle<()>,
    _world: RunningWorld,
}

impl Robot {
    /// `xtb-1`, once `bus` sees it; also as a node of ROS 2 if that is said.
    pub(crate) async fn start(pki: &Pki, router: &str, bus: &Bus, ros2: Option<Ros2>) -> Self {
        let (hardware, lines) = SimulatedHardware::connect();
        let simulation =
            Simulation::new(World::default(), &TruckParameters::default(), &["truck"], 1).unwrap();
        let world = RunningWorld::start(simulation, vec![lines], WorldTime::new(), 1.0, |_| {}).unwrap();
        let (sender, passed) = mpsc::channel();
        let probe = Probe::new(hardware, sender);
        let mut config = AgentConfig { ros2, ..agent_config(router, fleet_tests::identities::FLEET) };
        config.identity = Some(xtb_bus::Enrolled::load(&pki.folder().join("xtb-1")).unwrap());
        let (end, shutdown) = watch::channel(false);
        let agent = tokio::spawn(async move {
            robot_agent::run(&config, Box::new(probe), Clock::real(), shutdown).await.unwrap();
        });
        let alive = pki.keys().robot(&name("xtb-1")).alive();
        eventually("the agent", || async {
            let found = bus.alive(&alive, Duration::from_secs(1)).await.unwrap();
            (!found.is_empty()).then_some(())
        })
        .await;
        Self { passed, end, agent, _world: world }
    }

    /// The pulses to the motor since the last look, but for neutral.
    pub(crate) fn driven(&self) -> usize {
        self.passed.try_iter().filter(|(pulses, _)| pulses.motor != PwmCount::NEUTRAL).count()
    }

    /// Someone who drives it, with the lease and a state.
    pub(super) async fn pilot(bus: &Bus, client: &str) -> Pilot {
        let pilot = Pilot::new(bus, fleet_tests::identities::FLEET, "xtb-1", client).await;
        eventually("the lease and a state", || async {
            pilot.setpoint(0.0, 0.0).await;
            pilot.next_setpoint(0.0, 0.0)
        })
        .await;
        pilot
    }

    pub(crate) async fn end(self) {
        self.end.send_replace(true);
        self.agent.await.unwrap();
    }
}
