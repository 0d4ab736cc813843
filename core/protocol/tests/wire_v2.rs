//! The bytes of those types that are in version 2. This file is never edited to pass: bytes that
//! change need a new version of their type, and a file of their own.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_control::Mode;
use xtb_protocol::Name;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    Event, EventKind, Fault, FaultState, InputAges, Message, ObstacleView, PoseSource, PoseState, Rejected,
    RobotState, Sensors, StopReason, TiltState,
};

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn pinned<M: Message + PartialEq + std::fmt::Debug>(message: &M, postcard: &str, json: &str) {
    let bytes = encode(message, Format::Postcard).unwrap();
    let text = encode(message, Format::Json).unwrap();
    assert_eq!((hex(&bytes).as_str(), std::str::from_utf8(&text).unwrap()), (postcard, json));
    for (format, bytes) in [(Format::Postcard, &bytes), (Format::Json, &text)] {
        assert_eq!(&decode::<M>(&encoding::<M>(format), bytes).unwrap().0, message);
    }
}

fn name() -> Name {
    Name::new("xtb-1").unwrap()
}

#[test]
fn the_versions() {
    assert_eq!(encoding::<RobotState>(Format::Postcard), "application/x-postcard;xtb.RobotState.v2");
    assert_eq!(encoding::<Sensors>(Format::Postcard), "application/x-postcard;xtb.Sensors.v2");
    assert_eq!(encoding::<Event>(Format::Postcard), "application/x-postcard;xtb.Event.v2");
}

#[test]
fn an_event_of_a_fault() {
    let kind =
        EventKind::Fault { fault: Fault::GyroSilent, present: true, detail: Some("no such device".into()) };
    let event = Event { robot: name(), epoch: 5, seq: 1, tick_ms: 1000, kind };
    pinned(
        &event,
        "057874622d310501e807040d01010e6e6f207375636820646576696365",
        concat!(
            r#"{"robot":"xtb-1","epoch":5,"seq":1,"tick_ms":1000,"kind":{"fault":{"fault":"gyro"#,
            r#"_silent","present":true,"detail":"no such device"}}}"#
        ),
    );
}

#[test]
fn a_state() {
    let state = RobotState {
        robot: name(),
        epoch: 5,
        seq: 1,
        tick_ms: 1000,
        mode: Mode::Idle,
        lease: None,
        pose: PoseState { x_m: 1.5, y_m: 0.0, yaw_rad: 0.5, source: PoseSource::Odometry, age_ms: Some(7) },
        speed_mps: Some(0.0),
        reference_rpm: 0.0,
        steering: 0.0,
        obstacle: ObstacleView { front: Some(true), rear: None },
        tilt_deg: TiltState { x: Some(0.25), y: None },
        battery_v: None,
        goal: None,
        faults: vec![FaultState { fault: Fault::BoardSilent, age_ms: 300, detail: None }],
        latches: Vec::new(),
        stopped_because: vec![StopReason::BoardLost, StopReason::RemoteLost],
        input_age_ms: InputAges { gyro: Some(3), remote: Some(9), ..InputAges::default() },
        rejected: Rejected { gyro_lost: 2, remote_readings: 1, ..Rejected::default() },
    };
    pinned(
        &state,
        concat!(
            "057874622d310501e8070000000000000000f83f0000000000000000000000000000e03f01010701",
            "00000000000000000000000000000000000000000000000001010001000000000000d03f00000001",
            "04ac020000020b0e01030000010900000000000000000000000000020100"
        ),
        concat!(
            r#"{"robot":"xtb-1","epoch":5,"seq":1,"tick_ms":1000,"mode":"idle","lease":null,"po"#,
            r#"se":{"x_m":1.5,"y_m":0.0,"yaw_rad":0.5,"source":"odometry","age_ms":7},"speed_mp"#,
            r#"s":0.0,"reference_rpm":0.0,"steering":0.0,"obstacle":{"front":true,"rear":null},"#,
            r#""tilt_deg":{"x":0.25,"y":null},"battery_v":null,"goal":null,"faults":[{"fault":""#,
            r#"board_silent","age_ms":300,"detail":null}],"latches":[],"stopped_because":["boar"#,
            r#"d_lost","remote_lost"],"input_age_ms":{"gyro":3,"encoder":null,"adc":null,"remot"#,
            r#"e":9,"setpoint":null},"rejected":{"malformed":0,"oversized":0,"wrong_version":0,"#,
            r#""out_of_range":0,"refused":0,"stale":0,"overloaded":0,"setpoints_overwritten":0,"#,
            r#""events_dropped":0,"board_frames":0,"board_lost":0,"gyro_bytes":0,"gyro_lost":2,"#,
            r#""remote_readings":1,"record_dropped":0}}"#
        ),
    );
}

#[test]
fn sensors() {
    let sensors = Sensors {
        robot: name(),
        tick_ms: 1000,
        gyro_yaw: -1,
        encoder_pulses: 23,
        ir_front: [1; 6],
        ir_rear: [2; 6],
        ir_front_cm: [None; 6],
        ir_rear_cm: [Some(0.5), None, None, None, None, None],
        tilt: [512.5, 513.0],
        pistons: [512.0; 4],
        pistons_m: [0.5; 4],
        remote: [Some(938), None, Some(58_275)],
        gyro_firmware: Some(1300),
        board_firmware: Some(0x0100),
        rpm: 0.0,
        motor_counts: 3750,
        steer_front_counts: 3710,
        steer_rear_counts: 4179,
        bumper_counts: [3750; 2],
        piston_counts: [3750; 4],
    };
    pinned(
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
