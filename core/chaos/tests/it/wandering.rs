//! Robots that wander among robots that are led. `XTB_WANDERING=50` tries 50 seeds instead of a few.

use crate::draw::Draw;
use crate::drive::Drive;
use crate::lifelong::Fleet;
use xtb_control::VehicleConfig;
use xtb_nav::{Car, MapPose};
use xtb_sim::World;

const ROOM: &str = "[room]\nwidth_m = 10.0\ndepth_m = 10.0\n";
const ROBOTS: usize = 12;
const CROWDED_ROOM: &str = "[room]\nwidth_m = 9.0\ndepth_m = 9.0\n";
const CROWD: usize = 16;

/// Seeds from the first one on: so many, or as many as `XTB_WANDERING` says.
fn seeds(first: u64, usually: u64) -> std::ops::Range<u64> {
    let asked = std::env::var("XTB_WANDERING").ok().and_then(|count| count.parse().ok());
    first..first + asked.unwrap_or(usually)
}

/// Five minutes in which every other robot wanders and the rest always has a goal.
fn touched(seed: u64) -> Vec<String> {
    let mut fleet = Fleet::new(ROOM, ROBOTS, seed, true);
    (0..ROBOTS).step_by(2).for_each(|index| fleet.drive.wander(index));
    fleet.run(300.0, true, &mut |_, _| {});
    assert!(fleet.life.reached > 5, "{} goals reached", fleet.life.reached);
    fleet.life.touched
}

/// So long in a crowd of which each robot goes from goal to goal, and every 40 s or so wanders for 10 to 40 s first.
fn touched_in_crowd(seed: u64, seconds: f64) -> Vec<String> {
    let mut fleet = Fleet::new(CROWDED_ROOM, CROWD, seed, true);
    let mut draw = Draw::new(seed ^ 0x77AA);
    let mut wanders_until_s = [None; CROWD];
    fleet.run(seconds, true, &mut |fleet, at_s| {
        for (index, until_s) in wanders_until_s.iter_mut().enumerate() {
            match *until_s {
                Some(end_s) if end_s > at_s => {}
                Some(_) => {
                    *until_s = None;
                    fleet.send_on(index);
                }
                None if draw.uniform(0.0, 1.0) < 0.005 => {
                    *until_s = Some(at_s + draw.uniform(10.0, 40.0));
                    fleet.drive.wander(index);
                }
                None => {}
            }
        }
    });
    assert!(fleet.life.reached > 5, "{} goals reached", fleet.life.reached);
    fleet.life.touched
}

/// One that wanders for so long in a square room, `gap_m` beside its north wall at first, heading `toward_deg` towards
/// it: its contacts, and how far it drove, in m.
fn along_a_wall(side_m: f64, gap_m: f64, toward_deg: f64, seed: u64, seconds: f64) -> (u64, f64) {
    let room = format!("[room]\nwidth_m = {side_m}\ndepth_m = {side_m}\n");
    let half_width_m = Car::of(&VehicleConfig::default()).half_width_m;
    let y_m = side_m / 2.0 - half_width_m - gap_m;
    let start = MapPose { x_m: 1.0 - side_m / 2.0, y_m, yaw_rad: toward_deg.to_radians() };
    let mut drive = Drive::at(World::from_toml(&room).unwrap(), &[start], seed);
    drive.wander(0);
    let mut driven_m = 0.0;
    for _ in 0..(seconds / 0.1) as u32 {
        drive.run_s(0.1);
        driven_m += 0.1 * drive.lockstep.simulation().trucks()[0].truth().speed_mps.abs();
    }
    (drive.lockstep.simulation().trucks()[0].truth().contacts, driven_m)
}

/// Its beams look straight ahead: no range finder sees a wall that is met at so flat an angle.
#[test]
fn a_robot_that_wanders_along_a_wall_leaves_it() {
    for seed in seeds(601, 8) {
        let mut draw = Draw::new(seed);
        let (gap_m, toward_deg) = (draw.uniform(0.2, 0.4), draw.uniform(3.0, 10.0));
        let (contacts, driven_m) = along_a_wall(14.0, gap_m, toward_deg, seed, 90.0);
        assert_eq!(contacts, 0, "seed {seed}: {gap_m:.2} m beside it, {toward_deg:.1}° towards it");
        assert!(driven_m > 5.0, "seed {seed}: {driven_m} m");
    }
}

#[test]
fn robots_that_wander_touch_nobody_who_is_led() {
    for seed in seeds(201, 2) {
        assert_eq!(touched(seed), Vec::<String>::new(), "seed {seed}");
    }
}

/// It gets its goal where another one's released way is: with seed 10 that one drove on into it.
#[test]
fn nobody_touches_a_robot_that_has_just_ended_to_wander() {
    for seed in seeds(10, 1) {
        assert_eq!(touched_in_crowd(seed, 200.0), Vec::<String>::new(), "seed {seed}");
    }
}

/// Everybody always has a goal, and messages are half a second late: at 0.35 m/s that is 17 cm.
#[test]
fn robots_that_are_led_touch_nobody_when_messages_are_late() {
    for seed in seeds(401, 1) {
        let mut fleet = Fleet::new(CROWDED_ROOM, CROWD, seed, true);
        fleet.drive.lockstep.traffic_mut().unwrap().late_ms = 500;
        fleet.run(120.0, true, &mut |_, _| {});
        assert!(fleet.life.reached > 20, "{} goals reached", fleet.life.reached);
        assert_eq!(fleet.life.touched, Vec::<String>::new(), "seed {seed}");
    }
}
