//! The brain and its controller in one turn: what a robot does about requests, setpoints and silence.

use crate::bench::*;
use std::sync::Arc;
use xtb_control::controller::Mode;
use xtb_control::{Command, PwmCount, Sample, Stamp};
use xtb_nav::geometry::Grid;
use xtb_nav::map::Map;
use xtb_nav::navigator::PreparedMap;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{
    Body, GoalStatus, Lease, LinkLoss, Outcome, RejectCode, Request, Route, Setpoint, StopReason,
};

#[test]
fn a_robot_that_has_booted_stands_and_says_why() {
    let mut bench = Bench::new();
    bench.run_ms(2000);
    let state = bench.state();
    assert_eq!((bench.motor, state.mode), (PwmCount::NEUTRAL, Mode::Idle));
    assert_eq!(state.stopped_because, vec![StopReason::NoCommand]);
}

#[test]
fn a_goal_runs_is_reached_and_is_reported_once_each() {
    let mut bench = Bench::new();
    let goal = goal_of(&bench.ask(ahead(0.5)));
    bench.run_ms(1000);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Running);
    bench.run_ms(10_000);
    let state = bench.state();
    assert_eq!(state.goal.unwrap().status, GoalStatus::Reached);
    assert_eq!(state.stopped_because, vec![StopReason::GoalReached]);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    let expected = [GoalStatus::Accepted, GoalStatus::Running, GoalStatus::Reached].map(|s| (goal, s));
    assert_eq!(bench.goal_events(), expected);
}

#[test]
fn a_new_goal_replaces_the_old_one_and_both_ends_are_reported() {
    let mut bench = Bench::new();
    let first = goal_of(&bench.ask(ahead(5.0)));
    bench.run_ms(500);
    let second = goal_of(&bench.ask(ahead(0.1)));
    bench.run_ms(500);
    let events = bench.goal_events();
    assert!(events.contains(&(first, GoalStatus::Replaced)), "{events:?}");
    assert!(events.contains(&(second, GoalStatus::Reached)), "{events:?}");
}

#[test]
fn the_same_request_id_gets_the_same_reply_and_does_nothing_twice() {
    let mut bench = Bench::new();
    let id = Uuid::from_u128(9);
    let first = bench.ask_with_id(id, ahead(5.0));
    bench.run_ms(500);
    bench.ask(Body::Stop {});
    bench.run_ms(100);
    assert_eq!(bench.ask_with_id(id, ahead(5.0)), first);
    bench.run_ms(500);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Cancelled);
}

#[test]
fn a_setpoint_lives_200_ms_and_then_the_motor_is_neutral() {
    let mut bench = Bench::new();
    bench.setpoint(20.0);
    bench.run_ms(195);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    bench.run_ms(5);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(bench.state().stopped_because, vec![StopReason::SetpointExpired]);
}

#[test]
fn a_lost_session_ends_teleoperation_at_once() {
    let mut bench = Bench::new();
    bench.setpoint(20.0);
    bench.run_ms(100);
    bench.robot.agent_mut().set_link(false);
    bench.run_ms(5);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(bench.state().stopped_because, vec![StopReason::LinkLost]);
}

#[test]
fn a_setpoint_takes_over_from_a_goal() {
    let mut bench = Bench::new();
    let goal = goal_of(&bench.ask(ahead(5.0)));
    bench.run_ms(300);
    bench.setpoint(0.0);
    bench.run_ms(50);
    assert_eq!((bench.motor, bench.state().mode), (PwmCount::NEUTRAL, Mode::Teleop));
    assert!(bench.goal_events().contains(&(goal, GoalStatus::Cancelled)));
}

#[test]
fn an_obstacle_blocks_a_goal_and_its_going_lets_it_run_again() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    bench.front = 300;
    bench.run_ms(100);
    let state = bench.state();
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(state.goal.unwrap().status, GoalStatus::Blocked);
    assert_eq!(state.stopped_because, vec![StopReason::ObstacleFront]);
    bench.front = 60;
    bench.run_ms(1000);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Running);
}

