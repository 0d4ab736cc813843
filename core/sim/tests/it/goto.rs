//! A-to-B (§4.10) with the whole vehicle: every trip in free space ends, soon and without shunting.
//! `cargo run -p xtb-sim --example goto_table` prints the same figures.

use crate::trips::{measure, quantile};
use xtb_control::VehicleConfig;
use xtb_control::vehicle::GotoLaw;

#[test]
fn two_thousand_trips_in_free_space_all_arrive_soon_and_without_shunting() {
    let all = measure(2000, &VehicleConfig::default());
    let ratios: Vec<f64> = all.iter().filter_map(|arrival| arrival.ratio).collect();
    assert_eq!(ratios.len(), 2000, "all arrive");
    let p95 = quantile(ratios, 0.95);
    assert!(p95 <= 2.2, "p95 of the time over that of a straight line: {p95}");
    let most = all.iter().map(|arrival| arrival.gear_changes).max();
    assert!(most <= Some(3), "{most:?} gear changes");
    let missed_m = quantile(all.iter().map(|arrival| arrival.missed_m).collect(), 1.0);
    assert!(missed_m < 0.6, "{missed_m} m from the goal with drift and wheel scale");
}

#[test]
fn with_the_law_as_printed_some_trips_never_end() {
    let mut config = VehicleConfig::default();
    config.goto.law = GotoLaw::Published;
    let all = measure(200, &config);
    let arrived = all.iter().filter(|arrival| arrival.ratio.is_some()).count();
    assert!((100..190).contains(&arrived), "{arrived} of 200 arrive");
    let shunting = all.iter().filter(|arrival| arrival.gear_changes > 100).count();
    assert!(shunting > 10, "{shunting} of 200 go to and fro over the edge of a slice");
}
