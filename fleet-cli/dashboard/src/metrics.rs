//! What a Prometheus server gets at `/metrics`: the dashboard's own counters, and the fleet as it is at
//! that moment.

use prometheus_client::collector::Collector;
use prometheus_client::encoding::text::encode;
use prometheus_client::encoding::{DescriptorEncoder, EncodeLabelSet, NoLabelSet};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::{SystemTime, UNIX_EPOCH};
use xtb_client::dispatcher_client::fleet_stop;
use xtb_client::scene::live::SharedScene;
use xtb_client::scene::{AtMs, Scene, SceneRobot};
use xtb_client::text::reasons;
use xtb_protocol::Name;
use xtb_protocol::messages::RobotState;

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Reason {
    reason: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Done {
    command: &'static str,
    result: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct OfRobot {
    robot: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Battery {
    robot: String,
    level: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Latched {
    robot: String,
    latch: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct RejectedAs {
    robot: String,
    reason: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct InState {
    state: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Present {
    present: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Service {
    service: &'static str,
}

/// The dashboard's own counters. Clones share them.
#[derive(Debug, Clone)]
pub(super) struct Metrics {
    registry: Arc<Registry>,
    /// Pages that are connected.
    pub(super) sockets: Gauge,
    /// Frames that went out.
    pub(super) sent: Counter,
    /// Frames that were left out because a page had not answered.
    pub(super) skipped: Counter,
    /// Pages that were closed because they took nothing for 5 s.
    pub(super) stalled: Counter,
    /// Messages from pages that could not be read.
    pub(super) malformed: Counter,
    refused: Family<Reason, Counter>,
    commands: Family<Done, Counter>,
}

impl Metrics {
    /// All zero; what is known of the fleet comes from `scene`.
    pub(super) fn new(scene: Arc<SharedScene>) -> Self {
        let mut registry = Registry::with_prefix("xtb");
        let own = registry.sub_registry_with_prefix("dashboard");
        let metrics = Self {
            registry: Arc::default(),
            sockets: Gauge::default(),
            sent: Counter::default(),
            skipped: Counter::default(),
            stalled: Counter::default(),
            malformed: Counter::default(),
            refused: Family::default(),
            commands: Family::default(),
        };
        own.register("sockets", "Pages that are connected", metrics.sockets.clone());
        own.register("frames_sent", "Frames sent to pages", metrics.sent.clone());
        let help = "Frames skipped because a page had not acknowledged earlier ones";
        own.register("frames_skipped", help, metrics.skipped.clone());
        let help = "Pages closed because they read nothing for 5 s";
        own.register("sockets_stalled", help, metrics.stalled.clone());
        let help = "Unreadable messages of pages";
        own.register("messages_malformed", help, metrics.malformed.clone());
        let help =
            "Requests refused: a foreign origin, an unknown host, no token, not signed in, no TLS, no room";
        own.register("requests_refused", help, metrics.refused.clone());
        own.register("commands", "Commands of pages by their result", metrics.commands.clone());
        for reason in ["origin", "host", "token", "sign_in", "guesses", "handshake", "full"] {
            drop(metrics.refused.get_or_create(&Reason { reason }));
        }
        let began: Gauge<f64, AtomicU64> = Gauge::default();
        began.set(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64());
        let help = "Start time of the dashboard, since 1970";
        own.register_with_unit("start_time", help, Unit::Seconds, began);
        registry.register_collector(Box::new(Fleet { scene }));
        Self { registry: Arc::new(registry), ..metrics }
    }

    /// A request was refused.
    pub(super) fn refused(&self, reason: &'static str) {
        self.refused.get_or_create(&Reason { reason }).inc();
    }

    /// A command was answered.
    pub(super) fn answered(&self, command: &'static str, ok: bool) {
        let result = if ok { "ok" } else { "error" };
        self.commands.get_or_create(&Done { command, result }).inc();
    }

    /// Everything as text.
    pub(super) fn text(&self) -> Result<String, fmt::Error> {
        let mut text = String::new();
        encode(&mut text, &self.registry)?;
        Ok(text)
    }
}

/// The fleet, read anew for each scrape.
#[derive(Debug)]
struct Fleet {
    scene: Arc<SharedScene>,
}

impl Collector for Fleet {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let now_ms = self.scene.now_ms();
        // A copy: a slow scrape must not hold up what comes in.
        let scene = self.scene.lock().clone();
        let mut out = Sheet { encoder: &mut encoder };
        out.count("messages_unreadable", "Unreadable messages on the fleet's keys", self.scene.unreadable())?;
        let help = "Messages of other fleets, or of more robots than the dashboard keeps";
        out.count("messages_refused", help, scene.refused())?;
        robots(&mut out, &scene, now_ms)?;
        counters(&mut out, &scene, now_ms)?;
        services(&mut out, &scene)
    }
}

/// One metric after the other.
struct Sheet<'a, 'b> {
    encoder: &'a mut DescriptorEncoder<'b>,
}

impl Sheet<'_, '_> {
    fn count(&mut self, name: &str, help: &str, value: u64) -> fmt::Result {
        self.encoder
            .encode_descriptor(name, help, None, MetricType::Counter)?
            .encode_counter::<NoLabelSet, _, u64>(&value, None)
    }

    fn gauges<L: EncodeLabelSet>(
        &mut self,
        name: &str,
        help: &str,
        unit: Option<Unit>,
        values: impl Iterator<Item = (L, f64)>,
    ) -> fmt::Result {
        let mut metric = self.encoder.encode_descriptor(name, help, unit.as_ref(), MetricType::Gauge)?;
        for (labels, value) in values {
            metric.encode_family(&labels)?.encode_gauge(&value)?;
        }
        Ok(())
    }

    fn counts<L: EncodeLabelSet>(
        &mut self,
        name: &str,
        help: &str,
        values: impl Iterator<Item = (L, u64)>,
    ) -> fmt::Result {
        let mut metric = self.encoder.encode_descriptor(name, help, None, MetricType::Counter)?;
        for (labels, value) in values {
            metric.encode_family(&labels)?.encode_counter::<NoLabelSet, _, u64>(&value, None)?;
        }
        Ok(())
    }
}

fn fresh(scene: &Scene, now_ms: AtMs) -> impl Iterator<Item = (&Name, &RobotState)> {
    let state =
        move |robot: &'_ SceneRobot| robot.state.as_ref().is_some_and(|seen| seen.fresh(now_ms).is_some());
    let robots = scene.robots().iter().filter(move |(_, robot)| state(robot));
    robots.filter_map(|(name, robot)| Some((name, &robot.state.as_ref()?.value)))
}

fn of(name: &Name) -> OfRobot {
    OfRobot { robot: name.to_string() }
}

/// Values of robots that were not heard lately are left out: unknown is not the last known.
fn robots(out: &mut Sheet<'_, '_>, scene: &Scene, now_ms: AtMs) -> fmt::Result {
    let count = |there: bool| scene.robots().values().filter(|robot| robot.alive == there).count() as f64;
    let there = [(Present { present: "true" }, count(true)), (Present { present: "false" }, count(false))];
    out.gauges(
        "fleet_robots",
        "Robots present, and those of the roster that are missing",
        None,
        there.into_iter(),
    )?;
    let ages = scene
        .robots()
        .iter()
        .filter_map(|(name, robot)| Some((of(name), robot.state.as_ref()?.age_ms(now_ms) as f64 / 1000.0)));
    out.gauges("robot_state_age", "Time since the robot's last state", Some(Unit::Seconds), ages)?;
    let speeds = fresh(scene, now_ms).filter_map(|(name, state)| Some((of(name), state.speed_mps?)));
    let unit = Unit::Other("meters_per_second".to_owned());
    out.gauges("robot_speed", "Speed over ground, + = ahead", Some(unit), speeds)?;
    let volts = fresh(scene, now_ms).filter_map(|(name, state)| Some((of(name), state.battery_v?)));
    out.gauges("robot_battery", "Battery voltage", Some(Unit::Volts), volts)?;
    let levels = fresh(scene, now_ms).map(|(name, state)| {
        (Battery { robot: name.to_string(), level: reasons::name(&state.battery_level) }, 1.0)
    });
    out.gauges("robot_battery_level", "1 at the current battery level", None, levels)?;
    let latches = fresh(scene, now_ms).flat_map(|(name, state)| {
        let latched = |latch: String| (Latched { robot: name.to_string(), latch }, 1.0);
        state.latches.iter().map(move |set| latched(set.latch.to_string())).collect::<Vec<_>>()
    });
    out.gauges("robot_latched", "1 for each latched stop", None, latches)
}

fn counters(out: &mut Sheet<'_, '_>, scene: &Scene, now_ms: AtMs) -> fmt::Result {
    let late = fresh(scene, now_ms).map(|(name, state)| (of(name), state.turns_late));
    out.counts("robot_turns_late", "Turns of the control loop that were more than 5 ms late", late)?;
    let dropped = fresh(scene, now_ms).map(|(name, state)| (of(name), state.rejected.events_dropped));
    out.counts("robot_events_dropped", "Events dropped from the robot's full queue", dropped)?;
    let rejected = fresh(scene, now_ms).flat_map(|(name, state)| {
        let counters = match serde_json::to_value(state.rejected) {
            Ok(Value::Object(counters)) => counters,
            _ => serde_json::Map::new(),
        };
        let each = |(reason, count): (String, Value)| {
            Some((RejectedAs { robot: name.to_string(), reason }, count.as_u64()?))
        };
        counters.into_iter().filter_map(each).collect::<Vec<_>>()
    });
    out.counts("robot_rejected", "Messages that the robot refused or dropped since its boot", rejected)
}

fn services(out: &mut Sheet<'_, '_>, scene: &Scene) -> fmt::Result {
    let is = |there: bool| f64::from(u8::from(there));
    let there = [("dispatcher", scene.dispatcher()), ("traffic_control", scene.traffic_control())];
    let there = there.into_iter().map(|(service, there)| (Service { service }, is(there)));
    out.gauges("fleet_service_up", "1 = present", None, there)?;
    if scene.dispatcher() {
        let suspended = is(fleet_stop(scene.suspended()).is_some());
        let help = "1 = suspended after an emergency stop of all robots, until it is activated";
        out.gauges(
            "dispatcher_suspended",
            help,
            None,
            [(Service { service: "dispatcher" }, suspended)].into_iter(),
        )?;
    }
    let mut tasks: BTreeMap<String, f64> = BTreeMap::new();
    let list = scene.tasks().filter(|_| scene.dispatcher());
    for task in list.iter().flat_map(|seen| &seen.value.tasks) {
        *tasks.entry(reasons::name(&task.state)).or_default() += 1.0;
    }
    let tasks = tasks.into_iter().map(|(state, count)| (InState { state }, count));
    out.gauges(
        "fleet_tasks",
        "Tasks of the dispatcher, by state: the open ones and the last 100 that ended",
        None,
        tasks,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::{self, name};
    use xtb_client::messages::AnyMessage;
    use xtb_protocol::keys::Key;
    use xtb_protocol::messages::Latch;

    fn put(shared: &SharedScene, at_ms: AtMs, key: &str, news: impl Into<AnyMessage>) {
        shared.lock().take(at_ms, &Key::parse(key).unwrap(), news.into());
    }

    #[test]
    fn the_fleet_and_the_counters_stand_in_the_text_with_their_units() {
        let shared = Arc::new(SharedScene::new(Scene::new(name("lab"))));
        let mut state = fake::state("xtb-1");
        state.latches = vec![fake::latch(Latch::Estop, "cli-1", false)];
        state.turns_late = 3;
        state.rejected.stale = 5;
        put(&shared, shared.now_ms(), "xtb/lab/xtb-1/state", state);
        put(&shared, 0, "xtb/lab/xtb-1/alive", AnyMessage::Alive(true));
        put(&shared, 0, "xtb/lab/xtb-2/alive", AnyMessage::Alive(false));
        let metrics = Metrics::new(shared);
        metrics.refused("origin");
        metrics.answered("goto", true);
        let text = metrics.text().unwrap();
        for line in [
            "xtb_fleet_robots{present=\"true\"} 1.0",
            "xtb_fleet_robots{present=\"false\"} 1.0",
            "xtb_robot_speed_meters_per_second{robot=\"xtb-1\"} 0.0",
            "xtb_robot_battery_volts{robot=\"xtb-1\"} 7.4",
            "xtb_robot_battery_level{robot=\"xtb-1\",level=\"ok\"} 1.0",
            "xtb_robot_latched{robot=\"xtb-1\",latch=\"estop\"} 1.0",
            "xtb_robot_turns_late_total{robot=\"xtb-1\"} 3",
            "xtb_robot_rejected_total{robot=\"xtb-1\",reason=\"stale\"} 5",
            "xtb_dashboard_requests_refused_total{reason=\"origin\"} 1",
            "xtb_dashboard_requests_refused_total{reason=\"host\"} 0",
            "xtb_dashboard_commands_total{command=\"goto\",result=\"ok\"} 1",
            "xtb_dashboard_frames_skipped_total 0",
            "xtb_messages_unreadable_total 0",
            "# EOF",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
        }
        assert!(text.contains("xtb_dashboard_start_time_seconds 1"), "{text}");
    }

    #[test]
    fn what_a_silent_robot_was_like_is_left_out() {
        let shared = Arc::new(SharedScene::new(Scene::new(name("lab"))));
        put(&shared, 0, "xtb/lab/xtb-1/state", fake::state("xtb-1"));
        let scene = shared.lock().clone();
        assert_eq!(fresh(&scene, 400).count(), 1);
        assert_eq!(fresh(&scene, 10_000).count(), 0);
    }
}
