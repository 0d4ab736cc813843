//! A fleet with faults, contacts, planned goals and traffic control: the same bits step by step, in windows,
//! and on any number of threads.

#[path = "../../examples/scale/threads.rs"]
mod pool;

use pool::Threads;
use std::hash::{DefaultHasher, Hash, Hasher};
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::units::Stamp;
use xtb_protocol::messages::{Body, LinkLoss, Request, TruthRobot, Via};
use xtb_protocol::{Name, Uuid};
use xtb_sim::lockstep::Traffic;
use xtb_sim::{
    BoxSpec, DriveFault, FixTruth, InjectedLineFault, LineFaults, Lockstep, RangeFinderFault, SensorFaults,
    Sequential, Simulation, TruckParameters, World,
};

const ROBOTS: usize = 26;
const WORLD: &str = "
    room = { width_m = 19.0, depth_m = 19.0 }
    walls = [{ points = [[-9.5, 1.0], [3.0, 1.0]] }]
    ramps = [{ x_m = 5.0, y_m = -5.0, length_m = 3.0, width_m = 3.0, slope_deg = 8.0, uphill_rad = 1.0 }]
";

fn ask(fleet: &mut Lockstep, robot: usize, id: u128, body: Body) {
    let request = Request { id: Uuid::from_u128(id), lease: None, body };
    fleet.request(robot, &Name::new("tester").unwrap(), &request).unwrap();
}

fn fleet() -> Lockstep {
    let names: Vec<String> = (1..=ROBOTS).map(|n| format!("xtb-{n}")).collect();
    let world = World::from_toml(WORLD).unwrap();
    let simulation = Simulation::new(world, &TruckParameters::default(), &names, 3).unwrap();
    let map = simulation.world().to_map(0.05).unwrap();
    let mut fleet = Lockstep::new(simulation, &Name::new("lab").unwrap(), &VehicleConfig::default()).unwrap();
    fleet.set_map(&map);
    fleet.set_fixes(FixTruth { rate_hz: 2.0, ..FixTruth::default() }, 3);
    fleet.set_unheard(0.2, 3);
    fleet
}

/// Most wander, some drive to goals, if somebody shall.
fn set_off(fleet: &mut Lockstep, goals: bool) {
    for robot in 0..ROBOTS {
        let body = match robot % 5 {
            0 if goals => {
                let (x_m, y_m) = (7.0 - robot as f64 * 0.5, 8.0 - robot as f64 * 0.6);
                let (via, on_link_loss) = (Some(Via::Planned), LinkLoss::Halt);
                Body::Goto { x_m, y_m, yaw_rad: None, via, on_link_loss, finish_s: 300.0 }
            }
            _ => Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 },
        };
        ask(fleet, robot, robot as u128 + 1, body);
    }
}

/// What happens in a round.
fn disturb(fleet: &mut Lockstep, round: u64) {
    let robot = (round * 7) as usize % ROBOTS;
    let until = |now: Stamp| now.plus_ms(60);
    let line = |board, gyro| LineFaults { board, gyro };
    let now = fleet.now();
    let world = fleet.simulation_mut();
    match round % 11 {
        0 => world.trucks_mut()[robot]
            .set_line_faults(line(InjectedLineFault::Lossy(0.3), InjectedLineFault::Garbage)),
        1 => world.trucks_mut()[robot]
            .set_line_faults(line(InjectedLineFault::WrongDevice, InjectedLineFault::None)),
        2 => world.trucks_mut()[robot].set_drive_fault(DriveFault::Stuck),
        4 => world.trucks_mut()[robot].power_cycle_board(),
        5 => {
            let pose = MapPose { x_m: 8.0, y_m: -8.0, yaw_rad: 1.0 };
            let body = TruckParameters::default().body;
            assert!(world.put_foreign("elsewhere-1", &pose, &body, until(now)));
        }
        6 => {
            let spec = BoxSpec { x_m: 4.0, y_m: 6.0, width_m: 0.3, depth_m: 0.3, yaw_rad: 0.4 };
            // Somebody may stand there.
            let _ = world.put_box("crate", spec);
        }
        7 | 3 => {
            // 3 mm in front of somebody who drives: nobody can stop in time.
            let drives = world.truths().find(|truth| truth.speed_mps > 0.05);
            if let Some(TruthRobot { x_m, y_m, yaw_rad, .. }) = drives {
                let (sin, cos) = yaw_rad.sin_cos();
                let pose = MapPose { x_m: x_m + 0.503 * cos, y_m: y_m + 0.503 * sin, yaw_rad };
                let _ = world.place(robot, pose);
            }
        }
        8 => {
            let faults = SensorFaults::range_finder(robot % 12, RangeFinderFault::Short);
            world.trucks_mut()[robot].set_sensor_faults(faults);
            world.trucks_mut()[(robot + 1) % ROBOTS].set_battery_left(0.05);
        }
        9 if round < 20 => fleet.kill(robot),
        _ => ask(fleet, robot, 1000 + u128::from(round), Body::Stop {}),
    }
}

/// Everything that a run shows, and how often trucks touched something.
fn run(goals: bool, ahead: impl Fn(&mut Lockstep, u64)) -> (u64, u64) {
    let mut fleet = fleet();
    let mut bits = DefaultHasher::new();
    ahead(&mut fleet, 100);
    set_off(&mut fleet, goals);
    for round in 0..40 {
        ahead(&mut fleet, [1, 7, 203, 10, 320, 160][round as usize % 6]);
        disturb(&mut fleet, round);
        if goals && round == 20 {
            let map = fleet.simulation().world().to_map(0.05).unwrap();
            let mut traffic = Traffic::new(&map, 3);
            traffic.lost = 0.1;
            fleet.set_traffic(Some(traffic));
        }
        if goals && round == 32 {
            fleet.traffic_mut().unwrap().kill();
        }
        format!("{:?}", fleet.simulation().trucks()).hash(&mut bits);
        for robot in 0..ROBOTS {
            format!("{:?}", fleet.state(robot)).hash(&mut bits);
        }
    }
    (bits.finish(), fleet.simulation().truths().map(|truth| truth.contacts).sum())
}

fn is_the_same_in_windows_and_on(threads: &[usize], goals: bool) {
    let one_by_one = run(goals, |fleet, steps| (0..steps).for_each(|_| fleet.step()));
    assert!(one_by_one.1 > 1, "{} contacts", one_by_one.1);
    assert_eq!(run(goals, |fleet, steps| fleet.run(steps, &Sequential)), one_by_one, "in windows");
    for &threads in threads {
        let many = run(goals, |fleet, steps| fleet.run(steps, &Threads(threads)));
        assert_eq!(many, one_by_one, "{threads} threads");
    }
}

#[test]
fn neither_windows_nor_threads_change_a_bit() {
    is_the_same_in_windows_and_on(&[1, 2, 3, 8], true);
}

#[test]
fn nor_do_the_longer_windows_of_a_fleet_without_planned_goals() {
    is_the_same_in_windows_and_on(&[3], false);
}
