//! A-to-B (§4.10), the published law and ours.

use crate::any::{config, goal};
use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::goto::{GotoCommand, GotoDecision, GotoGoal, GotoStage, Maneuver};
use xtb_control::odometry::OdomPose;
use xtb_control::units::Heading;
use xtb_control::vehicle::{Goto, GotoLaw};

fn published() -> Goto {
    Goto { law: GotoLaw::Published, ..Goto::default() }
}

/// What a new goal straight north gives a truck from which it bears `gamma_deg`.
fn decide(config: &Goto, gamma_deg: f64) -> (GotoDecision, GotoCommand) {
    step(&mut north(), config, gamma_deg)
}

fn north() -> GotoStage {
    GotoStage::new(GotoGoal::new(0.0, 2.0).unwrap())
}

fn step(stage: &mut GotoStage, config: &Goto, gamma_deg: f64) -> (GotoDecision, GotoCommand) {
    stage.step(config, &OdomPose { x_m: 0.0, y_m: 0.0, yaw: Heading::from_deg(-gamma_deg) })
}

/// Table 4 as the memorandum prints it: behaviour, sign of the correction on the front servo, whether
/// the correction is γ or γ − 360, sign of V.
fn table_4(gamma: f64) -> (Maneuver, f64, f64) {
    use Maneuver::*;
    let (first, beyond) = (195.0 * gamma, 195.0 * (gamma - 360.0));
    match gamma {
        g if g <= 45.0 => (RightForward, -first, 1.0),
        g if g <= 90.0 => (LeftBackward, first, -1.0),
        g if g <= 135.0 => (LeftForward, first, 1.0),
        g if g <= 180.0 => (RightBackward, -first, -1.0),
        g if g <= 225.0 => (LeftBackward, -beyond, -1.0),
        g if g <= 270.0 => (RightForward, beyond, 1.0),
        g if g <= 315.0 => (RightBackward, beyond, -1.0),
        _ => (LeftForward, -beyond, 1.0),
    }
}

/// How fast the heading grows for a steering command: below centre = right.
fn turning(command: &GotoCommand) -> f64 {
    -command.steering_counts.signum() * command.direction
}

