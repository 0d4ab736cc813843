//! What moves by itself, on the bench of `calibrate`: a servo one way and the other, a short low pulse of the motor.

use super::dialogue::{Verdict, Wrong};
use crate::commands::calibrate::bench::{Bench, Trouble};
use xtb_control::calibration::{Actuator, ActuatorKind, Sweep};
use xtb_control::pistons::height_m;
use xtb_control::{PwmCount, VehicleConfig};

/// A servo is tried over this part of the sweep of its calibration, for so long each way, in s.
const WIGGLE_PART: f64 = 0.6;
const WIGGLE_S: f64 = 0.8;
/// A piston moves for so long each way, in s, at this part of its sweep's speed.
const PISTON_S: f64 = 0.8;
/// A piston that has moved by less than this has not moved, in m.
const MOVED_M: f64 = 0.001;
/// The motor's pulse begins where the wheels turn by the settings, and grows by so many counts …
const MOTOR_STEP: f64 = 25.0;
/// … each so many s, until the encoder counts; so often at most.
const MOTOR_STEP_S: f64 = 0.15;
const MOTOR_STEPS: u32 = 6;
/// Then it goes on for so long, in s.
const MOTOR_ON_S: f64 = 0.4;
/// After its end the wheels have so long to stop, in s.
const COAST_S: f64 = 3.0;

/// The pulses for right or up and for left or down, and the one between.
fn ends(actuator: Actuator, vehicle: &VehicleConfig) -> [PwmCount; 3] {
    let Sweep { from, to, .. } = actuator.default_sweep(vehicle);
    let line = actuator.line(&vehicle.calibration);
    let middle = (from.as_f64() + to.as_f64()) / 2.0;
    let reach = (to.as_f64() - from.as_f64()) / 2.0 * WIGGLE_PART * line.slope.signum();
    [middle + reach, middle - reach, middle].map(PwmCount::saturating)
}

/// The first way, the other one, and back.
pub(super) fn wiggle(
    bench: &mut Bench,
    actuator: Actuator,
    vehicle: &VehicleConfig,
    eyes: &mut dyn FnMut(&mut Bench),
) -> Result<Verdict, Trouble> {
    let [first, then, middle] = ends(actuator, vehicle);
    let ActuatorKind::Piston(index) = actuator.kind() else {
        eyes(bench);
        bench.drive(actuator, first);
        bench.hold(WIGGLE_S)?;
        eyes(bench);
        for count in [then, middle] {
            bench.drive(actuator, count);
            bench.hold(WIGGLE_S)?;
        }
        bench.rest();
        bench.hold(WIGGLE_S)?;
        return Ok(Ok(String::new()));
    };
    let mut heights_m = Vec::new();
    for count in [None, Some(first), Some(then)] {
        if let Some(count) = count {
            bench.drive(actuator, count);
            bench.hold(PISTON_S)?;
        }
        bench.rest();
        let (_, scan) = bench.next_scan()?;
        heights_m.push(scan.pistons.map(|position| height_m(&vehicle.pistons, position)));
    }
    Ok(piston_moved(index, [heights_m[0], heights_m[1], heights_m[2]]))
}

/// Its own sensor, and no other, has to show that it went up and down again.
fn piston_moved(index: usize, heights_m: [[f64; 4]; 3]) -> Verdict {
    let names = ["FL", "FR", "RL", "RR"];
    let [before, up, down] = heights_m;
    let rise_m = |i: usize| up[i] - before[i];
    let most = (0..4).max_by(|a, b| rise_m(*a).abs().total_cmp(&rise_m(*b).abs())).unwrap_or(index);
    let mm = rise_m(index) * 1000.0;
    if rise_m(most).abs() < MOVED_M {
        return Err(Wrong::new(
            "no piston has moved",
            "check the servo's lead and its 5 V, and the position sensors",
        ));
    }
    if most != index {
        let what = format!("the position of {} changes instead of that of {}", names[most], names[index]);
        return Err(Wrong::new(what, "two servos or two position sensors are swapped"));
    }
    if mm < 0.0 {
        return Err(Wrong::new(
            format!("it went down ({mm:+.1} mm) where it should go up"),
            "calibrate it: its line has the wrong sign; or exchange the ends of its position sensor",
        ));
    }
    if down[index] > up[index] - MOVED_M {
        return Err(Wrong::new(
            format!("it went up ({mm:+.1} mm) and not down again"),
            "check its linkage and servo",
        ));
    }
    Ok(format!("{mm:+.1} mm and back, by its own sensor"))
}

