//! What a page gets: the scene, less what this page has already. Pure: scene, time and memory in,
//! messages out.
//!
//! A robot that has not been heard lately keeps its last place, marked as stale; everything else about
//! it is unknown then.

use super::hello::Hello;
use serde::Serialize;
use std::collections::BTreeMap;
use xtb_client::scene::{AtMs, CarBody, Scene, SceneEvent, SceneRobot};
use xtb_client::text::robot as describe;
use xtb_control::Mode;
use xtb_nav::MapPose;
use xtb_nav::geometry::path::Piece;
use xtb_nav::map::places_hash;
use xtb_protocol::Name;
use xtb_protocol::messages::{
    About, BatteryLevel, Fault, FleetAlerts, FleetMap, GoalKind, GoalStatus, Latch, MapContent, MapHash,
    MapPlace, ObstacleView, RobotState, RouteState, Sensors, StopReason, Suspension, SuspensionCause, TaskId,
    TaskList, TiltState, Track,
};

/// Between two points of a path that is drawn, in m.
const PATH_STEP_M: f64 = 0.1;
/// Points of a path at most; a longer one is drawn coarser.
const PATH_POINTS: f64 = 2000.0;

/// A message to the page.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ToPage {
    /// Once, first.
    Hello(Hello),
    /// At first and when it changes.
    Map(Option<Box<FleetMap>>),
    /// Those of the map, when they change.
    Places(Vec<MapPlace>),
    /// What map and places are, for whoever edits them; after each change of either.
    MapContent(MapContent),
    /// The robots.
    Frame(Box<Frame>),
    /// When a new list has come.
    Tasks(Box<TaskList>),
    /// When they have changed; `None` = nobody knows them.
    Alerts(Option<Box<FleetAlerts>>),
    /// New ones.
    Happenings(Vec<SceneEvent>),
    /// To a command.
    Answer(super::commands::Answer),
    /// How teleoperation stands.
    Teleop(super::teleop::Said),
}

/// One picture of the fleet.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Frame {
    /// Counts the frames of this page.
    pub(super) n: u64,
    /// The viewer's clock, which ages and happenings refer to.
    pub(super) now_ms: AtMs,
    /// False: the dashboard has lost its router; nothing comes from robots, and nothing reaches them.
    pub(super) link: bool,
    dispatcher: bool,
    traffic_control: bool,
    /// What the dispatcher has suspended.
    suspended: Vec<Suspended>,
    /// How an overloaded simulator runs, in words; absent while none is.
    #[serde(skip_serializing_if = "Option::is_none")]
    simulator: Option<String>,
    /// Frames that were left out because the page had not answered.
    pub(super) skipped: u64,
    robots: Vec<Row>,
    detail: Option<Detail>,
}

/// What the dispatcher has suspended, in words: as every screen says it.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Suspended {
    text: String,
    remedy: &'static str,
    /// Nothing at all is assigned, until `activate`.
    all: bool,
}

