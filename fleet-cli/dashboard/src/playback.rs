//! A recording that is played, as the page sees it: how it stands, and what can be asked of it.

use serde::Serialize;

/// How the playing stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaybackPosition {
    /// When the first message came, in ms since 1970.
    pub began_ms: u64,
    /// Played so far.
    pub position_ms: u64,
    /// How long the recording is.
    pub duration_ms: u64,
    /// Times as fast as it was.
    pub speed: f64,
    /// Whether it stands because somebody wants that.
    pub paused: bool,
    /// Whether it is at its end.
    pub ended: bool,
}

/// What plays a recording.
pub trait Playback: Send + Sync {
    /// How it stands.
    fn position(&self) -> PlaybackPosition;
    /// Goes to another place, from the first message, at most to the end.
    fn seek(&self, position_ms: u64);
    /// Stands, or goes on.
    fn pause(&self, paused: bool);
}
