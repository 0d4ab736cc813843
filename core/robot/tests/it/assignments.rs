//! Assignments of a dispatcher on a whole robot: their order, over leases and other people's goals.

use crate::bench::*;
use std::sync::Arc;
use xtb_nav::geometry::Grid;
use xtb_nav::map::Map;
use xtb_nav::navigator::PreparedMap;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{
    Assignment, Body, Done, GoalEnd, GoalStatus, LinkLoss, MAX_ASSIGN_SEQ, Outcome, RejectCode, Request,
    TaskAction, TaskId,
};

const LEDGER: u64 = 77;

fn assignment(assign_seq: u64, leg: u32) -> Assignment {
    Assignment { ledger: LEDGER, task: TaskId::new(1), assign_seq, leg }
}

fn assign(assign_seq: u64, leg: u32, y_m: f64) -> Body {
    Body::Assign {
        assignment: assignment(assign_seq, leg),
        errand: TaskAction::Goto { x_m: 0.0, y_m, yaw_rad: None, via: None },
        on_link_loss: LinkLoss::Finish,
        finish_s: 60.0,
    }
}

fn withdraw(bench: &mut Bench, assign_seq: u64) {
    let body = Body::Withdraw { ledger: LEDGER, assign_seq };
    bench.asked += 1;
    let id = Uuid::from_u128(7000 + bench.asked);
    let reply = bench.ask_with(Request { id, lease: None, body });
    assert_eq!(reply.result, Outcome::Ok(Done::default()));
}

#[test]
fn its_goal_says_which_assignment_runs_and_asking_again_begins_nothing() {
    let mut bench = Bench::new();
    let goal = goal_of(&bench.ask(assign(5, 0, 5.0)));
    assert_eq!(Assignment::of_goal(LEDGER, goal), Some((5, 0)));
    bench.run_ms(300);
    let before = bench.state().goal.unwrap();
    assert_eq!((before.id, before.status), (goal, GoalStatus::Running));
    assert_eq!(goal_of(&bench.ask(assign(5, 0, 5.0))), goal);
    bench.run_ms(100);
    let after = bench.state();
    assert_eq!(after.goal.unwrap().status, GoalStatus::Running);
    assert_eq!(after.ended_goals, [], "nothing was replaced");
}

#[test]
fn lower_is_refused_and_higher_replaces() {
    let mut bench = Bench::new();
    bench.ask(assign(5, 1, 5.0));
    bench.run_ms(100);
    for (seq, leg) in [(4, 7), (5, 0)] {
        assert_eq!(code_of(&bench.ask(assign(seq, leg, 1.0))), RejectCode::UnknownGoal, "{seq} {leg}");
    }
    bench.run_ms(100);
    assert_eq!(bench.state().goal.unwrap().id, assignment(5, 1).goal_id());
    for (seq, leg) in [(5, 2), (6, 0)] {
        assert_eq!(goal_of(&bench.ask(assign(seq, leg, 4.0))), assignment(seq, leg).goal_id());
        bench.run_ms(100);
    }
    let ended: Vec<GoalStatus> = bench.state().ended_goals.iter().map(|end| end.status).collect();
    assert_eq!(ended, [GoalStatus::Replaced, GoalStatus::Replaced]);
}

/// A robot with an empty room of 20 × 20 m on its map, on its way to the first leg and told of the second one.
fn between_two_legs() -> Bench {
    let mut bench = Bench::new();
    let room = Grid::free(0.1, [-10.0, -10.0], 200, 200).unwrap();
    let map = Map::new("room", room, Vec::new()).unwrap();
    bench.robot.agent_mut().set_floor(Arc::new(PreparedMap::of(map)));
    bench.ask(assign(5, 0, 5.0));
    bench.run_ms(100);
    assert_eq!(goal_of(&bench.ask(assign(5, 1, 4.0))), assignment(5, 1).goal_id());
    bench.run_ms(100);
    let goal = bench.state().goal.unwrap();
    assert_eq!((goal.id, goal.status), (assignment(5, 0).goal_id(), GoalStatus::Running), "it waits");
    bench
}

#[test]
fn the_next_leg_waits_for_the_one_under_way_and_anything_later_replaces_both() {
    let mut bench = between_two_legs();
    assert_eq!(goal_of(&bench.ask(assign(5, 1, 4.0))), assignment(5, 1).goal_id(), "acknowledged again");
    assert_eq!(code_of(&bench.ask(assign(5, 0, 5.0))), RejectCode::UnknownGoal);
    assert_eq!(goal_of(&bench.ask(assign(6, 0, 3.0))), assignment(6, 0).goal_id());
    bench.run_ms(100);
    let state = bench.state();
    assert_eq!(state.goal.unwrap().id, assignment(6, 0).goal_id());
    let replaced = GoalEnd { id: assignment(5, 0).goal_id(), status: GoalStatus::Replaced };
    assert_eq!(state.ended_goals, [replaced], "the second leg has never begun");
}

