//! Each check finds what is wrong, and nothing where nothing is.

use super::*;
use xtb_client::fake::{self, name};
use xtb_protocol::messages::{
    BOARD_FIRMWARE, DispatchStatus, FaultState, FleetMap, Latch, MapHash, MapState, ParameterInfo, SPEAKS,
    SimStats, TaskList, TaskState, TrafficState,
};

fn entry(robot: &str) -> RosterEntry {
    RosterEntry { name: name(robot), tags: Vec::new(), start_pose: None }
}

/// A fleet of two with nothing wrong.
pub(super) fn healthy() -> Facts {
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
        fixes: FixBook::default(),
        services: Services::default(),
        simulator: None,
        simulated: BTreeSet::new(),
    }
}

/// The findings that are not ok.
fn wrong(facts: &Facts) -> Vec<Finding> {
    all(facts).into_iter().filter(|finding| finding.level != Level::Ok).collect()
}

fn the_only(facts: &Facts) -> Finding {
    let mut found = wrong(facts);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].hint.as_ref().is_some_and(|hint| !hint.is_empty()), "{found:?}");
    found.remove(0)
}

#[test]
fn a_healthy_fleet_is_ok_in_every_respect() {
    let findings = all(&healthy());
    assert!(findings.iter().all(|finding| finding.level == Level::Ok), "{findings:?}");
    let mut topics: Vec<_> = findings.iter().map(|finding| finding.topic).collect();
    topics.dedup();
    assert_eq!(
        topics,
        [
            "roster", "names", "versions", "starts", "clocks", "loops", "vehicle", "latches", "faults",
            "fixes", "dispatch", "ledger", "traffic", "map"
        ]
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
    let hint = the_only(&facts).hint.unwrap();
    let written = hint.split('`').nth(1).unwrap();
    let config = crate::config::FleetConfig::parse(written).unwrap();
    assert_eq!(config.robots, [entry("xtb-1"), entry("xtb-2")], "{hint}");
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
        fixes: FixBook::default(),
        ..healthy()
    };
    let findings = all(&nobody);
    assert_eq!((findings.len(), findings[0].level), (1, Level::Problem));
    assert!(findings[0].text.contains("no robot of fleet lab at tcp/a:1"), "{findings:?}");
}

#[test]
fn two_agents_of_one_name_are_a_problem() {
    let mut facts = healthy();
    facts.epochs.insert(name("xtb-1"), BTreeSet::from([7, 8]));
    facts.rates.insert(name("xtb-1"), None);
    let found = the_only(&facts);
    assert_eq!((found.level, found.topic, found.robot), (Level::Problem, "names", Some(name("xtb-1"))));
}

fn parameter(name: &str, value: &str) -> ParameterInfo {
    ParameterInfo { name: name.into(), value: value.into(), unit: String::new(), origin: "ours".into() }
}

fn speaking(version: &str, wire: Option<&str>) -> Facts {
    let mut facts = healthy();
    let about = &mut facts.abouts.get_mut(&name("xtb-1")).unwrap()[0];
    about.version = version.into();
    about.vehicle.retain(|info| info.name != SPEAKS);
    about.vehicle.extend(wire.map(|wire| parameter(SPEAKS, wire)));
    facts
}

