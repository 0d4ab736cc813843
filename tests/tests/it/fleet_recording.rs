//! Recordings of the fleet, made by the real `fleet-cli record` and read by others: Python's own package,
//! and our reader after a `kill -9`.

use fleet_cli::recording::playback_worker::{PlaySettings, PlaybackWorker};
use fleet_tests::processes::{Process, RouterProcess, Signal, program};
use fleet_tests::{Fleet, Setup, eventually, name};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use xtb_bus::{Bus, Publisher, SessionRole};
use xtb_control::frames::MapPose;
use xtb_protocol::Uuid;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{
    Body, DispatchBody, DispatchRequest, Estop, Event, EventKind, Fix, FixSource, FleetMap, MapCell, MapHash,
    Message, Request, Roster, RosterEntry, Route, Setpoint, TaskEvent, TaskId, TaskKind, TaskList, TaskSpec,
    TaskState, TaskStep, TaskView, TrafficState, Waypoint, Who,
};
use xtb_recording::fleet::reader::{Recorded, RecordingReader};

/// `fleet-cli record` of fleet `lab`, and the end of its life.
struct Recording {
    process: Process,
    file: PathBuf,
}

impl Recording {
    fn start(endpoint: &str, file: &Path, more: &[&str]) -> Self {
        let mut command = Command::new(program("fleet-cli"));
        command.args(["--json", "--connect", endpoint, "record", "--out"]).arg(file).args(more);
        let (process, line) = Process::start_ready(&mut command);
        assert!(line.contains("\"ready\":true"), "{line}");
        Self { process, file: file.to_owned() }
    }

    /// Ctrl-C; how long it took to end.
    fn end(&mut self) -> Duration {
        let began = Instant::now();
        self.process.signal(Signal::Interrupt);
        let status = self.process.0.wait().unwrap();
        assert!(status.success(), "{status}");
        began.elapsed()
    }

    fn messages(&self) -> (Vec<Recorded>, Option<String>) {
        let mut reader = RecordingReader::open(&self.file).unwrap();
        let mut messages = Vec::new();
        while let Some(message) = reader.next_message().unwrap() {
            messages.push(message);
        }
        (messages, reader.cut_because().map(str::to_owned))
    }
}

async fn client(endpoint: &str) -> Bus {
    xtb_bus::open(&SessionRole::Client { connect: vec![endpoint.to_owned()] }).await.unwrap()
}

/// A Python with the packages `mcap` and `jsonschema`, if there is one.
fn python() -> Option<PathBuf> {
    let candidates = std::env::var_os("XTB_PYTHON").into_iter().chain(["python3".into()]);
    candidates.map(PathBuf::from).find(|python| {
        let import =
            Command::new(python).args(["-c", "import mcap, jsonschema"]).stderr(Stdio::null()).status();
        import.is_ok_and(|status| status.success())
    })
}