proptest! {
    #[test]
    fn every_decision_is_finite_and_in_range(
        config in config(), goal in goal(), poses in vec((-1.0e5..=1.0e5, -1.0e5..=1.0e5, -1.0e3..=1.0e3), 1..30),
    ) {
        let mut stage = GotoStage::new(goal);
        for (x_m, y_m, yaw_deg) in poses {
            let pose = OdomPose { x_m, y_m, yaw: Heading::from_deg(yaw_deg) };
            let (decision, command) = stage.step(&config.goto, &pose);
            prop_assert!((1..=4).contains(&decision.quadrant));
            prop_assert!((0.0..=90.0).contains(&decision.alpha_deg), "{decision:?}");
            prop_assert!((0.0..360.0).contains(&decision.beta_deg), "{decision:?}");
            prop_assert!((0.0..360.0).contains(&decision.gamma_deg), "{decision:?}");
            prop_assert!(decision.distance_m.is_finite() && decision.distance_m >= 0.0);
            prop_assert!(command.steering_counts.is_finite());
            prop_assert!(command.direction.abs() == 1.0);
        }
    }

    #[test]
    fn the_bearing_is_that_of_the_goal(x_m in -5.0..=5.0, y_m in -5.0..=5.0, yaw_deg in 0.0..360.0) {
        prop_assume!(f64::hypot(x_m, y_m) > 1e-3);
        let mut stage = GotoStage::new(GotoGoal::new(x_m, y_m).unwrap());
        let pose = OdomPose { x_m: 0.0, y_m: 0.0, yaw: Heading::from_deg(yaw_deg) };
        let (decision, _) = stage.step(&Goto::default(), &pose);
        let expected = (f64::atan2(x_m, y_m).to_degrees() - yaw_deg).rem_euclid(360.0);
        let apart = (decision.gamma_deg - expected).abs();
        prop_assert!(apart.min(360.0 - apart) < 1e-9, "{} for {expected}", decision.gamma_deg);
    }

    #[test]
    fn it_has_arrived_inside_the_box_and_nowhere_else(
        x_m in -0.5..=0.5, y_m in -0.5..=0.5, law in prop_oneof![Just(published()), Just(Goto::default())],
    ) {
        let (decision, _) = GotoStage::new(GotoGoal::new(x_m, y_m).unwrap()).step(&law, &OdomPose::default());
        prop_assert_eq!(decision.arrived, x_m.abs() <= 0.2 && y_m.abs() <= 0.2);
    }

    #[test]
    fn published_it_is_table_4_for_every_bearing_and_history(gammas in vec(0.001..360.0, 1..30)) {
        let (config, mut stage) = (published(), north());
        for gamma in gammas {
            let (decision, command) = step(&mut stage, &config, gamma);
            let (maneuver, steering, direction) = table_4(decision.gamma_deg);
            prop_assert_eq!(decision.maneuver, maneuver);
            prop_assert!((command.steering_counts - steering).abs() < 1e-6, "{gamma}: {command:?} {steering}");
            prop_assert_eq!(command.direction, direction);
        }
    }

    #[test]
    fn ours_differs_from_table_4_only_near_180_as_long_as_no_slice_is_kept(gamma in 0.001..360.0) {
        let ((theirs, table), (ours, command)) = (decide(&published(), gamma), decide(&Goto::default(), gamma));
        prop_assert_eq!(theirs.maneuver, ours.maneuver);
        prop_assert_eq!(table.direction, command.direction);
        let expected =
            if (135.0 < gamma) && (gamma <= 225.0) { 195.0 * (gamma - 180.0) } else { table.steering_counts };
        prop_assert!((command.steering_counts - expected).abs() < 1e-6, "{gamma}: {command:?} {expected}");
    }

    #[test]
    fn both_turn_the_truck_towards_0_or_180_degrees_whichever_is_nearer(gamma in 0.001..360.0) {
        prop_assume!([0.0, 90.0, 180.0, 270.0, 360.0].iter().all(|edge| f64::abs(gamma - edge) > 0.01));
        // γ falls while the heading grows.
        let wanted = if gamma < 90.0 || (180.0..270.0).contains(&gamma) { 1.0 } else { -1.0 };
        for config in [published(), Goto::default()] {
            prop_assert_eq!(turning(&decide(&config, gamma).1), wanted, "{:?} at {}", config.law, gamma);
        }
    }

    #[test]
    fn both_are_mirror_images(gamma in 0.001..180.0) {
        prop_assume!(f64::abs(gamma / 45.0 - f64::round(gamma / 45.0)) > 1e-6); // an edge belongs to one side
        for config in [published(), Goto::default()] {
            let ((_, right), (_, left)) = (decide(&config, gamma), decide(&config, 360.0 - gamma));
            prop_assert!((right.steering_counts + left.steering_counts).abs() < 1e-6);
            prop_assert_eq!(right.direction, left.direction);
        }
    }

    #[test]
    fn a_bearing_that_shakes_by_less_than_the_hysteresis_changes_gear_once_at_most(
        centre in 0.0..360.0, shaking in vec(-2.4..=2.4, 2..100),
    ) {
        let (config, mut stage) = (Goto::default(), north());
        let gears: Vec<f64> =
            shaking.iter().map(|by| step(&mut stage, &config, centre + by).1.direction).collect();
        prop_assert!(gears.windows(2).filter(|pair| pair[0] != pair[1]).count() <= 1, "{gears:?}");
    }

    #[test]
    fn while_a_slice_is_kept_the_steering_never_jumps(start in 0.0..360.0, turns in vec(-1.0..=1.0, 1..100)) {
        let (config, mut stage, mut gamma) = (Goto::default(), north(), start);
        let mut before: Option<(Maneuver, f64)> = None;
        for turn in turns {
            gamma += turn;
            let (decision, command) = step(&mut stage, &config, gamma);
            let kept = before.filter(|(maneuver, _)| *maneuver == decision.maneuver);
            if let Some((_, steering)) = kept {
                prop_assert!((command.steering_counts - steering).abs() <= 195.0 + 1e-6, "{gamma}");
            }
            before = Some((decision.maneuver, command.steering_counts));
        }
    }
}
