//! The sweep of an angle servo: steering or bumper, there and back.
//!
//! On a simulated truck the instruments are read by themselves; on a real one a person reads the
//! protractor (A.1) or the marked lines (A.2) and types the angle.

use super::bench::{Bench, Trouble};
use super::console::Console;
use indicatif::ProgressBar;
use xtb_control::PwmCount;
use xtb_control::calibration::Measured;
use xtb_control::calibration::{Actuator, ActuatorKind, Point, SweepStep};

/// From a new pulse to a servo at rest, linkage included.
const SETTLE_S: f64 = 0.5;
/// A reading beyond this is a slip of the pen.
const MOST_DEG: f64 = 90.0;

/// What came of one reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Answer {
    /// The angle in degrees.
    Angle(f64),
    /// The reading before was wrong: once more.
    Repeat,
    /// None here.
    Skip,
    /// Enough.
    Quit,
}

/// Where an angle sweep takes place.
pub(crate) trait Stand {
    /// Turns the servo to this pulse and waits until it rests.
    fn go(&mut self, count: PwmCount) -> Result<(), Trouble>;
    /// Reads the angle at this pulse, reading number `number` of `of`.
    fn read(&mut self, count: PwmCount, number: usize, of: usize) -> Result<Answer, Trouble>;
}

/// All readings of a sweep.
pub(crate) fn angles(steps: &[SweepStep], stand: &mut dyn Stand) -> Result<Vec<Point>, Trouble> {
    let number = |index: usize| steps[..index].iter().filter(|step| step.read).count();
    let of = number(steps.len());
    let mut points: Vec<(usize, Point)> = Vec::with_capacity(of);
    let mut index = 0;
    while let Some(&SweepStep { count, read, branch }) = steps.get(index) {
        stand.go(count)?;
        if !read {
            index += 1;
            continue;
        }
        match stand.read(count, number(index) + 1, of)? {
            Answer::Angle(quantity) => {
                points.push((index, Point { count, quantity, branch }));
                index += 1;
            }
            Answer::Skip => index += 1,
            Answer::Quit => return Err(Trouble::Quit),
            Answer::Repeat => {
                let wrong = (0..index).rev().find(|&before| steps[before].read).unwrap_or(index);
                points.retain(|(reading, _)| *reading != wrong);
                // From the same side as the first time, or the play would tell.
                if let Some(before) = wrong.checked_sub(1) {
                    stand.go(steps[before].count)?;
                }
                index = wrong;
            }
        }
    }
    Ok(points.into_iter().map(|(_, point)| point).collect())
}

/// A truck on its bench.
pub(crate) struct Truck<'a> {
    pub(crate) bench: &'a mut Bench,
    pub(crate) actuator: Actuator,
    pub(crate) console: &'a Console,
    pub(crate) progress: &'a ProgressBar,
}

impl Stand for Truck<'_> {
    fn go(&mut self, count: PwmCount) -> Result<(), Trouble> {
        self.bench.drive(self.actuator, count);
        self.bench.hold(SETTLE_S)
    }

    fn read(&mut self, count: PwmCount, number: usize, of: usize) -> Result<Answer, Trouble> {
        if let Some(angle_deg) = self.bench.measured()?.and_then(|read| angle_deg(self.actuator, &read)) {
            self.progress.set_message(format!("pulse {}", count.get()));
            self.progress.set_position(number as u64);
            return Ok(Answer::Angle(angle_deg));
        }
        let positive = if matches!(self.actuator.kind(), ActuatorKind::Steering(_)) { "right" } else { "up" };
        let mut question = format!("{number:>3} of {of}  pulse {}  deg, + = {positive}: ", count.get());
        loop {
            let typed = self.console.ask_while(&question, || self.bench.turn())?;
            match parse(&typed) {
                Ok(answer) => return Ok(answer),
                Err(wrong) => question = format!("     {wrong}: "),
            }
        }
    }
}

/// What the instruments say of an actuator; they do not measure pistons.
fn angle_deg(actuator: Actuator, measured: &Measured) -> Option<f64> {
    match actuator.kind() {
        ActuatorKind::Steering(i) => measured.steering_deg.get(i).copied(),
        ActuatorKind::Bumper(i) => measured.bumpers_deg.get(i).copied(),
        ActuatorKind::Piston(_) => None,
    }
}

