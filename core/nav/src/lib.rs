//! The second level of one robot: around things. Many robots are `xtb-traffic`'s.
//!
//! The memorandum ends where a truck stops in front of everything; this library finds the way on.
//! Pure like the rest of `core`: no clock, no file, no socket; the same input gives the same bits.
//!
//! ```text
//!   map ──► planner ──► path ──► follower ──► follow {rpm, steering} ──► first level
//!            ▲  ▲                   ▲
//!   traffic ─┘  └─ local obstacles  └─ pose filter
//! ```

pub mod car;
pub mod clearance;
pub mod filter;
pub mod follower;
pub mod grid;
pub mod local;
pub mod map;
pub mod navigator;
pub mod path;
pub mod planner;
pub mod rect;
pub mod reeds_shepp;
pub mod rooms;
pub mod settings;
pub mod space;

pub use car::Car;
pub use clearance::Clearance;
pub use filter::PoseFilter;
pub use follower::{Drive, Follower, FollowerSettings, Released, Status};
pub use grid::{Cell, Grid};
pub use local::LocalLayer;
pub use map::{Map, Zone, ZoneKind};
pub use path::{Path, Piece};
pub use planner::{Goal, Plan, PlanError, Planner, PlannerSettings};
pub use settings::NavSettings;
pub use space::{GridSpace, Space};
pub use xtb_control::frames::MapPose;