/// One robot, as the map and the table show it.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
struct Row {
    name: String,
    /// What people here call it; absent = nothing else.
    #[serde(skip_serializing_if = "Option::is_none")]
    alias: Option<String>,
    alive: bool,
    age_ms: Option<u64>,
    stale: bool,
    tags: Vec<String>,
    pose: Option<Pose>,
    /// `None` = the page has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    body: Option<CarBody>,
    /// The roster's start pose; `None` = there is none, or the page has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<MapPose>,
    mode: Option<Mode>,
    speed_mps: Option<f64>,
    reference_mps: Option<f64>,
    tilt_deg: Option<TiltState>,
    battery_v: Option<f64>,
    battery_level: Option<BatteryLevel>,
    lease: Option<Name>,
    task: Option<TaskId>,
    goal: Option<Goal>,
    latches: Option<Vec<Latch>>,
    faults: Option<Vec<Fault>>,
    why: Option<Vec<StopReason>>,
    stopped_age_ms: Option<u64>,
    obstacle: Option<ObstacleView>,
    ir_cm: Option<Infrared>,
    path: Option<PathPart>,
    trail: Vec<[f64; 2]>,
    trail_reset: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Pose {
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
    sigma_m: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Goal {
    kind: GoalKind,
    x_m: Option<f64>,
    y_m: Option<f64>,
    yaw_rad: Option<f64>,
    status: GoalStatus,
    distance_m: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Infrared {
    front: Vec<Option<f64>>,
    rear: Vec<Option<f64>>,
}

/// A path, or how far it is driven if the page has its points.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct PathPart {
    /// Tells this page's paths of a robot apart.
    plan: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    points: Option<Vec<[f64; 2]>>,
    done_m: f64,
    release_m: f64,
}

/// Everything about the robot that the page watches.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Detail {
    robot: Name,
    /// `None` = not heard lately.
    state: Option<RobotState>,
    sensors: Option<Sensors>,
    sensors_age_ms: Option<u64>,
    about: Option<About>,
}

/// What a page has already.
#[derive(Debug, Default)]
pub(super) struct Known {
    /// `None` = nothing was said of a map.
    map: Option<Option<MapHash>>,
    /// `None` = nothing was said of them.
    places: Option<Vec<MapPlace>>,
    /// When the list came, and from when it is.
    tasks: Option<(AtMs, u64)>,
    /// As they were sent last.
    alerts: Option<FleetAlerts>,
    /// Number of the last happening.
    happened: u64,
    robots: BTreeMap<Name, KnownRobot>,
}

#[derive(Debug, Default)]
struct KnownRobot {
    trail_count: Option<u64>,
    paths: u64,
    path: Option<Track>,
    body: Option<CarBody>,
    start: Option<MapPose>,
}

/// Which frame it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Moment {
    /// Number of the frame.
    pub(super) n: u64,
    /// The viewer's clock.
    pub(super) now_ms: AtMs,
    /// Frames left out so far.
    pub(super) skipped: u64,
    /// Whether there is a router.
    pub(super) link: bool,
}

impl Known {
    /// What the page lacks now, in the order in which it goes out; the frame comes last.
    pub(super) fn news(&mut self, scene: &Scene, moment: Moment, watch: Option<&Name>) -> Vec<ToPage> {
        let mut news = Vec::new();
        news.extend(self.map(scene));
        news.extend(self.places(scene));
        if let Some(map) = scene.map().filter(|_| !news.is_empty()) {
            let content = MapContent { map: map.hash, places: places_hash(scene.places()) };
            news.push(ToPage::MapContent(content));
        }
        news.extend(self.tasks(scene));
        news.extend(self.alerts(scene));
        news.extend(self.happenings(scene));
        news.push(ToPage::Frame(Box::new(self.frame(scene, moment, watch))));
        news
    }

    fn map(&mut self, scene: &Scene) -> Option<ToPage> {
        let hash = Some(scene.map().map(|map| map.hash));
        (self.map != hash).then(|| {
            self.map = hash;
            ToPage::Map(scene.map().cloned().map(Box::new))
        })
    }

    fn places(&mut self, scene: &Scene) -> Option<ToPage> {
        (self.places.as_deref() != Some(scene.places())).then(|| {
            self.places = Some(scene.places().to_vec());
            ToPage::Places(scene.places().to_vec())
        })
    }

    fn tasks(&mut self, scene: &Scene) -> Option<ToPage> {
        let seen = scene.tasks()?;
        let came = Some((seen.at_ms, seen.value.at_ms));
        (self.tasks != came).then(|| {
            self.tasks = came;
            ToPage::Tasks(Box::new(seen.value.clone()))
        })
    }

    fn alerts(&mut self, scene: &Scene) -> Option<ToPage> {
        let same = match (&self.alerts, scene.alerts()) {
            (Some(known), Some(now)) => known.alerts == now.alerts && known.left_out == now.left_out,
            (None, None) => true,
            _ => false,
        };
        (!same).then(|| {
            self.alerts = scene.alerts().cloned();
            ToPage::Alerts(self.alerts.clone().map(Box::new))
        })
    }

