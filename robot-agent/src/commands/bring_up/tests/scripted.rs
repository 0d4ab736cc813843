//! A truck and a person of which the session sees no more than of real ones.

use crate::commands::bring_up::detect::View;
use crate::commands::bring_up::dialogue::{Chore, Motion, Question, Verdict, WHEELS_UP, Wrong};
use crate::commands::bring_up::plan::Stick;
use crate::commands::bring_up::session::Event;
use std::collections::BTreeSet;
use xtb_control::VehicleConfig;
use xtb_control::calibration::ActuatorKind;
use xtb_control::vehicle::SLOTS;
use xtb_sim::rng::Rng;

const TURN_S: f64 = 0.02;
/// Hands need so long to begin.
const HANDS_S: f64 = 0.6;

/// A truck.
pub(super) struct Fake {
    vehicle: VehicleConfig,
    /// Names of steps whose thing is broken.
    broken: BTreeSet<String>,
    now_s: f64,
    chore: Chore,
    began_s: f64,
    pub(super) lost_after_s: Option<f64>,
    pub(super) mends_after_s: Option<f64>,
    /// Each range finder answers at its right neighbour's channel.
    pub(super) swapped: bool,
    pub(super) reversed: bool,
    pub(super) no_receiver: bool,
    pub(super) gyro_lost: bool,
    pub(super) moved: usize,
}

impl Fake {
    pub(super) fn new(vehicle: VehicleConfig, broken: BTreeSet<String>) -> Self {
        Self {
            vehicle,
            broken,
            now_s: 0.0,
            chore: Chore::Wait,
            began_s: 0.0,
            lost_after_s: None,
            mends_after_s: None,
            swapped: false,
            reversed: false,
            no_receiver: false,
            gyro_lost: false,
            moved: 0,
        }
    }

    pub(super) fn begin(&mut self, chore: Chore) {
        (self.chore, self.began_s) = (chore, self.now_s);
    }

    fn is_broken(&self, id: &str) -> bool {
        self.broken.contains(id) && self.mends_after_s.is_none_or(|at_s| self.now_s < at_s)
    }

    pub(super) fn does(&self, id: &str) -> Verdict {
        if self.is_broken(id) { Err(Wrong::new("broken", "mend it")) } else { Ok("well".into()) }
    }

    pub(super) fn moves(&mut self, motion: Motion) -> Verdict {
        self.moved += 1;
        match motion {
            // Its own sensor tells.
            Motion::Servo(actuator) if matches!(actuator.kind(), ActuatorKind::Piston(_)) => {
                self.does(&format!("servo-{actuator}"))
            }
            _ => Ok(String::new()),
        }
    }

    pub(super) fn look(&mut self) -> View {
        self.now_s += TURN_S;
        if self.lost_after_s.is_some_and(|at_s| self.now_s > at_s) {
            let what = "board_unplugged: /dev/serial/by-id/usb-1: no such device";
            return View {
                now_s: self.now_s,
                fault: Some(Wrong::new(what, "plug it in")),
                ..View::default()
            };
        }
        let hands_s = self.now_s - self.began_s - HANDS_S;
        let mut view = self.at_rest();
        if hands_s > 0.0 {
            self.act(&mut view, hands_s);
        }
        view
    }

    fn at_rest(&self) -> View {
        View {
            now_s: self.now_s,
            is_up: true,
            fault: None,
            gyro_fault: self.gyro_lost.then(|| Wrong::new("gyro_silent", "check its wires")),
            firmware: Some("1.1".into()),
            stop_pressed: Some(false),
            ranges_cm: Some([[None; SLOTS]; 2]),
            pulses: Some(0),
            tilt_deg: Some([0.4, -0.3]),
            yaw_deg: Some(170.0),
            sticks_ms: (!self.no_receiver).then_some([Some(1.5), Some(1.49)]),
            manual: (!self.no_receiver).then_some(false),
            battery_v: (!self.is_broken("battery")).then_some(7.4).or(Some(9.0)),
        }
    }

