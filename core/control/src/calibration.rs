//! Calibration (Annex A): what can be calibrated, which pulses to send, and the line through what
//! was measured ([`fit()`]).
//!
//! "Send a specific PWM value and measure the resulting angle or speed." The memorandum does not
//! print which values; the sweeps here are ours:
//!
//! ```text
//!   angle servo, there and back:          piston, outwards from zero movement:
//!   count │    ·  ●○                      count │             ●
//!         │     ●   ○                           │       ●
//!         │   ●       ○                   zero ─┼─●───────────────── each one a short move that
//!         │ ●           ○ ·                     │    ●               starts in the middle
//!         └·─────────────── order               └──────────●─────── order
//!   · = not read: takes up the play
//! ```
//! A steering linkage has play (A.2), so the same pulse gives two angles, depending on the side from
//! which it is reached. Each reading is reached from its own branch's side, the first one too.

mod fit;

pub use fit::{Branch, Fit, FitError, MIN_POINTS, MIN_R, Point, fit, speed_mps};

use crate::controller::PwmOutputs;
use crate::units::PwmCount;
use crate::vehicle::{Calibration, Drivetrain, Line, VehicleConfig};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Part of the steering's range that is swept: its own stops may lie nearer than configured.
const STEERING_PART: f64 = 0.85;
/// Part of the platform controllers' pulses that pistons are swept over: where the pulse still
/// matters, and their curve is straight.
const PISTON_PART: f64 = 0.5;
/// Bumpers are swept to this angle either side of the horizontal.
const BUMPER_DEG: f64 = 40.0;
/// The way back begins this part of the sweep beyond its end, so that the play is taken up.
const APPROACH_PART: f64 = 0.05;
/// Pulses of an angle servo's sweep, each way.
const ANGLE_POINTS: usize = 13;
/// Pulses of a piston's sweep; even, so that none is spent on zero movement.
const PISTON_POINTS: usize = 20;
/// Most pulses of a sweep: more than anybody wants to read from a protractor.
const MOST_POINTS: usize = 200;

/// Angles as read from lines on the floor and from a protractor, with their errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Wheel angle of front and rear axle in degrees, + = to the right.
    pub steering_deg: [f64; 2],
    /// Angle of front and rear bumper in degrees, + = up.
    pub bumpers_deg: [f64; 2],
}

/// A servo whose line Annex A measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Actuator {
    /// Steering of the front axle (A.2).
    SteeringFront,
    /// Steering of the rear axle (A.2).
    SteeringRear,
    /// Front bumper (A.1).
    BumperFront,
    /// Rear bumper (A.1).
    BumperRear,
    /// Front-left piston (A.3).
    PistonFl,
    /// Front-right piston (A.3).
    PistonFr,
    /// Rear-left piston (A.3).
    PistonRl,
    /// Rear-right piston (A.3).
    PistonRr,
}

/// What an actuator's pulse decides, and where it stands among its like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActuatorKind {
    /// Wheel angle in degrees, + = right; 0 = front, 1 = rear.
    Steering(usize),
    /// Angle in degrees, + = up; 0 = front, 1 = rear.
    Bumper(usize),
    /// Speed in m/s, + = up; FL, FR, RL, RR.
    Piston(usize),
}

