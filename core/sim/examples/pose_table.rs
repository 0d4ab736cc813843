//! The table and the plot of docs/navigation.md, docs/images/pose-filter.svg: how far the pose is off, with
//! and without fixes. `cargo run -p xtb-sim --example pose_table`

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
#[path = "pose_table/plot.rs"]
mod plot;
#[allow(dead_code)]
#[path = "../tests/it/troubled.rs"]
mod troubled;

use fixed::{Drive, Moment, two_hertz};
use std::path::Path;
use xtb_sim::FixTruth;

const TRUCKS: u64 = 20;
const SECONDS: f64 = 600.0;

fn main() {
    println!(
        "| fixes | pose off by: p50 | p95 | most | heading off by: p50 | p95 | within its own 95 % | outliers taken | started again |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    let heading = FixTruth { heading: true, ..two_hertz() };
    let drop_outs = FixTruth { drop_out_every_s: 60.0, drop_out_s: 20.0, ..two_hertz() };
    let late = FixTruth { latency_s: 0.3, ..two_hertz() };
    let many = FixTruth { outliers: 0.2, ..two_hertz() };
    row("none", &FixTruth::default());
    let drives = row("2 Hz, 5 cm, 2 % outliers", &two_hertz());
    row("the same with headings of 0.05 rad", &heading);
    row("the same as the second, 0.3 s late", &late);
    row("the same as the second, 20 s drop-outs", &drop_outs);
    row("the same as the second, 20 % outliers", &many);
    let ranging = FixTruth { rate_hz: 10.0, noise_m: 0.3, latency_s: 0.1, ..two_hertz() };
    row("10 Hz, 30 cm, 2 % outliers, 0.1 s late (as of ultra-wide band)", &ranging);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/images/pose-filter.svg");
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    plot::draw(&path, &drives).unwrap();
    println!("\n{}", path.canonicalize().unwrap().display());
}

fn row(name: &str, fixes: &FixTruth) -> Vec<Drive> {
    let drives: Vec<Drive> = (0..TRUCKS).map(|seed| Drive::new(seed, fixes.clone()).run_s(SECONDS)).collect();
    let all = |of: &dyn Fn(&Moment) -> f64| {
        let mut values: Vec<f64> = drives.iter().flat_map(|d| d.moments.iter().map(of)).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let at = |values: &[f64], part: f64| values[(part * (values.len() - 1) as f64) as usize];
    let (off_m, turned) = (all(&Moment::error_m), all(&|m| m.yaw_error_rad().to_degrees()));
    let within = all(&|m| f64::from(m.is_within_own_bounds())).iter().sum::<f64>() / off_m.len() as f64;
    let (taken, outliers) = drives.iter().fold((0, 0), |(a, b), d| (a + d.outliers.0, b + d.outliers.1));
    let restarts: usize = drives.iter().map(|d| d.restarts.len()).sum();
    println!(
        "| {name} | {:.1} cm | {:.1} cm | {:.1} cm | {:.2}° | {:.2}° | {:.1} % | {taken} of {outliers} | {restarts} |",
        100.0 * at(&off_m, 0.5),
        100.0 * at(&off_m, 0.95),
        100.0 * at(&off_m, 1.0),
        at(&turned, 0.5),
        at(&turned, 0.95),
        100.0 * within,
    );
    drives
}
