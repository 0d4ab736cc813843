//! Chains of reasons from states.

use super::*;
use xtb_client::fake;
use xtb_protocol::Uuid;
use xtb_protocol::messages::Latch;
use xtb_protocol::messages::{FaultState, InputAges, LeaseState, LinkLoss};

fn view(state: RobotState) -> RobotView {
    let name = state.robot.clone();
    RobotView {
        name,
        alias: None,
        alive: true,
        state: Some(state),
        age_ms: Some(30),
        tags: Vec::new(),
        start_pose: None,
    }
}

fn kinds(why: &Why) -> Vec<Kind> {
    why.reasons.iter().map(|reason| reason.kind).collect()
}

#[test]
fn a_standstill_is_explained_from_latch_to_battery_each_with_what_to_do() {
    let mut goal = fake::goal(Uuid::from_u128(1), GoalStatus::Failed);
    (goal.age_ms, goal.reason) = (3000, Some("gyro_lost".into()));
    let fault = Fault::GyroSilent;
    let state = RobotState {
        latches: vec![fake::latch(Latch::GyroLost, "gyro_silent", true)],
        faults: vec![FaultState { fault, age_ms: 3100, detail: None }],
        stopped_because: vec![StopReason::GyroLost, StopReason::ObstacleFront],
        stopped_age_ms: Some(3000),
        goal: Some(goal),
        lease: Some(LeaseState { holder: fake::name("cli-2"), age_ms: 40 }),
        input_age_ms: InputAges { gyro: Some(3200), ..fake::state("xtb-1").input_age_ms },
        battery_level: BatteryLevel::Finish,
        ..fake::state("xtb-1")
    };
    let why = explain(&view(state));
    assert_eq!(why.verdict, Verdict::Stands);
    let order = [
        Kind::Latch,
        Kind::Fault,
        Kind::Stop,
        Kind::Goal,
        Kind::Lease,
        Kind::Inputs,
        Kind::Inputs,
        Kind::Battery,
    ];
    assert_eq!(kinds(&why), order);
    let hint = |i: usize| why.reasons[i].hint.as_deref().unwrap();
    assert!(hint(0).starts_with(&format!("first {}; then `fleet-cli reset", fault.remedy())), "{}", hint(0));
    assert_eq!(hint(1), fault.remedy());
    assert_eq!(why.reasons[2].name.as_deref(), Some("obstacle_front"), "a latch is not said twice");
    assert!(hint(2).contains("clear the path"), "{}", hint(2));
    assert!(why.reasons[3].text.contains("failed (1.00, 2.00) 3.0 s ago, sent by me: gyro_lost"));
    assert!(hint(3).contains("fleet-cli goto xtb-1 1 2"), "{}", hint(3));
    assert!(why.reasons[4].text.contains("cli-2 has control, heard 40 ms ago"));
    assert_eq!((why.reasons[5].age_ms, why.reasons[5].hinders), (Some(3200), true));
    assert!(hint(7).contains("charge"), "{}", hint(7));
}

#[test]
fn a_driving_robot_says_what_allows_it() {
    let mut goal = fake::goal(Uuid::from_u128(1), GoalStatus::Running);
    goal.on_link_loss = LinkLoss::Finish;
    let state = RobotState { mode: Mode::Goto, goal: Some(goal), ..fake::state("xtb-1") };
    let why = explain(&view(state.clone()));
    assert_eq!(why.verdict, Verdict::Drives);
    assert_eq!(kinds(&why), [Kind::May, Kind::Goal, Kind::Lease, Kind::Inputs, Kind::Battery]);
    assert!(why.reasons[0].text.starts_with("goal of me"), "{}", why.reasons[0].text);
    assert!(why.reasons[1].text.contains("continues without its client"), "{}", why.reasons[1].text);
    let coasting = RobotState { stopped_because: vec![StopReason::Coasting], ..state };
    let why = explain(&view(coasting));
    assert_eq!((why.verdict, why.reasons[1].hinders), (Verdict::Drives, false));
    let lease = Some(LeaseState { holder: fake::name("cli-2"), age_ms: 40 });
    let input_age_ms = InputAges { setpoint: Some(20), ..fake::state("xtb-1").input_age_ms };
    let state = RobotState { mode: Mode::Teleop, lease, input_age_ms, ..fake::state("xtb-1") };
    let may = &explain(&view(state)).reasons[0];
    assert_eq!(may.text, "driven by hand by cli-2, last setpoint 20 ms ago");
}

