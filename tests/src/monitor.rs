//! Watches a fleet from outside, over its router: the ground truth of its simulator, and what its robots say of
//! themselves.

use crate::{Fleet, eventually, name, robot_name};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_protocol::Name;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{RobotState, Truth, TruthRobot};

/// Where ground truth comes from: a simulator in this process, or one that is watched from outside.
pub trait GroundTruth {
    /// Where `xtb-<number>` really is.
    ///
    /// # Panics
    /// If there is no such truck.
    fn truth(&self, number: usize) -> TruthRobot;

    /// Simulated time in s.
    fn time_s(&self) -> f64;
}

impl GroundTruth for Fleet {
    fn truth(&self, number: usize) -> TruthRobot {
        self.truth(number)
    }

    fn time_s(&self) -> f64 {
        self.time_s()
    }
}

/// The latest of everything.
#[derive(Debug, Default)]
struct Heard {
    truth: Option<Truth>,
    states: BTreeMap<Name, RobotState>,
}

/// Hears the ground truth, which is published 20 times a second, and all robots' states.
pub struct Monitor {
    heard: Arc<Mutex<Heard>>,
    _subscriptions: [Subscription; 2],
}

impl Monitor {
    /// Listens, and waits for the first ground truth.
    ///
    /// # Panics
    /// If Zenoh fails, or no simulator is there.
    pub async fn listen(bus: &Bus, fleet: &str) -> Self {
        let keys = FleetKeys::new(name(fleet));
        let heard = Arc::<Mutex<Heard>>::default();
        let (truths, states) = (heard.clone(), heard.clone());
        let truths = move |incoming: Incoming| {
            if let Ok(truth) = incoming.decode::<Truth>() {
                lock(&truths).truth = Some(truth);
            }
        };
        let states = move |incoming: Incoming| {
            if let Ok(state) = incoming.decode::<RobotState>() {
                lock(&states).states.insert(state.robot.clone(), state);
            }
        };
        let truths = bus.subscribe(&keys.sim_truth(), truths).await.unwrap_or_else(|error| panic!("{error}"));
        let states = bus.subscribe(&keys.any_robot().state(), states).await;
        let subscriptions = [truths, states.unwrap_or_else(|error| panic!("{error}"))];
        eventually("the ground truth", || async { lock(&heard).truth.is_some().then_some(()) }).await;
        Self { heard, _subscriptions: subscriptions }
    }

    /// The latest ground truth.
    ///
    /// # Panics
    /// Never: [`Monitor::listen`] has waited for the first one.
    #[must_use]
    pub fn latest(&self) -> Truth {
        lock(&self.heard).truth.clone().unwrap_or_else(|| panic!("no ground truth"))
    }

    /// What a robot has said last; `None` = nothing yet.
    #[must_use]
    pub fn state(&self, robot: &Name) -> Option<RobotState> {
        lock(&self.heard).states.get(robot).cloned()
    }

    /// Waits until what `xtb-<number>` says satisfies `is`.
    ///
    /// # Panics
    /// If it does not in time.
    pub async fn until(&self, number: usize, what: &str, is: impl Fn(&RobotState) -> bool) -> RobotState {
        let robot = robot_name(number);
        eventually(&format!("{robot}: {what}"), || async { self.state(&robot).filter(|state| is(state)) })
            .await
    }
}

impl GroundTruth for Monitor {
    fn truth(&self, number: usize) -> TruthRobot {
        let (robot, truth) = (robot_name(number), self.latest());
        *truth.robots.get(&robot).unwrap_or_else(|| panic!("no truck {number}"))
    }

    fn time_s(&self) -> f64 {
        self.latest().t_s
    }
}

fn lock(heard: &Mutex<Heard>) -> MutexGuard<'_, Heard> {
    heard.lock().unwrap_or_else(PoisonError::into_inner)
}