/// What `docs/examples/recording.py` says of a file.
fn independent(python: &Path, file: &Path) -> Value {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let example = docs.join("examples/recording.py");
    let code = std::fs::read_to_string(&example).unwrap();
    let page = std::fs::read_to_string(docs.join("fleet-recordings.md")).unwrap();
    assert!(page.contains(code.trim()), "docs/fleet-recordings.md does not hold the example as it is");
    let output = Command::new(python).arg(example).arg(file).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Waits until a publisher is heard.
async fn heard<M: Message>(publisher: &Publisher<M>) {
    eventually("a listener", || async { publisher.has_listeners().await.then_some(()) }).await;
}

async fn put<M: Message>(bus: &Bus, key: &str, channel: &Channel, message: &M, format: Format) {
    bus.put(key, channel, message, format).await.unwrap();
}

/// One of each message that is published, on its key; returns the keys.
async fn one_of_each(bus: &Bus, keys: &FleetKeys, format: Format) -> Vec<String> {
    let me = name("me");
    let robot = keys.robot(&name("ghost"));
    let id = Uuid::from_u128(7);
    let at = Waypoint { x_m: 1.0, y_m: 2.0, yaw_rad: None };
    let spec = TaskSpec { who: Who::Tag("red".into()), ..TaskSpec::new(TaskKind::Goto { to: at }) };
    let step = TaskStep {
        at_ms: 5,
        state: TaskState::Failed,
        robot: None,
        legs_done: 0,
        reason: Some("why".into()),
    };
    let task = TaskView {
        id: TaskId::new(3),
        state: TaskState::Queued,
        since_ms: 1,
        reason: None,
        robot: Some(name("ghost")),
        map: None,
        legs_done: 0,
        legs: None,
        failures: 0,
        by: me.clone(),
        submitted_ms: 1,
        spec: spec.clone(),
    };
    let map = FleetMap {
        name: "floor".into(),
        hash: MapHash::new(9),
        resolution_m: 0.1,
        origin_m: [0.0, 0.0],
        width: 2,
        height: 2,
        cells: vec![(MapCell::Occupied, 3), (MapCell::Free, 1)],
        zones: Vec::new(),
    };
    let fix = Fix {
        x_m: 0.0,
        y_m: 0.0,
        yaw_rad: None,
        sigma_m: 0.1,
        sigma_yaw_rad: 0.1,
        source: FixSource::Uwb,
        age_ms: 0,
    };
    let route = Route {
        epoch: 1,
        seq: 1,
        goal: None,
        track: None,
        plan: 0,
        release_m: 0.0,
        cruise_mps: 0.1,
        waits_for: None,
        reason: None,
        others: vec![MapPose::default()],
    };
    let traffic = TrafficState {
        epoch: 1,
        seq: 1,
        map_hash: "0".into(),
        led: vec![me.clone()],
        obstacles: vec![],
        plans: 1,
    };
    let latch = EventKind::Latch { latch: xtb_protocol::messages::Latch::Estop, set: true, by: "me".into() };
    let event = Event { robot: name("ghost"), epoch: 1, seq: 1, tick_ms: 1, kind: latch };
    let setpoint = Setpoint { lease: None, seq: 1, echo_tick_ms: None, rpm: 1.0, steering: 0.5 };
    let request = Request { id, lease: None, body: Body::Acquire { take: false } };
    let submit = DispatchRequest { id, body: DispatchBody::Submit { tasks: vec![spec] } };
    let roster = Roster { robots: vec![RosterEntry { name: me.clone(), tags: vec![], start_pose: None }] };
    let list = TaskList {
        ledger: 1,
        at_ms: 1,
        ledger_failed: None,
        tasks: vec![task],
        left_out: 0,
        suspended: Vec::new(),
    };
    let changed = TaskEvent { ledger: 1, entry: 1, task: TaskId::new(3), step };
    put(bus, &robot.event(), &Channel::Event, &event, format).await;
    put(bus, &robot.fix(), &Channel::Fix, &fix, format).await;
    put(bus, &robot.route(), &Channel::Route, &route, format).await;
    put(bus, &robot.teleop(Some(&me)), &Channel::Teleop(me.clone()), &setpoint, format).await;
    put(bus, &robot.cmd(Some(&me)), &Channel::Cmd(me.clone()), &request, format).await;
    put(bus, &keys.estop_all(Some(&me)), &Channel::EstopAll(me.clone()), &Estop { id }, format).await;
    put(bus, &keys.map(), &Channel::Map, &map, format).await;
    put(bus, &keys.traffic_state(), &Channel::TrafficState, &traffic, format).await;
    put(bus, &keys.sim_roster(), &Channel::SimRoster, &roster, format).await;
    put(bus, &keys.dispatch_cmd(Some(&me)), &Channel::DispatchCmd(me.clone()), &submit, format).await;
    put(bus, &keys.dispatch_tasks(), &Channel::DispatchTasks, &list, format).await;
    put(bus, &keys.dispatch_event(), &Channel::DispatchEvent, &changed, format).await;
    vec![
        robot.event(),
        robot.fix(),
        robot.route(),
        robot.teleop(Some(&me)),
        robot.cmd(Some(&me)),
        keys.estop_all(Some(&me)),
        keys.map(),
        keys.traffic_state(),
        keys.sim_roster(),
        keys.dispatch_cmd(Some(&me)),
        keys.dispatch_tasks(),
        keys.dispatch_event(),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn an_independent_reader_finds_every_topic_schema_and_message() {
    const SENT: u64 = 2000;
    let Some(python) = python() else {
        return eprintln_skip("no Python with the packages mcap and jsonschema: the recording was not read");
    };
    let folder = tempfile::tempdir().unwrap();
    let fleet = Fleet::start(Setup { robots: 2, speed: 1.0, ..Setup::default() }).await;
    let mut recording = Recording::start(fleet.simulator.endpoint(), &folder.path().join("lab.mcap"), &[]);
    let keys = FleetKeys::new(name("lab"));
    let me = name("counter");
    let key = keys.robot(&name("ghost")).teleop(Some(&me));
    // With the care of requests, so that Zenoh drops none on the way.
    let publisher = fleet.bus.publisher::<Setpoint>(&key, &Channel::Cmd(me), Format::Postcard).await.unwrap();
    heard(&publisher).await;
    for seq in 0..SENT {
        let setpoint = Setpoint { lease: None, seq, echo_tick_ms: None, rpm: 1.0, steering: 0.0 };
        publisher.put(&setpoint).await.unwrap();
    }
    let goal = fleet.goto(1, 0.3, 0.3).await;
    fleet.outcome(1, goal).await;
    // An emergency stop is among them.
    let mut others = one_of_each(&fleet.bus, &keys, Format::Postcard).await;
    assert_eq!(others, one_of_each(&fleet.bus, &keys, Format::Json).await);
    // They have to arrive before the end: the last of them is on the disk.
    eventually("the last of them", || async {
        let (messages, _) = recording.messages();
        messages.iter().any(|message| Some(&message.topic) == others.last()).then_some(())
    })
    .await;
    assert!(recording.end() < Duration::from_secs(5));

    let found = independent(&python, &recording.file);
    assert_eq!((&found["wrong"], &found["cut"]), (&Value::Array(Vec::new()), &Value::Null), "{found}");
    let counts = &found["metadata"]["xtb.recording.counts"];
    let count = |name: &str| counts[name].as_str().unwrap().parse::<u64>().unwrap();
    assert_eq!(count("unreadable"), 0, "{found}");
    let of = |topic: &str| {
        found["topics"][topic]["messages"].as_u64().unwrap_or_else(|| panic!("{topic}: {found}"))
    };
    assert_eq!(of(&key) + count("dropped"), SENT, "{found}");
    let all: u64 =
        found["topics"].as_object().unwrap().values().map(|it| it["messages"].as_u64().unwrap()).sum();
    assert_eq!((Some(all), all), (found["messages"].as_u64(), count("messages") + count("derived")));
    for robot in 1..=2 {
        let robot = fleet.robot(robot);
        others.extend([robot.alive(), robot.state(), robot.sensors(), robot.about()]);
        others.push(format!("{}/pose", robot.state()));
    }
    others.extend([keys.sim_truth(), keys.sim_stats(), "foxglove/scene".into(), "foxglove/log".into()]);
    for topic in others {
        assert!(of(&topic) > 0, "{topic}");
    }
    let schema = |topic: &str| found["topics"][topic]["schema"].clone();
    assert_eq!(schema(&fleet.robot(1).state()), "xtb.RobotState");
    assert_eq!(schema(&format!("{}/pose", fleet.robot(1).state())), "foxglove.PoseInFrame");
    assert_eq!(
        (schema("foxglove/scene"), schema("foxglove/log")),
        ("foxglove.SceneUpdate".into(), "foxglove.Log".into())
    );
    assert_eq!(found["metadata"]["xtb.recording"]["fleet"], "lab");
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_kill_costs_at_most_the_last_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let router = RouterProcess::start(None);
    let recording = Recording::start(router.endpoint(), &folder.path().join("lab.mcap"), &[]);
    let bus = client(router.endpoint()).await;
    let me = name("counter");
    let key = FleetKeys::new(name("lab")).robot(&name("ghost")).teleop(Some(&me));
    let publisher = bus.publisher::<Setpoint>(&key, &Channel::Cmd(me), Format::Postcard).await.unwrap();
    heard(&publisher).await;
    // Sent while it is recorded, with when: the kill comes after 3 s.
    let began = Instant::now();
    let mut sent = Vec::new();
    let mut tick = tokio::time::interval(Duration::from_millis(10));
    while began.elapsed() < Duration::from_secs(3) {
        tick.tick().await;
        let seq = sent.len() as u64;
        publisher
            .put(&Setpoint { lease: None, seq, echo_tick_ms: None, rpm: 1.0, steering: 0.0 })
            .await
            .unwrap();
        sent.push(began.elapsed());
    }
    recording.process.signal(Signal::Kill);
    let killed = began.elapsed();
    let (messages, cut) = recording.messages();
    assert!(cut.is_some());
    let kept: Vec<Value> = messages
        .iter()
        .filter(|message| message.topic == key)
        .map(|message| serde_json::from_slice(&message.data).unwrap())
        .collect();
    let in_order = kept.iter().enumerate().all(|(place, setpoint)| setpoint["seq"] == place);
    assert!(in_order && !kept.is_empty(), "{} kept", kept.len());
    // One second of a chunk, and a machine that is busy.
    let missing = killed - sent[kept.len() - 1];
    assert!(missing < Duration::from_millis(2500), "the last {missing:?} are lost");
    if let Some(python) = python() {
        let found = independent(&python, &recording.file);
        assert!(found["cut"].is_string() && found["wrong"] == Value::Array(Vec::new()), "{found}");
        assert_eq!(found["topics"][&key]["messages"], kept.len(), "{found}");
    }
    bus.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_is_played_as_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = Fleet::start(Setup { robots: 2, speed: 4.0, ..Setup::default() }).await;
    let mut recording = Recording::start(fleet.simulator.endpoint(), &folder.path().join("lab.mcap"), &[]);
    let goal = fleet.goto(1, 0.3, 0.6).await;
    fleet.outcome(1, goal).await;
    recording.end();
    let last = fleet.state(1).await;
    fleet.end().await;

    lines_and_tables_hold_every_message(&recording, folder.path());

    let playing =
        PlaybackWorker::open(&recording.file, PlaySettings { speed: 20.0, ..Default::default() }).unwrap();
    let scene = playing.scene();
    eventually("the end", || async { playing.status().ended.then_some(()) }).await;
    let status = playing.status();
    assert_eq!((status.failed, status.unreadable), (None, 0));
    eventually("the last place", || async {
        let scene = scene.lock();
        let state = &scene.robots().get(&name("xtb-1"))?.state.as_ref()?.value;
        ((state.pose.x_m - last.pose.x_m).hypot(state.pose.y_m - last.pose.y_m) < 0.05).then_some(())
    })
    .await;
    let (rewinds, happenings) = (scene.rewinds(), scene.lock().happenings().len());
    assert!(happenings > 3, "{happenings}");
    playing.pause(true);
    playing.seek(200);
    eventually("another scene", || async { (scene.rewinds() > rewinds).then_some(()) }).await;
    eventually("its place", || async { (scene.now_ms() == 200).then_some(()) }).await;
    let robots: Vec<_> = scene.lock().robots().keys().cloned().collect();
    assert!(robots.contains(&name("xtb-1")), "{robots:?}");
}

/// `play --json` and `export --csv` of a recording, as processes.
fn lines_and_tables_hold_every_message(recording: &Recording, folder: &Path) {
    let (messages, cut) = recording.messages();
    assert_eq!(cut, None);
    let count = |schema: &str| messages.iter().filter(|message| message.schema == schema).count();
    let of_ours = messages.iter().filter(|message| message.schema.starts_with("xtb.")).count();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(program("fleet-cli"));
        let output = command.env_clear().args(arguments).arg(&recording.file).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let lines = run(&["--json", "play", "--speed", "1000"]);
    assert_eq!(lines.lines().count(), of_ours);
    let first: Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
    assert!(first["key"].is_string() && first["type"].is_string(), "{first}");

    let tables = folder.join("tables");
    run(&["export", "--csv", "--out", tables.to_str().unwrap()]);
    let table = std::fs::read_to_string(tables.join("RobotState.csv")).unwrap();
    let rows: Vec<&str> = table.split("\r\n").collect();
    // The header, and nothing behind the last line's end.
    assert_eq!(rows.len(), count("xtb.RobotState") + 2);
    let columns: Vec<&str> = rows[0].split(',').collect();
    assert_eq!(columns[..2], ["log_ns", "topic"]);
    assert!(columns.contains(&"pose.x_m") && columns.contains(&"nav.route.release_m"), "{columns:?}");
    assert!(tables.join("Event.csv").exists() && !tables.join("SceneUpdate.csv").exists());
    // What is there already is left alone.
    let mut again = Command::new(program("fleet-cli"));
    let again = again.env_clear().args(["export", "--csv", "--out"]).arg(&tables).arg(&recording.file);
    assert_eq!(again.output().unwrap().status.code(), Some(2));
}

#[allow(clippy::print_stderr)] // people who run the tests shall see it
fn eprintln_skip(why: &str) {
    eprintln!("skipped: {why}");
}
