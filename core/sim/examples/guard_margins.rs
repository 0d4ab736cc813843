//! tmp
#![allow(clippy::unwrap_used, clippy::print_stdout)]
#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[path = "../tests/it/draw.rs"]
mod draw;
#[path = "../tests/it/ordinary.rs"]
mod ordinary;
#[allow(dead_code)]
#[path = "../tests/it/whole_robot.rs"]
mod whole_robot;
use xtb_control::VehicleConfig;
fn main() {
    let n: u64 = std::env::args().nth(1).unwrap().parse().unwrap();
    for kind in [ordinary::Ordinary::Teleop, ordinary::Ordinary::Slope, ordinary::Ordinary::Sticks] {
        let t = std::time::Instant::now();
        let mut c = VehicleConfig::default();
        println!("{kind:?} default {:?} {:?}", kind.alarms(n, &c), t.elapsed());
        if kind != ordinary::Ordinary::Wander && kind != ordinary::Ordinary::Goto {
            for (s, p, co) in [
                (0.25, 0.3, 0.5),
                (0.2, 0.3, 0.5),
                (0.15, 0.3, 0.5),
                (0.3, 0.3, 0.4),
                (0.3, 0.3, 0.3),
                (0.3, 0.1, 0.5),
            ] {
                c.guard.runaway_s = s;
                c.guard.runaway_part = p;
                c.guard.coast_s = co;
                println!("  runaway {s} {p} {co}: {:?}", kind.alarms(n / 2, &c));
            }
        }
        c = VehicleConfig::default();
        for st in [0.2, 0.15, 0.1] {
            c.guard.stall_s = st;
            println!("  stall {st}: {:?}", kind.alarms(n / 2, &c));
        }
    }
}
