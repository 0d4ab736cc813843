//! The obstacle rule (§4.6) keeps the truck off walls and boxes at every speed that the
//! configuration admits, and what the fold-back latch adds to it. The example `wall_table` prints the
//! same figures.

use crate::approaches::{Approach, late, run_all};
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

#[test]
fn what_other_thresholds_tilts_and_sights_admit_touches_nothing_either() {
    for (threshold_cm, tilt_deg, far_v) in
        [(14.0, 0.0, 0.42), (40.0, 0.0, 0.42), (80.0, 0.0, 0.42), (80.0, 45.0, 0.42), (80.0, 30.0, 0.6)]
    {
        let mut config = VehicleConfig::default();
        config.obstacle.threshold_cm = threshold_cm;
        (config.bumpers.front_deg, config.bumpers.rear_deg) = (tilt_deg, tilt_deg);
        config.infrared.far_v = far_v;
        let most_mps = config.admitted_mps();
        let all = run_all(0..400, &config, &TruckParameters::default(), |seed| Approach::any(seed, most_mps));
        let touched: Vec<_> = all.iter().filter(|(_, outcome)| outcome.touched || !outcome.seen).collect();
        assert!(touched.is_empty(), "{} at up to {most_mps} m/s: {:?}", touched.len(), touched[0]);
    }
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