#[test]
fn what_ends_the_leg_under_way_ends_the_next_one_before_it_has_begun() {
    let stop: fn(&mut Bench) = |bench| drop(bench.ask(Body::Stop {}));
    let withdraw: fn(&mut Bench) = |bench| withdraw(bench, 5);
    for end in [stop, withdraw] {
        let mut bench = between_two_legs();
        end(&mut bench);
        bench.run_ms(500);
        let state = bench.state();
        let goal = state.goal.unwrap();
        assert_eq!((goal.id, goal.status), (assignment(5, 0).goal_id(), GoalStatus::Cancelled));
        assert_eq!(state.ended_goals, []);
        assert_eq!(code_of(&bench.ask(assign(5, 1, 4.0))), RejectCode::UnknownGoal, "its number is used up");
    }
}

#[test]
fn a_leg_whose_request_was_held_up_until_the_one_before_had_failed_does_not_begin() {
    let mut bench = Bench::new();
    bench.ask(assign(5, 0, 5.0));
    bench.run_ms(100);
    bench.ask(Body::Stop {});
    bench.run_ms(100);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Cancelled);
    assert_eq!(code_of(&bench.ask(assign(5, 1, 4.0))), RejectCode::UnknownGoal);
    assert_eq!(goal_of(&bench.ask(assign(6, 1, 4.0))), assignment(6, 1).goal_id());
}

#[test]
fn the_order_outlives_the_lease_and_other_goals() {
    let mut bench = Bench::new();
    bench.ask(assign(5, 0, 5.0));
    bench.run_ms(100);
    bench.ask(Body::Release {});
    bench.lease = None;
    bench.ask(ahead(2.0));
    bench.run_ms(100);
    assert_eq!(code_of(&bench.ask(assign(4, 0, 1.0))), RejectCode::UnknownGoal);
    assert_eq!(goal_of(&bench.ask(assign(5, 0, 1.0))), assignment(5, 0).goal_id(), "acknowledged, not begun");
    assert_ne!(bench.state().goal.unwrap().id, assignment(5, 0).goal_id());
    assert_eq!(goal_of(&bench.ask(assign(6, 0, 1.0))), assignment(6, 0).goal_id());
}

#[test]
fn a_withdrawal_stops_the_truck_without_the_lease_and_holds() {
    let mut bench = Bench::new();
    bench.ask(assign(5, 0, 5.0));
    bench.run_ms(300);
    withdraw(&mut bench, 4);
    bench.run_ms(50);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Running, "an earlier one was withdrawn");
    withdraw(&mut bench, 5);
    bench.run_ms(50);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Cancelled);
    assert_eq!(code_of(&bench.ask(assign(5, 1, 5.0))), RejectCode::UnknownGoal);
    goal_of(&bench.ask(assign(6, 0, 5.0)));
}

#[test]
fn a_withdrawal_without_the_lease_bars_no_later_assignment() {
    let mut bench = Bench::new();
    withdraw(&mut bench, MAX_ASSIGN_SEQ);
    goal_of(&bench.ask(assign(5, 0, 5.0)));
    bench.run_ms(300);
    withdraw(&mut bench, MAX_ASSIGN_SEQ - 1);
    bench.run_ms(50);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Cancelled);
    assert_eq!(code_of(&bench.ask(assign(5, 1, 5.0))), RejectCode::UnknownGoal);
    goal_of(&bench.ask(assign(6, 0, 5.0)));
}

#[test]
fn an_assignment_that_is_withdrawn_before_it_comes_does_not_begin() {
    let mut bench = Bench::new();
    withdraw(&mut bench, 1_000_000);
    assert_eq!(code_of(&bench.ask(assign(1_000_000, 0, 5.0))), RejectCode::UnknownGoal);
    goal_of(&bench.ask(assign(1_000_001, 0, 5.0)));
}

#[test]
fn a_withdrawal_with_the_lease_fences_all_before_it() {
    let mut bench = Bench::new();
    let reply = bench.ask(Body::Withdraw { ledger: LEDGER, assign_seq: 9 });
    assert_eq!(reply.result, Outcome::Ok(Done::default()));
    assert_eq!(code_of(&bench.ask(assign(8, 0, 5.0))), RejectCode::UnknownGoal);
    goal_of(&bench.ask(assign(10, 0, 5.0)));
}

#[test]
fn nobody_else_withdraws_it() {
    let mut bench = Bench::new();
    bench.ask(assign(5, 0, 5.0));
    bench.run_ms(300);
    let body = Body::Withdraw { ledger: LEDGER, assign_seq: 9 };
    bench.ask_as("cli-2", &Request { id: Uuid::from_u128(1), lease: None, body });
    bench.run_ms(50);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Running);
    goal_of(&bench.ask(assign(5, 1, 5.0)));
}

#[test]
fn an_assignment_needs_the_lease() {
    let mut bench = Bench::new();
    let request = Request { id: Uuid::from_u128(1), lease: None, body: assign(1, 0, 1.0) };
    assert_eq!(code_of(&bench.ask_with(request)), RejectCode::LeaseRequired);
}
