//! The threads around recordings of the fleet, and what they say to people. The files are `xtb-recording`'s;
//! `docs/fleet-recordings.md` is the contract.
//!
//! ```text
//! listen ─► queue (bounded) ─► RecorderWorker (a thread): Recorder ─► McapWriter ─► FILE.mcap
//! FILE.mcap ─► PlaybackWorker (a thread): Reader, Player ─► scene
//! ```
//!
//! The robots' own recordings (`robot-agent --record`) are another thing: every sample and decision of
//! one controller, to be decided again bit for bit.

pub mod playback_worker;
pub mod recorder_worker;