impl Actuator {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::SteeringFront,
        Self::SteeringRear,
        Self::BumperFront,
        Self::BumperRear,
        Self::PistonFl,
        Self::PistonFr,
        Self::PistonRl,
        Self::PistonRr,
    ];

    /// As on the command line: `steering-front`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SteeringFront => "steering-front",
            Self::SteeringRear => "steering-rear",
            Self::BumperFront => "bumper-front",
            Self::BumperRear => "bumper-rear",
            Self::PistonFl => "piston-fl",
            Self::PistonFr => "piston-fr",
            Self::PistonRl => "piston-rl",
            Self::PistonRr => "piston-rr",
        }
    }

    /// Its kind and place.
    #[must_use]
    pub const fn kind(self) -> ActuatorKind {
        match self {
            Self::SteeringFront => ActuatorKind::Steering(0),
            Self::SteeringRear => ActuatorKind::Steering(1),
            Self::BumperFront => ActuatorKind::Bumper(0),
            Self::BumperRear => ActuatorKind::Bumper(1),
            Self::PistonFl => ActuatorKind::Piston(0),
            Self::PistonFr => ActuatorKind::Piston(1),
            Self::PistonRl => ActuatorKind::Piston(2),
            Self::PistonRr => ActuatorKind::Piston(3),
        }
    }

    /// Whether this vehicle has it: the rear axle of a front-steered car has no servo.
    #[must_use]
    pub fn is_fitted(self, vehicle: &VehicleConfig) -> bool {
        self != Self::SteeringRear || vehicle.drivetrain != Drivetrain::FrontAxle
    }

    /// Unit of its quantity.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self.kind() {
            ActuatorKind::Steering(_) | ActuatorKind::Bumper(_) => "deg",
            ActuatorKind::Piston(_) => "m/s",
        }
    }

    /// Its line as configured.
    #[must_use]
    pub fn line(self, calibration: &Calibration) -> Line {
        match self.kind() {
            ActuatorKind::Steering(i) => calibration.steering()[i],
            ActuatorKind::Bumper(i) => calibration.bumpers()[i],
            ActuatorKind::Piston(i) => calibration.pistons()[i],
        }
    }

    /// Gives it this pulse.
    pub fn set(self, outputs: &mut PwmOutputs, count: PwmCount) {
        match self.kind() {
            ActuatorKind::Steering(0) => outputs.steer_front = count,
            ActuatorKind::Steering(_) => outputs.steer_rear = count,
            ActuatorKind::Bumper(0) => outputs.bumper_front = count,
            ActuatorKind::Bumper(_) => outputs.bumper_rear = count,
            ActuatorKind::Piston(i) => outputs.pistons[i] = count,
        }
    }

    /// The sweep that its configuration suggests: 85 % of the steering's range, bumpers to 40°,
    /// pistons over the inner half of the pulses that the platform controllers may send. Within the
    /// servos' limits.
    #[must_use]
    pub fn default_sweep(self, vehicle: &VehicleConfig) -> Sweep {
        let line = self.line(&vehicle.calibration);
        let steering = &vehicle.steering;
        let (middle, reach, points) = match self.kind() {
            ActuatorKind::Steering(0) => {
                (steering.front_centre, STEERING_PART * steering.range_counts, ANGLE_POINTS)
            }
            ActuatorKind::Steering(_) => {
                (steering.rear_centre, STEERING_PART * steering.range_counts, ANGLE_POINTS)
            }
            ActuatorKind::Bumper(_) => (line.count(0.0), (BUMPER_DEG / line.slope).abs(), ANGLE_POINTS),
            ActuatorKind::Piston(_) => {
                (line.count(0.0), PISTON_PART * vehicle.pistons.max_offset_counts, PISTON_POINTS)
            }
        };
        let (from, to) = (PwmCount::saturating(middle - reach), PwmCount::saturating(middle + reach));
        Sweep { from, to, points }
    }
}

impl fmt::Display for Actuator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// There is no such actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("not one of steering-front, steering-rear, bumper-front, bumper-rear, piston-fl, -fr, -rl, -rr")]
pub struct UnknownActuator;

impl FromStr for Actuator {
    type Err = UnknownActuator;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|actuator| actuator.name() == name).ok_or(UnknownActuator)
    }
}

/// Which pulses to send: evenly spaced, both ends among them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sweep {
    /// The shortest.
    pub from: PwmCount,
    /// The longest.
    pub to: PwmCount,
    /// How many, one way.
    pub points: usize,
}

/// A sweep that cannot be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum SweepError {
    /// Its ends are in the wrong order, or so near each other that pulses coincide.
    #[error("{points} different pulses do not fit between {from} and {to}")]
    TooNarrow {
        /// Shortest pulse in counts.
        from: u16,
        /// Longest pulse in counts.
        to: u16,
        /// How many.
        points: usize,
    },
    /// Not enough for a line, or more than anybody can want.
    #[error("a sweep has {MIN_POINTS} to {MOST_POINTS} pulses, not {points}")]
    Points {
        /// How many.
        points: usize,
    },
}

/// One pulse of an angle servo's sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SweepStep {
    /// The pulse.
    pub count: PwmCount,
    /// Whether the angle is read there, or the pulse only takes up the play.
    pub read: bool,
    /// Which way the sweep goes.
    pub branch: Branch,
}

impl Sweep {
    /// For an angle servo: up, and down again. Each way begins a little beyond its first pulse, as
    /// far as the servo's limits allow.
    ///
    /// # Errors
    /// [`SweepError`].
    pub fn there_and_back(&self) -> Result<Vec<SweepStep>, SweepError> {
        let counts = self.counts()?;
        let approach = APPROACH_PART * (self.to.as_f64() - self.from.as_f64());
        let (below, above) = (self.from.as_f64() - approach, self.to.as_f64() + approach);
        let way = |start: f64, branch: Branch, counts: Vec<PwmCount>| {
            let first = SweepStep { count: PwmCount::saturating(start), read: false, branch };
            std::iter::once(first).chain(counts.into_iter().map(move |count| SweepStep {
                count,
                read: true,
                branch,
            }))
        };
        let back = counts.iter().rev().copied().collect();
        Ok(way(below, Branch::Up, counts).chain(way(above, Branch::Down, back)).collect())
    }

    /// For a piston: pulses nearest to the middle first, on both sides in turn, so that one which
    /// runs away does so slowly.
    ///
    /// # Errors
    /// [`SweepError`].
    pub fn outwards(&self) -> Result<Vec<PwmCount>, SweepError> {
        let mut counts = self.counts()?;
        let twice_middle = self.from.get() + self.to.get();
        counts.sort_by_key(|count| (2 * count.get()).abs_diff(twice_middle));
        Ok(counts)
    }

