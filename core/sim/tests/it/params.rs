//! A speed limit that comes while a robot drives, by ground truth.

use crate::drive::Drive;
use xtb_protocol::messages::{Outcome, ParamBody, ParamOutcome, ParamRequest, ParamValue};
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
