//! VDA 5050 over mosquitto: foreign master controls drive, and whatever is killed, no node is driven twice.

use fleet_tests::dispatch::{Serve, Witness};
use fleet_tests::processes::program;
use fleet_tests::vda5050::{BridgeProcess, Master, Mosquitto, order};
use fleet_tests::{Fleet, Setup, eventually};
use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use xtb_client::fake::FakeRobot;
use xtb_client::{Client, Settings};

const PLACES: [(f64, f64); 4] = [(0.0, 0.0), (0.0, 1.2), (0.0, 2.4), (0.0, 3.4)];

#[allow(clippy::print_stderr)] // people who run the tests shall see it
fn skip(why: &str) {
    eprintln!("SKIP: {why}");
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// A Python that has these modules, if there is one.
fn python(modules: &str) -> Option<PathBuf> {
    let candidates = std::env::var_os("XTB_PYTHON").into_iter().chain(["python3".into()]);
    candidates.map(PathBuf::from).find(|python| {
        let import =
            Command::new(python).args(["-c", &format!("import {modules}")]).stderr(Stdio::null()).status();
        import.is_ok_and(|status| status.success())
    })
}

/// Where the modules of Node are that have vda-5050-lib, if there are any: `XTB_NODE_MODULES`.
fn node_modules() -> Option<PathBuf> {
    let modules = PathBuf::from(std::env::var_os("XTB_NODE_MODULES")?);
    let has_node = Command::new("node").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    (modules.join("vda-5050-lib").is_dir() && has_node.is_ok_and(|status| status.success()))
        .then_some(modules)
}

/// Checks everything on the broker against the official schemas until it is asked; `None` = no Python for that.
struct Schemas(Child);

impl Schemas {
    fn listen(broker: &Mosquitto) -> Option<Self> {
        let Some(python) = python("jsonschema, paho.mqtt.client") else {
            skip(
                "no Python with jsonschema and paho-mqtt: what goes over the broker is not checked with them",
            );
            return None;
        };
        let mut child = Command::new(python)
            .arg(folder("vda5050/schemas.py"))
            .args(["127.0.0.1", &broker.port.to_string()])
            .arg(folder("../core/vda5050/tests/data"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        output.read_line(&mut line).unwrap();
        assert_eq!(line, "listening\n");
        child.stdout = Some(output.into_inner());
        Some(Self(child))
    }

    /// Every message so far fits its schema.
    fn assert_kept(mut self) {
        drop(self.0.stdin.take());
        let mut text = String::new();
        self.0.stdout.take().unwrap().read_to_string(&mut text).unwrap();
        self.0.wait().unwrap();
        let said: Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(said["faults"], json!([]), "{said}");
        assert!(said["messages"]["state"].as_u64().unwrap() > 5, "{said}");
    }
}

/// One robot, its dispatcher, a broker and the bridge between them.
struct Scene {
    fleet: Fleet,
    serve: Serve,
    witness: Witness,
    broker: Mosquitto,
    bridge: BridgeProcess,
    _folder: tempfile::TempDir,
}

impl Scene {
    async fn start(protocol: &str) -> Option<Self> {
        let Some(broker) = Mosquitto::start().await else {
            skip("no mosquitto: VDA 5050 was not tried over a broker");
            return None;
        };
        // A robot that stands and waits for long is not sure enough of its place without them.
        let fixes = xtb_sim::fixes::FixTruth { rate_hz: 2.0, ..Default::default() };
        let fleet = Fleet::start(Setup { speed: 4.0, fixes, ..Setup::default() }).await;
        let folder = tempfile::tempdir().unwrap();
        let serve = Serve::start(fleet.simulator.endpoint(), &folder.path().join("lab.ledger"));
        let witness = Witness::listen(&fleet.bus).await;
        let state = folder.path().join("vda5050");
        let protocol = ["--protocol", protocol];
        let bridge = BridgeProcess::start(fleet.simulator.endpoint(), &broker.url(), &state, &protocol);
        Some(Self { fleet, serve, witness, broker, bridge, _folder: folder })
    }

    /// Goals that were reached; none twice.
    fn reached(&self) -> usize {
        let reached: Vec<_> = self.witness.reached().into_iter().map(|reached| reached.goal).collect();
        let different: BTreeSet<_> = reached.iter().collect();
        assert_eq!(reached.len(), different.len(), "a drive was repeated");
        reached.len()
    }

    /// A person's command, until it is carried out: the dispatcher keeps its lease for a second.
    async fn run(&self, arguments: &[&str]) {
        eventually(arguments[0], || async { self.try_to(arguments).await.then_some(()) }).await;
    }

    async fn try_to(&self, arguments: &[&str]) -> bool {
        let mut command = Command::new(program("fleet-cli"));
        command
            .args(arguments)
            .args(["--connect", self.fleet.simulator.endpoint()])
            .env_clear()
            .stdin(Stdio::null());
        let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
        output.status.success()
    }

    /// Lets a foreign master control drive.
    async fn drive_by(&self, command: &mut Command) -> Vec<Value> {
        command.args([&self.broker.url(), "xtb", "xtb-1"]).stdin(Stdio::null()).stderr(Stdio::inherit());
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let read = move || {
            let mut text = String::new();
            child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
            (child.wait().unwrap(), text)
        };
        let (status, text) = tokio::task::spawn_blocking(read).await.unwrap();
        let lines: Vec<Value> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        let ok = lines.last().is_some_and(|last| last["ok"] == true);
        assert!(status.success() && ok, "{status}: {text}");
        lines
    }
}

fn map_of(state: &Value) -> String {
    state["agvPosition"]["mapId"].as_str().unwrap().to_owned()
}

/// `n3`, when nothing of the order is left.
fn ended_at(node: &'static str) -> impl Fn(&Value) -> bool {
    move |state| state["lastNodeId"] == node && state["nodeStates"] == json!([])
}

#[tokio::test(flavor = "multi_thread")]
async fn the_master_of_vda_5050_lib_drives_a_robot() {
    let Some(modules) = node_modules() else {
        return skip("no XTB_NODE_MODULES with vda-5050-lib, or no node: it was not the master control");
    };
    let Some(scene) = Scene::start("2.0").await else { return };
    let schemas = Schemas::listen(&scene.broker);
    let mut node = Command::new("node");
    node.arg(folder("vda5050/vda_5050_lib.js")).env("NODE_PATH", modules);
    let said = scene.drive_by(&mut node).await;
    assert_eq!(said.len(), 4, "{said:?}");
    // Three of the first order; the second one was cancelled, the third one may not have ended.
    assert!((3..=4).contains(&scene.reached()));
    if let Some(schemas) = schemas {
        schemas.assert_kept();
    }
    scene.fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_master_of_vda5050_sdk_drives_a_robot() {
    let Some(python) = python("vda5050, aiomqtt") else {
        return skip("no Python with vda5050-sdk and aiomqtt: it was not the master control");
    };
    let Some(scene) = Scene::start("2.1").await else { return };
    let schemas = Schemas::listen(&scene.broker);
    let mut command = Command::new(python);
    command.arg(folder("vda5050/vda5050_sdk.py"));
    let said = scene.drive_by(&mut command).await;
    assert_eq!((said.len(), scene.reached()), (4, 2), "{said:?}");
    if let Some(schemas) = schemas {
        schemas.assert_kept();
    }
    scene.fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_is_killed_an_order_goes_on_and_no_node_is_driven_twice() {
    let Some(mut scene) = Scene::start("2.1").await else { return };
    let schemas = Schemas::listen(&scene.broker);
    let master = Master::connect(scene.broker.port, "uagv/v2/xtb").await;
    let first =
        master.state("xtb-1", "a state", |state| state["agvPosition"]["positionInitialized"] == true).await;
    let map = map_of(&first);
    master.publish("xtb-1/order", &order("killed", 0, 0, &map, &PLACES, 3)).await;
    master
        .state("xtb-1", "the order", |state| state["orderId"] == "killed" && state["driving"] == true)
        .await;
    scene.bridge.kill();
    // The broker says so by itself.
    let broken = |last: Option<Value>| last.filter(|last| last["connectionState"] == "CONNECTIONBROKEN");
    eventually("the last will", || async { broken(master.last("xtb-1/connection")) }).await;
    scene.bridge.restart();
    master.state("xtb-1", "the first node", |state| state["lastNodeId"] == "n1").await;
    scene.serve.kill();
    // An update that nobody can take yet.
    let update = order("killed", 1, 4, &map, &PLACES[2..], 2);
    master.publish("xtb-1/order", &update).await;
    master
        .state("xtb-1", "no dispatcher", |state| state["errors"][0]["errorType"] == "dispatcherUnreachable")
        .await;
    scene.bridge.kill();
    scene.bridge.restart();
    scene.serve.restart();
    master.state("xtb-1", "the update", |state| state["orderUpdateId"] == 1).await;
    if let Some(schemas) = schemas {
        schemas.assert_kept();
    }
    scene.broker.kill();
    scene.broker.restart().await;
    master.state("xtb-1", "the end", ended_at("n3")).await;
    assert_eq!(scene.reached(), 3);
    // The same order again is the same order.
    master.publish("xtb-1/order", &update).await;
    master
        .publish(
            "xtb-1/instantActions",
            &json!({"actions": [{"actionType": "stateRequest", "actionId": "s"}]}),
        )
        .await;
    let state =
        master.state("xtb-1", "the action", |state| state["actionStates"][0]["actionId"] == "s").await;
    assert_eq!((&state["errors"], scene.reached()), (&json!([]), 3));
    scene.fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_master_of_3_0_extends_pauses_and_is_told_of_an_emergency_stop() {
    let Some(scene) = Scene::start("3.0").await else { return };
    let schemas = Schemas::listen(&scene.broker);
    let master = Master::connect(scene.broker.port, "vda5050/v3/xtb").await;
    let localized = |state: &Value| state["mobileRobotPosition"]["localized"] == true;
    let first = master.state("xtb-1", "a state", localized).await;
    let map = first["mobileRobotPosition"]["mapId"].as_str().unwrap().to_owned();
    let act = async |kind: &str| {
        let action = json!({"actionType": kind, "actionId": kind, "blockingType": "NONE"});
        master.publish("xtb-1/instantActions", &json!({"actions": [action]})).await;
        let is_finished = |state: &Value| {
            let states = state["instantActionStates"].as_array().unwrap();
            states.iter().any(|state| state["actionId"] == kind && state["actionStatus"] == "FINISHED")
        };
        master.state("xtb-1", kind, is_finished).await
    };
    master.publish("xtb-1/order", &order("three", 0, 0, &map, &PLACES[..3], 2)).await;
    master
        .state("xtb-1", "the order", |state| state["driving"] == true && state["newBaseRequest"] == true)
        .await;
    master.publish("xtb-1/order", &order("three", 1, 2, &map, &PLACES[1..], 3)).await;
    let state = master.state("xtb-1", "the update", |state| state["orderUpdateId"] == 1).await;
    assert_eq!(state["nodeStates"].as_array().unwrap().len(), 3, "{state}");
    let state = act("startPause").await;
    assert_eq!((&state["paused"], &state["driving"]), (&json!(true), &json!(false)));
    act("stopPause").await;
    master.state("xtb-1", "driving again", |state| state["driving"] == true).await;
    // A stop of this robot keeps the order; after the reset it goes on by itself.
    scene.run(&["estop", "xtb-1"]).await;
    let stopped = |state: &Value| state["safetyState"]["activeEmergencyStop"] == "REMOTE";
    let state = master.state("xtb-1", "the stop", stopped).await;
    assert_eq!(
        (&state["errors"][0]["errorType"], &state["errors"][0]["errorLevel"]),
        (&json!("estop"), &json!("FATAL"))
    );
    scene.run(&["reset", "xtb-1"]).await;
    let state = master.state("xtb-1", "the end", ended_at("n3")).await;
    assert_eq!((&state["lastNodeSequenceId"], scene.reached()), (&json!(6), 3));
    act("factsheetRequest").await;
    assert!(master.last("xtb-1/factsheet").is_some_and(|sheet| sheet["physicalParameters"]["length"] != 0.0));
    if let Some(schemas) = schemas {
        schemas.assert_kept();
    }
    scene.fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn fifty_robots_have_fifty_wills() {
    const ROBOTS: usize = 50;
    let Some(broker) = Mosquitto::start().await else { return skip("no mosquitto: no last will was seen") };
    let fleet = Fleet::start(Setup::default()).await;
    let connect = vec![fleet.simulator.endpoint().to_owned()];
    let client = Client::open(&Settings { connect, ..Settings::new("lab").unwrap() }).await.unwrap();
    let mut robots = Vec::new();
    for i in 1..=ROBOTS {
        robots.push(FakeRobot::start(&client, &format!("wagon-{i}")).await);
    }
    let folder = tempfile::tempdir().unwrap();
    let master = Master::connect(broker.port, "vda5050/v3/lab").await;
    let more = ["--protocol", "3.0", "--manufacturer", "lab"];
    let mut bridge = BridgeProcess::start(fleet.simulator.endpoint(), &broker.url(), folder.path(), &more);
    let all = async |said: &str| {
        eventually(said, || async {
            let is = |i| {
                let last = master.last(&format!("wagon-{i}/connection"));
                last.is_some_and(|last| {
                    last["connectionState"] == said && last["serialNumber"] == format!("wagon-{i}")
                })
            };
            (1..=ROBOTS).all(is).then_some(())
        })
        .await;
    };
    all("ONLINE").await;
    bridge.kill();
    all("CONNECTION_BROKEN").await;
    bridge.restart();
    all("ONLINE").await;
    // One robot is gone, the bridge is not.
    robots.pop();
    eventually("one that is gone", || async {
        master.last("wagon-50/connection").filter(|last| last["connectionState"] == "CONNECTION_BROKEN")
    })
    .await;
    assert_eq!(master.last("wagon-1/connection").unwrap()["connectionState"], "ONLINE");
    bridge.interrupt();
    all("OFFLINE").await;
    fleet.end().await;
}

/// A certificate authority, and the certificate and key of a broker on this computer, in PEM.
fn certificates() -> [String; 3] {
    let (ca_key, key) = (KeyPair::generate().unwrap(), KeyPair::generate().unwrap());
    let mut ca = CertificateParams::new(Vec::new()).unwrap();
    ca.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let ca_pem = ca.self_signed(&ca_key).unwrap().pem();
    let broker = CertificateParams::new(vec!["127.0.0.1".to_owned()]).unwrap();
    let broker = broker.signed_by(&key, &Issuer::new(ca, ca_key)).unwrap();
    [ca_pem, broker.pem(), key.serialize_pem()]
}

#[tokio::test(flavor = "multi_thread")]
async fn a_broker_with_login_and_tls_hears_only_who_may_and_only_the_right_one_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let [users, password, wrong, ca, other] =
        ["users", "password", "wrong", "ca.pem", "other.pem"].map(|name| folder.path().join(name));
    let made =
        Command::new("mosquitto_passwd").arg("-c").arg("-b").arg(&users).args(["fleet", "secret"]).status();
    if !made.is_ok_and(|status| status.success()) {
        return skip("no mosquitto_passwd: login and TLS were not tried");
    }
    let [authority, certificate, key] = certificates();
    std::fs::write(&password, "secret\n").unwrap();
    std::fs::write(&wrong, "guess\n").unwrap();
    std::fs::write(&ca, &authority).unwrap();
    std::fs::write(&other, &certificates()[0]).unwrap();
    let lines = format!(
        "allow_anonymous false\npassword_file {}\ncertfile FOLDER/cert.pem\nkeyfile FOLDER/key.pem\n",
        users.display()
    );
    let files = [("cert.pem", certificate.as_str()), ("key.pem", key.as_str())];
    let Some(broker) = Mosquitto::start_with(&lines, &files).await else {
        return skip("no mosquitto: login and TLS were not tried");
    };
    let fleet = Fleet::start(Setup::default()).await;
    let url = format!("mqtts://127.0.0.1:{}", broker.port);
    for (password, ca, may) in [(&wrong, &ca, false), (&password, &other, false), (&password, &ca, true)] {
        let (password, ca) = (password.display().to_string(), ca.display().to_string());
        let more = ["--mqtt-user", "fleet", "--mqtt-password-file", &password, "--mqtt-ca", &ca];
        let state = folder.path().join("state");
        let (connected, said) = BridgeProcess::try_for(fleet.simulator.endpoint(), &url, &state, &more, may);
        assert_eq!(connected > 0, may, "{said}");
    }
    fleet.end().await;
}
