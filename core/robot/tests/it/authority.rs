//! Who may drive: lease, freshness, latched stops, link loss, and a loop that was held up.

use crate::bench::*;
use xtb_control::PwmCount;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{
    Body, Done, Fault, GoalStatus, Latch, Lease, LinkLoss, Outcome, RejectCode, Reply, Request, Setpoint,
    StopReason,
};

const OTHER: &str = "cli-2";

fn acquire_as(bench: &mut Bench, client: &str, take: bool) -> Reply {
    bench.asked += 1;
    let id = Uuid::from_u128(9000 + bench.asked);
    bench.ask_as(client, &Request { id, lease: None, body: Body::Acquire { take } })
}

fn lease_in(reply: &Reply) -> Lease {
    match reply.result {
        Outcome::Ok(Done { lease: Some(lease), .. }) => lease,
        _ => panic!("{reply:?}"),
    }
}

fn moves(bench: &Bench) -> bool {
    bench.motor != PwmCount::NEUTRAL
}

fn finish(y_m: f64) -> Body {
    Body::Goto { x_m: 0.0, y_m, yaw_rad: None, via: None, on_link_loss: LinkLoss::Finish, finish_s: 60.0 }
}

#[test]
fn every_command_but_stop_needs_the_lease() {
    let mut bench = Bench::new();
    let none = |id, body| Request { id: Uuid::from_u128(id), lease: None, body };
    for (id, body) in [
        (1, ahead(1.0)),
        (2, Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 60.0 }),
        (3, Body::Cancel { goal: Uuid::nil() }),
        (4, Body::SetPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 }),
        (5, Body::Reset { latch: None }),
        (6, Body::Retain {}),
        (7, Body::Release {}),
    ] {
        assert_eq!(code_of(&bench.ask_with(none(id, body))), RejectCode::LeaseRequired, "{id}");
    }
    assert!(matches!(bench.ask_with(none(8, Body::Stop {})).result, Outcome::Ok(_)));
}

#[test]
fn a_second_operator_is_told_who_holds_the_lease_until_he_takes_it() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    let refused = acquire_as(&mut bench, OTHER, false);
    assert_eq!(code_of(&refused), RejectCode::LeaseHeld);
    let Outcome::Error(error) = &refused.result else { panic!() };
    assert!(error.message.contains(CLIENT), "{error:?}");
    let first = bench.lease.unwrap();
    let second = lease_in(&acquire_as(&mut bench, OTHER, true));
    assert!(second.root > first.root);
    bench.run_ms(5);
    assert!(!moves(&bench), "a goal that halts on link loss was the other's");
    let state = bench.state();
    assert_eq!(state.goal.unwrap().status, GoalStatus::Cancelled);
    assert_eq!(state.stopped_because, [StopReason::LeaseTaken]);
    let late = bench.ask(ahead(5.0));
    assert_eq!(code_of(&late), RejectCode::LeaseLost);
    let Outcome::Error(error) = &late.result else { panic!() };
    assert!(error.message.contains(OTHER), "{error:?}");
}

#[test]
fn a_take_fences_the_setpoints_of_the_one_before_at_once() {
    let mut bench = Bench::new();
    bench.setpoint(13.0);
    bench.run_ms(100);
    assert!(moves(&bench));
    acquire_as(&mut bench, OTHER, true);
    bench.run_ms(5);
    assert!(!moves(&bench));
    for _ in 0..20 {
        bench.setpoint(13.0);
        bench.run_ms(50);
        assert!(!moves(&bench));
    }
    assert_eq!(bench.state().rejected.fenced, 20);
}

#[test]
fn a_halt_goal_ends_500_ms_after_the_last_word_of_its_client_and_a_finish_goal_does_not() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    bench.retains = false;
    bench.run_ms(495);
    assert!(moves(&bench));
    bench.run_ms(10);
    assert!(!moves(&bench));
    let state = bench.state();
    assert_eq!(state.stopped_because, [StopReason::LeaseExpired]);
    let goal = state.goal.unwrap();
    assert_eq!(goal.status, GoalStatus::Failed);
    assert!(goal.reason.unwrap().contains(CLIENT));

    let mut bench = Bench::new();
    bench.ask(finish(3.0));
    bench.retains = false;
    bench.run_ms(5000);
    assert!(moves(&bench));
    assert_eq!(bench.state().lease, None);
    bench.lease = None;
    acquire_as(&mut bench, OTHER, false);
    bench.run_ms(500);
    assert!(moves(&bench), "a new holder who asks for nothing changes nothing");
}

#[test]
fn a_release_ends_what_lived_by_the_lease() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    bench.ask(Body::Release {});
    bench.run_ms(5);
    assert!(!moves(&bench));
    assert_eq!(bench.state().stopped_because, [StopReason::LeaseReleased]);
}

