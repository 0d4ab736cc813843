//! What a scene keeps, and for how long.

use super::*;
use xtb_protocol::messages::{Roster, SimStats};

fn own(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn key(text: &str) -> Key {
    Key::parse(text).unwrap()
}

fn state(name: &str, x_m: f64) -> RobotState {
    let mut state = crate::fake::state(name);
    state.pose.x_m = x_m;
    state
}

#[test]
fn an_old_state_keeps_its_age_and_is_not_fresh() {
    let mut scene = Scene::new(own("lab"));
    scene.take(1000, &key("xtb/lab/xtb-1/state"), state("xtb-1", 1.0).into());
    let seen = scene.robots()[&own("xtb-1")].state.as_ref().unwrap();
    assert!(seen.fresh(1400).is_some());
    assert_eq!((seen.fresh(1600), seen.age_ms(1600)), (None, 600));
}

#[test]
fn a_trail_grows_with_the_way_and_is_bounded() {
    let mut scene = Scene::new(own("lab"));
    for step in 0..2000_u32 {
        let x_m = f64::from(step) * 0.03;
        scene.take(u64::from(step), &key("xtb/lab/xtb-1/state"), state("xtb-1", x_m).into());
    }
    let robot = &scene.robots()[&own("xtb-1")];
    assert_eq!((robot.trail.len(), robot.trail_count), (TRAIL, 1000));
    assert!(robot.trail.back().unwrap().0 > 59.0);
}

#[test]
fn presence_that_did_not_change_is_no_happening() {
    let mut scene = Scene::new(own("lab"));
    for there in [true, true, false] {
        scene.take(0, &key("xtb/lab/xtb-1/alive"), AnyMessage::Alive(there));
        scene.take(0, &key("xtb/lab/dispatch/alive"), AnyMessage::Alive(there));
    }
    let shown: Vec<_> = scene
        .happenings()
        .iter()
        .map(|happening| match &happening.what {
            SceneChange::Presence { key, there, .. } => (key.as_str(), *there),
            other => panic!("{other:?}"),
        })
        .collect();
    let (robot, dispatcher) = ("xtb/lab/xtb-1/alive", "xtb/lab/dispatch/alive");
    assert_eq!(shown, [(robot, true), (dispatcher, true), (robot, false), (dispatcher, false)]);
}

#[test]
fn happenings_are_bounded_and_numbered() {
    let mut scene = Scene::new(own("lab"));
    for n in 0..300_u64 {
        scene.take(n, &key("xtb/lab/xtb-1/alive"), AnyMessage::Alive(n % 2 == 0));
    }
    let numbers: Vec<u64> = scene.happenings().iter().map(|happening| happening.number).collect();
    assert_eq!(numbers, (101..=300).collect::<Vec<_>>());
}

#[test]
fn other_fleets_and_too_many_robots_are_counted() {
    let mut scene = Scene::new(own("lab"));
    scene.take(0, &key("xtb/hall/xtb-1/alive"), AnyMessage::Alive(true));
    assert_eq!((scene.robots().len(), scene.refused()), (0, 1));
    for n in 0..MOST_ROBOTS + 3 {
        scene.take(0, &key(&format!("xtb/lab/r{n}/alive")), AnyMessage::Alive(true));
    }
    assert_eq!((scene.robots().len(), scene.refused()), (MOST_ROBOTS, 4));
}

#[test]
fn the_roster_makes_rows_for_those_who_are_missing() {
    let mut scene = Scene::new(own("lab"));
    let entry = RosterEntry { name: own("xtb-7"), tags: vec!["red".into()], start_pose: None };
    scene.take(0, &key("xtb/lab/sim/roster"), Roster { robots: vec![entry.clone()] }.into());
    let robot = &scene.robots()[&own("xtb-7")];
    assert_eq!((robot.alive, &robot.roster, &robot.state), (false, &Some(entry), &None));
    // A simulator's roster, which has no tags, takes none away.
    let bare = RosterEntry { name: own("xtb-7"), tags: Vec::new(), start_pose: None };
    scene.take(0, &key("xtb/lab/sim/roster"), Roster { robots: vec![bare] }.into());
    let kept = scene.robots()[&own("xtb-7")].roster.as_ref().unwrap();
    assert_eq!(kept.tags, ["red"]);
}

#[test]
fn of_several_simulators_the_slowest_is_told_as_long_as_it_is_heard() {
    let mut scene = Scene::new(own("lab"));
    let stats = |first, factor| SimStats { t_s: 1.0, speed: 2.0, real_time_factor: Some(factor), first };
    let mut say = |at_ms, first, factor| {
        scene.take(at_ms, &key("xtb/lab/sim/stats"), stats(first, factor).into());
        scene.slow_simulator(at_ms)
    };
    assert_eq!(say(0, Some(1), 1.9), None);
    let slow = stats(Some(501), 0.6);
    assert_eq!(say(500, Some(501), 0.6), Some(slow));
    assert_eq!(say(1000, Some(1), 1.9), Some(slow), "the other one is in time");
    assert_eq!(say(1400, Some(1), 0.5), Some(stats(Some(1), 0.5)), "even slower");
    assert_eq!(say(2000, Some(501), 1.8), Some(stats(Some(1), 0.5)));
    assert_eq!(say(6500, Some(501), 1.8), None, "the first one has not been heard for 5 s");
    for first in 0..1000 {
        say(7000, Some(first), 1.0);
    }
    assert_eq!(scene.simulators.len(), MOST_SIMULATORS);
    scene.take(7100, &key("xtb/lab/sim/stats"), slow.into());
    assert_eq!(scene.slow_simulator(7100), Some(slow), "one that is known is heard in a crowd too");
}
