//! What the corpus is made of: one of everything that really goes over the lines.
//!
//! `cargo run -p fleet-tests --example fuzz_corpus` writes it; a test compares it with the files.

mod navigation;
mod tasks;

pub(crate) use navigation::{fix, fleet_map, near, robot_state, ros_map, route, traffic};
pub(crate) use tasks::dispatch;

use super::Seed;
use robot_agent::config::ConfigFile;
use std::path::Path;
use xtb_control::controller::{AdcSample, GyroSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, TpuSetup};
use xtb_control::vehicle::SLOTS;
use xtb_control::{AdcCount, PwmCount, VehicleConfig};
use xtb_protocol::Uuid;
use xtb_protocol::board::{BoardStatus, Firmware, FrameWriter};
use xtb_protocol::codec::{Format, encode, encoding};
use xtb_protocol::gyro_3dmg::{EulerFrame, encode_firmware};
use xtb_protocol::messages::{
    Assignment, Body, Estop, Latch, Lease, LinkLoss, MAX_ASSIGN_SEQ, MAX_LEDGER, MAX_LEG, Message, Request,
    Setpoint, TaskAction, TaskId, Via,
};

const ID: Uuid = Uuid::from_u128(0x0011_2233_4455_6677_8899_aabb_ccdd_eeff);
const LEASE: Option<Lease> = Some(Lease { epoch: 300, root: 2 });
/// The largest numbers that fit.
const ASSIGNMENT: Assignment =
    Assignment { ledger: MAX_LEDGER, task: TaskId::new(17), assign_seq: MAX_ASSIGN_SEQ, leg: MAX_LEG };

/// A message in both formats, and once with its encoding in front.
fn message<M: Message>(name: &str, message: &M) -> [Seed; 3] {
    let write = |format| encode(message, format).unwrap_or_else(|error| panic!("{name}: {error}"));
    let (postcard, json) = (write(Format::Postcard), write(Format::Json));
    let named = [encoding::<M>(Format::Postcard).as_bytes(), b"\n", postcard.as_slice()].concat();
    [(format!("{name}.postcard"), postcard), (format!("{name}.json"), json), (format!("{name}.named"), named)]
}

fn text(name: &str, text: &str) -> Seed {
    (name.to_owned(), text.as_bytes().to_vec())
}

pub(super) fn command() -> Vec<Seed> {
    let (on_link_loss, finish_s) = (LinkLoss::Finish, 60.0);
    let there = TaskAction::Goto { x_m: 1.5, y_m: -2.0, yaw_rad: None, via: Some(Via::Planned) };
    let assign = |errand| Body::Assign { assignment: ASSIGNMENT, errand, on_link_loss, finish_s };
    let bodies = [
        ("acquire", Body::Acquire { take: true }),
        ("retain", Body::Retain {}),
        ("release", Body::Release {}),
        ("goto", Body::Goto { x_m: 1.5, y_m: -2.0, yaw_rad: Some(0.5), via: None, on_link_loss, finish_s }),
        (
            "goto_planned",
            Body::Goto { x_m: 4.0, y_m: 5.0, yaw_rad: None, via: Some(Via::Planned), on_link_loss, finish_s },
        ),
        ("wander", Body::Wander { for_s: Some(20.0), on_link_loss, finish_s }),
        ("stop", Body::Stop {}),
        ("cancel", Body::Cancel { goal: ID }),
        ("set_pose", Body::SetPose { x_m: 0.5, y_m: 0.25, yaw_rad: -1.5 }),
        ("reset", Body::Reset { latch: Some(Latch::SensorFault) }),
        ("reset_all", Body::Reset { latch: None }),
        ("assign_goto", assign(there)),
        ("assign_wander", assign(TaskAction::Wander { for_s: 20.0 })),
        ("withdraw", Body::Withdraw { ledger: ASSIGNMENT.ledger, assign_seq: ASSIGNMENT.assign_seq }),
    ];
    let mut seeds: Vec<Seed> = bodies
        .into_iter()
        .flat_map(|(name, body)| message(name, &Request { id: ID, lease: LEASE, body }))
        .collect();
    let short = r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{"goto":{"x_m":1,"y_m":2}}}"#;
    seeds.push(text("short.json", short));
    seeds.push(text("named.json", &format!("application/json\n{short}")));
    seeds.push(text("other_version.named", &format!("application/x-postcard;xtb.Request.v9\n{short}")));
    seeds.push(text("unknown_field.json", &short.replace("x_m", "x")));
    seeds.push(text("long_field.json", &short.replace("x_m", &"x".repeat(2000))));
    seeds.push(text("out_of_range.json", &short.replace("1,", "1000.5,")));
    seeds
}