    fn happenings(&mut self, scene: &Scene) -> Option<ToPage> {
        let last = scene.happenings().back().map_or(0, |happening| happening.number);
        if last < self.happened {
            // A recording was wound back.
            self.happened = 0;
        }
        let new = scene.happenings().iter().filter(|happening| happening.number > self.happened);
        let new: Vec<SceneEvent> = new.cloned().collect();
        self.happened = last;
        (!new.is_empty()).then_some(ToPage::Happenings(new))
    }

    fn frame(&mut self, scene: &Scene, moment: Moment, watch: Option<&Name>) -> Frame {
        let Moment { n, now_ms, skipped, link } = moment;
        // The page forgets who is in no frame.
        self.robots.retain(|name, _| scene.robots().contains_key(name));
        let rows = scene.robots().iter().map(|(name, robot)| {
            let task = scene.task_of(name).map(|task| task.id);
            let row = self.robots.entry(name.clone()).or_default().row(name, robot, now_ms, task);
            Row { alias: scene.alias(name).map(str::to_owned), ..row }
        });
        let detail = |name| Some(Detail::of(name, scene.robots().get(name)?, now_ms));
        Frame {
            n,
            now_ms,
            dispatcher: scene.dispatcher(),
            traffic_control: scene.traffic_control(),
            suspended: scene.suspended().iter().map(Suspended::of).collect(),
            simulator: scene.slow_simulator(now_ms).as_ref().map(describe::simulator),
            link,
            skipped,
            robots: rows.collect(),
            detail: watch.and_then(detail),
        }
    }
}

impl KnownRobot {
    fn row(&mut self, name: &Name, robot: &SceneRobot, now_ms: AtMs, task: Option<TaskId>) -> Row {
        let fresh = robot.state.as_ref().and_then(|seen| seen.fresh(now_ms));
        let (trail, trail_reset) = self.trail(robot);
        let row = Row {
            name: name.to_string(),
            alive: robot.alive,
            age_ms: robot.state.as_ref().map(|seen| seen.age_ms(now_ms)),
            stale: fresh.is_none(),
            tags: robot.roster.as_ref().map(|entry| entry.tags.clone()).unwrap_or_default(),
            pose: robot.state.as_ref().map(|seen| Pose::of(&seen.value)),
            body: self.body(robot),
            start: self.start(robot),
            path: self.path(fresh.and_then(|state| state.nav.route.as_ref())),
            trail,
            trail_reset,
            ..Row::default()
        };
        let Some(state) = fresh else { return row };
        let sensors = robot.sensors.as_ref().and_then(|seen| seen.fresh(now_ms));
        Row {
            mode: Some(state.mode),
            speed_mps: state.speed_mps.map(rounded),
            reference_mps: robot.mps_per_rpm().map(|mps| rounded(mps * state.reference_rpm)),
            tilt_deg: Some(TiltState { x: state.tilt_deg.x.map(rounded), y: state.tilt_deg.y.map(rounded) }),
            battery_v: state.battery_v.map(rounded),
            battery_level: Some(state.battery_level),
            lease: state.lease.as_ref().map(|lease| lease.holder.clone()),
            task,
            goal: state.goal.as_ref().map(|goal| Goal {
                kind: goal.kind,
                x_m: goal.x_m,
                y_m: goal.y_m,
                yaw_rad: goal.yaw_rad,
                status: goal.status,
                distance_m: goal.distance_m.map(rounded),
            }),
            latches: Some(state.latches.iter().map(|set| set.latch).collect()),
            faults: Some(state.faults.iter().map(|set| set.fault).collect()),
            why: Some(state.stopped_because.clone()),
            stopped_age_ms: state.stopped_age_ms,
            obstacle: Some(state.obstacle),
            ir_cm: sensors.map(|sensors| {
                let rounded = |side: &[Option<f64>]| side.iter().map(|cm| cm.map(rounded)).collect();
                Infrared { front: rounded(&sensors.ir_front_cm), rear: rounded(&sensors.ir_rear_cm) }
            }),
            ..row
        }
    }

