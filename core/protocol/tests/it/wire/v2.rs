//! The bytes of those types that are in version 2. This file is never edited to pass: bytes that
//! change need a new version of their type, and a file of their own.

use super::{id, pinned, pinned_in};
use xtb_protocol::Name;
use xtb_protocol::codec::{Format, decode, encoding};
use xtb_protocol::messages::{Body, Latch, Lease, LinkLoss, Request, Sensors, Via};

fn name() -> Name {
    Name::new("xtb-1").unwrap()
}

#[test]
fn the_versions() {
    assert_eq!(encoding::<Request>(Format::Postcard), "application/x-postcard;xtb.Request.v2");
    assert_eq!(encoding::<Sensors>(Format::Previous), "application/x-postcard;xtb.Sensors.v2");
}

#[test]
fn sensors_which_are_in_version_3_today() {
    let sensors = Sensors {
        robot: name(),
        tick_ms: 1000,
        gyro_yaw: -1,
        encoder_pulses: 23,
        ir_front: vec![1; 6],
        ir_rear: vec![2; 6],
        ir_front_cm: vec![None; 6],
        ir_rear_cm: vec![Some(0.5), None, None, None, None, None],
        tilt: Some([512.5, 513.0]),
        pistons: Some([512.0; 4]),
        pistons_m: Some([0.5; 4]),
        remote: Some([Some(938), None, Some(58_275)]),
        gyro_firmware: Some(1300),
        board_firmware: Some(0x0100),
        rpm: 0.0,
        motor_counts: 3750,
        steer_front_counts: 3710,
        steer_rear_counts: Some(4179),
        bumper_counts: [3750; 2],
        piston_counts: Some([3750; 4]),
    };
    pinned_in(
        Format::Previous,
        &sensors,
        concat!(
            "057874622d31e807011701010101010102020202020200000000000001000000000000e03f000000",
            "00000000000000048040000000000008804000000000000080400000000000008040000000000000",
            "80400000000000008040000000000000e03f000000000000e03f000000000000e03f000000000000",
            "e03f01aa070001a3c70301940a0180020000000000000000a61dfe1cd320a61da61da61da61da61d",
            "a61d"
        ),
        concat!(
            r#"{"robot":"xtb-1","tick_ms":1000,"gyro_yaw":-1,"encoder_pulses":23,"ir_front":[1,"#,
            r#"1,1,1,1,1],"ir_rear":[2,2,2,2,2,2],"ir_front_cm":[null,null,null,null,null,null]"#,
            r#","ir_rear_cm":[0.5,null,null,null,null,null],"tilt":[512.5,513.0],"pistons":[512"#,
            r#".0,512.0,512.0,512.0],"pistons_m":[0.5,0.5,0.5,0.5],"remote":[938,null,58275],"g"#,
            r#"yro_firmware":1300,"board_firmware":256,"rpm":0.0,"motor_counts":3750,"steer_fro"#,
            r#"nt_counts":3710,"steer_rear_counts":4179,"bumper_counts":[3750,3750],"piston_cou"#,
            r#"nts":[3750,3750,3750,3750]}"#
        ),
    );
}

#[test]
fn a_goto_request() {
    let body = Body::Goto {
        x_m: 1.5,
        y_m: -2.0,
        yaw_rad: None,
        via: Some(Via::Planned),
        on_link_loss: LinkLoss::Finish,
        finish_s: 300.0,
    };
    let request = Request { id: id(), lease: Some(Lease { epoch: 300, root: 2 }), body };
    pinned(
        &request,
        concat!(
            "1000112233445566778899aabbccddeeff01ac020203000000000000f83f00000000000000c00001",
            "01010000000000c07240"
        ),
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","lease":{"epoch":300,"root":2},"body":{"g"#,
            r#"oto":{"x_m":1.5,"y_m":-2.0,"yaw_rad":null,"via":"planned","on_link_loss":"finish","fin"#,
            r#"ish_s":300.0}}}"#
        ),
    );
}

#[test]
fn a_request_in_json_may_leave_defaults_out() {
    let json = br#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"goto":{"x_m":1,"y_m":2}}}"#;
    let (request, _) = decode::<Request>("application/json", json).unwrap();
    let body = Body::Goto {
        x_m: 1.0,
        y_m: 2.0,
        yaw_rad: None,
        via: None,
        on_link_loss: LinkLoss::Halt,
        finish_s: 300.0,
    };
    assert_eq!(request, Request { id: id(), lease: None, body });
}

#[test]
fn a_reset_request() {
    let request =
        |latch| Request { id: id(), lease: Some(Lease { epoch: 300, root: 2 }), body: Body::Reset { latch } };
    pinned(
        &request(None),
        "1000112233445566778899aabbccddeeff01ac02020800",
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","lease":{"epoch":300,"root":2},"body":{"#,
            r#""reset":{"latch":null}}}"#
        ),
    );
    pinned(
        &request(Some(Latch::SensorFault)),
        "1000112233445566778899aabbccddeeff01ac0202080105",
        concat!(
            r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","lease":{"epoch":300,"root":2},"body":{"#,
            r#""reset":{"latch":"sensor_fault"}}}"#
        ),
    );
    let json = br#"{"id":"00112233-4455-6677-8899-aabbccddeeff","lease":{"epoch":300,"root":2},"body":{"reset":{}}}"#;
    assert_eq!(decode::<Request>("application/json", json).unwrap().0, request(None));
}