pub(super) fn teleop() -> Vec<Seed> {
    let full = Setpoint { lease: LEASE, seq: 7, echo_tick_ms: Some(18_145), rpm: 13.0, steering: -0.5 };
    let bare = Setpoint { lease: None, seq: 0, echo_tick_ms: None, rpm: 0.0, steering: 0.0 };
    let mut seeds = message("full", &full).to_vec();
    seeds.extend(message("bare", &bare));
    seeds.push(text("short.json", r#"{"rpm":-353,"steering":1}"#));
    seeds.push(text("out_of_range.json", r#"{"rpm":353.1,"steering":-1.1}"#));
    seeds
}

pub(super) fn estop() -> Vec<Seed> {
    let mut seeds = message("estop", &Estop { id: ID }).to_vec();
    seeds.push(text("nil.json", r#"{"id":"00000000000000000000000000000000"}"#));
    seeds.push(text("unknown_field.json", r#"{"id":"00112233-4455-6677-8899-aabbccddeeff","why":1}"#));
    seeds
}

fn pwm() -> PwmOutputs {
    let steer = |counts| PwmCount::try_from(counts).unwrap_or(PwmCount::NEUTRAL);
    PwmOutputs {
        motor: PwmCount::MAX,
        steer_front: steer(3710),
        steer_rear: steer(4179),
        bumper_front: PwmCount::MIN,
        bumper_rear: PwmCount::NEUTRAL,
        pistons: [PwmCount::NEUTRAL; 4],
        spare: PwmCount::NEUTRAL,
    }
}

fn adc() -> AdcSample {
    let count = |counts: f64| AdcCount::try_from(counts).unwrap_or(AdcCount::ZERO);
    AdcSample {
        ir_front: [count(100.0); SLOTS],
        ir_rear: [count(1023.0); SLOTS],
        tilt: [count(512.5), count(513.0)],
        pistons: [count(512.015_625); 4],
    }
}

/// Each frame alone, and all in a row.
pub(super) fn board() -> Vec<Seed> {
    let mut line = FrameWriter::default();
    let (firmware, emergency_stop) = (Firmware(0x0100), None);
    let (ready, watchdog, setup_checksum, rejected) = (true, true, 0x1234, 3);
    let status = BoardStatus { firmware, ready, watchdog, emergency_stop, setup_checksum, rejected };
    let setup = TpuSetup::of(&VehicleConfig::default()).unwrap_or_else(|error| panic!("{error}"));
    let remote = RemoteSample { speed: Some(938), steering: None, selector: Some(58_275) };
    let frames = [
        ("encoder", line.encoder(23)),
        ("adc", line.adc(&adc(), Some(7200))),
        ("adc_no_battery", line.adc(&adc(), None)),
        ("remote", line.remote(&remote)),
        ("status", line.status(&status)),
        ("pwm", line.pwm(&pwm())),
        ("setup", line.setup(&setup)),
        ("reset", line.reset(ResetMask { speed: true, steering: false, selector: true })),
    ];
    let mut seeds: Vec<Seed> =
        frames.iter().map(|(name, frame)| (format!("{name}.frame"), frame.as_bytes().to_vec())).collect();
    let all: Vec<u8> = frames.iter().flat_map(|(_, frame)| frame.as_bytes().iter().copied()).collect();
    seeds.push(("all.line".to_owned(), all));
    seeds.push(("no_end.line".to_owned(), vec![0x11; 100]));
    // What stands in a frame: type, sequence, numbers.
    let agents = [(0x10, 10), (0x18, 11), (0x19, 1), (0x1A, 1)];
    let boards = [(0x11, 1), (0x12, 19), (0x13, 3), (0x14, 4), (0x15, 6), (0x16, 7), (0x17, 23)];
    for (kind, words) in agents.into_iter().chain(boards) {
        let mut body = vec![kind, 1];
        body.extend([0xA6, 0x0E].repeat(words)); // 3750, a neutral pulse
        seeds.push((format!("{kind:02x}.body"), body));
    }
    seeds
}

pub(super) fn gyro() -> Vec<Seed> {
    let euler = |yaw, ticks| EulerFrame { angles: GyroSample { roll: 14, pitch: -3, yaw }, ticks }.encode();
    let firmware = encode_firmware(1300).to_vec();
    let mut session = vec![0x0E, 0x01, 0x0E, 0xFF];
    session.extend(&firmware);
    for i in 0..6_u16 {
        session.extend(euler(i as i16 * 100, i * 3 / 2));
    }
    vec![
        ("euler.frame".to_owned(), euler(0x0E0E, 77).to_vec()),
        ("firmware.frame".to_owned(), firmware),
        ("headers.line".to_owned(), vec![0x0E; 40]),
        ("session.line".to_owned(), session),
    ]
}

pub(super) fn fleet_config() -> Vec<Seed> {
    let full = concat!(
        "fleet = \"hall\"\nconnect = [\"tcp/10.0.0.1:7447\"]\n\n[[robots]]\nname = \"xtb-1\"\n",
        "tags = [\"arm\"]\nstart_pose = { x_m = 1.0, y_m = -2.0, yaw_rad = 0.5 }\n\n[[robots]]\nname = \"xtb-2\"\n",
    );
    vec![
        text("full.toml", full),
        text("fleet.toml", "fleet = 'lab'\n"),
        text("routers.toml", "connect = ['tcp/a:1', \"tcp/b\\t\"] # two\n"),
        text("table.toml", "robots = [{ name = 'a', tags = ['x', 'y'] }, { name = 'b' }]\n"),
        text("not_finite.toml", &full.replace("1.0", "nan")),
        text("far_away.toml", &full.replace("1.0", "1e300")),
        text("twice.toml", &full.replace("xtb-2", "xtb-1")),
        text("reserved.toml", "[[robots]]\nname = 'all'\n"),
        text("unknown_key.toml", "[[robots]]\nnme = 'a'\n"),
    ]
}

pub(super) fn agent_config() -> Vec<Seed> {
    vec![
        text("default.toml", &ConfigFile::default().to_toml()),
        text("published.toml", include_str!("../../../configs/published.toml")),
        text(
            "who.toml",
            "[agent]\nname = \"red\"\nfleet = \"barn\"\n[start_pose]\nx_m = 1\nyaw_rad = -0.5\n",
        ),
        text("serial.toml", "[hardware]\nkind = \"serial\"\nboard = \"/dev/ttyUSB0\"\nboard_baud = 57600\n"),
        text(
            "escapes.toml",
            "[hardware]\nboard = \"\\u0000\\u001b\\u007f\\\"'\\\\\"\ngyro = \"e\\u0301\\t\"\n",
        ),
        text("routers.toml", "[zenoh]\nmode = 'peer'\nconnect = ['tcp/a:1', \"tcp/\\u0007\"]\n"),
        text("gains.toml", "[vehicle.speed]\nkp = 3\n[vehicle.goto]\ntolerance_m = 0.5\n"),
        text(
            "navigation.toml",
            "[navigation]\nmap = 'lab.yaml'\n[navigation.drive]\ncruise_mps = 0.3\n[navigation.pose]\ngate = 2\n",
        ),
        text("out_of_order.toml", "[navigation.pose]\nslow_part = 0.9\nstop_part = 0.8\n"),
        text("out_of_range.toml", "[vehicle.goto]\ntolerance_m = 0.0\n"),
        text("not_finite.toml", "[start_pose]\nx_m = nan\n"),
        text("unknown_key.toml", "[vehicle.speed]\nkpp = 3.0\n"),
    ]
}

/// Ten lines from the middle of each published vector, and what else a line may be.
pub(super) fn trace() -> Vec<Seed> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot-agent/tests/vectors");
    let vectors = [
        "arrive",
        "balance",
        "edges",
        "goto",
        "infrared",
        "remote",
        "remote_cases",
        "speed",
        "speed_cases",
        "tilt_cases",
        "tilt_pid",
        "wander",
        "wander_cases",
    ];
    let mut seeds: Vec<Seed> = vectors
        .into_iter()
        .map(|name| {
            let path = folder.join(format!("{name}.in.jsonl"));
            let all = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path:?}: {error}"));
            let lines: Vec<&str> = all.lines().collect();
            let middle = lines.iter().skip(lines.len() / 2).take(10);
            text(&format!("{name}.jsonl"), &middle.map(|line| format!("{line}\n")).collect::<String>())
        })
        .collect();
    seeds.push(text(
        "commands.jsonl",
        concat!(
            "{\"t_ns\":1,\"command\":{\"idle\":{}}}\n{\"t_ns\":2,\"command\":{\"wander\":{}}}\n",
            "{\"t_ns\":3,\"command\":{\"goto\":{\"x_m\":0.1,\"y_m\":-2.0}}}\n",
            "{\"t_ns\":4,\"command\":{\"teleop\":{\"rpm\":-13.3,\"steering\":0.7}}}\n",
            "{\"t_ns\":5,\"command\":{\"follow\":{\"rpm\":40.5,\"steering\":-0.2}}}\n",
        ),
    ));
    seeds.push(text(
        "refused.jsonl",
        concat!(
            "{\"t_ns\":5}\n{\"t_ns\":6,\"gyro\":null}\n{\"t_ns\":7,\"gyro\":[0,0,0]}\n{\"t_ns\":8,\"gyros\":{}}\n",
            "{\"t_ns\":9,\"encoder\":{\"pulses\":-1}}\n{\"t_ns\":10,\"command\":{\"idle\":{},\"wander\":{}}}\n",
        ),
    ));
    seeds.push(text(
        "last_stamp.jsonl",
        "{\"t_ns\":18446744073709551615,\"encoder\":{\"pulses\":4294967295}}\n",
    ));
    seeds
}
