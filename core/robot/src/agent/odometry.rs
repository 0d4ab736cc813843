//! The odometry's scale: how far the truck goes for each metre that its encoder counts, as pose fixes have
//! shown, and what follows from it for the speed.
//!
//! ```text
//!   scale known (σ ≤ 3 %) ─► speed shown and measured × scale, wheels asked for ÷ scale
//!   > 15 % off, surely    ─► fault odometry_scale: no goal begins
//! ```
//! A wrong scale, as from fixes that lie, must not make a truck fast: wheels are asked for at most 5 % more
//! than without it, and what is applied changes slowly. Without fixes the scale is 1.

use xtb_control::{Command, Stamp, WheelRpm};

/// A scale is known from this standard deviation down: a third of what it is before any fix shows it
/// (`filter.open_scale`), after 10 to 13 s in the table of docs/navigation.md.
const KNOWN_SIGMA: f64 = 0.03;
/// Beyond this the settings are wrong, or the encoder is: tyres differ by 2 % (assumed). Chosen, not
/// measured.
const FAULT: f64 = 0.15;
/// The fault ends below this, so that it does not flap; chosen, not measured.
const FAULT_OVER: f64 = 0.12;
/// The least and the largest that wheels are asked for by: 5 % more at most, so that a wrong scale makes no
/// truck fast (table in docs/navigation.md), and half at least. Chosen.
const APPLIED: std::ops::RangeInclusive<f64> = 0.95..=2.0;
/// What is applied changes by this much in a second, up or down; chosen, not measured.
const CHANGE_PER_S: f64 = 0.1;

/// What is known of the scale, and what is made of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct OdometryScale {
    /// 1 = what the settings say.
    measured: Option<f64>,
    applied: f64,
    fault: bool,
    at: Stamp,
}

impl Default for OdometryScale {
    fn default() -> Self {
        Self { measured: None, applied: 1.0, fault: false, at: Stamp::ZERO }
    }
}

impl OdometryScale {
    /// What the pose filter says now: by which part the wheels go farther, with its standard deviation, and
    /// whether fixes contradict it.
    pub(super) fn learn(&mut self, now: Stamp, scale: Option<(f64, f64)>, contradicted: bool) {
        match scale.filter(|(_, sigma)| *sigma <= KNOWN_SIGMA) {
            None => self.measured = None,
            Some(_) if contradicted => {}
            Some((off, sigma)) => {
                self.measured = Some(1.0 + off);
                let sure = off.abs() - 2.0 * sigma;
                self.fault = sure > FAULT || (self.fault && off.abs() > FAULT_OVER);
            }
        }
        // One that is not known any more does not make the truck faster.
        let wanted = self.measured.unwrap_or_else(|| self.applied.max(1.0));
        let step = CHANGE_PER_S * now.since_s(self.at).min(1.0);
        self.at = now;
        let wanted = wanted.clamp(*APPLIED.start(), *APPLIED.end());
        self.applied += (wanted - self.applied).clamp(-step, step);
    }

    /// How far it goes for each metre that the encoder counts; 1 as long as nobody knows better.
    pub(super) fn way(&self) -> f64 {
        self.measured.unwrap_or(1.0)
    }

    /// The settings are wrong, or the encoder is: what was seen.
    pub(super) fn fault(&self) -> Option<String> {
        let words = || format!("the robot drives {:.2} m per metre of the encoder", self.way());
        self.fault.then(words)
    }

    /// A command that makes the truck, and not only its wheels, as fast as was asked for.
    pub(super) fn correct(&self, command: Command) -> Command {
        let slower = |rpm: WheelRpm| WheelRpm::try_from(rpm.get() / self.applied).unwrap_or(rpm);
        match command {
            Command::Teleop { rpm, steering } => Command::Teleop { rpm: slower(rpm), steering },
            Command::Follow { rpm, steering } => Command::Follow { rpm: slower(rpm), steering },
            Command::Idle | Command::Wander | Command::Goto(_) => command,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::units::Steering;

    fn learnt(said: &[(f64, f64)]) -> OdometryScale {
        let mut scale = OdometryScale::default();
        for (turn, (value, sigma)) in (1..).zip(said) {
            for tenth in 0..100 {
                scale.learn(Stamp::from_ms(turn * 10_000 + tenth * 100), Some((value - 1.0, *sigma)), false);
            }
        }
        scale
    }

    fn asked(scale: &OdometryScale) -> f64 {
        let rpm = WheelRpm::try_from(20.0).unwrap();
        match scale.correct(Command::Follow { rpm, steering: Steering::CENTRED }) {
            Command::Follow { rpm, .. } => rpm.get(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_truck_that_goes_farther_than_it_counts_is_asked_for_less_and_has_a_fault() {
        let scale = learnt(&[(4.0 / 3.0, 0.01)]);
        assert!((asked(&scale) - 15.0).abs() < 1e-9 && (scale.way() - 4.0 / 3.0).abs() < 1e-12);
        assert!(scale.fault().is_some_and(|words| words.contains("1.33 m")));
        assert_eq!(learnt(&[(1.14, 0.01)]).fault(), None);
        assert_eq!(learnt(&[(1.16, 0.02)]).fault(), None, "not sure enough");
        assert!(learnt(&[(0.8, 0.01)]).fault().is_some());
    }

    #[test]
    fn a_scale_makes_nothing_fast_and_nothing_at_once() {
        assert!((asked(&learnt(&[(0.6, 0.01)])) - 20.0 / 0.95).abs() < 1e-9, "5 % more at most");
        let mut scale = OdometryScale::default();
        scale.learn(Stamp::from_ms(5), Some((1.3 - 1.0, 0.01)), false);
        assert!((asked(&scale) - 20.0).abs() < 0.1, "{}", asked(&scale));
    }

    #[test]
    fn what_is_not_known_is_1_but_a_truck_that_was_slowed_down_stays_so() {
        assert!((asked(&learnt(&[(1.3, 0.1)])) - 20.0).abs() < 1e-12);
        let forgotten = learnt(&[(1.25, 0.01), (1.0, 0.1)]);
        assert_eq!(forgotten.way(), 1.0);
        assert!((asked(&forgotten) - 16.0).abs() < 1e-9, "{}", asked(&forgotten));
    }
}