#[test]
fn a_silent_gyro_or_board_stops_the_truck_and_it_does_not_start_again_by_itself() {
    for silence in
        [|bench: &mut Bench, on| bench.gyro_silent = on, |bench: &mut Bench, on| bench.board_silent = on]
    {
        let mut bench = Bench::new();
        bench.ask(ahead(5.0));
        bench.run_ms(500);
        silence(&mut bench, true);
        bench.run_ms(270);
        assert_eq!(bench.motor, PwmCount::NEUTRAL);
        assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Failed);
        assert_eq!(code_of(&bench.ask(ahead(5.0))), RejectCode::Latched);
        silence(&mut bench, false);
        bench.run_ms(2000);
        assert_eq!(bench.motor, PwmCount::NEUTRAL);
    }
}

#[test]
fn a_silent_range_finder_is_unknown_not_clear() {
    let mut bench = Bench::new();
    assert_eq!(bench.state().obstacle.front, Some(false));
    bench.board_silent = true;
    bench.run_ms(300);
    let state = bench.state();
    assert_eq!((state.obstacle.front, state.speed_mps, state.battery_v), (None, None, None));
}

#[test]
fn a_pose_is_set_while_standing_only() {
    let mut bench = Bench::new();
    let set = Body::SetPose { x_m: 3.0, y_m: 4.0, yaw_rad: 0.0 };
    bench.ask(ahead(5.0));
    assert_eq!(code_of(&bench.ask(set.clone())), RejectCode::Busy);
    bench.run_ms(5);
    bench.ask(Body::Stop {});
    bench.run_ms(5);
    bench.ask(set);
    let pose = bench.state().pose;
    assert!((pose.x_m - 3.0).abs() < 1e-9 && (pose.y_m - 4.0).abs() < 1e-9 && pose.yaw_rad.abs() < 1e-9);
}

#[test]
fn a_finish_goal_ends_when_its_time_is_up() {
    let mut bench = Bench::new();
    bench.ask(Body::Goto {
        x_m: 0.0,
        y_m: 9.0,
        yaw_rad: None,
        via: None,
        on_link_loss: LinkLoss::Finish,
        finish_s: 1.0,
    });
    bench.run_ms(990);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    bench.run_ms(20);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Failed);
}

#[test]
fn a_lease_is_granted_shown_and_free_again_900_ms_after_the_last_word() {
    let mut bench = Bench::new();
    bench.lease_of(CLIENT);
    bench.retains = false;
    assert_eq!(bench.state().lease.unwrap().holder, client());
    bench.run_ms(895);
    assert!(bench.state().lease.is_some());
    bench.run_ms(5);
    assert_eq!(bench.state().lease, None);
}

#[test]
fn a_frame_goes_out_every_20_ms_and_neutral_at_once() {
    let mut bench = Bench::new();
    let frames = bench.frames.counters().frames;
    bench.run_ms(1000);
    assert_eq!(bench.frames.counters().frames - frames, 50);
    bench.setpoint(20.0);
    bench.run_ms(60);
    bench.setpoint(0.0);
    bench.run_ms(5);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
}

/// Frames that leave in the turn after a fresh setpoint.
fn frames_after_steering(bench: &mut Bench, rpm: f64, steering: f64) -> u64 {
    bench.lease_of(CLIENT);
    let setpoint = Setpoint { steering, ..bench.fresh_setpoint(rpm) };
    bench.put(&setpoint);
    let frames = bench.frames.counters().frames;
    bench.run_ms(5);
    bench.frames.counters().frames - frames
}

#[test]
fn a_new_setpoint_turns_the_wheels_in_the_same_turn_in_any_phase_of_the_frame() {
    let mut bench = Bench::new();
    for counts in 1..=20_u16 {
        let left = f64::from(counts) / 975.0;
        assert_eq!(frames_after_steering(&mut bench, 0.0, -left), 1, "{counts}");
        assert_eq!(bench.steer_front.get(), 3710 + counts);
        bench.run_ms(50);
    }
}

