//! The bytes of a robot's samples in version 3. This file is never edited to pass: bytes that change need a new version
//! of their type, and a file of their own.

use super::{name, pinned};
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{Message, Sensors};
use xtb_protocol::wire::CodecError;

/// A car with a front steering, eight range finders ahead and one behind, and nothing else.
fn sensors() -> Sensors {
    Sensors {
        robot: name("xtb-1"),
        tick_ms: 1000,
        gyro_yaw: -1,
        encoder_pulses: 23,
        ir_front: vec![1, 2, 3, 4, 5, 6, 7, 300],
        ir_rear: vec![9],
        ir_front_cm: vec![None, Some(0.5), None, None, None, None, None, Some(2.0)],
        ir_rear_cm: vec![None],
        tilt: None,
        pistons: None,
        pistons_m: None,
        remote: None,
        gyro_firmware: None,
        board_firmware: Some(0x0102),
        rpm: 0.0,
        motor_counts: 3750,
        steer_front_counts: 3710,
        steer_rear_counts: None,
        bumper_counts: [3750; 2],
        piston_counts: None,
    }
}

#[test]
fn the_version() {
    assert_eq!(encoding::<Sensors>(Format::Postcard), "application/x-postcard;xtb.Sensors.v3");
}

#[test]
fn of_what_is_not_fitted_there_is_nothing() {
    pinned(
        &sensors(),
        concat!(
            "057874622d31e80701170801020304050607ac020109080001000000000000e03f00000000000100",
            "00000000000040010000000000000182020000000000000000a61dfe1c00a61da61d00"
        ),
        concat!(
            r#"{"robot":"xtb-1","tick_ms":1000,"gyro_yaw":-1,"encoder_pulses":23,"ir_front":[1,"#,
            r#"2,3,4,5,6,7,300],"ir_rear":[9],"ir_front_cm":[null,0.5,null,null,null,null,null,"#,
            r#"2.0],"ir_rear_cm":[null],"tilt":null,"pistons":null,"pistons_m":null,"remote":nu"#,
            r#"ll,"gyro_firmware":null,"board_firmware":258,"rpm":0.0,"motor_counts":3750,"stee"#,
            r#"r_front_counts":3710,"steer_rear_counts":null,"bumper_counts":[3750,3750],"pisto"#,
            r#"n_counts":null}"#
        ),
    );
}

#[test]
fn of_what_is_fitted_there_is_all() {
    let all = Sensors {
        ir_front: vec![1; 6],
        ir_front_cm: vec![None; 6],
        tilt: Some([512.5, 513.0]),
        pistons: Some([512.0; 4]),
        pistons_m: Some([0.5; 4]),
        remote: Some([Some(938), None, Some(58_275)]),
        gyro_firmware: Some(1300),
        steer_rear_counts: Some(4179),
        piston_counts: Some([3750; 4]),
        ..sensors()
    };
    pinned(
        &all,
        concat!(
            "057874622d31e8070117060101010101010109060000000000000100010000000000048040000000",
            "00000880400100000000000080400000000000008040000000000000804000000000000080400100",
            "0000000000e03f000000000000e03f000000000000e03f000000000000e03f0101aa070001a3c703",
            "01940a0182020000000000000000a61dfe1c01d320a61da61d01a61da61da61da61d"
        ),
        concat!(
            r#"{"robot":"xtb-1","tick_ms":1000,"gyro_yaw":-1,"encoder_pulses":23,"ir_front":[1,"#,
            r#"1,1,1,1,1],"ir_rear":[9],"ir_front_cm":[null,null,null,null,null,null],"ir_rear_"#,
            r#"cm":[null],"tilt":[512.5,513.0],"pistons":[512.0,512.0,512.0,512.0],"pistons_m":"#,
            r#"[0.5,0.5,0.5,0.5],"remote":[938,null,58275],"gyro_firmware":1300,"board_firmware"#,
            r#"":258,"rpm":0.0,"motor_counts":3750,"steer_front_counts":3710,"steer_rear_counts"#,
            r#"":4179,"bumper_counts":[3750,3750],"piston_counts":[3750,3750,3750,3750]}"#
        ),
    );
}

#[test]
fn nine_range_finders_or_a_reading_without_one_are_no_bumper() {
    let refused = |change: fn(&mut Sensors)| {
        let mut sensors = sensors();
        change(&mut sensors);
        assert!(matches!(encode(&sensors, Format::Postcard), Err(CodecError::OutOfRange(_))), "{sensors:?}");
        let json = serde_json::to_vec(&sensors).unwrap();
        assert!(matches!(decode::<Sensors>("application/json", &json), Err(CodecError::OutOfRange(_))));
    };
    refused(|sensors| (sensors.ir_front, sensors.ir_front_cm) = (vec![0; 9], vec![None; 9]));
    refused(|sensors| sensors.ir_rear_cm.push(None));
    refused(|sensors| sensors.ir_rear.clear());
}

#[test]
fn what_is_no_number_is_refused_in_either_version() {
    let all = |sensors: &mut Sensors| {
        (sensors.ir_front, sensors.ir_front_cm) = (vec![1; 6], vec![None; 6]);
        (sensors.ir_rear, sensors.ir_rear_cm) = (vec![1; 6], vec![None; 6]);
        (sensors.tilt, sensors.pistons, sensors.pistons_m) = (Some([0.0; 2]), Some([0.0; 4]), Some([0.0; 4]));
        (sensors.remote, sensors.steer_rear_counts, sensors.piston_counts) =
            (Some([None; 3]), Some(0), Some([0; 4]));
    };
    let wrong: [fn(&mut Sensors); 5] = [
        |sensors| sensors.rpm = f64::NAN,
        |sensors| sensors.ir_front_cm[3] = Some(f64::NAN),
        |sensors| sensors.ir_rear_cm[0] = Some(f64::INFINITY),
        |sensors| sensors.tilt = Some([0.0, f64::NAN]),
        |sensors| sensors.pistons_m = Some([f64::NEG_INFINITY; 4]),
    ];
    for make_wrong in wrong {
        let mut sensors = sensors();
        all(&mut sensors);
        let previous = encode(&sensors, Format::Previous).unwrap();
        assert!(decode::<Sensors>(&encoding::<Sensors>(Format::Previous), &previous).is_ok());
        make_wrong(&mut sensors);
        assert!(matches!(encode(&sensors, Format::Postcard), Err(CodecError::OutOfRange(_))));
        for (format, bytes) in [
            (Format::Postcard, postcard::to_allocvec(&sensors).unwrap()),
            (Format::Previous, sensors.write_previous().unwrap()),
        ] {
            let read = decode::<Sensors>(&encoding::<Sensors>(format), &bytes);
            assert!(matches!(read, Err(CodecError::OutOfRange(_))), "{format:?} {read:?}");
        }
    }
}
