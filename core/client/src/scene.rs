//! The fleet as screens show it: what `top` and `dashboard` draw, whether it comes from Zenoh
//! ([`live`]) or out of a recording.
//!
//! A state machine without I/O: [`AnyMessage`] and the viewer's clock come in as arguments. The latest of
//! everything is kept with when it came; trails and events are bounded, the oldest go first. What is
//! old is handed out with its age, never as if it were the present.

mod body;
pub mod fold;
pub mod live;

pub use body::{Beam, CarBody};

use crate::client::STALE;
use crate::messages::AnyMessage;
use serde::Serialize;
use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::PI;
use xtb_protocol::Name;
use xtb_protocol::keys::{Channel, FleetKeys, Key};
use xtb_protocol::messages::{
    About, Event, FleetAlerts, FleetMap, FleetPlaces, MAX_ROSTER, MapPlace, RobotState, RosterEntry, Sensors,
    SimStats, Suspension, TaskEvent, TaskList, TaskView, TrafficState,
};

/// Points of a trail; 5 cm apart: 20 m.
pub const TRAIL: usize = 400;
/// A new point of the trail this far from the last.
const TRAIL_STEP_M: f64 = 0.05;
/// Happenings that stay readable.
pub const HAPPENINGS: usize = 200;
/// Robots that a scene holds, as many as a roster; states of further ones are counted and not kept.
pub const MOST_ROBOTS: usize = MAX_ROSTER;

/// A simulator speaks once a second, and not as regularly when it is overloaded.
const SIMULATOR_STALE_MS: u64 = 5000;
/// Simulators of a fleet that a scene tells apart.
const MOST_SIMULATORS: usize = 64;

/// The factsheet's name for the wheels' diameter, in m.
const WHEEL_DIAMETER: &str = "geometry.wheel_diameter_m";

/// The viewer's monotonic clock, in ms.
pub type AtMs = u64;

/// Something and when it came.
#[derive(Debug, Clone, PartialEq)]
pub struct Received<T> {
    /// When.
    pub at_ms: AtMs,
    /// What.
    pub value: T,
}

impl<T> Received<T> {
    fn new(at_ms: AtMs, value: T) -> Self {
        Self { at_ms, value }
    }

    /// Its age at `now_ms`.
    #[must_use]
    pub fn age_ms(&self, now_ms: AtMs) -> u64 {
        now_ms.saturating_sub(self.at_ms)
    }

    /// The value, unless it is older than a state may be ([`STALE`]).
    #[must_use]
    pub fn fresh(&self, now_ms: AtMs) -> Option<&T> {
        (u128::from(self.age_ms(now_ms)) <= STALE.as_millis()).then_some(&self.value)
    }
}

/// One robot.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SceneRobot {
    /// Whether it is present: alive means commandable.
    pub alive: bool,
    /// From the roster; `None` = it is not in the roster, or there is none.
    pub roster: Option<RosterEntry>,
    /// Its last state.
    pub state: Option<Received<RobotState>>,
    /// Its last samples.
    pub sensors: Option<Received<Sensors>>,
    /// Its factsheet.
    pub about: Option<About>,
    /// Its body, from that.
    pub body: CarBody,
    /// Where it has been, (x, y) in m, the newest last; at most [`TRAIL`].
    pub trail: VecDeque<(f64, f64)>,
    /// Points that the trail has had since the robot was first seen: what a viewer has already is not
    /// needed again.
    pub trail_count: u64,
}

impl SceneRobot {
    /// Metres per second at one wheel rpm, by its factsheet; `None` = that has not come.
    #[must_use]
    pub fn mps_per_rpm(&self) -> Option<f64> {
        let about = self.about.as_ref()?;
        let diameter = about.vehicle.iter().find(|info| info.name == WHEEL_DIAMETER)?;
        Some(PI * diameter.value.parse::<f64>().ok()? / 60.0)
    }

    fn show(&mut self, at_ms: AtMs, state: RobotState) {
        let here = (state.pose.x_m, state.pose.y_m);
        let far = |last: &(f64, f64)| (last.0 - here.0).hypot(last.1 - here.1) >= TRAIL_STEP_M;
        if self.trail.back().is_none_or(far) {
            if self.trail.len() == TRAIL {
                self.trail.pop_front();
            }
            self.trail.push_back(here);
            self.trail_count += 1;
        }
        self.state = Some(Received::new(at_ms, state));
    }
}

/// Something that happened, in the order in which it came.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneEvent {
    /// Counts all that have come.
    pub number: u64,
    /// When it came, by the viewer's clock.
    pub at_ms: AtMs,
    /// What.
    pub what: SceneChange,
}

