//! Robots that meet without traffic control: nobody touches anybody, and everything ends.

use crate::meetings::{Meeting, meet};
use crate::planned::Drive;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use xtb_control::frames::MapPose;
use xtb_protocol::messages::GoalStatus;
use xtb_sim::World;

const HALL: &str = "[room]\nwidth_m = 8.0\ndepth_m = 6.0";
const SQUARE: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0";
/// Two rooms and a corridor of 0.9 m between them: nobody passes anybody in there.
const CORRIDOR: &str = "[room]\nwidth_m = 10.0\ndepth_m = 3.0\n\
    [[boxes]]\nname = \"north\"\nx_m = 0.0\ny_m = 0.975\nwidth_m = 4.0\ndepth_m = 1.05\n\
    [[boxes]]\nname = \"south\"\nx_m = 0.0\ny_m = -0.975\nwidth_m = 4.0\ndepth_m = 1.05";

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

fn alone(world: &str, starts: &[MapPose], seed: u64) -> Drive {
    Drive::at(World::from_toml(world).unwrap(), starts, seed)
}

fn untouched(made: &Meeting, seed: u64) {
    assert_eq!(made.contacts, 0, "seed {seed}: {:#?}", Meeting { tracks: Vec::new(), ..made.clone() });
}

fn all_arrive(made: &Meeting, seed: u64) {
    untouched(made, seed);
    assert_eq!(made.reached, made.ends.len(), "seed {seed}: {:#?}", made.ends);
}

/// Everybody has arrived, or says who was in the way.
fn all_end(made: &Meeting, seed: u64) {
    untouched(made, seed);
    let told = |(status, reason): &(GoalStatus, Option<String>)| match status {
        GoalStatus::Reached => true,
        GoalStatus::Failed => reason.as_ref().is_some_and(|words| words.contains("blocked by xtb-")),
        _ => false,
    };
    assert!(made.ends.iter().all(told), "seed {seed}: {:#?}", made.ends);
}

#[test]
fn nose_to_nose_in_a_hall_both_arrive() {
    for seed in 1..=20 {
        let off_m = (seed as f64 - 10.0) * 0.02;
        let starts = [pose(-2.5, 0.0, 0.0), pose(2.5, off_m, PI)];
        let goals = [pose(2.5, 0.0, 0.0), pose(-2.5, off_m, PI)];
        let mut drive = alone(HALL, &starts, seed);
        let made = meet(&mut drive, &goals, 240.0, &mut |_, _| ());
        eprintln!("nose {seed}: {:.0} s stood {:.1} waited {:.1} contacts {} {:?}", made.took_s, made.stood_s, made.waited_s, made.contacts, made.ends);
        all_arrive(&made, seed);
    }
}

#[test]
fn at_right_angles_both_arrive_and_the_smaller_name_hardly_stops() {
    for seed in 1..=20 {
        let later_m = (seed as f64 - 10.0) * 0.06;
        let starts = [pose(-2.5, 0.0, 0.0), pose(0.0, -2.6 + later_m, FRAC_PI_2)];
        let goals = [pose(2.5, 0.0, 0.0), pose(0.0, 3.0, FRAC_PI_2)];
        let mut drive = alone(SQUARE, &starts, seed);
        let mut stood_s: f64 = 0.0;
        let made = meet(&mut drive, &goals, 240.0, &mut |drive, _| {
            let state = drive.lockstep.state(0).unwrap();
            if state.goal.is_some_and(|goal| !goal.status.is_final()) {
                stood_s = stood_s.max(state.stopped_age_ms.unwrap_or(0) as f64 / 1000.0);
            }
        });
        eprintln!("cross {seed}: {:.0} s first stood {stood_s:.1} waited {:.1} contacts {} {:?}", made.took_s, made.waited_s, made.contacts, made.ends);
        all_arrive(&made, seed);
        assert!(stood_s < 3.0, "seed {seed}: the first one stood for {stood_s} s");
    }
}

