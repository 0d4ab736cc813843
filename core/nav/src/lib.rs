//! The second level of one robot: around things. Many robots are `xtb-traffic`'s.
//!
//! The memorandum ends where a truck stops in front of everything; this library finds the way on.
//! Pure like the rest of `core`: no clock, no file, no socket; the same input gives the same bits.
//!
//! ```text
//!   map ──► planner ──► path ──► path follower ──► follow {rpm, steering} ──► first level
//!            ▲  ▲                     ▲
//!   traffic ─┘  └─ obstacle layer     └─ localization ◄── odometry, pose fixes
//! ```
//!
//! The modules in the order that a goal passes them, each built on those before it:
//!
//! 1. [`geometry`]: the footprint of a car, paths of exact arcs, Reeds–Shepp curves, distance fields.
//! 2. [`map`]: what stands where for good, and zones with rules. A goal on top of something or in a keep-out is
//!    refused before anything else happens.
//! 3. [`localization`]: where the robot is, how sure that is, and how fast it may drive with it.
//! 4. [`obstacle_layer`]: what the range finders have seen that is not on the map.
//! 5. [`planner`]: a path to the goal through all that, for a car that goes ahead and astern.
//! 6. [`path_follower`]: from the path to steering and speed, a hundred times a second.
//! 7. [`navigator`]: keeps the goal from its beginning to its end: asks for plans, has them followed, looks ahead,
//!    gives way, recovers, and says why it stands.
//!
//! [`settings`] is what a lab may set of them, [`rooms`] where planners are tried.

pub mod geometry;
pub mod localization;
pub mod map;
pub mod navigator;
pub mod obstacle_layer;
pub mod path_follower;
pub mod planner;
pub mod rooms;
pub mod settings;

pub use geometry::{Car, Cell, Clearance, Grid, Path, Piece};
pub use localization::PoseFilter;
pub use map::{Map, Zone, ZoneKind};
pub use obstacle_layer::ObstacleLayer;
pub use path_follower::{DriveCommand, DriveLimits, FollowerSettings, FollowerStatus, PathFollower};
pub use planner::space::{GridSpace, Space};
pub use planner::{Plan, PlanError, Planner, PlannerGoal, PlannerSettings};
pub use settings::NavSettings;
pub use xtb_control::frames::MapPose;
pub use xtb_control::vehicle::Gears;
