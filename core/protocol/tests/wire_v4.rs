//! The bytes of those types that are in version 4, and of the messages that came with them. This file is
//! never edited to pass: bytes that change need a new version of their type, and a file of their own.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_control::Mode;
use xtb_control::frames::MapPose;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    Arc, BatteryLevel, Fault, FaultState, Fix, FixSource, GoalEnd, GoalKind, GoalState, GoalStatus,
    InputAges, Latch, LatchState, LeaseState, LinkLoss, MapState, Message, NavPhase, NavState, ObstacleView,
    PoseSource, PoseState, Rejected, RobotState, Route, RouteGoal, RouteSource, RouteState, StopReason,
    TiltState, Track, TrafficState, Via,
};
use xtb_protocol::{Name, Uuid};

fn id() -> Uuid {
    Uuid::from_u128(0x0011_2233_4455_6677_8899_aabb_ccdd_eeff)
}

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

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

fn track() -> Track {
    Track {
        start: MapPose { x_m: 1.0, y_m: -1.0, yaw_rad: 0.5 },
        arcs: vec![
            Arc { length_m: 0.5, curvature_per_m: 2.0 },
            Arc { length_m: -0.25, curvature_per_m: 0.0 },
        ],
    }
}

/// A state that says something in every field.
fn full() -> RobotState {
    RobotState {
        robot: name("xtb-1"),
        epoch: 300,
        seq: 7,
        tick_ms: 128_000,
        mode: Mode::Goto,
        lease: Some(LeaseState { holder: name("cli-7"), age_ms: 90 }),
        pose: PoseState {
            x_m: 1.5,
            y_m: -2.0,
            yaw_rad: 0.5,
            source: PoseSource::Fixes,
            age_ms: Some(12),
            sigma_m: 0.0625,
            sigma_yaw_rad: 0.125,
            fix_age_ms: Some(310),
        },
        speed_mps: Some(0.125),
        reference_rpm: 13.0,
        steering: -0.5,
        obstacle: ObstacleView { front: Some(true), rear: None },
        tilt_deg: TiltState { x: Some(0.25), y: None },
        battery_v: Some(7.25),
        battery_level: BatteryLevel::Finish,
        goal: Some(GoalState {
            id: id(),
            kind: GoalKind::Goto,
            x_m: Some(3.0),
            y_m: Some(4.0),
            yaw_rad: Some(0.5),
            via: Some(Via::Planned),
            status: GoalStatus::Failed,
            distance_m: Some(6.0),
            age_ms: 400,
            reason: Some("r".to_owned()),
            by: name("cli-7"),
            on_link_loss: LinkLoss::Finish,
        }),
        ended_goals: vec![
            GoalEnd { id: Uuid::from_u128(2), status: GoalStatus::Replaced },
            GoalEnd { id: Uuid::from_u128(1), status: GoalStatus::Reached },
        ],
        faults: vec![FaultState { fault: Fault::GyroFrozen, age_ms: 410, detail: Some("d".to_owned()) }],
        latches: vec![
            LatchState { latch: Latch::Estop, age_ms: 500, by: "cli-9".to_owned(), present: false },
            LatchState {
                latch: Latch::SensorFault,
                age_ms: 409,
                by: "gyro_frozen".to_owned(),
                present: true,
            },
        ],
        nav: NavState {
            map: Some(MapState { name: "lab".to_owned(), hash: "00ff".to_owned(), fleet_hash: None }),
            traffic: true,
            route: Some(RouteState {
                source: RouteSource::Traffic,
                plan: 3,
                phase: NavPhase::Waiting,
                track: Some(track()),
                done_m: 0.5,
                release_m: 1.0,
                off_m: 0.25,
                waits_for: Some(name("xtb-2")),
                blocked_at_m: Some((1.5, -0.5)),
                plans: 2,
            }),
            fixes: 40,
        },
        stopped_because: vec![StopReason::Estop, StopReason::SensorFault, StopReason::Coasting],
        stopped_age_ms: Some(499),
        input_age_ms: InputAges {
            gyro: Some(1),
            encoder: Some(2),
            adc: Some(3),
            remote: None,
            setpoint: Some(200),
        },
        turn_late_us: 900,
        turns_late: 2,
        rejected: Rejected {
            malformed: 1,
            oversized: 2,
            wrong_version: 3,
            out_of_range: 4,
            refused: 5,
            stale: 6,
            fixes: 18,
            fenced: 7,
            overloaded: 8,
            setpoints_overwritten: 9,
            events_dropped: 10,
            board_frames: 11,
            board_lost: 12,
            board_repeated: 13,
            gyro_bytes: 14,
            gyro_lost: 15,
            remote_readings: 16,
            record_dropped: 17,
        },
    }
}

