//! The bytes of those types that are in version 5, and the numbers of the names that they use. This file is
//! never edited to pass: bytes that change need a new version of their type, and a file of their own.

use super::{id, name, pinned};
use xtb_control::Mode;
use xtb_control::frames::MapPose;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{Format, decode, encoding};
use xtb_protocol::messages::{
    Arc, BatteryLevel, Fault, FaultState, GoalEnd, GoalKind, GoalState, GoalStatus, InputAges, Latch,
    LatchState, LeaseState, LinkLoss, MapState, NavPhase, NavState, ObstacleView, PoseSource, PoseState,
    Rejected, RobotState, RouteSource, RouteState, StopReason, TiltState, Track, Via,
};

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
            odometry_scale: Some(1.0625),
            odometry_scale_sigma: Some(0.0625),
            fix_delay_ms: Some(-40),
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
    assert_eq!(encoding::<RobotState>(Format::Postcard), "application/x-postcard;xtb.RobotState.v5");
}

#[test]
fn a_full_state() {
    pinned(
        &full(),
        concat!(
            "057874622d31ac020780e807030105636c692d375a000000000000f83f00000000000000c0000000",
            "000000e03f02010c000000000000b03f000000000000c03f01b60201000000000000f13f01000000",
            "000000b03f014f01000000000000c03f0000000000002a40000000000000e0bf0101000100000000",
            "0000d03f00010000000000001d4003011000112233445566778899aabbccddeeff00010000000000",
            "00084001000000000000104001000000000000e03f01010601000000000000184090030101720563",
            "6c692d37010210000000000000000000000000000000020510000000000000000000000000000000",
            "010301179a030101640200f40305636c692d39000599030b6779726f5f66726f7a656e0101036c61",
            "62043030666600010101030201000000000000f03f000000000000f0bf000000000000e03f020000",
            "00000000e03f0000000000000040000000000000d0bf0000000000000000000000000000e03f0000",
            "00000000f03f000000000000d03f01057874622d3201000000000000f83f000000000000e0bf0228",
            "030f121b01f3030101010201030001c801840702010203040506120708090a0b0c0d0e0f1011"
        ),
        concat!(
            r#"{"robot":"xtb-1","epoch":300,"seq":7,"tick_ms":128000,"mode":"goto","lease":{"holder"#,
            r#"":"cli-7","age_ms":90},"pose":{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5,"source":"fixes",""#,
            r#"age_ms":12,"sigma_m":0.0625,"sigma_yaw_rad":0.125,"fix_age_ms":310,"odometry_scale":"#,
            r#"1.0625,"odometry_scale_sigma":0.0625,"fix_delay_ms":-40},"speed_mps":0.125,"referenc"#,
            r#"e_rpm":13.0,"steering":-0.5,"obstacle":{"front":true,"rear":null},"tilt_deg":{"x":0."#,
            r#"25,"y":null},"battery_v":7.25,"battery_level":"finish","goal":{"id":"00112233-4455-6"#,
            r#"677-8899-aabbccddeeff","kind":"goto","x_m":3.0,"y_m":4.0,"yaw_rad":0.5,"via":"planne"#,
            r#"d","status":"failed","distance_m":6.0,"age_ms":400,"reason":"r","by":"cli-7","on_lin"#,
            r#"k_loss":"finish"},"ended_goals":[{"id":"00000000-0000-0000-0000-000000000002","statu"#,
            r#"s":"replaced"},{"id":"00000000-0000-0000-0000-000000000001","status":"reached"}],"fa"#,
            r#"ults":[{"fault":"gyro_frozen","age_ms":410,"detail":"d"}],"latches":[{"latch":"estop"#,
            r#"","age_ms":500,"by":"cli-9","present":false},{"latch":"sensor_fault","age_ms":409,"b"#,
            r#"y":"gyro_frozen","present":true}],"nav":{"map":{"name":"lab","hash":"00ff","fleet_ha"#,
            r#"sh":null},"traffic":true,"route":{"source":"traffic","plan":3,"phase":"waiting","tra"#,
            r#"ck":{"start":{"x_m":1.0,"y_m":-1.0,"yaw_rad":0.5},"arcs":[{"length_m":0.5,"curvature"#,
            r#"_per_m":2.0},{"length_m":-0.25,"curvature_per_m":0.0}]},"done_m":0.5,"release_m":1.0"#,
            r#","off_m":0.25,"waits_for":"xtb-2","blocked_at_m":[1.5,-0.5],"plans":2},"fixes":40},""#,
            r#"stopped_because":["estop","sensor_fault","coasting"],"stopped_age_ms":499,"input_age"#,
            r#"_ms":{"gyro":1,"encoder":2,"adc":3,"remote":null,"setpoint":200},"turn_late_us":900,"#,
            r#""turns_late":2,"rejected":{"malformed":1,"oversized":2,"wrong_version":3,"out_of_ran"#,
            r#"ge":4,"refused":5,"stale":6,"fixes":18,"fenced":7,"overloaded":8,"setpoints_overwrit"#,
            r#"ten":9,"events_dropped":10,"board_frames":11,"board_lost":12,"board_repeated":13,"gy"#,
            r#"ro_bytes":14,"gyro_lost":15,"remote_readings":16,"record_dropped":17}}"#
        ),
    );
}