/// Whose change it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SceneChange {
    /// A robot's.
    Robot(Event),
    /// A task's.
    Task(TaskEvent),
    /// Somebody has come or gone.
    Presence {
        /// `None` = the dispatcher or traffic control.
        robot: Option<Name>,
        /// The key of the presence.
        key: String,
        /// Whether it is there now.
        there: bool,
    },
}

/// The whole fleet.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    fleet: Name,
    robots: BTreeMap<Name, SceneRobot>,
    aliases: BTreeMap<Name, String>,
    map: Option<FleetMap>,
    places: Option<FleetPlaces>,
    tasks: Option<Received<TaskList>>,
    alerts: Option<Received<FleetAlerts>>,
    traffic: Option<Received<TrafficState>>,
    /// By the number of their first robot.
    simulators: BTreeMap<Option<u32>, Received<SimStats>>,
    dispatcher: bool,
    traffic_control: bool,
    happenings: VecDeque<SceneEvent>,
    happened: u64,
    refused: u64,
}

impl Scene {
    /// Nothing known yet.
    #[must_use]
    pub fn new(fleet: Name) -> Self {
        Self {
            fleet,
            robots: BTreeMap::new(),
            aliases: BTreeMap::new(),
            map: None,
            places: None,
            tasks: None,
            alerts: None,
            traffic: None,
            simulators: BTreeMap::new(),
            dispatcher: false,
            traffic_control: false,
            happenings: VecDeque::new(),
            happened: 0,
            refused: 0,
        }
    }

    /// Takes in what came on `key` at `at_ms`. Messages of other fleets, and of more than
    /// [`MOST_ROBOTS`], change only the count of what was refused.
    pub fn take(&mut self, at_ms: AtMs, key: &Key, news: AnyMessage) {
        if key.fleet != self.fleet {
            self.refused += 1;
            return;
        }
        match (news, &key.robot) {
            (AnyMessage::State(state), Some(name)) => self.with(name, |robot| robot.show(at_ms, *state)),
            (AnyMessage::Sensors(sensors), Some(name)) => {
                self.with(name, |robot| robot.sensors = Some(Received::new(at_ms, *sensors)));
            }
            (AnyMessage::About(about), Some(name)) => self.with(name, |robot| {
                robot.body = CarBody::of_about(&about);
                robot.about = Some(*about);
            }),
            (AnyMessage::Event(event), Some(_)) => self.happened(at_ms, SceneChange::Robot(*event)),
            (AnyMessage::TaskEvent(event), None) => self.happened(at_ms, SceneChange::Task(*event)),
            (AnyMessage::Alive(there), _) => self.presence(at_ms, key, there),
            (AnyMessage::Roster(roster), None) => {
                roster.robots.into_iter().for_each(|entry| self.expect_also(entry))
            }
            (AnyMessage::Map(map), None) => self.map = Some(*map),
            (AnyMessage::Places(places), None) => self.places = Some(*places),
            (AnyMessage::Tasks(tasks), None) => self.tasks = Some(Received::new(at_ms, *tasks)),
            (AnyMessage::Alerts(alerts), None) => self.alerts = Some(Received::new(at_ms, *alerts)),
            (AnyMessage::Traffic(traffic), None) => self.traffic = Some(Received::new(at_ms, *traffic)),
            (AnyMessage::SimStats(stats), None) => {
                self.simulators.retain(|_, seen| seen.age_ms(at_ms) <= SIMULATOR_STALE_MS);
                if self.simulators.len() < MOST_SIMULATORS || self.simulators.contains_key(&stats.first) {
                    self.simulators.insert(stats.first, Received::new(at_ms, *stats));
                }
            }
            // Commands, setpoints, fixes and routes show in the states that they bring about.
            _ => {}
        }
    }

    /// A robot that should be there, from the roster.
    pub fn expect(&mut self, entry: RosterEntry) {
        let name = entry.name.clone();
        self.with(&name, |robot| robot.roster = Some(entry));
    }

    /// The same from a simulator's roster, which has no tags: those that are known stay.
    fn expect_also(&mut self, mut entry: RosterEntry) {
        let known = self.robots.get(&entry.name).and_then(|robot| robot.roster.as_ref());
        if let Some(known) = known.filter(|_| entry.tags.is_empty()) {
            entry.tags.clone_from(&known.tags);
        }
        self.expect(entry);
    }

    /// What people here call robots; it makes no rows.
    pub fn set_aliases(&mut self, aliases: BTreeMap<Name, String>) {
        self.aliases = aliases;
    }

