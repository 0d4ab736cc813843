//! The live scene for the Foxglove app (`dashboard --foxglove`): the same pictures, poses and log as in a
//! recording, over Foxglove's own WebSocket protocol.
//!
//! It only shows: nothing that a viewer sends is taken. Each viewer has a queue of its own in which the
//! oldest goes first, so a slow one misses pictures and holds up nobody. That protocol knows no token,
//! so it is served on the loopback only.

use foxglove::{Context, FoxgloveError, PartialMetadata, RawChannel, Schema, WebSocketServer};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::task::JoinHandle;
use xtb_client::messages::AnyMessage;
use xtb_client::scene::live::SharedScene;
use xtb_client::scene::{Scene, SceneChange, SceneEvent};
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::keys::{Channel, FleetKeys, Key};
use xtb_protocol::messages::MapHash;
use xtb_recording::fleet::drawing::{self, Painter};
use xtb_recording::fleet::{LOG_TOPIC, SCENE_TOPIC, schemas};

/// Between two pictures.
const EVERY: Duration = Duration::from_millis(100);
/// The map is long and seldom changes: for those who have come later it is sent again.
const MAP_EVERY_MS: u64 = 5_000;
/// Messages that wait for a viewer; of more the oldest are dropped.
const BACKLOG: usize = 256;

/// A server for Foxglove, until it is dropped.
pub struct Handle {
    address: SocketAddr,
    server: Option<foxglove::WebSocketServerHandle>,
    task: JoinHandle<()>,
}

impl Handle {
    /// Where it listens: Foxglove opens `ws://ADDRESS`.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.task.abort();
        if let Some(server) = self.server.take() {
            drop(server.stop());
        }
    }
}

/// Serves a scene; port 0 takes a free one.
///
/// # Errors
/// [`ErrorKind::Invalid`]: not a loopback address; [`ErrorKind::PortTaken`]: the port is.
pub async fn serve(shared: Arc<SharedScene>, listen: SocketAddr) -> Result<Handle> {
    if !listen.ip().is_loopback() {
        let message = format!("Foxglove's protocol has no access token: it cannot be served at {listen}");
        return Err(Error::new(ErrorKind::Invalid, message).hint(
            "use 127.0.0.1, and ssh -L from another \
            computer",
        ));
    }
    let context = Context::new();
    let mut stage = Stage::new(&context, Arc::clone(&shared))?;
    let server = WebSocketServer::new()
        .name("xtb fleet")
        .bind(listen.ip().to_string(), listen.port())
        .message_backlog_size(BACKLOG)
        .context(&context)
        .start()
        .await
        .map_err(|error| cannot_listen(listen, &error))?;
    let address = SocketAddr::new(listen.ip(), server.port());
    let task = tokio::spawn(async move {
        let mut tick = tokio::time::interval(EVERY);
        tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
        loop {
            tick.tick().await;
            stage.show(now_ns());
        }
    });
    Ok(Handle { address, server: Some(server), task })
}

fn cannot_listen(listen: SocketAddr, error: &FoxgloveError) -> Error {
    let failure = Error::new(ErrorKind::PortTaken, format!("cannot serve Foxglove at {listen}: {error}"));
    failure.hint("another program uses this port; choose another one")
}

fn not_made(error: &FoxgloveError) -> Error {
    Error::new(ErrorKind::Failed, format!("cannot create a channel for Foxglove: {error}"))
}

fn now_ns() -> u64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(now.as_nanos()).unwrap_or(u64::MAX)
}

/// What was shown so far.
struct Stage {
    context: Arc<Context>,
    shared: Arc<SharedScene>,
    keys: FleetKeys,
    painter: Painter,
    scene: Arc<RawChannel>,
    log: Arc<RawChannel>,
    poses: BTreeMap<Name, Arc<RawChannel>>,
    there: BTreeSet<Name>,
    /// Boots of the robots whose factsheets were shown.
    cars: BTreeMap<Name, u64>,
    map: Option<(MapHash, u64)>,
    happened: u64,
    rewinds: u64,
}

impl Stage {
    fn new(context: &Arc<Context>, shared: Arc<SharedScene>) -> Result<Self> {
        let keys = FleetKeys::new(shared.lock().fleet().clone());
        Ok(Self {
            context: Arc::clone(context),
            keys,
            painter: Painter::default(),
            scene: channel(context, SCENE_TOPIC, "foxglove.SceneUpdate")?,
            log: channel(context, LOG_TOPIC, "foxglove.Log")?,
            poses: BTreeMap::new(),
            there: BTreeSet::new(),
            cars: BTreeMap::new(),
            map: None,
            happened: 0,
            rewinds: shared.rewinds(),
            shared,
        })
    }