#[test]
fn each_robot_is_told_with_its_program_and_the_wire_that_it_speaks() {
    let ours = env!("CARGO_PKG_VERSION");
    for (version, wire, level, says) in [
        (ours, Some(WIRE), Level::Ok, format!("robot-agent {ours}, wire {WIRE}, as this fleet-cli")),
        (
            "0.0.1",
            Some(WIRE),
            Level::Warning,
            format!("robot-agent 0.0.1, wire {WIRE}; this fleet-cli is {ours}"),
        ),
        (ours, Some(WIRE - 1), Level::Warning, format!("wire {}; this fleet-cli", WIRE - 1)),
        (ours, Some(WIRE + 1), Level::Warning, format!("wire {}; this fleet-cli", WIRE + 1)),
    ] {
        let facts = speaking(version, wire.map(|wire| wire.to_string()).as_deref());
        let of_one = |finding: &Finding| finding.topic == "versions" && finding.robot == Some(name("xtb-1"));
        let found = all(&facts).into_iter().find(of_one).unwrap();
        assert_eq!(found.level, level, "{found:?}");
        assert!(found.text.contains(&says), "{found:?}");
        assert_eq!(found.text.contains("accepts it"), wire == Some(WIRE - 1), "{found:?}");
    }
    let mut facts = speaking(ours, Some(&WIRE.to_string()));
    let about = &mut facts.abouts.get_mut(&name("xtb-1")).unwrap()[0];
    about.vehicle.push(parameter(BOARD_FIRMWARE, "1.2"));
    let says = format!("robot-agent {ours} with board firmware 1.2, wire {WIRE}, as this");
    assert!(all(&facts).iter().any(|finding| finding.text.contains(&says)), "{:?}", all(&facts));
    let unsaid = the_only(&speaking(ours, None));
    assert!(unsaid.text.contains("wire 5;"), "agents of before do not say it: {unsaid:?}");
    assert_eq!(the_only(&speaking(ours, Some("new"))).level, Level::Problem);
}

#[test]
fn unreadable_messages_and_silence_are_told_apart() {
    let mut facts = healthy();
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
    assert!(the_only(&facts).text.contains("start pose (1.00, 0.00)"));
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
    assert!(all(&facts).iter().any(|finding| finding.text.contains("8.0 × this computer's: a simulator's")));
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
        let about =
            About { vehicle: vec![parameter(value), ParameterInfo::speaks()], ..fake::about(robot, hash) };
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
    assert_eq!((found.level, found.hint.as_deref()), (Level::Problem, Some(Fault::GyroSilent.remedy())));
    let state = facts.states.get_mut(&name("xtb-1")).unwrap();
    state.faults = vec![FaultState { fault: Fault::BatteryLow, age_ms: 3000, detail: None }];
    state.battery_level = BatteryLevel::Finish;
    assert_eq!(the_only(&facts).level, Level::Warning, "said once");
    let state = facts.states.get_mut(&name("xtb-1")).unwrap();
    state.faults.clear();
    (state.battery_level, state.battery_v) = (BatteryLevel::Unknown, None);
    assert!(the_only(&facts).text.contains("may be empty"));
}

/// The fleet in a simulator that runs at `factor` × real time.
fn simulated(factor: f64) -> Facts {
    let stats = SimStats { t_s: 60.0, speed: 1.0, real_time_factor: Some(factor), first: None };
    Facts { simulator: Some(stats), simulated: ["xtb-1", "xtb-2"].map(name).into(), ..healthy() }
}

#[test]
fn an_overloaded_simulator_is_named_and_its_robots_are_not_blamed() {
    // Silent, late, slow and gone, and one that is no robot of the simulator's.
    let with_faults = |factor| {
        let mut facts = simulated(factor);
        facts.simulated.extend([name("xtb-3"), name("xtb-4")]);
        facts.alive.insert(name("xtb-3"));
        facts.roster = Some(["xtb-1", "xtb-2", "xtb-3", "xtb-4"].map(entry).to_vec());
        facts.states.get_mut(&name("xtb-1")).unwrap().turn_late_us = 90_000;
        facts.rates.insert(name("xtb-1"), Some(0.19));
        facts.rates.insert(name("xtb-2"), None);
        facts
    };
    let found = wrong(&with_faults(0.19));
    assert_eq!((found[0].topic, found[0].level), ("simulator", Level::Warning));
    assert!(found[0].text.starts_with("simulator runs at 0.19 × real time"), "{found:?}");
    let topics: Vec<_> = found[1..].iter().map(|finding| (finding.topic, finding.level)).collect();
    let warned = ["versions", "clocks", "loops"].map(|topic| (topic, Level::Warning));
    assert_eq!(topics[0], ("roster", Level::Problem), "who is missing is missing");
    assert_eq!(topics[1..], warned);
    for finding in &found[1..] {
        assert!(finding.hint.as_ref().unwrap().contains("not the robot's fault"), "{finding:?}");
    }
    // In time, the same robots have to answer for themselves.
    let blamed = wrong(&with_faults(0.99));
    assert!(
        blamed.iter().all(|finding| !finding.hint.as_ref().unwrap().contains("simulator is")),
        "{blamed:?}"
    );
    assert!(blamed.iter().any(|finding| (finding.topic, finding.level) == ("clocks", Level::Problem)));
}

