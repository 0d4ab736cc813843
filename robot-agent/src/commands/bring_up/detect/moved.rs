//! What moves: wheels, the whole truck, sticks, switches.

use super::{Detector, Seen, Since, View, done, wrong};
use crate::commands::bring_up::dialogue::Wrong;
use crate::commands::bring_up::plan::Stick;
use xtb_control::VehicleConfig;
use xtb_control::vehicle::Imu;

/// A car within this is level, and one beyond that is lifted, in degrees.
const LEVEL_DEG: f64 = 3.0;
const LIFTED_DEG: f64 = 5.0;
/// A stick that is let go, within this, and one that is pushed, by this at least, in ms.
const CENTRE_MS: f64 = 1.5;
const CENTRED_MS: f64 = 0.15;
const PUSHED_MS: f64 = 0.25;

/// The wheels turn and stop again.
#[derive(Debug)]
pub(in crate::commands::bring_up) struct Turned {
    window_s: f64,
    least: f64,
    still_pulses: u32,
    looked_s: Option<f64>,
    pulses: f64,
    still: Since,
}

impl Turned {
    /// An eighth of a turn of both wheels of an axle: of one alone, with a differential, a quarter.
    pub(in crate::commands::bring_up) fn new(vehicle: &VehicleConfig) -> Self {
        let encoder = &vehicle.encoder;
        let least = encoder.pulses_per_rev * encoder.gear_ratio / 8.0;
        let (window_s, still_pulses) = (encoder.window_s, vehicle.speed.interlock_pulses);
        Self { window_s, least, still_pulses, looked_s: None, pulses: 0.0, still: Since::default() }
    }
}

impl Detector for Turned {
    fn look(&mut self, view: &View) -> Seen {
        let Some(pulses) = view.pulses else { return Seen::Nothing };
        let waited_s = view.now_s - self.looked_s.replace(view.now_s).unwrap_or(view.now_s);
        self.pulses += f64::from(pulses) * waited_s.min(self.window_s) / self.window_s;
        let still_s = self.still.lasts_s(view.now_s, u32::from(pulses) <= self.still_pulses);
        if self.pulses >= self.least && still_s >= 0.5 {
            return done(format!("some {:.0} pulses, then still", self.pulses));
        }
        Seen::Nothing
    }

    fn missing(&self) -> Wrong {
        let hint = "check the encoder's supply, its lead (through the divider to 3.3 V), and its disc";
        if self.pulses >= self.least {
            return Wrong::new("the encoder counts on although nobody turns the wheels", hint);
        }
        Wrong::new(format!("{:.0} of {:.0} pulses", self.pulses, self.least), hint)
    }
}

/// Two values of which one has to change in one direction, and the other not more.
#[derive(Debug)]
struct Moved {
    axis: usize,
    least: f64,
    at_rest: f64,
    right: Since,
    reverse: Since,
    other: Since,
}

enum Way {
    Not,
    Right(f64),
    Reverse,
    Other,
}

impl Moved {
    /// `least` with its sign; what both are at rest.
    fn new(axis: usize, least: f64, at_rest: f64) -> Self {
        let [right, reverse, other] = [(); 3].map(|()| Since::default());
        Self { axis, least, at_rest, right, reverse, other }
    }

    fn look(&mut self, now_s: f64, values: [f64; 2]) -> Way {
        let change = values.map(|value| value - self.at_rest);
        let (mine, other) = (change[self.axis] * self.least.signum(), change[1 - self.axis].abs());
        let least = self.least.abs();
        if self.right.lasts_s(now_s, mine >= least && other < mine) >= 0.3 {
            return Way::Right(change[self.axis]);
        }
        if self.reverse.lasts_s(now_s, mine <= -least && other < -mine) >= 0.5 {
            return Way::Reverse;
        }
        if self.other.lasts_s(now_s, other >= least && other >= mine.abs()) >= 1.0 {
            Way::Other
        } else {
            Way::Not
        }
    }
}

/// The tilt sensor answers to a lift: x falls when the nose goes up, y when the left side does.
#[derive(Debug)]
pub(in crate::commands::bring_up) struct Tilted(Moved);

impl Tilted {
    pub(in crate::commands::bring_up) fn new(axis: usize) -> Self {
        Self(Moved::new(axis, -LIFTED_DEG, 0.0))
    }
}

