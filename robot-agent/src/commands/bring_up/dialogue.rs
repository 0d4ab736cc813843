//! What a person is asked to do, and asked; and what an answer means.

use super::plan::{Place, Stick};
use xtb_control::calibration::{Actuator, ActuatorKind};

/// What went well, or what is wrong and what to do about it.
pub(super) type Verdict = Result<String, Wrong>;

/// Something that is not as it should be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Wrong {
    pub(super) what: String,
    pub(super) hint: String,
}

impl Wrong {
    pub(super) fn new(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { what: what.into(), hint: hint.into() }
    }
}

/// What hands shall do while the sensors are watched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Chore {
    Wait,
    HoldBefore { place: Place, cm: f64 },
    TakeAway,
    TurnWheels,
    LiftNose,
    LiftLeft,
    PutDown,
    TurnRight,
    LetGo,
    Push(Stick),
    Selector,
    PressStop,
    ReleaseStop,
}

impl Chore {
    /// In words; empty if there is nothing to do.
    pub(super) fn text(self) -> String {
        match self {
            Self::Wait => String::new(),
            Self::HoldBefore { place, cm } => format!(
                "Hold something narrow, such as a bottle, {cm:.0} cm before range finder {} (the {} from the \
                 left, seen from above with the car pointing up).",
                place.name(),
                nth(place.slot + 1)
            ),
            Self::TakeAway => "Take it away.".into(),
            Self::TurnWheels => "Turn the wheels by hand, half a turn or more, then let go.".into(),
            Self::LiftNose => "Lift the front of the car by some 10°, and hold it.".into(),
            Self::LiftLeft => "Lift the left side of the car by some 10°, and hold it.".into(),
            Self::PutDown => "Put it down again.".into(),
            Self::TurnRight => {
                "Turn the car to the right (clockwise, seen from above) by a quarter turn.".into()
            }
            Self::LetGo => "Transmitter on, sticks let go.".into(),
            Self::Push(Stick::Speed) => "Push the speed stick fully ahead, hold it.".into(),
            Self::Push(Stick::Steering) => "Push the steering stick fully to the right, hold it.".into(),
            Self::Selector => "Switch the selector to manual and back to automatic, a second each.".into(),
            Self::PressStop => "Press the emergency stop. (None fitted: type skip.)".into(),
            Self::ReleaseStop => "Release it.".into(),
        }
    }
}

fn nth(n: usize) -> String {
    match n {
        1 => "first".into(),
        2 => "second".into(),
        3 => "third".into(),
        _ => format!("{n}th"),
    }
}

/// What moves, in words that a person sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    Servo(Actuator),
    Motor { astern: bool },
}

impl Motion {
    /// The two directions, the one that comes first before the other.
    fn directions(self) -> [&'static str; 2] {
        match self {
            Self::Servo(actuator) if matches!(actuator.kind(), ActuatorKind::Steering(_)) => {
                ["right", "left"]
            }
            Self::Servo(_) => ["up", "down"],
            Self::Motor { astern: false } => ["ahead", "astern"],
            Self::Motor { astern: true } => ["astern", "ahead"],
        }
    }
}

/// What a person is asked; the answer is a line.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Question {
    /// Before a servo moves.
    Ready(Actuator),
    /// Before the motor moves.
    WheelsUp {
        astern: bool,
    },
    /// What was seen.
    Direction(Motion),
    /// What a voltmeter shows at the battery.
    Voltmeter {
        board_v: f64,
    },
    /// A length by the ruler, now so many m by the settings.
    Length {
        name: &'static str,
        key: &'static str,
        now_m: f64,
    },
    Calibrate(Actuator),
}

