//! Each check finds what is wrong, and nothing where nothing is.

use super::*;
use crate::fake::{self, name};
use xtb_protocol::messages::{FaultState, Latch, ParameterInfo};

fn entry(robot: &str) -> RosterEntry {
    RosterEntry { name: name(robot), tags: Vec::new(), start_pose: None }
}

/// A fleet of two with nothing wrong.
fn healthy() -> Facts {
    let robots = ["xtb-1", "xtb-2"];
    let each = || robots.iter().map(|robot| (name(robot), *robot));
    Facts {
        connected: "tcp/a:1".into(),
        fleet: name("lab"),
        roster: Some(robots.map(entry).to_vec()),
        alive: robots.map(name).into(),
        abouts: each().map(|(name, robot)| (name, vec![fake::about(robot, "00c0ffee")])).collect(),
        unreadable: BTreeMap::new(),
        epochs: each().map(|(name, _)| (name, BTreeSet::from([7]))).collect(),
        voices: each().map(|(name, _)| (name, 1)).collect(),
        answered_for_nobody: false,
        states: each().map(|(name, robot)| (name, fake::state(robot))).collect(),
        rates: each().map(|(name, _)| (name, Some(1.02))).collect(),
    }
}

/// The findings that are not ok.
fn wrong(facts: &Facts) -> Vec<Finding> {
    all(facts).into_iter().filter(|finding| finding.level != Level::Ok).collect()
}

fn the_only(facts: &Facts) -> Finding {
    let mut found = wrong(facts);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].todo.as_ref().is_some_and(|todo| !todo.is_empty()), "{found:?}");
    found.remove(0)
}

#[test]
fn a_healthy_fleet_is_ok_in_every_respect() {
    let findings = all(&healthy());
    assert!(findings.iter().all(|finding| finding.level == Level::Ok), "{findings:?}");
    let topics: Vec<_> = findings.iter().map(|finding| finding.topic).collect();
    assert_eq!(
        topics,
        ["roster", "names", "versions", "starts", "clocks", "loops", "vehicle", "latches", "faults"]
    );
}

#[test]
fn the_roster_names_the_missing_and_the_unexpected_or_how_to_write_one() {
    let mut facts = healthy();
    facts.roster = Some(vec![entry("xtb-1"), entry("xtb-2"), entry("xtb-3")]);
    let found = the_only(&facts);
    assert_eq!(
        (found.level, found.robot, found.text.as_str()),
        (Level::Problem, Some(name("xtb-3")), "missing")
    );
    facts.roster = Some(vec![entry("xtb-1")]);
    let found = the_only(&facts);
    assert_eq!((found.level, found.robot), (Level::Warning, Some(name("xtb-2"))));
    facts.roster = None;
    let todo = the_only(&facts).todo.unwrap();
    let written = todo.split('`').nth(1).unwrap();
    let config = crate::config::FleetConfig::parse(written).unwrap();
    assert_eq!(config.robots, [entry("xtb-1"), entry("xtb-2")], "{todo}");
}

#[test]
fn nobody_at_all_is_one_problem() {
    let nobody = Facts {
        roster: None,
        alive: BTreeSet::new(),
        abouts: BTreeMap::new(),
        epochs: BTreeMap::new(),
        voices: BTreeMap::new(),
        answered_for_nobody: false,
        states: BTreeMap::new(),
        rates: BTreeMap::new(),
        ..healthy()
    };
    let findings = all(&nobody);
    assert_eq!((findings.len(), findings[0].level), (1, Level::Problem));
    assert!(findings[0].text.contains("no robot of fleet lab is at tcp/a:1"), "{findings:?}");
}

#[test]
fn two_agents_of_one_name_are_a_problem() {
    let mut facts = healthy();
    facts.epochs.insert(name("xtb-1"), BTreeSet::from([7, 8]));
    facts.rates.insert(name("xtb-1"), None);
    let found = the_only(&facts);
    assert_eq!((found.level, found.topic, found.robot), (Level::Problem, "names", Some(name("xtb-1"))));
}

#[test]
fn other_versions_unreadable_messages_and_silence_are_told_apart() {
    let mut facts = healthy();
    facts.abouts.get_mut(&name("xtb-1")).unwrap()[0].version = "0.0.1".into();
    let found = the_only(&facts);
    assert_eq!(found.level, Level::Warning);
    assert!(found.text.contains("agent 0.0.1"), "{found:?}");
    facts.abouts.remove(&name("xtb-1"));
    assert!(the_only(&facts).text.contains("does not answer"));
    facts.unreadable.insert(name("xtb-1"), "RobotState.v9".into());
    let found = the_only(&facts);
    assert_eq!(found.level, Level::Problem);
    assert!(found.text.contains("cannot be read: RobotState.v9"), "{found:?}");
}

