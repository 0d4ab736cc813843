//! Robots that meet without traffic control: nobody touches anybody, and everything ends.

use crate::drive::Drive;
use crate::meetings::{Meeting, meet};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{GoalStatus, RouteSource, StopReason};
use xtb_sim::World;

const HALL: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0";
/// Two rooms and a corridor of 0.9 m between them: nobody passes anybody in there.
const CORRIDOR: &str = "[room]\nwidth_m = 10.0\ndepth_m = 3.0\n\
    [[boxes]]\nname = \"north\"\nx_m = 0.0\ny_m = 0.975\nwidth_m = 4.0\ndepth_m = 1.05\n\
    [[boxes]]\nname = \"south\"\nx_m = 0.0\ny_m = -0.975\nwidth_m = 4.0\ndepth_m = 1.05";
/// A corridor without rooms.
const TUBE: &str = "[room]\nwidth_m = 8.0\ndepth_m = 3.0\n\
    [[boxes]]\nname = \"north\"\nx_m = 0.0\ny_m = 0.975\nwidth_m = 8.0\ndepth_m = 1.05\n\
    [[boxes]]\nname = \"south\"\nx_m = 0.0\ny_m = -0.975\nwidth_m = 8.0\ndepth_m = 1.05";

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

fn alone(world: &str, starts: &[MapPose], seed: u64) -> Drive {
    Drive::at(World::from_toml(world).unwrap(), starts, seed)
}

/// Without anybody who meddles.
fn meet_alone(drive: &mut Drive, goals: &[MapPose]) -> Meeting {
    meet(drive, goals, 290.0, &mut |_, _| ())
}

fn untouched(made: &Meeting, seed: u64) {
    let what = || format!("seed {seed}: {:#?}", Meeting { tracks: Vec::new(), ..made.clone() });
    assert_eq!(made.contacts, 0, "{}", what());
    // A wait for a robot that is named, and moves, stays under a minute; any other is short.
    assert!(made.is_brisk(), "{}", what());
}

fn all_arrive(made: &Meeting, seed: u64) {
    untouched(made, seed);
    assert_eq!(made.reached, made.ends.len(), "seed {seed}: {:#?}", made.ends);
}

/// It has ended: by name of whoever is in the way.
fn is_told(end: &(GoalStatus, Option<String>), by: &str) -> bool {
    end.0 == GoalStatus::Failed && end.1.as_deref() == Some(by)
}

#[test]
fn nose_to_nose_in_a_hall_both_arrive() {
    for seed in 1..=20 {
        let off_m = (seed as f64 - 10.0) * 0.02;
        let starts = [pose(-2.5, 0.0, 0.0), pose(2.5, off_m, PI)];
        let goals = [pose(2.5, 0.0, 0.0), pose(-2.5, off_m, PI)];
        all_arrive(&meet_alone(&mut alone(HALL, &starts, seed), &goals), seed);
    }
}

#[test]
fn at_right_angles_both_arrive_and_the_smaller_name_hardly_stops() {
    for seed in 1..=20 {
        let later_m = (seed as f64 - 10.0) * 0.06;
        let starts = [pose(-2.5, 0.0, 0.0), pose(0.0, -2.6 + later_m, FRAC_PI_2)];
        let goals = [pose(2.5, 0.0, 0.0), pose(0.0, 3.0, FRAC_PI_2)];
        let (mut stood_s, mut gave_way): (f64, bool) = (0.0, false);
        let made = meet(&mut alone(HALL, &starts, seed), &goals, 240.0, &mut |drive, at_s| {
            let [first, second] = [0, 1].map(|index| drive.lockstep.state(index).unwrap());
            if at_s > 3.0 && first.goal.is_some_and(|goal| !goal.status.is_final()) {
                stood_s = stood_s.max(first.stopped_age_ms.unwrap_or(0) as f64 / 1000.0);
            }
            let goal = second.goal.unwrap();
            if second.stopped_because.contains(&StopReason::GivingWay) {
                let route = second.nav.route.unwrap();
                assert_eq!(route.waits_for.unwrap().as_str(), "xtb-1");
                assert_eq!(goal.reason.as_deref(), Some("giving way to xtb-1"));
                assert!(!second.nav.traffic && route.source == RouteSource::Own, "it goes alone");
                gave_way = true;
            }
        });
        all_arrive(&made, seed);
        assert!(stood_s < 2.0, "seed {seed}: the first one stood for {stood_s} s");
        assert!(gave_way, "seed {seed}: the second one never said that it gives way");
    }
}