#[test]
fn the_same_client_may_acquire_again_and_its_goal_goes_on_but_its_old_lease_does_not() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    let old = bench.lease.unwrap();
    bench.lease = Some(lease_in(&acquire_as(&mut bench, CLIENT, false)));
    bench.run_ms(1000);
    assert!(moves(&bench));
    let retain = Request { id: Uuid::from_u128(1), lease: Some(old), body: Body::Retain {} };
    assert_eq!(code_of(&bench.ask_with(retain)), RejectCode::LeaseLost);
}

#[test]
fn setpoints_that_are_repeated_reordered_or_answer_an_old_state_do_not_count() {
    let mut bench = Bench::new();
    bench.setpoint(0.0);
    bench.run_ms(50);
    let good = bench.fresh_setpoint(13.0);
    bench.put(&good);
    bench.run_ms(180);
    let stale = bench.state().rejected.stale;
    bench.put(&good);
    bench.put(&Setpoint { seq: good.seq - 1, ..good });
    let fresh = bench.fresh_setpoint(13.0);
    let now_ms = bench.now.ms();
    bench.put(&Setpoint { echo_tick_ms: None, ..fresh });
    bench.put(&Setpoint { echo_tick_ms: Some(now_ms - 301), ..fresh });
    bench.put(&Setpoint { echo_tick_ms: Some(now_ms + 1), ..fresh });
    assert_eq!(bench.state().rejected.stale - stale, 5);
    bench.run_ms(20);
    assert!(!moves(&bench), "none of them kept it alive");
}

#[test]
fn an_estop_is_latched_until_a_reset_and_moves_nothing_then() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    bench.estop(1);
    bench.run_ms(5);
    assert!(!moves(&bench));
    let state = bench.state();
    assert_eq!((state.latches[0].latch, state.latches[0].by.as_str()), (Latch::Estop, CLIENT));
    assert_eq!(state.stopped_because, [StopReason::Estop]);
    assert_eq!(state.goal.unwrap().status, GoalStatus::Failed);
    assert_eq!(code_of(&bench.ask(ahead(5.0))), RejectCode::Latched);
    for _ in 0..10 {
        bench.setpoint(13.0);
        bench.run_ms(50);
        assert!(!moves(&bench));
    }
    bench.ask(Body::Reset { latch: Some(Latch::Runaway) });
    assert_eq!(bench.state().latches.len(), 1, "another one's reset");
    bench.ask(Body::Reset { latch: Some(Latch::Estop) });
    bench.run_ms(2000);
    assert!(!moves(&bench) && bench.state().latches.is_empty());
    bench.estop(1);
    bench.run_ms(5);
    assert!(bench.state().latches.is_empty(), "a repetition that was held up");
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    assert!(moves(&bench));
}

#[test]
fn a_thousand_other_stops_do_not_make_a_repetition_a_new_one() {
    let mut bench = Bench::new();
    (0..1024).for_each(|id| bench.estop(id));
    bench.run_ms(5);
    bench.ask(Body::Reset { latch: None });
    assert!(bench.state().latches.is_empty());
    (0..1024).for_each(|id| bench.estop(id));
    bench.run_ms(5);
    assert!(bench.state().latches.is_empty(), "all of them are remembered");
    bench.estop(1024);
    bench.run_ms(5);
    assert!(!bench.state().latches.is_empty(), "a new one latches");
}

#[test]
fn a_lost_gyro_is_latched_and_its_reset_refused_until_it_is_back() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    bench.gyro_silent = true;
    bench.run_ms(300);
    assert_eq!(bench.state().latches[0].latch, Latch::GyroLost);
    let refused = bench.ask(Body::Reset { latch: None });
    assert_eq!(code_of(&refused), RejectCode::CausePresent);
    let Outcome::Error(error) = &refused.result else { panic!() };
    assert!(error.message.contains(&Fault::GyroSilent.to_string()), "{error:?}");
    bench.gyro_silent = false;
    bench.run_ms(1000);
    assert!(!bench.state().latches[0].present);
    assert!(matches!(bench.ask(Body::Reset { latch: None }).result, Outcome::Ok(_)));
    bench.run_ms(1000);
    assert!(!moves(&bench));
}

#[test]
fn a_robot_whose_lines_were_never_well_has_faults_but_no_latch() {
    let mut bench = Bench::new();
    assert!(bench.state().latches.is_empty());
    bench.run_ms(1000);
    assert!(bench.state().latches.is_empty());
}

