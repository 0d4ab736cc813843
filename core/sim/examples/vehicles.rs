//! The tables of docs/vehicles.md: the cars of configs/vehicles, whole, and cars drawn at random.
//! `cargo run -p xtb-sim --example vehicles [TRIPS] [PARKINGS] [GOALS] [DRAWN]` (500, 100, 40, 200)

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[allow(dead_code)]
#[path = "../tests/it/any_car.rs"]
mod any_car;
#[allow(dead_code)]
#[path = "../tests/it/draw.rs"]
mod draw;
#[allow(dead_code)]
#[path = "../tests/it/drive.rs"]
mod drive;
#[allow(dead_code)]
#[path = "../tests/it/parkings.rs"]
mod parkings;
#[path = "../tests/it/pillars.rs"]
mod pillars;
#[allow(dead_code)]
#[path = "../tests/it/trips.rs"]
mod trips;

use any_car::{Came, FILES, Way, all_drawn, file, in_the_lab};
use parkings::Course;
use pillars::Margins;
use std::collections::BTreeMap;
use trips::quantile;
use xtb_nav::Car;
use xtb_sim::VehicleFile;

fn main() {
    let argument = |place: usize, usual: u64| {
        std::env::args().nth(place).and_then(|text| text.parse().ok()).unwrap_or(usual)
    };
    let (trips, parkings, goals, drawn) =
        (argument(1, 500), argument(2, 100), argument(3, 40), argument(4, 200));
    println!(
        "| vehicle | circle, m | ahead / astern of the reference point, m | admitted, m/s | A to B: arrived | contacts \
         | time / straight line: p95 | off the goal, m: p95 | parked | contacts | held | off the goal, cm: p95 \
         | goals in the lab | refused | contacts | off the goal, cm: most |"
    );
    println!("| --- |{}", " ---: |".repeat(15));
    for named in FILES {
        row(named.0, &file(named), (trips, parkings, goals));
    }
    println!("\n{drawn} cars drawn at random:");
    let mut reasons = BTreeMap::<String, usize>::new();
    let all = all_drawn(drawn);
    for way in &all {
        let key = match &way.came {
            Came::Reached => "reached".to_owned(),
            Came::Refused(reason) => format!("refused: {}", reason.split(" = ").next().unwrap_or(reason)),
            Came::Failed(reason) => format!("FAILED, seed {}: {reason}", way.seed),
        };
        *reasons.entry(key).or_default() += 1;
    }
    for (reason, count) in reasons {
        println!("{count:4} {reason}");
    }
    println!("{} contacts; off the goal at most {:.2} m", contacts(&all), most_missed_m(&all));
}

fn contacts(all: &[Way]) -> u64 {
    all.iter().map(|way| way.contacts).sum()
}

fn most_missed_m(all: &[Way]) -> f64 {
    all.iter().filter(|way| way.came == Came::Reached).map(|way| way.missed_m).fold(0.0, f64::max)
}

fn row(name: &str, file: &VehicleFile, (trips, parkings, goals): (u64, u64, u64)) {
    let car = Car::of(&file.vehicle);
    let trips = trips::measure_file(trips, file);
    let ratios: Vec<f64> = trips.iter().filter_map(|arrival| arrival.ratio).collect();
    let missed_m = quantile(trips.iter().map(|arrival| arrival.missed_m).collect(), 0.95);
    let margins = Some(Margins { body_m: 0.03, look_out_m: 0.30 });
    let course = Course { margins, file: file.clone(), ..Course::new(0.35, 1.15) };
    let parked = parkings::measure(parkings, &course);
    let lab = in_the_lab(file, goals);
    let refused = lab.iter().filter(|way| matches!(way.came, Came::Refused(_))).count();
    let reached = lab.iter().filter(|way| way.came == Came::Reached).count();
    for way in lab.iter().filter(|way| way.came != Came::Reached) {
        println!("{name}: {way:?}");
    }
    println!(
        "| {name} | {:.2} | {:.2} / {:.2} | {:.2} | {} of {} | {} | {:.2} | {missed_m:.2} | {} of {} | {} | {} | {:.1} \
         | {reached} of {goals} | {refused} | {} | {:.0} |",
        car.radius_m,
        car.front_m,
        car.rear_m,
        file.vehicle.admitted_mps(),
        ratios.len(),
        trips.len(),
        trips.iter().map(|arrival| arrival.contacts).sum::<u64>(),
        quantile(ratios.clone(), 0.95),
        parked.iter().filter(|parked| parked.reached && !parked.alarmed).count(),
        parked.len(),
        parked.iter().map(|parked| parked.contacts).sum::<u64>(),
        parked.iter().filter(|parked| parked.blocked_s > 0.0).count(),
        100.0 * quantile(parked.iter().map(|parked| parked.missed_m).collect(), 0.95),
        contacts(&lab),
        100.0 * most_missed_m(&lab),
    );
}
