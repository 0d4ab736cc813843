//! Foreign code computes every hash that is used here, and decodes what is written here: rosbags, an independent
//! implementation in Python (`XTB_PYTHON`, else `python3`), and rclpy's genuine type support (`XTB_RCLPY`). Without a
//! Python that has it nothing is judged by it.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use serde_json::{Value, json};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use xtb_control::VehicleConfig;
use xtb_protocol::Name;
use xtb_ros2::cdr::{Cdr, to_bytes};
use xtb_ros2::convert::Robot;
use xtb_ros2::offer;
use xtb_ros2::types::{
    CancelGoalRequest, CancelGoalResponse, DiagnosticArray, DiagnosticStatus, Distro, EmptyRequest,
    GetResultRequest, GetResultResponse, GoalId, GoalInfo, Header, KeyValue, LaserScan, Message,
    NavigateFeedback, Point, Pose, PoseStamped, Quaternion, RosType, SendGoalRequest, SendGoalResponse,
    Service, SetBool, SetBoolRequest, Text, Time, Verdict,
};

const RELEASES: [(Distro, &str); 3] =
    [(Distro::Jazzy, "jazzy"), (Distro::Kilted, "kilted"), (Distro::Lyrical, "lyrical")];
const ACTION: &str = "nav2_msgs/action/NavigateToPose";
const UUID: GoalId = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 255];

/// Who judges.
#[derive(Clone, Copy)]
struct Foreign {
    script: &'static str,
    /// Names its Python.
    variable: &'static str,
    package: &'static str,
}

const ROSBAGS: Foreign =
    Foreign { script: "rosbags_judge.py", variable: "XTB_PYTHON", package: "rosbags.typesys" };
const RCLPY: Foreign =
    Foreign { script: "rclpy_judge.py", variable: "XTB_RCLPY", package: "rclpy.serialization" };

impl Foreign {
    fn python(self) -> Option<PathBuf> {
        let candidates = std::env::var_os(self.variable).into_iter().chain(["python3".into()]);
        candidates.map(PathBuf::from).find(|python| {
            let import = format!("import {}", self.package);
            let import = Command::new(python).args(["-c", &import]).stderr(Stdio::null()).status();
            import.is_ok_and(|status| status.success())
        })
    }

