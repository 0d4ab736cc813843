//! Draws the fleet in Foxglove's messages: trucks, goals, paths, what the range finders see, and the
//! walls of the map. Pure: what is said comes in with its time, what is to be drawn comes out.
//!
//! What moves vanishes by itself when nothing new is heard ([`STALE`]): a picture must not look as if a
//! silent robot still stood there.

mod parts;
mod walls;

use super::well_known::{Log, Pose, PoseInFrame, SceneEntity, SceneEntityDeletion, SceneUpdate, Time};
use std::collections::BTreeMap;
use xtb_client::client::STALE;
use xtb_client::messages::AnyMessage;
use xtb_client::scene::{CarBody, MOST_ROBOTS};
use xtb_client::text::reasons;
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{Event, EventKind, PoseState, RobotState, Sensors, TaskEvent};
use xtb_protocol::{Name, Uuid};

/// The frame that everything is in: x east, y north.
pub const FRAME: &str = "map";
/// A truck is drawn at most this often.
const TRUCK_EVERY_NS: u64 = 100_000_000;
/// A path is drawn when it or its release changes, and else this often.
const PATH_EVERY_NS: u64 = 1_000_000_000;

const INFO: u8 = 2;
const WARNING: u8 = 3;
const ERROR: u8 = 4;

/// What of a robot was drawn last.
#[derive(Debug, Clone, PartialEq, Default)]
struct Drawn {
    pose: Option<PoseState>,
    truck_ns: Option<u64>,
    path: Option<(Uuid, u32, u64)>,
    path_ns: u64,
}

/// Remembers what was drawn, so that what stays the same is not drawn again each time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Painter {
    robots: BTreeMap<Name, Drawn>,
    /// What they are, for as long as this paints: said once, true also when all is drawn anew.
    bodies: BTreeMap<Name, CarBody>,
}

impl Painter {
    /// What has changed in the picture, if anything.
    pub fn draw(&mut self, at_ns: u64, key: &Key, news: &AnyMessage) -> Option<SceneUpdate> {
        match (news, &key.robot) {
            (AnyMessage::State(state), Some(name)) => self.truck(at_ns, name, state),
            (AnyMessage::Sensors(sensors), Some(name)) => self.sight(at_ns, name, sensors),
            (AnyMessage::About(about), Some(name)) => {
                if self.bodies.len() < MOST_ROBOTS || self.bodies.contains_key(name) {
                    self.bodies.insert(name.clone(), CarBody::of_about(about));
                }
                None
            }
            (AnyMessage::Map(map), None) => Some(SceneUpdate {
                entities: vec![walls::room(Time::of_ns(at_ns), map)],
                deletions: Vec::new(),
            }),
            (AnyMessage::Alive(false), Some(name)) => Some(self.gone(at_ns, name)),
            _ => None,
        }
    }

    /// Forgets what was drawn: somebody looks who has seen nothing yet.
    pub fn forget(&mut self) {
        self.robots.clear();
    }

    /// An XTB's, of a robot that has not said what car it is.
    fn body(&self, name: &Name) -> CarBody {
        self.bodies.get(name).cloned().unwrap_or_default()
    }

    fn drawn(&mut self, name: &Name) -> Option<&mut Drawn> {
        let room = self.robots.len() < MOST_ROBOTS || self.robots.contains_key(name);
        room.then(|| self.robots.entry(name.clone()).or_default())
    }

    fn truck(&mut self, at_ns: u64, name: &Name, state: &RobotState) -> Option<SceneUpdate> {
        let body = self.body(name);
        let drawn = self.drawn(name)?;
        drawn.pose = Some(state.pose);
        let soon = |last_ns: u64| at_ns.saturating_sub(last_ns) < TRUCK_EVERY_NS;
        if drawn.truck_ns.is_some_and(soon) {
            return None;
        }
        drawn.truck_ns = Some(at_ns);
        let at = Time::of_ns(at_ns);
        let mut update =
            SceneUpdate { deletions: Vec::new(), entities: vec![parts::truck(at, name, &body, state)] };
        let goal = state.goal.as_ref().filter(|goal| !goal.status.is_final());
        let route = state.nav.route.as_ref().filter(|_| goal.is_some());
        let release_mm = |release_m: f64| (release_m * 1000.0).max(0.0) as u64;
        let shown = goal.map(|goal| {
            (goal.id, route.map_or(0, |it| it.plans), route.map_or(0, |it| release_mm(it.release_m)))
        });
        let due = shown.is_some() && at_ns.saturating_sub(drawn.path_ns) >= PATH_EVERY_NS;
        if shown != drawn.path || due {
            match (&goal, shown) {
                (Some(goal), Some(_)) => update.entities.push(parts::way(at, name, goal, route)),
                _ => update.deletions.push(deletion(at, parts::way_id(name))),
            }
            (drawn.path, drawn.path_ns) = (shown, at_ns);
        }
        Some(update)
    }

