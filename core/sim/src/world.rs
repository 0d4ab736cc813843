//! The world: walls, boxes and ramps in a room, and where the robots start.
//!
//! A world comes from a TOML file and is refused with the reason when it is impossible. All
//! positions are in the map's frame (ENU: x east, y north, m; angles counter-clockwise from +x,
//! rad). Everything is optional:
//!
//! ```toml
//! name = "lab"
//! vehicles = ["xtb.toml"]     # of the first robot, the second …: files of vehicle settings, seen from here
//! [room]                      # walls around a rectangle; x_m, y_m is its centre (default 0, 0)
//! width_m = 10.0              # along x
//! depth_m = 14.0              # along y
//! [[walls]]                   # a polyline
//! points = [[-5.0, 2.0], [-1.0, 2.0]]
//! thickness_m = 0.1           # default 0.1
//! [[boxes]]
//! name = "crate"              # only needed to remove it again
//! x_m = 2.0
//! y_m = 3.0
//! width_m = 0.6               # along the box's own x axis
//! depth_m = 0.4
//! yaw_rad = 0.5               # default 0
//! [[ramps]]                   # tilts the truck and slows it a little; no obstacle
//! x_m = 0.0
//! y_m = 4.0
//! length_m = 2.0              # along the slope
//! width_m = 1.0               # across
//! slope_deg = 6.0
//! uphill_rad = 1.57           # where it rises to
//! [[starts]]                  # of the first robot, the second …
//! x_m = 0.0
//! y_m = 0.0
//! yaw_rad = 1.5707963267948966
//! [[zones]]                   # a rule for planners, drawn on the map; nothing that stands there
//! name = "charger"
//! kind = "keep_out"           # or "one_way", with heading_rad
//! points = [[-4.0, -6.0], [-3.0, -6.0], [-3.0, -5.0]]
//! [[places]]                  # where people send robots by name
//! name = "dock-1"
//! kind = "dock"               # or "place" (default), "parking", "waiting"
//! x_m = -4.5
//! y_m = 6.0
//! yaw_rad = 1.57              # on arrival; default: any
//! tags = ["north"]            # default: none
//! ```

mod layout;
mod of_map;

pub use layout::{BoxSpec, Ramp, Room, Wall};

use crate::geometry::{Bounds, OrientedBox};
use crate::lattice::places;
use crate::parameters::{Body, TruckParameters};
use crate::world_error::{WorldError, check};
use layout::{Contents, NamedBox};
use xtb_control::frames::MapPose;
use xtb_nav::Zone;
use xtb_nav::map::check_places;
use xtb_protocol::messages::MapPlace;

/// Farthest coordinate, in m: the same limit as for goals.
const LIMIT_M: f64 = 1000.0;
/// Thinner than this is nothing.
const THINNEST_M: f64 = 0.001;
/// Narrower than this no truck can turn round in.
const SMALLEST_ROOM_M: f64 = 1.0;
/// Of the walls around a room.
const ROOM_WALL_M: f64 = 0.1;
/// Free floor around the contents of a world without a room.
const OPEN_MARGIN_M: f64 = 10.0;
/// Side of the default room.
const DEFAULT_SIDE_M: f64 = 14.0;

/// Something that trucks cannot pass.
pub(crate) struct Solid {
    pub(crate) what: String,
    pub(crate) shape: OrientedBox,
}

/// A world that is possible: every value of this type has passed the checks.
#[derive(Debug, Clone, PartialEq)]
pub struct World(Contents);

impl Default for World {
    /// An empty room of 14 × 14 m, centred on the origin.
    fn default() -> Self {
        Self::square(DEFAULT_SIDE_M)
    }
}

impl World {
    /// An empty square room, centred on the origin, in which `robots` of this size start with 3 m
    /// free ahead; never smaller than the default one, never larger than 1000 m.
    #[must_use]
    pub fn for_robots(robots: usize, body: &Body) -> Self {
        let holds_all = |side_m: f64| {
            let floor = Bounds::around(0.0, 0.0, side_m, side_m);
            places(floor, body).take(robots).count() == robots
        };
        let mut side_m = DEFAULT_SIDE_M;
        while side_m < LIMIT_M && !holds_all(side_m) {
            side_m += 2.0;
        }
        Self::square(side_m)
    }

    /// The same for a truck of each of these kinds.
    #[must_use]
    pub fn for_kinds(kinds: &[TruckParameters]) -> Self {
        Self::for_robots(kinds.len(), &Body::around(kinds.iter().map(|kind| &kind.body)))
    }

    fn square(side_m: f64) -> Self {
        let room = Room { x_m: 0.0, y_m: 0.0, width_m: side_m, depth_m: side_m };
        Self(Contents { room: Some(room), ..Contents::default() })
    }

