//! Recordings: the one place that writes and reads MCAP, for robots and for whoever listens to a fleet.
//!
//! ```text
//! a robot:   Step ─► StepWriter ────────────┐                           ┌─► Recording ─► RecordedStep ─► replay
//!                                           ├─► FILE.mcap (and -2, …) ──┤
//! the fleet: Item ─► Recorder ─► McapWriter ┘                           └─► Reader ─► Player ─► screens, tables
//! ```
//!
//! * [`robot`]: every sample and every decision of one controller, to be decided again bit for bit
//!   (`docs/recording.md`).
//! * `fleet`, with the feature of that name: what everybody said on the fleet's keys, with pictures of it for
//!   Foxglove (`docs/fleet-recordings.md`).
//! * [`files`]: how a file is read that may have come from anywhere. What is read of an MCAP file is bounded too:
//!   [`Excess`].
//!
//! What both sides share is written once: the end that writes (chunks, topics with their schemas, metadata), the
//! end that reads (record by record, up to the end or to a cut), and JSON Schemas made from the types.
//!
//! Files are read and written here, and nothing else: threads, queues, clocks and the command line are the
//! programs'. How much room a disk has left is asked nowhere: a disk that is full is an [`Error`], and what was
//! written before can be read.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod bounds;
mod error;
pub mod files;
#[cfg(feature = "fleet")]
pub mod fleet;
mod input;
mod output;
pub mod robot;
mod schema;

pub use bounds::Excess;
pub use error::Error;
pub use schema::Schema;
