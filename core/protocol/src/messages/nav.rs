//! The second level on the wire: where a robot is, which way it goes, and how far it may.

use super::state::reported;
use super::{Message, angle, bounded, coordinate, finite};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use xtb_control::frames::MapPose;

/// What measured a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum FixSource {
    /// Cameras on the walls.
    MotionCapture,
    /// A camera on the robot that sees tags.
    Tags,
    /// Ultra-wideband ranging.
    Uwb,
}

/// A measured pose. Anyone who may write to the robot's `fix` key can send one; outliers are gated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Fix {
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Counter-clockwise from +x; `None` = not measured.
    #[serde(default)]
    pub yaw_rad: Option<f64>,
    /// Standard deviation of x and y, in m.
    pub sigma_m: f64,
    /// Standard deviation of the yaw.
    #[serde(default = "sigma_yaw_rad")]
    pub sigma_yaw_rad: f64,
    /// What measured it.
    pub source: FixSource,
    /// How old it was when it was sent.
    #[serde(default)]
    pub age_ms: u64,
}

fn sigma_yaw_rad() -> f64 {
    0.05
}

impl Message for Fix {
    const NAME: &'static str = "Fix";

    fn validate(&self) -> Result<(), CodecError> {
        coordinate("x_m", self.x_m)?;
        coordinate("y_m", self.y_m)?;
        if let Some(yaw_rad) = self.yaw_rad {
            angle("yaw_rad", yaw_rad)?;
        }
        bounded("sigma_m", self.sigma_m, 0.001, 100.0, "m")?;
        bounded("sigma_yaw_rad", self.sigma_yaw_rad, 0.001, 7.0, "rad")
    }
}

/// One arc or straight, driven in one gear.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Arc {
    /// Way of the middle between the axles, in m; negative = astern.
    pub length_m: f64,
    /// + = to the left when driven ahead.
    pub curvature_per_m: f64,
}

/// A path: a start, and arcs from there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Track {
    /// Where it begins.
    pub start: MapPose,
    /// In the order in which they are driven; at most [`Track::MOST_ARCS`].
    pub arcs: Vec<Arc>,
}

impl Track {
    /// Longest track in arcs.
    pub const MOST_ARCS: usize = 256;

    pub(super) fn validate(&self) -> Result<(), CodecError> {
        coordinate("start x_m", self.start.x_m)?;
        coordinate("start y_m", self.start.y_m)?;
        angle("start yaw_rad", self.start.yaw_rad)?;
        bounded("arcs", self.arcs.len() as f64, 0.0, Self::MOST_ARCS as f64, "arcs")?;
        for arc in &self.arcs {
            bounded("length_m", arc.length_m, -1000.0, 1000.0, "m")?;
            bounded("curvature_per_m", arc.curvature_per_m, -50.0, 50.0, "1/m")?;
        }
        Ok(())
    }
}

/// The goal that a route is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RouteGoal {
    /// The robot's boot.
    pub epoch: u64,
    /// The goal's id.
    pub id: Uuid,
}

/// From traffic control to one robot, several times a second: the path, and how far along it.
///
/// It moves nothing by itself: it guides a goal that a lease holder has sent and that still runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Route {
    /// Random at the coordinator's start.
    pub epoch: u64,
    /// Counts its messages to this robot; one that is not above the last is dropped.
    pub seq: u64,
    /// `None` = no path, only a sign of life.
    pub goal: Option<RouteGoal>,
    /// The path from where it was planned; `None` = none yet, stand.
    pub track: Option<Track>,
    /// Counts the coordinator's paths for this robot.
    pub plan: u64,
    /// Released so far along the track, in m: stand there.
    pub release_m: f64,
    /// At most this fast on the released stretch.
    pub cruise_mps: f64,
    /// Who has to pass first at the end of the released stretch.
    pub waits_for: Option<Name>,
    /// Why there is no path, in words.
    #[serde(default, deserialize_with = "text::read_option")]
    pub reason: Option<String>,
    /// Where other robots are, nearest first, at most [`Route::MOST_OTHERS`]: what the range finders see of
    /// them is not unknown.
    pub others: Vec<MapPose>,
}