impl Detector for Tilted {
    fn look(&mut self, view: &View) -> Seen {
        let Some(tilt_deg) = view.tilt_deg else { return Seen::Nothing };
        match self.0.look(view.now_s, tilt_deg) {
            Way::Not => Seen::Nothing,
            Way::Right(deg) => done(format!("{deg:+.1}°")),
            Way::Reverse => wrong(
                "it reads the other way round".into(),
                "turn the sensor by 180°, or change the sign of tilt.x_v_per_deg and y_v_per_deg at its supply",
            ),
            Way::Other => {
                wrong("the other axis answers".into(), "tilt x and y are swapped: exchange their leads")
            }
        }
    }

    fn missing(&self) -> Wrong {
        Wrong::new("the tilt sensor does not answer", "check its lead and its 5 V; lift by 10°")
    }
}

/// The truck lies level again.
#[derive(Debug, Default)]
pub(in crate::commands::bring_up) struct Level(Since);

impl Detector for Level {
    fn look(&mut self, view: &View) -> Seen {
        let is_level = view.tilt_deg.is_some_and(|deg| deg.iter().all(|deg| deg.abs() < LEVEL_DEG));
        if self.0.lasts_s(view.now_s, is_level) >= 0.3 { done(String::new()) } else { Seen::Nothing }
    }

    fn missing(&self) -> Wrong {
        let hint = "put it on a level place; else level the sensor, or set tilt.x_zero_v and y_zero_v";
        Wrong::new("the tilt sensor does not read level (± 3°)", hint)
    }
}

/// The yaw follows a turn to the right.
#[derive(Debug, Default)]
pub(in crate::commands::bring_up) struct TurnedRight {
    /// The last yaw, and the whole turn since the first one.
    yaw_deg: Option<f64>,
    turn_deg: f64,
    right: Since,
    left: Since,
    at_board: bool,
}

impl TurnedRight {
    pub(in crate::commands::bring_up) fn new(vehicle: &VehicleConfig) -> Self {
        Self { at_board: vehicle.imu == Imu::Bno085Rvc, ..Self::default() }
    }
}

impl Detector for TurnedRight {
    fn look(&mut self, view: &View) -> Seen {
        let Some(yaw_deg) = view.yaw_deg else { return Seen::Nothing };
        let before_deg = self.yaw_deg.replace(yaw_deg).unwrap_or(yaw_deg);
        self.turn_deg += (yaw_deg - before_deg + 180.0).rem_euclid(360.0) - 180.0;
        let turn_deg = self.turn_deg;
        if self.right.lasts_s(view.now_s, turn_deg >= 60.0) >= 0.3 {
            return done(format!("turned by {turn_deg:.0}°"));
        }
        if self.left.lasts_s(view.now_s, turn_deg <= -60.0) >= 0.3 {
            return wrong(
                format!("yaw went {turn_deg:.0}°: it takes a turn to the right for one to the left"),
                if self.at_board {
                    "set vehicle.imu_yaw to the other word, if it is not mounted upside down"
                } else {
                    "is it mounted upside down?"
                },
            );
        }
        Seen::Nothing
    }

    fn missing(&self) -> Wrong {
        let hint = "a quarter turn is enough; does it stand still, or drift? robot-agent check-hardware shows its row";
        Wrong::new(format!("yaw went {:+.0}°, not 60° or more", self.turn_deg), hint)
    }
}

/// The transmitter is on, and its sticks are let go.
#[derive(Debug, Default)]
pub(in crate::commands::bring_up) struct Centred {
    absent: Since,
    centred: Since,
}

impl Detector for Centred {
    fn look(&mut self, view: &View) -> Seen {
        if self.absent.lasts_s(view.now_s, view.is_up && view.sticks_ms.is_none()) >= 1.0 {
            return Seen::NotFitted("the board has no receiver");
        }
        let is_centred = |ms: &Option<f64>| ms.is_some_and(|ms| (ms - CENTRE_MS).abs() <= CENTRED_MS);
        let are_centred = view.sticks_ms.is_some_and(|sticks_ms| sticks_ms.iter().all(is_centred));
        if self.centred.lasts_s(view.now_s, are_centred) >= 0.3 { done(String::new()) } else { Seen::Nothing }
    }