    fn counts(&self) -> Result<Vec<PwmCount>, SweepError> {
        let &Self { from, to, points } = self;
        if !(MIN_POINTS..=MOST_POINTS).contains(&points) {
            return Err(SweepError::Points { points });
        }
        if from.get() >= to.get() || usize::from(to.get() - from.get()) < points - 1 {
            return Err(SweepError::TooNarrow { from: from.get(), to: to.get(), points });
        }
        let step = (to.as_f64() - from.as_f64()) / (points - 1) as f64;
        Ok((0..points).map(|i| PwmCount::saturating(from.as_f64() + step * i as f64)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(from: u16, to: u16, points: usize) -> Sweep {
        let count = |counts| PwmCount::try_from(counts).unwrap();
        Sweep { from: count(from), to: count(to), points }
    }

    #[test]
    fn names_read_back_and_every_actuator_moves_its_own_output() {
        let at_rest = crate::Controller::new(VehicleConfig::default()).outputs(crate::Stamp::ZERO).pwm;
        let mut seen = vec![at_rest];
        for actuator in Actuator::ALL {
            assert_eq!(actuator.to_string().parse(), Ok(actuator));
            let mut outputs = at_rest;
            actuator.set(&mut outputs, PwmCount::MAX);
            assert_eq!(outputs.motor, PwmCount::NEUTRAL);
            assert!(!seen.contains(&outputs), "{actuator}");
            seen.push(outputs);
        }
        assert!("motor".parse::<Actuator>().is_err());
    }

    #[test]
    fn a_front_steered_car_has_every_servo_but_the_rear_steerings() {
        let front = VehicleConfig { drivetrain: Drivetrain::FrontAxle, ..VehicleConfig::default() };
        let lacks: Vec<_> =
            Actuator::ALL.into_iter().filter(|actuator| !actuator.is_fitted(&front)).collect();
        assert_eq!(lacks, [Actuator::SteeringRear]);
        assert!(Actuator::ALL.iter().all(|actuator| actuator.is_fitted(&VehicleConfig::default())));
    }

    #[test]
    fn the_configuration_suggests_sweeps_that_stay_off_the_stops() {
        let vehicle = VehicleConfig::default();
        let ends = |actuator: Actuator| {
            let Sweep { from, to, points } = actuator.default_sweep(&vehicle);
            (from.get(), to.get(), points)
        };
        assert_eq!(ends(Actuator::SteeringFront), (2881, 4539, 13));
        assert_eq!(ends(Actuator::SteeringRear), (3350, 5008, 13));
        assert_eq!(ends(Actuator::BumperRear), (2639, 4861, 13));
        assert_eq!(ends(Actuator::PistonRr), (3550, 3950, 20));
        for step in Actuator::SteeringFront.default_sweep(&vehicle).there_and_back().unwrap() {
            let angle_deg = Actuator::SteeringFront.line(&vehicle.calibration).at(step.count.as_f64());
            assert!(angle_deg.abs() < 0.95 * vehicle.steering.stop_deg, "{step:?}");
        }
    }

    #[test]
    fn there_and_back_reaches_every_reading_from_its_own_side() {
        let steps = sweep(3000, 4000, 5).there_and_back().unwrap();
        let counts: Vec<_> = steps.iter().map(|step| step.count.get()).collect();
        assert_eq!(counts, [2950, 3000, 3250, 3500, 3750, 4000, 4050, 4000, 3750, 3500, 3250, 3000]);
        for pair in steps.windows(2).filter(|pair| pair[1].read) {
            let upwards = pair[1].count > pair[0].count;
            assert_eq!(pair[1].branch == Branch::Up, upwards, "{pair:?}");
        }
        assert_eq!(steps.iter().filter(|step| step.read).count(), 10);
    }

    #[test]
    fn outwards_begins_slowly_and_takes_the_sides_in_turn() {
        let counts: Vec<_> =
            sweep(3350, 4150, 6).outwards().unwrap().iter().map(|count| count.get()).collect();
        assert_eq!(counts, [3670, 3830, 3510, 3990, 3350, 4150]);
    }

    #[test]
    fn sweeps_that_cannot_be_are_refused() {
        assert_eq!(sweep(3000, 4000, 2).outwards(), Err(SweepError::Points { points: 2 }));
        assert!(sweep(4000, 3000, 9).there_and_back().is_err());
        assert!(sweep(3000, 3005, 9).there_and_back().is_err());
        assert!(sweep(3000, 3008, 9).there_and_back().is_ok());
        let whole = sweep(2331, 5272, 9).there_and_back().unwrap();
        assert!(whole.iter().all(|step| (2331..=5272).contains(&step.count.get())));
    }
}
