//! Wander (§4.6, Fig. 13).

use crate::any::samples;
use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::obstacle::ObstacleState;
use xtb_control::units::Stamp;
use xtb_control::vehicle::Wander;
use xtb_control::wander::{Phase, WanderStage};
use xtb_control::{Command, Controller, Mode, PwmCount, Sample, VehicleConfig};

/// Obstacles seen, each for so many ms.
fn sights() -> impl Strategy<Value = Vec<(ObstacleState, u64)>> {
    let seen = any::<(bool, bool)>().prop_map(|(front, rear)| ObstacleState { front, rear });
    vec((seen, 0_u64..3000), 1..80)
}

/// The phases that follow each other, with when each began, and the steering that began it.
fn phases(config: &Wander, sights: &[(ObstacleState, u64)]) -> Vec<(Phase, Stamp, f64, ObstacleState)> {
    let (mut stage, mut now) = (WanderStage::new(config), Stamp::ZERO);
    let mut phases = vec![(stage.phase(), now, 0.0, ObstacleState::default())];
    for (seen, ms) in sights {
        for steering in [stage.obstacle(config, now, *seen), stage.timers(config, now)].into_iter().flatten()
        {
            phases.push((stage.phase(), now, steering.get(), *seen));
        }
        now = now.plus_ms(*ms);
    }
    phases
}

fn config(rear_check: bool, sides: &str) -> Wander {
    Wander { rear_check, sides: sides.to_owned(), ..Wander::default() }
}

proptest! {
    #[test]
    fn the_phases_follow_figure_13(sights in sights(), rear_check: bool) {
        let config = config(rear_check, "alternate");
        for pair in phases(&config, &sights).windows(2) {
            let ((before, since, ..), (after, now, steering, seen)) = (pair[0], pair[1]);
            let lasted_s = now.since_s(since);
            match (before, after) {
                (Phase::Ahead, Phase::Reversing(at)) => {
                    prop_assert!(seen.front && at == now && steering.abs() == 1.0);
                }
                (Phase::Reversing(_), Phase::Pausing(at)) => {
                    prop_assert!(at == now && steering == 0.0);
                    prop_assert!(lasted_s >= 6.0 || (rear_check && seen.rear), "{lasted_s}");
                }
                (Phase::Pausing(_), Phase::Ahead) => prop_assert!(lasted_s >= 2.0 && steering == 0.0),
                (before, after) => prop_assert!(false, "{before:?} to {after:?}"),
            }
        }
    }

    #[test]
    fn it_turns_to_the_sides_that_the_configuration_says(sights in sights()) {
        for (sides, first, factor) in [("alternate", 1.0, -1.0), ("right", 1.0, 1.0), ("left", -1.0, 1.0)] {
            let mut expected = first;
            for (phase, _, steering, _) in phases(&config(true, sides), &sights) {
                if matches!(phase, Phase::Reversing(_)) {
                    prop_assert_eq!(steering, expected);
                    expected *= factor;
                }
            }
        }
    }

    #[test]
    fn its_reference_is_v_minus_v_or_0_and_the_motor_never_goes_into_something(samples in samples(80)) {
        let mut controller = Controller::new(VehicleConfig::default());
        controller.step(Stamp::ZERO, &Sample::Command(Command::Wander));
        for (t, sample) in samples {
            let out = controller.step(t, &sample);
            if out.mode == Mode::Wander {
                prop_assert!([13.0, 0.0, -13.0].contains(&out.reference_rpm), "{out:?}");
                let into_something = out.obstacle.blocks(out.reference_rpm);
                prop_assert!(!into_something || out.pwm.motor == PwmCount::NEUTRAL, "{out:?}");
            }
        }
    }
}
