//! The step log: every step of the controller, until somebody takes it away to be recorded.
//!
//! Bounded: a turn makes a handful of steps, the recorder takes them after each turn. What finds the
//! log full is counted, never waited for.

use std::collections::VecDeque;
use xtb_control::{Outputs, Sample, Stamp};

/// Steps that wait to be taken: nearly half a second of them (gyro 100, encoder 19, converter 26, receiver 45,
/// commands up to 400 a second).
const CAPACITY: usize = 256;

/// One step of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Its place among all steps since boot.
    pub number: u64,
    /// The sample's stamp.
    pub t: Stamp,
    /// What went in.
    pub sample: Sample,
    /// What came out.
    pub outputs: Outputs,
}

/// Steps of a robot, oldest first.
#[derive(Debug, Clone, Default)]
pub struct StepLog {
    steps: Option<VecDeque<Step>>,
    number: u64,
    dropped: u64,
}

impl StepLog {
    /// Keeps every step from now on.
    pub fn start(&mut self) {
        self.steps = Some(VecDeque::with_capacity(CAPACITY));
    }

    /// A step was made.
    pub fn push(&mut self, t: Stamp, sample: &Sample, outputs: &Outputs) {
        let number = self.number;
        self.number += 1;
        let Some(steps) = &mut self.steps else { return };
        if steps.len() == CAPACITY {
            self.dropped += 1; // the gap in the numbers says where
        } else {
            steps.push_back(Step { number, t, sample: *sample, outputs: *outputs });
        }
    }

    /// The oldest step that nobody has taken.
    pub fn take(&mut self) -> Option<Step> {
        self.steps.as_mut()?.pop_front()
    }

    /// Steps that found the log full.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}
