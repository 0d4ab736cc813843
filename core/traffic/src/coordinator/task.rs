//! What a search in space and time is asked, and what it answers.

use super::field::Field;
use super::occupancy::Occupancy;
use super::room::RoomGeometry;
use xtb_nav::geometry::rect::Rect;
use xtb_nav::{Car, MapPose, Piece};

/// Expansions for one truck's way; chosen, not measured.
pub(super) const EXPANSIONS_EACH: u32 = 4000;

/// Where to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Target {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) yaw_rad: Option<f64>,
}

/// What a way is looked for.
#[derive(Clone, Copy)]
pub(super) enum Course<'a> {
    ToGoal,
    /// Out of the others' way, by how far that is from anywhere.
    Aside(&'a Field),
    /// The rest of its present way, at other times.
    Along(&'a [Piece]),
}

/// Another truck, and how far to stay away from it in m.
#[derive(Clone, Copy)]
pub(super) struct Other<'a> {
    pub(super) line: &'a Occupancy,
    pub(super) separation_m: f64,
    /// No truck but a thing, which goes nowhere.
    pub(super) is_thing: bool,
}

/// What is asked for.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) room: &'a dyn RoomGeometry,
    pub(super) car: &'a Car,
    pub(super) start: MapPose,
    pub(super) gear: f64,
    /// Tick at which it is at the start.
    pub(super) tick: u32,
    /// `None` = anywhere out of everybody's way.
    pub(super) target: Option<Target>,
    pub(super) field: &'a Field,
    pub(super) others: &'a [Other<'a>],
    /// Places of trucks that have to go away some time.
    pub(super) soft: &'a [Rect],
}

/// One arc and when it is driven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leg {
    pub(super) piece: Piece,
    /// Tick at which it begins.
    pub(super) depart: u32,
    pub(super) ticks: u32,
}

/// Why there is no way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stuck {
    /// Something stands, or will stand, at the goal.
    Goal,
    /// It stands inside of something.
    Start,
    /// All that can be reached has been seen.
    Nowhere,
    /// Not enough expansions.
    Budget,
}