/// A short low pulse, as long as it has to be for the encoder to count; neutral after it, however it ends.
pub(super) fn turn_wheels(
    bench: &mut Bench,
    astern: bool,
    vehicle: &VehicleConfig,
    eyes: &mut dyn FnMut(&mut Bench),
) -> Result<Verdict, Trouble> {
    let sign = if astern { -1.0 } else { 1.0 };
    bench.hold(0.3)?;
    let still = bench.take_pulses();
    eyes(bench);
    let mut counted = 0;
    let mut offset = vehicle.guard.stall_counts;
    for step in 0..MOTOR_STEPS {
        offset = vehicle.guard.stall_counts + MOTOR_STEP * f64::from(step);
        bench.turn_motor(sign * offset);
        bench.hold(MOTOR_STEP_S)?;
        counted += bench.take_pulses();
        if counted > 2 {
            break;
        }
    }
    bench.hold(MOTOR_ON_S)?;
    counted += bench.take_pulses();
    eyes(bench);
    bench.rest();
    let stopped = stops(bench)?;
    let least = vehicle.speed.interlock_pulses;
    Ok(if still > least {
        Err(Wrong::new(
            format!("{still} pulses before the motor had a pulse"),
            "hold the wheels still; check the encoder",
        ))
    } else if counted <= least {
        Err(Wrong::new(
            format!("no encoder pulses at {offset:.0} counts from neutral"),
            "did the wheels turn? Then check the encoder; else the ESC: on, armed, its lead, its dead band",
        ))
    } else if !stopped {
        Err(Wrong::new("the wheels did not stop within 3 s of neutral", "set the ESC's neutral to 1.5 ms"))
    } else {
        Ok(format!("{counted} pulses with {offset:.0} counts, then still"))
    })
}

/// Whether the encoder falls silent.
fn stops(bench: &mut Bench) -> Result<bool, Trouble> {
    let mut waited_s = 0.0;
    while waited_s < COAST_S {
        bench.take_pulses();
        bench.hold(MOTOR_STEP_S)?;
        waited_s += MOTOR_STEP_S;
        if bench.take_pulses() == 0 {
            return Ok(true);
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piston_is_judged_by_its_own_sensor() {
        let still = [0.02; 4];
        let with = |i: usize, height_m| {
            let mut heights_m = still;
            heights_m[i] = height_m;
            heights_m
        };
        let words = |index, up, down| match piston_moved(index, [still, up, down]) {
            Ok(words) => words,
            Err(wrong) => wrong.what,
        };
        assert_eq!(words(1, with(1, 0.025), still), "+5.0 mm and back, by its own sensor");
        assert_eq!(words(1, with(1, 0.015), still), "it went down (-5.0 mm) where it should go up");
        assert_eq!(words(1, with(3, 0.025), still), "the position of RR changes instead of that of FR");
        assert_eq!(words(1, still, still), "no piston has moved");
        assert_eq!(words(1, with(1, 0.025), with(1, 0.0249)), "it went up (+5.0 mm) and not down again");
    }

    #[test]
    fn every_servo_goes_right_or_up_first() {
        let vehicle = VehicleConfig::default();
        for actuator in Actuator::ALL {
            let line = actuator.line(&vehicle.calibration);
            let [first, then, middle] = ends(actuator, &vehicle).map(|count| line.at(count.as_f64()));
            assert!(first > middle && middle > then, "{actuator}");
        }
    }
}