#[test]
fn in_a_corridor_one_backs_out_or_both_say_who_is_in_the_way() {
    let mut reached = 0;
    for seed in 1..=20 {
        let east_m = 0.6 + seed as f64 * 0.05;
        let starts = [pose(-east_m, 0.0, 0.0), pose(east_m, 0.0, PI)];
        let goals = [pose(4.0, 0.0, 0.0), pose(-4.0, 0.0, PI)];
        let mut drive = alone(CORRIDOR, &starts, seed);
        let made = meet(&mut drive, &goals, 290.0, &mut |_, _| ());
        eprintln!("corridor {seed}: {:.0} s stood {:.1} waited {:.1} contacts {} {:?}", made.took_s, made.stood_s, made.waited_s, made.contacts, made.ends);
        all_end(&made, seed);
        reached += made.reached;
    }
    assert!(reached >= 36, "{reached} of 40 arrived");
}

#[test]
fn a_parked_robot_is_gone_round() {
    for seed in 1..=20 {
        let off_m = (seed as f64 - 10.0) * 0.03;
        let starts = [pose(-2.5, 0.0, 0.0), pose(0.0, off_m, seed as f64)];
        let mut drive = alone(HALL, &starts, seed);
        let made = meet(&mut drive, &[pose(2.5, 0.0, 0.0)], 240.0, &mut |_, _| ());
        eprintln!("parked {seed}: {:.0} s waited {:.1} contacts {} {:?}", made.took_s, made.waited_s, made.contacts, made.ends);
        all_arrive(&made, seed);
        assert_eq!(drive.lockstep.simulation().trucks()[1].truth().contacts, 0);
    }
}

fn circle(robots: usize, seed: u64) -> Meeting {
    let place = |n: usize, turned: f64, facing: f64| {
        let angle = TAU * n as f64 / robots as f64 + turned;
        pose(3.0 * angle.cos(), 3.0 * angle.sin(), xtb_nav::path::wrap_rad(angle + facing))
    };
    let starts: Vec<_> = (0..robots).map(|n| place(n, 0.0, PI)).collect();
    let goals: Vec<_> = (0..robots).map(|n| place(n, PI, 0.0)).collect();
    let mut drive = alone(SQUARE, &starts, seed);
    meet(&mut drive, &goals, 290.0, &mut |_, _| ())
}

#[test]
fn explore_circles() {
    for robots in [3, 4, 6, 10] {
        for seed in 1..=5 {
            let made = circle(robots, seed);
            eprintln!("circle {robots} {seed}: {:.0} s stood {:.1} {} waited {:.1} contacts {} {:?}\n   {:#?}", made.took_s, made.stood_s, made.stood_for, made.waited_s, made.contacts, made.ends, made.touched);
        }
    }
}

#[test]
fn explore_door() {
    const ROOM: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0\ny_m = 4.0\n\
            [[walls]]\npoints = [[-4.0, 4.0], [-0.75, 4.0]]\n[[walls]]\npoints = [[0.75, 4.0], [4.0, 4.0]]";
    for seed in 1..=5 {
        let side = |n: usize, north: bool| {
            let x_m = (n as f64 - 2.0) * 1.3;
            if north { pose(x_m, 5.6, -FRAC_PI_2) } else { pose(x_m, 2.4, FRAC_PI_2) }
        };
        let starts: Vec<_> = (0..5).map(|n| side(n, n % 2 == 0)).collect();
        let goals: Vec<_> = (0..5).map(|n| side(n, n % 2 == 1)).collect();
        let mut drive = alone(ROOM, &starts, seed);
        let made = meet(&mut drive, &goals, 290.0, &mut |_, _| ());
        eprintln!("door {seed}: {:.0} s stood {:.1} {} waited {:.1} contacts {} {:?}\n   {:#?}", made.took_s, made.stood_s, made.stood_for, made.waited_s, made.contacts, made.ends, made.touched);
    }
}

#[test]
fn explore_closed() {
    for seed in 1..=5 {
        // A parked, then a latched one in the corridor.
        let starts = [pose(-3.5, 0.0, 0.0), pose(0.3, 0.0, PI)];
        let mut drive = alone(CORRIDOR, &starts, seed);
        let made = meet(&mut drive, &[pose(4.0, 0.0, 0.0)], 240.0, &mut |_, _| ());
        eprintln!("closed {seed}: {:.0} s waited {:.1} contacts {} {:?}", made.took_s, made.waited_s, made.contacts, made.ends);
        let made = meet(&mut drive, &[pose(4.0, 0.0, 0.0), pose(-4.0, 0.6, PI)], 240.0, &mut |_, _| ());
        eprintln!("again {seed}: {:.0} s waited {:.1} contacts {} {:?}", made.took_s, made.waited_s, made.contacts, made.ends);
    }
}