#[test]
fn what_is_not_known_is_called_unknown() {
    let robot = |alive, age_ms| RobotView { alive, state: None, age_ms, ..view(fake::state("xtb-1")) };
    for (alive, age_ms, said) in [
        (false, None, "missing"),
        (false, Some(30), "missing"),
        (true, Some(9000), "STALE"),
        (true, None, "unknown"),
    ] {
        let why = explain(&robot(alive, age_ms));
        assert_eq!(why.verdict, Verdict::Unknown);
        assert!(why.headline.contains(said) && why.headline.contains("unknown"), "{}", why.headline);
        assert!(why.mode.is_none() && why.reasons.len() == 1 && why.reasons[0].hint.is_some());
    }
    // A robot that has left, its last words still fresh.
    let left = RobotView { alive: false, ..view(fake::state("xtb-1")) };
    assert_eq!(explain(&left).verdict, Verdict::Unknown);
}

#[test]
fn every_reason_to_stand_has_words_and_only_passing_ones_have_nothing_to_do() {
    for latch in Latch::ALL {
        let state = RobotState { latches: vec![fake::latch(latch, "x", true)], ..fake::state("xtb-1") };
        let why = explain(&view(state));
        assert_eq!(why.verdict, Verdict::Stands);
        assert!(why.reasons[0].hint.as_ref().unwrap().contains(&format!("--latch {latch}")));
        // The state names a latch by the reason of the same name.
        assert_eq!(reasons::name(&latch.reason()), latch.to_string());
    }
}

#[test]
fn a_latch_that_was_reset_is_only_why_it_stopped() {
    let state = RobotState { stopped_because: vec![StopReason::Estop], ..fake::state("xtb-1") };
    let why = explain(&view(state));
    assert_eq!(why.verdict, Verdict::Stands);
    assert_eq!(why.reasons[0].text, "emergency stop, since reset");
    assert!(why.reasons[0].hint.as_ref().unwrap().contains("give a new command"));
}

#[test]
fn a_line_that_is_heard_again_is_only_why_it_stopped() {
    let mut state = RobotState { stopped_because: vec![StopReason::BoardLost], ..fake::state("xtb-1") };
    state.input_age_ms.encoder = Some(20);
    let why = explain(&view(state.clone()));
    assert_eq!(why.reasons[0].text, "I/O board was lost, now responding again");
    assert!(why.reasons[0].hint.as_ref().unwrap().contains("give a new command"));
    state.input_age_ms.encoder = Some(3000);
    assert_eq!(explain(&view(state)).reasons[0].text, "I/O board not responding, last message 3.0 s ago");
}

#[test]
fn a_robot_that_stands_beside_a_suspended_dispatcher_has_that_for_a_reason() {
    let cause = xtb_protocol::messages::SuspensionCause::FleetStop { by: None };
    let suspended = [Suspension { cause, since_ms: 0, tasks: 2 }];
    let state = RobotState { stopped_because: vec![StopReason::NoCommand], ..fake::state("xtb-1") };
    let why = explain(&view(state)).beside(&suspended);
    let reason = why.reasons.iter().find(|reason| reason.kind == Kind::Tasks).unwrap();
    assert!(reason.text.contains("emergency stop of all robots; 2 open tasks wait"), "{}", reason.text);
    assert!(reason.hint.as_ref().unwrap().contains("dispatch activate"));
}
