//! The last steps, so that a late fix can be applied where it was measured.
//!
//! Whole states are kept of every few steps and of each fix; those between follow from the steps, with the same
//! bits. So a step that no fix asks for costs little, also where a thousand robots share one processor's cache.

use super::fix::Measurement;
use super::model::State;
use super::motion_increment::{MotionIncrement, Twist};
use super::tuning::FilterTuning;
use super::{SLIP_MOST_M, SLIP_WALK_M};
use crate::MapPose;
use std::collections::VecDeque;
use xtb_control::units::Stamp;

/// 1 s of gyro readings and encoder windows (120 a second): more than `filter.late_s` may be, 0.6 s, and
/// [`OF_LATE_S`] before.
const LENGTH: usize = 120;
/// A state is kept of so many steps: to be made again, one costs up to as many predictions; chosen, not measured.
const KEPT_EVERY: u64 = 16;
/// The oldest steps go together, up to one of which a state is kept.
const MOST: usize = LENGTH + KEPT_EVERY as usize;
/// The speed of late is the mean of this time: some encoder windows, and about as long as a fix is late, in s.
const OF_LATE_S: f64 = 0.2;

/// What happened to a state beside the prediction of its step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum After {
    Nothing,
    /// The pose is the odometry's.
    Pose(MapPose),
    /// The wheels may have slipped.
    Slip,
}

impl After {
    pub(crate) fn apply(self, state: &mut State, dt_s: f64) {
        match self {
            Self::Nothing => {}
            Self::Pose(pose) => state.set_pose(&pose),
            Self::Slip => state.slip(SLIP_WALK_M, SLIP_MOST_M, dt_s),
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Step {
    stamp: Stamp,
    /// How the truck came here.
    increment: MotionIncrement,
    after: After,
}

/// The state after a step.
#[derive(Debug, Clone, Copy)]
struct Kept {
    number: u64,
    state: State,
    /// What corrected it.
    fix: Option<Measurement>,
}

/// The newest step is now.
#[derive(Debug, Clone)]
pub(crate) struct History {
    steps: VecDeque<Step>,
    /// The number of the oldest step.
    first: u64,
    /// In the order of their numbers; the first is of the oldest step.
    kept: VecDeque<Kept>,
}

impl Default for History {
    fn default() -> Self {
        Self { steps: VecDeque::with_capacity(MOST), first: 0, kept: VecDeque::with_capacity(MOST / 4) }
    }
}

impl History {
    /// Forgets everything before now.
    pub(crate) fn begin(&mut self, now: Stamp, state: &State) {
        self.first += self.steps.len() as u64;
        self.steps.clear();
        self.kept.clear();
        self.kept.push_back(Kept { number: self.first, state: *state, fix: None });
        self.steps.push_back(Step {
            stamp: now,
            increment: MotionIncrement::default(),
            after: After::Nothing,
        });
    }

    /// A step that led to `state`.
    pub(crate) fn push(&mut self, now: Stamp, increment: MotionIncrement, after: After, state: &State) {
        if self.steps.len() == MOST {
            self.kept.pop_front();
            let first = self.kept.front().map_or(self.first, |next| next.number);
            self.steps.drain(..(first - self.first) as usize);
            self.first = first;
        }
        let number = self.first + self.steps.len() as u64;
        if number.is_multiple_of(KEPT_EVERY) {
            self.kept.push_back(Kept { number, state: *state, fix: None });
        }
        self.steps.push_back(Step { stamp: now, increment, after });
    }

    /// The newest step not after `stamp` that has no fix yet.
    pub(crate) fn slot(&self, stamp: Stamp) -> Option<usize> {
        let has_fix = |slot| self.kept_at(slot).is_some_and(|kept| kept.fix.is_some());
        (0..self.steps.len()).rev().find(|&slot| self.steps[slot].stamp <= stamp && !has_fix(slot))
    }

    fn kept_at(&self, slot: usize) -> Option<&Kept> {
        let number = self.first + slot as u64;
        self.kept.binary_search_by_key(&number, |kept| kept.number).ok().map(|place| &self.kept[place])
    }

    /// The state after the step in this slot.
    pub(crate) fn state(&self, slot: usize, tuning: &FilterTuning) -> State {
        let number = self.first + slot as u64;
        let last = self.kept.partition_point(|kept| kept.number <= number) - 1;
        let Kept { number: from, mut state, .. } = self.kept[last];
        for later in from + 1..=number {
            self.step(later).lead(&mut state, tuning);
        }
        state
    }

    fn step(&self, number: u64) -> &Step {
        &self.steps[(number - self.first) as usize]
    }

    /// How the truck went just before this slot.
    pub(crate) fn twist(&self, slot: usize) -> Twist {
        let here = &self.steps[slot];
        let before = (0..slot).rev().map(|slot| &self.steps[slot]);
        let before = before.take_while(|step| here.stamp.since_s(step.stamp) < OF_LATE_S);
        Twist::over(std::iter::once(here).chain(before).map(|step| step.increment))
    }

    /// Puts a fix that made `state` into its slot and predicts again from there: the state now.
    pub(crate) fn insert(
        &mut self,
        slot: usize,
        fix: Measurement,
        mut state: State,
        tuning: &FilterTuning,
    ) -> State {
        let number = self.first + slot as u64;
        let corrected = Kept { number, state, fix: Some(fix) };
        match self.kept.binary_search_by_key(&number, |kept| kept.number) {
            Ok(place) => self.kept[place] = corrected,
            Err(place) => self.kept.insert(place, corrected),
        }
        let mut place = self.kept.partition_point(|kept| kept.number <= number);
        for later in slot + 1..self.steps.len() {
            self.steps[later].after = After::Nothing;
            self.steps[later].lead(&mut state, tuning);
            if self.kept.get(place).is_some_and(|kept| kept.number == self.first + later as u64) {
                if let Some(fix) = self.kept[place].fix {
                    state.correct(&fix, &self.twist(later), tuning.gate);
                }
                self.kept[place].state = state;
                place += 1;
            }
        }
        state
    }
}

impl Step {
    fn lead(&self, state: &mut State, tuning: &FilterTuning) {
        state.predict(&self.increment, tuning);
        self.after.apply(state, self.increment.dt_s);
    }
}