#[test]
fn a_start_pose_that_is_not_the_rosters_is_shown_with_both() {
    let mut facts = healthy();
    let pose = |x_m, yaw_rad| Some(MapPose { x_m, y_m: 0.0, yaw_rad });
    let started = facts.abouts[&name("xtb-1")][0].start_pose;
    let turned = started.yaw_rad + std::f64::consts::TAU;
    for (start_pose, differs) in [(pose(started.x_m, turned), false), (pose(1.0, started.yaw_rad), true)] {
        let first = RosterEntry { start_pose, tags: vec!["arm".into()], ..entry("xtb-1") };
        facts.roster = Some(vec![first, entry("xtb-2")]);
        assert_eq!(wrong(&facts).len(), usize::from(differs), "{start_pose:?}");
        assert!(all(&facts).iter().any(|finding| finding.text.contains("tags: xtb-1 arm")));
    }
    assert!(the_only(&facts).text.contains("starts at (1.00, 0.00)"));
}

#[test]
fn a_clock_that_is_off_is_a_problem_except_a_simulators() {
    let mut facts = healthy();
    for rate in [Some(0.94), Some(1.06), None] {
        facts.rates.insert(name("xtb-1"), rate);
        let found = the_only(&facts);
        assert_eq!((found.level, found.topic), (Level::Problem, "clocks"), "{rate:?}");
    }
    facts.rates.insert(name("xtb-1"), Some(8.0));
    facts.abouts.get_mut(&name("xtb-1")).unwrap()[0].hardware = "simulated".into();
    assert_eq!(wrong(&facts), []);
    assert!(all(&facts).iter().any(|finding| finding.text.contains("8.0 times ours: a simulator's")));
}

#[test]
fn a_control_loop_that_was_late_is_worth_a_look() {
    let mut facts = healthy();
    facts.states.get_mut(&name("xtb-1")).unwrap().turn_late_us = 12_000;
    let found = the_only(&facts);
    assert_eq!((found.level, found.text.as_str()), (Level::Warning, "its control loop was 12 ms late"));
}

#[test]
fn differing_vehicle_parameters_are_named() {
    let mut facts = healthy();
    let parameter = |value: &str| ParameterInfo {
        name: "speed.kp".into(),
        value: value.into(),
        unit: String::new(),
        origin: "printed".into(),
    };
    for (robot, hash, value) in [("xtb-1", "a", "1"), ("xtb-2", "a", "1"), ("xtb-3", "b", "2")] {
        let about = About { vehicle: vec![parameter(value)], ..fake::about(robot, hash) };
        facts.abouts.insert(name(robot), vec![about]);
    }
    let found = the_only(&facts);
    assert_eq!((found.level, &found.robot), (Level::Warning, &Some(name("xtb-3"))));
    assert!(found.text.contains("a of xtb-1, xtb-2: speed.kp 2 instead of 1"), "{found:?}");
}

#[test]
fn latches_faults_and_batteries_are_shown_with_their_remedies() {
    let mut facts = healthy();
    let state = facts.states.get_mut(&name("xtb-1")).unwrap();
    state.latches = vec![fake::latch(Latch::Estop, "cli-1", false)];
    let found = the_only(&facts);
    assert_eq!((found.level, found.topic), (Level::Problem, "latches"));
    let state = facts.states.get_mut(&name("xtb-1")).unwrap();
    state.latches.clear();
    state.faults = vec![FaultState { fault: Fault::GyroSilent, age_ms: 3000, detail: None }];
    let found = the_only(&facts);
    assert_eq!((found.level, found.todo.as_deref()), (Level::Problem, Some(Fault::GyroSilent.remedy())));
    let state = facts.states.get_mut(&name("xtb-1")).unwrap();
    state.faults = vec![FaultState { fault: Fault::BatteryLow, age_ms: 3000, detail: None }];
    state.battery_level = BatteryLevel::Finish;
    assert_eq!(the_only(&facts).level, Level::Warning, "said once");
    let state = facts.states.get_mut(&name("xtb-1")).unwrap();
    state.faults.clear();
    (state.battery_level, state.battery_v) = (BatteryLevel::Unknown, None);
    assert!(the_only(&facts).text.contains("may be empty"));
}
