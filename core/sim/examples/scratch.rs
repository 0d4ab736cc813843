#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[path = "../tests/it/approaches.rs"]
mod approaches;
#[path = "../tests/it/draw.rs"]
mod draw;
use xtb_control::VehicleConfig;
fn main() {
    let factor: f64 = std::env::args().nth(1).map_or(1.0, |a| a.parse().unwrap());
    for latch in [true, false] {
        let mut config = VehicleConfig::default();
        config.obstacle.foldback_latch = latch;
        let t = std::time::Instant::now();
        let most = config.admitted_mps() * factor;
        let all = approaches::run_all(0..10_000, most, &config);
        println!("latch {latch} {most} m/s: {:?}", t.elapsed());
        use approaches::By::*;
        for by in [Goto, Wander, Teleop, Manual] {
            for wall in [true, false] {
                for ahead in [true, false] {
                    let sel: Vec<_> = all.iter().filter(|(a, _)| a.by == by && a.wall == wall && (a.mps > 0.0) == ahead).collect();
                    if sel.is_empty() { continue; }
                    let contacts = sel.iter().filter(|(_, o)| o.contacts > 0).count();
                    let unseen = sel.iter().filter(|(_, o)| !o.seen).count();
                    let nearest = sel.iter().map(|(_, o)| o.nearest_m).fold(f64::MAX, f64::min);
                    let over = sel.iter().map(|(a, o)| o.fastest_mps / a.mps.abs()).fold(0.0, f64::max);
                    println!("{by:?} wall {wall} ahead {ahead}: {} contacts {contacts} unseen {unseen} nearest {:.3} overshoot {over:.2}", sel.len(), nearest.min(9.9));
                    for (a, o) in sel.iter().filter(|(_, o)| o.contacts > 0 || !o.seen).take(3) { println!("   {a:?} {o:?}"); }
                }
            }
        }
    }
}
