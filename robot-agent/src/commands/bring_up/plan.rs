//! Which steps a truck needs: they follow from what its settings say is fitted.

use xtb_control::VehicleConfig;
use xtb_control::calibration::{Actuator, ActuatorKind};
use xtb_control::vehicle::{BumperFinders, Drivetrain, Platform, SLOTS};

/// A range finder: bumper and number from the left, 0..[`SLOTS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) is_rear: bool,
    pub(super) slot: usize,
}

impl Place {
    /// As in `check-hardware`: `front 1`.
    pub(super) fn name(self) -> String {
        format!("{} {}", self.bumper(), self.slot + 1)
    }

    pub(super) fn bumper(self) -> &'static str {
        if self.is_rear { "rear" } else { "front" }
    }

    /// Those of this bumper.
    pub(super) fn finders(self, vehicle: &VehicleConfig) -> &BumperFinders {
        let fitted = &vehicle.range_finders;
        if self.is_rear { &fitted.rear } else { &fitted.front }
    }
}

/// A channel of the receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stick {
    Speed,
    Steering,
}

/// One step of a bring-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// The board speaks, and has confirmed its set-up.
    Board,
    /// Everything at rest, as `check-hardware` sees it.
    Check,
    /// The ruler's lengths.
    Measures,
    Battery,
    Range(Place),
    Encoder,
    /// The tilt sensor, nose up and left side up.
    Pitch,
    Roll,
    /// The gyro.
    Yaw,
    Stick(Stick),
    Selector,
    Servo(Actuator),
    EmergencyStop,
    Motor {
        astern: bool,
    },
    Calibrate(Actuator),
}

/// The steps of this vehicle, in their order: what can hurt comes after what stops it.
pub(super) fn steps(vehicle: &VehicleConfig) -> Vec<Step> {
    let has_platform = vehicle.platform != Platform::Off;
    let both_axles = vehicle.drivetrain == Drivetrain::BothAxles;
    let is_fitted = |actuator: &Actuator| match actuator.kind() {
        ActuatorKind::Steering(axle) => axle == 0 || both_axles,
        ActuatorKind::Bumper(_) => true,
        ActuatorKind::Piston(_) => has_platform,
    };
    let actuators: Vec<_> = Actuator::ALL.into_iter().filter(is_fitted).collect();
    let ranges = |is_rear| {
        let place = Place { is_rear, slot: 0 };
        let fitted = place.finders(vehicle).0.len().min(SLOTS);
        (0..fitted).map(move |slot| Step::Range(Place { is_rear, slot }))
    };

    let mut steps = vec![Step::Board, Step::Check, Step::Measures, Step::Battery];
    steps.extend(ranges(false).chain(ranges(true)));
    steps.push(Step::Encoder);
    if has_platform {
        steps.extend([Step::Pitch, Step::Roll]);
    }
    steps.push(Step::Yaw);
    if vehicle.remote.enabled {
        steps.extend([Step::Stick(Stick::Speed), Step::Stick(Stick::Steering), Step::Selector]);
    }
    steps.extend(actuators.iter().map(|actuator| Step::Servo(*actuator)));
    steps.push(Step::EmergencyStop);
    steps.extend([Step::Motor { astern: false }, Step::Motor { astern: true }]);
    steps.extend(actuators.iter().map(|actuator| Step::Calibrate(*actuator)));
    steps
}

impl Step {
    /// Its name on the command line and in the report.
    pub(super) fn id(self) -> String {
        match self {
            Self::Board => "board".into(),
            Self::Check => "check".into(),
            Self::Measures => "measures".into(),
            Self::Battery => "battery".into(),
            Self::Range(place) => format!("range-{}-{}", place.bumper(), place.slot + 1),
            Self::Encoder => "encoder".into(),
            Self::Pitch => "pitch".into(),
            Self::Roll => "roll".into(),
            Self::Yaw => "yaw".into(),
            Self::Stick(Stick::Speed) => "stick-speed".into(),
            Self::Stick(Stick::Steering) => "stick-steering".into(),
            Self::Selector => "selector".into(),
            Self::Servo(actuator) => format!("servo-{actuator}"),
            Self::EmergencyStop => "emergency-stop".into(),
            Self::Motor { astern: false } => "motor-ahead".into(),
            Self::Motor { astern: true } => "motor-astern".into(),
            Self::Calibrate(actuator) => format!("calibrate-{actuator}"),
        }
    }

    /// What it is about, for people.
    pub(super) fn title(self) -> String {
        match self {
            Self::Board => "I/O board: found, set up, firmware".into(),
            Self::Check => "every sensor at rest".into(),
            Self::Measures => "lengths of the car".into(),
            Self::Battery => "battery voltage".into(),
            Self::Range(place) => format!("range finder {}", place.name()),
            Self::Encoder => "encoder".into(),
            Self::Pitch => "tilt sensor, x (pitch)".into(),
            Self::Roll => "tilt sensor, y (roll)".into(),
            Self::Yaw => "gyro, yaw".into(),
            Self::Stick(Stick::Speed) => "receiver, speed stick".into(),
            Self::Stick(Stick::Steering) => "receiver, steering stick".into(),
            Self::Selector => "receiver, selector".into(),
            Self::Servo(actuator) => format!("servo {actuator}"),
            Self::EmergencyStop => "emergency stop".into(),
            Self::Motor { astern: false } => "motor, ahead".into(),
            Self::Motor { astern: true } => "motor, astern".into(),
            Self::Calibrate(actuator) => format!("calibration of {actuator}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_fitted_has_no_step_and_every_name_occurs_once() {
        let xtb = VehicleConfig::default();
        let mut names: Vec<_> = steps(&xtb).into_iter().map(Step::id).collect();
        assert_eq!(names.len(), 4 + 12 + 1 + 2 + 1 + 3 + 8 + 1 + 2 + 8);
        names.sort();
        names.dedup();
        assert_eq!(names.len(), 42);

        let mut small = xtb;
        small.platform = Platform::Off;
        small.drivetrain = Drivetrain::FrontAxle;
        small.remote.enabled = false;
        small.range_finders.front.0.truncate(3);
        small.range_finders.rear.0.truncate(1);
        let names: Vec<_> = steps(&small).into_iter().map(Step::id).collect();
        for absent in
            ["tilt", "pitch", "roll", "stick", "selector", "piston", "steering-rear", "front-4", "rear-2"]
        {
            assert!(!names.iter().any(|name| name.contains(absent)), "{absent} in {names:?}");
        }
        assert_eq!(names.len(), 4 + 4 + 1 + 1 + 3 + 1 + 2 + 3);
    }

    #[test]
    fn the_emergency_stop_is_tried_before_the_motor() {
        let steps = steps(&VehicleConfig::default());
        let at = |wanted| steps.iter().position(|step| *step == wanted).unwrap();
        assert!(at(Step::EmergencyStop) < at(Step::Motor { astern: false }));
        assert!(at(Step::Check) < at(Step::Servo(Actuator::SteeringFront)));
    }
}
