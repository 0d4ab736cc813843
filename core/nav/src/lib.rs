//! The second level: around things, and around each other.
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
pub mod grid;
pub mod path;
pub mod reeds_shepp;
pub mod traffic;

pub use car::Car;
pub use grid::{Cell, Grid};
pub use path::{Path, Piece};
pub use xtb_control::frames::MapPose;