    fn sight(&mut self, at_ns: u64, name: &Name, sensors: &Sensors) -> Option<SceneUpdate> {
        let body = self.body(name);
        let pose = self.drawn(name)?.pose?;
        let entity = parts::sight(Time::of_ns(at_ns), name, &body, &pose, sensors);
        Some(SceneUpdate { deletions: Vec::new(), entities: vec![entity] })
    }

    fn gone(&mut self, at_ns: u64, name: &Name) -> SceneUpdate {
        self.robots.remove(name);
        let at = Time::of_ns(at_ns);
        let ids = [parts::truck_id(name), parts::way_id(name), parts::sight_id(name)];
        SceneUpdate { deletions: ids.map(|id| deletion(at, id)).into(), entities: Vec::new() }
    }
}

fn deletion(timestamp: Time, id: String) -> SceneEntityDeletion {
    SceneEntityDeletion { timestamp, kind: 0, id }
}

fn entity(timestamp: Time, id: String) -> SceneEntity {
    SceneEntity {
        timestamp,
        frame_id: FRAME,
        id,
        lifetime: super::well_known::Span { sec: 0, nsec: STALE.subsec_nanos() },
        frame_locked: true,
        metadata: Vec::new(),
        arrows: Vec::new(),
        cubes: Vec::new(),
        spheres: Vec::new(),
        cylinders: [],
        lines: Vec::new(),
        triangles: [],
        texts: Vec::new(),
        models: [],
    }
}

/// Where a robot says that it is.
#[must_use]
pub fn pose(at_ns: u64, state: &RobotState) -> PoseInFrame {
    let PoseState { x_m, y_m, yaw_rad, .. } = state.pose;
    PoseInFrame { timestamp: Time::of_ns(at_ns), frame_id: FRAME, pose: Pose::flat(x_m, y_m, 0.0, yaw_rad) }
}

/// A line of the log, if that is something that happened.
#[must_use]
pub fn log(at_ns: u64, key: &Key, news: &AnyMessage) -> Option<Log> {
    let (level, message) = match news {
        AnyMessage::Event(event) => robot_line(event),
        AnyMessage::TaskEvent(event) => task_line(event),
        AnyMessage::Alive(true) => (INFO, "is online".to_owned()),
        AnyMessage::Alive(false) => (WARNING, "is missing".to_owned()),
        AnyMessage::Estop(_) => (ERROR, "emergency stop requested".to_owned()),
        _ => return None,
    };
    let name = match &key.robot {
        Some(name) => name.to_string(),
        None => match key.channel {
            Channel::TrafficAlive => "traffic control".to_owned(),
            Channel::EstopAll(_) => "all robots".to_owned(),
            _ => "dispatcher".to_owned(),
        },
    };
    Some(Log { timestamp: Time::of_ns(at_ns), level, message, name, file: String::new(), line: 0 })
}

fn because(reason: Option<&str>) -> String {
    reason.map_or_else(String::new, |reason| format!(": {reason}"))
}

fn robot_line(event: &Event) -> (u8, String) {
    match &event.kind {
        EventKind::Started { version } => (INFO, format!("agent started, version {version}")),
        EventKind::Mode { from, to } => {
            (INFO, format!("mode {}, was {}", reasons::name(to), reasons::name(from)))
        }
        EventKind::Goal { id, status, reason } => {
            (INFO, format!("goal {id} {}{}", reasons::name(status), because(reason.as_deref())))
        }
        EventKind::Lease { holder: Some(holder) } => (INFO, format!("{holder} has control")),
        EventKind::Lease { holder: None } => (INFO, "no client has control".to_owned()),
        EventKind::Fault { fault, present: true, detail } => {
            (ERROR, format!("fault {fault}{}", because(detail.as_deref())))
        }
        EventKind::Fault { fault, present: false, .. } => (INFO, format!("fault {fault} cleared")),
        EventKind::Latch { latch, set: true, by } => (ERROR, format!("stopped by {by}: {latch} until reset")),
        EventKind::Latch { latch, set: false, by } => (INFO, format!("{latch} reset by {by}")),
    }
}

fn task_line(event: &TaskEvent) -> (u8, String) {
    let TaskEvent { task, step, .. } = event;
    let robot = step.robot.as_ref().map_or_else(String::new, |robot| format!(" on {robot}"));
    let reason = because(step.reason.as_deref());
    (INFO, format!("task {task} {}{robot}{reason}", reasons::name(&step.state)))
}

#[cfg(test)]
mod tests;