impl Route {
    /// Most robots that a route tells of.
    pub const MOST_OTHERS: usize = 16;
}

impl Message for Route {
    const NAME: &'static str = "Route";

    fn validate(&self) -> Result<(), CodecError> {
        if let Some(track) = &self.track {
            track.validate()?;
        }
        bounded("others", self.others.len() as f64, 0.0, Self::MOST_OTHERS as f64, "robots")?;
        for other in &self.others {
            coordinate("others x_m", other.x_m)?;
            coordinate("others y_m", other.y_m)?;
            angle("others yaw_rad", other.yaw_rad)?;
        }
        bounded("release_m", self.release_m, 0.0, 1.0e5, "m")?;
        bounded("cruise_mps", self.cruise_mps, 0.0, 2.0, "m/s")
    }
}

/// What traffic control says of itself, twice a second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TrafficState {
    /// Random at its start.
    pub epoch: u64,
    /// Counts the states.
    pub seq: u64,
    /// Its map's hash, in hexadecimal.
    #[serde(deserialize_with = "text::read")]
    pub map_hash: String,
    /// Robots that it leads along paths.
    pub led: Vec<Name>,
    /// Robots that it only drives others around.
    pub obstacles: Vec<Name>,
    /// Joint plans so far.
    pub plans: u64,
}

impl Message for TrafficState {
    const NAME: &'static str = "TrafficState";
}

/// Who made a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum RouteSource {
    /// The robot itself, on its own map.
    Own,
    /// Traffic control.
    Traffic,
}

/// What a planned goal is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum NavPhase {
    /// A path is looked for.
    Planning,
    /// Along the path.
    Following,
    /// Standing on the path: see `stopped_because`.
    Waiting,
    /// The memorandum's avoidance: reversing while turning.
    Recovering,
}

/// The map a robot plans on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MapState {
    /// Its name.
    #[serde(deserialize_with = "text::read")]
    pub name: String,
    /// Its hash, in hexadecimal.
    #[serde(deserialize_with = "text::read")]
    pub hash: String,
    /// The hash of the fleet's map, if another one is published: no planned goals then.
    #[serde(default, deserialize_with = "text::read_option")]
    pub fleet_hash: Option<String>,
}

/// The path of the present goal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RouteState {
    /// Who made it.
    pub source: RouteSource,
    /// Number of the coordinator's plan; 0 for an own one.
    pub plan: u64,
    /// What it is at.
    pub phase: NavPhase,
    /// The path; `None` while there is none.
    pub track: Option<Track>,
    /// Driven along it, in m.
    pub done_m: f64,
    /// Released, in m.
    pub release_m: f64,
    /// Beside the path, in m.
    pub off_m: f64,
    /// Who has to pass first.
    pub waits_for: Option<Name>,
    /// Where something unknown is in its way, (x, y) in m.
    pub blocked_at_m: Option<(f64, f64)>,
    /// Paths planned for this goal.
    pub plans: u32,
}

/// Map and path of a robot.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NavState {
    /// The map; `None` = it has none.
    pub map: Option<MapState>,
    /// Whether traffic control has been heard within the last 3 s.
    pub traffic: bool,
    /// The present planned goal's path.
    pub route: Option<RouteState>,
    /// Fixes that were accepted since boot.
    pub fixes: u64,
}

impl NavState {
    pub(super) fn validate(&self) -> Result<(), CodecError> {
        let Some(route) = &self.route else { return Ok(()) };
        finite("done_m", Some(route.done_m))?;
        finite("release_m", Some(route.release_m))?;
        finite("off_m", Some(route.off_m))?;
        reported("blocked_at_m x", route.blocked_at_m.map(|(x_m, _)| x_m))?;
        reported("blocked_at_m y", route.blocked_at_m.map(|(_, y_m)| y_m))?;
        route.track.as_ref().map_or(Ok(()), Track::validate)
    }
}
