//! VDA 5050 as its users run it: mosquitto, the bridge as a process that may be killed, and a master control that
//! sees everything on the broker.

use crate::processes::{Process, Signal, program};
use crate::{LOOK_EVERY, PATIENCE, eventually};
use rumqttc::{AsyncClient, Event, MqttOptions, Packet, QoS};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::net::TcpStream;
use tokio::task::JoinHandle;

/// Longest packet of a test, in bytes.
const MAX_PACKET: usize = 4 << 20;

/// mosquitto on a free port of this computer.
pub struct Mosquitto {
    process: Process,
    config: PathBuf,
    program: PathBuf,
    /// Its port.
    pub port: u16,
    _folder: tempfile::TempDir,
}

/// Where mosquitto is, if it is anywhere.
#[must_use]
pub fn mosquitto() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    // Debian puts it where only root looks.
    let folders = std::env::split_paths(&path).chain([PathBuf::from("/usr/sbin")]);
    folders.map(|folder| folder.join("mosquitto")).find(|program| program.is_file())
}

impl Mosquitto {
    /// Starts it; `None` = there is none.
    ///
    /// # Panics
    /// If it does not start.
    pub async fn start() -> Option<Self> {
        Self::start_with("allow_anonymous true\n", &[]).await
    }

    /// The same with these lines in its configuration, and these files beside it.
    ///
    /// # Panics
    /// If it does not start.
    pub async fn start_with(lines: &str, files: &[(&str, &str)]) -> Option<Self> {
        let program = mosquitto()?;
        let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap_or_else(|error| panic!("{error}"));
        }
        let free = TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr());
        let port = free.unwrap_or_else(|error| panic!("{error}")).port();
        let config = folder.path().join("mosquitto.conf");
        let lines = lines.replace("FOLDER", &folder.path().display().to_string());
        // As root it would become another user, who may not read the folder.
        let text = format!("listener {port} 127.0.0.1\npersistence false\nuser root\n{lines}");
        std::fs::write(&config, text).unwrap_or_else(|error| panic!("{error}"));
        let process = Self::run(&program, &config, port).await;
        Some(Self { process, config, program, port, _folder: folder })
    }

    async fn run(program: &Path, config: &Path, port: u16) -> Process {
        let process = Process::start(Command::new(program).arg("-c").arg(config).stdout(Stdio::null()));
        eventually("mosquitto", || async { TcpStream::connect(("127.0.0.1", port)).await.ok() }).await;
        process
    }

    /// `kill -9`.
    pub fn kill(&mut self) {
        self.process.signal(Signal::Kill);
        let _ = self.process.0.wait();
    }

    /// Starts it again at the same port. What was retained is gone.
    pub async fn restart(&mut self) {
        self.process = Self::run(&self.program, &self.config, self.port).await;
    }

    /// Its URL.
    #[must_use]
    pub fn url(&self) -> String {
        format!("mqtt://127.0.0.1:{}", self.port)
    }
}

/// `fleet-cli vda5050 serve` as a process.
pub struct BridgeProcess {
    process: Process,
    arguments: Vec<String>,
}

impl BridgeProcess {
    /// Starts it and waits until it is ready.
    ///
    /// # Panics
    /// If it does not start.
    #[must_use]
    pub fn start(endpoint: &str, mqtt: &str, state: &Path, more: &[&str]) -> Self {
        let state = state.display().to_string();
        let arguments =
            ["--json", "vda5050", "serve", "--connect", endpoint, "--mqtt", mqtt, "--state", &state];
        let arguments: Vec<String> =
            arguments.iter().chain(more).map(|&argument| argument.to_owned()).collect();
        Self { process: Self::run(&arguments), arguments }
    }

    fn run(arguments: &[String]) -> Process {
        let (process, line) = Process::start_ready(Command::new(program("fleet-cli")).args(arguments));
        assert!(line.starts_with("{\"ready\":true"), "the bridge says {line:?}");
        process
    }

    /// Starts it, ends it when it has said something about its broker, and returns how often it was connected to it;
    /// and what it said. Where it `may`, that is until a message of its robot is out.
    ///
    /// # Panics
    /// If it does not start or end.
    #[must_use]
    pub fn try_for(endpoint: &str, mqtt: &str, state: &Path, more: &[&str], may: bool) -> (u64, String) {
        let state = state.display().to_string();
        let mut command = Command::new(program("fleet-cli"));
        command.args([
            "--json",
            "vda5050",
            "serve",
            "--connect",
            endpoint,
            "--mqtt",
            mqtt,
            "--state",
            &state,
        ]);
        command.args(more).env_clear().env("RUST_LOG", "xtb_services=debug").stdin(Stdio::null());
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("{error}"));
        let mut errors = BufReader::new(child.stderr.take().unwrap_or_else(|| panic!("no errors")));
        let wanted = if may { "the broker has accepted" } else { "no connection to the broker" };
        let mut said = String::new();
        while !said.contains(wanted) && errors.read_line(&mut said).is_ok_and(|bytes| bytes > 0) {}
        let mut process = Process(child);
        process.signal(Signal::Interrupt);
        let mut output = String::new();
        if let Some(mut stdout) = process.0.stdout.take() {
            let _ = stdout.read_to_string(&mut output);
        }
        let ended: Value =
            output.lines().last().and_then(|line| serde_json::from_str(line).ok()).unwrap_or_default();
        (ended["connected"].as_u64().unwrap_or(0), format!("{said}{output}"))
    }

    /// `kill -9`.
    pub fn kill(&mut self) {
        self.process.signal(Signal::Kill);
        let _ = self.process.0.wait();
    }

    /// Ctrl-C, until it has ended.
    ///
    /// # Panics
    /// If its exit code is not 0.
    pub fn interrupt(&mut self) {
        self.process.signal(Signal::Interrupt);
        let status = self.process.0.wait().unwrap_or_else(|error| panic!("{error}"));
        assert!(status.success(), "{status}");
    }

    /// Starts it again with what it has kept.
    pub fn restart(&mut self) {
        self.process = Self::run(&self.arguments);
    }
}