#[test]
fn in_a_corridor_one_backs_out() {
    for seed in 1..=20 {
        let east_m = 0.6 + seed as f64 * 0.05;
        let starts = [pose(-east_m, 0.0, 0.0), pose(east_m, 0.0, PI)];
        let goals = [pose(4.0, 0.0, 0.0), pose(-4.0, 0.0, PI)];
        let made = meet_alone(&mut alone(CORRIDOR, &starts, seed), &goals);
        all_arrive(&made, seed);
        let farthest_m = made.tracks[1].iter().fold(0.0, |far: f64, pose| far.max(pose.x_m));
        assert!(farthest_m > 2.0, "seed {seed}: the second one has not backed out, {farthest_m} m");
    }
}

#[test]
fn where_nobody_can_make_room_both_say_who_is_in_the_way() {
    for seed in 1..=20 {
        let east_m = 0.6 + seed as f64 * 0.05;
        let starts = [pose(-east_m, 0.0, 0.0), pose(east_m, 0.0, PI)];
        let goals = [pose(3.0, 0.0, 0.0), pose(-3.0, 0.0, PI)];
        let made = meet_alone(&mut alone(TUBE, &starts, seed), &goals);
        assert_eq!(made.contacts, 0, "seed {seed}: {:#?}", made.touched);
        assert!(made.took_s < 150.0, "seed {seed}: {} s", made.took_s);
        assert!(is_told(&made.ends[0], "blocked by xtb-2"), "seed {seed}: {:#?}", made.ends);
        assert!(is_told(&made.ends[1], "blocked by xtb-1"), "seed {seed}: {:#?}", made.ends);
    }
}

#[test]
fn a_parked_robot_is_gone_round() {
    for seed in 1..=20 {
        let off_m = (seed as f64 - 10.0) * 0.03;
        let starts = [pose(-2.5, 0.0, 0.0), pose(0.0, off_m, seed as f64)];
        let mut drive = alone(HALL, &starts, seed);
        all_arrive(&meet_alone(&mut drive, &[pose(2.5, 0.0, 0.0)]), seed);
        assert_eq!(drive.lockstep.simulation().trucks()[1].truth().contacts, 0);
    }
}

#[test]
fn a_robot_that_is_parked_or_latched_in_a_corridor_is_named() {
    for (seed, latched) in [(1, false), (2, true)] {
        let mut drive = alone(CORRIDOR, &[pose(-3.5, 0.0, 0.0), pose(0.3, 0.0, PI)], seed);
        if latched {
            drive.estop(1);
        }
        let made = meet_alone(&mut drive, &[pose(4.0, 0.0, 0.0)]);
        assert_eq!(made.contacts, 0);
        assert!(is_told(&made.ends[0], "blocked by xtb-2"), "{:?}", made.ends);
    }
}

#[test]
fn many_swap_across_a_circle_also_with_three_of_ten_states_lost() {
    for (robots, seed, unheard) in
        [(4, 1, 0.0), (4, 2, 0.3), (6, 3, 0.0), (6, 4, 0.3), (10, 5, 0.0), (10, 6, 0.3)]
    {
        let place = |n: usize, turned: f64, facing: f64| {
            let angle = TAU * n as f64 / robots as f64 + turned;
            pose(3.0 * angle.cos(), 3.0 * angle.sin(), xtb_nav::geometry::path::wrap_rad(angle + facing))
        };
        let starts: Vec<_> = (0..robots).map(|n| place(n, 0.0, PI)).collect();
        let goals: Vec<_> = (0..robots).map(|n| place(n, PI, 0.0)).collect();
        let mut drive = alone(HALL, &starts, seed);
        drive.lockstep.set_unheard(unheard, seed);
        let made = meet_alone(&mut drive, &goals);
        assert_eq!(made.contacts, 0, "seed {seed}: {:#?}", made.touched);
        assert!(made.ends.iter().all(|(status, _)| status.is_final()), "seed {seed}: {:#?}", made.ends);
        assert!(made.is_told(), "seed {seed}: {:#?}", made.ends);
    }
}

#[test]
fn five_swap_through_a_door() {
    const ROOM: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0\ny_m = 4.0\n\
        [[walls]]\npoints = [[-4.0, 4.0], [-0.75, 4.0]]\n[[walls]]\npoints = [[0.75, 4.0], [4.0, 4.0]]";
    let side = |n: usize, north: bool| {
        let x_m = (n as f64 - 2.0) * 1.3;
        if north { pose(x_m, 5.6, -FRAC_PI_2) } else { pose(x_m, 2.4, FRAC_PI_2) }
    };
    let starts: Vec<_> = (0..5).map(|n| side(n, n % 2 == 0)).collect();
    let goals: Vec<_> = (0..5).map(|n| side(n, n % 2 == 1)).collect();
    for seed in 1..=5 {
        let made = meet_alone(&mut alone(ROOM, &starts, seed), &goals);
        assert_eq!(made.contacts, 0, "seed {seed}: {:#?}", made.touched);
        assert!(made.is_told(), "seed {seed}: {:#?}", made.ends);
    }
}
