//! A goal under way: which stage it is in, and what has been tried in vain.

use super::following::Following;
use super::replan::PlanFailure;
use super::turn::{HoldReason, TargetPose};
use crate::MapPose;
use xtb_control::Stamp;

/// It waits this long for something unknown to go away, before each further try: the first [`PATIENT_TRIES`]
/// take longer than [`LATELY_MS`], so that what has gone meanwhile does not count any more.
pub(super) const PAUSE_MS: u64 = 5_000;
/// Tries without any way gained before it gives up: half a minute; chosen, not measured.
pub(super) const TRIES: u32 = 6;
/// After so many tries in vain …
const PATIENT_TRIES: u32 = 4;
/// … only obstacles count that were seen within the last so many ms; chosen, not measured.
const LATELY_MS: u64 = 15_000;
/// After a way back it lets the others begin for so long; chosen, not measured.
const AFTER_RETREAT_MS: u64 = 3_000;
const _: () = assert!(PAUSE_MS * PATIENT_TRIES as u64 > LATELY_MS && PATIENT_TRIES < TRIES);

#[derive(Debug, Clone)]
pub(super) enum Stage {
    /// Asks for a path once it stands.
    Seeking { job: Option<(u64, Stamp)> },
    /// Along a path.
    Following(Box<Following>),
    /// Waits before it tries again.
    Pausing { until: Stamp },
    /// The memorandum's avoidance (§4.6): astern while turning.
    Recovering(Recovery),
    /// Its wheels do not turn. It stands until the motor is released, and backs off then.
    Contact { released: bool },
}

/// A way without a path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Recovery {
    pub(super) until: Stamp,
    pub(super) steering: f64,
    pub(super) from: MapPose,
    /// Negative = astern.
    pub(super) way_m: f64,
}

/// What a goal has to do with other robots where nobody coordinates.
#[derive(Debug, Clone, Default)]
pub(super) struct Yielding {
    /// For whom it stands at present.
    pub(super) waits_for: Option<String>,
    /// For whom it makes room: it looks for a way back, or has driven it.
    pub(super) makes_room: Option<String>,
    /// It stands where the other one can pass.
    pub(super) has_made_room: bool,
    pub(super) retreats: u32,
    /// Who was in the way last.
    pub(super) blocked_by: Option<String>,
}

/// A goal under way.
#[derive(Debug, Clone)]
pub(super) struct Task {
    pub(super) target: TargetPose,
    pub(super) stage: Stage,
    /// Plans that found no way since the last progress.
    pub(super) tries: u32,
    /// Paths that came to nothing since the last progress.
    pub(super) lost_paths: u32,
    /// Ways only to look.
    pub(super) vantages: u32,
    /// Paths for this goal.
    pub(super) plans: u32,
    /// What was in the way last.
    pub(super) blocked_at: Option<[f64; 2]>,
    /// In words, for when it gives up.
    pub(super) last_failure: String,
    pub(super) recoveries: u32,
    /// Things touched since the last progress.
    pub(super) contacts: u32,
    /// The last plan found no way out of where it stands.
    pub(super) enclosed: bool,
    pub(super) hold_reason: Option<HoldReason>,
    /// Where traffic control's path began that it got off: only another one will do.
    pub(super) lost_start: Option<MapPose>,
    pub(super) yielding: Yielding,
}

impl Task {
    pub(super) fn new(target: TargetPose) -> Self {
        Self {
            target,
            stage: Stage::Seeking { job: None },
            tries: 0,
            lost_paths: 0,
            vantages: 0,
            plans: 0,
            blocked_at: None,
            last_failure: String::new(),
            recoveries: 0,
            contacts: 0,
            enclosed: false,
            hold_reason: Some(HoldReason::Planning),
            lost_start: None,
            yielding: Yielding::default(),
        }
    }

    /// Whether it stands because of something touched, until the motor is released.
    pub(super) fn in_contact(&self) -> bool {
        matches!(self.stage, Stage::Contact { released: false })
    }

    /// Plans anew, from where it stands; what it touches comes first.
    pub(super) fn seek(&mut self) {
        if !self.in_contact() {
            self.stage = Stage::Seeking { job: None };
        }
    }

    /// Obstacles count that were seen within this time: whoever waits for long believes only what was seen
    /// lately.
    pub(super) fn seen_within_ms(&self) -> u64 {
        if self.tries < PATIENT_TRIES { u64::MAX } else { LATELY_MS }
    }

    /// There is no way at present: another try later, or the end.
    pub(super) fn no_way(&mut self, now: Stamp, failure: PlanFailure) {
        self.tries += 1;
        self.last_failure = failure.words;
        self.enclosed = failure.enclosed;
        if let Some(at) = failure.at {
            self.blocked_at = Some(at);
        }
        self.stage = match failure.for_good {
            true => {
                self.tries = TRIES + 1;
                Stage::Pausing { until: now }
            }
            false => Stage::Pausing { until: now.plus_ms(PAUSE_MS) },
        };
    }

    /// No way past this robot, for now.
    pub(super) fn no_way_past(&mut self, now: Stamp, name: String) {
        let words = format!("blocked by {name}");
        self.no_way(now, PlanFailure { words, at: None, for_good: false, enclosed: false });
        self.yielding.blocked_by = Some(name);
    }

    /// At the end of a way back.
    pub(super) fn has_made_room(&mut self, now: Stamp) {
        self.yielding.has_made_room = true;
        self.stage = Stage::Pausing { until: now.plus_ms(AFTER_RETREAT_MS) };
    }

    /// Why it stands between two tries.
    pub(super) fn pausing(&mut self) -> HoldReason {
        let yielding = &mut self.yielding;
        yielding.waits_for = yielding.makes_room.clone().or_else(|| yielding.blocked_by.clone());
        if yielding.has_made_room { HoldReason::GivingWay } else { HoldReason::WayBlocked }
    }

    /// In words, once it gives up.
    pub(super) fn failure(&self) -> String {
        if let Some(name) = &self.yielding.blocked_by {
            return format!("blocked by {name}");
        }
        match self.blocked_at {
            Some([x_m, y_m]) => format!("blocked near ({x_m:.2}, {y_m:.2}): {}", self.last_failure),
            None => self.last_failure.clone(),
        }
    }
}