    fn act(&self, view: &mut View, hands_s: f64) {
        let way = if self.reversed { -1.0 } else { 1.0 };
        let right = self.vehicle.calibration.steering()[0].slope.signum();
        match self.chore {
            Chore::HoldBefore { place, cm } => {
                let id = format!("range-{}-{}", place.bumper(), place.slot + 1);
                let slot = place.slot + usize::from(self.swapped);
                if let Some(ranges_cm) = view.ranges_cm.as_mut().filter(|_| !self.is_broken(&id)) {
                    ranges_cm[usize::from(place.is_rear)][slot] = Some(cm + 0.7);
                }
            }
            Chore::TurnWheels if !self.is_broken("encoder") && hands_s < 2.0 => view.pulses = Some(30),
            Chore::LiftNose if !self.is_broken("pitch") => view.tilt_deg = Some([0.4 - way * 9.0, -0.3]),
            Chore::LiftLeft if !self.is_broken("roll") => view.tilt_deg = Some([0.4, -0.3 - way * 9.0]),
            // Through the jump from 180° to −180°.
            Chore::TurnRight if !self.is_broken("yaw") => {
                let yaw_deg = 170.0 + way * (hands_s * 45.0).min(90.0);
                view.yaw_deg = Some((yaw_deg + 180.0).rem_euclid(360.0) - 180.0);
            }
            Chore::Push(Stick::Speed) if !self.is_broken("stick-speed") => {
                view.sticks_ms = view.sticks_ms.map(|[speed_ms, other]| [speed_ms.map(|ms| ms + 0.4), other]);
            }
            Chore::Push(Stick::Steering) if !self.is_broken("stick-steering") => {
                view.sticks_ms = view.sticks_ms.map(|[other, ms]| [other, ms.map(|ms| ms + 0.4 * right)]);
            }
            Chore::Selector if !self.is_broken("selector") => view.manual = Some(hands_s < 1.0),
            Chore::PressStop => view.stop_pressed = Some(!self.is_broken("emergency-stop")),
            _ => {}
        }
    }
}

/// Whoever answers.
pub(super) struct Person {
    rng: Rng,
    /// Answers are wrong words with this probability; then asked again.
    slips: f64,
    quits: f64,
    again: bool,
    gone: bool,
}

impl Person {
    fn new(seed: u64, slips: f64, quits: f64) -> Self {
        Self { rng: Rng::new(seed, 0), slips, quits, again: false, gone: false }
    }

    pub(super) fn truthful() -> Self {
        Self::new(0, 0.0, 0.0)
    }

    /// Types nonsense now and then.
    pub(super) fn hasty(seed: u64) -> Self {
        Self::new(seed, 0.4, 0.0)
    }

    pub(super) fn who_quits(seed: u64, quits: f64) -> Self {
        Self::new(seed, 0.1, quits)
    }

    pub(super) fn who_tries_again() -> Self {
        Self { again: true, ..Self::truthful() }
    }

    /// Nobody is there.
    pub(super) fn gone() -> Self {
        Self { gone: true, ..Self::truthful() }
    }

    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.rng.chance(probability)
    }

    pub(super) fn decide(&mut self) -> Event {
        if self.gone {
            return Event::InputEnded;
        }
        if self.chance(self.slips) {
            return Event::Typed("what?".into());
        }
        Event::Typed(if self.again { "again" } else { "skip" }.into())
    }

    pub(super) fn answer(&mut self, question: &Question, fake: &Fake) -> Event {
        if self.gone {
            return Event::InputEnded;
        }
        if self.chance(self.quits) {
            return Event::Typed("quit".into());
        }
        if self.chance(self.slips) {
            let nonsense = ["hm", "no", "0x", "wheels", "maybe", "-"];
            let i = (self.rng.uniform(0.0, 1.0) * nonsense.len() as f64) as usize;
            return Event::Typed(nonsense[i.min(nonsense.len() - 1)].into());
        }
        Event::Typed(match question {
            Question::Ready(_) | Question::Calibrate(_) => "yes".into(),
            Question::WheelsUp { .. } => WHEELS_UP.into(),
            Question::Length { .. } => String::new(),
            Question::Voltmeter { .. } => "7.38".into(),
            Question::Direction(Motion::Servo(actuator)) if fake.is_broken(&format!("servo-{actuator}")) => {
                "nothing".into()
            }
            Question::Direction(Motion::Servo(actuator))
                if matches!(actuator.kind(), ActuatorKind::Steering(_)) =>
            {
                "right".into()
            }
            Question::Direction(Motion::Servo(_)) => "up".into(),
            Question::Direction(Motion::Motor { astern: true }) if fake.is_broken("motor-astern") => {
                "ahead".into()
            }
            Question::Direction(Motion::Motor { astern: true }) => "astern".into(),
            Question::Direction(Motion::Motor { astern: false }) if fake.is_broken("motor-ahead") => {
                "nothing".into()
            }
            Question::Direction(Motion::Motor { astern: false }) => "ahead".into(),
        })
    }
}
