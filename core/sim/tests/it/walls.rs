//! The obstacle rule (§4.6) keeps the truck off walls and boxes at every speed that the
//! configuration admits, and what the fold-back latch adds to it.

use crate::approaches::{Approach, run_all};
use xtb_control::VehicleConfig;
use xtb_sim::TruckParameters;

#[test]
fn ten_thousand_approaches_at_up_to_the_admitted_speed_touch_nothing() {
    let config = VehicleConfig::default();
    let most_mps = config.admitted_mps();
    assert!((0.42..0.43).contains(&most_mps), "49 rpm with the 25 cm rule: {most_mps}");
    let all = run_all(0..10_000, &config, &TruckParameters::default(), |seed| Approach::any(seed, most_mps));
    let unseen: Vec<_> = all.iter().filter(|(_, outcome)| !outcome.seen).collect();
    assert!(unseen.is_empty(), "{} never met anything: {:?}", unseen.len(), unseen[0]);
    let touched: Vec<_> = all.iter().filter(|(_, outcome)| outcome.touched).collect();
    assert!(touched.is_empty(), "{} of 10,000 touch: {:?}", touched.len(), touched[0]);
}

/// A truck that coasts for longer than `obstacle.reaction_s` knows: worn brake, ramp, more mass.
fn late() -> TruckParameters {
    let mut parameters = TruckParameters::default();
    parameters.drive.lag_s = 0.55;
    parameters
}

#[test]
fn a_truck_that_stops_later_than_its_configuration_says_needs_the_latch() {
    let config = VehicleConfig::default();
    let mps = config.admitted_mps();
    let count = |latch: bool| {
        let mut config = config.clone();
        config.obstacle.foldback_latch = latch;
        let all = run_all(0..1000, &config, &late(), |seed| Approach::straight(seed, mps));
        let rolling = all.iter().filter(|(_, outcome)| outcome.touched_rolling).count();
        (rolling, all.iter().filter(|(_, outcome)| outcome.touched).count())
    };
    let ((with_rolling, with), (without_rolling, without)) = (count(true), count(false));
    // Nearer than 2 cm the sensors read farther than 25 cm: without the latch the motor is switched
    // on again while the truck still rolls.
    assert!(without_rolling > 20 && with_rolling * 5 < without_rolling, "{with_rolling} {without_rolling}");
    assert!(with < without, "{with} {without}");
}