    fn show(&mut self, at_ns: u64) {
        if self.shared.rewinds() != self.rewinds {
            (self.rewinds, self.happened) = (self.shared.rewinds(), 0);
            self.painter.forget();
        }
        let now_ms = self.shared.now_ms();
        let (news, lines) = {
            let shared = Arc::clone(&self.shared);
            let scene = shared.lock();
            (self.news(&scene, now_ms), self.lines(&scene))
        };
        for (key, news) in news {
            if let (AnyMessage::State(state), Some(name)) = (&news, &key.robot) {
                let pose = drawing::pose(at_ns, state);
                self.pose(name, at_ns, &pose);
            }
            if let Some(update) = self.painter.draw(at_ns, &key, &news) {
                say(&self.scene, at_ns, &update);
            }
        }
        for (key, news) in lines {
            if let Some(line) = drawing::log(at_ns, &key, &news) {
                say(&self.log, at_ns, &line);
            }
        }
    }

    /// What is known now, as news; what is stale is none.
    fn news(&mut self, scene: &Scene, now_ms: u64) -> Vec<(Key, AnyMessage)> {
        let key = |robot: Option<&Name>, channel| Key {
            fleet: scene.fleet().clone(),
            robot: robot.cloned(),
            channel,
        };
        let mut news = Vec::new();
        if let Some(map) = scene.map() {
            let sent =
                self.map.is_some_and(|(hash, at_ms)| hash == map.hash && now_ms < at_ms + MAP_EVERY_MS);
            if !sent {
                self.map = Some((map.hash, now_ms));
                news.push((key(None, Channel::Map), map.clone().into()));
            }
        }
        for (name, robot) in scene.robots() {
            if let Some(about) =
                robot.about.as_ref().filter(|about| self.cars.get(name) != Some(&about.epoch))
            {
                self.cars.insert(name.clone(), about.epoch);
                news.push((key(Some(name), Channel::About), AnyMessage::About(Box::new(about.clone()))));
            }
            if let Some(state) = robot.state.as_ref().and_then(|seen| seen.fresh(now_ms)) {
                news.push((key(Some(name), Channel::State), state.clone().into()));
            }
            if let Some(sensors) = robot.sensors.as_ref().and_then(|seen| seen.fresh(now_ms)) {
                news.push((key(Some(name), Channel::Sensors), sensors.clone().into()));
            }
            match robot.alive {
                true => drop(self.there.insert(name.clone())),
                false if self.there.remove(name) => {
                    news.push((key(Some(name), Channel::Alive), AnyMessage::Alive(false)));
                }
                false => {}
            }
        }
        news
    }

    /// What has happened since the last look.
    fn lines(&mut self, scene: &Scene) -> Vec<(Key, AnyMessage)> {
        let fleet = scene.fleet().clone();
        let new = scene.happenings().iter().filter(|it| it.number > self.happened);
        let lines = new.map(|SceneEvent { what, .. }| match what {
            SceneChange::Robot(event) => {
                let robot = Some(event.robot.clone());
                (Key { fleet: fleet.clone(), robot, channel: Channel::Event }, event.clone().into())
            }
            SceneChange::Task(event) => (
                Key { fleet: fleet.clone(), robot: None, channel: Channel::DispatchEvent },
                event.clone().into(),
            ),
            SceneChange::Presence { robot, key, there } => {
                let channel = Key::parse(key).map_or(Channel::Alive, |key| key.channel);
                (Key { fleet: fleet.clone(), robot: robot.clone(), channel }, AnyMessage::Alive(*there))
            }
        });
        let lines: Vec<_> = lines.collect();
        self.happened = scene.happenings().back().map_or(self.happened, |last| last.number);
        lines
    }

    fn pose(&mut self, name: &Name, at_ns: u64, pose: &impl Serialize) {
        if !self.poses.contains_key(name) {
            let topic = format!("{}/pose", self.keys.robot(name).state());
            match channel(&self.context, &topic, "foxglove.PoseInFrame") {
                Ok(made) => drop(self.poses.insert(name.clone(), made)),
                Err(failure) => tracing::warn!("{failure}"),
            }
        }
        if let Some(channel) = self.poses.get(name) {
            say(channel, at_ns, pose);
        }
    }
}

fn channel(context: &Arc<Context>, topic: &str, schema: &str) -> Result<Arc<RawChannel>> {
    let schema = schemas::of(schema).map(|it| Schema::new(it.name.as_str(), "jsonschema", it.text.clone()));
    let made = context.channel_builder(topic).message_encoding("json").schema(schema).build_raw();
    made.map_err(|error| not_made(&error))
}

fn say(channel: &RawChannel, at_ns: u64, message: &impl Serialize) {
    if let Ok(json) = serde_json::to_vec(message) {
        channel.log_with_meta(&json, PartialMetadata { log_time: Some(at_ns) });
    }
}