#[test]
fn a_real_robot_beside_an_overloaded_simulator_answers_for_itself() {
    let mut facts = Facts { simulated: BTreeSet::from([name("xtb-1")]), ..simulated(0.19) };
    facts.rates.insert(name("xtb-2"), Some(0.5));
    let found = wrong(&facts);
    let slow = found.iter().find(|finding| finding.robot == Some(name("xtb-2"))).unwrap();
    assert_eq!((slow.level, slow.text.as_str()), (Level::Problem, "clock runs at 0.50 × this computer's"));
}

fn tasks(ledger: u64) -> TaskList {
    let tasks = [TaskState::Running, TaskState::Queued, TaskState::Done].map(|state| fake::task(1, state));
    TaskList {
        ledger,
        at_ms: 1,
        ledger_failed: None,
        tasks: tasks.to_vec(),
        left_out: 0,
        suspended: Vec::new(),
    }
}

fn floor(bits: u64) -> FleetMap {
    FleetMap {
        name: "hall".into(),
        hash: MapHash::new(bits),
        resolution_m: 0.1,
        origin_m: [0.0, 0.0],
        width: 1,
        height: 1,
        cells: Vec::new(),
        zones: Vec::new(),
    }
}

/// The fleet with everything that serves it: dispatcher, traffic control and one map that all are on.
fn served() -> Facts {
    let mut facts = healthy();
    let state = TrafficState {
        epoch: 7,
        seq: 1,
        map_hash: MapHash::new(5).to_string(),
        led: vec![name("xtb-1")],
        obstacles: Vec::new(),
        plans: 0,
    };
    facts.services = Services {
        dispatcher: true,
        tasks: vec![Ok(tasks(1))],
        status: None,
        traffic: true,
        traffic_states: BTreeMap::from([(7, state)]),
        traffic_unreadable: None,
        maps: vec![Ok(floor(5))],
    };
    for state in facts.states.values_mut() {
        let hash = MapHash::new(5).to_string();
        state.nav.map = Some(MapState { name: "hall".into(), hash, fleet_hash: None });
    }
    facts
}

/// What is wrong: topic, level, and that the text says it.
#[track_caller]
fn is_wrong(facts: &Facts, topic: &str, level: Level, said: &str) {
    let found = the_only(facts);
    assert_eq!((found.topic, found.level), (topic, level), "{found:?}");
    assert!(found.text.contains(said), "{found:?}");
}

#[test]
fn what_serves_the_fleet_is_ok_while_it_answers() {
    let findings = all(&served());
    assert!(findings.iter().all(|finding| finding.level == Level::Ok), "{findings:?}");
    let said: Vec<_> = findings.iter().map(|finding| finding.text.as_str()).collect();
    for part in ["2 of 3 tasks are open", "ledger 1 writable", "coordinates 1 robot,", "used by 2 robots"] {
        assert!(said.iter().any(|text| text.contains(part)), "{part}: {said:?}");
    }
}

#[test]
fn tasks_of_further_pages_are_counted_or_said_to_be_left_out() {
    let mut facts = served();
    facts.services.tasks = vec![Ok(TaskList { left_out: 997, ..tasks(1) })];
    let says = |facts: &Facts, part: &str| all(facts).iter().any(|finding| finding.text.contains(part));
    assert!(says(&facts, "2 of 3 tasks are open, 997 more were not counted"));
    let status = DispatchStatus {
        ledger: 1,
        ledger_failed: None,
        map: None,
        tasks: 1000,
        open: 640,
        assigned: 2,
        robots: 2,
    };
    facts.services.status = Some(status);
    assert!(says(&facts, "answers: 640 of 1000 tasks are open"));
}

