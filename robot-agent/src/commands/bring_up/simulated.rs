//! The person beside a simulated truck: hands that do what is asked for, eyes that answer by what is so.

use super::Person;
use super::dialogue::{Chore, Motion, Question, WHEELS_UP};
use super::plan::Stick;
use crate::commands::Failure;
use crate::commands::calibrate::bench::Bench;
use crate::commands::calibrate::console::Input;
use crate::commands::run::Lines;
use robot_agent::config::ConfigFile;
use robot_agent::hardware::instruments::Instruments;
use robot_agent::hardware::simulated::{LoneTruck, WorldOrders};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use xtb_control::VehicleConfig;
use xtb_control::calibration::{Actuator, ActuatorKind};
use xtb_sim::{Hands, Simulation, Transmitter, Truck, TruckParameters};

/// A simulated truck's world need not wait for anybody's watch.
const SPEED: f64 = 1000.0;
/// Less is not seen to move, in degrees and m/s.
const SEEN_DEG: f64 = 2.0;
const SEEN_MPS: f64 = 0.01;
/// The selector stays on manual for so long, in s.
const MANUAL_S: f64 = 0.7;

/// What the eyes have seen of the truck at a moment.
#[derive(Debug, Clone, Copy, Default)]
struct Sight {
    steering_deg: [f64; 2],
    bumpers_deg: [f64; 2],
    speed_mps: f64,
}

pub(super) struct SimulatedPerson {
    vehicle: VehicleConfig,
    orders: WorldOrders,
    answers: SyncSender<String>,
    sights: Arc<Mutex<Vec<Sight>>>,
    /// When the selector goes back to automatic.
    automatic_at_s: Option<f64>,
}

/// The truck that the settings describe, and the person beside it.
pub(super) fn meet(file: &ConfigFile) -> Result<(Lines, Input, SimulatedPerson), Failure> {
    let mut parameters = TruckParameters::of(&file.vehicle);
    parameters.board.answers_asks = true; // firmware as it is flashed today
    let (truck, clock) = LoneTruck::start_of(&parameters, u64::from(file.hardware.seed), SPEED)
        .map_err(|error| Failure::new(error, "the simulated truck does not fit into its room"))?;
    let (answers, answered) = sync_channel(8);
    let (orders, vehicle) = (truck.orders(), file.vehicle.clone());
    let person = SimulatedPerson { vehicle, orders, answers, sights: Arc::default(), automatic_at_s: None };
    Ok(((Box::new(truck), clock), Input::Lines(answered), person))
}

impl SimulatedPerson {
    pub(super) fn truck(&self, act: impl FnOnce(&mut Truck) + Send + 'static) {
        self.orders.change(move |simulation: &mut Simulation| {
            if let Some(truck) = simulation.trucks_mut().first_mut() {
                act(truck);
            }
        });
    }

    fn hands_on(&self, hands: Hands) {
        self.truck(move |truck| truck.set_hands(hands));
    }

    fn transmitter(&self, transmitter: Transmitter) {
        self.truck(move |truck| truck.set_transmitter(transmitter));
    }

    fn say(&self, answer: &str) {
        // Who does not hear it any more does not ask any more.
        let _ = self.answers.try_send(answer.to_owned());
    }

    /// What moved between the first look and the second.
    fn saw(&self, motion: Motion) -> &'static str {
        let sights = self.sights.lock().unwrap_or_else(PoisonError::into_inner);
        let [before, while_moving] = sights[..] else { return "nothing" };
        let (change, least, [more, less]) = match motion {
            Motion::Motor { .. } => (while_moving.speed_mps, SEEN_MPS, ["ahead", "astern"]),
            Motion::Servo(actuator) => servo(actuator, &before, &while_moving),
        };
        match change {
            change if change >= least => more,
            change if change <= -least => less,
            _ => "nothing",
        }
    }
}

fn servo(actuator: Actuator, before: &Sight, after: &Sight) -> (f64, f64, [&'static str; 2]) {
    match actuator.kind() {
        ActuatorKind::Steering(axle) => {
            (after.steering_deg[axle] - before.steering_deg[axle], SEEN_DEG, ["right", "left"])
        }
        ActuatorKind::Bumper(end) => {
            (after.bumpers_deg[end] - before.bumpers_deg[end], SEEN_DEG, ["up", "down"])
        }
        ActuatorKind::Piston(_) => (0.0, SEEN_DEG, ["up", "down"]),
    }
}

impl Person for SimulatedPerson {
    fn hands(&mut self, chore: Chore, now_s: f64) {
        self.transmitter(Transmitter::default());
        match chore {
            Chore::Wait | Chore::LetGo => {}
            Chore::HoldBefore { place, cm } => {
                let Some(finder) = place.finders(&self.vehicle).get(place.slot).copied() else { return };
                self.orders.change(move |simulation| {
                    // What would lie inside the truck is not held; it is then not seen either.
                    let _ = simulation.hold_before(0, &finder, place.is_rear, cm / 100.0);
                });
            }
            Chore::TakeAway => self.orders.change(Simulation::take_away),
            Chore::TurnWheels => self.hands_on(Hands { roll_m: 0.3, ..Hands::default() }),
            Chore::LiftNose => self.hands_on(Hands { nose_up_deg: 10.0, ..Hands::default() }),
            Chore::LiftLeft => self.hands_on(Hands { left_up_deg: 10.0, ..Hands::default() }),
            Chore::PutDown => self.hands_on(Hands::default()),
            Chore::TurnRight => self.hands_on(Hands { turn_deg: 90.0, ..Hands::default() }),
            Chore::Push(Stick::Speed) => self.transmitter(Transmitter { speed: 1.0, ..Default::default() }),
            Chore::Push(Stick::Steering) => {
                self.transmitter(Transmitter { steering: 1.0, ..Default::default() })
            }
            Chore::Selector => {
                self.transmitter(Transmitter { selector_manual: true, ..Default::default() });
                self.automatic_at_s = Some(now_s + MANUAL_S);
            }
            Chore::PressStop => self.truck(|truck| truck.set_emergency_stop(true)),
            Chore::ReleaseStop => self.truck(|truck| truck.set_emergency_stop(false)),
        }
    }

    fn goes_on(&mut self, now_s: f64) {
        if self.automatic_at_s.take_if(|at_s| now_s >= *at_s).is_some() {
            self.transmitter(Transmitter::default());
        }
    }

    fn asked(&mut self, question: &Question) {
        match question {
            Question::Ready(_) | Question::Calibrate(_) => self.say("yes"),
            Question::WheelsUp { .. } => self.say(WHEELS_UP),
            Question::Direction(motion) => self.say(self.saw(*motion)),
            Question::Length { .. } => self.say(""),
            Question::Voltmeter { .. } => {
                let answers = self.answers.clone();
                self.truck(move |truck| drop(answers.try_send(format!("{:.2}", truck.battery_v()))));
            }
        }
    }

    /// Nobody here mends a truck.
    fn told_of_failure(&mut self) {
        self.say("skip");
    }

    fn begins_to_watch(&mut self) {
        self.sights.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    fn eyes(&mut self, _: &mut Bench) {
        let sights = self.sights.clone();
        self.truck(move |truck| {
            let measured = truck.measured();
            let speed_mps = truck.truth().speed_mps;
            let sight =
                Sight { steering_deg: measured.steering_deg, bumpers_deg: measured.bumpers_deg, speed_mps };
            sights.lock().unwrap_or_else(PoisonError::into_inner).push(sight);
        });
    }

    fn instruments(&self) -> Option<Instruments> {
        Some(self.orders.instruments(0))
    }
}
