//! What a planner asks of the world: does a car that stands or drives there hit something, and what.
//!
//! A trait, so that the same search plans on a grid, among discs or between cars that move.

mod grid_space;
mod layer;
mod one_way;
mod sweep;

pub use grid_space::{GridLayers, GridSpace, LayersError, LookOut};
pub use one_way::OneWay;

use crate::MapPose;
use crate::geometry::{Car, Piece};
use std::fmt;

/// What stands in the way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Obstruction {
    /// An occupied cell of the map.
    Wall,
    /// A cell nobody has looked at.
    Unknown,
    /// The edge of the map.
    Edge,
    /// A keep-out zone, by name.
    KeepOut(String),
    /// Something that is not on the map.
    Local,
    /// A one-way zone that would be driven against its direction.
    OneWay,
    /// A direction in which the car has no range finder.
    Unseen,
    /// Another car or anything else that another world knows by name.
    Other(String),
}

/// What a car would touch, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Hit {
    /// A point of what it would touch, in m.
    pub x_m: f64,
    /// A point of what it would touch, in m.
    pub y_m: f64,
    /// What it is.
    pub what: Obstruction,
}

impl fmt::Display for Hit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.what {
            Obstruction::Wall => write!(f, "an obstacle on the map")?,
            Obstruction::Unknown => write!(f, "an unknown cell")?,
            Obstruction::Edge => write!(f, "the edge of the map")?,
            Obstruction::KeepOut(name) => write!(f, "keep-out {name}")?,
            Obstruction::Local => write!(f, "an unmapped obstacle")?,
            Obstruction::OneWay => write!(f, "the wrong way of a one-way zone")?,
            Obstruction::Unseen => write!(f, "a way on which the car has no range finder")?,
            Obstruction::Other(name) => write!(f, "{name}")?,
        }
        write!(f, " at ({:.2}, {:.2})", self.x_m, self.y_m)
    }
}

/// South-west and north-east corner, (x, y) in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least x and y.
    pub low_m: [f64; 2],
    /// Greatest x and y.
    pub high_m: [f64; 2],
}

/// A world with one car in it.
pub trait Space {
    /// The car that is meant.
    fn car(&self) -> &Car;

    /// All poses at which the car can stand have their reference point in here.
    fn bounds(&self) -> Bounds;

    /// What the car touches while it stands there; `None` = nothing.
    fn standing(&self, pose: &MapPose) -> Option<Hit>;

    /// Whether it can drive the whole piece without touching anything. May say no where the gap is a
    /// hair's breadth, never yes where there is none.
    fn drives(&self, from: &MapPose, piece: &Piece) -> bool;

    /// [`Space::drives`] for whoever knows sine and cosine of the yaw already.
    fn drives_towards(&self, from: &MapPose, _sin_cos: (f64, f64), piece: &Piece) -> bool {
        self.drives(from, piece)
    }

    /// Whether it can drive all of these pieces, one after the other.
    fn drives_all(&self, from: &MapPose, pieces: &[Piece]) -> bool {
        let mut pose = *from;
        pieces.iter().all(|piece| {
            let free = self.drives(&pose, piece);
            pose = piece.end(&pose);
            free
        })
    }

    /// Whether a quick look leaves open that it can drive all of these pieces, one after the other.
    fn may_drive_all(&self, _from: &MapPose, _pieces: &[Piece]) -> bool {
        true
    }

    /// What keeps it from driving the piece; `None` exactly when [`Space::drives`].
    fn driving(&self, from: &MapPose, piece: &Piece) -> Option<Hit>;

    /// Whether a car that may end in any heading should end in this one.
    fn lets_drive_on(&self, _pose: &MapPose) -> bool {
        true
    }

    /// At least as far is everything from this point, in m.
    fn clearance_m(&self, x_m: f64, y_m: f64) -> f64;

    /// At most as far is the nearest thing from any point within `around_m` of this one, in m.
    fn most_clearance_m(&self, x_m: f64, y_m: f64, around_m: f64) -> f64;
}
