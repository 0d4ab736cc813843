//! The last steps, so that a late fix can be applied where it was measured.

use super::fix::Measurement;
use super::model::State;
use super::motion_increment::{MotionIncrement, Twist};
use super::tuning::FilterTuning;
use crate::MapPose;
use xtb_control::units::Stamp;

/// 1 s of gyro readings and encoder windows (120 a second): more than `filter.late_s` may be, 0.6 s, and
/// [`OF_LATE_S`] before.
const LENGTH: usize = 120;
/// The speed of late is the mean of this time: some encoder windows, and about as long as a fix is late, in s.
const OF_LATE_S: f64 = 0.2;

#[derive(Debug, Clone, Copy)]
struct Entry {
    stamp: Stamp,
    /// How the truck came here.
    increment: MotionIncrement,
    /// What corrected it here.
    fix: Option<Measurement>,
    state: State,
}

/// A ring of steps, the newest of which is now.
#[derive(Debug, Clone)]
pub(crate) struct History {
    /// Always full length, so that nothing is ever allocated again.
    ring: Vec<Entry>,
    oldest: usize,
    length: usize,
}

impl Default for History {
    fn default() -> Self {
        let nowhere = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        let entry = Entry {
            stamp: Stamp::ZERO,
            increment: MotionIncrement::default(),
            fix: None,
            state: State::at(&nowhere, &FilterTuning::default()),
        };
        Self { ring: vec![entry; LENGTH], oldest: 0, length: 0 }
    }
}

impl History {
    /// Forgets everything before now.
    pub(crate) fn begin(&mut self, now: Stamp, state: &State) {
        self.length = 0;
        self.push(now, MotionIncrement::default(), state);
    }

    /// A step that led to `state`.
    pub(crate) fn push(&mut self, now: Stamp, increment: MotionIncrement, state: &State) {
        let place = (self.oldest + self.length) % LENGTH;
        self.ring[place] = Entry { stamp: now, increment, fix: None, state: *state };
        if self.length == LENGTH {
            self.oldest = (self.oldest + 1) % LENGTH;
        } else {
            self.length += 1;
        }
    }

    fn at(&self, slot: usize) -> &Entry {
        &self.ring[(self.oldest + slot) % LENGTH]
    }

    fn at_mut(&mut self, slot: usize) -> &mut Entry {
        &mut self.ring[(self.oldest + slot) % LENGTH]
    }

    /// The newest step not after `stamp` that has no fix yet.
    pub(crate) fn slot(&self, stamp: Stamp) -> Option<usize> {
        (0..self.length).rev().find(|&slot| self.at(slot).stamp <= stamp && self.at(slot).fix.is_none())
    }

    /// The state after the step in this slot.
    pub(crate) fn state(&self, slot: usize) -> &State {
        &self.at(slot).state
    }

    /// How the truck went just before this slot.
    pub(crate) fn twist(&self, slot: usize) -> Twist {
        let here = self.at(slot);
        let before = (0..slot).rev().map(|slot| self.at(slot));
        let before = before.take_while(|entry| here.stamp.since_s(entry.stamp) < OF_LATE_S);
        Twist::over(std::iter::once(here).chain(before).map(|entry| entry.increment))
    }

    /// Puts a fix that made `state` into its slot and predicts again from there: the state now.
    pub(crate) fn insert(
        &mut self,
        slot: usize,
        fix: Measurement,
        mut state: State,
        tuning: &FilterTuning,
    ) -> State {
        let entry = self.at_mut(slot);
        (entry.fix, entry.state) = (Some(fix), state);
        for later in slot + 1..self.length {
            let entry = self.at(later);
            state.predict(&entry.increment, tuning);
            if let Some(fix) = &entry.fix {
                state.correct(fix, &self.twist(later), tuning.gate);
            }
            self.at_mut(later).state = state;
        }
        state
    }
}