/// A state of version 4 as a recording of the fleet holds it: what version 5 added is not known there.
#[test]
fn a_recorded_state_of_version_4_is_read() {
    let recorded = concat!(
        r#"{"robot":"xtb-1","epoch":300,"seq":7,"tick_ms":128000,"mode":"goto","lease":{"holder":"c"#,
        r#"li-7","age_ms":90},"pose":{"x_m":1.5,"y_m":-2.0,"yaw_rad":0.5,"source":"fixes","age_ms":"#,
        r#"12,"sigma_m":0.0625,"sigma_yaw_rad":0.125,"fix_age_ms":310},"speed_mps":0.125,"reference"#,
        r#"_rpm":13.0,"steering":-0.5,"obstacle":{"front":true,"rear":null},"tilt_deg":{"x":0.25,"y"#,
        r#"":null},"battery_v":7.25,"battery_level":"finish","goal":{"id":"00112233-4455-6677-8899-"#,
        r#"aabbccddeeff","kind":"goto","x_m":3.0,"y_m":4.0,"yaw_rad":0.5,"via":"planned","status":""#,
        r#"failed","distance_m":6.0,"age_ms":400,"reason":"r","by":"cli-7","on_link_loss":"finish"}"#,
        r#","ended_goals":[{"id":"00000000-0000-0000-0000-000000000002","status":"replaced"},{"id":"#,
        r#""00000000-0000-0000-0000-000000000001","status":"reached"}],"faults":[{"fault":"gyro_fro"#,
        r#"zen","age_ms":410,"detail":"d"}],"latches":[{"latch":"estop","age_ms":500,"by":"cli-9",""#,
        r#"present":false},{"latch":"sensor_fault","age_ms":409,"by":"gyro_frozen","present":true}]"#,
        r#","nav":{"map":{"name":"lab","hash":"00ff","fleet_hash":null},"traffic":true,"route":{"so"#,
        r#"urce":"traffic","plan":3,"phase":"waiting","track":{"start":{"x_m":1.0,"y_m":-1.0,"yaw_r"#,
        r#"ad":0.5},"arcs":[{"length_m":0.5,"curvature_per_m":2.0},{"length_m":-0.25,"curvature_per"#,
        r#"_m":0.0}]},"done_m":0.5,"release_m":1.0,"off_m":0.25,"waits_for":"xtb-2","blocked_at_m":"#,
        r#"[1.5,-0.5],"plans":2},"fixes":40},"stopped_because":["estop","sensor_fault","coasting"],"#,
        r#""stopped_age_ms":499,"input_age_ms":{"gyro":1,"encoder":2,"adc":3,"remote":null,"setpoin"#,
        r#"t":200},"turn_late_us":900,"turns_late":2,"rejected":{"malformed":1,"oversized":2,"wrong"#,
        r#"_version":3,"out_of_range":4,"refused":5,"stale":6,"fixes":18,"fenced":7,"overloaded":8,"#,
        r#""setpoints_overwritten":9,"events_dropped":10,"board_frames":11,"board_lost":12,"board_r"#,
        r#"epeated":13,"gyro_bytes":14,"gyro_lost":15,"remote_readings":16,"record_dropped":17}}"#
    );
    let (state, _) = decode::<RobotState>("application/json", recorded.as_bytes()).unwrap();
    let mut expected = full();
    (expected.pose.odometry_scale, expected.pose.odometry_scale_sigma) = (None, None);
    expected.pose.fix_delay_ms = None;
    assert_eq!(state, expected);
}

/// The names of an enum in the order of their numbers on the wire.
fn names<T: serde::de::DeserializeOwned + serde::Serialize>() -> String {
    let known = (0_u8..128).map_while(|number| postcard::from_bytes::<T>(&[number]).ok());
    let names: Vec<_> = known.map(|value| serde_json::to_value(value).unwrap()).collect();
    names.iter().map(|name| name.as_str().unwrap()).collect::<Vec<_>>().join(" ")
}

/// A name put in between, or taken away, would change the meaning of all that follow.
#[test]
fn the_numbers_of_the_names() {
    assert_eq!(
        names::<Latch>(),
        "estop remote_takeover board_lost gyro_lost runaway sensor_fault battery_critical"
    );
    assert_eq!(
        names::<Fault>(),
        concat!(
            "board_unplugged board_busy board_no_permission board_port_broken board_silent ",
            "board_garbage board_half_frames board_wrong_device board_not_set_up gyro_unplugged ",
            "gyro_busy gyro_no_permission gyro_port_broken gyro_silent gyro_garbage gyro_half_frames ",
            "gyro_wrong_device encoder_silent converter_silent remote_lost tilt_out_of_range ",
            "recording_failed board_frozen gyro_frozen encoder_out_of_range converter_frozen ",
            "infrared_frozen infrared_out_of_range runaway stalled battery_low battery_critical ",
            "odometry_scale fixes_frozen fixes_contradict"
        )
    );
    assert_eq!(
        names::<StopReason>(),
        concat!(
            "no_command goal_reached stop cancelled time_up setpoint_expired link_lost setpoint_zero ",
            "obstacle_front obstacle_rear wander_pause board_lost gyro_lost remote_neutral remote_lost ",
            "estop remote_takeover runaway sensor_fault battery_critical lease_expired lease_taken ",
            "lease_released loop_stalled stalled over_speed changing_direction coasting starting planning ",
            "waiting_for_traffic giving_way way_blocked pose_uncertain in_keep_out at_cusp"
        )
    );
    assert_eq!(names::<BatteryLevel>(), "unknown ok warn finish critical");
    assert_eq!(
        names::<GoalStatus>(),
        "accepted running blocked reached cancelled replaced failed interrupted"
    );
    assert_eq!(names::<Mode>(), "idle manual teleop goto wander fault");
}