    fn start(&mut self, robot: &SceneRobot) -> Option<MapPose> {
        let start = robot.roster.as_ref().and_then(|entry| entry.start_pose);
        start.filter(|_| std::mem::replace(&mut self.start, start) != start)
    }

    fn body(&mut self, robot: &SceneRobot) -> Option<CarBody> {
        let new = self.body.as_ref() != Some(&robot.body);
        new.then(|| self.body.insert(robot.body.clone()).clone())
    }

    /// Points that the page lacks, and whether it has to drop those that it has.
    fn trail(&mut self, robot: &SceneRobot) -> (Vec<[f64; 2]>, bool) {
        let has = self.trail_count.replace(robot.trail_count);
        let new = has.and_then(|has| robot.trail_count.checked_sub(has));
        let new = new.and_then(|new| usize::try_from(new).ok()).filter(|new| *new <= robot.trail.len());
        let skip = new.map_or(0, |new| robot.trail.len() - new);
        let points = robot.trail.iter().skip(skip).map(|&(x_m, y_m)| [rounded(x_m), rounded(y_m)]);
        (points.collect(), new.is_none())
    }

    fn path(&mut self, route: Option<&RouteState>) -> Option<PathPart> {
        let Some((route, track)) = route.and_then(|route| Some((route, route.track.as_ref()?))) else {
            self.path = None;
            return None;
        };
        let points = (self.path.as_ref() != Some(track)).then(|| {
            self.paths += 1;
            self.path = Some(track.clone());
            points_of(track)
        });
        let (done_m, release_m) = (rounded(route.done_m), rounded(route.release_m));
        Some(PathPart { plan: self.paths, points, done_m, release_m })
    }
}

impl Suspended {
    fn of(suspension: &Suspension) -> Self {
        let all = matches!(suspension.cause, SuspensionCause::FleetStop { .. });
        Self { text: suspension.text(), remedy: suspension.cause.remedy(), all }
    }
}

impl Pose {
    fn of(state: &RobotState) -> Self {
        let pose = &state.pose;
        Self {
            x_m: rounded(pose.x_m),
            y_m: rounded(pose.y_m),
            yaw_rad: rounded(pose.yaw_rad),
            sigma_m: rounded(pose.sigma_m),
        }
    }
}

impl Detail {
    fn of(name: &Name, robot: &SceneRobot, now_ms: AtMs) -> Self {
        let fresh = robot.state.as_ref().and_then(|seen| seen.fresh(now_ms));
        Self {
            robot: name.clone(),
            state: fresh.cloned(),
            sensors: robot.sensors.as_ref().and_then(|seen| seen.fresh(now_ms)).cloned(),
            sensors_age_ms: robot.sensors.as_ref().map(|seen| seen.age_ms(now_ms)),
            about: robot.about.clone(),
        }
    }
}

/// Points along a track.
fn points_of(track: &Track) -> Vec<[f64; 2]> {
    let length_m: f64 = track.arcs.iter().map(|arc| arc.length_m.abs()).sum();
    let step_m = PATH_STEP_M.max(length_m / PATH_POINTS);
    let mut at: MapPose = track.start;
    let mut points = vec![[rounded(at.x_m), rounded(at.y_m)]];
    for arc in &track.arcs {
        let piece = Piece { length_m: arc.length_m, curvature_per_m: arc.curvature_per_m };
        let straight = arc.curvature_per_m == 0.0;
        let steps = if straight { 1.0 } else { (arc.length_m.abs() / step_m).ceil().max(1.0) };
        for step in 1..=steps as u32 {
            let there = piece.after(&at, arc.length_m * f64::from(step) / steps);
            points.push([rounded(there.x_m), rounded(there.y_m)]);
        }
        at = piece.end(&at);
    }
    points
}

/// To a tenth of a millimetre: more digits say nothing, and they are half of a frame's bytes.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests;
