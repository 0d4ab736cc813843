//! The fleet on file: `record` writes what is said on the keys into MCAP, `play` shows it again, `export`
//! makes tables of it. `docs/fleet-recordings.md` is the contract.
//!
//! ```text
//! listen ─► queue (bounded) ─► Recorder (pure: items in, records out) ─► McapWriter (files) ─► FILE.mcap
//! FILE.mcap ─► Reader ─► Player (pure: what is due) ─► PlaybackWorker (a thread) ─► scene
//! ```
//!
//! The robots' own recordings (`robot-agent --record`) are another thing: every sample and decision of
//! one controller, to be decided again bit for bit.

pub mod drawing;
pub mod mcap_writer;
pub mod playback_worker;
pub mod player;
pub mod reader;
pub mod recorder;
pub mod recorder_worker;
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
