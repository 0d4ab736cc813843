//! Goals: reached, replaced, stopped.

use fleet_tests::{Fleet, Setup, eventually};
use xtb_control::Mode;
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, Outcome, RejectCode, StopReason, Via};

#[tokio::test(flavor = "multi_thread")]
async fn a_truck_is_really_there_after_three_metres() {
    let fleet = Fleet::start(Setup::default()).await;
    let goal = fleet.goto(1, 0.3, 3.0).await;
    assert_eq!(fleet.outcome(1, goal).await, GoalStatus::Reached);
    let truth = fleet.truth(1);
    let error_m = (truth.x_m - 0.3).hypot(truth.y_m - 3.0);
    assert!(error_m < 0.5, "{error_m} m off: {truth:?}");
    assert_eq!(truth.contacts, 0);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn all_robots_share_one_map() {
    let setup = Setup { robots: 2, starts: vec![(0.0, 0.0, 1.57), (3.0, 0.0, 0.0)], ..Setup::default() };
    let fleet = Fleet::start(setup).await;
    let (first, second) = (fleet.goto(1, 0.0, 2.0).await, fleet.goto(2, 5.0, 0.3).await);
    assert_eq!(fleet.outcome(1, first).await, GoalStatus::Reached);
    assert_eq!(fleet.outcome(2, second).await, GoalStatus::Reached);
    for (number, x_m, y_m) in [(1, 0.0, 2.0), (2, 5.0, 0.3)] {
        let truth = fleet.truth(number);
        assert!((truth.x_m - x_m).hypot(truth.y_m - y_m) < 0.5, "xtb-{number}: {truth:?}");
    }
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_new_goal_replaces_the_old_one_and_both_ends_are_reported_once() {
    let fleet = Fleet::start(Setup::default()).await;
    let events = fleet.events(1).await;
    let first = fleet.goto(1, 0.0, 5.0).await;
    fleet.until(1, "driving", |state| state.speed_mps.is_some_and(|mps| mps > 0.05)).await;
    let second = fleet.goto(1, 0.2, 1.0).await;
    assert_eq!(fleet.outcome(1, second).await, GoalStatus::Reached);
    let both = || (events.count(first, GoalStatus::Replaced), events.count(second, GoalStatus::Reached));
    eventually("both ends", || async { (both() == (1, 1)).then_some(()) }).await;
    assert_eq!(
        (events.count(first, GoalStatus::Reached), events.count(second, GoalStatus::Replaced)),
        (0, 0)
    );
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn stop_ends_a_goal_and_the_truck_stands() {
    let fleet = Fleet::start(Setup::default()).await;
    let goal = fleet.goto(1, 0.0, 5.0).await;
    fleet.until(1, "driving", |state| state.speed_mps.is_some_and(|mps| mps > 0.05)).await;
    assert!(matches!(fleet.ask(1, Body::Stop {}).await, Outcome::Ok(_)));
    assert_eq!(fleet.outcome(1, goal).await, GoalStatus::Cancelled);
    fleet.until(1, "standing", |state| state.speed_mps == Some(0.0)).await;
    assert_eq!(fleet.state(1).await.stopped_because, vec![StopReason::Stop]);
    assert!(fleet.truth(1).neutral_since_s.is_some());
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn wander_drives_until_its_time_is_up() {
    let fleet = Fleet::start(Setup::default()).await;
    let body = Body::Wander { for_s: Some(5.0), on_link_loss: LinkLoss::Finish, finish_s: 300.0 };
    let Outcome::Ok(done) = fleet.ask(1, body).await else { panic!("refused") };
    fleet.until(1, "wandering", |state| state.mode == Mode::Wander).await;
    assert_eq!(fleet.outcome(1, done.goal.unwrap()).await, GoalStatus::Reached);
    assert!(fleet.truth(1).y_m > 0.3);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_robot_cannot_do_is_refused_by_name() {
    let fleet = Fleet::start(Setup::default()).await;
    let goal = uuid_of_nothing();
    let refused = |outcome: Outcome| match outcome {
        Outcome::Error(error) => error.code,
        Outcome::Ok(done) => panic!("{done:?}"),
    };
    assert_eq!(refused(fleet.ask(1, Body::Cancel { goal }).await), RejectCode::UnknownGoal);
    let turned = Body::Goto {
        x_m: 1.0,
        y_m: 1.0,
        yaw_rad: Some(0.0),
        via: Some(Via::Direct),
        on_link_loss: LinkLoss::Finish,
        finish_s: 300.0,
    };
    assert_eq!(refused(fleet.ask(1, turned).await), RejectCode::Unsupported);
    fleet.end().await;
}

fn uuid_of_nothing() -> xtb_protocol::Uuid {
    xtb_protocol::Uuid::nil()
}