#[test]
fn the_versions() {
    assert_eq!(encoding::<RobotState>(Format::Postcard), "application/x-postcard;xtb.RobotState.v4");
    assert_eq!(encoding::<Route>(Format::Postcard), "application/x-postcard;xtb.Route.v1");
    assert_eq!(encoding::<Fix>(Format::Postcard), "application/x-postcard;xtb.Fix.v1");
    assert_eq!(encoding::<TrafficState>(Format::Postcard), "application/x-postcard;xtb.TrafficState.v1");
}

#[test]
fn a_full_state() {
    pinned(
        &full(),
        concat!(
            "057874622d31ac020780e807030105636c692d375a000000000000f83f00000000000000c0000000",
            "000000e03f02010c000000000000b03f000000000000c03f01b60201000000000000c03f00000000",
            "00002a40000000000000e0bf01010001000000000000d03f00010000000000001d40030110001122",
            "33445566778899aabbccddeeff0001000000000000084001000000000000104001000000000000e0",
            "3f010106010000000000001840900301017205636c692d3701021000000000000000000000000000",
            "0000020510000000000000000000000000000000010301179a030101640200f40305636c692d3900",
            "0599030b6779726f5f66726f7a656e0101036c6162043030666600010101030201000000000000f0",
            "3f000000000000f0bf000000000000e03f02000000000000e03f0000000000000040000000000000",
            "d0bf0000000000000000000000000000e03f000000000000f03f000000000000d03f01057874622d",
            "3201000000000000f83f000000000000e0bf0228030f121b01f3030101010201030001c801840702",
            "010203040506120708090a0b0c0d0e0f1011"
        ),
        concat!(
            r#"{"robot":"xtb-1","epoch":300,"seq":7,"tick_ms":128000,"mode":"goto","lease":{"holder":"#,
            r#""cli-7","age_ms":90},"pose":{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5,"source":"fixes","age_"#,
            r#"ms":12,"sigma_m":0.0625,"sigma_yaw_rad":0.125,"fix_age_ms":310},"speed_mps":0.125,"ref"#,
            r#"erence_rpm":13.0,"steering":-0.5,"obstacle":{"front":true,"rear":null},"tilt_deg":{"x""#,
            r#":0.25,"y":null},"battery_v":7.25,"battery_level":"finish","goal":{"id":"00112233-4455-"#,
            r#"6677-8899-aabbccddeeff","kind":"goto","x_m":3.0,"y_m":4.0,"yaw_rad":0.5,"via":"planned"#,
            r#"","status":"failed","distance_m":6.0,"age_ms":400,"reason":"r","by":"cli-7","on_link_l"#,
            r#"oss":"finish"},"ended_goals":[{"id":"00000000-0000-0000-0000-000000000002","status":"r"#,
            r#"eplaced"},{"id":"00000000-0000-0000-0000-000000000001","status":"reached"}],"faults":["#,
            r#"{"fault":"gyro_frozen","age_ms":410,"detail":"d"}],"latches":[{"latch":"estop","age_ms"#,
            r#"":500,"by":"cli-9","present":false},{"latch":"sensor_fault","age_ms":409,"by":"gyro_fr"#,
            r#"ozen","present":true}],"nav":{"map":{"name":"lab","hash":"00ff","fleet_hash":null},"tr"#,
            r#"affic":true,"route":{"source":"traffic","plan":3,"phase":"waiting","track":{"start":{""#,
            r#"x_m":1.0,"y_m":-1.0,"yaw_rad":0.5},"arcs":[{"length_m":0.5,"curvature_per_m":2.0},{"le"#,
            r#"ngth_m":-0.25,"curvature_per_m":0.0}]},"done_m":0.5,"release_m":1.0,"off_m":0.25,"wait"#,
            r#"s_for":"xtb-2","blocked_at_m":[1.5,-0.5],"plans":2},"fixes":40},"stopped_because":["es"#,
            r#"top","sensor_fault","coasting"],"stopped_age_ms":499,"input_age_ms":{"gyro":1,"encoder"#,
            r#"":2,"adc":3,"remote":null,"setpoint":200},"turn_late_us":900,"turns_late":2,"rejected""#,
            r#":{"malformed":1,"oversized":2,"wrong_version":3,"out_of_range":4,"refused":5,"stale":6"#,
            r#","fixes":18,"fenced":7,"overloaded":8,"setpoints_overwritten":9,"events_dropped":10,"b"#,
            r#"oard_frames":11,"board_lost":12,"board_repeated":13,"gyro_bytes":14,"gyro_lost":15,"re"#,
            r#"mote_readings":16,"record_dropped":17}}"#
        ),
    );
}