#[test]
fn a_dispatcher_that_is_silent_twice_there_or_of_another_release_is_a_problem() {
    let mut facts = served();
    facts.services.tasks.clear();
    is_wrong(&facts, "dispatch", Level::Problem, "does not answer");
    facts.services.tasks = vec![Ok(tasks(1)), Ok(tasks(2))];
    is_wrong(&facts, "dispatch", Level::Problem, "2 dispatchers answer");
    facts.services.tasks = vec![Err("TaskList.v9".into())];
    is_wrong(&facts, "dispatch", Level::Problem, "message version: TaskList.v9");
}

#[test]
fn a_ledger_that_cannot_be_written_is_a_problem_with_its_reason() {
    let mut facts = served();
    facts.services.tasks = vec![Ok(TaskList { ledger_failed: Some("disk full".into()), ..tasks(1) })];
    is_wrong(&facts, "ledger", Level::Problem, "cannot be written: disk full");
}

#[test]
fn a_suspended_dispatcher_is_a_warning_that_says_what_ends_it() {
    let mut facts = served();
    let cause = xtb_protocol::messages::SuspensionCause::FleetStop { by: None };
    let suspended = vec![xtb_protocol::messages::Suspension { cause, since_ms: 0, tasks: 3 }];
    facts.services.tasks = vec![Ok(TaskList { suspended, ..tasks(1) })];
    is_wrong(&facts, "dispatch", Level::Warning, "emergency stop of all robots; 3 open tasks wait");
}

#[test]
fn traffic_control_that_is_silent_twice_there_on_another_map_or_sees_ghosts_is_named() {
    let mut facts = served();
    let state = facts.services.traffic_states[&7].clone();
    facts.services.traffic_states.insert(8, TrafficState { epoch: 8, ..state.clone() });
    is_wrong(&facts, "traffic", Level::Problem, "2 traffic controls");
    let around = TrafficState { obstacles: vec![name("xtb-5")], ..state.clone() };
    facts.services.traffic_states = BTreeMap::from([(7, around)]);
    is_wrong(&facts, "traffic", Level::Warning, "xtb-5 has left: the others drive around");
    let elsewhere = TrafficState { map_hash: MapHash::new(6).to_string(), ..state };
    facts.services.traffic_states = BTreeMap::from([(7, elsewhere)]);
    is_wrong(&facts, "traffic", Level::Problem, "uses map 0000000000000006");
    facts.services.traffic_states.clear();
    is_wrong(&facts, "traffic", Level::Problem, "sends nothing");
    facts.services.traffic_unreadable = Some("TrafficState.v9".into());
    is_wrong(&facts, "traffic", Level::Problem, "message version: TrafficState.v9");
}

#[test]
fn robots_that_are_not_on_the_map_that_is_served_are_named() {
    let mut facts = served();
    let first = facts.states.get_mut(&name("xtb-1")).unwrap();
    let own = first.nav.map.take().unwrap();
    is_wrong(&facts, "map", Level::Warning, "has no map");
    let other = MapState { hash: MapHash::new(6).to_string(), ..own };
    facts.states.get_mut(&name("xtb-1")).unwrap().nav.map = Some(other);
    is_wrong(&facts, "map", Level::Problem, "uses map hall (0000000000000006)");
    assert_eq!(the_only(&facts).robot, Some(name("xtb-1")));
    // Nobody serves one: the robots' own are compared.
    facts.services.maps.clear();
    is_wrong(&facts, "map", Level::Warning, "others use");
    let mut facts = served();
    facts.services.maps.push(Ok(floor(6)));
    is_wrong(&facts, "map", Level::Problem, "2 maps are served");
}
