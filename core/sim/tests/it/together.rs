//! Several robots and traffic control: everybody arrives, nobody touches anybody.

use crate::planned::Drive;
use std::f64::consts::{PI, TAU};
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_nav::Car;
use xtb_protocol::messages::{GoalStatus, Outcome};
use xtb_sim::World;
use xtb_sim::lockstep::Traffic;

/// What came of a meeting.
#[derive(Debug, Clone)]
pub(crate) struct Meeting {
    pub(crate) reached: usize,
    pub(crate) contacts: u64,
    pub(crate) took_s: f64,
    /// Longest standstill of one with an open goal, and its reason at the end of it.
    pub(crate) stood_s: f64,
    pub(crate) stood_for: String,
    pub(crate) ends: Vec<(GoalStatus, Option<String>)>,
}

pub(crate) fn fleet(world: &str, starts: &[MapPose], seed: u64) -> Drive {
    let world = World::from_toml(world).unwrap();
    let map = world.chart(0.05).unwrap();
    let mut drive = Drive::at(world, starts, seed);
    let car = Car::of(&VehicleConfig::default());
    drive.lockstep.set_traffic(Some(Traffic::new(&map, car, seed)));
    drive
}

/// All go to their goals at once.
pub(crate) fn meet(drive: &mut Drive, goals: &[MapPose], within_s: f64) -> Meeting {
    let contacts = |drive: &Drive| -> u64 {
        drive.lockstep.simulation().trucks().iter().map(|truck| truck.truth().contacts).sum()
    };
    let before = contacts(drive);
    for (index, goal) in goals.iter().enumerate() {
        let asked = drive.goto(index, goal.x_m, goal.y_m, Some(goal.yaw_rad));
        assert!(matches!(asked, Outcome::Ok(_)), "{asked:?}");
    }
    let begun = drive.lockstep.now();
    let mut stood = vec![0.0; goals.len()];
    let mut made = Meeting {
        reached: 0,
        contacts: 0,
        took_s: 0.0,
        stood_s: 0.0,
        stood_for: String::new(),
        ends: Vec::new(),
    };
    while made.took_s < within_s {
        drive.run_s(0.2);
        made.took_s = drive.lockstep.now().since_s(begun);
        made.ends.clear();
        for (index, stood) in stood.iter_mut().enumerate() {
            let state = drive.lockstep.state(index).unwrap();
            let goal = state.goal.clone().unwrap();
            let stands = !goal.status.is_final() && state.speed_mps.is_none_or(|mps| mps.abs() < 0.01);
            *stood = if stands { *stood + 0.2 } else { 0.0 };
            if *stood > made.stood_s {
                made.stood_s = *stood;
                made.stood_for = format!("{}: {:?} {:?}", state.robot, state.stopped_because, goal.reason);
            }
            made.ends.push((goal.status, goal.reason));
        }
        if made.ends.iter().all(|(status, _)| status.is_final()) {
            break;
        }
    }
    made.reached = made.ends.iter().filter(|(status, _)| *status == GoalStatus::Reached).count();
    made.contacts = contacts(drive) - before;
    made
}

/// Ten on a circle, each to the place opposite.
pub(crate) fn circle(robots: usize, seed: u64) -> Meeting {
    let place = |n: usize, turned: f64| {
        let angle = TAU * n as f64 / robots as f64 + turned;
        let (sin, cos) = angle.sin_cos();
        (3.0 * cos, 3.0 * sin, angle)
    };
    let pose = |(x_m, y_m, angle): (f64, f64, f64), turned: f64| {
        let yaw_rad = xtb_nav::path::wrap_rad(angle + turned);
        MapPose { x_m, y_m, yaw_rad }
    };
    let starts: Vec<_> = (0..robots).map(|n| pose(place(n, 0.0), PI)).collect();
    let goals: Vec<_> = (0..robots).map(|n| pose(place(n, PI), 0.0)).collect();
    let mut drive = fleet("[room]\nwidth_m = 8.0\ndepth_m = 8.0", &starts, seed);
    meet(&mut drive, &goals, 300.0)
}

#[test]
fn four_swap_across_a_circle() {
    let made = circle(4, 1);
    assert_eq!((made.reached, made.contacts), (4, 0), "{made:#?}");
}