    /// Reads and checks a world.
    ///
    /// # Errors
    /// What is not TOML of this layout, or impossible: see [`WorldError`].
    pub fn from_toml(text: &str) -> Result<Self, WorldError> {
        let world = Self(toml::from_str(text)?);
        world.check_values()?;
        world.check_names()?;
        world.check_starts(&Body::default())?;
        Ok(world)
    }

    /// The name in the file, if it has one.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.0.name.as_deref()
    }

    /// With this name, unless the file gives one: worlds of different files are different places.
    #[must_use]
    pub fn or_named(mut self, name: &str) -> Self {
        self.0.name.get_or_insert_with(|| name.to_owned());
        self
    }

    /// Start poses that the file gives, in the robots' order.
    #[must_use]
    pub fn starts(&self) -> &[MapPose] {
        &self.0.starts
    }

    /// Names of the vehicle files of the first robot, the second …; robots beyond have none of their own.
    #[must_use]
    pub fn vehicles(&self) -> &[String] {
        &self.0.vehicles
    }

    /// The room, if the world has one.
    #[must_use]
    pub fn room(&self) -> Option<Room> {
        self.0.room
    }

    /// The walls inside and outside of it.
    #[must_use]
    pub fn walls(&self) -> &[Wall] {
        &self.0.walls
    }

    /// The boxes, with their names if they have one.
    pub fn boxes(&self) -> impl Iterator<Item = (Option<&str>, BoxSpec)> {
        self.0.boxes.iter().map(|b| (b.name.as_deref(), b.spec()))
    }

    /// The ramps.
    #[must_use]
    pub fn ramps(&self) -> &[Ramp] {
        &self.0.ramps
    }

    /// The zones of its map.
    #[must_use]
    pub fn zones(&self) -> &[Zone] {
        &self.0.zones
    }

    /// The places of its map.
    #[must_use]
    pub fn places(&self) -> &[MapPlace] {
        &self.0.places
    }

    /// Adds a box, or moves and resizes the one of that name.
    ///
    /// # Errors
    /// A value that is not finite or out of its range.
    pub fn put_box(&mut self, name: &str, spec: BoxSpec) -> Result<(), WorldError> {
        check_box(&format!("box \"{name}\""), &spec)?;
        let named = NamedBox::new(name, spec);
        match self.0.boxes.iter_mut().find(|b| b.name.as_deref() == Some(name)) {
            Some(known) => *known = named,
            None => self.0.boxes.push(named),
        }
        Ok(())
    }

    /// Takes a box away.
    ///
    /// # Errors
    /// [`WorldError::NoSuchBox`].
    pub fn remove_box(&mut self, name: &str) -> Result<(), WorldError> {
        let found = self.0.boxes.iter().position(|b| b.name.as_deref() == Some(name));
        let i = found.ok_or_else(|| WorldError::NoSuchBox { name: name.to_owned() })?;
        self.0.boxes.remove(i);
        Ok(())
    }

    /// The floor that the walls of the room leave, if there is a room.
    pub(crate) fn floor(&self) -> Option<Bounds> {
        self.0.room.map(|room| Bounds::around(room.x_m, room.y_m, room.width_m, room.depth_m))
    }

    /// The part of the plane in which things happen: the room, and everything outside of it; or the map.
    pub(crate) fn extent(&self) -> Bounds {
        if let Some(map) = self.map_bounds() {
            return map;
        }
        let starts = self.0.starts.iter().map(|pose| Bounds::around(pose.x_m, pose.y_m, 0.0, 0.0));
        let contents = self.solids().map(|solid| solid.shape.bounds()).chain(starts);
        match (self.floor(), contents.reduce(Bounds::union)) {
            (Some(room), contents) => contents.map_or(room, |contents| room.union(contents)),
            (None, Some(contents)) => contents.grown(OPEN_MARGIN_M),
            (None, None) => Bounds::around(0.0, 0.0, DEFAULT_SIDE_M, DEFAULT_SIDE_M),
        }
    }

    /// Everything that trucks cannot pass, in the file's order.
    pub(crate) fn solids(&self) -> impl Iterator<Item = Solid> {
        let around = self.floor().into_iter().flat_map(room_walls);
        let walls = self.0.walls.iter().enumerate().flat_map(|(i, wall)| {
            wall.points.windows(2).map(move |ends| Solid {
                what: format!("wall {}", i + 1),
                shape: OrientedBox::wall(ends[0], ends[1], wall.thickness_m),
            })
        });
        let boxes = self.0.boxes.iter().enumerate();
        let boxes = boxes.map(|(i, b)| Solid { what: box_name(i, b), shape: b.spec().shape() });
        around.chain(walls).chain(boxes)
    }

    fn check_values(&self) -> Result<(), WorldError> {
        let place = |item: &str, x_m, y_m| {
            check(item, "x_m", x_m, -LIMIT_M, LIMIT_M)?;
            check(item, "y_m", y_m, -LIMIT_M, LIMIT_M)
        };
        if let Some(room) = &self.0.room {
            place("the room", room.x_m, room.y_m)?;
            check("the room", "width_m", room.width_m, SMALLEST_ROOM_M, LIMIT_M)?;
            check("the room", "depth_m", room.depth_m, SMALLEST_ROOM_M, LIMIT_M)?;
        }
        for (i, wall) in self.0.walls.iter().enumerate() {
            check_wall(&format!("wall {}", i + 1), wall)?;
        }
        for (i, b) in self.0.boxes.iter().enumerate() {
            check_box(&box_name(i, b), &b.spec())?;
        }
        for (i, ramp) in self.0.ramps.iter().enumerate() {
            let item = format!("ramp {}", i + 1);
            place(&item, ramp.x_m, ramp.y_m)?;
            check(&item, "length_m", ramp.length_m, THINNEST_M, LIMIT_M)?;
            check(&item, "width_m", ramp.width_m, THINNEST_M, LIMIT_M)?;
            check(&item, "slope_deg", ramp.slope_deg, 0.0, 30.0)?;
            check(&item, "uphill_rad", ramp.uphill_rad, -10.0, 10.0)?;
        }
        for (i, pose) in self.0.starts.iter().enumerate() {
            let item = format!("start {}", i + 1);
            place(&item, pose.x_m, pose.y_m)?;
            check(&item, "yaw_rad", pose.yaw_rad, -10.0, 10.0)?;
        }
        Ok(())
    }

    fn check_names(&self) -> Result<(), WorldError> {
        let names: Vec<_> = self.0.boxes.iter().filter_map(|b| b.name.as_deref()).collect();
        if let Some(name) = twice(&names) {
            return Err(WorldError::BoxNamedTwice { name });
        }
        let names: Vec<_> = self.0.zones.iter().map(Zone::name).collect();
        if let Some(name) = twice(&names) {
            return Err(WorldError::ZoneNamedTwice { name });
        }
        check_places(&self.0.places).map_err(WorldError::Places)
    }
}