    /// What people here call this robot.
    #[must_use]
    pub fn alias(&self, robot: &Name) -> Option<&str> {
        self.aliases.get(robot).map(String::as_str)
    }

    fn with(&mut self, name: &Name, change: impl FnOnce(&mut SceneRobot)) {
        if !self.robots.contains_key(name) && self.robots.len() == MOST_ROBOTS {
            self.refused += 1;
            return;
        }
        change(self.robots.entry(name.clone()).or_default());
    }

    fn presence(&mut self, at_ms: AtMs, key: &Key, there: bool) {
        let was = match (&key.channel, &key.robot) {
            (Channel::DispatchAlive, _) => std::mem::replace(&mut self.dispatcher, there),
            (Channel::TrafficAlive, _) => std::mem::replace(&mut self.traffic_control, there),
            (_, Some(name)) => {
                let mut was = there;
                self.with(name, |robot| was = std::mem::replace(&mut robot.alive, there));
                was
            }
            _ => there,
        };
        if was != there {
            let keys = FleetKeys::new(self.fleet.clone());
            let key_text = match (&key.channel, &key.robot) {
                (_, Some(robot)) => keys.robot(robot).alive(),
                (Channel::DispatchAlive, None) => keys.dispatch_alive(),
                _ => keys.traffic_alive(),
            };
            self.happened(at_ms, SceneChange::Presence { robot: key.robot.clone(), key: key_text, there });
        }
    }

    fn happened(&mut self, at_ms: AtMs, what: SceneChange) {
        if self.happenings.len() == HAPPENINGS {
            self.happenings.pop_front();
        }
        self.happened += 1;
        self.happenings.push_back(SceneEvent { number: self.happened, at_ms, what });
    }

    /// Its name.
    #[must_use]
    pub fn fleet(&self) -> &Name {
        &self.fleet
    }

    /// Everybody who is or should be there, by name.
    #[must_use]
    pub fn robots(&self) -> &BTreeMap<Name, SceneRobot> {
        &self.robots
    }

    /// The floor, if anybody serves one.
    #[must_use]
    pub fn map(&self) -> Option<&FleetMap> {
        self.map.as_ref()
    }

    /// The floor's places, if they are of the map that is served.
    #[must_use]
    pub fn places(&self) -> &[MapPlace] {
        let map = self.map.as_ref().map(|map| map.hash);
        self.places.as_ref().filter(|places| Some(places.map) == map).map_or(&[], |places| &places.places)
    }

    /// The dispatcher's tasks.
    #[must_use]
    pub fn tasks(&self) -> Option<&Received<TaskList>> {
        self.tasks.as_ref()
    }

    /// The task that a robot has. Nobody knows without the dispatcher.
    #[must_use]
    pub fn task_of(&self, robot: &Name) -> Option<&TaskView> {
        self.tasks.as_ref().filter(|_| self.dispatcher)?.value.of_robot(robot)
    }

    /// What the dispatcher has suspended. Nobody knows without it.
    #[must_use]
    pub fn suspended(&self) -> &[Suspension] {
        self.tasks.as_ref().filter(|_| self.dispatcher).map_or(&[], |list| &list.value.suspended)
    }

    /// What needs a person. Nobody knows without the dispatcher.
    #[must_use]
    pub fn alerts(&self) -> Option<&FleetAlerts> {
        self.alerts.as_ref().filter(|_| self.dispatcher).map(|alerts| &alerts.value)
    }

    /// What traffic control does.
    #[must_use]
    pub fn traffic(&self) -> Option<&Received<TrafficState>> {
        self.traffic.as_ref()
    }

    /// How the slowest simulator runs, if it is overloaded; what is older than 5 s says nothing any more.
    #[must_use]
    pub fn slow_simulator(&self, now_ms: AtMs) -> Option<SimStats> {
        let heard = self.simulators.values().filter(|seen| seen.age_ms(now_ms) <= SIMULATOR_STALE_MS);
        SimStats::slowest(heard.map(|seen| seen.value)).filter(SimStats::is_slow)
    }

    /// Whether a dispatcher is there.
    #[must_use]
    pub fn dispatcher(&self) -> bool {
        self.dispatcher
    }

    /// Whether traffic control is there.
    #[must_use]
    pub fn traffic_control(&self) -> bool {
        self.traffic_control
    }

    /// The last [`HAPPENINGS`], the newest last.
    #[must_use]
    pub fn happenings(&self) -> &VecDeque<SceneEvent> {
        &self.happenings
    }

    /// Messages that were of another fleet, or of too many robots.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.refused
    }
}

#[cfg(test)]
mod tests;