#[test]
fn setpoints_that_change_nothing_send_no_frame_before_its_time() {
    let mut bench = Bench::new();
    frames_after_steering(&mut bench, 0.0, 0.5);
    bench.run_ms(20);
    let frames = bench.frames.counters().frames;
    for _ in 0..100 {
        frames_after_steering(&mut bench, 0.0, 0.5);
        bench.run_ms(5);
    }
    assert_eq!(bench.frames.counters().frames - frames, 50);
}

#[test]
fn setpoints_at_each_turn_send_25_early_frames_a_second_at_most_and_neutral_is_none_of_them() {
    let mut bench = Bench::new();
    let mut frames = 0;
    for turn in 0..200 {
        frames += frames_after_steering(&mut bench, 20.0, f64::from(turn % 7) / 10.0);
    }
    assert!((51..=75).contains(&frames), "{frames}");
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    frames_after_steering(&mut bench, 0.0, 0.9);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
}

#[test]
fn an_early_frame_makes_no_step_of_its_own() {
    let mut bench = Bench::new();
    bench.run_ms(10);
    bench.robot.record_steps();
    // A turn without a sample, in which no frame is due.
    assert_eq!(frames_after_steering(&mut bench, 0.0, 0.5), 1);
    let samples: Vec<Sample> =
        std::iter::from_fn(|| bench.robot.take_step()).map(|step| step.sample).collect();
    assert!(matches!(samples[..], [Sample::Command(Command::Teleop { .. })]), "{samples:?}");
}

#[test]
fn a_command_with_a_lease_of_another_boot_moves_nothing() {
    let mut bench = Bench::new();
    let lease = Some(Lease { epoch: 41, root: 1 });
    let reply = bench.ask_with(Request { id: Uuid::from_u128(1), lease, body: ahead(5.0) });
    assert_eq!(code_of(&reply), RejectCode::LeaseLost);
    let setpoint = Setpoint { lease, seq: 0, echo_tick_ms: None, rpm: 20.0, steering: 0.0 };
    let now = bench.now;
    bench.robot.agent_mut().setpoint(now, now, 99, &client(), &setpoint);
    bench.run_ms(500);
    assert_eq!((bench.motor, bench.state().rejected.fenced), (PwmCount::NEUTRAL, 1));
    let stop = bench.ask_with(Request { id: Uuid::from_u128(2), lease, body: Body::Stop {} });
    assert!(matches!(stop.result, Outcome::Ok(_)), "a stop needs no lease, so a wrong one is no matter");
}

#[test]
fn what_came_before_a_stop_does_not_move_the_robot_after_it() {
    let mut bench = Bench::new();
    let now = bench.now;
    let lease = Some(bench.lease_of(CLIENT));
    bench.robot.agent_mut().stop(now, 10);
    let goto = Request { id: Uuid::from_u128(1), lease, body: ahead(5.0) };
    let reply = bench.robot.request(now, 9, &client(), &goto);
    assert_eq!(code_of(&reply), RejectCode::Overtaken);
    let setpoint = bench.fresh_setpoint(20.0);
    bench.robot.agent_mut().setpoint(now, now, 8, &client(), &setpoint);
    bench.run_ms(500);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    let now = bench.now;
    let goto = Request { id: Uuid::from_u128(2), lease, body: ahead(5.0) };
    goal_of(&bench.robot.request(now, 11, &client(), &goto));
    bench.run_ms(500);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
}

#[test]
fn a_setpoint_from_before_a_goal_does_not_end_it() {
    let mut bench = Bench::new();
    let now = bench.now;
    let lease = Some(bench.lease_of(CLIENT));
    let goto = Request { id: Uuid::from_u128(1), lease, body: ahead(5.0) };
    goal_of(&bench.robot.request(now, 10, &client(), &goto));
    let setpoint = bench.fresh_setpoint(0.0);
    bench.robot.agent_mut().setpoint(now, now, 9, &client(), &setpoint);
    bench.run_ms(500);
    assert_eq!(bench.state().mode, Mode::Goto);
}

