//! Cars without range finders at a bumper: what they refuse, and how they are driven by hand.

use crate::bench::*;
use std::sync::Arc;
use xtb_control::vehicle::{BumperFinders, Drivetrain, Platform, RangeFinder, UNSEEN_MPS};
use xtb_control::{PwmCount, VehicleConfig};
use xtb_nav::navigator::PreparedMap;
use xtb_nav::{Grid, Map};
use xtb_protocol::board::Firmware;
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, Outcome, RejectCode, Reply, Via};

fn bare(front: bool, rear: bool) -> VehicleConfig {
    let mut vehicle = VehicleConfig::default();
    if front {
        vehicle.range_finders.front = BumperFinders(Vec::new());
    }
    if rear {
        vehicle.range_finders.rear = BumperFinders(Vec::new());
    }
    vehicle
}

/// With an empty room on its map.
fn mapped(vehicle: VehicleConfig) -> Bench {
    let mut bench = Bench::with(vehicle);
    let room = Grid::free(0.1, [-10.0, -10.0], 200, 200).unwrap();
    let map = Map::new("room", room, Vec::new()).unwrap();
    bench.robot.agent_mut().set_floor(Arc::new(PreparedMap::of(map)));
    bench
}

fn goto(via: Via) -> Body {
    let on_link_loss = LinkLoss::Halt;
    Body::Goto { x_m: 0.0, y_m: 2.0, yaw_rad: None, via: Some(via), on_link_loss, finish_s: 300.0 }
}

fn wander() -> Body {
    Body::Wander { for_s: Some(10.0), on_link_loss: LinkLoss::Halt, finish_s: 300.0 }
}

fn refusal(reply: &Reply) -> (RejectCode, String) {
    match &reply.result {
        Outcome::Error(error) => (error.code, error.message.clone()),
        Outcome::Ok(done) => panic!("{done:?}"),
    }
}

#[test]
fn what_may_drive_where_no_range_finder_looks_is_refused_with_the_reason() {
    for (vehicle, unseen) in [
        (bare(false, true), "the rear bumper has no range finder"),
        (bare(true, false), "the front bumper has no range finder"),
        (bare(true, true), "no bumper has a range finder"),
    ] {
        let mut bench = mapped(vehicle);
        for body in [goto(Via::Direct), wander()] {
            let (code, words) = refusal(&bench.ask(body));
            assert!(code == RejectCode::Unsupported && words.ends_with(unseen), "{code:?}: {words}");
        }
        assert_eq!(bench.motor, PwmCount::NEUTRAL);
    }
    let mut bench = mapped(bare(true, true));
    let (code, words) = refusal(&bench.ask(goto(Via::Planned)));
    assert!(code == RejectCode::Unsupported && words.contains("no bumper"), "{words}");
}

#[test]
fn a_planned_goal_is_taken_with_range_finders_at_one_bumper_and_the_other_side_is_unknown() {
    for (vehicle, front, rear) in
        [(bare(false, true), Some(false), None), (bare(true, false), None, Some(false))]
    {
        let mut bench = mapped(vehicle);
        bench.ask(goto(Via::Planned));
        bench.run_ms(100);
        let state = bench.state();
        assert_eq!(state.goal.unwrap().status, GoalStatus::Running);
        assert_eq!((state.obstacle.front, state.obstacle.rear), (front, rear));
    }
}

#[test]
fn by_hand_it_is_driven_there_at_a_crawl() {
    let vehicle = bare(false, true);
    let crawl_rpm = UNSEEN_MPS / vehicle.mps_per_rpm();
    let mut bench = Bench::with(vehicle);
    bench.setpoint(0.0);
    bench.run_ms(50);
    bench.setpoint(-20.0);
    bench.run_ms(100);
    assert!((bench.state().reference_rpm + crawl_rpm).abs() < 1e-9, "{}", bench.state().reference_rpm);
    assert!(bench.motor < PwmCount::NEUTRAL);
}

#[test]
fn samples_are_of_what_is_fitted() {
    let sampled = |vehicle: VehicleConfig| {
        let mut bench = Bench::at_board(vehicle, Firmware(0x0102));
        bench.run_ms(500);
        bench.robot.sensors(bench.now).unwrap()
    };
    let all = sampled(VehicleConfig::default());
    assert_eq!((all.ir_front.len(), all.ir_rear_cm.len()), (6, 6));
    assert!(all.tilt.is_some() && all.pistons.is_some() && all.pistons_m.is_some(), "{all:?}");
    assert!(all.piston_counts.is_some() && all.remote.is_some() && all.steer_rear_counts.is_some());

    let mut car = bare(false, true);
    car.range_finders.front.0.resize(8, RangeFinder::at(0.0));
    (car.drivetrain, car.platform, car.remote.enabled) = (Drivetrain::FrontAxle, Platform::Off, false);
    let fitted = sampled(car);
    assert_eq!((fitted.ir_front.len(), fitted.ir_front_cm.len()), (8, 8));
    assert_eq!((fitted.ir_rear.len(), fitted.ir_rear_cm.len()), (0, 0));
    assert_eq!(
        (fitted.tilt, fitted.pistons, fitted.pistons_m, fitted.piston_counts),
        (None, None, None, None)
    );
    assert_eq!((fitted.remote, fitted.steer_rear_counts), (None, None));
}