#[test]
fn a_fix() {
    let fix = Fix {
        x_m: 1.5,
        y_m: -2.0,
        yaw_rad: Some(0.5),
        sigma_m: 0.0625,
        sigma_yaw_rad: 0.125,
        source: FixSource::Tags,
        age_ms: 40,
    };
    pinned(
        &fix,
        concat!("000000000000f83f00000000000000c001000000000000e03f000000000000b03f000000000000c0", "3f0128"),
        concat!(
            r#"{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5,"sigma_m":0.0625,"sigma_yaw_rad":0.125,"source":"t"#,
            r#"ags","age_ms":40}"#
        ),
    );
}

#[test]
fn a_route() {
    let route = Route {
        epoch: 300,
        seq: 9,
        goal: Some(RouteGoal { epoch: 5, id: id() }),
        track: Some(track()),
        plan: 3,
        release_m: 1.0,
        cruise_mps: 0.25,
        waits_for: Some(name("xtb-2")),
        reason: Some("r".to_owned()),
        others: vec![MapPose { x_m: 1.0, y_m: 2.0, yaw_rad: 0.5 }],
    };
    pinned(
        &route,
        concat!(
            "ac020901051000112233445566778899aabbccddeeff01000000000000f03f000000000000f0bf00",
            "0000000000e03f02000000000000e03f0000000000000040000000000000d0bf0000000000000000",
            "03000000000000f03f000000000000d03f01057874622d3201017201000000000000f03f00000000",
            "00000040000000000000e03f"
        ),
        concat!(
            r#"{"epoch":300,"seq":9,"goal":{"epoch":5,"id":"00112233-4455-6677-8899-aabbccddeeff"},"t"#,
            r#"rack":{"start":{"x_m":1.0,"y_m":-1.0,"yaw_rad":0.5},"arcs":[{"length_m":0.5,"curvature"#,
            r#"_per_m":2.0},{"length_m":-0.25,"curvature_per_m":0.0}]},"plan":3,"release_m":1.0,"crui"#,
            r#"se_mps":0.25,"waits_for":"xtb-2","reason":"r","others":[{"x_m":1.0,"y_m":2.0,"yaw_rad""#,
            r#":0.5}]}"#
        ),
    );
}

#[test]
fn the_state_of_traffic_control() {
    let state = TrafficState {
        epoch: 300,
        seq: 2,
        map_hash: "00ff".to_owned(),
        led: vec![name("xtb-1")],
        obstacles: vec![name("xtb-2")],
        plans: 4,
    };
    pinned(
        &state,
        "ac0202043030666601057874622d3101057874622d3204",
        concat!(
            r#"{"epoch":300,"seq":2,"map_hash":"00ff","led":["xtb-1"],"obstacles":["xtb-2"],"plans":4"#,
            r#"}"#
        ),
    );
}
