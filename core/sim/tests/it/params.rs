//! Settings that change while a robot drives, by ground truth.

use crate::drive::Drive;
use xtb_control::{Controller, VehicleConfig};
use xtb_protocol::messages::{
    Body, Done, LinkLoss, Outcome, ParamBody, ParamOutcome, ParamRequest, ParamValue, Request, Via,
};
use xtb_protocol::{Name, Uuid};

const HALL: &str = "[room]\nwidth_m = 12.0\ndepth_m = 12.0";
const LIMIT_MPS: f64 = 0.1;

#[test]
fn a_robot_on_its_path_slows_down_to_a_speed_limit_at_once() {
    let mut drive = Drive::new(HALL, 1, 5);
    assert!(matches!(drive.goto(0, 0.0, 5.0, None), Outcome::Ok(_)));
    let fastest_mps = |drive: &mut Drive, seconds: f64| {
        let mut fastest = 0.0_f64;
        for _ in 0..(seconds / 0.05) as u32 {
            drive.run_s(0.05);
            fastest = fastest.max(drive.lockstep.simulation().trucks()[0].truth().speed_mps.abs());
        }
        fastest
    };
    let before = fastest_mps(&mut drive, 8.0);
    assert!(before > 0.15, "{before} m/s");
    let value = ParamValue { name: "navigation.drive.limit_mps".to_owned(), value: LIMIT_MPS };
    let body = ParamBody::Set { values: vec![value] };
    let request = ParamRequest { id: Uuid::from_u128(1), lease: None, body };
    let now = drive.lockstep.now();
    let robot = drive.lockstep.robot_mut(0).unwrap();
    // By somebody who does not drive it.
    let reply = robot.param(now, &Name::new("cli-9").unwrap(), &request);
    assert!(matches!(reply.result, ParamOutcome::Ok(_)), "{reply:?}");
    drive.run_s(1.5);
    let after = fastest_mps(&mut drive, 5.0);
    assert!(after > 0.05 && after < 1.25 * LIMIT_MPS, "{after} m/s");
}

/// How far the front bumper stays from the wall ahead on a direct drive at it, in m, and whether the recorded steps give
/// the same decisions again; told this in cm before, by somebody who has control.
fn stops_before_wall_m(obstacle_cm: Option<f64>) -> f64 {
    let mut drive = Drive::new(HALL, 1, 5);
    drive.lockstep.robot_mut(0).unwrap().record_steps();
    let me = Name::new("tester").unwrap();
    let ask = |number: u128, lease, body| Request { id: Uuid::from_u128(number), lease, body };
    let acquire = ask(1, None, Body::Acquire { take: false });
    let reply = drive.lockstep.request(0, &me, &acquire).unwrap();
    let Outcome::Ok(Done { lease, .. }) = reply.result else { panic!("{reply:?}") };
    let now = drive.lockstep.now();
    if let Some(value) = obstacle_cm {
        let values = vec![ParamValue { name: "navigation.drive.obstacle_cm".to_owned(), value }];
        let request = ParamRequest { id: Uuid::from_u128(2), lease, body: ParamBody::Set { values } };
        let reply = drive.lockstep.robot_mut(0).unwrap().param(now, &me, &request);
        assert!(matches!(reply.result, ParamOutcome::Ok(_)), "{reply:?}");
    }
    let (via, on_link_loss, finish_s) = (Some(Via::Direct), LinkLoss::Finish, 300.0);
    let body = Body::Goto { x_m: 0.0, y_m: 900.0, yaw_rad: None, via, on_link_loss, finish_s };
    let reply = drive.lockstep.request(0, &me, &ask(3, lease, body)).unwrap();
    assert!(matches!(reply.result, Outcome::Ok(_)), "{reply:?}");
    let mut again = Controller::new(VehicleConfig::default());
    let mut steps = 0;
    for _ in 0..1_400 {
        drive.run_s(0.05);
        let robot = drive.lockstep.robot_mut(0).unwrap();
        while let Some(step) = robot.take_step() {
            // From where the recording begins; what was before is one pose.
            let outputs = again.step(step.t, &step.sample);
            assert_eq!((outputs.obstacle, outputs.blocked), (step.outputs.obstacle, step.outputs.blocked));
            steps += 1;
        }
    }
    assert!(steps > 10_000, "{steps}");
    let truth = drive.lockstep.simulation().trucks()[0].truth();
    assert_eq!((truth.speed_mps, truth.contacts), (0.0, 0));
    6.0 - truth.y_m - 0.25
}

#[test]
fn a_robot_that_is_told_to_keep_more_distance_stops_sooner_and_its_steps_decide_the_same_again() {
    let (usual_m, more_m) = (stops_before_wall_m(None), stops_before_wall_m(Some(45.0)));
    assert!((0.15..0.27).contains(&usual_m), "{usual_m} m");
    assert!((0.40..0.52).contains(&more_m), "{more_m} m");
}