/// The first name that stands there again.
fn twice(names: &[&str]) -> Option<String> {
    let again = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name));
    again.map(|(_, name)| (*name).to_owned())
}

fn box_name(i: usize, b: &NamedBox) -> String {
    b.name.as_ref().map_or_else(|| format!("box {}", i + 1), |name| format!("box \"{name}\""))
}

fn room_walls(room: Bounds) -> [Solid; 4] {
    // The faces, not the middle lines, bound the free floor.
    let middle = room.grown(ROOM_WALL_M / 2.0);
    let (west, south, east, north) = (middle.min_x_m, middle.min_y_m, middle.max_x_m, middle.max_y_m);
    [
        ("west", [west, south], [west, north]),
        ("east", [east, south], [east, north]),
        ("south", [west, south], [east, south]),
        ("north", [west, north], [east, north]),
    ]
    .map(|(side, from, to)| Solid {
        what: format!("the room's {side} wall"),
        shape: OrientedBox::wall(from, to, ROOM_WALL_M),
    })
}

fn check_wall(item: &str, wall: &Wall) -> Result<(), WorldError> {
    check(item, "thickness_m", wall.thickness_m, THINNEST_M, LIMIT_M)?;
    for point in &wall.points {
        check(item, "point", point[0], -LIMIT_M, LIMIT_M)?;
        check(item, "point", point[1], -LIMIT_M, LIMIT_M)?;
    }
    if wall.points.len() < 2 {
        return Err(WorldError::WallTooShort { item: item.to_owned(), points: wall.points.len() });
    }
    for ends in wall.points.windows(2) {
        let length_m = libm::hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
        check(item, "segment length", length_m, THINNEST_M, 4.0 * LIMIT_M)?;
    }
    Ok(())
}

fn check_box(item: &str, spec: &BoxSpec) -> Result<(), WorldError> {
    check(item, "x_m", spec.x_m, -LIMIT_M, LIMIT_M)?;
    check(item, "y_m", spec.y_m, -LIMIT_M, LIMIT_M)?;
    check(item, "width_m", spec.width_m, THINNEST_M, LIMIT_M)?;
    check(item, "depth_m", spec.depth_m, THINNEST_M, LIMIT_M)?;
    check(item, "yaw_rad", spec.yaw_rad, -10.0, 10.0)
}