/// What an answer means.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Reply {
    /// The next stage, with something for the report or nothing.
    Go(String),
    /// The step ends.
    Wrong(Wrong),
    NotFitted,
    Skip,
    /// A setting of the vehicle changes: `geometry`, key, value.
    Set(&'static str, f64),
    /// Not understood: ask again with this.
    Again(&'static str),
}

/// A voltmeter and the board may differ by this part.
const VOLTS_PART: f64 = 0.03;
/// What has to be typed before the motor turns.
pub(super) const WHEELS_UP: &str = "wheels up";

/// Whether a car may lack it without a setting that says so.
fn may_be_missing(actuator: Actuator) -> bool {
    matches!(actuator.kind(), ActuatorKind::Bumper(_))
}

/// What to answer then.
fn or_none(actuator: Actuator) -> &'static str {
    if may_be_missing(actuator) { "; none = there is no such servo" } else { "" }
}

impl Question {
    /// In words.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Ready(actuator) => {
                let [first, then] = Motion::Servo(*actuator).directions();
                let none = or_none(*actuator);
                format!(
                    "{actuator} will go {first}, then {then}, then back. Fingers clear? [yes/skip{none}] "
                )
            }
            Self::WheelsUp { astern } => format!(
                "The motor will turn the wheels slowly {}, for 1.3 s at most.\nPut the car on its stand: ALL WHEELS \
                 OFF THE GROUND, hands, hair and cables clear, a hand on the power switch. Ctrl-C stops it.\nType \
                 \"{WHEELS_UP}\" to go on, or skip: ",
                if *astern { "astern" } else { "ahead" }
            ),
            Self::Direction(motion) => {
                let [first, then] = motion.directions();
                let (what, which) = match motion {
                    Motion::Servo(actuator) => (actuator.name(), " first"),
                    Motion::Motor { .. } => ("the wheels", ""),
                };
                format!(
                    "Which way did {what} go{which}? [{first}/{then}/nothing/other = something else moved] "
                )
            }
            Self::Voltmeter { board_v } => {
                format!(
                    "The board measures {board_v:.2} V. What does a voltmeter show at the battery? [V, or none] "
                )
            }
            Self::Length { name, now_m, .. } => format!("{name} in m [Enter keeps {now_m}] "),
            Self::Calibrate(actuator) => format!(
                "Calibrate {actuator} now (docs/calibration.md)? Wheels off the ground. [yes/skip{}] ",
                or_none(*actuator)
            ),
        }
    }

    /// What a line means as the answer.
    pub(super) fn judge(&self, typed: &str) -> Reply {
        let typed = typed.trim().to_lowercase();
        match self {
            _ if typed == "skip" => Reply::Skip,
            Self::Ready(actuator) | Self::Calibrate(actuator) => match typed.as_str() {
                "yes" | "y" => Reply::Go(String::new()),
                "none" if may_be_missing(*actuator) => Reply::NotFitted,
                _ => Reply::Again("yes or skip"),
            },
            // Nothing shorter: it has to be meant.
            Self::WheelsUp { .. } if typed == WHEELS_UP => Reply::Go(String::new()),
            Self::WheelsUp { .. } => Reply::Again("type \"wheels up\", or skip"),
            Self::Direction(motion) => direction(*motion, &typed),
            Self::Voltmeter { board_v } if typed == "none" => {
                Reply::Go(format!("{board_v:.2} V, not compared with a voltmeter"))
            }
            Self::Voltmeter { board_v } => match number(&typed) {
                Some(volts) if volts > 0.0 => volts_agree(*board_v, volts),
                _ => Reply::Again("a voltage such as 7.4, or none"),
            },
            Self::Length { .. } if typed.is_empty() => Reply::Go(String::new()),
            Self::Length { key, .. } => match number(&typed) {
                Some(metres) => Reply::Set(key, metres),
                None => Reply::Again("a length in m such as 0.286, or Enter"),
            },
        }
    }
}

fn number(typed: &str) -> Option<f64> {
    // A decimal comma is what half of the world types.
    typed.replace(',', ".").parse().ok().filter(|number: &f64| number.is_finite())
}