/// What was typed: an angle, or a word or its first letter.
fn parse(typed: &str) -> Result<Answer, String> {
    let typed = typed.trim();
    match typed {
        "r" | "repeat" => return Ok(Answer::Repeat),
        "s" | "skip" => return Ok(Answer::Skip),
        "q" | "quit" => return Ok(Answer::Quit),
        _ => {}
    }
    // A decimal comma is what half of the world types.
    match typed.replace(',', ".").parse::<f64>() {
        Ok(angle_deg) if angle_deg.abs() <= MOST_DEG => Ok(Answer::Angle(angle_deg)),
        Ok(_) => Err(format!("-{MOST_DEG} to {MOST_DEG} degrees")),
        Err(_) => Err("an angle, repeat (the last one), skip or quit".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::calibration::Sweep;

    /// Answers in their order, and every pulse that the servo was sent to.
    struct Scripted {
        answers: Vec<Answer>,
        went: Vec<u16>,
    }

    impl Stand for Scripted {
        fn go(&mut self, count: PwmCount) -> Result<(), Trouble> {
            self.went.push(count.get());
            Ok(())
        }

        fn read(&mut self, _: PwmCount, number: usize, of: usize) -> Result<Answer, Trouble> {
            assert!((1..=10).contains(&number) && of == 10);
            if self.answers.is_empty() {
                return Ok(Answer::Angle(number as f64));
            }
            Ok(self.answers.remove(0))
        }
    }

    fn sweep(answers: &[Answer]) -> (Result<Vec<f64>, Trouble>, Vec<u16>) {
        let count = |counts| PwmCount::try_from(counts).unwrap();
        let steps = Sweep { from: count(3000), to: count(4000), points: 5 }.there_and_back().unwrap();
        let mut stand = Scripted { answers: answers.to_vec(), went: Vec::new() };
        let points = angles(&steps, &mut stand);
        (points.map(|points| points.iter().map(|point| point.quantity).collect()), stand.went)
    }

    #[test]
    fn every_reading_comes_once_and_none_where_the_play_is_taken_up() {
        let (angles, went) = sweep(&[]);
        assert_eq!(angles.unwrap(), (1..=10).map(f64::from).collect::<Vec<_>>());
        assert_eq!(went, [2950, 3000, 3250, 3500, 3750, 4000, 4050, 4000, 3750, 3500, 3250, 3000]);
    }

    #[test]
    fn repeat_goes_back_one_reading_and_comes_from_the_same_side() {
        let (angles, went) = sweep(&[Answer::Angle(0.1), Answer::Angle(99.0), Answer::Repeat]);
        assert_eq!(angles.unwrap()[..4], [0.1, 2.0, 3.0, 4.0]);
        assert_eq!(went[..7], [2950, 3000, 3250, 3500, 3000, 3250, 3500]);
        // At the very first reading there is none before.
        let (angles, went) = sweep(&[Answer::Repeat]);
        assert_eq!((angles.unwrap().len(), &went[..4]), (10, &[2950, 3000, 2950, 3000][..]));
    }

    #[test]
    fn a_skipped_reading_is_missing_and_quitting_ends_it() {
        assert_eq!(sweep(&[Answer::Skip]).0.unwrap().len(), 9);
        assert_eq!(sweep(&[Answer::Angle(1.0), Answer::Quit]).0, Err(Trouble::Quit));
        let (angles, _) = sweep(&[Answer::Angle(1.0), Answer::Skip, Answer::Repeat]);
        assert_eq!(angles.unwrap()[..2], [1.0, 2.0], "also a skipped one can be read after all");
    }

    #[test]
    fn typed_answers() {
        assert_eq!(parse(" -3.5\n"), Ok(Answer::Angle(-3.5)));
        assert_eq!(parse("3,5"), Ok(Answer::Angle(3.5)));
        assert_eq!(
            (parse("r"), parse("skip"), parse("q")),
            (Ok(Answer::Repeat), Ok(Answer::Skip), Ok(Answer::Quit))
        );
        for wrong in ["", "nan", "inf", "-100", "right"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