    /// What it answers; `None` without it.
    fn judged(self, asked: &Value) -> Option<Value> {
        let Some(python) = self.python() else {
            skip(&format!("no Python with {}: hashes and bytes were not judged by it", self.package));
            return None;
        };
        let judge = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(self.script);
        let mut command = Command::new(python);
        let mut child = command.arg(judge).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(asked.to_string().as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{output:?}");
        Some(serde_json::from_slice(&output.stdout).unwrap())
    }
}

#[allow(clippy::print_stderr)]
fn skip(why: &str) {
    eprintln!("skipped: {why}");
}

fn types(distro: Distro) -> Vec<RosType> {
    let offered = offer::robot(distro).chain([offer::MAP, offer::FLEET_ESTOP, offer::CLOCK]);
    offered.map(|channel| channel.ros_type).chain([LaserScan::TYPE, SetBool::TYPE]).collect()
}

#[test]
fn every_hash_is_the_one_that_rosbags_computes() {
    let all =
        RELEASES.iter().flat_map(|(distro, store)| types(*distro).into_iter().map(move |it| (it, *store)));
    let (types, asked): (Vec<_>, Vec<_>) =
        all.map(|(it, store)| (it, json!({ "name": it.name, "store": store }))).unzip();
    let Some(answer) = ROSBAGS.judged(&json!({ "types": asked, "messages": [] })) else { return };
    for (ours, theirs) in types.iter().zip(answer["types"].as_array().unwrap()) {
        assert_eq!(theirs["hash"], ours.hash, "{theirs}");
    }
}

/// It has no tf2_msgs and no nav2_msgs.
#[test]
fn every_hash_is_the_one_that_the_genuine_generator_has_written() {
    let types = types(Distro::Kilted);
    let asked: Vec<_> = types.iter().map(|it| json!({ "name": it.name })).collect();
    let Some(answer) = RCLPY.judged(&json!({ "types": asked, "messages": [] })) else { return };
    let theirs = answer["types"].as_array().unwrap();
    let known: Vec<_> = types.iter().zip(theirs).filter(|(_, theirs)| !theirs["hash"].is_null()).collect();
    for (ours, theirs) in &known {
        assert_eq!(theirs["hash"], ours.hash, "{theirs}");
    }
    assert!(known.len() > 20, "{theirs:?}");
}

/// A message with its release and its type's name.
struct Sent {
    name: String,
    store: &'static str,
    bytes: Vec<u8>,
    /// Where in the decoded message something stands, and what.
    check: (&'static str, Value),
}

fn sent<T: Cdr>(name: &str, message: &T, check: (&'static str, Value)) -> Sent {
    Sent { name: name.to_owned(), store: "kilted", bytes: to_bytes(message), check }
}

fn header(frame: &str) -> Header {
    Header { stamp: Time { sec: 1_800_000_000, nanosec: 999_999_999 }, frame_id: frame.to_owned() }
}

fn goal() -> PoseStamped {
    let orientation = Quaternion { x: 0.0, y: 0.0, z: 0.6, w: 0.8 };
    PoseStamped {
        header: header("map"),
        pose: Pose { position: Point { x: 1.0, y: -2.0, z: 0.0 }, orientation },
    }
}

fn messages() -> Vec<Sent> {
    let robot = Robot::new(&Name::new("xtb-1").unwrap(), &VehicleConfig::default());
    let stamp = header("").stamp;
    let info = GoalInfo { goal_id: UUID, stamp: stamp.clone() };
    let tf = robot.static_transforms(&stamp);
    let mut all = vec![
        sent("tf2_msgs/msg/TFMessage", &tf, ("/transforms/12/child_frame_id", json!("xtb_1/ir_rear_5"))),
        sent(
            "std_msgs/msg/String",
            &Text { data: robot.description() },
            ("/data", json!(robot.description())),
        ),
        sent(
            "std_srvs/srv/Trigger_Request",
            &EmptyRequest::default(),
            ("/structure_needs_at_least_one_member", json!(0)),
        ),
        sent("std_srvs/srv/Trigger_Response", &Verdict::refused("ü"), ("/message", json!("ü"))),
        sent("std_srvs/srv/SetBool_Request", &SetBoolRequest { data: true }, ("/data", json!(true))),
        sent(
            "action_msgs/srv/CancelGoal_Request",
            &CancelGoalRequest { goal_info: info.clone() },
            ("/goal_info/goal_id/uuid/15", json!(255)),
        ),
        sent(
            "action_msgs/srv/CancelGoal_Response",
            &CancelGoalResponse { return_code: -1, goals_canceling: vec![info.clone(), info] },
            ("/goals_canceling/1/stamp/nanosec", json!(999_999_999)),
        ),
        sent(
            &format!("{ACTION}_SendGoal_Request"),
            &SendGoalRequest { goal_id: UUID, pose: goal(), behavior_tree: "tree".into() },
            ("/goal/behavior_tree", json!("tree")),
        ),
        sent(
            &format!("{ACTION}_SendGoal_Response"),
            &SendGoalResponse { accepted: true, stamp: stamp.clone() },
            ("/stamp/sec", json!(1_800_000_000)),
        ),
        sent(
            &format!("{ACTION}_GetResult_Request"),
            &GetResultRequest { goal_id: UUID },
            ("/goal_id/uuid/1", json!(1)),
        ),
        sent(
            &format!("{ACTION}_GetResult_Response"),
            &GetResultResponse { status: 6, error_code: 9000, error_msg: "no path".into() },
            ("/result", json!({ "error_code": 9000, "error_msg": "no path" })),
        ),
        sent(
            "diagnostic_msgs/msg/DiagnosticArray",
            &diagnostics(),
            ("/status/1/values/1/value", json!("xyz")),
        ),
    ];
    let ranges = robot.ranges(&stamp, &[None, Some(25.0), None, None, None, None], &[Some(1.0); 6]);
    for (range, value) in ranges.iter().flatten().zip([json!("inf"), json!(0.25), json!("inf")]) {
        all.push(sent("sensor_msgs/msg/Range", range, ("/range", value)));
    }
    let feedback = NavigateFeedback {
        goal_id: UUID,
        current_pose: goal(),
        navigation_time: xtb_ros2::types::Duration::from_s(1.5),
        number_of_recoveries: 3,
        distance_remaining: 2.5,
        ..NavigateFeedback::default()
    };
    for (distro, store) in RELEASES {
        let bytes = distro.feedback(feedback.clone(), 0.125, -0.5);
        let check = match distro {
            Distro::Lyrical => ("/feedback/heading_tracking_error", json!(-0.5)),
            _ => ("/feedback/distance_remaining", json!(2.5)),
        };
        all.push(Sent { name: format!("{ACTION}_FeedbackMessage"), store, bytes, check });
    }
    all
}

fn diagnostics() -> DiagnosticArray {
    let value = |key: &str, value: &str| KeyValue { key: key.into(), value: value.into() };
    let status = |name: &str| DiagnosticStatus {
        level: 1,
        name: name.into(),
        values: vec![value("a", ""), value("bc", "xyz")],
        ..DiagnosticStatus::default()
    };
    DiagnosticArray { header: header(""), status: vec![status("xtb_1: a"), status("xtb_1: bc")] }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn asked(sent: &[Sent]) -> Value {
    let messages = sent.iter().map(|it| json!({ "name": it.name, "store": it.store, "hex": hex(&it.bytes) }));
    json!({ "types": [], "messages": messages.collect::<Vec<_>>() })
}

#[test]
fn rosbags_decodes_what_is_written_here_and_writes_the_same_bytes() {
    let sent = messages();
    let Some(answer) = ROSBAGS.judged(&asked(&sent)) else { return };
    for (ours, theirs) in sent.iter().zip(answer["messages"].as_array().unwrap()) {
        assert_eq!(theirs["hex"], hex(&ours.bytes), "{}", ours.name);
        let (place, expected) = &ours.check;
        assert_eq!(theirs["value"].pointer(place), Some(expected), "{}: {theirs}", ours.name);
    }
}

#[test]
fn the_genuine_type_support_decodes_what_is_written_here_and_every_vector() {
    let sent = messages();
    let Some(answer) = RCLPY.judged(&asked(&sent)) else { return };
    let mut known = 0;
    for (ours, theirs) in sent.iter().zip(answer["messages"].as_array().unwrap()) {
        if theirs["value"].is_null() {
            continue;
        }
        let (place, expected) = &ours.check;
        let hidden = theirs["value"] == json!({}); // the one byte of an empty request
        assert!(hidden || theirs["value"].pointer(place) == Some(expected), "{}: {theirs}", ours.name);
        assert_eq!(theirs["same"], true, "{theirs}");
        known += 1;
    }
    assert!(known >= 10, "{known} messages");

    let vectors: Value = serde_json::from_str(include_str!("data/cdr-vectors.json")).unwrap();
    let vectors = vectors.as_object().unwrap().iter();
    let asked = vectors.map(|(name, it)| json!({ "name": name, "store": "kilted", "hex": it["cdr_hex"] }));
    let asked = json!({ "types": [], "messages": asked.collect::<Vec<_>>() });
    let (genuine, rosbags) = (RCLPY.judged(&asked).unwrap(), ROSBAGS.judged(&asked));
    for (index, theirs) in genuine["messages"].as_array().unwrap().iter().enumerate() {
        let missing = theirs["value"].is_null();
        assert!(missing || theirs["same"] == true, "{theirs}");
        let hidden = missing || theirs["value"] == json!({});
        if let Some(rosbags) = rosbags.as_ref().filter(|_| !hidden) {
            assert_eq!(rosbags["messages"][index]["value"], theirs["value"]);
        }
    }
}
