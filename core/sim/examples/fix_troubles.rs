//! The table of docs/navigation.md: whether the pose knows how far it is off when its fixes are wrong in
//! ways that nobody says. `cargo run --release -p xtb-sim --example fix_troubles [TRUCKS [FIRST_SEED]]`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[allow(dead_code)]
#[path = "../tests/it/draw.rs"]
mod draw;
#[allow(dead_code)]
#[path = "../tests/it/fixed.rs"]
mod fixed;
#[allow(dead_code)]
#[path = "../tests/it/troubled.rs"]
mod troubled;

use draw::in_parallel;
use fixed::{Drive, Moment};
use troubled::Trouble;
use xtb_nav::localization::{UncertaintyLimits, UncertaintySpeed};
use xtb_sim::{FixTruth, TruckParameters};

const SECONDS: f64 = 600.0;

fn main() {
    let numbers: Vec<u64> = std::env::args().skip(1).map(|word| word.parse().unwrap()).collect();
    let trucks = numbers.first().copied().unwrap_or(20);
    let seeds = numbers.get(1).map_or(5000..5000 + trucks, |first| *first..*first + trucks);
    println!(
        "| fixes | of 5 cm at | within 3 σ + 5 cm | error p95 | largest | yaw p95 | uncertain | started again |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    for (name, trouble, change) in rows() {
        for rate_hz in [2.0, 10.0, 20.0] {
            let mut fixes = FixTruth { rate_hz, noise_m: 0.05, ..FixTruth::default() };
            let mut truck = TruckParameters::default();
            change(&mut fixes, &mut truck);
            let run = |seed| Drive::of(seed, fixes.clone(), trouble, &truck).run_s(SECONDS);
            row(&format!("{name} | {rate_hz} Hz"), &in_parallel(seeds.clone(), run));
        }
    }
}

type Change = fn(&mut FixTruth, &mut TruckParameters);

fn rows() -> Vec<(&'static str, Trouble, Change)> {
    let heading: Change = |fixes, _| fixes.heading = true;
    let frozen = |s, noise_m| Trouble::Frozen { s, noise_m };
    vec![
        ("clean", Trouble::Nothing, |_, _| ()),
        ("clean, with headings", Trouble::Nothing, heading),
        ("200 ms late, not said", Trouble::Undeclared, |fixes, _| fixes.latency_s = 0.2),
        ("5 % outliers of 1 m", Trouble::Nothing, |fixes, _| {
            (fixes.outliers, fixes.outlier_m) = (0.05, 1.0);
        }),
        ("drop-outs of 10 s", Trouble::Nothing, |fixes, _| {
            (fixes.drop_out_every_s, fixes.drop_out_s) = (40.0, 10.0);
        }),
        ("frozen for 3 s", frozen(3.0, 0.0), |_, _| ()),
        ("frozen for 10 s", frozen(10.0, 0.0), |_, _| ()),
        ("frozen for 10 s, with 1 mm of noise", frozen(10.0, 0.001), |_, _| ()),
        ("another robot's for 1 s", Trouble::Swapped { s: 1.0 }, |_, _| ()),
        ("another robot's for 1 s, with headings", Trouble::Swapped { s: 1.0 }, heading),
        ("another robot's for 10 s", Trouble::Swapped { s: 10.0 }, |_, _| ()),
        ("yaw + 180° for 1 s", Trouble::TurnedAbout { s: 1.0 }, heading),
        ("clock 50 ppm slow", Trouble::SlowClock(50e-6), |_, _| ()),
        ("frame turned by 2°", Trouble::Frame(0.035), |_, _| ()),
        ("25 % fewer pulses", Trouble::Nothing, |_, truck| truck.encoder.pulses_per_rev *= 0.75),
    ]
}

/// Whether a robot with 20 cm to spare would stand here because its pose is uncertain.
fn would_stand(moment: &Moment) -> bool {
    UncertaintySpeed::of(&moment.estimate, 0.2, &UncertaintyLimits::default()) == UncertaintySpeed::Stop
}

fn row(name: &str, drives: &[Drive]) {
    let all = |of: &dyn Fn(&Moment) -> f64| {
        let mut values: Vec<f64> = drives.iter().flat_map(|d| d.moments.iter().map(of)).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let at = |values: &[f64], part: f64| values[(part * (values.len() - 1) as f64) as usize];
    let share = |of: &dyn Fn(&Moment) -> bool| {
        let values = all(&|m| f64::from(of(m)));
        100.0 * values.iter().sum::<f64>() / values.len() as f64
    };
    let (off_m, turned) = (all(&Moment::error_m), all(&|m| m.yaw_error_rad().to_degrees()));
    println!(
        "| {name} | {:.2} % | {:.1} cm | {:.1} cm | {:.2}° | {:.1} % | {} |",
        share(&Moment::is_consistent),
        100.0 * at(&off_m, 0.95),
        100.0 * at(&off_m, 1.0),
        at(&turned, 0.95),
        share(&would_stand),
        drives.iter().map(|d| d.restarts.len()).sum::<usize>(),
    );
}