    fn missing(&self) -> Wrong {
        let hint =
            "is the transmitter on, and bound? Trim both sticks to 1.5 ms, and check the receiver's leads";
        Wrong::new("the sticks do not come to rest at 1.35 to 1.65 ms", hint)
    }
}

/// A stick of the transmitter arrives on its channel, in its direction.
#[derive(Debug)]
pub(in crate::commands::bring_up) struct Pushed(Stick, Moved);

impl Pushed {
    /// Ahead is a longer pulse; right is the one that turns the front wheels to the right.
    pub(in crate::commands::bring_up) fn new(stick: Stick, vehicle: &VehicleConfig) -> Self {
        let right = vehicle.calibration.steering()[0].slope.signum();
        let (axis, least_ms) = match stick {
            Stick::Speed => (0, PUSHED_MS),
            Stick::Steering => (1, PUSHED_MS * right),
        };
        Self(stick, Moved::new(axis, least_ms, CENTRE_MS))
    }
}

impl Detector for Pushed {
    fn look(&mut self, view: &View) -> Seen {
        let Some([Some(speed_ms), Some(steering_ms)]) = view.sticks_ms else { return Seen::Nothing };
        match self.1.look(view.now_s, [speed_ms, steering_ms]) {
            Way::Not => Seen::Nothing,
            Way::Right(change_ms) => done(format!("{change_ms:+.2} ms")),
            Way::Reverse => {
                wrong("the pulse goes the other way".into(), "reverse this channel at the transmitter")
            }
            Way::Other => wrong(
                "the other stick's channel moves".into(),
                "the receiver's leads of speed and steering are swapped",
            ),
        }
    }

    fn missing(&self) -> Wrong {
        let name = if self.0 == Stick::Speed { "speed" } else { "steering" };
        let hint = "check this channel's lead from the receiver, and its end points at the transmitter";
        Wrong::new(format!("the channel of {name} does not move"), hint)
    }
}

/// Both positions of the selector have been seen.
#[derive(Debug, Default)]
pub(in crate::commands::bring_up) struct Switched {
    manual: Since,
    automatic: Since,
    seen: [bool; 2],
    absent: Since,
}

impl Detector for Switched {
    fn look(&mut self, view: &View) -> Seen {
        if self.absent.lasts_s(view.now_s, view.is_up && view.sticks_ms.is_none()) >= 1.0 {
            return Seen::NotFitted("the board has no receiver");
        }
        self.seen[0] |= self.manual.lasts_s(view.now_s, view.manual == Some(true)) >= 0.2;
        self.seen[1] |= self.automatic.lasts_s(view.now_s, view.manual == Some(false)) >= 0.2;
        if self.seen == [true, true] { done("manual and automatic".into()) } else { Seen::Nothing }
    }

    fn missing(&self) -> Wrong {
        let what = match self.seen {
            [true, false] => "only manual was seen",
            [false, true] => "only automatic was seen",
            _ => "neither manual nor automatic was seen",
        };
        Wrong::new(
            what,
            "check the selector's lead; remote.selector_counts has to lie between its two pulses",
        )
    }
}

/// The emergency stop is pressed, or released.
#[derive(Debug)]
pub(in crate::commands::bring_up) struct Stop {
    pressed: bool,
    since: Since,
    untold: Since,
}

impl Stop {
    pub(in crate::commands::bring_up) fn new(pressed: bool) -> Self {
        Self { pressed, since: Since::default(), untold: Since::default() }
    }
}

impl Detector for Stop {
    fn look(&mut self, view: &View) -> Seen {
        if self.untold.lasts_s(view.now_s, view.is_up && view.stop_pressed.is_none()) >= 1.0 {
            return Seen::NotFitted("this board's firmware does not tell of one");
        }
        if self.since.lasts_s(view.now_s, view.stop_pressed == Some(self.pressed)) < 0.15 {
            return Seen::Nothing;
        }
        done(if self.pressed { "pressed and seen" } else { "released" }.into())
    }

    fn missing(&self) -> Wrong {
        if self.pressed {
            let hint = "its contact opens when it is pressed: between GP12 and ground, and not bridged";
            return Wrong::new("the board does not see the emergency stop", hint);
        }
        let hint = "is it released? Its contact has to close GP12 to ground; without one: GP12 to ground";
        Wrong::new("the board says that the emergency stop is still pressed", hint)
    }
}