#[derive(Debug, Clone)]
struct Heard {
    topic: String,
    message: Value,
}

/// A master control that hears everything.
pub struct Master {
    client: AsyncClient,
    heard: Arc<Mutex<Vec<Heard>>>,
    polling: JoinHandle<()>,
    prefix: String,
}

impl Drop for Master {
    fn drop(&mut self) {
        self.polling.abort();
    }
}

impl Master {
    /// Connects, again and again if the broker goes. `prefix` is such as `uagv/v2/xtb`.
    pub async fn connect(port: u16, prefix: &str) -> Self {
        let mut options = MqttOptions::new(format!("master-{port}"), "127.0.0.1", port);
        options.set_max_packet_size(MAX_PACKET, MAX_PACKET);
        let (client, mut events) = AsyncClient::new(options, 64);
        let heard = Arc::<Mutex<Vec<Heard>>>::default();
        let (list, subscribing) = (heard.clone(), client.clone());
        let polling = tokio::spawn(async move {
            loop {
                match events.poll().await {
                    Ok(Event::Incoming(Packet::ConnAck(_))) => {
                        let _ = subscribing.try_subscribe("#", QoS::AtLeastOnce);
                    }
                    Ok(Event::Incoming(Packet::Publish(publish))) => {
                        let message = serde_json::from_slice(&publish.payload).unwrap_or(Value::Null);
                        let heard = Heard { topic: publish.topic, message };
                        list.lock().unwrap_or_else(PoisonError::into_inner).push(heard);
                    }
                    Ok(_) => {}
                    Err(_) => tokio::time::sleep(Duration::from_millis(50)).await,
                }
            }
        });
        let master = Self { client, heard, polling, prefix: prefix.to_owned() };
        // It hears itself: it is subscribed then.
        master.publish("self", &json!({})).await;
        master.until_heard("self").await;
        master
    }

    async fn until_heard(&self, end: &str) {
        eventually("the master's subscription", || async {
            if self.last(end).is_none() {
                self.publish(end, &json!({})).await;
            }
            self.last(end)
        })
        .await;
    }

    /// Publishes, such as on `xtb-1/order`.
    ///
    /// # Panics
    /// If its connection has ended.
    pub async fn publish(&self, end: &str, message: &Value) {
        let topic = format!("{}/{end}", self.prefix);
        let sent = self.client.publish(topic, QoS::AtMostOnce, false, message.to_string()).await;
        sent.unwrap_or_else(|error| panic!("{error}"));
    }

    /// All messages on a topic so far.
    #[must_use]
    pub fn all(&self, end: &str) -> Vec<Value> {
        let topic = format!("{}/{end}", self.prefix);
        let heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        heard.iter().filter(|heard| heard.topic == topic).map(|heard| heard.message.clone()).collect()
    }

    /// The last one.
    #[must_use]
    pub fn last(&self, end: &str) -> Option<Value> {
        self.all(end).pop()
    }

    /// Waits for a state of a robot.
    ///
    /// # Panics
    /// If it does not come in time; says the last one.
    pub async fn state(&self, robot: &str, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        let end = format!("{robot}/state");
        let give_up = Instant::now() + PATIENCE;
        loop {
            let last = self.last(&end);
            if let Some(state) = last.as_ref().filter(|state| is(state)) {
                return state.clone();
            }
            assert!(Instant::now() < give_up, "waited in vain for: {what}; the last state is {last:?}");
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }
}

/// An order of a version 2.1: nodes at these places of a map, so many of them released; the first one has this
/// sequenceId.
#[must_use]
pub fn order(id: &str, update: u32, first: usize, map: &str, places: &[(f64, f64)], base: usize) -> Value {
    let name = |i: usize| format!("n{}", first / 2 + i);
    let nodes: Vec<Value> = places
        .iter()
        .enumerate()
        .map(|(i, (x, y))| {
            json!({"nodeId": name(i), "sequenceId": first + 2 * i, "released": i < base, "actions": [],
                   "nodePosition": {"x": x, "y": y, "mapId": map}})
        })
        .collect();
    let edges: Vec<Value> = (1..places.len())
        .map(|i| {
            json!({"edgeId": format!("e{}", first / 2 + i), "sequenceId": first + 2 * i - 1, "released": i < base,
                   "startNodeId": name(i - 1), "endNodeId": name(i), "actions": []})
        })
        .collect();
    json!({"headerId": 1, "timestamp": "2026-09-21T14:13:20.123Z", "version": "2.1.0", "manufacturer": "xtb",
           "serialNumber": "xtb-1", "orderId": id, "orderUpdateId": update, "nodes": nodes, "edges": edges})
}
