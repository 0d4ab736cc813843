//! What goes to one page and when. Pure: ticks and the page's answers in, messages out.
//!
//! Latest wins: at most [`MOST_OUT`] frames are out that the page has not answered; what happens
//! meanwhile is left out and counted, not queued. The frame after that shows the present.

use super::frames::{Known, Moment, ToPage};
use crate::scene::{AtMs, Scene};
use std::collections::VecDeque;
use xtb_protocol::Name;

/// Frames that may be out without an answer.
pub(super) const MOST_OUT: u64 = 2;
/// Frames whose times are remembered: at 20 Hz more than the setpoints' 300 ms.
const REMEMBERED: usize = 32;

/// One page's stream of frames.
#[derive(Debug, Default)]
pub(super) struct Session {
    known: Known,
    /// Number of the last frame.
    sent: u64,
    seen: u64,
    skipped: u64,
    times: VecDeque<(u64, AtMs)>,
}

impl Session {
    /// The page has this frame.
    pub(super) fn seen(&mut self, n: u64) {
        if n <= self.sent {
            self.seen = self.seen.max(n);
        }
    }

    /// What goes out now; nothing while the page has not answered.
    pub(super) fn tick(&mut self, scene: &Scene, now_ms: AtMs, watch: Option<&Name>) -> Vec<ToPage> {
        if self.sent - self.seen >= MOST_OUT {
            self.skipped += 1;
            return Vec::new();
        }
        self.sent += 1;
        if self.times.len() == REMEMBERED {
            self.times.pop_front();
        }
        self.times.push_back((self.sent, now_ms));
        self.known.news(scene, Moment { n: self.sent, now_ms, skipped: self.skipped }, watch)
    }

    /// Frames left out.
    pub(super) fn skipped(&self) -> u64 {
        self.skipped
    }
}
