//! The recording of a fleet: what is said on its keys, written, read, shown again and made tables of.
//! `docs/fleet-recordings.md` is the contract.
//!
//! ```text
//! Item ─► Recorder (pure: items in, records out) ─► McapWriter (files) ─► FILE.mcap, FILE-2.mcap …
//! FILE.mcap ─► Reader ─► Player (pure: what is due)
//! ```
//!
//! What is drawn for Foxglove ([`drawing`]) is here as it is part of the file: who records derives poses, scene
//! and log from what is said. The live scene for the Foxglove app draws the same. What is drawn of a robot is its
//! [car](xtb_nav::Car), so that no screen is needed for it.
//!
//! Threads and queues around this are `fleet-cli`'s: `recorder_worker.rs` and `playback_worker.rs`.

pub mod drawing;
pub mod mcap_writer;
pub mod player;
pub mod reader;
pub mod recorder;
pub mod schemas;
pub mod table;
pub mod well_known;

/// Name of the metadata that a file begins with: who recorded what.
pub const BEGAN: &str = "xtb.recording";
/// Name of the metadata that count what was and was not kept; the last of a file holds.
pub const COUNTS: &str = "xtb.recording.counts";
/// What the scene for Foxglove is called.
pub const SCENE_TOPIC: &str = "foxglove/scene";
/// What the log for Foxglove is called.
pub const LOG_TOPIC: &str = "foxglove/log";
