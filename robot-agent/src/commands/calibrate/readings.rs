//! Readings from a file: "count quantity" a line, in the order in which they were taken.

use crate::commands::Failure;
use robot_agent::files;
use std::path::Path;
use xtb_control::PwmCount;
use xtb_control::calibration::{Actuator, ActuatorKind, Branch, Point};

/// Reads the file; `#` begins a comment.
pub(crate) fn read(path: &Path, what: Actuator) -> Result<Vec<Point>, Failure> {
    let name = path.display();
    let hint = format!("each line is a pulse in counts and the value measured there, in {}", what.unit());
    let text = files::text(path, files::MAX_TEXT)
        .map_err(|error| Failure::new(format!("cannot read {name}: {error}"), &hint).code(2))?;
    parse(&text, what).map_err(|wrong| Failure::new(format!("{name}:{wrong}"), &hint).code(2))
}

fn parse(text: &str, what: Actuator) -> Result<Vec<Point>, String> {
    let mut readings = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split('#').next().unwrap_or_default().split_whitespace().collect();
        match words[..] {
            [] => {}
            [count, quantity] => {
                readings.push(reading(count, quantity).map_err(|e| format!("{}: {e}", i + 1))?)
            }
            _ => return Err(format!("{}: {} words instead of two", i + 1, words.len())),
        }
    }
    Ok(branches(&readings, what))
}

fn reading(count: &str, quantity: &str) -> Result<(PwmCount, f64), String> {
    let counts: u16 = count.parse().map_err(|_| format!("{count:?} is not a pulse in counts"))?;
    let count = PwmCount::try_from(counts).map_err(|error| error.to_string())?;
    match quantity.parse::<f64>() {
        Ok(quantity) if quantity.is_finite() => Ok((count, quantity)),
        _ => Err(format!("{quantity:?} is not a number")),
    }
}

/// An angle's branch is the way from the reading before (for the first: to the next one); a piston's
/// is the way that it moves.
fn branches(readings: &[(PwmCount, f64)], what: Actuator) -> Vec<Point> {
    let first = readings.windows(2).find(|pair| pair[0].0 != pair[1].0);
    let mut branch = first.map_or(Branch::Up, |pair| way(pair[0].0, pair[1].0, Branch::Up));
    let mut before = None;
    let mut points = Vec::with_capacity(readings.len());
    for &(count, quantity) in readings {
        branch = match what.kind() {
            ActuatorKind::Piston(_) if quantity == 0.0 => Branch::Still,
            ActuatorKind::Piston(_) if quantity > 0.0 => Branch::Up,
            ActuatorKind::Piston(_) => Branch::Down,
            _ => before.map_or(branch, |before| way(before, count, branch)),
        };
        before = Some(count);
        points.push(Point { count, quantity, branch });
    }
    points
}

fn way(from: PwmCount, to: PwmCount, otherwise: Branch) -> Branch {
    match to.cmp(&from) {
        std::cmp::Ordering::Greater => Branch::Up,
        std::cmp::Ordering::Less => Branch::Down,
        // The sweep turns here: the same pulse again is the first one of the way back.
        std::cmp::Ordering::Equal if otherwise == Branch::Up => Branch::Down,
        std::cmp::Ordering::Equal => Branch::Up,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn branches_of(text: &str, what: Actuator) -> Vec<Branch> {
        parse(text, what).unwrap().iter().map(|point| point.branch).collect()
    }

    #[test]
    fn the_order_says_from_which_side_an_angle_was_reached() {
        use Branch::{Down, Up};
        let there_and_back =
            "# protractor\n3000 1.5\n\n3500 -2\n4000 -9.5 # turned here\n4000 -9\n3500 0\n3000 2\n";
        assert_eq!(branches_of(there_and_back, Actuator::SteeringFront), [Up, Up, Up, Down, Down, Down]);
        assert_eq!(branches_of("4000 1\n3000 2\n", Actuator::BumperRear), [Down, Down]);
        let piston = "3400 -0.01\n3740 0\n4100 0.01\n";
        assert_eq!(branches_of(piston, Actuator::PistonFl), [Down, Branch::Still, Up]);
    }

    #[test]
    fn what_is_no_reading_is_named_by_its_line() {
        for (text, wrong) in [
            ("3000 1\n3000\n", "2: 1 words"),
            ("9 1", "1: "),
            ("3000 nan", "1: \"nan\""),
            ("x 1", "1: \"x\""),
            ("3000 1 2", "1: 3 words"),
        ] {
            let said = parse(text, Actuator::SteeringFront).unwrap_err();
            assert!(said.starts_with(wrong), "{said}");
        }
    }
}
