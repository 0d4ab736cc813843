//! Foxglove's well-known messages, as far as we send them, as its own schemas in `schemas/foxglove` have
//! them (<https://docs.foxglove.dev/docs/sdk/schemas>), in JSON.

use serde::Serialize;

/// A point in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Time {
    /// Seconds since 1970.
    pub sec: u32,
    /// And nanoseconds.
    pub nsec: u32,
}

impl Time {
    /// From ns since 1970.
    #[must_use]
    pub fn of_ns(ns: u64) -> Self {
        let sec = u32::try_from(ns / 1_000_000_000).unwrap_or(u32::MAX);
        Self { sec, nsec: (ns % 1_000_000_000) as u32 }
    }
}

/// A length of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Span {
    /// Seconds.
    pub sec: i32,
    /// And nanoseconds.
    pub nsec: u32,
}

/// Three numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Vector3 {
    /// East, or along the first axis, in m.
    pub x: f64,
    /// North, or along the second axis, in m.
    pub y: f64,
    /// Up, in m.
    pub z: f64,
}

/// A point, in m.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Point3 {
    /// East.
    pub x: f64,
    /// North.
    pub y: f64,
    /// Up.
    pub z: f64,
}

/// A turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quaternion {
    /// i.
    pub x: f64,
    /// j.
    pub y: f64,
    /// k.
    pub z: f64,
    /// The real part.
    pub w: f64,
}

/// Where something is and how it is turned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pose {
    /// Where.
    pub position: Vector3,
    /// How.
    pub orientation: Quaternion,
}

impl Pose {
    /// On the floor of the map, or above it.
    #[must_use]
    pub fn flat(x_m: f64, y_m: f64, z_m: f64, yaw_rad: f64) -> Self {
        let half = yaw_rad / 2.0;
        Self {
            position: Vector3 { x: x_m, y: y_m, z: z_m },
            orientation: Quaternion { x: 0.0, y: 0.0, z: half.sin(), w: half.cos() },
        }
    }
}

/// Parts of one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Color {
    /// Red.
    pub r: f64,
    /// Green.
    pub g: f64,
    /// Blue.
    pub b: f64,
    /// How much it covers.
    pub a: f64,
}

/// A pose in a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseInFrame {
    /// When.
    pub timestamp: Time,
    /// In which frame.
    pub frame_id: &'static str,
    /// Where.
    pub pose: Pose,
}

/// A line of a log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Log {
    /// When.
    pub timestamp: Time,
    /// 1 debug, 2 info, 3 warning, 4 error, 5 fatal.
    pub level: u8,
    /// What.
    pub message: String,
    /// Who says so.
    pub name: String,
    /// Unused.
    pub file: String,
    /// Unused.
    pub line: u32,
}

/// Something to know about an entity.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct KeyValuePair {
    /// What.
    pub key: String,
    /// Its value.
    pub value: String,
}

/// An arrow from its tail.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ArrowPrimitive {
    /// Its tail, pointing along +x.
    pub pose: Pose,
    /// In m.
    pub shaft_length: f64,
    /// In m.
    pub shaft_diameter: f64,
    /// In m.
    pub head_length: f64,
    /// In m.
    pub head_diameter: f64,
    /// Its colour.
    pub color: Color,
}

/// A box or an ellipsoid around its centre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SolidPrimitive {
    /// Its centre.
    pub pose: Pose,
    /// Along each axis, in m.
    pub size: Vector3,
    /// Its colour.
    pub color: Color,
}

/// A line through points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LinePrimitive {
    /// 0 from point to point, 1 closed, 2 each two points a line.
    #[serde(rename = "type")]
    pub kind: u8,
    /// Its origin.
    pub pose: Pose,
    /// In m.
    pub thickness: f64,
    /// Whether the thickness is in pixels.
    pub scale_invariant: bool,
    /// Its points.
    pub points: Vec<Point3>,
    /// Its colour, unless each point has one.
    pub color: Color,
    /// Of each point.
    pub colors: Vec<Color>,
    /// Order of the points, if not as they stand.
    pub indices: Vec<u32>,
}

/// A word in the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TextPrimitive {
    /// Its centre.
    pub pose: Pose,
    /// Whether it always faces the viewer.
    pub billboard: bool,
    /// In m.
    pub font_size: f64,
    /// Whether that is in pixels.
    pub scale_invariant: bool,
    /// Its colour.
    pub color: Color,
    /// What it says.
    pub text: String,
}

/// Things that belong together; it replaces the earlier one of the same id.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneEntity {
    /// When.
    pub timestamp: Time,
    /// In which frame.
    pub frame_id: &'static str,
    /// Which.
    pub id: String,
    /// After that it vanishes; 0 = never.
    pub lifetime: Span,
    /// Whether it moves with its frame.
    pub frame_locked: bool,
    /// What else is to be known.
    pub metadata: Vec<KeyValuePair>,
    /// Arrows.
    pub arrows: Vec<ArrowPrimitive>,
    /// Boxes.
    pub cubes: Vec<SolidPrimitive>,
    /// Ellipsoids.
    pub spheres: Vec<SolidPrimitive>,
    /// None of ours, but a part of the type.
    pub cylinders: [(); 0],
    /// Lines.
    pub lines: Vec<LinePrimitive>,
    /// None of ours.
    pub triangles: [(); 0],
    /// Words.
    pub texts: Vec<TextPrimitive>,
    /// None of ours.
    pub models: [(); 0],
}

/// Takes entities away.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneEntityDeletion {
    /// Earlier ones only.
    pub timestamp: Time,
    /// 0 the one of this id, 1 all.
    #[serde(rename = "type")]
    pub kind: u8,
    /// Which.
    pub id: String,
}

/// What has changed in the scene.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SceneUpdate {
    /// What is gone.
    pub deletions: Vec<SceneEntityDeletion>,
    /// What is there.
    pub entities: Vec<SceneEntity>,
}