#[test]
fn a_setpoint_that_is_dead_on_arrival_ends_no_goal() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    let setpoint = bench.fresh_setpoint(0.0);
    let now = bench.now;
    bench.robot.agent_mut().setpoint(now, Stamp::from_ns(now.ns() - 200_000_000), 99, &client(), &setpoint);
    bench.run_ms(100);
    assert_eq!(bench.state().mode, Mode::Goto);
}

#[test]
fn a_stop_is_done_each_time_also_with_an_id_that_was_used() {
    let mut bench = Bench::new();
    let id = Uuid::from_u128(5);
    bench.ask_with_id(id, Body::Stop {});
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    bench.ask_with_id(id, Body::Stop {});
    bench.run_ms(5);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
}

/// A sign of life of traffic control.
fn hear_traffic(bench: &mut Bench, seq: u64) {
    let route = Route {
        epoch: 7,
        seq,
        goal: None,
        track: None,
        plan: 0,
        release_m: 0.0,
        cruise_mps: 0.0,
        waits_for: None,
        reason: None,
        others: Vec::new(),
    };
    let now = bench.now;
    bench.robot.agent_mut().route(now, &route);
}

#[test]
fn a_goal_too_near_to_a_wall_for_traffic_control_is_refused_at_once_while_it_leads() {
    let mut bench = Bench::new();
    let room = Grid::free(0.05, [-5.0, -5.0], 200, 200).unwrap();
    let map = Map::new("room", room, Vec::new()).unwrap();
    bench.robot.agent_mut().set_floor(Arc::new(PreparedMap::of(map)));
    let goal = |x_m: f64| Body::Goto {
        x_m,
        y_m: 0.0,
        yaw_rad: None,
        via: None,
        on_link_loss: LinkLoss::Finish,
        finish_s: 60.0,
    };
    // The wall is at 5 m, and half a truck is 0.2 m wide.
    let near = 5.0 - 0.22;
    goal_of(&bench.ask(goal(near)));
    hear_traffic(&mut bench, 1);
    let Outcome::Error(refused) = bench.ask(goal(near)).result else { panic!("it is not refused") };
    assert_eq!(refused.code, RejectCode::GoalBlocked);
    assert!(refused.message.contains("traffic control, which keeps 5 cm"), "{refused:?}");
    hear_traffic(&mut bench, 2);
    goal_of(&bench.ask(goal(4.7)));
}

#[test]
fn one_route_with_the_largest_number_does_not_mute_traffic_control() {
    let mut bench = Bench::new();
    hear_traffic(&mut bench, 1);
    hear_traffic(&mut bench, u64::MAX);
    assert_eq!(bench.state().rejected.out_of_range, 1);
    // Longer than traffic control can be silent.
    for seq in 2..52 {
        bench.run_ms(100);
        hear_traffic(&mut bench, seq);
    }
    assert!(bench.state().nav.traffic);
    // Not even after a silence, when any number is taken: those that follow are taken a second later.
    bench.run_ms(1500);
    hear_traffic(&mut bench, u64::MAX);
    for seq in 52..102 {
        bench.run_ms(100);
        hear_traffic(&mut bench, seq);
    }
    assert!(bench.state().nav.traffic);
    assert_eq!(bench.state().rejected.out_of_range, 1);
}

#[test]
fn a_late_route_is_no_sign_of_life() {
    let mut bench = Bench::new();
    hear_traffic(&mut bench, 5);
    bench.run_ms(500);
    hear_traffic(&mut bench, 4);
    bench.run_ms(1500);
    hear_traffic(&mut bench, 5);
    bench.run_ms(1100);
    assert!(!bench.state().nav.traffic);
}
