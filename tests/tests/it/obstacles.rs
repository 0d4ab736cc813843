//! The obstacle rule against real geometry.

use fleet_tests::{Fleet, Setup, eventually};
use std::f64::consts::FRAC_PI_2;
use xtb_protocol::messages::{GoalStatus, StopReason};
use xtb_sim::BoxSpec;

#[tokio::test(flavor = "multi_thread")]
async fn an_obstacle_stops_a_truck_before_contact_and_it_goes_on_when_it_is_gone() {
    let fleet = Fleet::start(Setup::default()).await;
    fleet.simulator.world().change(|simulation| {
        let wall = BoxSpec { x_m: 0.0, y_m: 1.5, width_m: 1.0, depth_m: 0.2, yaw_rad: 0.0 };
        simulation.put_box("wall", wall).expect("there is room for it");
    });
    let goal = fleet.goto(1, 0.0, 3.0).await;
    let blocked = fleet
        .until(1, "blocked", |state| {
            state.goal.as_ref().is_some_and(|goal| goal.status == GoalStatus::Blocked)
                && state.speed_mps == Some(0.0)
        })
        .await;
    assert_eq!(blocked.stopped_because, vec![StopReason::ObstacleFront]);
    let truth = fleet.truth(1);
    let gap_m = 1.4 - (truth.y_m + 0.25);
    assert!((0.05..0.30).contains(&gap_m), "stands {gap_m} m before the wall");
    assert_eq!(truth.contacts, 0);
    fleet.simulator.world().change(|simulation| simulation.remove_box("wall").expect("it is there"));
    assert_eq!(fleet.outcome(1, goal).await, GoalStatus::Reached);
    assert_eq!(fleet.truth(1).contacts, 0);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn two_trucks_head_on_stop_without_contact() {
    let starts = vec![(0.0, 0.0, FRAC_PI_2), (0.0, 3.5, -FRAC_PI_2)];
    let fleet = Fleet::start(Setup { robots: 2, starts, ..Setup::default() }).await;
    fleet.goto(1, 0.0, 3.5).await;
    fleet.goto(2, 0.0, 0.0).await;
    eventually("both standing before each other", || async {
        let (one, two) = (fleet.state(1).await, fleet.state(2).await);
        let stands = |state: &xtb_protocol::messages::RobotState| {
            state.stopped_because.contains(&StopReason::ObstacleFront) && state.speed_mps == Some(0.0)
        };
        (stands(&one) && stands(&two)).then_some(())
    })
    .await;
    fleet.simulated(3.0).await;
    let (one, two) = (fleet.truth(1), fleet.truth(2));
    assert_eq!((one.contacts, two.contacts), (0, 0));
    assert!(two.y_m - one.y_m > 0.5, "{one:?} {two:?}");
    fleet.end().await;
}
