//! What a world's file says, as it stands there.

use crate::geometry::OrientedBox;
use serde::Deserialize;
use xtb_control::frames::MapPose;
use xtb_nav::{Map, Zone};
use xtb_protocol::messages::MapPlace;

/// A rectangle with walls around it.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Room {
    /// Centre, east, in m.
    #[serde(default)]
    pub x_m: f64,
    /// Centre, north, in m.
    #[serde(default)]
    pub y_m: f64,
    /// Free width along x, in m.
    pub width_m: f64,
    /// Free depth along y, in m.
    pub depth_m: f64,
}

/// A polyline of straight walls.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// At least two points (x, y), in m.
    pub points: Vec<[f64; 2]>,
    /// In m.
    #[serde(default = "default_thickness_m")]
    pub thickness_m: f64,
}

fn default_thickness_m() -> f64 {
    0.1
}

/// A box on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxSpec {
    /// Centre, east, in m.
    pub x_m: f64,
    /// Centre, north, in m.
    pub y_m: f64,
    /// Along the box's own x axis, in m.
    pub width_m: f64,
    /// Along the box's own y axis, in m.
    pub depth_m: f64,
    /// Turned counter-clockwise by this, in rad.
    pub yaw_rad: f64,
}

impl BoxSpec {
    pub(crate) fn shape(&self) -> OrientedBox {
        OrientedBox::new(self.x_m, self.y_m, self.yaw_rad, self.width_m, self.depth_m)
    }
}

/// A box as the file has it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NamedBox {
    pub(super) name: Option<String>,
    x_m: f64,
    y_m: f64,
    width_m: f64,
    depth_m: f64,
    #[serde(default)]
    yaw_rad: f64,
}

impl NamedBox {
    pub(super) fn new(name: &str, spec: BoxSpec) -> Self {
        let BoxSpec { x_m, y_m, width_m, depth_m, yaw_rad } = spec;
        Self { name: Some(name.to_owned()), x_m, y_m, width_m, depth_m, yaw_rad }
    }

    pub(super) fn nameless(spec: BoxSpec) -> Self {
        Self { name: None, ..Self::new("", spec) }
    }

    pub(super) fn spec(&self) -> BoxSpec {
        let &Self { x_m, y_m, width_m, depth_m, yaw_rad, .. } = self;
        BoxSpec { x_m, y_m, width_m, depth_m, yaw_rad }
    }
}

/// A sloping rectangle of floor.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Centre, east, in m.
    pub x_m: f64,
    /// Centre, north, in m.
    pub y_m: f64,
    /// Along the slope, in m.
    pub length_m: f64,
    /// Across the slope, in m.
    pub width_m: f64,
    /// Steepness in deg, at most 30.
    pub slope_deg: f64,
    /// The direction in which it rises, counter-clockwise from +x, in rad.
    pub uphill_rad: f64,
}

/// The file's layout.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Contents {
    pub(super) name: Option<String>,
    pub(super) room: Option<Room>,
    pub(super) walls: Vec<Wall>,
    pub(super) boxes: Vec<NamedBox>,
    pub(super) ramps: Vec<Ramp>,
    pub(super) starts: Vec<MapPose>,
    pub(super) zones: Vec<Zone>,
    pub(super) places: Vec<MapPlace>,
    pub(super) vehicles: Vec<String>,
    /// What it is made of, if no file of a world says it.
    #[serde(skip)]
    pub(super) map: Option<Map>,
}