fn volts_agree(board_v: f64, volts: f64) -> Reply {
    let off = board_v / volts - 1.0;
    if off.abs() <= VOLTS_PART {
        return Reply::Go(format!("{board_v:.2} V, voltmeter {volts:.2} V"));
    }
    Reply::Wrong(Wrong::new(
        format!("the board measures {board_v:.2} V, a voltmeter {volts:.2} V ({:+.0} %)", off * 100.0),
        "check the resistors of the battery's divider (1 : 4) and the board's 3.3 V",
    ))
}

fn direction(motion: Motion, typed: &str) -> Reply {
    let [first, then] = motion.directions();
    if typed == first {
        return Reply::Go(format!("went {first}"));
    }
    let is_motor = matches!(motion, Motion::Motor { .. });
    let (what, hint) = match typed {
        _ if typed == then && is_motor => (
            format!("turned {then} instead of {first}"),
            "reverse the motor: at the ESC, or swap two of its leads",
        ),
        _ if typed == then => (
            format!("went {then} first instead of {first}"),
            "calibrate it: its line has the wrong sign; or reverse the servo",
        ),
        "nothing" if motion == (Motion::Motor { astern: true }) => (
            "the wheels did not turn".to_owned(),
            "an ESC that brakes before it reverses: set it to reverse at once, or without brake",
        ),
        "nothing" if is_motor => (
            "the wheels did not turn".to_owned(),
            "is the ESC on, is it armed (neutral at power-on), is its lead at the motor's output? \
             guard.stall_counts has to be above its dead band",
        ),
        "nothing" => {
            ("did not move".to_owned(), "check its lead, its place on the board, and the servos' 5 V")
        }
        "other" => ("something else moved".to_owned(), "two leads are swapped: compare with the pin table"),
        _ => return Reply::Again("one of the words in brackets"),
    };
    Reply::Wrong(Wrong::new(what, hint))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_but_the_two_words_lets_the_motor_turn() {
        let question = Question::WheelsUp { astern: false };
        assert_eq!(question.judge(" Wheels up "), Reply::Go(String::new()));
        for typed in ["", "y", "yes", "wheels", "wheelsup", "wheels up!", "ok"] {
            assert!(matches!(question.judge(typed), Reply::Again(_)), "{typed:?}");
        }
        assert_eq!(question.judge("skip"), Reply::Skip);
    }

    #[test]
    fn only_bumpers_may_be_without_a_servo_and_then_nothing_of_them_stays_open() {
        for ask in [Question::Ready, Question::Calibrate] {
            let (bumper, steering) = (ask(Actuator::BumperFront), ask(Actuator::SteeringFront));
            assert!(bumper.text().contains("none") && !steering.text().contains("none"));
            assert_eq!(bumper.judge("none"), Reply::NotFitted);
            assert!(matches!(steering.judge("none"), Reply::Again(_)));
        }
    }

    #[test]
    fn what_was_seen_is_judged_and_anything_else_asked_again() {
        let right = Question::Direction(Motion::Servo(Actuator::SteeringFront));
        assert_eq!(right.judge("right"), Reply::Go("went right".into()));
        for typed in ["left", "nothing", "other"] {
            assert!(matches!(right.judge(typed), Reply::Wrong(_)), "{typed}");
        }
        assert!(matches!(right.judge("up"), Reply::Again(_)));
        let astern = Question::Direction(Motion::Motor { astern: true });
        let Reply::Wrong(wrong) = astern.judge("nothing") else { panic!() };
        assert!(wrong.hint.contains("brakes"), "{wrong:?}");
        assert!(matches!(astern.judge("ahead"), Reply::Wrong(_)));
    }

    #[test]
    fn a_voltmeter_that_differs_names_the_divider() {
        let question = Question::Voltmeter { board_v: 7.4 };
        assert!(matches!(question.judge("7,5"), Reply::Go(_)));
        let Reply::Wrong(wrong) = question.judge("8.2") else { panic!() };
        assert!(wrong.what.contains("8.20 V (-10 %)") && wrong.hint.contains("divider"), "{wrong:?}");
        assert!(matches!(question.judge("full"), Reply::Again(_)));
        assert!(matches!(question.judge("nan"), Reply::Again(_)));
    }
}