#[test]
fn a_loop_that_was_held_up_ends_everything() {
    for jump_ms in [80, 5000] {
        let mut bench = Bench::new();
        bench.ask(ahead(5.0));
        bench.run_ms(1000);
        bench.now = bench.now.plus_ms(jump_ms);
        bench.run_ms(1000);
        assert!(!moves(&bench), "{jump_ms}");
        let state = bench.state();
        assert_eq!(state.goal.unwrap().status, GoalStatus::Failed);
        assert_eq!(state.stopped_because[0], StopReason::LoopStalled, "{jump_ms}");
    }
}

#[test]
fn a_clock_that_goes_back_ends_everything_and_frees_the_lease() {
    let mut bench = Bench::new();
    bench.run_ms(5000);
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    bench.now = xtb_control::Stamp::from_ms(100);
    bench.retains = false;
    bench.run_ms(5);
    assert!(!moves(&bench) && bench.state().lease.is_none());
    bench.run_ms(1000);
    assert!(!moves(&bench));
    bench.lease = None;
    bench.retains = true;
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    assert!(moves(&bench), "it works again");
}

#[test]
fn the_ends_of_earlier_goals_stay_readable() {
    let mut bench = Bench::new();
    let goals: Vec<Uuid> = (0..10).map(|_| goal_of(&bench.ask(ahead(5.0)))).collect();
    bench.run_ms(50);
    let state = bench.state();
    assert_eq!(state.goal.unwrap().id, goals[9]);
    let ended: Vec<Uuid> = state.ended_goals.iter().map(|end| end.id).collect();
    assert_eq!(ended, goals[1..9].iter().rev().copied().collect::<Vec<_>>());
    assert!(state.ended_goals.iter().all(|end| end.status == GoalStatus::Replaced));
}

#[test]
fn a_reset_that_a_later_emergency_stop_overtook_resets_nothing() {
    let mut bench = Bench::new();
    let lease = Some(bench.lease_of(CLIENT));
    bench.run_ms(100);
    let (now, me) = (bench.now, client());
    bench.robot.agent_mut().estop(now, 20, &me, Uuid::from_u128(7));
    let reset = Request { id: Uuid::from_u128(8), lease, body: Body::Reset { latch: None } };
    assert_eq!(code_of(&bench.robot.request(now, 19, &me, &reset)), RejectCode::Overtaken);
    assert_eq!(bench.state().latches.len(), 1);
}

#[test]
fn a_joystick_that_was_let_go_before_a_stop_only_is_still_held_after_it() {
    let mut bench = Bench::new();
    bench.setpoint(0.0);
    bench.run_ms(50);
    bench.setpoint(13.0);
    bench.run_ms(50);
    let (now, zero, held) = (bench.now, bench.fresh_setpoint(0.0), bench.fresh_setpoint(13.0));
    bench.robot.agent_mut().stop(now, 1000);
    bench.robot.agent_mut().setpoint(now, now, 999, &client(), &zero);
    bench.robot.agent_mut().setpoint(now, now, 1001, &client(), &held);
    bench.run_ms(150);
    assert!(!moves(&bench));
}

#[test]
fn a_joystick_that_is_held_through_a_stalled_loop_does_not_drive_on() {
    let mut bench = Bench::new();
    let hold = |bench: &mut Bench, times| {
        for _ in 0..times {
            bench.setpoint(13.0);
            bench.run_ms(50);
        }
    };
    bench.setpoint(0.0);
    hold(&mut bench, 10);
    assert!(moves(&bench));
    // Longer than a setpoint lives: as if nothing had been sent meanwhile.
    bench.now = bench.now.plus_ms(400);
    bench.run_ms(5);
    hold(&mut bench, 20);
    assert!(!moves(&bench));
}

#[test]
fn a_command_that_waited_until_its_lease_had_run_out_comes_too_late() {
    let mut bench = Bench::new();
    bench.lease_of(CLIENT);
    bench.retains = false;
    bench.now = bench.now.plus_ms(950); // held up: no turn has freed the lease
    assert_eq!(code_of(&bench.ask(ahead(5.0))), RejectCode::LeaseLost);
}

#[test]
fn an_acquire_that_is_repeated_keeps_the_lease_until_its_client_knows_of_it() {
    let mut bench = Bench::new();
    let acquire = Request { id: Uuid::from_u128(1), lease: None, body: Body::Acquire { take: false } };
    let lease = lease_in(&bench.ask_as(CLIENT, &acquire));
    for _ in 0..10 {
        bench.run_ms(200);
        assert_eq!(lease_in(&bench.ask_as(CLIENT, &acquire)), lease);
    }
    let retain = Request { id: Uuid::from_u128(2), lease: Some(lease), body: Body::Retain {} };
    assert!(matches!(bench.ask_as(CLIENT, &retain).result, Outcome::Ok(_)));
    bench.run_ms(1000);
    bench.ask_as(CLIENT, &acquire);
    assert_eq!(code_of(&bench.ask_as(CLIENT, &retain)), RejectCode::LeaseLost, "what has run out stays so");
}
